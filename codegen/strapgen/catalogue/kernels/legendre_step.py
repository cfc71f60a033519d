"""Attitude steps from the Legendre coefficients of the rate, which any filters of samples estimate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import sympy as sp

from strapgen.catalogue.kinematics import KINEMATICS
from strapgen.catalogue.methods import rate_fit, windowed
from strapgen.catalogue.methods.samples import Samples
from strapgen.catalogue.methods.window import Window
from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder

_SOURCE = "the rate as a Legendre series"


def step(name: str, degree: int, terms: int = 0) -> Kernel:
    """Derive the step of a window after its filters: from Legendre coefficients of the rate times the step, in rad.

    `terms` of the power series give the exact rotation; with 0 the rotation vector is to fourth order.
    """
    kinematics = KINEMATICS[name]
    build = KernelBuilder()
    state = build.input(kinematics.state)
    samples = Coefficients(build, [build.input(_signal(m)) for m in range(degree + 1)])
    method = windowed.method(unfiltered(degree, terms))
    transition = method.transition(build, kinematics, samples)
    build.output(kinematics.next, kinematics.product(state, build.stage(kinematics.transition, transition)))
    return build.kernel(
        f"{name}-legendre-{'exact-' if terms else ''}{degree}",
        f"{kinematics.title}: step from the Legendre coefficients of the rate to degree {degree}"
        + (", exact rotation" if terms else ""),
        f"{kinematics.source}; {method.source}",
    )


def coefficient_name(m: int) -> str:
    """Return the name of the input for a Legendre coefficient."""
    return f"legendre_{m}"


class Coefficients(Samples):
    """Legendre coefficients of the rate times the step as the samples of a step."""

    def __init__(self, build: KernelBuilder, vectors: Sequence[sp.Matrix]) -> None:
        self._build = build
        self._labels = {}
        self._symbols = sp.Matrix.vstack(*(vector.T for vector in vectors))
        self.increments, self.previous, self.ahead = len(vectors), 0, 0
        self.fit = rate_fit.from_legendre(unfiltered(len(vectors) - 1).filters)


def _signal(m: int) -> Signal:
    return Signal.vector(
        coefficient_name(m),
        f"c{m}",
        unit="rad",
        meaning=f"Legendre coefficient {m} of the body rate times the step, body axes",
        bound=Fraction(1),
        frame="b",
        over="cycle",
    )


def unfiltered(degree: int, terms: int = 0) -> Window:
    """Return the window whose samples are the Legendre coefficients themselves."""
    count = degree + 1
    filters = tuple(tuple(Fraction(row == column) for column in range(count)) for row in range(count))
    window = Window("legendre", "", _SOURCE, 1, 0, degree, count, Fraction(1), "minimax", filters)
    return replace(window, rotation="exact", terms=terms) if terms else window
