"""Prints C that commits an attitude late and answers it now: the tables of filters, and what goes on between calls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeVar

from strapgen.design.commit_late.fixed_filters import NORMALIZED_EVERY, FixedFilters
from strapgen.design.commit_late.late_filters import NEXT, SHORT, LateFilters
from strapgen.design.commit_late.lost_samples import REACH
from strapgen.ir.formats import above
from strapgen.ir.interfaces import Argument
from strapgen.ir.kernel_info import KernelInfo
from strapgen.ir.sources import Function, Sources
from strapgen.ir.version import VERSION
from strapgen.targets.c.emit import CPrinter, real_of
from strapgen.targets.rendering import render

_Tap = TypeVar("_Tap", int, Fraction)
#: Kinds of operations that are counted, with what a multiplication of a tap adds.
_COUNTED = ("multiply", "add")


@dataclass(frozen=True)
class CallCost:
    """Multiplications and additions."""

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
    """What calls of the generated functions cost at most."""

    #: A commit with all samples ahead, which nearly every sample is
    commit: CallCost
    #: The most in one call of ``_push``, at the start and after a gap, both where a gap ends the start
    start: CallCost
    gap: CallCost
    #: The attitude of now, without a gap and with one
    now: CallCost
    now_gap: CallCost

    @classmethod
    def of(cls, filters: LateFilters, step: Sources, rotation: Sources, normalization: Sources) -> LateCosts:
        """Return the costs with filters and the generated functions."""
        window = filters.window
        rows = len(filters.sums)
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
    name: str,
    title: str,
    command: str,
    filters: LateFilters,
    functions: tuple[Sources, Sources, Sources],
    fixed: FixedFilters | None = None,
) -> Sources:
    """Generate the C that commits late and answers now."""
    step, rotation, normalization = functions
    state, result = step.function.inputs[0], step.function.outputs[0]
    rows = filters.sums
    values = {
        "name": name,
        "title": title,
        "command": command,
        "version": VERSION,
        "guard": f"{name}_h".upper(),
        "headers": [next(file for file in each.files if file.endswith(".h")) for each in functions],
        "filters": filters,
        "window": filters.window,
        "reach": REACH,
        "short": SHORT,
        "rows": rows,
        "state": state,
        "result": result,
        "functions": [each.function.name for each in functions],
        "call": f"{rotation.function.name}({', '.join(['state', *_coefficients(rows), 'next'])});",
        "costs": LateCosts.of(filters, *functions),
        **(
            _in_floating_point(filters, step)
            if fixed is None
            else _in_fixed_point(filters, fixed, step, normalization)
        ),
    }
    files = {f"{name}.{end}": render(f"commit_late_c/{file}.j2", **values) for end, file in _FILES.items()}
    for each in functions:
        files |= each.step_files
    counts = {kind: sum(each.operations[kind] for each in functions) for kind in step.operations}
    temporaries = sum(each.temporaries for each in functions)
    function = Function(name, (state,), (result,))
    info = KernelInfo(name, title, filters.window.source)
    return Sources(info, step.target, files, function, counts, temporaries, step.fixed)


def _in_floating_point(filters: LateFilters, step: Sources) -> dict[str, object]:
    """Return what templates take of numbers in double or in float."""
    real, rows = real_of(step.target), filters.sums
    printer, size = CPrinter(real), step.function.inputs[0].size
    return {
        "fixed": None,
        "residuals": (),
        "type": real.name,
        "status": "void",
        "result_text": "",
        "bytes": real.bytes * (size + 3 * filters.capacity) + 16,
        "counts": "four",
        "unit_text": "unit 1",
        "sample_text": "unit rad; any finite number",
        "identity": [printer.constant(Fraction(one)) for one in _identity(size)],
        "sets": [[_line(group[m], printer) for m in rows] for group in filters.sets],
        "shorts": [[_line(_padded(group[m], Fraction(0)), printer) for m in rows] for group in filters.short],
        "restoring": [_line(taps, printer) for taps in filters.restoration],
        "next": _line(NEXT, printer),
    }


def _in_fixed_point(
    filters: LateFilters, fixed: FixedFilters, step: Sources, normalization: Sources
) -> dict[str, object]:
    """Return what templates take of integers."""
    assert step.fixed is not None
    assert normalization.fixed is not None
    state, samples = step.fixed.inputs
    one, size = 1 << state.format.fraction, state.signal.size
    feedback = step.fixed.residuals
    return {
        "fixed": fixed,
        "residuals": [{"place": place, "fresh": word.fresh} for place, word in enumerate(feedback)],
        "normalized_residuals": bool(normalization.fixed.residuals),
        "every": NORMALIZED_EVERY,
        "now_errors": [above(error) for error in fixed.now_errors],
        "state_argument": state,
        "sample_argument": samples,
        "type": f"int{state.format.word}_t",
        "status": "int",
        "result_text": "status = ",
        "bytes": state.format.word // 8 * (size + 3 * filters.capacity + len(feedback)) + 20,
        "counts": "five",
        "unit_text": f"format {state.format}, unit 2^-{state.format.fraction}",
        "sample_text": f"{_unit(samples)}; range -{fixed.limit} to {fixed.limit}, for a sum of two intervals twice "
        "that",
        "identity": [str(one if number else 0) for number in _identity(size)],
        "sets": [[_text(row) for row in group] for group in fixed.sets],
        "shorts": [[_text(_padded(row, 0)) for row in group] for group in fixed.short],
        "restoring": [_text(row) for row in fixed.restoring],
        "next": _text([int(2 * tap) for tap in NEXT]),
    }


def _unit(samples: Argument) -> str:
    """Return in words what the integers of samples are."""
    if samples.sensor is not None:
        return f"counts of the gyro, unit {samples.sensor.unit}"
    return f"format {samples.format}, unit 2^-{samples.format.fraction} rad"


_FILES = {"h": "header.h", "c": "source.c"}


def _coefficients(rows: range) -> list[str]:
    """Return the arguments of the step from Legendre coefficients that hold them."""
    return ["sample"] * rows.start + [f"sums[{number}]" for number in range(len(rows))]


def _identity(size: int) -> list[int]:
    """Return the state of zero rotation."""
    ones = range(0, 9, 4) if size == 9 else (3,)
    return [int(number in ones) for number in range(size)]


def _padded(taps: Sequence[_Tap], zero: _Tap) -> list[_Tap]:
    """Return the taps of a polynomial with zeros for samples that it does not take."""
    return list(taps) + [zero] * (SHORT - len(taps))


def _line(taps: Sequence[Fraction], printer: CPrinter) -> str:
    return ", ".join(map(printer.constant, taps))


def _text(integers: Sequence[int]) -> str:
    return ", ".join(map(str, integers))
