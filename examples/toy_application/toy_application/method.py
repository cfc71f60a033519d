"""A method: the step turns by the rate in its middle."""

from fractions import Fraction

from strapgen.catalogue.methods.method import PHI, Method, exponential


def method(order: int) -> Method:
    """Return the method, whose rotation vector is the rate in the middle of the step times the step."""
    middle = Fraction(1, 2)
    return exponential(
        *("middle-rate", "rotation by the rate in the middle of the step", "midpoint rule", order),
        lambda build, samples: build.stage(PHI, samples.turn(middle)),
        nodes=(middle,),
    )
