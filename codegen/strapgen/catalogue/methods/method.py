"""An integration method turns the samples of a step into its transition."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy as sp

from strapgen.catalogue.coefficients import Number
from strapgen.catalogue.kinematics import Kinematics
from strapgen.catalogue.methods import rate_fit
from strapgen.catalogue.methods.rate_fit import Fit
from strapgen.catalogue.methods.samples import Samples
from strapgen.catalogue.methods.window import Window
from strapgen.ir.kernel_info import Order, Truncation
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import exact
from strapgen.kernel.kernel import KernelBuilder

#: Signal of the rotation vector of a step.
PHI = Signal.vector("phi", "phi", unit="rad", meaning="rotation vector of the step")


@dataclass(frozen=True)
class Method:
    """A method of integrating the attitude over one step.

    Parameters
    ----------
    name, title, source : str
        Name on the command line, name in the literature, citation.
    order : int
        Classical order.
    transition : callable
        ``transition(build, kinematics, samples)`` writes the stages of the method into a kernel under construction and
        returns the transition.
    nodes : tuple of Fraction or Expr
        Distinct nodes at which the method needs the rate; empty if it needs increments.
    attitude_order : callable, optional
        ``attitude_order(degree)`` returns the order on attitude kinematics for a polynomial rate of at most this
        degree, or for any rate if it is None; by default the classical order.
    isometry : callable, optional
        ``isometry(count)`` returns whether its transition from so many samples is a rotation for any samples; None
        stands for rates at the nodes. By default it is not.
    option : str
        The option that chooses it on the command line.
    rotation_vector : callable, optional
        ``rotation_vector(build, samples)`` writes the stages of the rotation vector of the step and returns it, where
        the transition is its exponential.
    limit : callable, optional
        ``limit(increments, previous, ahead)`` returns the highest order that these samples allow; by default that of
        the polynomial through them.
    fit : callable, optional
        ``fit(increments, previous, ahead)`` returns the rate over the step in terms of these samples; by default the
        polynomial through them.
    conditions : int, optional
        Of a method with filters of its own, which says itself how many samples a step takes: the number of powers of
        time for which the rate is exact. By default it is the number of the samples.
    coning : callable, optional
        Of a method by coning coefficients: ``coning(increments, previous)`` returns the coefficient of
        each cross product, see `coning_coefficients.Design`.
    truncation : callable, optional
        ``truncation(kinematics)`` returns what its series for an exponential leaves out.
    window : Window, optional
        Of a method with filters of its own, the window.
    """

    name: str
    title: str
    source: str
    order: int
    transition: Callable[[KernelBuilder, Kinematics, Samples], sp.Matrix]
    nodes: tuple[Number, ...] = ()
    attitude_order: Callable[[int | None], int] | None = None
    isometry: Callable[[int | None], bool] = lambda count: False
    option: str = ""
    rotation_vector: Callable[[KernelBuilder, Samples], sp.Matrix] | None = None
    limit: Callable[[int, int, int], int] = rate_fit.step_order
    fit: Callable[[int, int, int], Fit] = rate_fit.from_increments
    conditions: int | None = None
    coning: Callable[[int, int], dict[tuple[int, int], Fraction]] | None = None
    truncation: Callable[[Kinematics], Truncation] | None = None
    window: Window | None = None

    def step_order(self, increments: int | None, previous: int = 0, ahead: int = 0) -> Order:
        """Return the orders of a step on so many increments; None stands for rates at the nodes."""
        of = self.attitude_order or (lambda degree: self.order)
        attitude = of(None)
        if increments is None:
            return Order(self.order, attitude, None, attitude)
        count = increments + previous + ahead if self.conditions is None else self.conditions
        step = min(of(count - 1), self.limit(increments, previous, ahead))
        return Order(self.order, attitude, count, step)


def exponential(
    name: str,
    title: str,
    source: str,
    order: int,
    rotation_vector: Callable[[KernelBuilder, Samples], sp.Matrix],
    **rest: Any,
) -> Method:
    """Return the method whose transition is the exponential of a rotation vector; the rest is as in `Method`.

    ``rotation_vector(build, samples)`` writes its stages and returns the rotation vector of the step.
    """

    def transition(build: KernelBuilder, kinematics: Kinematics, samples: Samples) -> sp.Matrix:
        return kinematics.exponential(rotation_vector(build, samples))

    return Method(
        name,
        title,
        source,
        order,
        transition,
        isometry=lambda count: True,
        rotation_vector=rotation_vector,
        **rest,
    )


def combination(coefficients: Sequence[Number], terms: Sequence[sp.Matrix], like: sp.Matrix) -> sp.Matrix:
    """Return the sum of terms, each times its coefficient; zero of the shape of `like` if there are none."""
    total = sp.zeros(*like.shape)
    for coefficient, term in zip(coefficients, terms, strict=True):
        total += exact(coefficient) * term
    return total
