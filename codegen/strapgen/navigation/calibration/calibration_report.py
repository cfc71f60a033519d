"""Reports and draws what a scheme of positions tells of the coefficients of an inertial measurement unit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from strapgen.navigation.calibration.calibration import Calibration
from strapgen.navigation.calibration.calibration_file import CalibrationFile
from strapgen.results import figures
from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable

#: Units as a reader has them, and what follows them for a coefficient, by the letters of its name.
_SHOWN = {"rate": "deg/h", "acceleration": "micro-g"}
_FACTORS = {"D0": "", "B": "/g", "E": "/g^2", "A0": "", "M": "/g", "N": "/g^2"}


def calibration_report(
    file: CalibrationFile,
    several: Sequence[Calibration],
    estimates: Mapping[str, Mapping[str, float]],
    remaining: Mapping[str, Any],
) -> Report:
    """Return the study as a report.

    `remaining` (3, 3): covariance of the compensated quantity in flight, in squares of its unit; empty without
    a flight.
    """
    rows = [_row(file, one, name, estimates) for one in several for name in one.names]
    return Report(
        lambda: _text(file, several, rows, remaining),
        lambda: _data(file, several, rows, remaining),
        lambda: TextTable([Column(key) for key in _KEYS], [[row[key] for key in _KEYS] for row in rows]),
    )


_KEYS = ("quantity", "coefficient", "unit", "deviation", "uncertainty", "estimate")


def _row(
    file: CalibrationFile, one: Calibration, name: str, estimates: Mapping[str, Mapping[str, float]]
) -> dict[str, Any]:
    deviation = one.deviations[name]
    return {
        "quantity": one.quantity,
        "coefficient": name,
        "unit": f"{_SHOWN[one.quantity]}{_FACTORS[name.partition('_')[0]]}",
        "deviation": deviation,
        "uncertainty": None if deviation is None else deviation * file.sigma[one.quantity],
        "estimate": estimates.get(one.quantity, {}).get(name),
    }


def _combination(one: Mapping[str, Any]) -> str:
    """Return a combination of coefficients as text."""
    parts = [name if value == 1 else f"({value}) {name}" for name, value in one.items()]
    return " + ".join(parts)


def _text(
    file: CalibrationFile,
    several: Sequence[Calibration],
    rows: Sequence[Mapping[str, Any]],
    remaining: Mapping[str, Any],
) -> str:
    lines = [f"{file.scheme.name}: least squares of {3 * len(file.scheme.positions)} errors of each quantity"]
    for one in several:
        unit = _SHOWN[one.quantity]
        seen = f"{one.rank} of {len(one.names)} coefficients are seen"
        lost = "; ".join(_combination(row) for row in one.unseen)
        seen += f"; no position shows {lost}" if lost else ""
        lines += ["", f"{one.quantity}, noise {file.sigma[one.quantity]:g} {unit}: {seen}", ""]
        columns = [
            Column("coefficient", "<"),
            Column("unit", "<"),
            Column("deviation", spec=".5f"),
            Column("uncertainty", spec=".3g"),
        ]
        has_estimate = any(row["estimate"] is not None for row in rows if row["quantity"] == one.quantity)
        columns += [Column("estimate", spec=".6g")] * has_estimate
        body = [
            [row[key] for key in _KEYS[1 : 5 + has_estimate]]
            for row in rows
            if row["quantity"] == one.quantity
        ]
        lines += TextTable(columns, body).lines()
    lines += [
        "",
        "deviation: for noise of 1; uncertainty: times the noise of the file; -: cannot be estimated",
    ]
    for quantity, covariance in remaining.items():
        sigmas = ", ".join(f"{value:.3g}" for value in np.sqrt(np.diag(covariance)))
        lines.append(
            f"left after compensation, {quantity} about or along x, y, z: {sigmas} {_SHOWN[quantity]}"
        )
    return "\n".join(lines)


def _data(
    file: CalibrationFile,
    several: Sequence[Calibration],
    rows: Sequence[Mapping[str, Any]],
    remaining: Mapping[str, Any],
) -> dict[str, Any]:
    return {
        "name": file.scheme.name,
        "positions": len(file.scheme.positions),
        "rank": {one.quantity: one.rank for one in several},
        "unseen": {
            one.quantity: [{name: str(value) for name, value in row.items()} for row in one.unseen]
            for one in several
        },
        "coefficients": [dict(row) for row in rows],
        "remaining_covariance": {name: covariance.tolist() for name, covariance in remaining.items()},
    }


def calibration_image(file: CalibrationFile, several: Sequence[Calibration], path: str | Path) -> bytes:
    """Return the uncertainty of every coefficient as bars, a panel for each quantity; unseen ones are marked."""
    figure, grid = figures.grid_of_axes(1, len(several), (5.2 * len(several), 5.0))
    for axes, one in zip(grid[0], several, strict=True):
        names = list(one.names)[::-1]
        values = [(one.deviations[name] or 0.0) * file.sigma[one.quantity] for name in names]
        axes.barh(names, values, color=figures.COLOURS[0], height=0.6)
        for place, name in enumerate(names):
            if name in one.lost:
                axes.text(0, place, "  cannot be seen", va="center", fontsize=8, color=figures.COLOURS[1])
        figures.style(axes)
        axes.set_title(one.quantity, loc="left", fontsize=10)
        axes.set_xlabel(f"uncertainty, {_SHOWN[one.quantity]}")
    figures.title(figure, f"{file.scheme.name}: uncertainty of the coefficients, one standard deviation")
    return figures.image(figure, path)
