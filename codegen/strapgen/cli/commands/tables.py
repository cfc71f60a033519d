"""The command ``strapgen tables`` computes the five tables of the thesis."""

from __future__ import annotations

from typing import Annotated

import typer

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import whole
from strapgen.cli.output import Format, check_format, print_json
from strapgen.cli.progress import track
from strapgen.support.exceptions import InputError


@grouped
def tables(
    *,
    backend: Annotated[
        str | None,
        typer.Option(
            "--backend",
            help="Back end; strapgen list shows all.  [default: all but fixed-model and exact, which are slow]",
            show_default=False,
        ),
    ] = None,
    table: Annotated[
        str | None,
        typer.Option(
            "--table", help="Number of the only table to compute.  [default: all five]", show_default=False
        ),
    ] = None,
    fixed: Annotated[FixedOptions, Shown(only=("rounding", "carry"))],
    predict: Annotated[
        bool,
        typer.Option(
            "--predict",
            help="Predict every figure from the truncation-error series, and show it beside a simulation in numpy.",
        ),
    ] = False,
    format: Format = "text",
) -> None:
    """Compute the five tables of the thesis again, or one of them, and print the results beside its figures.

    Example: strapgen tables --backend c-q31 --carry full
    """
    check_format(format)
    if predict:
        for option in [o for o, v in (("--backend", backend), ("--table", table)) if v is not None] + [
            *fixed.stated
        ]:
            raise InputError(f"--predict and {option} do not go together")
        _predict(format)
        return
    from strapgen.backends import BACKENDS
    from strapgen.experiments.thesis_tables import ALGORITHMS, ORDERS, TABLES, build_all, run_tables
    from strapgen.reports.thesis_tables import thesis_table_text
    from strapgen.support import checks

    names = _runnable() if backend is None else (checks.choice("backend", backend, BACKENDS),)
    settings = fixed.settings(2)
    if settings is not None and not any(BACKENDS[name].fixed for name in names):
        raise InputError(f"--rounding and --carry are for fixed-point back ends, not for {', '.join(names)}")
    number = None if table is None else checks.count("table", whole("table", table), largest=len(TABLES))
    chosen = [each for each in TABLES if number in (None, each.number)]
    cases = len(names) * len(ALGORITHMS) * len(ORDERS)
    for _ in track(build_all(names, settings, chosen), "building", cases):
        pass
    entries = list(track(run_tables(names, settings, chosen), "simulating", cases * len(chosen)))
    if format == "json":
        print_json([entry.as_dict() for entry in entries])
        return
    for each in chosen:
        here = [entry for entry in entries if entry.table == each.number]
        typer.echo(f"{thesis_table_text(each, here)}\n")


def _predict(format: str) -> None:
    """Print the tables as the series predict them, and the ratios that the thesis reads from its tables."""
    from strapgen.analysis import ratios
    from strapgen.experiments import predicted_tables
    from strapgen.experiments.thesis_tables import ALGORITHMS, ORDERS, TABLES
    from strapgen.reports.predicted_tables import predicted_text
    from strapgen.reports.ratios import claims_text

    cases = len(TABLES) * len(ALGORITHMS) * len(ORDERS)
    entries = list(track(predicted_tables.predicted(), "predicting", cases))
    claims = ratios.claims()
    if format == "json":
        print_json(
            {
                "entries": [entry.as_dict() for entry in entries],
                "ratios": [claim.as_dict() for claim in claims],
            }
        )
        return
    typer.echo(predicted_text(entries))
    typer.echo(claims_text(claims))


def _runnable() -> tuple[str, ...]:
    """Return all back ends, or, with a word on stderr, those that need no compiler if there is none."""
    from strapgen.experiments.thesis_tables import DEFAULT_BACKENDS
    from strapgen.support.exceptions import CompilerError
    from strapgen.toolchain import compiler

    try:
        compiler.compiler()
    except CompilerError as error:
        typer.echo(f"strapgen: only numpy is shown: {error}", err=True)
        return ("numpy",)
    return DEFAULT_BACKENDS
