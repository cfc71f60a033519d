"""Coning coefficients, exact or designed for a band or a spectrum, with their residual drift, as results."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from strapgen.catalogue.methods import coning_drift
from strapgen.catalogue.methods.coning import by_form, sample_terms
from strapgen.catalogue.methods.coning_coefficients import SOURCES, Design
from strapgen.catalogue.methods.coning_drift import ConingShape
from strapgen.catalogue.methods.method import sample_names
from strapgen.catalogue.methods.rotation_series import Scalars
from strapgen.catalogue.methods.shaped_coning import ShapedConing
from strapgen.design.coning_design import Lines, annulling
from strapgen.results.records import INTERNAL, entry, reader_table
from strapgen.results.result import Result
from strapgen.results.table import READABLE_UNITS, Column, TextTable

_PAIR_COLUMNS = (Column(align="<"), Column(), Column(spec=".9f", least=12))
#: Where the terms of third and fourth order are to be found, for the forms that have some.
_HIGHER_TERMS = {
    "combined": "kept by the kernels of this form",
    "uncompressed": "kept by method coning-polynomial",
}
#: Frequencies at which the drift is shown, up to the end of the band, or to 3 rad a sample for a spectrum.
_POINTS, _WIDEST = 16, 3.0


@dataclass(frozen=True)
class ConingResult(Result):
    """Coning coefficients and their residual drift; coefficients and residual are text that SymPy can read."""

    design: Design = field(metadata=INTERNAL)
    coefficients: list[str]
    #: Mean drift on coning, computed less true, to second order in the half-angle of the cone
    residual: str = field(metadata=entry(unit="rad/s"))
    #: Its leading term
    leading: str = field(metadata=entry(unit="rad/s"))
    #: The samples of the pairs, older and newer
    pairs: list[list[str]]
    #: Order of a step on any motion
    order: int
    #: By the vector, the coefficients of its scalar products
    third_order: dict[str, dict[str, str]] | None = field(metadata=entry(optional=True))
    fourth_order: dict[str, dict[str, str]] | None = field(metadata=entry(optional=True))

    @staticmethod
    def of(design: Design, terms: bool = False) -> ConingResult:
        """Return a design, with its terms of third and fourth order if they are asked for."""
        names = sample_names(design.increments, design.previous)
        drift = design.residual()
        third, fourth = sample_terms(design.increments, design.previous) if terms else ({}, {})
        by_sample = {names[k]: _products(row, names) for k, row in third.items()}
        by_pair = {f"{names[k]} x {names[m]}": _products(row, names) for (k, m), row in fourth.items()}
        return ConingResult(
            design=design,
            coefficients=[str(c) for c in design.pairs.values()],
            residual=drift.expression,
            leading=drift.leading_expression,
            pairs=[[names[older], names[newer]] for older, newer in design.pairs],
            order=by_form(design.form).step_order(design.increments, design.previous).step,
            third_order=by_sample if terms else None,
            fourth_order=by_pair if terms else None,
        )

    def rows(self) -> list[PairRow]:
        """Return the pairs."""
        both = zip(self.pairs, self.coefficients, self.design.pairs.values(), strict=True)
        return [PairRow(older, newer, text, float(c)) for (older, newer), text, c in both]

    def reader(self) -> TextTable:
        """Return the pairs for a reader."""
        return reader_table(self.rows(), PairRow)

    def latex(self) -> str:
        """Return the correction as a formula."""
        from strapgen.results.display.objects import coning_latex  # loads SymPy

        return coning_latex(self.design)

    def text(self) -> str:
        """Return the coefficients, the residual drift, and the terms of higher order."""
        design = self.design
        lines = [
            f"{design.form} coning coefficients, {_samples_text(design)}",
            f"source of the form: {SOURCES[design.form]}",
            "",
            *_pair_lines(self),
            "",
            "residual: mean drift on coning, computed minus true, rad/s, to second order in alpha",
            f"  {self.residual}",
            f"  leading term {self.leading}",
            "  alpha: half-angle of the cone in rad; omega: its frequency in rad/s; T: time between samples in s",
            f"order of a step on any motion: {self.order}",
        ]
        if design.form in _HIGHER_TERMS:
            lines.append(f"terms of third and fourth order: {_HIGHER_TERMS[design.form]}; --terms lists them")
        for kind, rows in (("third", self.third_order or {}), ("fourth", self.fourth_order or {})):
            if rows:
                lines += ["", f"terms of {kind} order: each vector times its sum of scalar products"]
            for vector, row in rows.items():
                lines.append(f"  {vector} * ({' + '.join(f'{c} {product}' for product, c in row.items())})")
        option = f"--method coning-{design.form} --increments {design.increments}"
        if design.previous:
            option += f" --previous {design.previous}"
        lines += [
            "",
            f"kernels: strapgen derive rotation-vector {option}; euler, dcm and sculling take the same options",
        ]
        return "\n".join(lines).replace("+ -", "- ")


@dataclass(frozen=True)
class PairRow:
    """The coefficient of the cross product of two samples."""

    older: str = field(metadata=entry("older", align="<"))
    newer: str = field(metadata=entry("newer", align="<"))
    coefficient: str = field(metadata=entry("coefficient"))
    decimal: float = field(metadata=entry("decimal", ".9f"))


def _products(row: Scalars, names: list[str]) -> dict[str, str]:
    return {f"{names[i]}.{names[j]}": str(c) for (i, j), c in row.items()}


def _samples_text(design: Design) -> str:
    one = design.increments == 1
    before = f" and {design.previous} before {'it' if one else 'them'}" if design.previous else ""
    return f"{design.increments} {'sample' if one else 'samples'}{before}"


def _pair_lines(result: ConingResult) -> list[str]:
    """Return a line for each pair: its samples, its coefficient exactly and as a decimal."""
    if not result.pairs:
        return ["  one sample has no pairs: there is no correction"]
    rows = [(f"{row.older} x {row.newer}", row.coefficient, row.decimal) for row in result.rows()]
    return TextTable(_PAIR_COLUMNS, rows).lines("  ")


@dataclass(frozen=True)
class ShapedDrift:
    """The drift on coning with coefficients for a band or a spectrum, and with those that annul powers."""

    shape: ShapedConing
    #: The spectrum for which they are designed
    lines: Lines | None = None

    @property
    def _of(self) -> ConingShape:
        return ConingShape(self.shape.increments, self.shape.previous, self.shape.gyro)

    @cached_property
    def annulling(self) -> tuple[Fraction, ...]:
        """The coefficients that annul as many powers of the frequency as there are coefficients."""
        return annulling(self._of)

    @cached_property
    def rows(self) -> list[tuple[float, float, float]]:
        """Frequency in rad a sample, drift of both in rad a step for each squared radian of the half-angle."""
        highest = _WIDEST if self.shape.band is None else float(self.shape.band)
        points = [highest * k / _POINTS for k in range(1, _POINTS + 1)]
        both = [
            coning_drift.errors(self._of, coefficients, points)
            for coefficients in (self.shape.coefficients, self.annulling)
        ]
        return [(b, float(x), float(y)) for b, x, y in zip(points, *both, strict=True)]

    def figures(self) -> dict[str, float]:
        """Return the drift of the coefficients, and of those that annul powers.

        Returns: over a band the largest drift in rad a step; under a spectrum the drift in deg/h for the worst
        phases, and its root mean square for lines of random phases.
        """
        if self.shape.band is not None:
            return {
                "largest_rad_step": coning_drift.largest(self._of, self.shape.coefficients, self.shape.band),
                "largest_annulling_rad_step": coning_drift.largest(self._of, self.annulling, self.shape.band),
            }
        return {
            f"{what}{suffix}_deg_h": value
            for suffix, coefficients in (("", self.shape.coefficients), ("_annulling", self.annulling))
            for what, value in zip(("worst", "random"), self._under_spectrum(coefficients), strict=True)
        }

    def _under_spectrum(self, coefficients: tuple[Fraction, ...]) -> tuple[float, float]:
        assert self.lines is not None, "a design for a spectrum has one"
        errors = coning_drift.errors(self._of, coefficients, self.lines.radians)
        rates = np.array(self.lines.products) * np.array([float(value) for value in errors])
        step = self.shape.increments / float(self.lines.sample_hz)
        _, factor = READABLE_UNITS["rad/s"]
        return (
            float(np.abs(rates).sum()) / step * factor,
            math.sqrt(float((rates**2).sum()) / 2) / step * factor,
        )


def figure_lines(drift: ShapedDrift) -> list[str]:
    """Return the drift of the coefficients as lines of text."""
    figures = drift.figures()
    if drift.shape.band is not None:
        return [
            f"largest drift over the band to {float(drift.shape.band):g} rad a sample, in rad a step: "
            f"{figures['largest_rad_step']:.6g}; annulling powers: {figures['largest_annulling_rad_step']:.3g}"
        ]
    return [
        f"drift under the spectrum for the worst phases: {figures['worst_deg_h']:.3g} deg/h; "
        f"annulling powers: {figures['worst_annulling_deg_h']:.3g} deg/h",
        f"root mean square for lines of random phases: {figures['random_deg_h']:.3g} deg/h; "
        f"annulling powers: {figures['random_annulling_deg_h']:.3g} deg/h",
    ]


@dataclass(frozen=True)
class ReachedDrift:
    """The drift of coefficients, and of those that annul powers, over a band or under a spectrum."""

    #: Largest drift over the band
    largest_rad_step: float | None = field(metadata=entry(optional=True))
    largest_annulling_rad_step: float | None = field(metadata=entry(optional=True))
    #: Drift under the spectrum for the worst phases
    worst_deg_h: float | None = field(metadata=entry(optional=True))
    #: Its root mean square for lines of random phases
    random_deg_h: float | None = field(metadata=entry(optional=True))
    worst_annulling_deg_h: float | None = field(metadata=entry(optional=True))
    random_annulling_deg_h: float | None = field(metadata=entry(optional=True))


@dataclass(frozen=True)
class DriftRow:
    """The drift on coning at a frequency, for each squared radian of the half-angle."""

    frequency_rad_sample: float = field(metadata=entry("rad a sample", ".4g"))
    drift_rad_step: float = field(metadata=entry("these", ".3e"))
    #: With the coefficients that annul powers of the frequency
    drift_annulling_rad_step: float = field(metadata=entry("annulling powers", ".3e"))


@dataclass(frozen=True)
class ShapedResult(Result):
    """Coning coefficients for a band or a spectrum, and their drift; the coefficients are text, exact."""

    rows_in = "drift"

    shaped: ShapedDrift = field(metadata=INTERNAL)
    name: str
    title: str
    source: str
    #: Samples of a step
    samples: int
    #: Samples from before it
    previous: int
    objective: str
    #: Number of powers of the frequency that the coefficients annul
    powers: int
    #: Highest degree of products of two powers of time in the rate for which a step is exact; 0 for none
    products: int
    band_rad_sample: float | None
    gyro: dict[str, Any] | None
    coefficients: tuple[Fraction, ...]
    figures: Mapping[str, float] = field(metadata=entry(spread=True, kind=ReachedDrift))
    drift: list[DriftRow]

    @staticmethod
    def of(drift: ShapedDrift) -> ShapedResult:
        """Return coefficients with their drift."""
        shape = drift.shape
        gyro = None if shape.gyro is None else shape.gyro.plain
        same = (
            "name",
            "title",
            "source",
            "previous",
            "objective",
            "powers",
            "products",
            "coefficients",
        )
        return ShapedResult(
            shaped=drift,
            samples=shape.increments,
            **{name: getattr(shape, name) for name in same},
            band_rad_sample=None if shape.band is None else float(shape.band),
            gyro=gyro,
            figures=drift.figures(),
            drift=[DriftRow(*row) for row in drift.rows],
        )

    def text(self) -> str:
        """Return the coefficients and their drift."""
        drift, shape = self.shaped, self.shaped.shape
        names = sample_names(shape.increments, shape.previous)
        rows = [
            (f"{names[older]} x {names[newer]}", f"{float(c): .15g}")
            for (older, newer), c in reversed(shape.pairs.items())
        ]
        return "\n".join(
            [
                f"{shape.name}: {shape.title}",
                f"source: {shape.source}",
                "",
                *TextTable((Column(align="<"), Column(align="<")), rows).lines("  "),
                "",
                *figure_lines(drift),
                "",
                "drift on coning in rad a step, for each squared radian of the half-angle:",
                *reader_table(self.drift, DriftRow).lines("  "),
                "",
                "the coefficients answer coning in their band alone; on other motion the step is of low order",
                "--format toml --out FILE writes them; --coning FILE takes them wherever --method goes",
            ]
        )
