"""The command ``strapgen tables`` computes the five tables of the thesis."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from strapgen.cli import terminal
from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Excludes, Shown, grouped, rules
from strapgen.cli.options import FastBackends, option
from strapgen.cli.output import TEXT_OUTPUT, Output
from strapgen.cli.progress import track
from strapgen.cli.values import Positive, whole
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.thesis.thesis_tables import TableEntry


@grouped
@rules(Excludes("--predict", "--backend --table --orthonormalize @fixed"))
def tables(
    *,
    backend: FastBackends = None,
    table: Annotated[
        int | None,
        option(
            "--table",
            metavar="N",
            help="Number of the only table to compute.  [default: all five]",
            panel="Algorithm",
            read=whole(1, 5),
        ),
    ] = None,
    orthonormalize: Annotated[
        Positive,
        option(
            "--orthonormalize",
            metavar="S",
            help="Time from one orthonormalization, and record, to the next in s; the thesis has 5 s and 10 s.",
            panel="Run",
        ),
    ] = Positive("5"),
    predict: Annotated[
        bool,
        option(
            "--predict",
            help="Predict every figure from the truncation-error series, and show it beside a simulation in numpy.",
            panel="Algorithm",
        ),
    ] = False,
    fixed: Annotated[FixedOptions, Shown(only=("rounding", "carry"))],
    output: Output,
) -> None:
    """Compute the tables of the thesis beside its printed figures.

    Example: strapgen tables --backend c-fixed32 --carry full
    """
    output.check()
    if predict:
        return _predict(output)
    from strapgen.thesis.tables_report import ThesisTablesResult

    output.show(ThesisTablesResult(_simulate(backend or runnable(), table, orthonormalize, fixed)))


def _simulate(
    names: tuple[str, ...], table: int | None, orthonormalize: Positive, fixed: FixedOptions
) -> list[TableEntry]:
    """Return the entries of the tables, or of one of them, on some back ends."""
    from strapgen.run.backends import BACKENDS
    from strapgen.thesis.thesis_tables import (
        ALGORITHMS,
        DURATION,
        ORDERS,
        STEP,
        TABLES,
        build_all,
        run_tables,
    )

    settings = fixed.settings(2)
    if settings is not None and not any(BACKENDS[name].fixed for name in names):
        raise InputError(f"--rounding and --carry are for fixed-point back ends, not for {', '.join(names)}")
    chosen = [each for each in TABLES if table in (None, each.number)]
    checks.multiple("orthonormalize", orthonormalize, "step", STEP)
    checks.multiple("duration", DURATION, "orthonormalize", orthonormalize)
    cases = len(names) * len(ALGORITHMS) * len(ORDERS)
    for _ in track(build_all(names, settings, chosen), "building", cases):
        pass
    runs = run_tables(names, settings, chosen, orthonormalize)
    return list(track(runs, "simulating", cases * len(chosen)))


def _predict(output: Output) -> None:
    """Deliver the tables as the series predict them, and the ratios that the thesis reads from its tables."""
    from strapgen.analysis import ratios
    from strapgen.thesis import predicted_tables
    from strapgen.thesis.predicted_tables import PredictedTablesResult
    from strapgen.thesis.thesis_tables import ALGORITHMS, ORDERS, TABLES

    cases = len(TABLES) * len(ALGORITHMS) * len(ORDERS)
    entries = list(track(predicted_tables.predicted(), "predicting", cases))
    output.show(PredictedTablesResult(entries, ratios.claims()))


def runnable() -> tuple[str, ...]:
    """Return all back ends, or, with a word on stderr, those that need no compiler if there is none."""
    from strapgen.ir.exceptions import CompilerError
    from strapgen.run import compiler
    from strapgen.thesis.thesis_tables import DEFAULT_BACKENDS

    try:
        compiler.C.path()
    except CompilerError as error:
        terminal.remark(f"strapgen: only numpy is shown: {error}")
        return ("numpy",)
    return DEFAULT_BACKENDS


@grouped
def statements(*, output: Annotated[Output, Shown(only=TEXT_OUTPUT)]) -> None:
    """Test the statements of the thesis's text by runs.

    Chapter 5 of the thesis makes fourteen statements beside its tables. Each is shown with the numbers of the runs that
    test it, and a verdict.

    Example: strapgen statements --format markdown
    """
    output.check()
    from strapgen.thesis.thesis_statements import COUNT, StatementsResult
    from strapgen.thesis.thesis_statements import statements as runs

    output.show(StatementsResult(list(track(runs(), "simulating", COUNT))))
