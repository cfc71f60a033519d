"""`Settings` are the settings of fixed point that a user states: word, largest increment, rounding, error feedback."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

from strapgen.ir.formats import Format, check_rounding, check_word
from strapgen.support import checks
from strapgen.support.exceptions import InputError

#: Rounding errors that are fed back from step to step.
CARRIES = {
    "none": "nothing",
    "state": "the rounding of the state",
    "full": "the rounding of the state and of the transition",
}

#: Largest angle increment for which formats are chosen when none is stated, in rad.
DEFAULT_ANGLE = Fraction(1, 8)
#: Increments that formats are chosen for, in rad: from the earth's rate in a microsecond to over half a turn.
SMALLEST_ANGLE, LARGEST_ANGLE = Fraction(1, 10**11), 4
DEFAULT_ALLOWANCE = Fraction(1, 16)

#: A rational above pi/180, by less than 1e-18.
_DEGREE = Fraction(math.ceil(Fraction(3141592653589793239, 180) * 10**3), 10**21)
#: Stated limits are rounded up to whole multiples of this.
_LIMIT_UNIT = 1 << 60


@dataclass(frozen=True)
class Settings:
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
        Rounding errors that are fed back from call to call: "none", "state", or "full", those of state and transition.
    allowance : Fraction
        By how much an element of a state may exceed 1 in magnitude.
    ranges : mapping of str to Fraction
        Largest magnitude of the elements of other inputs, by the signal's name.
    formats : mapping of str to str
        Formats that the user fixes, as Qm.n, by the name of a value or of an input or output.
    stated : str
        The options of the command line that the largest angle follows from; "" where it is stated itself.

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

    def __post_init__(self) -> None:
        check_word(self.word)
        check_rounding(self.rounding)
        checks.choice("carry", self.carry, CARRIES)
        if not SMALLEST_ANGLE <= self.largest_angle <= LARGEST_ANGLE:
            # In the names of Python; the command line turns them into options again.
            stated = self.stated.removeprefix("--").replace("max-rate-deg-s", "max_rate_deg_s")
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

    @classmethod
    def of(
        cls,
        *,
        word: int = 32,
        max_rate_deg_s: Any = None,
        step: Any = None,
        increments: int = 1,
        largest_angle: Any = None,
        **rest: Any,
    ) -> Settings:
        """Return settings from what a user states: rates and times as numbers or decimals.

        Parameters
        ----------
        max_rate_deg_s, step : number, optional
            Largest body rate on an axis, in deg/s, and the step in s: their product, divided by the number of
            `increments` a step, bounds an angle increment.
        largest_angle : number, optional
            That bound itself, in rad.
        """
        if (max_rate_deg_s is None) != (step is None):
            missing = "step" if step is None else "max_rate_deg_s"
            raise InputError(f"max_rate_deg_s and step go together; {missing} is missing")
        if max_rate_deg_s is not None and largest_angle is not None:
            raise InputError("the largest angle and the largest rate are both given; one is needed")
        angle = DEFAULT_ANGLE
        if largest_angle is not None:
            angle = checks.number("largest angle", largest_angle, positive=True)
        elif max_rate_deg_s is not None:
            rate = checks.number("max_rate_deg_s", max_rate_deg_s, positive=True)
            angle = rate * checks.number("step", step, positive=True) * _DEGREE / increments
        stated = "" if max_rate_deg_s is None else f"--max-rate-deg-s {max_rate_deg_s} --step {step}"
        return cls(word, Fraction(math.ceil(angle * _LIMIT_UNIT), _LIMIT_UNIT), **rest, stated=stated)

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
        exponent = math.frexp(largest)[1] - 4
        angle = Fraction(2) ** exponent * math.ceil(math.ldexp(largest, -exponent))
        return replace(self, largest_angle=angle, stated="")

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
            "stated": self.stated,
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Settings:
        """Rebuild settings from `as_dict`."""
        return cls(
            **{
                **data,
                "largest_angle": Fraction(data["largest_angle"]),
                "allowance": Fraction(data["allowance"]),
                "ranges": {name: Fraction(value) for name, value in data["ranges"].items()},
            }
        )
