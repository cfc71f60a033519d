"""strapgen tables."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Annotated

import typer

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.output import Format, check_format, print_json
from strapgen.cli.progress import track
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.experiments.thesis_tables import Table, TableEntry


@grouped
def tables(
    *,
    backend: Annotated[
        str | None,
        typer.Option(
            "--backend",
            help="numpy, c, c-float, c-q31, c-q15 or fixed-model.  [default: all but the model]",
            show_default=False,
        ),
    ] = None,
    fixed: Annotated[FixedOptions, Shown(only=("rounding", "carry"))],
    predict: Annotated[
        bool,
        typer.Option(
            "--predict",
            help="Predict every figure from the truncation-error series, beside a simulation in numpy.",
        ),
    ] = False,
    format: Format = "text",
) -> None:
    """Run the five tables of the thesis and print them beside its figures.

    Example: strapgen tables --backend c-q31 --carry full
    """
    check_format(format)
    if predict:
        for option in [*([] if backend is None else ["--backend"]), *fixed.stated]:
            raise InputError(f"--predict and {option} do not go together")
        _predict(format)
        return
    from strapgen.backends import BACKENDS
    from strapgen.experiments.thesis_tables import ALGORITHMS, ORDERS, TABLES, build_all, run_tables
    from strapgen.support import checks
    from strapgen.targets import FIXED

    names = _runnable() if backend is None else (checks.choice("backend", backend, BACKENDS),)
    settings = fixed.settings(2)
    if settings is not None and not any(BACKENDS[name].target in FIXED for name in names):
        raise InputError(f"--rounding and --carry are for fixed-point back ends, not for {', '.join(names)}")
    cases = len(names) * len(ALGORITHMS) * len(ORDERS)
    for _ in track(build_all(names, settings), "building", cases):
        pass
    entries = list(track(run_tables(names, settings), "simulating", cases * len(TABLES)))
    if format == "json":
        print_json([entry.as_dict() for entry in entries])
        return
    for table in TABLES:
        _print_table(table, [entry for entry in entries if entry.table == table.number])


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


def _mark(entry: TableEntry) -> str:
    """Return what stands behind a figure: round-off says more than that the figure is not the thesis's."""
    return "r" if entry.roundoff_dominates else "" if entry.agrees else "*"


_NAMES = {"dcm": "direction cosines", "euler": "Euler parameters"}


def _print_table(table: Table, entries: list[TableEntry]) -> None:
    """Print one table: for each algorithm the thesis's line, then one for each back end."""
    from strapgen.experiments.thesis_tables import ALGORITHMS, ORDERS

    ratio = "of the same order" if table.by_order else "of first order"
    lines = [f"Table {table.number}: {table.title}"]
    lines.append(f"  drift in deg, and its ratio to that of direction cosines {ratio}")
    lines.append(" " * 14 + "".join(f"{f'order {order}':>20}    " for order in ORDERS))
    lines.append(" " * 14 + f"{'drift':>11}{'ratio':>11}  " * len(ORDERS))
    for algorithm in ALGORITHMS:
        lines.append(f"  {_NAMES[algorithm]}")
        drifts = [table.base if (algorithm, order) == ("dcm", 1) else "" for order in ORDERS]
        printed = zip(drifts, table.printed[algorithm], strict=True)
        lines.append(
            f"    {'thesis':<10}" + "".join(f"{drift:>11}{figure:>11}  " for drift, figure in printed)
        )
        for backend in dict.fromkeys(entry.backend for entry in entries):
            cells = [
                f"{e.drift_deg:>11.4g}{e.normalised:>11.4g}{_mark(e):<2}"
                for e in entries
                if (e.backend, e.algorithm) == (backend, algorithm)
            ]
            lines.append(f"    {backend:<10}" + "".join(cells))
    if not all(entry.agrees for entry in entries):
        lines.append("  * not the thesis's figure in its printed digits")
    if any(entry.roundoff_dominates for entry in entries):
        lines.append("  r round-off dominates: over half of what the method itself loses")
    notes: dict[tuple[str, int], str] = {}
    for entry in entries:
        if entry.note:  # back ends differ in its figures alone; the first one's stand for all
            notes.setdefault((entry.algorithm, entry.order), entry.note)
    for note in notes.values():
        lines += [f"  {line}" for line in textwrap.wrap(note, 90)]
    typer.echo("\n".join(line.rstrip() for line in lines) + "\n")
