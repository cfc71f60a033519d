"""Generates C that commits an attitude late, and estimates the present one."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import TypeVar

from strapgen import catalogue, pipeline, targets
from strapgen.catalogue import AnyAlgorithm, Choice, choose_step, named
from strapgen.catalogue.methods.window import Window
from strapgen.catalogue.methods.windows import named_window
from strapgen.design.commit_late import commit_late_fixed
from strapgen.design.commit_late.commit_late_fixed import WORD
from strapgen.design.commit_late.late_filters import (
    NEXT,
    NORMALIZED_EVERY,
    REACH,
    SHORT,
    FixedFilters,
    LateFilters,
)
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import above
from strapgen.ir.interfaces import Argument
from strapgen.ir.kernel_info import KernelInfo
from strapgen.ir.sources import Function, Sources
from strapgen.ir.version import VERSION
from strapgen.results.result import Result
from strapgen.targets import BUILT_IN, contract
from strapgen.targets.c import CPrinter, real_of
from strapgen.targets.rendering import render

#: Kinds of C that commit late.
TARGETS = ("c", "c-float", "c-fixed")
#: Most characters that names begin with: C99 tells external names apart by 31, and ``_memory`` comes behind.
MOST_CHARACTERS = 24
_TITLES = {"dcm": "Direction cosine matrix", "euler": "Euler parameters"}

#: Attitude algorithms that commit late, each with the kernel that removes rounding from a committed attitude.
NORMALIZATIONS = {"dcm": "dcm-orthonormalize-first-order", "euler": "euler-normalize-first-order"}


@dataclass(frozen=True)
class LateResult(Result):
    """The written C that commits an attitude late, and estimates the present one."""

    name: str
    target: str
    files: Sequence[Path]
    #: Operations of a call by kind
    operations: Mapping[str, int]

    def text(self) -> str:
        """Return the name and the files."""
        return "\n".join([f"{self.name} for {self.target}", *(f"  {path}" for path in self.files)])


@dataclass(frozen=True)
class LateSources:
    """Sources of code that commits an attitude late, and estimates the present one."""

    filters: LateFilters
    #: The step of the window, which is committed
    step: Sources
    #: The step from Legendre coefficients, which all other filters share
    rotation: Sources
    #: Removes rounding from a committed attitude
    normalization: Sources
    #: The taps as integers, in fixed point
    fixed: FixedFilters | None = None


def kernels(filters: LateFilters, algorithm: str) -> tuple[Choice, Choice, Choice]:
    """Return the choices of the step, of the step from Legendre coefficients and of the normalization.

    >>> [choice.kernel for choice in kernels(family("window-7-7"), "euler")]
    ['euler-window-7-7', 'euler-legendre-4', 'euler-normalize-first-order']
    """
    checks.choice("algorithm", algorithm, NORMALIZATIONS)
    return (
        choose_step(algorithm, filters.window),
        Choice(f"{algorithm}-legendre-{'exact-' if filters.exact else ''}{filters.degree}"),
        Choice(NORMALIZATIONS[algorithm]),
    )


def state_name(function: str, algorithm: AnyAlgorithm, filters: LateFilters) -> str:
    """Return the name of the state that a function commits late; an object with another window is refused.

    >>> state_name("CommitLate", choose_step("dcm", "window-7-7"), family("window-7-7"))
    'dcm'
    """
    choice, window = named(function, algorithm), filters.window
    if isinstance(choice, Choice) and choice.window not in (None, window):
        raise InputError(f"window is {window.name}, but the choice of {choice.kernel} has its own")
    return catalogue.state_name(function, algorithm, NORMALIZATIONS)


def family(window: str | Window, sample_hz: float | str | Fraction | None = None) -> LateFilters:
    """Return the filters of a family, if they go with the sampling rate.

    `sample_hz`: sampling rate in Hz, which a family that is designed for a gyro needs.

    >>> family("window-5-5").samples
    11
    """
    chosen = named_window(window) if isinstance(window, str) else window
    if chosen is None:
        raise InputError(f"window is {window!r}; a name as window-7-7, or a family of filters, is needed")
    rate = None if sample_hz is None else checks.number("sample_hz", sample_hz, positive=True)
    if chosen.gyro is not None and rate != chosen.gyro.sample_hz:
        stated = "no sampling rate is stated" if rate is None else f"the sampling rate is {float(rate):g} Hz"
        needed = f"{float(chosen.gyro.sample_hz or 0):g} Hz"
        raise InputError(f"{stated}; {chosen.name} is designed for a gyro at {needed}, which is needed")
    return LateFilters(chosen)


def parts(filters: LateFilters, algorithm: str, target: str, settings: Settings | None = None) -> LateSources:
    """Return the generated functions with their filters."""
    choices = kernels(filters, algorithm)
    targets.require(target, settings)
    if targets.TARGETS[target].fixed:
        functions, fixed, rounded = commit_late_fixed.functions(
            filters, choices, target, settings or Settings()
        )
        return LateSources(rounded, *functions, fixed)
    step, rotation, normalization = (pipeline.compile(choice, target) for choice in choices)
    return LateSources(filters, step, rotation, normalization)


def sources(
    window: str | Window,
    algorithm: str = "euler",
    target: str = "c",
    sample_hz: float | str | Fraction | None = None,
    name: str | None = None,
    settings: Settings | None = None,
) -> Sources:
    """Return the C that commits an attitude late, and estimates the present one.

    `settings`: of fixed point, with words of 32 bits; by default increments are up to 1/8 rad.

    >>> list(sources("window-3-3").files)[:4]
    ['euler_late_3_3.h', 'euler_late_3_3.c', 'euler_window_3_3.h', 'euler_window_3_3.c']
    """
    checks.choice("target", target, TARGETS)
    late = parts(family(window, sample_hz), algorithm, target, settings)
    filters = late.filters
    chosen = filters.window
    command = ["strapgen", "window", "generate", chosen.file or chosen.name]
    command += ["--algorithm", algorithm, "--target", target]
    stated = settings is not None and "--sample-hz" in settings.stated
    command += [] if sample_hz is None or stated else ["--sample-hz", str(sample_hz)]
    command += [] if name is None else ["--name", name]
    title = f"{_TITLES[algorithm]}, committed late and answered now: {chosen.title}"
    text = shlex.join(command)
    if late.step.fixed is not None:
        usual = late.step.fixed.settings
        usual = replace(usual, input_bits=usual.default_input_bits)
        text += f" {contract.options(usual, late.step.function.inputs)}"
    functions = late.step, late.rotation, late.normalization
    return whole(_identifier(chosen, algorithm, target, name), title, text, filters, functions, late.fixed)


def _identifier(window: Window, algorithm: str, target: str, name: str | None) -> str:
    """Return the prefix of the names of functions and files."""
    infix = f"_w{WORD}" if BUILT_IN[target].fixed else real_of(target).infix
    samples = window.name.removeprefix("window-").removeprefix("pair-")
    default = f"{algorithm}_late_{samples}".replace("-", "_") + infix
    identifier = default if name is None else name
    if name is not None and not re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII):
        raise InputError(f"--name is {name!r}; letters, digits and underscores are needed, a letter first")
    if len(identifier) > MOST_CHARACTERS:
        raise InputError(
            f"names would begin with {identifier}, which has more than {MOST_CHARACTERS} characters; --name chooses "
            "shorter ones"
        )
    return identifier


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
    """Largest operation counts of calls of the generated functions."""

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
    """Generate the C of the main unit."""
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
    """Return the values of the templates for double or float."""
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
        "shorts": [[_line(_pad(group[m], Fraction(0)), printer) for m in rows] for group in filters.short],
        "restoring": [_line(taps, printer) for taps in filters.restoration],
        "next": _line(NEXT, printer),
    }


def _in_fixed_point(
    filters: LateFilters, fixed: FixedFilters, step: Sources, normalization: Sources
) -> dict[str, object]:
    """Return the values of the templates for fixed point."""
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
        "shorts": [[_text(_pad(row, 0)) for row in group] for group in fixed.short],
        "restoring": [_text(row) for row in fixed.restoring],
        "next": _text([int(2 * tap) for tap in NEXT]),
    }


def _unit(samples: Argument) -> str:
    """Return the scale of the integers of samples in words."""
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


def _pad(taps: Sequence[_Tap], zero: _Tap) -> list[_Tap]:
    """Return the taps of a polynomial with zeros for samples that it does not take."""
    return list(taps) + [zero] * (SHORT - len(taps))


def _line(taps: Sequence[Fraction], printer: CPrinter) -> str:
    return ", ".join(map(printer.constant, taps))


def _text(integers: Sequence[int]) -> str:
    return ", ".join(map(str, integers))
