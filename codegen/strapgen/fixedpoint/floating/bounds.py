"""Bounds the rounding of a call and of a run of generated floating-point code.

A result is off by the sum over all operations of what is new in the error of the operation times how far it moves the
result. Both are bounded over the box of the inputs, in interval arithmetic that rounds outward.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache

from strapgen.fixedpoint.floating import any_order, proved
from strapgen.fixedpoint.floating.errors import (
    NUMBERS,
    Expressions,
    NoBoundError,
    NumberFormat,
    added_errors,
    sensitivities,
    slopes,
)
from strapgen.fixedpoint.format_plan import largest_magnitude
from strapgen.fixedpoint.intervals import Interval, norm
from strapgen.fixedpoint.quantities import up
from strapgen.ir import checks
from strapgen.ir.fixed_settings import ROTATION_INPUTS, Settings
from strapgen.ir.interfaces import AnyOrder, Condition, RoundingAccumulation, RoundingBounds, StepRounding
from strapgen.ir.program import Operation, Program, Result, walk

#: The functions of the C library that operations call.
_LIBRARY = {"sin": "sin", "cos": "cos", "sinc": "sin"}


class _Analysis:
    """The exact ranges, conditions and derivatives of a program, which both types of numbers share."""

    def __init__(self, program: Program, limits: tuple[tuple[str, Fraction], ...]) -> None:
        largest = dict(limits)
        box = {
            name: Interval.symmetric(largest[signal.name])
            for signal in program.inputs
            for name in signal.elements
        }
        self.expressions = Expressions.of(program)
        from strapgen.fixedpoint.floating.exact_ranges import ExactRanges  # loads numpy, as only proofs do

        exact = ExactRanges(program, self.expressions, box)
        self.ranges, self.conditions = exact.ranges, tuple(exact.conditions)
        self._slopes = slopes(self.expressions, self.ranges)
        self._moves: dict[tuple[str, tuple[int, ...]], list[dict[int, Fraction]]] = {}

    def moves(self, result: Result, held: Collection[int] = ()) -> list[dict[int, Fraction]]:
        """Return for every element of a result its `sensitivities` to all operations."""
        key = result.signal.name, tuple(held)
        if key not in self._moves:
            places = self.expressions.results[result.signal.name]
            self._moves[key] = [
                sensitivities(self.expressions, self._slopes, place, held) for place in places
            ]
        return self._moves[key]


@lru_cache(maxsize=64)
def _analysis(program: Program, limits: tuple[tuple[str, Fraction], ...]) -> _Analysis | str:
    """Return the analysis of a program on a box of inputs, or why there is none."""
    try:
        return _Analysis(program, limits)
    except NoBoundError as error:
        return str(error)
    except ArithmeticError:  # ranges beyond all numbers of the samples
        return "its values may overflow"


def rounding_bounds(
    program: Program, number: str = "double", settings: Settings | None = None
) -> RoundingBounds:
    """Bound the distance of generated C in floating point from exact arithmetic on the same inputs.

    The bounds hold for the operations in the order in which the targets `c` and `c-float` print them, with literals
    rounded to the nearest number, in arithmetic of IEEE 754 without contraction (``-ffp-contract=off``).

    Parameters
    ----------
    program : Program
    number : str, optional
        Type of the numbers: "double" or "float".
    settings : Settings, optional
        States the largest angle increment in rad, the allowance by which an element of a state may exceed 1, and ranges
        of other inputs; its other fields do not count. By default 1/8 rad and 1/16.

    Returns
    -------
    RoundingBounds
        With `errors` for every element of every output, in the unit of the output. They are empty where no bound is
        known, and `reason` says why; where numpy is missing, only bounds given to `proved.load` are known.

    Raises
    ------
    InputError
        If there is no such type, or the settings have ranges of other inputs than the program.

    Examples
    --------
    >>> from strapgen import derive, lower
    >>> bounds = rounding_bounds(lower(derive("euler", method="rk4", increments=2)))
    >>> max(bounds.errors["next"]) < 7e-16
    True
    >>> bounds.accumulation.bound(steps=1000) < 1.3e-12
    True
    """
    checks.choice("number", number, NUMBERS)
    settings = (settings or Settings()).for_program(program.increments_per_step, program.kernel)
    names = [signal.name for signal in program.inputs]
    for name in settings.ranges:
        checks.choice(f"input of {program.kernel}", name, names)
    precision = NUMBERS[number].precision
    if not _has_numpy():
        return proved.bounds(program, number, precision)
    known = {*settings.ranges, *ROTATION_INPUTS}
    for signal in program.inputs:
        without = signal.bound is None and signal.limit is None and not signal.constraint
        if without and signal.name not in known:
            reason = f"the range of {signal.name} is unknown"
            return RoundingBounds(number, precision, reason=reason)
    return _bounds(
        program, tuple((s.name, largest_magnitude(program, s, settings)) for s in program.inputs), number
    )


@lru_cache(maxsize=64)
def _bounds(program: Program, limits: tuple[tuple[str, Fraction], ...], number: str) -> RoundingBounds:
    """Bound the rounding of a program on a box of inputs, once for all targets with such numbers."""
    format_ = NUMBERS[number]
    inputs = tuple(Condition(name, -largest, largest) for name, largest in limits)
    analysis = _analysis(program, limits)
    if isinstance(analysis, str):
        return RoundingBounds(number, format_.precision, inputs, reason=analysis)
    try:
        added = added_errors(analysis.expressions, analysis.ranges, format_)
    except NoBoundError as error:
        return RoundingBounds(number, format_.precision, inputs, reason=str(error))
    left_out = _left_out(program, analysis)
    if left_out is None:
        reason = "the series of its transition does not converge on this range"
        return RoundingBounds(number, format_.precision, inputs, reason=reason)
    if left_out and program.transition is not None:
        for place in analysis.expressions.results[program.transition.signal.name]:
            added[place] += left_out
    outputs = {result.signal.name: _errors(analysis.moves(result), added) for result in program.outputs}
    step = _step_rounding(program, analysis, added)
    return RoundingBounds(
        number,
        format_.precision,
        inputs,
        analysis.conditions,
        _library_functions(program),
        outputs,
        step,
        None if step is None else _accumulation(program, dict(limits), step, *outputs.values()),
        any_order=_in_any_order(
            program, analysis, format_, outputs if left_out or analysis.expressions.remainders else {}
        ),
    )


def _in_any_order(
    program: Program, analysis: _Analysis, number: NumberFormat, beside: Mapping[str, Sequence[Fraction]]
) -> AnyOrder:
    """Bound the outputs in any order of the operations; what series leave out is part of the errors `beside` it."""
    try:
        values = any_order.AnyOrder(program, analysis.expressions, analysis.ranges, number)
        errors = {
            result.signal.name: tuple(map(values.error, analysis.expressions.results[result.signal.name]))
            for result in program.outputs
        }
    except NoBoundError as error:
        return AnyOrder(without=str(error))
    for name, each in beside.items():
        errors[name] = tuple(a + b for a, b in zip(errors[name], each, strict=True))
    is_step = program.attitude_step is not None and program.transition is not None and len(errors) == 1
    per_step = _longest_row(program, *errors.values()) if is_step else None
    return AnyOrder(errors, per_step, values.roundings, values.approximates)


def _longest_row(program: Program, errors: Sequence[Fraction]) -> Fraction:
    """Return the length of an error of the state, or of a row of a matrix."""
    width = _row(program)
    return up(max(norm(errors[k : k + width]) for k in range(0, len(errors), width)))


def _row(program: Program) -> int:
    """Return the number of elements of the state, or of a row of a matrix."""
    state = program.inputs[0]
    return state.size // (state.shape[0] if len(state.shape) == 2 else 1)


def _has_numpy() -> bool:
    try:
        import numpy  # noqa: F401
    except ImportError:
        return False
    return True


def _left_out(program: Program, analysis: _Analysis) -> Fraction | None:
    """Return a bound of the truncation error of the transition's series; None where it is not known."""
    if program.attitude_step is None or program.attitude_step.truncation is None:
        return Fraction(0)
    truncation = program.attitude_step.truncation
    left_out = truncation.bound(analysis.ranges[analysis.expressions.names[truncation.square]].magnitude)
    return None if left_out is None else up(left_out)


def _errors(moves: Iterable[Mapping[int, Fraction]], added: Sequence[Fraction]) -> tuple[Fraction, ...]:
    """Return the error bound of every element of a result from those that every operation adds."""
    return tuple(up(sum((move * added[k] for k, move in element.items()), Fraction(0))) for element in moves)


def _library_functions(program: Program) -> tuple[str, ...]:
    """Return the functions of the C library that the code calls and whose errors no standard bounds."""
    nodes = [node for a in program.body for node in walk(a.value) if isinstance(node, Operation)]
    return tuple(sorted({_LIBRARY[node.kind] for node in nodes if node.kind in _LIBRARY}))


def _step_rounding(program: Program, analysis: _Analysis, added: Sequence[Fraction]) -> StepRounding | None:
    """Return the errors that a call of an attitude step adds to a run; None for other kernels."""
    transition = program.transition
    if program.attitude_step is None or transition is None or len(program.outputs) > 1:
        return None
    places = analysis.expressions.results[transition.signal.name]
    away = (
        (analysis.ranges[place] - Interval.of(one)).magnitude
        for place, one in zip(places, program.attitude_step.identity, strict=True)
    )
    return StepRounding(
        _errors(analysis.moves(program.outputs[0], held=places), added),
        _errors(analysis.moves(transition), added),
        tuple(away),
    )


def _accumulation(
    program: Program, largest: Mapping[str, Fraction], step: StepRounding, errors: Sequence[Fraction]
) -> RoundingAccumulation:
    """Return the accumulation of an attitude step's errors: each call adds its error, and stretches that before it.

    Lengths are those of a state, or of a row of a matrix.
    """
    state, transition = program.inputs[0], program.transition
    assert transition is not None
    width = _row(program)
    length = largest[state.name] * norm([Fraction(1)] * width)
    rows = range(0, state.size, width)
    whole = _longest_row(program, errors)
    parts = max(norm(step.local[k : k + width]) for k in rows) + length * norm(step.transition)
    sizes = tuple(largest[signal.name] for signal in program.inputs[1:] for _ in signal.elements)
    from strapgen.fixedpoint.accumulation import transition_growth

    growth = transition_growth(program, transition, sizes, width, 1 + norm(step.away))
    return RoundingAccumulation(Fraction(0), up(min(whole, parts)), Fraction(0), growth)
