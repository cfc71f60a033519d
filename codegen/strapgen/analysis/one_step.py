"""What one step loses: the error matrix of a kernel as a power series in the step length, for any smooth rate.

The rate is w(t) = w_0 + w_1 t + w_2 t^2/2 + ..., its increments are exact, and so is the true transition.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy as sp

from strapgen import algebra, catalogue
from strapgen.catalogue import Choice
from strapgen.catalogue.coefficients import Number
from strapgen.exceptions import InputError, InputTypeError
from strapgen.kernel import Kernel
from strapgen.lowering.canonical.decomposition import Frame
from strapgen.powers import Powers, constant, field, outputs

#: Of a method whose coefficients are published with 17 digits or so: digits of its error, and what may be zero.
_DIGITS = 12
_LEAST = Fraction(1, 10**14)

#: Powers beyond the order that are looked at where a series does not begin.
PATIENCE = 4

#: A vector of polynomials for every derivative of the rate.
Rate = Sequence[Sequence[Any]]


@dataclass(frozen=True)
class Step:
    """An attitude step, and what it is to be given.

    Parameters
    ----------
    kernel : Kernel
    nodes : tuple of number or None
        Nodes at which it is given the rate; None for one that takes increments.
    lowest : int
        For a method whose published coefficients are rounded the power of the step at which its error begins but for
        that; 0 where they are exact.
    """

    kernel: Kernel
    nodes: tuple[Number, ...] | None
    lowest: int = 0

    def shown(self, number: Fraction) -> Fraction:
        """Return a coefficient of the error: where those of the method are rounded, as far as it can be known."""
        if not self.lowest:
            return number
        return Fraction(f"{float(number):.{_DIGITS - 1}e}") if abs(number) > _LEAST else Fraction(0)

    @property
    def domain(self) -> Any:
        """The field of the step's numbers: the rational ones, and what roots it has."""
        expressions = [algebra.exact(node) for node in self.nodes or ()]
        for stage in (*self.kernel.stages, *self.kernel.outputs):
            expressions += stage.expressions
        return field(expressions)


def step(choice: Choice) -> Step:
    """Return a chosen attitude step.

    Raises
    ------
    InputError, InputTypeError
        If it is no attitude step, or no choice is given.
    """
    if not isinstance(choice, Choice):
        raise InputTypeError(f"choice is {choice!r}; what catalogue.choose returns is needed")
    kernel = catalogue.derive(choice)
    if kernel.companions is None:
        raise InputError(f"kernel {kernel.name} is no attitude step")
    nodes = None if kernel.inputs[1].name == "increments" else catalogue.nodes(choice)
    rounded = kernel.order is not None and bool(catalogue.rounding(choice))
    return Step(kernel, nodes, kernel.order.step + 1 if kernel.order and rounded else 0)


def linear_step(choice: Choice) -> Step:
    """Return a chosen attitude step that is linear in its state, so that it loses the same at any attitude.

    Raises
    ------
    InputError, InputTypeError
        If it is not, or no attitude step.
    """
    taken = step(choice)
    if taken.kernel.transition is None:
        raise InputError(
            f"kernel {taken.kernel.name} is not linear in its state: what it loses in a run depends on the attitude"
        )
    return taken


def general_rate(taken: Step, count: int) -> tuple[Frame, Any, list[list[Any]]]:
    """Return what a general rate is given in: a rotated frame, a ring over the step's field, the rate's derivatives.

    Parameters
    ----------
    taken : Step
    count : int
        How many derivatives, with the rate itself.
    """
    frame = Frame(count)
    ring = frame.ring.clone(domain=taken.domain)
    return frame, ring, [[element.set_ring(ring) for element in vector] for vector in frame.vectors]


def errors(taken: Step, ring: Any, rate: Rate, top: int) -> dict[str, list[Powers]]:
    """Return the error matrix of one step from zero rotation, and its parts, up to a power of the step.

    Parameters
    ----------
    taken : Step
    ring : PolyRing
        Ring of the coefficients, over the step's own field.
    rate : sequence of sequence of ring element
        The rate and its derivatives at the beginning of the step; those that are left out are zero.
    top : int
        The last power that is kept.

    Returns
    -------
    dict of str to list of Powers
        "error", nine elements row by row, "scale", "skew" and "drift", three each: the outputs of the kernel
        error-matrix.
    """
    both = (computed_matrix(taken, ring, rate, top), true_matrix(ring, rate, top))
    split = _error_matrix()
    values: dict[str, Any] = {}
    for signal, elements in zip(split.inputs, both, strict=True):
        values |= zip(signal.elements, elements, strict=True)
    made: dict[str, list[Powers]] = split.expand(values, lambda value: constant(ring, value, top))
    if taken.lowest:
        made = {
            name: [
                Powers(ring, {p: x for p, x in one.parts.items() if p >= taken.lowest}, top)
                for one in elements
            ]
            for name, elements in made.items()
        }
    return made


def shown(taken: Step, element: Any) -> Any:
    """Return a ring element with its coefficients as they are shown."""
    if not taken.lowest:
        return element
    terms = {
        place: taken.shown(Fraction(int(x.numerator), int(x.denominator))) for place, x in element.terms()
    }
    return element.ring.from_dict(
        {place: sp.QQ(x.numerator, x.denominator) for place, x in terms.items() if x}
    )


def split(error: Sequence[Any]) -> dict[str, list[Any]]:
    """Return scale, skew and drift of an error matrix that is given row by row in expressions.

    Parameters
    ----------
    error : sequence of Expr
    """
    kernel = _error_matrix()
    computed, true = (signal.elements for signal in kernel.inputs)
    values = dict(zip(computed, (element + int(k % 4 == 0) for k, element in enumerate(error)), strict=True))
    values |= zip(true, (sp.Integer(int(k % 4 == 0)) for k in range(9)), strict=True)
    return kernel.expand(values)


def _error_matrix() -> Kernel:
    return catalogue.derive(catalogue.choose("error-matrix"))


def computed_state(taken: Step, ring: Any, rate: Rate, top: int) -> list[Powers]:
    """Return the state after one step from zero rotation, row by row."""
    kernel, companions = taken.kernel, taken.kernel.companions
    assert companions is not None, "checked by `step`"
    state, samples = kernel.inputs
    values: dict[str, Any] = {
        name: constant(ring, sp.Rational(x.numerator, x.denominator), top)
        for name, x in zip(state.elements, companions.identity, strict=True)
    }
    if taken.nodes is None:
        count, previous = samples.shape[0] - companions.previous, companions.previous
        given = increments(ring, rate, count, previous, top)
    else:
        given = turns(ring, rate, taken.nodes, top)
    values |= dict(zip(samples.elements, given, strict=True))
    return _evaluated(kernel, values, ring, top)


def computed_matrix(taken: Step, ring: Any, rate: Rate, top: int) -> list[Powers]:
    """Return the direction cosine matrix after one step from zero rotation, row by row."""
    elements = computed_state(taken, ring, rate, top)
    companions = taken.kernel.companions
    if companions is None or companions.attitude is None:
        return elements
    attitude = catalogue.companion(taken.kernel, companions.attitude)
    values = dict(zip(attitude.inputs[0].elements, elements, strict=True))
    return _evaluated(attitude, values, ring, top)


def _evaluated(kernel: Kernel, values: dict[str, Any], ring: Any, top: int) -> list[Powers]:
    """Return the elements of a kernel's last output."""
    return outputs(kernel, values, ring, top)[kernel.outputs[-1].signal.name]


def increments(ring: Any, rate: Rate, count: int, previous: int, top: int) -> list[Powers]:
    """Return the elements of the exact increments that a step takes, row by row."""
    found = []
    for k in range(-previous, count):
        begin, end = sp.Rational(k, count), sp.Rational(k + 1, count)
        shares = [(end ** (j + 1) - begin ** (j + 1)) / sp.factorial(j + 1) for j in range(len(rate))]
        found += _moments(ring, rate, shares, top)
    return found


def turns(ring: Any, rate: Rate, nodes: Sequence[Number], top: int) -> list[Powers]:
    """Return the elements of the rate at nodes of the step, times its length, row by row."""
    found = []
    for node in nodes:
        shares = [algebra.exact(node) ** j / sp.factorial(j) for j in range(len(rate))]
        found += _moments(ring, rate, shares, top)
    return found


def _moments(ring: Any, rate: Rate, shares: Sequence[sp.Expr], top: int) -> list[Powers]:
    """Return sum_j shares[j] w_j h^(j+1) for every axis."""
    numbers = [ring.domain.from_sympy(share) for share in shares]
    return [
        Powers(ring, {j + 1: vector[axis] * numbers[j] for j, vector in enumerate(rate)}, top)
        for axis in range(3)
    ]


def true_matrix(ring: Any, rate: Rate, top: int) -> list[Powers]:
    """Return the true direction cosine matrix after the step, row by row.

    With the rate sum_j g_j t^j, dC/dt = C skew(w) gives (n + 1) C_(n+1) = sum_j C_(n-j) skew(g_j).
    """
    zero, one = ring.zero, ring.one
    skews = [
        [[x * ring.domain.from_sympy(1 / sp.factorial(j)) for x in row] for row in _skew(vector)]
        for j, vector in enumerate(rate)
    ]
    terms = [[[one if i == j else zero for j in range(3)] for i in range(3)]]
    for n in range(top):
        share = ring.domain.from_sympy(sp.Rational(1, n + 1))
        total = [[zero] * 3 for _ in range(3)]
        for j, skew in enumerate(skews[: n + 1]):
            left = terms[n - j]
            for i in range(3):
                for k in range(3):
                    total[i][k] = total[i][k] + sum((left[i][m] * skew[m][k] for m in range(3)), zero)
        terms.append([[element * share for element in row] for row in total])
    return [
        Powers(ring, {n: term[i][j] for n, term in enumerate(terms)}, top) for i in range(3) for j in range(3)
    ]


def _skew(vector: Sequence[Any]) -> list[list[Any]]:
    columns = [algebra.cross_elements(vector, [int(axis == k) for k in range(3)]) for axis in range(3)]
    return [list(row) for row in zip(*columns, strict=True)]
