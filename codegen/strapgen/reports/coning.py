"""Reports coning coefficients, and the drift that remains with them, as plain data and as text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from strapgen.catalogue.methods.coning import method, sample_terms
from strapgen.catalogue.methods.coning_coefficients import SOURCES, Design
from strapgen.catalogue.methods.rotation_series import Scalars
from strapgen.catalogue.methods.samples import sample_names
from strapgen.reports.report import Report
from strapgen.reports.table import Column, TextTable

_PAIR_COLUMNS = (Column(align="<"), Column(), Column(spec=".9f", least=12))
#: Where the terms of third and fourth order are to be found, for the forms that have some.
_HIGHER_TERMS = {
    "combined": "kept by the kernels of this form",
    "uncompressed": "kept by method coning-polynomial",
}


def coning_data(design: Design, terms: bool = False) -> dict[str, Any]:
    """Return a design as plain JSON data; coefficients and residual are text that SymPy can read.

    Parameters
    ----------
    design : Design
    terms : bool, optional
        Whether the terms of third and fourth order follow, of the polynomial through the samples.
    """
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
    """Return a design as text.

    Parameters
    ----------
    design : Design
    data : mapping
        What `coning_data` returns for the design.
    """
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

    return Report(lambda: coning_text(design, data), lambda: data, table)


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
