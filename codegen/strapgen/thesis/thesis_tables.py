"""Computes the five tables of the thesis again, on every back end."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from strapgen.catalogue import choose_step
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Sources
from strapgen.lab.motions.motions import motion
from strapgen.lab.simulate.runs import Run, largest_increment, simulate
from strapgen.results.records import Record, entry, properties
from strapgen.run.backends import BACKENDS, Backend, backend, sources_to_build
from strapgen.run.backends import DEFAULT_BACKENDS as DEFAULT_BACKENDS
from strapgen.run.compiler import compile_together
from strapgen.thesis.printed_tables import ALGORITHMS as ALGORITHMS
from strapgen.thesis.printed_tables import ORDERS as ORDERS
from strapgen.thesis.printed_tables import SIXTEENTHS, agrees
from strapgen.thesis.printed_tables import TABLES as TABLES
from strapgen.thesis.printed_tables import Table as Table

STEP = Fraction(1, 8)
DURATION = Fraction(180)
INTERVAL = Fraction(5)


def printed_number(figure: str) -> float:
    """Return a figure of the thesis as a number."""
    return float(Fraction(figure))


@dataclass(frozen=True)
class TableEntry(Record):
    """One figure of a table."""

    computed = properties(thesis_printed=entry())

    table: int
    backend: str
    algorithm: str
    #: Order of the integration
    order: int
    #: Drift in degrees
    drift_deg: float
    #: Drift over that of the direction cosine matrix, of first order or (table 3) of the same order
    normalised: float
    #: The figure in the thesis's print
    thesis: str = field(metadata=entry(write=printed_number, kind=float))
    #: Whether `normalised`, rounded or truncated, has the printed digits
    agrees: bool
    #: Remark on the entry
    note: str | None = None
    #: Whether the drift differs from that of the run in double by more than half of it
    roundoff_dominates: bool = False
    #: What the scan of the thesis reads in place of `thesis`; None where it reads that
    scan: str | None = None
    #: What was repaired of the thesis for this entry, its figure or its motion, and why
    repairs: tuple[str, ...] = ()

    @property
    def thesis_printed(self) -> str:
        """The figure as the thesis prints it."""
        return self.thesis


def drift_deg(table: Table, run: Run) -> float:
    """Return the drift of a run as the table reports it."""
    return math.degrees(run.mean_drift if table.mean else float(run.drift_by_axis.max()))


def table_settings(table: Table, backend_name: str, settings: Settings | None) -> Settings | None:
    """Return the settings of fixed point for a table's increments; None for a back end in floating point."""
    if not BACKENDS[backend_name].fixed:
        return None
    profile = motion(table.motion, **table.settings)
    return (settings or Settings()).for_increments(largest_increment(profile, STEP, DURATION, 2))


def entries(
    table: Table, backend_name: str, settings: Settings | None = None, interval: Fraction = INTERVAL
) -> Iterator[TableEntry]:
    """Run every case of a table on one back end.

    `settings`: settings of fixed point beside the largest increment, which is the table's own. `interval`: time
    from one orthonormalization to the next in s; each is recorded.
    """
    chosen = table_settings(table, backend_name, settings)
    profile = motion(table.motion, **table.settings)

    def run(stepper: Backend, every: Fraction | None = interval) -> float:
        return drift_deg(table, simulate(stepper, profile, STEP, DURATION, every, interval))

    def drift(algorithm: str, order: int, every: Fraction | None = interval) -> float:
        return run(backend(algorithm, f"rk{order}", 2, backend_name, settings=chosen), every)

    drifts = {(a, order): drift(a, order) for a in ALGORITHMS for order in ORDERS}
    for (algorithm, order), value in drifts.items():
        normalised = value / drifts["dcm", order if table.by_order else 1]
        printed = table.printed[algorithm][ORDERS.index(order)]
        note = None
        if printed in SIXTEENTHS:
            rounded = SIXTEENTHS[printed]
            note = (
                f"The thesis's {printed} is a sixteenth of its rounded {rounded} and only as exact as that."
            )
        if table.number == 2 and (algorithm, order) == ("dcm", 1):
            try:
                plain = f"{drift('dcm', 1, None):.3f} deg here"
            except InputError:  # the matrix grows out of the format
                plain = "not in this format: the matrix grows to twice its size"
            note = (
                "The thesis prints 2.391 deg for this drift. That it is the run without orthonormalization is an "
                f"inference, which the run proves ({plain}). With it, which the ratios of the table need, it is "
                f"{value:.3f} deg."
            )
        double = value if backend_name == "numpy" else run(backend(algorithm, f"rk{order}", 2, "numpy"))
        yield TableEntry(
            table.number,
            backend_name,
            algorithm,
            order,
            value,
            normalised,
            printed,
            agrees(normalised, printed),
            note,
            abs(value - double) > abs(double) / 2,
            None if (repair := table.repair(algorithm, order)) is None else repair.scan,
            tuple(each.sentence for each in table.repairs_behind(algorithm, order)),
        )


def build_all(
    backends: tuple[str, ...] = DEFAULT_BACKENDS,
    settings: Settings | None = None,
    tables: Sequence[Table] = TABLES,
) -> Iterator[str]:
    """Generate the kernels of the tables, and compile those of a back end in one call of the compiler.

    Where the tables' increments lead to different formats in fixed point, a kernel has several sources of one name, and
    a back end as many calls.
    """
    for name in backends:
        sources: list[Sources] = []
        angles = {table_settings(table, name, settings): table for table in tables}
        for algorithm in ALGORITHMS:
            for order in ORDERS:
                choice = choose_step(algorithm, f"rk{order}", 2)
                for chosen in angles:
                    sources += sources_to_build(choice, name, chosen)
                yield choice.kernel
        compile_together(sources)


def run_tables(
    backends: tuple[str, ...] = DEFAULT_BACKENDS,
    settings: Settings | None = None,
    tables: Sequence[Table] = TABLES,
    interval: Fraction = INTERVAL,
) -> Iterator[TableEntry]:
    """Run tables on several back ends, table by table."""
    for table in tables:
        for name in backends:
            yield from entries(table, name, settings, interval)
