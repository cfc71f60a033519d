"""Kernels of algorithms in two speeds: fast loops of coning and sculling, slow updates of attitude and velocity.

The fast loops compute coning, sculling and the rotation vector by recursion. The slow ones update the attitude by the
rotation vectors of the body and of the navigation frame, exact or truncated, and take velocity increments from body to
navigation axes.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import sympy as sp

from strapgen.catalogue.kinematics import DCM_MEANING, KINEMATICS, SAVAGE, UNIT, Kinematics
from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import Signal, after
from strapgen.kernel import algebra
from strapgen.kernel.algebra import cross
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


def _describe(kinematics: Kinematics, order: int | None, which: int) -> tuple[str, str, tuple[str, ...]]:
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
    words, source, notes = _describe(kinematics, order, 0)
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
    words, source, notes = _describe(kinematics, order, 1)
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


INCREMENT = Signal.vector(
    "increment",
    "d",
    unit="rad",
    meaning="angle increment of the fast cycle, body axes: exact integral of the body rate",
    bound=Fraction(1, 8),
    frame="b",
    over="cycle",
)
PREVIOUS = Signal.vector(
    "previous_increment",
    "past",
    unit="rad",
    meaning="angle increment of the fast cycle before; zero at the start",
    bound=Fraction(1, 8),
    frame="b",
    over="cycle",
)
ANGLE_SUM = Signal.vector(
    "angle_sum",
    "beta",
    unit="rad",
    meaning="sum of the angle increments since the slow cycle began",
    bound=Fraction(1),
    frame="b",
)
CONING = Signal.vector(
    "coning",
    "coning",
    unit="rad",
    meaning="coning correction since the slow cycle began",
    bound=Fraction(1, 8),
    frame="b",
)
VELOCITY_INCREMENT = Signal.vector(
    "velocity_increment",
    "dv",
    unit="m/s",
    meaning="velocity increment of the fast cycle, body axes: exact integral of the specific force",
    bound=Fraction(1),
    frame="b",
    over="cycle",
)
VELOCITY_SUM = Signal.vector(
    "velocity_sum",
    "u",
    unit="m/s",
    meaning="sum of the velocity increments since the slow cycle began",
    bound=Fraction(8),
    frame="b",
)
SCULLING = Signal.vector(
    "sculling",
    "eta",
    unit="m/s",
    meaning="sculling integral since the slow cycle began",
    bound=Fraction(4),
    frame="b",
)


def coned(
    build: KernelBuilder, coning: sp.Matrix, beta: sp.Matrix, past: sp.Matrix, d: sp.Matrix
) -> sp.Matrix:
    """Return the coning correction after a fast cycle, in rad, equation (26); `past` is the previous increment."""
    arm = Signal.vector("arm", "arm", unit="rad", meaning="angle at the middle of the cycle, for coning")
    return coning + cross(build.stage(arm, beta + past / 6), d) / 2


def sculled(
    build: KernelBuilder,
    form: int,
    eta: sp.Matrix,
    beta: sp.Matrix,
    u: sp.Matrix | None,
    d: sp.Matrix,
    dv: sp.Matrix,
) -> sp.Matrix:
    """Return the sculling integral after a fast cycle, in m/s: S1 by equation (55), which needs no u, or S2 by (56)."""
    if form == 1:
        middle = Signal.vector("middle", "middle", unit="rad", meaning="angle at the middle of the cycle")
        return eta + cross(build.stage(middle, beta + d / 2), dv)
    return eta + (cross(beta, dv) + cross(u, d)) / 2


def coning() -> Kernel:
    """Derive the fast loop of the rotation vector, equation (26)."""
    build = KernelBuilder()
    beta, correction, past, d = map(build.input, (ANGLE_SUM, CONING, PREVIOUS, INCREMENT))
    build.feedback(ANGLE_SUM, beta + d, reset=True)
    build.feedback(CONING, coned(build, correction, beta, past, d), reset=True)
    build.feedback(PREVIOUS, d)
    return build.kernel("coning-fast", "Rotation vector by recursion: fast loop", f"{SAVAGE}, equation (26)")


def rotation_vector_of(beta: sp.Matrix, correction: sp.Matrix) -> sp.Matrix:
    """Return the rotation vector of a slow cycle, the sum of increments plus coning correction, equation (22)."""
    return beta + correction


def rotation_vector() -> Kernel:
    """Derive the slow loop of the rotation vector, equation (26)."""
    build = KernelBuilder()
    beta, correction = build.input(ANGLE_SUM), build.input(CONING)
    build.output(ROTATION_VECTOR, rotation_vector_of(beta, correction))
    return build.kernel(
        "coning-slow", "Rotation vector by recursion: slow loop", f"{SAVAGE}, equations (22) and (26)"
    )


def sculling(form: int) -> Kernel:
    """Derive the fast loop of the velocity: S1 by equation (55) for form 1, S2 by (56) for form 2."""
    build = KernelBuilder()
    beta, u, eta, d, dv = map(build.input, (ANGLE_SUM, VELOCITY_SUM, SCULLING, INCREMENT, VELOCITY_INCREMENT))
    build.feedback(ANGLE_SUM, beta + d, reset=True)
    build.feedback(VELOCITY_SUM, u + dv, reset=True)
    build.feedback(SCULLING, sculled(build, form, eta, beta, u, d, dv), reset=True)
    title = "Sculling with rotation compensation apart" if form == 2 else "Sculling and rotation compensation"
    return build.kernel(
        f"sculling-fast-{form}",
        f"{title} by recursion: fast loop",
        f"{SAVAGE}, equation {'(56)' if form == 2 else '(55)'}",
    )


TRANSFORMED = Signal.vector(
    "transformed",
    "v",
    unit="m/s",
    meaning="velocity increment of the slow cycle, navigation axes",
    frame="n",
    over="cycle",
)
NAVIGATION_VELOCITY = Signal.vector(
    "navigation_velocity",
    "v",
    unit="m/s",
    meaning="sum of the velocity increments over the navigation cycle, navigation axes",
    bound=Fraction(64),
    frame="n",
)
#: The equation of Savage that takes the velocity to navigation axes, by state and form of the sculling integral.
VELOCITY_EQUATIONS = {("dcm", 1): "(51)", ("dcm", 2): "(52)", ("euler", 1): "(57)", ("euler", 2): "(58)"}


def rotated(build: KernelBuilder, name: str, state: sp.Matrix, u: sp.Matrix) -> sp.Matrix:
    """Return vectors u (3, N) in navigation axes instead of body axes: C u, or q u q*."""
    if name == "dcm":
        return state * u
    matrix = Signal.matrix(
        "attitude", "C", meaning=DCM_MEANING, bound=UNIT, constraint="rotation", frame="b to n"
    )
    return build.stage(matrix, algebra.quaternion_matrix(state).applyfunc(sp.expand)) * u


def compensated(
    build: KernelBuilder, form: int, u: sp.Matrix, sculling: sp.Matrix, beta: sp.Matrix | None
) -> sp.Matrix:
    """Return the velocity increment of a slow cycle in m/s, body axes at its start: u + S1 or u + beta x u / 2 + S2."""
    meaning = "velocity increment, body axes at the start of the slow cycle"
    named = Signal.vector("compensated", "w", unit="m/s", meaning=meaning)
    return build.stage(named, u + sculling + (cross(beta, u) / 2 if form == 2 else sp.zeros(3, 1)))


def transformation(name: str) -> Kernel:
    """Derive the transformation of a specific force from body to navigation axes, equations (44) and (57)."""
    build = KernelBuilder()
    state = build.input(KINEMATICS[name].state)
    a = build.input(
        Signal.vector(
            "acceleration",
            "a",
            unit="m/s^2",
            meaning="specific force, body axes",
            bound=Fraction(128),
            frame="b",
        )
    )
    build.output(
        Signal.vector("transformed", "v", unit="m/s^2", meaning="specific force, navigation axes", frame="n"),
        rotated(build, name, state, a),
    )
    return build.kernel(
        f"{name}-acceleration",
        f"Acceleration transformation by {_words(name)}",
        f"{SAVAGE}, equation {'(44)' if name == 'dcm' else '(57)'}",
    )


def velocity(name: str, form: int) -> Kernel:
    """Derive the slow loop of the velocity, with S1 by equations (51) and (57) or S2 by equations (52) and (58)."""
    build = KernelBuilder()
    state, u, eta = map(build.input, (KINEMATICS[name].state, VELOCITY_SUM, SCULLING))
    beta = build.input(ANGLE_SUM) if form == 2 else None
    build.output(TRANSFORMED, rotated(build, name, state, compensated(build, form, u, eta, beta)))
    return build.kernel(
        f"{name}-velocity-{form}",
        f"Velocity increment in navigation axes by {_words(name)}, with S{form}",
        f"{SAVAGE}, equation {VELOCITY_EQUATIONS[name, form]}",
    )


def frame_correction(theta: sp.Matrix, v: sp.Matrix) -> sp.Matrix:
    """Return the change of velocity due to the rotation theta of the navigation frame over its cycle, equation (59)."""
    return -cross(theta, v) / 2


def navigation_velocity() -> Kernel:
    """Derive the velocity correction for the rotation of the navigation frame, equation (59)."""
    build = KernelBuilder()
    theta, v = build.input(NAVIGATION_ROTATION), build.input(NAVIGATION_VELOCITY)
    build.output(
        Signal.vector(
            "correction",
            "correction",
            unit="m/s",
            meaning="to be added to the velocity",
            frame="n",
            over="cycle",
        ),
        frame_correction(theta, v),
    )
    return build.kernel(
        "navigation-velocity",
        "Velocity correction for the rotation of the navigation frame",
        f"{SAVAGE}, equation (59)",
    )


def _words(name: str) -> str:
    return KINEMATICS[name].title.lower() if name == "dcm" else "Euler parameters"
