"""Forms of the attitude: operations of a navigator with three rows, two rows or a quaternion, as a result and plot."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar

from strapgen import pipeline
from strapgen.catalogue import Choice
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.lab.cost import cost
from strapgen.results import figures
from strapgen.results.records import INTERNAL, plain_record
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable
from strapgen.targets.printer import fill

#: Below this angle in rad the closed forms lose digits, and their series has these.
_SMALL = 0.5
_TERMS = 12


# What the first-order attitude in a slow cycle, equation (47), costs in velocity: exact series and closed form.
#
# At a constant rate w and acceleration a across it, over a cycle T, with the angle phi = |w| T, A(t) = I + [beta x]
# makes the velocity increment too large by 1 - sin(phi)/phi of itself along a, and by phi/2 - (1 - cos(phi))/phi
# across a and w. The leading term of what is missing is (T^3/6) w x (w x a).


def along_series(terms: int) -> dict[int, Fraction]:
    """Return the series of the error along the acceleration, by powers of phi.

    >>> along_series(2)
    {2: Fraction(1, 6), 4: Fraction(-1, 120)}
    """
    return {2 * k: Fraction((-1) ** (k + 1), math.factorial(2 * k + 1)) for k in range(1, terms + 1)}


def across_series(terms: int) -> dict[int, Fraction]:
    """Return the series of the error across acceleration and rate, as `along_series`.

    >>> across_series(2)
    {3: Fraction(1, 24), 5: Fraction(-1, 720)}
    """
    return {2 * k + 1: Fraction((-1) ** (k + 1), math.factorial(2 * k + 2)) for k in range(1, terms + 1)}


def velocity_errors(phi: float) -> tuple[float, float]:
    """Return the errors along and across the acceleration, as parts of the velocity increment.

    `phi`: angle of the cycle in rad.

    >>> print("{:.9e} {:.6e}".format(*velocity_errors(0.1)))
    1.665833532e-03 4.165278e-05
    """
    if abs(phi) < _SMALL:
        along, across = (
            math.fsum(float(c) * phi**power for power, c in series(_TERMS).items())
            for series in (along_series, across_series)
        )
        return along, across
    return 1 - math.sin(phi) / phi, phi / 2 - (1 - math.cos(phi)) / phi


def slowest_rate(largest_rate: float, error: float) -> float:
    """Return the slow rate at which the error is as stated at the largest rate.

    `largest_rate`: in rad/s. Returned in Hz.

    >>> round(slowest_rate(1.0, 1e-4), 4)
    40.8246
    """
    if not 0 < error < 1:
        raise InputError(
            f"velocity-error is {error:g}; a part of the increment, above 0 and below 1, is needed"
        )
    if not 0 < largest_rate < math.inf:
        raise InputError(f"largest rate is {largest_rate:g}; a number above 0 is needed")
    low, high = 0.0, math.pi
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if math.hypot(*velocity_errors(middle)) < error else (low, middle)
    return largest_rate / high


#: What a navigator does with its attitude, in the words of a table.
PARTS = {
    "update": "update of fifth order",
    "matrix": "third row or matrix",
    "velocity": "velocity increment",
    "orthonormalization": "orthonormalization",
    "navigation": "navigation frame",
}
#: Titles of the forms, and the kernel of each part; "" where a form does without it.
FORMS: dict[str, tuple[str, dict[str, str]]] = {
    "dcm": (
        "direction cosines",
        {
            "update": "dcm-update-5",
            "matrix": "",
            "velocity": "dcm-velocity-2",
            "orthonormalization": "dcm-orthonormalize-first-order",
            "navigation": "dcm-navigation-update-2",
        },
    ),
    "two-rows": (
        "two rows, third by (43)",
        {
            "update": "dcm-two-rows-update-5",
            "matrix": "dcm-from-two-rows",
            "velocity": "dcm-velocity-2",
            "orthonormalization": "dcm-two-rows-orthonormalize",
            "navigation": "dcm-two-rows-navigation-2",
        },
    ),
    "euler": (
        "quaternion, matrix by (17)",
        {
            "update": "euler-update-5",
            "matrix": "dcm-from-euler",
            "velocity": "dcm-velocity-2",
            "orthonormalization": "euler-normalize-first-order",
            "navigation": "euler-navigation-update-2",
        },
    ),
    "euler-alone": (
        "quaternion, velocity by (58)",
        {
            "update": "euler-update-5",
            "matrix": "",
            "velocity": "euler-velocity-2",
            "orthonormalization": "euler-normalize-first-order",
            "navigation": "euler-navigation-update-2",
        },
    ),
}


@dataclass(frozen=True)
class PartRates:
    """Rates of the parts of a navigator in Hz."""

    #: Slow cycles: update, matrix, velocity
    update: float
    #: 0 for a part that is never run
    navigation: float
    orthonormalization: float

    def of(self, part: str) -> float:
        """Return the rate of a part."""
        return {"navigation": self.navigation, "orthonormalization": self.orthonormalization}.get(
            part, self.update
        )


@dataclass(frozen=True)
class PartCost:
    """Operations and instructions of a part of a form."""

    #: Keys of `FORMS` and `PARTS`
    form: str
    part: str
    #: None where the form does without the part
    kernel: str | None
    hz: float
    #: Operations of a call in floating point
    operations: int
    operations_per_s: float
    #: Instructions of a call in fixed point; None where none were counted
    instructions: int | None
    instructions_per_s: float | None
    #: Operations of a call by kind
    kinds: Mapping[str, int]


@dataclass(frozen=True)
class FormTotal:
    """Operations and instructions of a form in a second."""

    form: str
    title: str
    operations_per_s: float
    instructions_per_s: float | None


@dataclass(frozen=True)
class Truncation:
    """The velocity error due to the first-order attitude in a slow cycle."""

    largest_rate_rad_s: float
    #: Angle of a slow cycle at that rate
    angle_rad: float
    #: Error along the acceleration as a part of the velocity increment
    along: float
    #: Error across it
    across: float
    #: Coefficients of the errors by power of the angle
    series_along: Mapping[int, Fraction]
    series_across: Mapping[int, Fraction]
    #: A stated error
    error: float
    #: The slow rate that it takes
    slowest_hz: float


def pairs(without: Iterable[str] = ()) -> list[tuple[str, str]]:
    """Return the forms and parts that are counted."""
    left_out = {checks.choice("without", name, PARTS) for name in without}
    remaining = [part for part in PARTS if part not in left_out]
    if not remaining:
        raise InputError("without names every part; at least one has to be left")
    return [(form, part) for form in FORMS for part in remaining]


def part_costs(
    which: Iterable[tuple[str, str]], rates: PartRates, cpu: str = "", settings: Settings | None = None
) -> Iterator[PartCost]:
    """Count the operations of parts, and where a processor is named their instructions in fixed point."""
    for form, part in which:
        kernel, hz = FORMS[form][1][part], rates.of(part)
        counts: dict[str, int] = {}
        executed = 0 if cpu else None
        if kernel:
            counts = {kind: n for kind, n in pipeline.program(Choice(kernel)).operations.items() if n}
            executed = (
                cost(pipeline.compile(Choice(kernel), "c-fixed", settings), cpu).executed if cpu else None
            )
        total = sum(counts.values())
        executed_per_s = None if executed is None else executed * hz
        yield PartCost(form, part, kernel or None, hz, total, total * hz, executed, executed_per_s, counts)


def truncation(rates: PartRates, largest_rate: float, error: float) -> Truncation:
    """Return the error of (47) at the slow rate, and the slow rate for a stated error.

    `largest_rate`: in rad/s.
    """
    angle = largest_rate / rates.update
    series = (along_series(4), across_series(4))
    return Truncation(
        largest_rate, angle, *velocity_errors(angle), *series, error, slowest_rate(largest_rate, error)
    )


_CONCLUSION = (
    "printed in 1984: the advantage of one form over the other is insignificant beside the whole system, and the "
    "choice is the analyst's"
)


@dataclass(frozen=True)
class FormResult(Result):
    """Operations and instructions of a navigator with each form of the attitude."""

    drawn_by: ClassVar[str] = f"{__name__}:attitude_form_image"

    rates: PartRates = field(metadata=INTERNAL)
    #: Processor on which instructions were counted
    cpu: str | None
    #: By what part of the smallest total the largest exceeds it
    spread: float
    totals: list[FormTotal]
    parts: list[PartCost]
    truncation: Truncation

    @staticmethod
    def of(rates: PartRates, parts: list[PartCost], loss: Truncation, cpu: str | None = None) -> FormResult:
        """Return the costs of all forms."""
        totals = []
        for form, (title, _) in FORMS.items():
            mine = [part for part in parts if part.form == form]
            executed = math.fsum(part.instructions_per_s or 0 for part in mine) if cpu else None
            totals.append(FormTotal(form, title, math.fsum(part.operations_per_s for part in mine), executed))
        several = [total.operations_per_s for total in totals]
        return FormResult(rates, cpu, max(several) / min(several) - 1, totals, parts, loss)

    def rows(self) -> list[dict[str, Any]]:
        """Return the parts without the kinds of their operations."""
        return [
            {key: one for key, one in plain_record(part).items() if key != "kinds"} for part in self.parts
        ]

    def text(self) -> str:
        """Return the operations of each part and form, and the error of the first-order attitude."""
        return "\n".join(_lines(self))


def attitude_form_image(result: FormResult, path: str | Path) -> bytes:
    """Return the operations of each form in a second, a bar whose pieces are the parts."""
    figure, grid = figures.grid_of_axes(1, 1, (8.5, 3.6))
    axes = grid[0, 0]
    shown = list(dict.fromkeys(part.part for part in result.parts))
    left = [0.0] * len(FORMS)
    for name, colour in zip(shown, figures.several_colours(len(shown)), strict=True):
        widths = [part.operations_per_s for part in result.parts if part.part == name]
        axes.barh(range(len(FORMS)), widths, left=left, color=colour, label=PARTS[name])
        left = [a + b for a, b in zip(left, widths, strict=True)]
    axes.set_yticks(range(len(FORMS)), [title for title, _ in FORMS.values()])
    axes.invert_yaxis()
    axes.set_xlabel("operations a second")
    figures.style(axes, "x")
    figures.common_legend(figure, [axes], loc="outside right center")
    figures.title(figure, f"Forms of the attitude at {result.rates.update:g} Hz")
    return figures.image(figure, path)


def _table(result: FormResult) -> TextTable:
    """Return operations of each part and form, in a call and in a second."""
    columns = [Column("operations of a call", "<"), Column("Hz", spec="g")]
    columns += [Column(title, spec=",.0f") for title, _ in FORMS.values()]
    rows: list[list[Any]] = []
    for name in dict.fromkeys(part.part for part in result.parts):
        parts = [part for part in result.parts if part.part == name]
        rows.append([PARTS[name], parts[0].hz, *(part.operations for part in parts)])
    rows.append(["operations a second", None, *(total.operations_per_s for total in result.totals)])
    if result.cpu:
        executed = (total.instructions_per_s for total in result.totals)
        rows.append([f"instructions a second, {result.cpu}", None, *executed])
    return TextTable(columns, rows)


def _lines(result: FormResult) -> Iterator[str]:
    yield from _table(result).lines()
    yield ""
    yield f"the largest total exceeds the smallest by {100 * result.spread:.1f} %"
    yield from fill(_CONCLUSION, "", 100).splitlines()
    yield ""
    yield from _truncation_lines(result.truncation, result.rates.update)


def _truncation_lines(loss: Truncation, hz: float) -> Iterator[str]:
    """Return the error of (47) in lines of text."""
    yield "the first-order attitude (47) in a slow cycle makes a velocity increment too large, phi = w T, by"
    yield f"  along the acceleration  {_series(along_series(3))}"
    yield f"  across it               {_series(across_series(3))}"
    yield (
        f"at {math.degrees(loss.largest_rate_rad_s):g} deg/s and {hz:g} Hz phi is {loss.angle_rad:.4g} rad: "
        f"{loss.along:.9e} along, {loss.across:.6e} across"
    )
    yield f"an error of {loss.error:g} at that rate takes a slow rate of {loss.slowest_hz:.4g} Hz"


def _series(series: dict[int, Any]) -> str:
    """Return a series as text."""
    text = ""
    for power, c in series.items():
        sign = "-" if c < 0 else "+"
        text += f" {sign} phi^{power}/{c.denominator}" if text else f"phi^{power}/{c.denominator}"
    return f"{text} ..."
