"""Derives the kernels between stages of different rates: sums and shares of increments, and increments from counts."""

from __future__ import annotations

from fractions import Fraction

from strapgen.ir.signals import ANY, CYCLE, Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder

_NOTE = "Unit any stands for the unit of the increments."

INCREMENT = Signal.vector("increment", "d", unit=ANY, meaning="increment of the cycle", frame=ANY, over=CYCLE)
SUM = Signal.vector(
    "sum", "sum", unit=ANY, meaning="sum of the increments since the slower cycle began", frame=ANY
)
#: The increment of a slower cycle is there for all faster cycles in it, and so no increment of theirs.
HELD = Signal.vector("increment", "d", unit=ANY, meaning="increment of the slower cycle, held", frame=ANY)
SHARE = Signal.scalar("share", meaning="1/N for N faster cycles in a slower one", bound=Fraction(1))

#: What sensors count: the unit of an increment, in words, and bounds of the scale: quanta of 3 arcsec and 1 cm/s fit.
_COUNTED = {"angle": ("rad", Fraction(1, 1 << 14)), "velocity": ("m/s", Fraction(1, 64))}


def increment_sum() -> Kernel:
    """Return the sum of the increments of a fast rate for a slower one.

    Returns: inputs ``sum`` (3,), which is zero at the start of every slower cycle, and ``increment`` (3,) of
    the faster cycle, in any unit and frame that they share; output ``next_sum`` (3,).

    >>> increment_sum().recursion.reset
    ('sum',)
    """
    build = KernelBuilder()
    total, d = build.input(SUM), build.input(INCREMENT)
    build.feedback(SUM, total + d, reset=True)
    return build.kernel(
        "sum-3",
        "Sum of the increments of a slower cycle",
        "the increment over a cycle is the sum of those over its parts; derived",
        notes=(_NOTE,),
    )


def held_increment() -> Kernel:
    """Return the share of a faster cycle in an increment of a slower one, at a constant rate.

    Returns: inputs ``increment`` (3,) of the slower cycle, in any unit and frame, and ``share``, 1/N for N
    faster cycles in a slower one; output ``increment_share`` (3,) in the same unit and frame.

    >>> held_increment().outputs[0].expressions[0]
    d_x*share
    """
    build = KernelBuilder()
    d, share = build.input(HELD), build.scalar(SHARE)
    meaning = "increment of the faster cycle at a constant rate"
    build.output(
        Signal.vector("increment_share", "share", unit=ANY, meaning=meaning, frame=ANY, over=CYCLE), share * d
    )
    return build.kernel(
        "hold-3",
        "Increments of a slower cycle, shared out to faster ones",
        "the increment over a cycle is N times that over its Nth part at a constant rate; derived",
        notes=(_NOTE, "The rate steps from one slower cycle to the next."),
    )


def scaled_counts(what: str) -> Kernel:
    """Return increments from the counts of three sensors of one scale.

    Returns: inputs ``count`` (3,), counts of the cycle about or along body axes, and ``scale``, the quantum of
    a count in rad or m/s; output ``increment`` (3,) in its unit, body axes.

    >>> scaled_counts("velocity").outputs[0].signal.unit
    'm/s'
    """
    unit, largest = _COUNTED[what]
    build = KernelBuilder()
    count = build.input(
        Signal.vector(
            "count",
            "n",
            meaning="counts of the cycle, body axes",
            bound=Fraction(1 << 15),
            frame="b",
            over=CYCLE,
        )
    )
    scale = build.scalar(Signal.scalar("scale", unit=unit, meaning=f"{what} of a count", bound=largest))
    meaning = f"{what} increment of the cycle, body axes"
    build.output(
        Signal.vector("increment", "d", unit=unit, meaning=meaning, frame="b", over=CYCLE), scale * count
    )
    return build.kernel(
        f"{what}-counts",
        f"{what.capitalize()} increments from counts",
        "a count is one quantum of the sensor; derived",
    )
