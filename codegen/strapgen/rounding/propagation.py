"""Bounds how far the results of a program move when its inputs do, anywhere in the box of the inputs."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from strapgen.fixedpoint.intervals import Interval
from strapgen.ir.program import Program
from strapgen.rounding.exact_ranges import ExactRanges
from strapgen.rounding.expressions import INPUT, Expressions
from strapgen.rounding.no_bound import NoBoundError
from strapgen.rounding.sensitivities import sensitivities, slopes
from strapgen.support.exceptions import InputError


def moved(
    program: Program, limits: Mapping[str, Fraction], errors: Mapping[str, tuple[Fraction, ...]]
) -> dict[str, tuple[Fraction, ...]]:
    """Bound how far every output moves when inputs move by at most some errors.

    The bounds hold under the conditions that `rounding_bounds` states for the program, such as a norm near 1.

    Parameters
    ----------
    program : Program
    limits : mapping of str to Fraction
        Largest magnitude of the elements of every input, with its error and without.
    errors : mapping of str to tuple of Fraction
        Errors of the elements of inputs, by the name of the input; those that are exact can be left out.

    Returns
    -------
    dict of str to tuple of Fraction
        For each output a bound for each element.

    Raises
    ------
    InputError
        If there is no bound: a function jumps, or a divisor may be zero.

    Examples
    --------
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
    except NoBoundError as error:
        raise InputError(f"{program.kernel}: {error}") from None
    except ArithmeticError:
        raise InputError(f"{program.kernel}: its values may overflow") from None
    derivatives = slopes(expressions, ranges)
    places = {
        item.name: place for place, item in enumerate(expressions.items) if item.kind == INPUT and item.name
    }
    result = {}
    for output in program.outputs:
        moves = [
            sensitivities(expressions, derivatives, place)
            for place in expressions.results[output.signal.name]
        ]
        result[output.signal.name] = tuple(
            sum(
                (
                    move.get(places[name], Fraction(0)) * error
                    for name, error in by_element.items()
                    if name in places
                ),
                Fraction(0),
            )
            for move in moves
        )
    return result
