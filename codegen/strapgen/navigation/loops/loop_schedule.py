"""The schedule of the loops of an attitude and heading reference: its modes, their time constants, and its switches."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Annotated

from strapgen.catalogue.toml_models import Key, UserFile
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

#: References that each loop can have.
REFERENCES = {
    "level": ("zero", "air-data"),
    "erection": ("zero",),
    "heading": ("magnetic", "open"),
    "vertical": ("air-data", "zero"),
}
#: When a mode holds: in its turn, without air data for some time, or when it is selected.
CONDITIONS = ("sequence", "no-air-data", "selected")
KNOT = Fraction(1852, 3600)
#: The schedule of the source, as far as it is printed.
BUILT_IN = Path(__file__).parent / "ltr81.toml"


@dataclass(frozen=True)
class LoopSetting:
    """The settings of a loop in a mode."""

    #: "level", "erection", "heading" or "vertical"
    loop: str
    #: One of `REFERENCES`; "open" has no time constant
    reference: str
    time_constant_s: Fraction | None
    #: None for the usual one
    order: int | None = None

    def __post_init__(self) -> None:
        checks.choice("loop", self.loop, REFERENCES)
        checks.choice(f"reference of the {self.loop} loop", self.reference, REFERENCES[self.loop])
        if self.reference == "open":
            if self.time_constant_s is not None or self.order is not None:
                raise InputError(f"the {self.loop} loop is open; tau_s and order have no place there")
        elif self.time_constant_s is None or self.time_constant_s <= 0:
            raise InputError(f"the {self.loop} loop has no tau_s above 0")


@dataclass(frozen=True)
class LoopTable:
    """A loop as a file states it; without them its order is the usual one, its reference the first of `REFERENCES`."""

    tau_s: Annotated[
        Fraction | None, Key("Time constant; none for an open loop", "s", least=1e-3, most=10**6)
    ] = None
    order: Annotated[int | None, Key("Order of the loop", choices=(2, 3))] = None
    reference: Annotated[
        str, Key("Reference of the loop", choices=sorted(set(sum(REFERENCES.values(), ()))))
    ] = ""


@dataclass(frozen=True)
class LoopMode:
    """A mode of the schedule."""

    heading: Annotated[LoopTable, Key("Loop of the heading")]
    vertical: Annotated[LoopTable, Key("Loop of the vertical channel")]
    level: Annotated[LoopTable | None, Key("Loop of levelling")] = None
    erection: Annotated[LoopTable | None, Key("Loop of erection, in place of levelling")] = None
    name: Annotated[str, Key("Name; by default its number")] = ""
    duration_s: Annotated[Fraction | None, Key("Duration; none for a mode without an end", "s", above=0)] = (
        None
    )
    when: Annotated[str, Key("When the mode is active", choices=CONDITIONS)] = "sequence"
    after_s: Annotated[Fraction, Key("Time without air data after which it is active", "s", least=0)] = (
        Fraction(0)
    )
    #: Levelling or erection, heading and vertical
    loops: tuple[LoopSetting, ...] = field(init=False)

    def __post_init__(self) -> None:
        if (self.level is None) == (self.erection is None):
            raise InputError("either level or erection is needed")
        tables = {name: getattr(self, name) for name in REFERENCES}
        settings = [
            LoopSetting(name, table.reference or REFERENCES[name][0], table.tau_s, table.order)
            for name, table in tables.items()
            if table is not None
        ]
        object.__setattr__(self, "loops", tuple(settings))

    def loop(self, name: str) -> LoopSetting:
        """Return the setting of the loop "level", which may be that of erection, "heading" or "vertical"."""
        return self.loops[("level", "heading", "vertical").index(name)]


@dataclass(frozen=True)
class LoopSchedule:
    """The modes of a reference system, and its switches."""

    #: Only the last of those in sequence may have no end
    modes: Annotated[tuple[LoopMode, ...], Key("The modes", least=1, most=50, name="mode")]
    cycle_s: Annotated[Fraction, Key("Cycle of the loops", "s", least=1e-5, most=1000)]
    gravity: Annotated[Fraction, Key("Gravity", "m/s^2", least=1e-3, most=1000)]
    radius: Annotated[Fraction, Key("Radius of the earth", "m", least=1000, most=10**10, name="radius_m")]
    title: Annotated[str, Key("Title in tables")] = ""
    heading_cutout_deg_s: Annotated[
        Fraction | None, Key("Rate about down above which the heading loop is open", "deg/s", above=0)
    ] = None
    air_data_on_m_s: Annotated[
        Fraction, Key("True airspeed above which it becomes the reference of levelling", "m/s", above=0)
    ] = 110 * KNOT
    air_data_off_m_s: Annotated[
        Fraction, Key("True airspeed below which it ceases to be", "m/s", above=0)
    ] = 100 * KNOT

    def __post_init__(self) -> None:
        named = [replace(one, name=one.name or f"mode {number}") for number, one in enumerate(self.modes, 1)]
        object.__setattr__(self, "modes", tuple(named))
        if not self.sequence:
            raise InputError("the schedule has no mode in sequence")
        for mode in self.sequence[:-1]:
            if mode.duration_s is None:
                raise InputError(
                    f"mode {mode.name} has no duration_s; only the last in sequence may have none"
                )
        if len({mode.name for mode in self.modes}) < len(self.modes):
            raise InputError("two modes of the schedule have the same name")
        if self.air_data_off_m_s > self.air_data_on_m_s:
            raise InputError(
                f"air_data_off_m_s is {float(self.air_data_off_m_s):g}; at most air_data_on_m_s, "
                f"{float(self.air_data_on_m_s):g}, is allowed"
            )

    @property
    def sequence(self) -> tuple[LoopMode, ...]:
        """The modes that follow each other."""
        return tuple(mode for mode in self.modes if mode.when == "sequence")

    def timed(self, last_s: Fraction) -> tuple[LoopMode, ...]:
        """Return the modes in sequence, the last of which ends after a time if it has no end; zero leaves it out."""
        modes = list(self.sequence)
        if modes[-1].duration_s is None:
            modes[-1:] = [replace(modes[-1], duration_s=last_s)] if last_s else []
        return tuple(modes)

    def mode(
        self, time_s: Fraction, without_air_data_s: Fraction = Fraction(0), selected: str = ""
    ) -> LoopMode:
        """Return the mode that holds."""
        if selected:
            names = {mode.name: mode for mode in self.modes if mode.when == "selected"}
            return names[checks.choice("selected mode", selected, names)]
        for mode in self.sequence:
            if mode.duration_s is not None and time_s < mode.duration_s:
                return mode
            time_s -= mode.duration_s or Fraction(0)
        lost = [
            mode for mode in self.modes if mode.when == "no-air-data" and without_air_data_s > mode.after_s
        ]
        return lost[-1] if lost else self.sequence[-1]

    def heading_is_open(self, mode: LoopMode, rate_deg_s: float) -> bool:
        """Whether the heading loop is open: in a mode that has it so, and at a rate above the cut-out."""
        limit = self.heading_cutout_deg_s
        return mode.loop("heading").reference == "open" or (limit is not None and abs(rate_deg_s) > limit)

    def air_data_engaged(self, engaged: bool, airspeed_m_s: float) -> bool:
        """Return whether true airspeed is the reference of levelling, with hysteresis."""
        return airspeed_m_s > (self.air_data_off_m_s if engaged else self.air_data_on_m_s)


SCHEDULE = UserFile("a schedule", LoopSchedule, 1 << 16)


def read(path: str | Path = BUILT_IN) -> LoopSchedule:
    """Read a schedule.

    >>> [mode.name for mode in read().sequence]
    ['fast', 'fine', 'normal']
    """
    return SCHEDULE.read(path)


def total_s(modes: Iterable[LoopMode]) -> Fraction:
    """Return the duration of modes with an end in s."""
    return sum((mode.duration_s or Fraction(0) for mode in modes), Fraction(0))
