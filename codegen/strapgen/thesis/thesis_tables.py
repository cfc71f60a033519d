"""Computes the five tables of the thesis again, on every back end."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from fractions import Fraction
from typing import ClassVar

from strapgen.catalogue import choose_step
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Sources
from strapgen.lab.motions.motions import motion
from strapgen.lab.runs import Run, largest_increment, simulate
from strapgen.results.records import Properties, Record, entry, properties
from strapgen.run.backends import BACKENDS, Backend, backend, sources_to_build
from strapgen.run.backends import DEFAULT_BACKENDS as DEFAULT_BACKENDS
from strapgen.run.compiler import compile_together

STEP = Fraction(1, 8)
DURATION = Fraction(180)
INTERVAL = Fraction(5)

ALGORITHMS = ("dcm", "euler")
ORDERS = (1, 2, 4)

#: Printed figures that the thesis worked out from other printed figures, by 1/16.
SIXTEENTHS = {".75e-6": ".12e-4", ".225e-5": ".36e-4"}

#: The thesis gives table 3 as fractions, whose exactness it does not state; its other tables have two digits.
_FRACTION_TOLERANCE = 5e-3


@dataclass(frozen=True)
class Repair:
    """A correction of a misread figure in the scan of the thesis."""

    #: What is read in its place
    figure: str
    #: What the scan reads; a question mark stands for an illegible exponent
    scan: str
    #: Why the figure is what it is, as a sentence
    reason: str
    #: Its place in the table; "" and 0 for what the whole table rests on, its motion
    algorithm: str = ""
    order: int = 0

    @property
    def sentence(self) -> str:
        """The repair in words for a reader."""
        return f"{self.figure} is repaired, the scan reads {self.scan}: {self.reason}"


@dataclass(frozen=True)
class Table:
    """One of the thesis's tables."""

    number: int
    #: Motion of the table in words
    title: str
    #: The motion and its parameters
    motion: str
    settings: dict[str, int]
    #: Whether the drift is the mean over the axes, or that of the worst axis
    mean: bool
    #: The printed figures by algorithm and order, corrected where the transcription says so
    printed: dict[str, tuple[str, str, str]]
    #: Printed drift of the first-order direction cosine matrix in degrees; "" if there is none
    base: str = ""
    #: Whether a figure is the ratio to the direction cosine matrix of the same order, or of first order
    by_order: bool = False
    #: Figures of the table, and of its motion, that are not what the scan reads
    repairs: tuple[Repair, ...] = ()

    def repair(self, algorithm: str, order: int) -> Repair | None:
        """Return the repair of a figure; None if the scan has it as it is used here."""
        return next(
            (each for each in self.repairs if (each.algorithm, each.order) == (algorithm, order)), None
        )

    def repairs_behind(self, algorithm: str, order: int) -> list[Repair]:
        """Return the repairs that affect a figure: its own, and those of the table's motion."""
        return [
            each for each in self.repairs if (each.algorithm, each.order) in ((algorithm, order), ("", 0))
        ]


def _coning(rate: int) -> dict[str, int]:
    return {"a_deg_s": rate, "b_deg_s": rate, "g_deg_s": rate}


_SIGN = Repair(
    "The rate a sin bt on axis x",
    "-a sin bt",
    "chapter 4 and appendix A have +a sin bt, with which Tables 4 and 5 come out; with -a the bases are "
    "others, 0.140 deg instead of 0.0625 deg.",
)


TABLES = (
    Table(
        1,
        "constant rate of 10 deg/s on one axis",
        "constant",
        {"y_deg_s": 10},
        False,
        {"dcm": ("1", ".5", ".12e-4"), "euler": (".25", ".125", ".75e-6")},
        "0.285",
        repairs=(
            Repair(
                ".75e-6",
                ".75e-?",
                "the exponent is illegible; the text has a sixteenth of .12e-4.",
                "euler",
                4,
            ),
        ),
    ),
    Table(
        2,
        "constant rate of 10 deg/s on three axes",
        "constant",
        {"x_deg_s": 10, "y_deg_s": 10, "z_deg_s": 10},
        False,
        {"dcm": ("1", ".5", ".36e-4"), "euler": (".25", ".125", ".225e-5")},
        repairs=(
            Repair(
                ".36e-4",
                ".26e-4",
                "the text has three times .12e-4, and .225e-5 is a sixteenth of .36e-4.",
                "dcm",
                4,
            ),
            Repair(
                ".225e-5",
                ".225e-?",
                "the exponent is illegible; the text has a sixteenth of .36e-4.",
                "euler",
                4,
            ),
        ),
    ),
    Table(
        3,
        "sinusoidal rate b cos(b t) on one axis, b = 10 deg/s",
        "sinusoidal",
        {"a_deg_s": 10, "b_deg_s": 10},
        False,
        {"dcm": ("1", "1", "1"), "euler": ("1", "1/4", "1/16")},
        by_order=True,
    ),
    Table(
        4,
        "coning on a constant pitch rate, a = b = g = 1 deg/s",
        "coning",
        _coning(1),
        True,
        {"dcm": ("1", ".71e-2", ".30e-8"), "euler": ("1", ".27e-2", ".16e-9")},
        "6.25e-2",
        repairs=(
            Repair(
                ".30e-8",
                ".30e-3",
                "Euler parameters have .16e-9 beside it, and the run has 3.07e-9.",
                "dcm",
                4,
            ),
            Repair(
                "b = 1 deg/s",
                "b = .1",
                "with b = 0.1 deg/s the base would be 0.00942 deg, where 6.25e-2 deg is printed.",
            ),
            _SIGN,
        ),
    ),
    Table(
        5,
        "coning on a constant pitch rate, a = b = g = 10 deg/s",
        "coning",
        _coning(10),
        True,
        {"dcm": ("1", ".44", ".19e-4"), "euler": (".66", ".16", ".23e-6")},
        "1.02",
        repairs=(
            Repair(".23e-6", ".23e-?", "the exponent is illegible; the run has 2.30e-7.", "euler", 4),
            _SIGN,
        ),
    ),
)


def printed_number(figure: str) -> float:
    """Return a figure of the thesis as a number."""
    return float(Fraction(figure))


def agrees(value: float, printed: str) -> bool:
    """Return whether a figure has the digits that the thesis prints.

    The thesis rounds some figures and truncates others: a figure up to half a unit below the printed one agrees, and so
    does one less than a unit above it. The entries .75e-6 and .225e-5 are sixteenths of the printed .12e-4 and .36e-4
    and only as exact as those.

    >>> agrees(1.87e-5, ".19e-4"), agrees(7.16e-3, ".71e-2"), agrees(7.3e-3, ".71e-2")
    (True, True, False)
    >>> agrees(7.439e-7, ".75e-6")
    True
    """
    if printed in SIXTEENTHS:
        return agrees(16 * value, SIXTEENTHS[printed])
    if "/" in printed:
        return math.isclose(value, float(Fraction(printed)), rel_tol=_FRACTION_TOLERANCE)
    figure = Decimal(printed)
    digits = 2 if figure == 1 else len(printed.partition("e")[0].partition(".")[2])
    unit = Decimal(1).scaleb(int(printed.partition("e")[2] or 0) - digits)
    return -unit / 2 <= Decimal(value) - figure < unit


@dataclass(frozen=True)
class TableEntry(Record):
    """One figure of a table."""

    computed: ClassVar[Properties] = properties(thesis_printed=entry())

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
