"""The conditions on the unknown coefficients of a step of velocity and position, up to an order.

On a general motion the errors of the changes have to vanish up to a power of the step. On a polynomial motion, of the
degree that the samples determine, and on sculling they do so up to products of a rate and a force, for which there are
cross products of increments. Sculling is the rate u cos(omega t) with the force v cos(omega t + phase). The mean of the
cross product of the i-th derivative of the rate with the j-th of the force is then half of
omega^(i + j) cos((j - i) pi/2 + phase) u x v: the conditions hold at every phase if the even and the odd powers of the
step vanish, each by itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import sympy as sp

from strapgen.analysis.series import invariants, velocity_series
from strapgen.analysis.series.notation import TEXT, covariant_text, with_forces
from strapgen.analysis.unknowns.demands import Demand
from strapgen.analysis.unknowns.families import Equation
from strapgen.ir.exceptions import InputError
from strapgen.kernel.algebra import exact
from strapgen.kernel.covariants import Coefficients, Frame
from strapgen.kernel.kernel import Kernel
from strapgen.kernel.power_series import Powers, outputs
from strapgen.lab import sampled_motion

#: Products of a rate and a force, and no longer ones.
_PRODUCTS = 2


def conditions(kernel: Kernel, demand: Demand, more: int = 0) -> list[Equation]:
    """Return the conditions of an order, and of some orders beyond it.

    >>> from strapgen import choose, derive
    >>> step = derive(choose("velocity-position", "magnus2", 1))
    >>> for equation in conditions(step, Demand("velocity", 2), more=1):
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
    try:
        if demand.motion in ("polynomial", "sculling"):
            degree = kernel.inputs[0].shape[0] - 1 if demand.motion == "polynomial" else top - 1
            count = min(degree, top - 1) + 1
            rows = _of_small_motion(kernel, count, top)
        else:
            count, rows = top, velocity_series.coefficients(kernel, top)
    except ArithmeticError as error:
        raise InputError(f"kernel {kernel.name} has no series in the step length: {error}") from None
    state = _on_sculling if demand.motion == "sculling" else _of_error
    return [
        equation
        for part in parts
        for power, one in rows[part].items()
        for equation in state(part, power, one, count)
    ]


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
        errors[part] = {power: invariants.vector(frame, row) for power, row in rows.items()}
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


def _of_error(part: str, power: int, one: Coefficients, rates: int) -> Iterator[Equation]:
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
