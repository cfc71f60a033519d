"""Derives what compares sensors at two places: moment arm, relative attitude and its mean over alignments."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from strapgen.catalogue.kinematics import DCM
from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import CYCLE, Signal, after
from strapgen.kernel.algebra import cross
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.redundancy.parity_equations import SEBRING

INCREMENT = Signal.vector(
    "increment",
    "d",
    unit="rad",
    meaning="angle increment of the cycle, body axes",
    bound=Fraction(1, 8),
    frame="b",
    over=CYCLE,
)
PREVIOUS = replace(
    INCREMENT,
    name="previous_increment",
    elements=tuple(f"previous_{name}" for name in INCREMENT.elements),
    meaning="angle increment of the cycle before, body axes",
)


def moment_arm() -> Kernel:
    """Return the velocity increment at the end of a moment arm: a + w' x r + w x (w x r), w' by differences.

    Returns: inputs ``velocity_increment`` (3,) in m/s, ``increment`` and ``previous_increment`` (3,) in rad,
    ``arm`` (3,) in m, all body axes, and ``cycle_rate`` 1/T in 1/s; outputs ``arm_velocity_increment`` (3,) in
    m/s and ``next_previous_increment``.
    """
    build = KernelBuilder()
    velocity = Signal.vector(
        "velocity_increment",
        "dv",
        unit="m/s",
        meaning="velocity increment of the cycle, body axes",
        bound=Fraction(4),
        frame="b",
        over=CYCLE,
    )
    arm = Signal.vector(
        "arm",
        "r",
        unit="m",
        meaning="from the sensors to the other place, body axes",
        bound=Fraction(4),
        frame="b",
    )
    dv, d, before, r = map(build.input, (velocity, INCREMENT, PREVIOUS, arm))
    rate = build.scalar(
        Signal.scalar("cycle_rate", unit="1/s", meaning="1/T, cycles in a second", bound=Fraction(128))
    )
    turned = build.stage(
        Signal.vector("turned", "turned", unit="m rad", meaning="displacement by the turn"), cross(d, r)
    )
    change = cross(d - before, r) + cross(d, turned)
    build.output(
        replace(velocity, name="arm_velocity_increment", elements=("arm_x", "arm_y", "arm_z"), bound=None),
        dv + rate * change,
    )
    build.output(after(PREVIOUS), d)
    return build.kernel(
        "moment-arm",
        "Velocity increment at the end of a moment arm",
        f"{SEBRING}, arm printed, equations lost and derived",
        recursion=Recursion(((PREVIOUS.name, after(PREVIOUS).name),), retained=(PREVIOUS.name,)),
        notes=("The rate of change is the difference of two cycles, and so that of half a cycle before.",),
    )


def boresight() -> Kernel:
    """Return the mean of the relative attitudes of two units over alignments, (C_B^n)' C_A^n.

    Returns: inputs ``attitude_a`` and ``attitude_b`` (3, 3), C_A^n and C_B^n, ``mean`` (3, 3), a state, and
    ``share``, 1/k in alignment k; output ``next_mean``. `dcm-orthonormalize-optimal` makes a rotation of the
    mean.
    """
    build = KernelBuilder()
    attitudes = [
        replace(
            DCM.state,
            name=f"attitude_{unit}",
            elements=tuple(name.replace(name.split("_")[0], unit) for name in DCM.state.elements),
            meaning=f"attitude of unit {unit.upper()} from its alignment, its axes to navigation axes",
        )
        for unit in "ab"
    ]
    a, b = map(build.input, attitudes)
    mean = Signal.matrix(
        "mean",
        "mean",
        meaning="mean of the relative attitude, axes of A to axes of B",
        bound=Fraction(1),
    )
    c = build.input(mean)
    share = build.scalar(Signal.scalar("share", meaning="1/k in alignment k", bound=Fraction(1)))
    build.output(after(mean), c + share * (b.T * a - c))
    return build.kernel(
        "boresight",
        "Mean relative attitude of two units",
        f"{SEBRING}, printed; running mean derived",
        recursion=Recursion(((mean.name, after(mean).name),), retained=(mean.name,)),
    )
