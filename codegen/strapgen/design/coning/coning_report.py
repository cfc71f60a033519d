"""Reports coning coefficients, exact ones and those for a band or a spectrum, and the drift that remains."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from strapgen.catalogue.methods import coning_drift
from strapgen.catalogue.methods.coning import method, sample_terms
from strapgen.catalogue.methods.coning_coefficients import SOURCES, Design
from strapgen.catalogue.methods.coning_drift import ConingShape
from strapgen.catalogue.methods.rotation_series import Scalars
from strapgen.catalogue.methods.samples import sample_names
from strapgen.catalogue.methods.shaped_coning import ShapedConing
from strapgen.design.coning.coning import annulling
from strapgen.design.coning.lines import Lines
from strapgen.results.report import Report
from strapgen.results.table import READABLE_UNITS, Column, TextTable

_PAIR_COLUMNS = (Column(align="<"), Column(), Column(spec=".9f", least=12))
#: Where the terms of third and fourth order are to be found, for the forms that have some.
_HIGHER_TERMS = {
    "combined": "kept by the kernels of this form",
    "uncompressed": "kept by method coning-polynomial",
}
#: Frequencies at which the drift is shown, up to the end of the band, or to 3 rad a sample for a spectrum.
_POINTS, _WIDEST = 16, 3.0
_DRIFT_COLUMNS = (
    Column("frequency_rad_sample", spec=".4g"),
    Column("drift_rad_step", spec=".3e"),
    Column("drift_annulling_rad_step", spec=".3e"),
)
_DRIFT_HEADINGS = ("rad a sample", "these", "annulling powers")


def coning_data(design: Design, terms: bool = False) -> dict[str, Any]:
    """Return a design as plain JSON data; coefficients and residual are text that SymPy can read."""
    names = sample_names(design.samples, design.previous)
    drift = design.residual()
    order = method(design.form).step_order(design.samples, design.previous)
    data: dict[str, Any] = {
        "coefficients": [str(c) for c in design.pairs.values()],
        "residual": drift.expression,
        "leading": drift.leading_expression,
        "pairs": [[names[older], names[newer]] for older, newer in design.pairs],
        "order": order.step,
    }
    if terms:
        third, fourth = sample_terms(design.samples, design.previous)
        data["third_order"] = {names[k]: _products(row, names) for k, row in third.items()}
        data["fourth_order"] = {
            f"{names[k]} x {names[m]}": _products(row, names) for (k, m), row in fourth.items()
        }
    return data


def _products(row: Scalars, names: list[str]) -> dict[str, str]:
    return {f"{names[i]}.{names[j]}": str(c) for (i, j), c in row.items()}


def coning_text(design: Design, data: Mapping[str, Any]) -> str:
    """Return a design as text."""
    lines = [
        f"{design.form} coning coefficients, {_samples_text(design)}",
        f"source of the form: {SOURCES[design.form]}",
        "",
        *_pair_lines(design, data),
        "",
        "residual: mean drift on coning, computed minus true, rad/s, to second order in alpha",
        f"  {data['residual']}",
        f"  leading term {data['leading']}",
        "  alpha: half-angle of the cone in rad; omega: its frequency in rad/s; T: time between samples in s",
        f"order of a step on any motion: {data['order']}",
    ]
    if design.form in _HIGHER_TERMS:
        lines.append(f"terms of third and fourth order: {_HIGHER_TERMS[design.form]}; --terms lists them")
    for kind in ("third", "fourth"):
        rows = data.get(f"{kind}_order", {})
        if rows:
            lines += ["", f"terms of {kind} order: each vector times its sum of scalar products"]
        for vector, row in rows.items():
            lines.append(f"  {vector} * ({' + '.join(f'{c} {product}' for product, c in row.items())})")
    option = f"--method coning-{design.form} --increments {design.samples}"
    if design.previous:
        option += f" --previous {design.previous}"
    lines += [
        "",
        f"kernels: strapgen derive rotation-vector {option}; euler, dcm and sculling take the same options",
    ]
    return "\n".join(lines).replace("+ -", "- ")


def coning_report(design: Design, data: Mapping[str, Any]) -> Report:
    """Return a design as a report, whose table has a row for each pair; parameters as for `coning_text`."""
    columns = (
        Column("older", "<"),
        Column("newer", "<"),
        Column("coefficient"),
        Column("decimal", spec=".9f"),
    )

    def table() -> TextTable:
        pairs = zip(data["pairs"], data["coefficients"], design.pairs.values(), strict=True)
        return TextTable(columns, [(older, newer, text, float(c)) for (older, newer), text, c in pairs])

    def latex() -> str:
        from strapgen.results.display.methods import coning_latex  # loads SymPy

        return coning_latex(design)

    return Report(lambda: coning_text(design, data), lambda: data, table, latex=latex)


def _samples_text(design: Design) -> str:
    one = design.samples == 1
    before = f" and {design.previous} before {'it' if one else 'them'}" if design.previous else ""
    return f"{design.samples} {'sample' if one else 'samples'}{before}"


def _pair_lines(design: Design, data: Mapping[str, Any]) -> list[str]:
    """Return a line for each pair: its samples, its coefficient exactly and as a decimal."""
    if not design.pairs:
        return ["  one sample has no pairs: there is no correction"]
    rows = [
        (f"{older} x {newer}", text, float(number))
        for (older, newer), text, number in zip(
            data["pairs"], data["coefficients"], design.pairs.values(), strict=True
        )
    ]
    return TextTable(_PAIR_COLUMNS, rows).lines("  ")


@dataclass(frozen=True)
class ShapedDrift:
    """The drift on coning with coefficients for a band or a spectrum, and with those that annul powers."""

    shape: ShapedConing
    #: The spectrum for which they are designed
    lines: Lines | None = None

    @property
    def _of(self) -> ConingShape:
        return ConingShape(self.shape.samples, self.shape.previous, self.shape.gyro)

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
        """Return what the coefficients reach, and what those reach that annul powers.

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
        step = self.shape.samples / float(self.lines.sample_hz)
        _, factor = READABLE_UNITS["rad/s"]
        return (
            float(np.abs(rates).sum()) / step * factor,
            math.sqrt(float((rates**2).sum()) / 2) / step * factor,
        )


def shaped_data(drift: ShapedDrift) -> dict[str, Any]:
    """Return coefficients and their drift as plain JSON data; the coefficients are text, exact."""
    shape = drift.shape
    return {
        "name": shape.name,
        "title": shape.title,
        "source": shape.source,
        "samples": shape.samples,
        "previous": shape.previous,
        "objective": shape.objective,
        "powers": shape.powers,
        "products": shape.products,
        "band_rad_sample": None if shape.band is None else float(shape.band),
        "gyro": None
        if shape.gyro is None
        else {key: float(value) for key, value in vars(shape.gyro).items()},
        "coefficients": [str(c) for c in shape.coefficients],
        **drift.figures(),
        "drift": [
            dict(zip((column.header for column in _DRIFT_COLUMNS), row, strict=True)) for row in drift.rows
        ],
    }


def shaped_text(drift: ShapedDrift) -> str:
    """Return coefficients and their drift as text."""
    shape = drift.shape
    names = sample_names(shape.samples, shape.previous)
    rows = [
        (f"{names[older]} x {names[newer]}", f"{float(c): .15g}")
        for (older, newer), c in reversed(shape.pairs.items())
    ]
    columns = [
        Column(heading, spec=column.spec)
        for heading, column in zip(_DRIFT_HEADINGS, _DRIFT_COLUMNS, strict=True)
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
            *TextTable(columns, drift.rows).lines("  "),
            "",
            "the coefficients answer coning in their band alone; on other motion the step is of low order",
            "--format toml --out FILE writes them; --coning FILE takes them wherever --method goes",
        ]
    )


def figure_lines(drift: ShapedDrift) -> list[str]:
    """Return what the coefficients reach as lines of text."""
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


def shaped_report(drift: ShapedDrift) -> Report:
    """Return coefficients and their drift as a report, whose table has the drift over the band."""
    return Report(
        lambda: shaped_text(drift),
        lambda: shaped_data(drift),
        lambda: TextTable(_DRIFT_COLUMNS, drift.rows),
    )
