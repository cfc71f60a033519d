"""What each form of the attitude costs, as a result and drawn."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

from strapgen.navigation.attitude_form.attitude_form import FORMS, PARTS, FormStudy, PartCost, VelocityLoss
from strapgen.navigation.two_speed import transformation_error
from strapgen.results import figures
from strapgen.results.records import INTERNAL, plain_record
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable
from strapgen.targets.printer import fill

_CONCLUSION = (
    "printed in 1984: the advantage of one form over the other is insignificant beside the whole system, and the "
    "choice is the analyst's"
)


@dataclass(frozen=True)
class PartRow:
    """What a part of a form costs."""

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

    @staticmethod
    def of(part: PartCost) -> PartRow:
        """Return a part with what it costs in a second."""
        executed = None if part.executed is None else part.executed * part.hz
        counts = (part.count, part.count * part.hz, part.executed, executed)
        return PartRow(part.form, part.part, part.kernel or None, part.hz, *counts, part.operations)


@dataclass(frozen=True)
class FormTotal:
    """What a form costs in a second."""

    form: str
    title: str
    operations_per_s: float
    instructions_per_s: float | None


@dataclass(frozen=True)
class Truncation:
    """What the first-order attitude in a slow cycle costs in velocity."""

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

    @staticmethod
    def of(loss: VelocityLoss) -> Truncation:
        """Return a loss with the first terms of its series."""
        series = (transformation_error.along_series(4), transformation_error.across_series(4))
        errors = (loss.along, loss.across, *series, loss.error, loss.slowest_hz)
        return Truncation(loss.largest_rate, loss.angle, *errors)


@dataclass(frozen=True)
class FormResult(Result):
    """What each form of the attitude costs in a navigator."""

    drawn_by = f"{__name__}:attitude_form_image"

    study: FormStudy = field(metadata=INTERNAL)
    #: Processor on which instructions were counted
    cpu: str | None
    #: By what part of the smallest total the largest exceeds it
    spread: float
    totals: list[FormTotal]
    parts: list[PartRow]
    truncation: Truncation

    @staticmethod
    def of(study: FormStudy) -> FormResult:
        """Return the costs of a study."""
        totals = [
            FormTotal(form, title, study.per_second(form), study.executed_per_second(form))
            for form, (title, _) in FORMS.items()
        ]
        parts = list(map(PartRow.of, study.parts))
        return FormResult(
            study, study.cpu or None, study.spread, totals, parts, Truncation.of(study.truncation)
        )

    def rows(self) -> list[dict[str, Any]]:
        """Return the parts without the kinds of their operations."""
        return [
            {key: one for key, one in plain_record(part).items() if key != "kinds"} for part in self.parts
        ]

    def text(self) -> str:
        """Return the operations of each part and form, and what the first-order attitude costs."""
        return "\n".join(_lines(self.study))


def attitude_form_image(result: FormResult, path: str | Path) -> bytes:
    """Return the operations of each form in a second, a bar whose pieces are the parts."""
    study = result.study
    figure, grid = figures.grid_of_axes(1, 1, (8.5, 3.6))
    axes = grid[0, 0]
    shown = list(dict.fromkeys(part.part for part in study.parts))
    places = range(len(FORMS))
    left = [0.0] * len(FORMS)
    for name, colour in zip(shown, figures.several_colours(len(shown)), strict=True):
        widths = [
            math.fsum(part.count * part.hz for part in study.of(form) if part.part == name) for form in FORMS
        ]
        axes.barh(places, widths, left=left, color=colour, label=PARTS[name])
        left = [a + b for a, b in zip(left, widths, strict=True)]
    axes.set_yticks(places, [title for title, _ in FORMS.values()])
    axes.invert_yaxis()
    axes.set_xlabel("operations a second")
    figures.style(axes, "x")
    figures.common_legend(figure, [axes], loc="outside right center")
    figures.title(figure, f"Forms of the attitude at {study.rates.update:g} Hz")
    return figures.image(figure, path)


def _table(study: FormStudy) -> TextTable:
    """Return operations of a call for each part and form, and what they are in a second."""
    columns = [Column("operations of a call", "<"), Column("Hz", spec="g")]
    columns += [Column(title, spec=",.0f") for title, _ in FORMS.values()]
    shown = list(dict.fromkeys(part.part for part in study.parts))
    rows: list[list[Any]] = []
    for name in shown:
        parts = [part for part in study.parts if part.part == name]
        rows.append([PARTS[name], parts[0].hz, *(part.count for part in parts)])
    rows.append(["operations a second", None, *(study.per_second(form) for form in FORMS)])
    if study.cpu:
        executed = (study.executed_per_second(form) for form in FORMS)
        rows.append([f"instructions a second, {study.cpu}", None, *executed])
    return TextTable(columns, rows)


def _lines(study: FormStudy) -> Iterator[str]:
    yield from _table(study).lines()
    yield ""
    yield f"the largest total exceeds the smallest by {100 * study.spread:.1f} %"
    yield from fill(_CONCLUSION, "", 100).splitlines()
    yield ""
    yield from _truncation_lines(study.truncation, study.rates.update)


def _truncation_lines(loss: VelocityLoss, hz: float) -> Iterator[str]:
    """Tell what (47) costs."""
    yield "the first-order attitude (47) in a slow cycle makes a velocity increment too large, phi = w T, by"
    yield f"  along the acceleration  {_series(transformation_error.along_series(3))}"
    yield f"  across it               {_series(transformation_error.across_series(3))}"
    yield (
        f"at {math.degrees(loss.largest_rate):g} deg/s and {hz:g} Hz phi is {loss.angle:.4g} rad: "
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
