"""Bounds the changes of a program's results when its inputs change, anywhere in the box of the inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

from strapgen.fixedpoint.floating.errors import Expression, Expressions, NoBoundError, sensitivities, slopes
from strapgen.fixedpoint.floating.exact_ranges import ExactRanges
from strapgen.fixedpoint.intervals import Interval
from strapgen.ir.exceptions import InputError
from strapgen.ir.program import Program


def moved(
    program: Program, limits: Mapping[str, Fraction], errors: Mapping[str, tuple[Fraction, ...]]
) -> dict[str, tuple[Fraction, ...]]:
    """Bound the change of every output when elements of inputs change by at most `errors`, or not at all.

    `limits` bound the inputs, changed and not. The bounds hold under the conditions that `rounding_bounds` states for
    the program, such as a norm near 1.

    >>> from strapgen import derive, lower
    >>> product = lower(derive("euler-product"))
    >>> bounds = moved(product, dict.fromkeys(("state", "transition"), Fraction(1)), {"state": (Fraction(1, 100),) * 4})
    >>> float(bounds["next"][0])
    0.04
    """
    by_element = {
        element: error
        for signal in program.inputs
        for element, error in zip(
            signal.elements, errors.get(signal.name, (Fraction(0),) * signal.size), strict=True
        )
    }
    if not any(by_element.values()):
        return {result.signal.name: (Fraction(0),) * result.signal.size for result in program.outputs}
    box = {
        name: Interval.symmetric(limits[signal.name]) for signal in program.inputs for name in signal.elements
    }
    expressions = Expressions.of(program)
    try:
        ranges = ExactRanges(program, expressions, box).ranges
        expressions, derivatives = _with_lengths(expressions, ranges)
        errors_at = {expressions.names[name]: error for name, error in by_element.items() if error}
        _require_settled(expressions, ranges, derivatives, errors_at)
    except NoBoundError as error:
        raise InputError(f"{program.kernel}: {error}") from None
    except ArithmeticError:
        raise InputError(f"{program.kernel}: its values may overflow") from None
    return {
        output.signal.name: tuple(
            _move(expressions, derivatives, place, errors_at)
            for place in expressions.results[output.signal.name]
        )
        for output in program.outputs
    }


def _move(
    expressions: Expressions,
    derivatives: Sequence[tuple[Interval, ...]],
    place: int,
    errors_at: Mapping[int, Fraction],
) -> Fraction:
    """Return the change of an operation due to the errors of inputs, which are known by their places."""
    moves = sensitivities(expressions, derivatives, place)
    return sum((moves.get(k, Fraction(0)) * error for k, error in errors_at.items()), Fraction(0))


def _with_lengths(
    expressions: Expressions, ranges: Sequence[Interval]
) -> tuple[Expressions, list[tuple[Interval, ...]]]:
    """Return operations and their slopes, where a root that may be zero is the length of the numbers squared under it.

    The root has no derivative at zero; a length moves by no more than its parts do.
    """
    items, derivatives = [*expressions.items], slopes(expressions, ranges)
    for place, item in enumerate(items):
        if item.kind != "sqrt" or ranges[place].low > 0:
            continue
        parts = tuple(expressions.squared(item.arguments[0]))
        if not parts:
            raise NoBoundError(f"the radicand in {expressions.labels[place]} may be zero")
        items[place] = Expression("length", parts)
        derivatives[place] = (Interval.of(-1, 1),) * len(parts)
    return replace(expressions, items=items), derivatives


def _require_settled(
    expressions: Expressions,
    ranges: Sequence[Interval],
    derivatives: Sequence[tuple[Interval, ...]],
    errors_at: Mapping[int, Fraction],
) -> None:
    """Refuse a comparison that the errors of inputs may turn: another value is selected then."""
    for place, item in enumerate(expressions.items):
        if item.kind != "select":
            continue
        condition = expressions.items[item.arguments[0]]
        if condition.kind == "at_least":
            left, right = condition.arguments
            apart = ranges[left] - ranges[right]
            moves = any(_move(expressions, derivatives, k, errors_at) for k in (left, right))
            if not moves or apart.low >= 0 or apart.high < 0:
                continue
        raise NoBoundError(f"an error of its input may turn a comparison in {expressions.labels[place]}")
