"""Modified Rodrigues parameters by any tableau: an algorithm with a state of its own, not linear in it."""

from fractions import Fraction

import sympy as sp

from strapgen.catalogue.methods.method import Samples
from strapgen.catalogue.methods.runge_kutta import advance
from strapgen.catalogue.methods.tableaux import TABLEAUX
from strapgen.ir.kernel_info import AttitudeStep
from strapgen.ir.signals import Signal
from strapgen.kernel import algebra
from strapgen.kernel.kernel import KernelBuilder

SOURCE = "M. D. Shuster, J. Astronaut. Sci. 41 (1993) 439-517"
STATE = Signal.vector(
    "state", "s", meaning="modified Rodrigues parameters, body to reference", bound=Fraction(1)
)


def slope(s, w):
    """Return ds/dt for the body rate w."""
    return (1 - algebra.dot(s, s)) * w / 4 + algebra.cross(s, w) / 2 + algebra.dot(s, w) * s / 2


def attitude():
    """Return the kernel of the direction cosine matrix."""
    build = KernelBuilder()
    s = build.input(STATE)
    S, square = algebra.skew(s), algebra.dot(s, s)
    matrix = sp.eye(3) + (8 * S * S + 4 * (1 - square) * S) / (1 + square) ** 2
    build.output(Signal.matrix("attitude", "C", meaning="direction cosine matrix, body to reference"), matrix)
    return build.kernel("dcm-from-mrp", "Direction cosine matrix from modified Rodrigues parameters", SOURCE)


def algorithm(method=TABLEAUX["rk4"], increments=2, previous=0):
    """Return the step."""
    build = KernelBuilder()
    s = build.input(STATE)
    samples = Samples(build, increments, previous, method.nodes)
    turns = {node: samples.turn(node) for node in dict.fromkeys(method.nodes)}
    end = advance(build, method, turns, s, slope, like=STATE, origin="the state")
    build.output(Signal.vector("next", "next", meaning="the state after the step"), end)
    return build.kernel(
        f"mrp-{method.name}-{increments}" + (f"-previous{previous}" if previous else ""),
        f"Modified Rodrigues parameters: step by {method.title}",
        SOURCE,
        attitude_step=AttitudeStep(None, None, "dcm-from-mrp", (Fraction(0),) * 3, previous),
        bundled_kernels=(attitude(),),
    )
