"""The conditions on the unknown coefficients of a step of attitude, or of velocity and position, up to an order.

On a general motion the error of a step has to vanish up to a power of the step. On a polynomial motion, of the degree
that the samples determine, on coning and on sculling it does so up to products of two vectors, for which there are
cross products of increments.

Coning is the rate u cos(omega t) + v sin(omega t), with two vectors u and v of one length across each other. The cross
product of its derivatives i and j is omega^(i + j) sin((j - i) pi/2) u x v, the same at all times, so that the drift is
that of a run. Sculling is the rate u cos(omega t) with the force v cos(omega t + phase). The mean of the cross product
of the i-th derivative of the rate with the j-th of the force is half of omega^(i + j) cos((j - i) pi/2 + phase) u x v:
the conditions hold at every phase if the even and the odd powers of the step vanish, each by itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import sympy as sp

from strapgen.analysis.series import velocity_series
from strapgen.analysis.series.invariants import (
    TEXT,
    Invariants,
    covariant_text,
    invariants,
    vector_invariants,
    with_forces,
)
from strapgen.analysis.series.motion_rates import in_powers_of_the_step
from strapgen.analysis.unknowns.elimination import Equation
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.kernel.algebra import exact
from strapgen.kernel.covariants import Coefficients, Frame
from strapgen.kernel.kernel import Kernel
from strapgen.kernel.power_series import Powers, outputs
from strapgen.lab import one_step, sampled_motion
from strapgen.lab.one_step import Step

#: Motions on which conditions of an attitude step are stated.
OF_ATTITUDE = ("general", "coning", "polynomial")
#: Motions, and parts of the change on any motion, on which those of a step of velocity and position are.
OF_VELOCITY = ("general", "velocity", "position", "polynomial", "sculling")
#: Highest order: on any smooth motion, of an attitude and of a velocity, and to second order in the motion.
MOST_GENERAL, MOST_OF_VELOCITY, MOST_SECOND = 8, 6, 16
#: Vectors in the products of the conditions on coning, sculling and polynomials.
_PRODUCTS = 2


@dataclass(frozen=True)
class Demand:
    """A motion and the required order of a step on it."""

    #: One of `OF_ATTITUDE` or `OF_VELOCITY`
    motion: str
    #: The last power of the step at which its error has to vanish
    order: int

    def require(self, velocity: bool) -> None:
        """Check the motion and the order."""
        what = "step of velocity and position" if velocity else "attitude step"
        checks.choice(f"motion of the {what}", self.motion, OF_VELOCITY if velocity else OF_ATTITUDE)
        most = MOST_OF_VELOCITY if velocity else MOST_GENERAL
        if self.motion in ("coning", "polynomial", "sculling"):
            most = MOST_SECOND
        checks.count(f"order on {self.motion} motion", self.order, largest=most)


def attitude_conditions(attitude_step: Step, demand: Demand, more: int = 0) -> list[Equation]:
    """Return the conditions of an order, and of some orders beyond it.

    >>> from strapgen import choose
    >>> step = one_step.step(choose("euler", "rk2"))
    >>> for equation in attitude_conditions(step, Demand("general", 2), more=1):
    ...     print(equation.order, equation.label, equation.value)
    3 h^3, drift: |w0|^2 w0 -1/24
    3 h^3, drift: w0 x w1 -1/6
    """
    demand.require(velocity=False)
    top = demand.order + more
    with in_powers_of_the_step(attitude_step.kernel.name):
        if demand.motion == "general":
            frame, ring, rate = one_step.general_rate(attitude_step, top)
            error = one_step.errors(attitude_step, ring, rate, top)["error"]
            rows = {power: [x.parts.get(power, ring.zero) for x in error] for power in range(1, top + 1)}
            vanish = {power: invariants(frame, row) for power, row in rows.items() if any(row)}
        else:
            degree = len(attitude_step.intervals) - 1 if demand.motion == "polynomial" else top - 1
            vanish = _of_second_order(attitude_step, min(degree, top - 1) + 1, top)
    if demand.motion == "coning":
        return [equation for power, one in vanish.items() for equation in _on_coning(power, one)]
    return [equation for power, one in vanish.items() for equation in _of_attitude_error(power, one)]


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


def _of_attitude_error(power: int, one: Invariants) -> Iterator[Equation]:
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


def velocity_conditions(kernel: Kernel, demand: Demand, more: int = 0) -> list[Equation]:
    """Return the conditions of an order, and of some orders beyond it.

    >>> from strapgen import choose, derive
    >>> step = derive(choose("velocity-position", "magnus2", 1))
    >>> for equation in velocity_conditions(step, Demand("velocity", 2), more=1):
    ...     print(equation.order, equation.label, equation.value)
    3 h^3, velocity: w0 x f1 -1/12
    3 h^3, velocity: w1 x f0 1/12
    """
    demand.require(velocity=True)
    parts = velocity_series.parts_of(kernel)
    if demand.motion in ("velocity", "position"):
        parts = tuple(part for part in parts if part == demand.motion)
    if demand.motion == "sculling":
        parts = tuple(part for part in parts if part == "velocity")
    if not parts:
        part = "velocity" if demand.motion == "sculling" else demand.motion
        raise InputError(
            f"kernel {kernel.name} returns no {part}_change, on which {demand.motion} sets conditions"
        )
    top = demand.order + more
    with in_powers_of_the_step(kernel.name):
        if demand.motion in ("polynomial", "sculling"):
            degree = kernel.inputs[0].shape[0] - 1 if demand.motion == "polynomial" else top - 1
            count = min(degree, top - 1) + 1
            rows = _of_small_motion(kernel, count, top)
        else:
            count, rows = top, velocity_series.coefficients(kernel, top)
    state = _on_sculling if demand.motion == "sculling" else _of_change_error
    return [
        equation
        for part in parts
        for power, one in rows[part].items()
        for equation in state(part, power, one, count)
    ]


# The conditions on the unknown coefficients of a step of velocity and position, up to an order.
#
# On a general motion the errors of the changes have to vanish up to a power of the step. On a polynomial motion, of
# the degree that the samples determine, and on sculling they do so up to products of a rate and a force, for which
# there are cross products of increments. Sculling is the rate u cos(omega t) with the force v cos(omega t + phase).
# The mean of the cross product of the i-th derivative of the rate with the j-th of the force is then half of omega^(i
# + j) cos((j - i) pi/2 + phase) u x v: the conditions hold at every phase if the even and the odd powers of the step
# vanish, each by itself.


def _of_small_motion(kernel: Kernel, count: int, top: int) -> dict[str, dict[int, Coefficients]]:
    """Return the errors up to products of a rate and a force, by part and power of the step."""
    frame = Frame(2 * count)
    domain = velocity_series.domain(kernel)
    ring, *_ = sp.ring(["h", *map(str, frame.ring.symbols)], domain)
    vectors = [[sampled_motion.with_step(ring, x) for x in vector] for vector in frame.vectors]
    motion = vectors[:count], vectors[count:]
    shares = velocity_series.shares(kernel, count)
    values: dict[str, Any] = {}
    for signal, each in zip(kernel.inputs, motion, strict=True):
        elements = sampled_motion.of_small_motion(ring, each, shares, _PRODUCTS)
        values |= zip(signal.elements, elements, strict=True)
    computed = outputs(kernel, values, ring, _PRODUCTS)
    target = frame.ring.clone(domain=domain)
    errors: dict[str, dict[int, Coefficients]] = {}
    for part in velocity_series.parts_of(kernel):
        true = _true_change(ring, motion, part)
        lost = [a - b for a, b in zip(computed[f"{part}_change"], true, strict=True)]
        rows = sampled_motion.by_power(target, lost, top)
        errors[part] = {power: vector_invariants(frame, row) for power, row in rows.items()}
    return errors


def _true_change(ring: Any, motion: tuple[Any, Any], part: str) -> list[Powers]:
    """Return a true change up to products of a rate and a force, as a series in the size of the motion."""
    h = ring.gens[0]
    # Only a turn by a first power of the rate is needed: it is 1 + the integral of skew(w), a matrix (3, 3).
    turn: list[dict[int, Any]] = [{0: ring.one} if k % 4 == 0 else {} for k in range(9)]
    for i, (x, y, z) in enumerate(motion[0]):
        for k, element in ((1, -z), (2, y), (3, z), (5, -x), (6, -y), (7, x)):
            turn[k][i + 1] = element * ring.domain.from_sympy(1 / sp.factorial(i + 1))
    change = []
    for row in range(3):
        sizes = {1: ring.zero, 2: ring.zero}
        for j, force in enumerate(motion[1]):
            for k in range(3):
                for n, element in turn[3 * row + k].items():
                    weight = velocity_series.share_of_change(part, n, j)
                    size = 2 if n else 1
                    term = element * force[k] * ring.domain.from_sympy(weight) * h ** (n + j + 1)
                    sizes[size] = sizes[size] + term
        change.append(Powers(ring, sizes, _PRODUCTS))
    return change


def _of_change_error(part: str, power: int, one: Coefficients, rates: int) -> Iterator[Equation]:
    """Yield a condition for every term of an error."""
    notation = with_forces(TEXT, rates)
    for covariant, polynomial in sorted(one.items()):
        for monomial, number in sorted(polynomial.items()):
            term = covariant_text({covariant: {monomial: sp.S.One}}, notation=notation)
            yield Equation(f"h^{power}, {part}: {term}", power, exact(number))


def _on_sculling(part: str, power: int, one: Coefficients, rates: int) -> Iterator[Equation]:
    """Yield the conditions of a power on sculling: the mean velocity, and the integral of the force."""
    total = sp.S.Zero
    for covariant, polynomial in one.items():
        number = exact(polynomial.get((), sp.S.Zero))
        if len(covariant) == 1 and covariant[0] >= rates:
            yield Equation(f"h^{power}, {part}: f{covariant[0] - rates}", power, number)
        elif len(covariant) == 2 and covariant[0] < rates <= covariant[1]:
            quarters = (covariant[1] - rates - covariant[0]) % 4
            total += number if quarters < 2 else -number
    if total := sp.expand(total):
        yield Equation(f"h^{power}, mean {part}", power, total)
