"""Attitude updates by the rotation vectors of the body and of the navigation frame, exact or truncated."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import sympy as sp

from strapgen.catalogue.kinematics import KINEMATICS, SAVAGE, Kinematics
from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import Signal, after
from strapgen.kernel import algebra
from strapgen.kernel.kernel import Kernel, KernelBuilder

ROTATION_VECTOR = Signal.vector(
    "rotation_vector",
    "phi",
    unit="rad",
    meaning="rotation vector of the cycle, body axes",
    bound=Fraction(1),
    frame="b",
    over="cycle",
)
NAVIGATION_ROTATION = Signal.vector(
    "navigation_rotation",
    "theta",
    unit="rad",
    meaning="rotation of the navigation frame over its cycle, navigation axes",
    bound=Fraction(1, 8),
    frame="n",
)
TURN, PREVIOUS_TURN = (
    Signal.vector(
        name,
        prefix,
        unit="rad",
        meaning=f"rate of the navigation frame {when} times the slow cycle, navigation axes",
        bound=Fraction(1, 64),
        frame="n",
    )
    for name, prefix, when in (("turn", "turn", "at its end"), ("previous_turn", "before", "at its start"))
)
#: Equations of the source by the size of the state: update of the body frame, update of the navigation frame.
_EQUATIONS = {9: ("(2) to (4)", "(5) and (6)"), 4: ("(9) to (14)", "(15)")}


def transition(
    build: KernelBuilder, kinematics: Kinematics, phi: sp.Matrix, order: int | None = None, frame: str = "b"
) -> sp.Matrix:
    """Name the transition of a rotation vector in rad, exact or to degree `order`, and return its symbols."""
    square = build.value("angle_squared", algebra.dot(phi, phi), "square of the angle")
    turning = replace(kinematics.transition, frame=f"{frame} to {frame}")
    return build.stage(turning, kinematics.exponential(phi, order, square))


def _described(kinematics: Kinematics, order: int | None, which: int) -> tuple[str, str, tuple[str, ...]]:
    """Return the end of the title, the source and the notes for an order."""
    equations = _EQUATIONS[kinematics.state.size][which]
    if order is None:
        return ", exact", f"{SAVAGE}, equations {equations} with all terms", ()
    note = f"Products of the elements of the rotation vector are kept up to degree {order}."
    return f", order {order}", f"{SAVAGE}, equations {equations}", (note,)


def update(name: str, order: int | None = None) -> Kernel:
    """Derive the rotation of an attitude by the rotation vector of a cycle, equations (2) to (4), (9) to (14).

    The exact kernel uses sin(x)/x at all angles, since its rounding error is no larger at small ones.
    """
    kinematics = KINEMATICS[name]
    build = KernelBuilder()
    state, phi = build.input(kinematics.state), build.input(ROTATION_VECTOR)
    step_transition = transition(build, kinematics, phi, order)
    build.output(kinematics.next, kinematics.product(state, step_transition))
    words, source, notes = _described(kinematics, order, 0)
    return build.kernel(
        f"{name}-update" + (f"-{order}" if order else ""),
        f"{kinematics.title}: update by a rotation vector{words}",
        source,
        transition=kinematics.transition.name,
        recursion=Recursion(
            ((kinematics.state.name, kinematics.next.name),), retained=(kinematics.state.name,)
        ),
        notes=notes,
    )


def turned_frame(
    build: KernelBuilder, kinematics: Kinematics, state: sp.Matrix, theta: sp.Matrix, order: int | None = None
) -> sp.Matrix:
    """Return a state relative to the navigation frame after the frame rotated by theta in rad, navigation axes."""
    turn = transition(build, kinematics, -theta, order, "n")
    return kinematics.product(turn, state)


def navigation_update(name: str, order: int | None = None) -> Kernel:
    """Derive the attitude relative to the rotated navigation frame, equations (5), (6) and (15)."""
    kinematics = KINEMATICS[name]
    build = KernelBuilder()
    state, theta = build.input(kinematics.state), build.input(NAVIGATION_ROTATION)
    build.output(kinematics.next, turned_frame(build, kinematics, state, theta, order))
    words, source, notes = _described(kinematics, order, 1)
    return build.kernel(
        f"{name}-navigation-update" + (f"-{order}" if order else ""),
        f"{kinematics.title}: update by the rotation of the navigation frame{words}",
        source,
        recursion=Recursion(
            ((kinematics.state.name, kinematics.next.name),), retained=(kinematics.state.name,)
        ),
        notes=notes,
    )


def rotation_sum(theta: sp.Matrix, before: sp.Matrix, turn: sp.Matrix) -> sp.Matrix:
    """Return the rotation of the navigation frame after one more cycle, by the trapezoidal rule, equation (27)."""
    return theta + (before + turn) / 2


def navigation_rotation() -> Kernel:
    """Derive the trapezoidal integral of the rate of the navigation frame, equation (27)."""
    build = KernelBuilder()
    theta, before, turn = map(build.input, (NAVIGATION_ROTATION, PREVIOUS_TURN, TURN))
    build.output(after(NAVIGATION_ROTATION), rotation_sum(theta, before, turn))
    build.output(after(PREVIOUS_TURN), turn)
    return build.kernel(
        "navigation-rotation",
        "Rotation of the navigation frame, trapezoidal",
        f"{SAVAGE}, equation (27)",
        recursion=Recursion(
            tuple((signal.name, after(signal).name) for signal in (NAVIGATION_ROTATION, PREVIOUS_TURN)),
            retained=(PREVIOUS_TURN.name,),
        ),
    )
