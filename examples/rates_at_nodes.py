"""Euler parameters from the body rate at three nodes, whose weights and cross products are unknown."""

from fractions import Fraction

from strapgen import EULER, AttitudeStep, KernelBuilder, Signal, algebra, node_rotations_signal

NODES = (Fraction(0), Fraction(1, 2), Fraction(1))


def algorithm():
    """Return the step; p, q and r weigh the rates, a and b the cross products of the first one with the others."""
    build = KernelBuilder()
    p, q, r, a, b = build.parameter("p", "q", "r", "a", "b")
    state = build.input(EULER.state)
    rotations = build.input(node_rotations_signal(NODES))
    w1, w2, w3 = (rotations[k, :].T for k in range(3))
    phi = build.stage(
        Signal.vector("phi", "phi", unit="rad", meaning="rotation vector of the step"),
        p * w1 + q * w2 + r * w3 + a * algebra.cross(w1, w2) + b * algebra.cross(w1, w3),
    )
    transition = build.stage(EULER.transition, algebra.quaternion(phi))
    build.output(EULER.next, algebra.quaternion_product(state, transition))
    return build.kernel(
        "rates-at-nodes",
        "Euler parameters from the rate at the ends and in the middle of the step",
        "W. Magnus, Comm. Pure Appl. Math. 7 (1954) 649-673, equation (3.28)",
        transition=EULER.transition.name,
        attitude_step=AttitudeStep(
            "euler-product", "euler-normalize", "dcm-from-euler", (0, 0, 0, 1), isometry=True, nodes=NODES
        ),
    )
