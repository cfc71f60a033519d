"""Euler parameters from increments and their cross products, with an unknown coefficient for each pair or distance."""

from strapgen import EULER, AttitudeStep, KernelBuilder, Signal, algebra, increments_signal


def algorithm(increments=2, previous=0):
    build = KernelBuilder()
    state = build.input(EULER.state)
    count = increments + previous
    rows = build.input(increments_signal(increments, previous))
    samples = [rows[k, :].T for k in range(count)]
    phi = sum(samples[previous + 1 :], samples[previous])
    for newer in range(1, count):
        for older in range(newer):
            weight = build.parameter(f"k_{older}_{newer}")
            phi += weight * algebra.cross(samples[older], samples[newer])
    phi = build.stage(Signal.vector("phi", "phi", unit="rad"), phi)
    p = build.stage(EULER.transition, algebra.quaternion(phi))
    build.output(EULER.next, algebra.quaternion_product(state, p))
    return build.kernel(
        "pairs",
        "Euler parameters from cross products of increments",
        "this test",
        transition=EULER.transition.name,
        attitude_step=AttitudeStep(
            "euler-product", "euler-normalize", "dcm-from-euler", (0, 0, 0, 1), previous, isometry=True
        ),
    )
