"""The conditions on the unknown coefficients of an attitude step, up to an order.

On a general motion the error of a step has to vanish up to a power of the step. On a polynomial rate, of the degree
that the increments determine, and on coning it does so up to products of two rates, for which there are cross products
of increments. Coning is the rate u cos(omega t) + v sin(omega t), with two vectors u and v of one length across each
other. The cross product of its derivatives i and j is then omega^(i + j) sin((j - i) pi/2) u x v, the same at all
times, so that the drift is that of a run.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import sympy as sp

from strapgen.analysis.series.invariants import Invariants, invariants
from strapgen.analysis.series.notation import covariant_text
from strapgen.analysis.unknowns.demands import Demand
from strapgen.analysis.unknowns.families import Equation
from strapgen.ir.exceptions import InputError
from strapgen.kernel.algebra import exact
from strapgen.kernel.covariants import Frame
from strapgen.kernel.power_series import Powers
from strapgen.lab import one_step, sampled_motion
from strapgen.lab.one_step import Step

#: Order in the rate of the terms that conditions on coning and on polynomials have.
_PRODUCTS = 2


def conditions(attitude_step: Step, demand: Demand, more: int = 0) -> list[Equation]:
    """Return the conditions of an order, and of some orders beyond it.

    >>> from strapgen import choose
    >>> step = one_step.step(choose("euler", "rk2"))
    >>> for equation in conditions(step, Demand("general", 2), more=1):
    ...     print(equation.order, equation.label, equation.value)
    3 h^3, drift: |w0|^2 w0 -1/24
    3 h^3, drift: w0 x w1 -1/6
    """
    demand.require(velocity=False)
    top = demand.order + more
    try:
        if demand.motion == "general":
            frame, ring, rate = one_step.general_rate(attitude_step, top)
            error = one_step.errors(attitude_step, ring, rate, top)["error"]
            rows = {power: [x.parts.get(power, ring.zero) for x in error] for power in range(1, top + 1)}
            vanish = {power: invariants(frame, row) for power, row in rows.items() if any(row)}
        else:
            degree = len(attitude_step.intervals) - 1 if demand.motion == "polynomial" else top - 1
            vanish = _of_second_order(attitude_step, min(degree, top - 1) + 1, top)
    except ArithmeticError as error:
        raise InputError(
            f"kernel {attitude_step.kernel.name} has no series in the step length: {error}"
        ) from None
    if demand.motion == "coning":
        return [equation for power, one in vanish.items() for equation in _on_coning(power, one)]
    return [equation for power, one in vanish.items() for equation in _of_error(power, one)]


def _of_second_order(attitude_step: Step, count: int, top: int) -> dict[int, Invariants]:
    """Return the error up to products of two rates, by power of the step.

    The small quantity of the series is the size of the rate, and the length of the step stands in the ring.
    """
    frame = Frame(count)
    ring, *_ = sp.ring(["h", *map(str, frame.ring.symbols)], attitude_step.domain)
    vectors = [[sampled_motion.with_step(ring, x) for x in vector] for vector in frame.vectors]
    sampled = sampled_motion.of_small_motion(ring, vectors, attitude_step.shares(count), _PRODUCTS)
    state = one_step.state_of(attitude_step, sampled, ring, _PRODUCTS)
    computed = one_step.matrix_of(attitude_step, state, ring, _PRODUCTS)
    error = one_step.parts_of_error(computed, _true_matrix(ring, vectors), ring, _PRODUCTS)["error"]
    target = frame.ring.clone(domain=attitude_step.domain)
    rows = sampled_motion.by_power(target, error, top)
    return {power: invariants(frame, row) for power, row in rows.items()}


def _true_matrix(ring: Any, vectors: list[list[Any]]) -> list[Powers]:
    """Return the true matrix up to products of two rates, as a series in their size, row by row."""
    h = ring.gens[0]
    skews = []
    for j, vector in enumerate(vectors):
        share = ring.domain.from_sympy(1 / sp.factorial(j))
        x, y, z = (element * share for element in vector)
        skews.append([[ring.zero, -z, y], [z, ring.zero, -x], [-y, x, ring.zero]])
    first = [[ring.zero] * 3 for _ in range(3)]
    second = [[ring.zero] * 3 for _ in range(3)]
    for i, left in enumerate(skews):
        weight = ring.domain.from_sympy(sp.Rational(1, i + 1)) * h ** (i + 1)
        first = [[first[r][c] + left[r][c] * weight for c in range(3)] for r in range(3)]
        for j, right in enumerate(skews):
            # dC/dt = C skew(w): the first integral of skew(w_i) t^i stands before skew(w_j) t^j.
            weight = ring.domain.from_sympy(sp.Rational(1, (i + 1) * (i + j + 2))) * h ** (i + j + 2)
            product = [
                [sum((left[r][k] * right[k][c] for k in range(3)), ring.zero) for c in range(3)]
                for r in range(3)
            ]
            second = [[second[r][c] + product[r][c] * weight for c in range(3)] for r in range(3)]
    return [
        Powers(ring, {0: ring(int(r == c)), 1: first[r][c], 2: second[r][c]}, _PRODUCTS)
        for r in range(3)
        for c in range(3)
    ]


def _of_error(power: int, one: Invariants) -> Iterator[Equation]:
    """Yield a condition for every term of an error."""
    for part, coefficients in (("drift", one.drift), ("scale and skew", one.symmetric)):
        for covariant, polynomial in coefficients.items():
            for monomial, number in polynomial.items():
                term = covariant_text({covariant: {monomial: sp.S.One}}, symmetric=part != "drift")
                yield Equation(f"h^{power}, {part}: {term}", power, exact(number))


def _on_coning(power: int, one: Invariants) -> Iterator[Equation]:
    """Yield the conditions of a power on coning: the drift, and the rate's integral."""
    total = sp.S.Zero
    for covariant, polynomial in one.drift.items():
        number = exact(polynomial.get((), sp.S.Zero))
        if len(covariant) == 1 and number:
            yield Equation(f"h^{power}, angle: w{covariant[0]}", power, number)
        elif len(covariant) == 2 and (covariant[1] - covariant[0]) % 2:
            total += number * (-1) ** ((covariant[1] - covariant[0] - 1) // 2)
    if total := sp.expand(total):
        yield Equation(f"h^{power}, drift", power, total)


def vanishing(equations: list[Equation], values: Mapping[sp.Symbol, sp.Expr]) -> list[Equation]:
    """Return the equations that values do not satisfy, with the values inserted."""
    inserted = [Equation(e.label, e.order, sp.factor(sp.cancel(e.value.xreplace(values)))) for e in equations]
    return [equation for equation in inserted if equation.value != 0]
