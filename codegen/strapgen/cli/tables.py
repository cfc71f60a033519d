"""strapgen tables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from strapgen.cli.options import Format, check_format, print_json
from strapgen.cli.progress import track

if TYPE_CHECKING:
    from strapgen.tables import Entry, Table


def tables(
    backend: Annotated[
        str | None, typer.Option("--backend", help="numpy, c or c-float.  [default: all]", show_default=False)
    ] = None,
    format: Format = "text",
) -> None:
    """Run the five tables of the thesis and print them beside its figures.

    Example: strapgen tables --backend c
    """
    check_format(format)
    from strapgen import checks
    from strapgen.backends import BACKENDS
    from strapgen.tables import ALGORITHMS, ORDERS, TABLES, run_tables

    names = tuple(BACKENDS) if backend is None else (checks.choice("backend", backend, BACKENDS),)
    total = len(TABLES) * len(names) * len(ALGORITHMS) * len(ORDERS)
    entries = list(track(run_tables(names), "simulating", total))
    if format == "json":
        print_json([entry.as_dict() for entry in entries])
        return
    for table in TABLES:
        _print_table(table, [entry for entry in entries if entry.table == table.number])


_NAMES = {"dcm": "direction cosines", "euler": "Euler parameters"}


def _print_table(table: Table, entries: list[Entry]) -> None:
    """Print one table, a line for each back end and algorithm."""
    from strapgen.tables import ORDERS

    base = f"; the thesis's base drift {table.base} deg" if table.base else ""
    ratio = "to direction cosines of the same order" if table.by_order else "to direction cosines of first order"
    typer.echo(f"Table {table.number}: {table.title}")
    typer.echo(f"  drift in deg, and its ratio {ratio}{base}")
    heads = "".join(f"  {f'order {order}':<35}" for order in ORDERS)
    typer.echo(f"  {'':<26}{heads}".rstrip())
    columns = f"  {'drift':<12}{'ratio':<13}{'thesis':<10}" * len(ORDERS)
    typer.echo(f"  {'':<26}{columns}".rstrip())
    by_line: dict[tuple[str, str], list[Entry]] = {}
    for entry in entries:
        by_line.setdefault((entry.backend, entry.algorithm), []).append(entry)
    for (backend, algorithm), line in by_line.items():
        cells = "".join(
            f"  {e.drift_deg:<12.4g}{e.normalised:<13.4g}{e.thesis + ('' if e.agrees else ' *'):<10}" for e in line
        )
        typer.echo(f"  {backend:<8}{_NAMES[algorithm]:<18}{cells}".rstrip())
    for note in dict.fromkeys(entry.note for entry in entries if entry.note):
        typer.echo(f"  {note}")
    if not all(entry.agrees for entry in entries):
        typer.echo("  * differs from the thesis in its printed digits")
    typer.echo("")
