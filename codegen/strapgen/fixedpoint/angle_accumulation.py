"""Bounds the angle by which rounding turns the attitude over a run: linear in the number of steps, without a stretch.

A step multiplies the state by its transition. Where that is a product of quaternions, it leaves the angle between two
states alone, and a change of length turns nothing: so the angle between the computed state and the exact one grows by
the angle of what a step adds, its error over the length of the state. A matrix and the exact one differ by a factor on
the left, C = M C*, which a step leaves alone too, whatever its transition; what a step adds to M is its error times
the inverse of the computed matrix, and the nearest rotation turns by no more. With error feedback the same holds of the
state with what will be fed back added to it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

from strapgen.fixedpoint.accumulation import StepErrors, stretch
from strapgen.fixedpoint.integer_sums import Quantization
from strapgen.fixedpoint.intervals import Interval, norm, root
from strapgen.fixedpoint.quantities import up
from strapgen.ir.interfaces import LARGEST_ERROR, AngleAccumulation
from strapgen.ir.program import Constant, Node, Program, Reference, Result
from strapgen.kernel.polynomials import ONE, OPERATIONS, Polynomial, add, multiply, scale

#: Elements of the vectors whose attitude turns by twice their angle: Euler and Cayley-Klein parameters.
_PARAMETERS = 4
#: Elements of the side of a matrix.
_SIDE = 3
#: The state may be this part of the way to the shortest when the proved steps begin.
_START = Fraction(1, 8)
#: Sines of angles of one step for which the bound is worth anything.
_LARGEST_SINE = Fraction(1, 2)


@dataclass(frozen=True)
class _Sizes:
    """The errors of a step, and the sizes of state and transition, as lengths of all elements together."""

    local: Fraction  # error of a call beside that of the transition
    transition: Fraction  # error of the transition
    state_feedback: Fraction  # part of the state that is fed back
    transition_feedback: Fraction  # part of the transition that is fed back
    away: Fraction  # distance of the exact transition from the identity
    #: Bounds of the length of the state; of a matrix, of its singular values.
    shortest: Fraction
    longest: Fraction
    #: The same of the exact transition.
    contraction: Fraction
    expansion: Fraction

    @property
    def added(self) -> Fraction:
        """A bound of the errors that a step adds to the state, and to the errors to be fed back."""
        unsteady = 2 * self.away + self.transition + 2 * self.transition_feedback
        error = self.local + self.longest * self.transition + self.state_feedback * self.away
        return error + self.transition_feedback * (
            self.longest * unsteady + self.local + 2 * self.state_feedback
        )

    @property
    def fed_back(self) -> Fraction:
        """A bound of the errors to be fed back."""
        return self.state_feedback + self.longest * self.transition_feedback


def angle_accumulation(
    context: Quantization, transition: Result, errors: StepErrors
) -> AngleAccumulation | None:
    """Return the accumulation of a step's errors as an angle.

    None stands for a step that is no product of attitudes, saturates, or is too coarse.
    """
    terms = _products(context.program, transition)
    if terms is None or errors.saturation:  # what saturates shortens one element alone
        return None
    is_matrix = len(context.program.inputs[0].shape) == 2
    if not (_multiplies_matrices(context.program, terms) if is_matrix else _multiplies_lengths(terms)):
        return None
    sizes = _sizes(context, transition, errors, is_matrix)
    rounding = context.rounding_error * context.plan.inputs[0].format.unit
    try:
        return _matrix_angles(sizes, errors) if is_matrix else _parameter_angles(sizes, errors, rounding)
    except ValueError:  # words so short that a step may turn the attitude anywhere
        return None


def _sizes(context: Quantization, transition: Result, errors: StepErrors, is_matrix: bool) -> _Sizes:
    """Return the errors of a step as lengths."""
    state = context.program.inputs[0]
    stretched = stretch(context, transition, state.shape[-1])
    away = norm(errors.away)
    contraction, expansion = max(Fraction(0), 1 - away), 1 + away
    if stretched is not None and stretched.lowest > -1:
        contraction, expansion = _root_below(1 + stretched.lowest), root(1 + stretched.highest)
    shortest = 1 - context.settings.allowance
    fed_back = errors.state_feedback if context.settings.carry != "none" else Fraction(0)
    # What is left is told from half a unit, also where it was cut off: a constant in it cancels from step to step.
    centred = Fraction(1, 2) / context.rounding_error
    return _Sizes(
        norm(errors.local),
        norm(errors.transition),
        centred * fed_back * root(Fraction(state.size)),
        centred * norm(errors.transition_feedback),
        away,
        shortest,
        _longest(shortest),
        contraction,
        expansion,
    )


def _longest(shortest: Fraction) -> Fraction:
    """Return the largest singular value of a matrix that goes with the smallest."""
    return root(2 - shortest * shortest)


def _with_transition_error(sizes: _Sizes, moves: tuple[Fraction, ...]) -> _Sizes:
    """Return the same with increments rounded to their format: an error of the transition."""
    return replace(sizes, transition=sizes.transition + norm(moves))


# Parameters


def _parameter_angles(sizes: _Sizes, errors: StepErrors, rounding: Fraction) -> AngleAccumulation:
    """Return the bound for a vector of parameters; ValueError if the words are too short for one."""

    def step_angle(sizes: _Sizes) -> Fraction:
        # All is told in the length of the state after the step.
        before, fed_back = _length_before(sizes), sizes.transition_feedback
        unsteady = 2 * sizes.away + sizes.transition + 2 * fed_back
        sine = (sizes.local + sizes.state_feedback * sizes.away) / sizes.shortest + before * sizes.transition
        sine += fed_back * (before * before * unsteady + _lost(sizes))
        return 2 * _arcsine(sine / (1 - sizes.state_feedback / sizes.shortest - before * fed_back))

    per_step = step_angle(sizes)
    end = sizes.state_feedback / sizes.shortest + _length_before(sizes) * sizes.transition_feedback
    start = 1 - _START * (1 - sizes.shortest)
    # Two steps before, a state may have been longer.
    lost = replace(sizes, longest=max(sizes.longest, _length_before(sizes) ** 2))
    words = rounding * root(Fraction(_PARAMETERS)) / sizes.shortest
    # With error feedback: what was left before, what is left now, and what the sum itself loses.
    normalized = _arcsine(3 * words) + 2 * _arcsine(end) if sizes.fed_back else _arcsine(words)
    return AngleAccumulation(
        up(4 * _arcsine(end)),
        up(per_step),
        up(step_angle(_with_transition_error(sizes, errors.moves)) - per_step),
        up(2 * normalized),
        Fraction(0),
        sizes.shortest,
        start,
        _steps(start - sizes.shortest - 2 * sizes.fed_back, 1 - sizes.contraction + lost.added),
        Fraction(1),
        Fraction(1),
        0,
        Fraction(0),
        up(lost.added),
    )


def _lost(sizes: _Sizes) -> Fraction:
    """Return the part of its length that the rounding of a step can take from the state."""
    return (sizes.local + 2 * sizes.state_feedback) / sizes.shortest


def _length_before(sizes: _Sizes) -> Fraction:
    """Return the largest ratio of the state's lengths before and after a step; ValueError if nothing is known."""
    smallest = sizes.contraction - sizes.transition - 2 * sizes.transition_feedback
    if smallest <= 0:
        raise ValueError
    return (1 + _lost(sizes)) / smallest


def _arcsine(sine: Fraction) -> Fraction:
    """Return an angle that is not below that of a sine; ValueError for large ones."""
    if sine > _LARGEST_SINE:
        raise ValueError
    return sine / _root_below(1 - sine * sine)


# Matrices


def _matrix_angles(sizes: _Sizes, errors: StepErrors) -> AngleAccumulation:
    """Return the bound for a matrix; ValueError if the words are too short for one.

    A change of the factor M by X turns the nearest rotation about each axis by (X_ij (1 + k) - X_ji (1 - k)) / 2 in the
    frame in which the stretch of the matrix is diagonal, with k the difference of two singular values over their sum.
    """
    shortest, longest = sizes.shortest, sizes.longest
    uneven = _unevenness(shortest, longest)
    proper = _turning(uneven)

    def step_angle(sizes: _Sizes) -> Fraction:
        smallest = shortest - sizes.fed_back - sizes.added
        if smallest <= shortest / 2:
            raise ValueError
        return proper * sizes.added / smallest

    if not sizes.contraction:
        raise ValueError
    per_step = step_angle(sizes)
    end = proper * sizes.fed_back / (shortest - 2 * sizes.fed_back)
    start = 1 - _START * (1 - shortest)
    added = sizes.added
    lower = _steps(start - shortest - 2 * sizes.fed_back, 1 - sizes.contraction + added)
    slack = longest - _longest(start) - 2 * sizes.fed_back
    upper = _steps(slack, longest * (sizes.expansion - 1) + added)
    unsteady = _unsteadiness(shortest, start)
    orthonormal = None if unsteady is None else _turning((uneven + unsteady) / (1 - unsteady))
    per_element = orthonormal and orthonormal * _SIDE / shortest
    apart, growth = _dual_rows(sizes, unsteady)
    return AngleAccumulation(
        up(2 * end),
        up(per_step),
        up(step_angle(_with_transition_error(sizes, errors.moves)) - per_step),
        up(2 * end * (orthonormal or proper) / proper),
        per_element and up(per_element),
        shortest,
        start,
        min(lower, upper),
        up(1 / proper),
        up((orthonormal or proper) / proper),
        apart,
        up(growth),
        up(added),
    )


def turning_of_matrices(shortest: Fraction) -> Fraction:
    """Return the angle by which the nearest rotation turns, per length of a change of a proper matrix.

    The angle is told in the stretch of the matrix: it has to be divided by the smallest singular value on the way.
    """
    return _turning(_unevenness(shortest, _longest(shortest)))


def _unevenness(shortest: Fraction, longest: Fraction) -> Fraction:
    """Return the largest difference of two singular values over their sum."""
    return (longest - shortest) / (longest + shortest)


def _turning(uneven: Fraction) -> Fraction:
    """Return the angle by which the nearest rotation turns for a change of M, with `uneven` of its symmetric part.

    Of an element and its mirror image the axis has half the difference; sums of squares follow by Cauchy and Schwarz.
    """
    return root((1 + uneven * uneven) / 2)


def _unsteadiness(shortest: Fraction, start: Fraction) -> Fraction | None:
    """Return the part of a symmetric change of M that an orthonormalization leaves; None if it restores too little.

    The expansion of first order takes a singular value s to f(s) = s (3 - s^2)/2, whose slope is 3/2 (1 - s^2); those
    of higher order are flatter. The symmetric part of a change is multiplied by a difference quotient of f, and
    the angle of the nearest rotation stays.
    """
    square = shortest * shortest
    longest = _longest(shortest)
    restored = min(shortest * (3 - square) / 2, longest * (1 + square) / 2)
    unsteady = Fraction(3, 2) * (1 - square) * longest / restored
    is_restored = restored - _SIDE * LARGEST_ERROR >= start
    return unsteady if is_restored and unsteady < Fraction(1, 2) else None


def _dual_rows(sizes: _Sizes, unsteady: Fraction | None) -> tuple[int, Fraction]:
    """Return the most steps between orthonormalizations by dual rows, and the factor by which each stretches an error.

    Let singular values differ from 1 by at most e. Adding dual rows makes F = Q f(S) of Q S, with f = s_i + s_j s_k:
    F F' is a multiple of 1 + H, and H at most 9/8 e^2. A change of M has a skew part w and a symmetric one y; F turns
    by w + K y, with K below e/(1 - e), and the rest of its change is less than 13/5 e y beside a multiple of 1.
    Dividing rows by their lengths removes that multiple, and adds to the change at most 3/2 H times as much, to its
    skew part H^2. So w + t y grows no faster than told, if t leaves y no share in the growth.
    """
    if unsteady is None:
        return 0, Fraction(0)
    e = (1 - sizes.shortest) / 16
    square, turned, rest = Fraction(9, 8) * e * e, e / (1 - e), Fraction(13, 5) * e
    from_symmetric = Fraction(101, 100) * turned + Fraction(11, 10) * rest
    remaining = Fraction(3, 2) * square * turned + Fraction(11, 10) * rest
    weight = from_symmetric / (1 - remaining)
    expansion = (1 + e) * (sizes.expansion - 1)
    lost = max(1 - sizes.contraction, expansion) + sizes.added
    # An orthonormalization returns singular values within e/8 of 1.
    apart = _steps(Fraction(7, 8) * e - 2 * sizes.fed_back, lost)
    return apart if weight <= unsteady else 0, square * square + weight * Fraction(3, 2) * square


def _steps(room: Fraction, lost: Fraction) -> int:
    """Return the number of steps for which there is room."""
    return max(0, int(room / lost)) if lost else 0


def _root_below(value: Fraction) -> Fraction:
    """Return a lower bound of a square root."""
    return Interval.of(value).sqrt().lowest


# What a step is


def _products(program: Program, transition: Result) -> list[Polynomial] | None:
    """Return the new state as polynomials of state "s0", ... and transition "t0", ...; None if it is none."""
    state, (result, *others) = program.inputs[0], program.outputs
    names = [node.name for node in transition.nodes if isinstance(node, Reference)]
    if others or len(set(names)) < len(transition.nodes) or len(names) != state.size != 0:
        return None
    known: dict[str, Polynomial] = {name: {(f"s{k}",): Fraction(1)} for k, name in enumerate(state.elements)}
    known |= {name: {(f"t{k}",): Fraction(1)} for k, name in enumerate(names)}
    values = {assignment.name: assignment.value for assignment in program.body}

    def value(node: Node) -> Polynomial:
        if isinstance(node, Constant):
            return scale(ONE, node.value)
        if isinstance(node, Reference):
            if node.name not in known:
                known[node.name] = value(values[node.name])
            return known[node.name]
        return OPERATIONS[node.kind](*(value(argument) for argument in node.arguments))

    try:
        terms = [value(node) for node in result.nodes]
    except KeyError:  # an increment, or an operation that is not of polynomials
        return None
    return terms if _leaves_states_alone(program, terms) else None


def _leaves_states_alone(program: Program, terms: list[Polynomial]) -> bool:
    """Return whether every term is a product of state and transition, and the identity returns the state."""
    kernels = program.attitude_step
    if kernels is None or any([name[0] for name in key] != ["s", "t"] for term in terms for key in term):
        return False
    for k, term in enumerate(terms):
        left = dict.fromkeys((f"s{i}" for i in range(len(terms))), Fraction(0))
        for (state, element), coefficient in term.items():
            left[state] += coefficient * kernels.identity[int(element[1:])]
        if left != {name: Fraction(name == f"s{k}") for name in left}:
            return False
    return True


def _multiplies_lengths(terms: list[Polynomial]) -> bool:
    """Return whether the length of a product is that of its factors: then multiplying leaves angles alone."""
    if len(terms) != _PARAMETERS:
        return False
    square: Polynomial = {}
    for term in terms:
        square = add(square, multiply(term, term))
    state, transition = (_square_of_length(name) for name in ("s", "t"))
    return square == multiply(state, transition)


def _square_of_length(name: str) -> Polynomial:
    return {(f"{name}{k}", f"{name}{k}"): Fraction(1) for k in range(_PARAMETERS)}


def _multiplies_matrices(program: Program, terms: list[Polynomial]) -> bool:
    """Return whether a step multiplies the matrix by the transition on the right."""
    places = range(_SIDE)
    return program.inputs[0].shape == (_SIDE, _SIDE) and terms == [
        {(f"s{_SIDE * i + k}", f"t{_SIDE * k + j}"): Fraction(1) for k in places}
        for i in places
        for j in places
    ]
