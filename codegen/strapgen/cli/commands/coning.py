"""strapgen coning."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from strapgen.cli.options import whole
from strapgen.cli.output import Format, check_format, print_json
from strapgen.support import checks
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.catalogue.methods.coning_coefficients import Design
    from strapgen.catalogue.methods.rotation_series import Scalars


def coning(
    samples: Annotated[
        str, typer.Option("--samples", metavar="N", help="Samples of the slow cycle, 1 to 8.")
    ],
    previous: Annotated[
        str,
        typer.Option("--previous", metavar="N", help="Samples before it that are kept, 0 to 3."),
    ] = "0",
    form: Annotated[
        str,
        typer.Option(
            "--form",
            help="compressed: made for coning; uncompressed: for polynomial rates; combined: for both.",
        ),
    ] = "compressed",
    terms: Annotated[
        bool,
        typer.Option(
            "--terms",
            help="List the terms of third and fourth order too, of the polynomial through up to six samples.",
        ),
    ] = False,
    format: Format = "text",
) -> None:
    """Derive coning coefficients for any number of samples exactly, and the drift that they leave.

    A coefficient multiplies older sample x newer sample; the pairs are ordered by the newer sample, then by the older
    one, the newest pair last. The residual is the mean drift on coning in rad/s, computed minus true, to second order
    in alpha, as SymPy reads it, in the symbols alpha (half-angle of the cone in rad), omega (its frequency in rad/s)
    and T (time between samples in s).

    Example: strapgen coning --samples 4 --form combined
    """
    check_format(format)
    from strapgen import catalogue
    from strapgen.catalogue.methods import coning_coefficients as derivation

    count = checks.count("samples", whole("samples", samples), largest=catalogue.MOST_INCREMENTS)
    kept = checks.count("previous", whole("previous", previous), smallest=0, largest=catalogue.MOST_PREVIOUS)
    checks.choice("form", form, derivation.FORMS)
    if terms and count + kept > _MOST_SAMPLES:
        raise InputError(
            f"terms of third and fourth order are listed for up to {_MOST_SAMPLES} samples; {count + kept} are given"
        )
    design = derivation.design(count, kept, form)
    data = _data(design, terms)
    if format == "json":
        print_json(data)
    else:
        typer.echo(_text(design, data))


#: Samples, those kept included, for which terms of third and fourth order are listed.
_MOST_SAMPLES = 6


def _data(design: Design, terms: bool) -> dict[str, Any]:
    from strapgen.catalogue.methods.coning import method, sample_terms
    from strapgen.catalogue.methods.samples import sample_names

    names = sample_names(design.samples, design.previous)
    residual = design.residual()
    order = method(design.form).step_order(design.samples, design.previous)
    data: dict[str, Any] = {
        "coefficients": [str(c) for c in design.pairs.values()],
        "residual": residual.expression,
        "leading": residual.leading_expression,
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


def _text(design: Design, data: dict[str, Any]) -> str:
    from strapgen.catalogue.methods import coning_coefficients as derivation

    before = (
        f" and {design.previous} before {'it' if design.samples == 1 else 'them'}" if design.previous else ""
    )
    samples = f"{design.samples} {'sample' if design.samples == 1 else 'samples'}{before}"
    pairs = [f"{older} x {newer}" for older, newer in data["pairs"]]
    width = max(map(len, pairs), default=0)
    length = max(map(len, data["coefficients"]), default=0)
    lines = [
        f"{design.form} coning coefficients, {samples}",
        f"source of the form: {derivation.SOURCES[design.form]}",
        "",
        *(
            f"  {pair:<{width}}  {c:>{length}}  {float(value):12.9f}"
            for pair, c, value in zip(pairs, data["coefficients"], design.pairs.values(), strict=True)
        ),
        *([] if pairs else ["  one sample has no pairs: there is no correction"]),
        "",
        "residual: mean drift on coning, computed minus true, rad/s, to second order in alpha",
        f"  {data['residual']}",
        f"  leading term {data['leading']}",
        "  alpha: half-angle of the cone in rad; omega: its frequency in rad/s; T: time between samples in s",
        f"order of a step on any motion: {data['order']}",
    ]
    if design.form == "combined":
        lines.append("terms of third and fourth order: kept by the kernels of this form; --terms lists them")
    if design.form == "uncompressed":
        lines.append("terms of third and fourth order: kept by method coning-polynomial; --terms lists them")
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
