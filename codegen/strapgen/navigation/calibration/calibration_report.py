"""What a scheme of positions tells of the coefficients of an inertial measurement unit, as a result and drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from strapgen.navigation.calibration.calibration import Calibration
from strapgen.navigation.calibration.calibration_file import CalibrationFile
from strapgen.results import figures
from strapgen.results.records import INTERNAL, entry, reader_table
from strapgen.results.result import Result

#: Units as a reader has them, and what follows them for a coefficient, by the letters of its name.
_SHOWN = {"rate": "deg/h", "acceleration": "micro-g"}
_FACTORS = {"D0": "", "B": "/g", "E": "/g^2", "A0": "", "M": "/g", "N": "/g^2"}


def _texts(unseen: Mapping[str, Sequence[Mapping[str, Any]]]) -> dict[str, list[dict[str, str]]]:
    return {
        quantity: [{name: str(value) for name, value in row.items()} for row in rows]
        for quantity, rows in unseen.items()
    }


@dataclass(frozen=True)
class CoefficientRow:
    """What a scheme of positions tells of a coefficient."""

    quantity: str
    coefficient: str = field(metadata=entry("coefficient", align="<"))
    unit: str = field(metadata=entry("unit", align="<"))
    #: Standard deviation for noise of 1; None if the coefficient cannot be estimated
    deviation: float | None = field(metadata=entry("deviation", ".5f"))
    #: The same for the noise of the file, in the unit
    uncertainty: float | None = field(metadata=entry("uncertainty", ".3g"))
    #: From the errors of the file, in the unit
    estimate: float | None = field(metadata=entry("estimate", ".6g"))

    @staticmethod
    def of(
        file: CalibrationFile, one: Calibration, name: str, estimates: Mapping[str, Mapping[str, float]]
    ) -> CoefficientRow:
        """Return a coefficient of a quantity."""
        deviation = one.deviations[name]
        return CoefficientRow(
            quantity=one.quantity,
            coefficient=name,
            unit=f"{_SHOWN[one.quantity]}{_FACTORS[name.partition('_')[0]]}",
            deviation=deviation,
            uncertainty=None if deviation is None else deviation * file.sigma[one.quantity],
            estimate=estimates.get(one.quantity, {}).get(name),
        )


@dataclass(frozen=True)
class CalibrationResult(Result):
    """What a scheme of positions tells of the coefficients of an inertial measurement unit."""

    rows_in = "coefficients"
    drawn_by = f"{__name__}:calibration_image"

    file: CalibrationFile = field(metadata=INTERNAL)
    several: Sequence[Calibration] = field(metadata=INTERNAL)
    name: str
    #: Number of positions
    positions: int
    #: Number of coefficients that are seen, by quantity
    rank: dict[str, int]
    #: Combinations that leave no trace, by quantity: factors by coefficient
    unseen: Mapping[str, Sequence[Mapping[str, Any]]] = field(
        metadata=entry(write=_texts, kind=dict[str, list[dict[str, str]]])
    )
    coefficients: list[CoefficientRow]
    #: Covariance of the compensated quantity in flight, in squares of its unit; empty without a flight
    remaining: Mapping[str, Any] = field(
        metadata=entry(key="remaining_covariance", kind=dict[str, list[list[float]]])
    )

    @staticmethod
    def of(
        file: CalibrationFile,
        several: Sequence[Calibration],
        estimates: Mapping[str, Mapping[str, float]],
        remaining: Mapping[str, Any],
    ) -> CalibrationResult:
        """Return what the positions of a file tell of each quantity."""
        return CalibrationResult(
            file=file,
            several=several,
            name=file.scheme.name,
            positions=len(file.scheme.positions),
            rank={one.quantity: one.rank for one in several},
            unseen={one.quantity: one.unseen for one in several},
            coefficients=[
                CoefficientRow.of(file, one, name, estimates) for one in several for name in one.names
            ],
            remaining=remaining,
        )

    def text(self) -> str:
        """Return what is seen of each quantity, and how well."""
        lines = [
            f"{self.file.scheme.name}: least squares of {3 * len(self.file.scheme.positions)} errors of each quantity"
        ]
        for one in self.several:
            unit = _SHOWN[one.quantity]
            seen = f"{one.rank} of {len(one.names)} coefficients are seen"
            lost = "; ".join(_combination(row) for row in one.unseen)
            seen += f"; no position shows {lost}" if lost else ""
            lines += ["", f"{one.quantity}, noise {self.file.sigma[one.quantity]:g} {unit}: {seen}", ""]
            rows = [row for row in self.coefficients if row.quantity == one.quantity]
            names = ["coefficient", "unit", "deviation", "uncertainty"]
            names += ["estimate"] if any(row.estimate is not None for row in rows) else []
            lines += reader_table(rows, CoefficientRow, *names).lines()
        lines += [
            "",
            "deviation: for noise of 1; uncertainty: times the noise of the file; -: cannot be estimated",
        ]
        for quantity, covariance in self.remaining.items():
            sigmas = ", ".join(f"{value:.3g}" for value in np.sqrt(np.diag(covariance)))
            lines.append(
                f"left after compensation, {quantity} about or along x, y, z: {sigmas} {_SHOWN[quantity]}"
            )
        return "\n".join(lines)


def _combination(one: Mapping[str, Any]) -> str:
    """Return a combination of coefficients as text."""
    parts = [name if value == 1 else f"({value}) {name}" for name, value in one.items()]
    return " + ".join(parts)


def calibration_image(result: CalibrationResult, path: str | Path) -> bytes:
    """Return the uncertainty of every coefficient as bars, a panel for each quantity; unseen ones are marked."""
    file, several = result.file, result.several
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
