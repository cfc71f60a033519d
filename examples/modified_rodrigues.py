"""An algorithm of your own: modified Rodrigues parameters, with the set switched so that they stay below 1.

strapgen takes this file wherever it takes the name of an algorithm:

    strapgen check examples/modified_rodrigues.py
    strapgen generate examples/modified_rodrigues.py --method rk4 --increments 2 --target c --out firmware
"""

from fractions import Fraction

import sympy as sp

from strapgen import (
    TABLEAUX,
    AttitudeStep,
    Kernel,
    KernelBuilder,
    Samples,
    Signal,
    Tableau,
    algebra,
    runge_kutta,
)

SOURCE = "H. Schaub, J. L. Junkins, J. Astronaut. Sci. 44 (1996) 1-19"

STATE = Signal.vector(
    "state",
    "s",
    meaning="modified Rodrigues parameters, body to reference: axis times tan(angle/4)",
    bound=Fraction(1),
)


def derivative(s: sp.Matrix, turn: sp.Matrix) -> sp.Matrix:
    """Return ds/dt = ((1 - s.s) w + 2 s x w + 2 (s.w) s)/4 for the body rate w."""
    return ((1 - algebra.dot(s, s)) * turn + 2 * algebra.cross(s, turn) + 2 * algebra.dot(s, turn) * s) / 4


def switched(s: sp.Matrix) -> list[sp.Expr]:
    """Return the shadow set -s/(s.s) where s is longer than 1: the same attitude, and no singularity ahead."""
    square = algebra.dot(s, s)
    shorter = sp.Max(square, 1)  # keeps the division in range on the branch that is not taken
    return [sp.Piecewise((-element / shorter, square > 1), (element, True)) for element in s]


def attitude() -> Kernel:
    """Return the direction cosine matrix, I + (8 S^2 + 4 (1 - s.s) S)/(1 + s.s)^2 with S the matrix of s x."""
    build = KernelBuilder()
    s = build.input(STATE)
    square = build.value("square", algebra.dot(s, s))
    S = algebra.skew(s)
    matrix = sp.eye(3) + (8 * S * S + 4 * (1 - square) * S) / (1 + square) ** 2
    build.output(Signal.matrix("attitude", "C", meaning="direction cosine matrix, body to reference"), matrix)
    return build.kernel(
        "dcm-from-rodrigues", "Direction cosine matrix from modified Rodrigues parameters", SOURCE
    )


def algorithm(method: Tableau = TABLEAUX["rk4"], increments: int = 2, previous: int = 0) -> Kernel:
    """Return the step by any tableau from any number of increments: what strapgen calls."""
    build = KernelBuilder()
    state = build.input(STATE)
    samples = Samples(build, increments, previous)
    turns = {node: samples.turn(node) for node in runge_kutta.nodes(method)}
    end = runge_kutta.advance(build, method, turns, state, derivative, like=STATE, origin="the state")
    moved = build.stage(Signal.vector("moved", "moved", meaning="parameters before they are switched"), end)
    after = Signal.vector("next", "next", meaning=f"{STATE.meaning}, after the step", bound=Fraction(1))
    build.output(after, switched(moved))
    kept = f"-previous{previous}" if previous else ""
    return build.kernel(
        f"rodrigues-{method.name}-{increments}{kept}",
        f"Modified Rodrigues parameters: step by {method.title}",
        f"{SOURCE}; {method.title}: {method.source}",
        attitude_step=AttitudeStep(
            product=None,  # not linear in the state: there is no transition
            orthonormalize=None,  # nothing to restore
            attitude="dcm-from-rodrigues",
            identity=(Fraction(0),) * 3,
            previous=previous,
        ),
        order=samples.order(method.order),
        bundled_kernels=(attitude(),),
    )
