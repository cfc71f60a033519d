"""Reports what each form of the attitude costs, as text, data, table and picture."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from strapgen.navigation.attitude_form.attitude_form import FORMS, PARTS, FormStudy, PartCost, VelocityLoss
from strapgen.navigation.two_speed import transformation_error
from strapgen.results import figures
from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable
from strapgen.targets.lines import fill

_CONCLUSION = (
    "printed in 1984: the advantage of one form over the other is insignificant beside the whole system, and the "
    "choice is the analyst's"
)


def attitude_form_report(study: FormStudy) -> Report:
    """Return the study as a report."""
    return Report(lambda: "\n".join(_lines(study)) + "\n", lambda: _data(study), lambda: _flat(study))


def attitude_form_image(study: FormStudy, path: str | Path) -> bytes:
    """Return the operations of each form in a second, a bar whose pieces are the parts."""
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


def _row(part: PartCost) -> dict[str, Any]:
    """Return a part as plain data."""
    return {
        "form": part.form,
        "part": part.part,
        "kernel": part.kernel or None,
        "hz": part.hz,
        "operations": part.count,
        "operations_per_s": part.count * part.hz,
        "instructions": part.executed,
        "instructions_per_s": None if part.executed is None else part.executed * part.hz,
    }


def _data(study: FormStudy) -> dict[str, Any]:
    loss = study.truncation
    return {
        "cpu": study.cpu or None,
        "spread": study.spread,
        "totals": [
            {
                "form": form,
                "title": title,
                "operations_per_s": study.per_second(form),
                "instructions_per_s": study.executed_per_second(form),
            }
            for form, (title, _) in FORMS.items()
        ],
        "parts": [_row(part) | {"kinds": dict(part.operations)} for part in study.parts],
        "truncation": {
            "largest_rate_rad_s": loss.largest_rate,
            "angle_rad": loss.angle,
            "along": loss.along,
            "across": loss.across,
            "series_along": {str(power): str(c) for power, c in transformation_error.along_series(4).items()},
            "series_across": {
                str(power): str(c) for power, c in transformation_error.across_series(4).items()
            },
            "error": loss.error,
            "slowest_hz": loss.slowest_hz,
        },
    }


def _flat(study: FormStudy) -> TextTable:
    rows = [_row(part) for part in study.parts]
    columns = [Column(name, "<" if name in ("form", "part", "kernel") else ">") for name in rows[0]]
    return TextTable(columns, [list(row.values()) for row in rows])


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
