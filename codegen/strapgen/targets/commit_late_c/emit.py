"""Prints C that commits an attitude late and answers it now: the tables of filters, and what goes on between calls."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from strapgen.catalogue.methods.late_filters import NEXT, SHORT, LateFilters, Rows
from strapgen.catalogue.methods.lost_samples import REACH
from strapgen.ir.sources import Function, Sources
from strapgen.support.version import VERSION
from strapgen.targets.c.emit import CPrinter, real_of
from strapgen.targets.rendering import render

#: Kinds of operations that are counted, with what a multiplication of a tap adds.
_COUNTED = ("multiply", "add")


@dataclass(frozen=True)
class CallCost:
    """Multiplications and additions.

    Parameters
    ----------
    multiply, add : int
    """

    multiply: int = 0
    add: int = 0

    def __add__(self, other: CallCost) -> CallCost:
        """Return the sum of two amounts."""
        return CallCost(self.multiply + other.multiply, self.add + other.add)

    def __rmul__(self, times: int) -> CallCost:
        """Return the cost of doing it several times."""
        return CallCost(times * self.multiply, times * self.add)

    def __str__(self) -> str:
        """Return the cost in words."""
        return f"{self.multiply:,} multiply and {self.add:,} add"

    @classmethod
    def of(cls, sources: Sources) -> CallCost:
        """Return the cost of a generated function."""
        return cls(*(sources.operations.get(kind, 0) for kind in _COUNTED))

    @classmethod
    def of_sum(cls, taps: int) -> CallCost:
        """Return the cost of a sum of vectors, each times its tap."""
        return cls(3 * taps, 3 * (taps - 1))


@dataclass(frozen=True)
class LateCosts:
    """What calls of the generated functions cost at most.

    Parameters
    ----------
    commit : CallCost
        A commit with all samples ahead, which nearly every sample is.
    start, gap : CallCost
        The most in one call of ``_push``, at the start and after a gap, both where a gap ends the start.
    now, now_gap : CallCost
        The attitude of now, without a gap and with one.
    """

    commit: CallCost
    start: CallCost
    gap: CallCost
    now: CallCost
    now_gap: CallCost

    @classmethod
    def of(cls, filters: LateFilters, step: Sources, rotation: Sources, normalization: Sources) -> LateCosts:
        """Return the costs with filters and the generated functions."""
        window = filters.window
        rows = len(_sums(filters))
        single = CallCost.of(step)
        other = rows * CallCost.of_sum(filters.samples) + CallCost.of(rotation)
        normal = CallCost.of(normalization)
        commit = single + normal
        restored = CallCost.of_sum(2 * REACH + 1) + CallCost(0, 6)
        before = (
            filters.most_commits - REACH - 1
        )  # at the start, where the gap is the last sample that is waited for
        return cls(
            commit,
            window.previous * (other + normal) + commit,
            before * (other + normal) + (REACH + 1) * commit + restored,
            window.ahead * other,
            (window.ahead * other) + REACH * single,
        )


def whole(
    name: str, title: str, command: str, filters: LateFilters, functions: tuple[Sources, Sources, Sources]
) -> Sources:
    """Generate the C that commits late and answers now.

    Parameters
    ----------
    name : str
        What all names of functions and files begin with.
    title, command : str
        A line for the head of the files, and the command line that generates them.
    filters : LateFilters
    functions : tuple of Sources
        C of the step, of the step from Legendre coefficients and of the normalization, in double or in float.

    Returns
    -------
    Sources
        The files of the whole and those of the functions.
    """
    step, rotation, _ = functions
    real = real_of(step.target)
    state, result = step.function.inputs[0], step.function.outputs[0]
    rows, printer = _sums(filters), CPrinter(real)
    costs = LateCosts.of(filters, *functions)
    values = {
        "name": name,
        "title": title,
        "command": command,
        "version": VERSION,
        "guard": f"{name}_h".upper(),
        "headers": [next(file for file in each.files if file.endswith(".h")) for each in functions],
        "type": real.name,
        "bytes": real.bytes * (state.size + 3 * filters.capacity) + 16,
        "filters": filters,
        "window": filters.window,
        "reach": REACH,
        "short": SHORT,
        "rows": rows,
        "state": state,
        "result": result,
        "functions": [each.function.name for each in functions],
        "call": f"{rotation.function.name}({', '.join(['state', *_coefficients(rows), 'next'])});",
        "identity": _identity(state.size, printer),
        "costs": costs,
        "sets": [_lines(group, rows, printer) for group in filters.sets],
        "shorts": [_lines(group, rows, printer, SHORT) for group in filters.short],
        "restoring": [_line(taps, printer) for taps in filters.restoration],
        "next": _line(NEXT, printer),
    }
    files = {f"{name}.{end}": render(f"commit_late_c/{file}.j2", **values) for end, file in _FILES.items()}
    for each in functions:
        files |= each.step_files
    counts = {kind: sum(each.operations[kind] for each in functions) for kind in step.operations}
    function = Function(name, (state,), (result,))
    return Sources(
        name, step.target, files, function, counts, sum(each.temporaries for each in functions), None
    )


_FILES = {"h": "header.h", "c": "source.c"}


def _sums(filters: LateFilters) -> range:
    """Return the Legendre coefficients that are sums of samples; of an ideal gyro the first one is a sample."""
    return range(0 if filters.window.gyro else 1, filters.degree + 1)


def _coefficients(rows: range) -> list[str]:
    """Return the arguments of the step from Legendre coefficients that hold them."""
    return ["sample"] * rows.start + [f"sums[{number}]" for number in range(len(rows))]


def _identity(size: int, printer: CPrinter) -> list[str]:
    ones = range(0, 9, 4) if size == 9 else (3,)
    return [printer.constant(Fraction(number in ones)) for number in range(size)]


def _lines(group: Rows, rows: Iterable[int], printer: CPrinter, width: int = 0) -> list[str]:
    """Return the filters of an interval as text, a line each, padded with zeros to a width."""
    return [_line((*group[m], *[Fraction(0)] * (width - len(group[m]))), printer) for m in rows]


def _line(taps: Sequence[Fraction], printer: CPrinter) -> str:
    return ", ".join(map(printer.constant, taps))
