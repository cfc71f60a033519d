"""`Settings` are the settings of fixed point that a user states: word, largest increment, rounding, error feedback."""

from __future__ import annotations

import inspect
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, NamedTuple, TypedDict, TypeVar, Unpack

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.formats import (
    MULTIPLICATIONS,
    SHORTEST_WORD,
    WORDS_OF_HIGH_PRODUCTS,
    Format,
    check_rounding,
    check_word,
)
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.read_only import ReadOnly
from strapgen.ir.units import DEFAULT_BITS, Sensor

#: Rounding errors that are fed back from step to step.
CARRIES = {
    "none": "nothing",
    "state": "the rounding of the state",
    "full": "the rounding of the state and of the transition",
    "all": "that, and the rounding of every other value that is handed on and of every increment that goes out",
}

#: The order in which targets in floating point add, and what that is in words.
SUMS = {
    "canonical": "one term after the other, as the formulas stand",
    "tree": "as balanced trees, in other bits",
}

#: Formats of the state that hold no magnitude of 1, as CMSIS has them, with the word that each goes with.
STATES = {"q15": 16, "q31": 32, "q63": 64}

#: Largest angle increment for which formats are chosen when none is stated, in rad.
DEFAULT_ANGLE = Fraction(1, 8)
#: Increments that formats are chosen for, in rad: from the earth's rate in a microsecond to over half a turn.
SMALLEST_ANGLE, LARGEST_ANGLE = Fraction(1, 10**11), 4
DEFAULT_ALLOWANCE = Fraction(1, 16)
#: Most increments of a step.
_MOST_INCREMENTS = 8
#: Names of the input of a step with its rates at nodes, each times the step; the second one is the name before.
NODE_ROTATIONS = ("node_rotations", "turns")
#: Names of the inputs that the largest angle bounds.
ROTATION_INPUTS = ("increments", *NODE_ROTATIONS)

#: A rational above pi/180, by less than 1e-18.
_DEGREE = Fraction(math.ceil(Fraction(3141592653589793239, 180) * 10**3), 10**21)
#: Stated limits are rounded up to whole multiples of this.
_LIMIT_UNIT = 1 << 60


#: A number: decimals and fractions as text are exact.
Number = float | str | Fraction
F = TypeVar("F", bound=Callable[..., Any])


class StatedSettings(TypedDict, total=False):
    """The keywords of `Settings.of`."""

    word: int
    max_rate_deg_s: Number | None
    step: Number | None
    sample_hz: Number | None
    increments: int | None
    largest_angle: Number | None
    lsb: str | None
    input_bits: int | None
    rounding: str
    carry: str
    allowance: Number
    ranges: Mapping[str, Number]
    formats: Mapping[str, str]
    state: str
    multiply: str
    digits: int
    sums: str


def with_settings(function: F) -> F:
    """Show the keywords of `StatedSettings` one by one in the signature of a function, for help and completion."""
    signature = inspect.signature(function)
    shown = [p for p in signature.parameters.values() if p.kind is not p.VAR_KEYWORD]
    shown += [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=kind)
        for name, kind in StatedSettings.__annotations__.items()
    ]
    function.__signature__ = signature.replace(parameters=shown)  # type: ignore[attr-defined]
    return function


class _WholeStep(NamedTuple):
    """Settings of a whole step, until the program determines the number of increments."""

    step: str
    max_rate_deg_s: str | None
    lsb: str | None


@dataclass(frozen=True)
class Settings(ReadOnly):
    """The conditions that fixed-point code must meet: word, ranges, rounding.

    Parameters
    ----------
    word : int
        Bits of a word; products have twice as many.
    largest_angle : Fraction
        Largest magnitude of an element of an angle increment, in rad.
    rounding : str
        "nearest" (halves up) or "truncation" (down).
    carry : str
        Rounding errors that are fed back from call to call: "none", "state", "full", those of state and transition, or
        "all", those of every value that goes into the next call and of every increment that goes out too.
    allowance : Fraction
        By how much an element of a state may exceed 1 in magnitude.
    ranges : mapping of str to Fraction
        Largest magnitude of the elements of other inputs, by the signal's name.
    formats : mapping of str to str
        Formats that the user fixes, as Qm.n, by the name of a value or of an input or output.
    stated : str
        The options of the command line that the largest angle follows from; "" where it is stated itself.
    sensor : Sensor or None
        The scale of the gyro if increments are its counts; None if they have a format in rad.
    input_bits : int or None
        Bits of an increment in memory; None for those of a word, or of a usual gyro where `sensor` is stated.
    state : str
        "q31", "q15" or "q63" for a state whose elements lie in -1 to 1 less a unit and saturate; "" for room above 1.
    multiply : str
        How products are computed: "product", "shift-add" for those with a constant, "high" for the high words of all
        alone, with words of 32 or 64 bits, or "half" for high words from half words, with words of 32 bits.
    digits : int
        Canonical signed digits of a constant that "shift-add" takes; 0 for all that a word has.
    sums : str
        Order of the sums of targets in floating point: "canonical", or "tree" for balanced trees. Sums in fixed point
        are exact before they are rounded, and have no other.
    increments : int or None
        The number of increments a step that `Settings.of` was told; a program with another number is refused.
    whole_step : tuple or None
        The step and the rate of settings that were not told the number: `largest_angle` is then the angle of the whole
        step, until `for_program` divides it.

    Raises
    ------
    InputError
        If a value is not allowed.

    Examples
    --------
    >>> Settings.of(word=16, max_rate_deg_s=12, step="0.125", increments=2).largest_angle < Fraction(1, 76)
    True
    """

    word: int = 32
    largest_angle: Fraction = DEFAULT_ANGLE
    rounding: str = "nearest"
    carry: str = "none"
    allowance: Fraction = DEFAULT_ALLOWANCE
    ranges: Mapping[str, Fraction] = field(default_factory=dict, hash=False)
    formats: Mapping[str, str] = field(default_factory=dict, hash=False)
    stated: str = field(default="", compare=False)
    sensor: Sensor | None = None
    input_bits: int | None = None
    state: str = ""
    multiply: str = "product"
    digits: int = 0
    sums: str = "canonical"
    increments: int | None = field(default=None, compare=False, repr=False)
    whole_step: _WholeStep | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "word", check_word(self.word))
        self._check_inputs()
        self._check_state()
        check_rounding(self.rounding)
        checks.choice("carry", self.carry, CARRIES)
        checks.choice("multiply", self.multiply, MULTIPLICATIONS)
        checks.choice("sums", self.sums, SUMS)
        digits = checks.count("digits", self.digits, smallest=0, largest=self.word)
        object.__setattr__(self, "digits", digits)
        if self.digits and self.multiply != "shift-add":
            raise InputError(f"digits is {self.digits}; it goes with multiply shift-add")
        words = WORDS_OF_HIGH_PRODUCTS.get(self.multiply, (self.word,))
        if self.word not in words:
            allowed = " or ".join(map(str, words))
            raise InputError(
                f"multiply {self.multiply} goes with words of {allowed} bits; word is {self.word}"
            )
        most = LARGEST_ANGLE * (1 if self.whole_step is None else _MOST_INCREMENTS)
        if not SMALLEST_ANGLE <= self.largest_angle <= most:
            # In the names of Python; the command line turns them into options again.
            stated = self.stated.removeprefix("--").replace("max-rate-deg-s", "max_rate_deg_s")
            stated = stated.replace("sample-hz", "sample_hz")
            how = f" ({stated.replace(' --', ', ')})" if stated else ""
            raise InputError(
                f"largest angle increment is {float(self.largest_angle):g} rad{how}; "
                f"from {float(SMALLEST_ANGLE):g} to {LARGEST_ANGLE} is needed"
            )
        if not 0 < self.allowance <= Fraction(1, 2):
            raise InputError(
                f"drift allowance is {float(self.allowance):g}; more than 0 and at most 0.5 is needed"
            )
        ranges = {name: checks.number(f"range of {name}", value) for name, value in self.ranges.items()}
        object.__setattr__(self, "ranges", ranges)
        for name, largest in ranges.items():
            if largest <= 0:
                raise InputError(f"range of {name} is {float(largest):g}; a number above 0 is needed")
        for text in self.formats.values():
            Format.parse(text, self.word)
        super().__post_init__()

    def _check_inputs(self) -> None:
        """Check the bits of an increment, and fill in the default for a gyro with counts."""
        if self.input_bits is None:
            object.__setattr__(self, "input_bits", self.default_input_bits)
        bits = self.input_bits
        if bits is None:
            return
        if not checks.is_whole(bits) or not SHORTEST_WORD <= bits <= self.word:
            raise InputError(
                f"input bits is {bits}; a whole number from {SHORTEST_WORD} to {self.word}, the bits of a word, is "
                "needed"
            )
        object.__setattr__(self, "input_bits", int(bits))

    def _check_state(self) -> None:
        """Check that a saturating state goes with the word, and that no other option sets its range."""
        if not self.state:
            return
        checks.choice("state", self.state, STATES)
        if STATES[self.state] != self.word:
            fitting = [name for name, bits in STATES.items() if bits == self.word]
            raise InputError(
                f"state {self.state} has {STATES[self.state]} bits and the word {self.word}; "
                f"{fitting[0] if fitting else 'a word of 16, 32 or 64 bits'} is needed"
            )
        if self.allowance != DEFAULT_ALLOWANCE:
            raise InputError(f"a drift allowance does not go with state {self.state}, which ends at 1")
        if "state" in self.formats:
            raise InputError(f"a format of the state does not go with state {self.state}, which is one")

    @property
    def default_input_bits(self) -> int | None:
        """Bits of an increment where none are stated: those of a usual gyro, or None without one."""
        return None if self.sensor is None else min(DEFAULT_BITS, self.word)

    @classmethod
    @with_settings
    def of(cls, **stated: Unpack[StatedSettings]) -> Settings:
        """Return settings from what a user states: rates and times as numbers or decimals.

        Parameters
        ----------
        max_rate_deg_s, step : number, optional
            Largest body rate on an axis, in deg/s, and the step in s: their product, divided by the number of
            increments a step, bounds an angle increment.
        increments : int, optional
            That number, which a program knows: where it is left out, the program that the settings are used for gives
            it, and where it is another one, they are refused.
        largest_angle : number, optional
            That bound itself, in rad.
        sample_hz : number, optional
            Samples of the gyro in a second, in place of the step.
        lsb : str, optional
            Scale of a gyro that counts: rate a count, as "0.0175dps", or angle a count, as "3e-6rad". Increments are
            then its counts, and the largest of them is bounded by its bits too.
        **stated
            The other parameters of `Settings`.

        Examples
        --------
        >>> settings = Settings.of(sample_hz=100, lsb="0.0175dps")
        >>> settings.input_bits, round(float(settings.largest_angle), 4)
        (16, 0.1001)
        """
        given: dict[str, Any] = {name: value for name, value in stated.items() if value is not None}
        for name in given.keys() - StatedSettings.__annotations__.keys():
            raise InputTypeError(checks.unknown("setting", name, StatedSettings.__annotations__))
        return cls._of(**given)

    @classmethod
    def stated_or(cls, settings: Settings | None, stated: StatedSettings) -> Settings | None:
        """Return settings, or those of keywords; None if there are neither."""
        given = [name for name, value in stated.items() if value is not None]
        if not given:
            return settings
        if settings is not None:
            raise InputError(f"settings and {given[0]} are both given; one is needed")
        return cls.of(**stated)

    @classmethod
    def _of(
        cls,
        *,
        word: int = 32,
        max_rate_deg_s: Any = None,
        step: Any = None,
        increments: int | None = None,
        largest_angle: Any = None,
        sample_hz: Any = None,
        lsb: Any = None,
        **rest: Any,
    ) -> Settings:
        if increments is not None:
            increments = checks.count("increments", increments)
        if "allowance" in rest:
            rest["allowance"] = checks.number("drift allowance", rest["allowance"])
        if max_rate_deg_s is not None and largest_angle is not None:
            raise InputError("the largest angle and the largest rate are both given; one is needed")
        interval, heard = _interval(step, sample_hz, increments or 1)
        if max_rate_deg_s is not None and interval is None:
            raise InputError("max_rate_deg_s and step go together; step is missing")
        if max_rate_deg_s is None and step is not None and lsb is None:
            raise InputError("max_rate_deg_s and step go together; max_rate_deg_s is missing")
        sensor = None if lsb is None else Sensor.of(lsb, interval, heard)
        if (
            sample_hz is not None
            and max_rate_deg_s is None
            and (sensor is None or heard not in sensor.stated)
        ):
            raise InputError(
                "sample_hz makes angles of rates; max_rate_deg_s or an lsb that is a rate is missing"
            )
        angle, options = None, []
        if largest_angle is not None:
            angle = checks.number("largest angle", largest_angle, positive=True)
            options = [f"--max-angle-rad {largest_angle}"] * (sensor is not None or angle == DEFAULT_ANGLE)
        elif max_rate_deg_s is not None and interval is not None:
            angle = checks.number("max_rate_deg_s", max_rate_deg_s, positive=True) * interval * _DEGREE
            options = [f"--max-rate-deg-s {max_rate_deg_s}"]
            options += [heard] * (sensor is None or heard not in sensor.stated)
        if sensor is not None:
            options.append(sensor.stated)
            bits = rest.get("input_bits") or min(DEFAULT_BITS, word)
            whole = sensor.count * (1 << (bits - 1))
            angle = whole if angle is None else min(angle, whole)
        if angle is None:
            angle = DEFAULT_ANGLE
        if step is not None and increments is None:
            rate, scale = (None if value is None else str(value) for value in (max_rate_deg_s, lsb))
            rest["whole_step"] = _WholeStep(str(step), rate, scale)
        elif step is not None:  # a sample rate and an angle hold for any number
            rest["increments"] = increments
        return cls(word, rounded_limit(angle), **rest, stated=" ".join(options), sensor=sensor)

    def for_program(self, increments: int | None, kernel: str) -> Settings:
        """Return the settings with the angle of one of the increments of a step.

        Parameters
        ----------
        increments : int or None
            Increments that a step of the program takes; None for a program that takes none.
        kernel : str
            Name of the kernel, for a refusal.

        Raises
        ------
        InputError
            If another number of increments was stated.

        Examples
        --------
        >>> settings = Settings.of(max_rate_deg_s=400, step="0.01")
        >>> settings.for_program(2, "euler-rk4-2") == Settings.of(max_rate_deg_s=400, step="0.01", increments=2)
        True
        """
        if increments is not None and self.increments not in (None, increments):
            raise InputError(
                f"increments is {self.increments}, but {kernel} takes {checks.counted(increments, 'increment')} a step"
            )
        if self.whole_step is None:
            return self if self.increments is None else replace(self, increments=None)
        step, rate, lsb = self.whole_step
        bits = None if self.sensor is None else self.input_bits
        angles = Settings.of(
            word=self.word,
            max_rate_deg_s=rate,
            step=step,
            increments=increments or 1,
            lsb=lsb,
            input_bits=bits,
        )
        return replace(
            self,
            largest_angle=angles.largest_angle,
            stated=angles.stated,
            sensor=angles.sensor,
            whole_step=None,
        )

    @property
    def only_ranges(self) -> bool:
        """Whether they state the ranges of inputs or the order of sums, and nothing of fixed point alone."""
        fixed = replace(
            self,
            largest_angle=DEFAULT_ANGLE,
            ranges={},
            stated="",
            increments=None,
            whole_step=None,
            sums="canonical",
        )
        return (self.states_ranges or self.sums != "canonical") and fixed == _DEFAULTS

    @property
    def states_ranges(self) -> bool:
        """Whether they state the largest magnitude of an input."""
        return bool(self.stated or self.ranges) or self.largest_angle != DEFAULT_ANGLE

    @property
    def range_options(self) -> str:
        """The options of the command line that state the largest angle."""
        return self.stated or f"--max-angle-rad {self.largest_angle}"

    def fitted(self, largest: float) -> Settings:
        """Return the settings with a largest angle of this magnitude, and up to an eighth more.

        Examples
        --------
        >>> float(Settings().fitted(0.0131).largest_angle)
        0.013671875
        """
        if not SMALLEST_ANGLE * 2 < largest <= LARGEST_ANGLE:
            # Nothing turns, or no format holds the increments: those are refused where they are read.
            return self
        if self.sensor is not None:
            return self  # its counts are what they are
        exponent = math.frexp(largest)[1] - 4
        angle = Fraction(2) ** exponent * math.ceil(math.ldexp(largest, -exponent))
        return replace(self, largest_angle=angle, stated="", increments=None, whole_step=None)

    def without_counts(self) -> Settings:
        """Return the settings for a kernel that takes no increments from the gyro."""
        if self.input_bits is None:
            return self
        return replace(
            self,
            sensor=None,
            input_bits=None,
            largest_angle=DEFAULT_ANGLE,
            stated="",
            increments=None,
            whole_step=None,
        )

    def for_increments(self, largest: float) -> Settings:
        """Return the settings for a run whose largest increment is known; a largest angle that is stated stays."""
        return self if self.largest_angle != DEFAULT_ANGLE else self.fitted(largest)

    def as_dict(self) -> dict[str, Any]:
        """Return the settings as plain JSON data."""
        return {
            "word": self.word,
            "largest_angle": str(self.largest_angle),
            "rounding": self.rounding,
            "carry": self.carry,
            "allowance": str(self.allowance),
            "ranges": {name: str(value) for name, value in self.ranges.items()},
            "formats": dict(self.formats),
            "stated": "" if self.stated == f"--max-angle-rad {self.largest_angle}" else self.stated,
            "sensor": self.sensor and self.sensor.as_dict(),
            "input_bits": self.input_bits,
            "state": self.state,
            "multiply": self.multiply,
            "digits": self.digits,
            **({} if self.sums == "canonical" else {"sums": self.sums}),
            **({} if self.whole_step is None else {"whole_step": list(self.whole_step)}),
        }

    @property
    def identity(self) -> str:
        """Text that differs between different settings."""
        return json.dumps(
            self.as_dict() | {"stated": self.stated, "increments": self.increments}, sort_keys=True
        )

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Settings:
        """Rebuild settings from `as_dict`."""
        return cls(
            **{
                **data,
                "largest_angle": Fraction(data["largest_angle"]),
                "allowance": Fraction(data["allowance"]),
                "ranges": {name: Fraction(value) for name, value in data["ranges"].items()},
                "sensor": data["sensor"] and Sensor.from_dict(data["sensor"]),
                "whole_step": _WholeStep(*data["whole_step"]) if "whole_step" in data else None,
            }
        )


_DEFAULTS = Settings()


def rounded_limit(angle: Fraction) -> Fraction:
    """Return a largest angle rounded up as those that are stated."""
    return Fraction(math.ceil(angle * _LIMIT_UNIT), _LIMIT_UNIT)


def _interval(step: Any, sample_hz: Any, increments: int) -> tuple[Fraction | None, str]:
    """Return the time of an increment in s if it is stated, and the option that states it."""
    if step is not None and sample_hz is not None:
        raise InputError("the step and the sample rate are both given; one is needed")
    if step is not None:
        return checks.number("step", step, positive=True) / increments, f"--step {step}"
    if sample_hz is not None:
        return 1 / checks.number("sample_hz", sample_hz, positive=True), f"--sample-hz {sample_hz}"
    return None, ""
