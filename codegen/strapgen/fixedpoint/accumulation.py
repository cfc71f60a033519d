"""How the rounding of one step adds up over a run.

The computed state obeys x' = x T + x d + r: T the exact transition, d the error of the computed one, r the rounding of
the state. A step stretches an error by at most the norm of T. With residuals, what is rounded off in one step is added
in the next: then r is paid once, beside the residual times T - 1 in every step; and of the rounding of T, summed by
parts, only its product with T - 1 is left.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import lru_cache

from strapgen.fixedpoint import quantities as exact
from strapgen.fixedpoint.code import IntegerSum, Value
from strapgen.fixedpoint.formats import ROUNDINGS
from strapgen.fixedpoint.interface import Argument, RoundingAccumulation
from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.series import Series, Truncated
from strapgen.fixedpoint.settings import Settings
from strapgen.program import Constant, Node, Operation, Program, Reference

#: Terms of the longest series that the norm of the transition is expanded in.
_MOST_TERMS = 1000


def accumulation(
    program: Program,
    settings: Settings,
    made: exact.Quantities,
    values: Mapping[str, Value],
    inputs: Sequence[Argument],
    outputs: Sequence[Argument],
) -> RoundingAccumulation | None:
    """Return how the errors of a step add up; None where it calls more than sums, roots, sines and cosines.

    Lengths are those of a state, or of a row of a matrix: the norm in which a transition stretches least.
    """
    (result,) = outputs
    state = program.inputs[0]
    rows = state.shape[0] if len(state.shape) == 2 else 1
    width = state.size // rows
    limit = made.items[state.elements[0]].range.magnitude
    length = limit * _root(Fraction(width))
    carry, half = settings.carry, ROUNDINGS[settings.rounding]

    assert program.transition is not None, "a step has a transition"
    held = [name for name in made.results[program.transition.signal.name] if isinstance(name, str)]
    inner, kept, away = [], [], []
    for name in held:
        if name not in values:
            continue
        value = values[name]
        rounding = half / Fraction(2) ** value.fraction
        rounded = value.definition
        carried = isinstance(rounded, IntegerSum) and rounded.residual is not None
        inner.append(value.error - (2 * rounding if carried else 0))
        kept.append(rounding if carried else Fraction(0))
        away.append(made.distance(name))
    away_norm = _norm(away)

    rounding = half * result.format.unit
    local, left = [], Fraction(0)
    for name in result.values:
        value = values[name]
        definition = made.items[name].definition
        assert isinstance(definition, exact.Sum)
        through = sum(
            abs(coefficient) * made.items[factor].range.magnitude * values[other].error
            for monomial, coefficient in definition.terms
            if len(monomial) == 2
            for factor, other in (monomial, monomial[::-1])
            if other in held and factor not in held
        )
        own = value.error - through
        lowered = value.definition
        if isinstance(lowered, IntegerSum) and lowered.residual is not None:
            own -= 2 * rounding
            left = rounding
        local.append(own)
    own_norm = max(_norm(local[k : k + width]) for k in range(0, len(local), width))
    left_norm = left * _root(Fraction(width))
    kept_norm = _norm(kept)
    per_step = own_norm + length * _norm(inner)
    once = Fraction(0)
    if carry != "none":
        per_step += left_norm * away_norm
        once += 2 * left_norm
    if any(kept):
        per_step += 2 * kept_norm * (length * away_norm + left_norm)
        once += 2 * length * kept_norm
    moved = _moved(made, {a.signal.name: a.format.unit / 2 for a in inputs[1:]})
    if moved is None:
        return None
    input_rounding = length * _norm([moved[name] for name in held])
    return RoundingAccumulation(once, per_step, input_rounding, _growth(program, made, width))


def _moved(made: exact.Quantities, by: Mapping[str, Fraction]) -> dict[str, Fraction] | None:
    """Return how far every quantity can move when the elements of inputs, by name, move by so much; None if unknown."""
    moved: dict[str, Fraction] = {}
    for name, quantity in made.items.items():
        definition = quantity.definition
        if isinstance(definition, exact.InputElement):
            moved[name] = by.get(definition.signal, Fraction(0))
        elif isinstance(definition, exact.Sum):
            total = Fraction(0)
            for monomial, coefficient in definition.terms:
                sizes = [made.items[factor].range.magnitude for factor in monomial]
                moves = [moved[factor] for factor in monomial]
                if len(monomial) == 1:
                    total += abs(coefficient) * moves[0]
                elif monomial:
                    (a, b), (da, db) = sizes, moves
                    total += abs(coefficient) * (a * db + b * da + da * db)
            moved[name] = total + sum(abs(c) * moved[m[0]] for m, c in quantity.beside)
        elif isinstance(definition, exact.Computed | exact.NearestInteger):
            moved[name] = Fraction(0)  # within a function, whose slope tells what becomes of it
        elif isinstance(definition, exact.SquareRoot):
            moved[name] = _root(moved[definition.argument])
        else:
            return None
        if quantity.follows is not None:
            moved[name] += _followed(quantity.follows, moved)
    return moved


def _followed(follows: exact.ErrorPropagation, moved: Mapping[str, Fraction]) -> Fraction:
    """Return how far a function can move."""
    total = Fraction(0)
    for name, slope in follows.slopes:
        if moved[name]:
            total += follows.most if slope is None else slope * moved[name]
    return min(total, follows.most)


def _norm(values: Sequence[Fraction]) -> Fraction:
    """Return a length that is not below that of a vector."""
    return _root(sum((value * value for value in values), Fraction(0)))


def _root(value: Fraction) -> Fraction:
    return Interval.of(value).sqrt().highest


def _growth(program: Program, made: exact.Quantities, width: int) -> Fraction:
    """Return a number that is not below the norm of any transition.

    The transition is expanded in its inputs to a degree at which it stays short, the rest bounded; in T T' - 1 the
    terms then cancel that a rotation does not have.
    """
    assert program.transition is not None
    if program.companions is not None and program.companions.isometry:
        return Fraction(1)
    inputs = [name for signal in program.inputs[1:] for name in signal.elements]
    try:
        return _expanded_growth(program, tuple(made.items[name].range.magnitude for name in inputs), width)
    except NotImplementedError:  # it calls functions: the identity, and the length of what is added to it
        held = made.results[program.transition.signal.name]
        return 1 + _norm([made.distance(name) for name in held if isinstance(name, str)])


@lru_cache(maxsize=64)
def _expanded_growth(program: Program, sizes: tuple[Fraction, ...], width: int) -> Fraction:
    """Return what `_growth` does, which no word and no rounding changes.

    Raises
    ------
    NotImplementedError
        If the transition calls functions.
    """
    series = Truncated(sizes, _MOST_TERMS)
    elements = _expanded(program, series)
    rows = [elements[k : k + width] for k in range(0, len(elements), width)]
    one = series.constant(Fraction(1))
    largest = Fraction(0)
    for row in rows:
        total = Fraction(0)
        for other in rows:
            product = series.dot(row, other)
            total += series.size(series.less(product, one) if other is row else product)
        largest = max(largest, total)
    return _root(1 + largest)


def _expanded(program: Program, series: Truncated) -> list[Series]:
    """Return the elements of the transition as truncated series in the inputs."""
    assert program.transition is not None
    inputs = [name for signal in program.inputs[1:] for name in signal.elements]
    known = {name: series.variable(place) for place, name in enumerate(inputs)}
    needed = program.used([program.transition])

    def value(node: Node) -> Series:
        if isinstance(node, Constant):
            return series.constant(node.value)
        if isinstance(node, Reference):
            return known[node.name]
        assert isinstance(node, Operation)
        if node.kind not in ("negate", "add", "subtract", "multiply"):
            raise NotImplementedError(node.kind)
        arguments = [value(argument) for argument in node.arguments]
        if node.kind == "negate":
            return series.less(series.constant(Fraction(0)), arguments[0])
        if node.kind == "subtract":
            return series.less(*arguments)
        return series.sum(*arguments) if node.kind == "add" else series.product(*arguments)

    for assignment in program.body:
        if assignment.name in needed:
            known[assignment.name] = value(assignment.value)
    return [value(node) for node in program.transition.nodes]
