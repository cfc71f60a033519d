"""Reads files that describe a filter: its sampling rate, the range of its samples, and sections one after the other."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field, fields
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Annotated

from strapgen.catalogue.methods.coefficient_files import Source, Title, slug
from strapgen.catalogue.methods.sensor_response import HIGHEST_ORDER, Response
from strapgen.catalogue.toml_models import Key, UserFile, check_kind
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.navigation.filters import sections
from strapgen.navigation.filters.proof import bounds
from strapgen.navigation.filters.sections import LOWEST_EDGE, Cascade, Prototype, Root, Section

#: The keys of each kind of section: those that it needs, and those that it may have.
KINDS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "lag": ((), ("frequency_hz", "time_constant_s")),
    "lead-lag": (("frequency_hz", "gain_db"), ("order", "damping")),
    "notch": (("frequency_hz", "width_hz", "depth_db"), ()),
    "butterworth": (("frequency_hz", "order"), ()),
    "bessel": (("frequency_hz", "order"), ()),
    "second-order": (("frequency_hz", "damping"), ()),
    "poles": (("poles",), ("zeros", "gain")),
}
#: Most sections of a filter, each of them of at most this order.
_MOST_SECTIONS, _MOST_ROOTS = 8, 16
_TWO_PI = Fraction(710, 113)


@dataclass(frozen=True)
class SectionFile:
    """A part of a filter."""

    kind: Annotated[str, Key("Kind of the section", choices=tuple(KINDS))]
    frequency_hz: Annotated[
        Fraction | None,
        Key("Corner, centre of a notch, or the mean of the frequencies of pole and zero", "Hz", above=0),
    ] = None
    time_constant_s: Annotated[
        Fraction | None, Key("Time constant of a lag, in place of its frequency", "s", above=0)
    ] = None
    order: Annotated[int | None, Key("Order; of a lead-lag 1 or 2", "1", least=1, most=HIGHEST_ORDER)] = None
    damping: Annotated[Fraction | None, Key("Damping ratio of second order", "1", above=0, most=100)] = None
    gain_db: Annotated[
        Fraction | None,
        Key("Gain of fast changes: above 0 of a lead, below of a lag", "dB", least=-120, most=120),
    ] = None
    width_hz: Annotated[
        Fraction | None,
        Key("Width of a notch, where the power is the mean of that at the centre and outside", "Hz", above=0),
    ] = None
    depth_db: Annotated[Fraction | None, Key("Depth of a notch", "dB", above=0, most=120)] = None
    poles: Annotated[
        tuple[Root, ...],
        Key("Real and imaginary parts; one above 0 stands for both signs", least=1, most=_MOST_ROOTS),
    ] = ()
    zeros: Annotated[
        tuple[Root, ...], Key("Real and imaginary parts of zeros, as of the poles", most=_MOST_ROOTS)
    ] = ()
    gain: Annotated[Fraction | None, Key("Factor of the zeros over the poles, 1 by default", "1")] = None

    def __post_init__(self) -> None:
        check_kind(self, "a section", KINDS)
        if self.kind == "lag" and (self.frequency_hz is None) == (self.time_constant_s is None):
            raise InputError("a lag has one of frequency_hz and time_constant_s")
        if self.kind == "lead-lag" and (self.order or 1) > 2:
            raise InputError(f"order is {self.order}; 1 or 2 is needed for a lead-lag")
        if self.kind == "lead-lag" and self.damping is not None and self.order != 2:
            raise InputError("damping goes with a lead-lag of order 2")
        for name in ("poles", "zeros"):
            for real, imaginary in getattr(self, name):
                if imaginary < 0:
                    raise InputError(
                        f"{name} has [{float(real):g}, {float(imaginary):g}]; an imaginary part of at least 0 is needed"
                    )

    def designs(self, sample_hz: Fraction) -> list[Prototype]:
        """Return the sections of first and second order for a sampling frequency in Hz."""
        hertz = self.frequency_hz
        if self.time_constant_s is not None:
            hertz = 1 / (_TWO_PI * self.time_constant_s)
        for name, value in {"frequency_hz": hertz, "width_hz": self.width_hz}.items():
            low, high = LOWEST_EDGE * sample_hz, sample_hz / 2
            if value is not None and not low <= value < high:
                raise InputError(
                    f"{name} is {float(value):g}; from {float(low):g} to below {float(high):g} is needed at "
                    f"{float(sample_hz):g} samples in a second"
                )
        if hertz is None:
            gain = Fraction(1) if self.gain is None else self.gain
            return sections.poles_and_zeros(self.poles, self.zeros, gain, sample_hz)
        if self.kind == "lag":
            return [Prototype(float(hertz), sections.warped(hertz, sample_hz))]
        if self.kind == "notch":
            assert self.width_hz is not None and self.depth_db is not None, "a notch has them"
            return [sections.notch(hertz, self.width_hz, sections.ratio(-self.depth_db), sample_hz)]
        if self.kind == "lead-lag":
            assert self.gain_db is not None, "a lead-lag has it"
            gain, damping = sections.ratio(self.gain_db), self.damping or Fraction(1)
            return [sections.lead_lag(self.order or 1, hertz, gain, damping, sample_hz)]
        response = Response(self.kind, self.order, hertz, self.damping)
        return sections.low_pass(response, sample_hz)


@dataclass(frozen=True)
class Filter(Cascade):
    """A filter as a file describes it."""

    #: Name in that of the kernel, name in the file, where it comes from
    name: str
    title: str
    source: str
    sample_hz: Fraction
    #: Largest magnitude of a sample
    range: Fraction
    unit: str
    designs: tuple[Prototype, ...]
    #: Path of the file
    file: str = field(default="", compare=False, repr=False)

    @property
    def sections(self) -> tuple[Section, ...]:
        """The sections with rounded coefficients."""
        return rounded(self.designs)

    @property
    def heading(self) -> str:
        """The filter in words."""
        return f"{self.title}, {float(self.sample_hz):g} samples in a second"

    @property
    def coefficients(self) -> dict[str, float]:
        """The coefficients of the sections, by their names in `Section`."""
        return {
            f"{part.name}{suffix}": float(value)
            for suffix, one in self.numbered
            for part in fields(one)
            if (value := getattr(one, part.name)) is not None
            and (one.loss is not None or part.name in ("square", "high", "low"))
        }

    @property
    def option(self) -> str:
        """The option that chooses it on the command line."""
        return f"--filter {shlex.quote(self.file)}"


@cache
def rounded(designs: tuple[Prototype, ...]) -> tuple[Section, ...]:
    """Return the sections of designs with rounded coefficients, all stable."""
    found = tuple(map(Section.of, designs))
    for one in found:
        one.require_stable()
    return found


@dataclass(frozen=True)
class FilterFile:
    """A filter of signals: sections one after the other, each on the output of the one before."""

    name: Title
    source: Source
    sample_hz: Annotated[Fraction, Key("Samples in a second", "Hz", above=0, most=1e9)]
    section: Annotated[
        tuple[SectionFile, ...], Key("The sections, one after the other", least=1, most=_MOST_SECTIONS)
    ]
    range: Annotated[Fraction, Key("Largest magnitude of a sample, in its unit", above=0, most=1e9)] = (
        Fraction(1)
    )
    unit: Annotated[str, Key("Unit of the samples", pattern=r"\S{1,20}", form="a unit without spaces")] = (
        "any"
    )


FILTER = UserFile("a filter", FilterFile, 50_000)


def read(path: str | Path) -> Filter:
    """Read a filter from a file and check that it is stable."""

    def described(file: FilterFile) -> Filter:
        designs: list[Prototype] = []
        for number, one in enumerate(file.section, 1):
            try:
                designs += one.designs(file.sample_hz)
            except InputError as error:
                raise InputError(f"section[{number}]: {error}") from None
        place = checks.text("the name of the file", str(path))
        name, unit = slug(file.name), file.unit
        found = Filter(name, file.name, file.source, file.sample_hz, file.range, unit, tuple(designs), place)
        bounds(found.sections)  # refuses a filter that settles too slowly
        return found

    return FILTER.convert(path, described)
