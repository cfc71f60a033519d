"""An integration method turns the samples of a step, angle increments or rates at nodes, into its transition."""

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
from strapgen.catalogue.methods.window import Window
from strapgen.ir.kernel_info import Order, Truncation
from strapgen.ir.notebook_display import short_repr
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


def sample_names(count: int, previous: int = 0, ahead: int = 0, letter: str = "d") -> list[str]:
    """Return the names of the samples that a step takes, oldest first.

    >>> sample_names(2, previous=1, ahead=1)
    ['past1', 'd1', 'd2', 'ahead1']
    """
    past, after = ("past", "ahead") if letter == "d" else (f"past_{letter}", f"ahead_{letter}")
    return [
        *(f"{past}{k}" for k in range(previous, 0, -1)),
        *(f"{letter}{k}" for k in range(1, count + 1)),
        *(f"{after}{k}" for k in range(1, ahead + 1)),
    ]


def increments_signal(count: int, previous: int = 0, ahead: int = 0) -> Signal:
    """Return the signal of the angle increments that a step takes, oldest first.

    Parameters
    ----------
    count : int
        Increments of the step.
    previous, ahead : int, optional
        Increments from before the step, and increments from after it.

    Examples
    --------
    >>> increments_signal(2, previous=1).elements[:4]
    ('past1_x', 'past1_y', 'past1_z', 'd1_x')
    """
    return Signal(
        "increments",
        (previous + count + ahead, 3),
        tuple(f"{name}_{axis}" for name in sample_names(count, previous, ahead) for axis in "xyz"),
        unit="rad",
        meaning="angle increments of the step, body axes, oldest first: exact integrals of the body rate"
        + beside(previous, ahead),
        bound=Fraction(1),
        frame="b",
        over="cycle",
    )


def velocities_signal(count: int, previous: int = 0, ahead: int = 0) -> Signal:
    """Return the signal of the velocity increments that a step takes, oldest first, as `increments_signal`.

    Examples
    --------
    >>> velocities_signal(1).elements, velocities_signal(1).unit
    (('v1_x', 'v1_y', 'v1_z'), 'm/s')
    """
    return Signal(
        "velocity_increments",
        (previous + count + ahead, 3),
        tuple(f"{name}_{axis}" for name in sample_names(count, previous, ahead, "v") for axis in "xyz"),
        unit="m/s",
        meaning="velocity increments of the step, body axes, oldest first: exact integrals of the specific force"
        + beside(previous, ahead),
        frame="b",
        over="cycle",
    )


def beside(previous: int, ahead: int = 0) -> str:
    """Return the part of a signal's meaning on samples from before the step and from after it."""
    before = f"; the first {previous} are those before the step" if previous else ""
    return before + (f"; the last {ahead} are those after the step" if ahead else "")


def node_rotations_signal(nodes: Sequence[Number]) -> Signal:
    """Return the signal of the body rates of one step, each times the step length, in the order of the nodes.

    Examples
    --------
    >>> node_rotations_signal([Fraction(0), Fraction(1)]).shape
    (2, 3)
    """
    return Signal(
        "node_rotations",
        (len(nodes), 3),
        tuple(f"turn_{name}_{axis}" for name in labels(nodes).values() for axis in "xyz"),
        unit="rad",
        meaning=f"body rate times the step length, body axes, at nodes {', '.join(map(str, nodes))} of the step",
        bound=Fraction(1),
        frame="b",
    )


def label(node: Number) -> str:
    """Return a node as part of a name: a short fraction as it is, any other number with four decimals."""
    text = str(node)
    if not isinstance(node, (int, Fraction)) or len(text) > 11:
        text = f"{float(node):.4f}"
    return text.replace("/", "_").replace(".", "_").replace("-", "minus_")


def labels(nodes: Sequence[Number]) -> dict[Number, str]:
    """Return a label for each node; of two equal labels the later one gets a number."""
    names: dict[Number, str] = {}
    for node in dict.fromkeys(nodes):
        name, number = label(node), 1
        while name in names.values():
            number += 1
            name = f"{label(node)}_{number}"
        names[node] = name
    return names


class Samples:
    """The samples of a step under construction, and the rate that follows from them.

    Parameters
    ----------
    build : KernelBuilder
        The kernel under construction; samples are declared as its input.
    increments : int or None
        Number of angle increments a step; None for rates at nodes.
    previous : int
        Number of increments from before the step.
    nodes : sequence of Fraction or Expr
        Nodes at which the method needs the rate; without increments the samples are the rates there.
    ahead : int
        Number of increments from after the step.
    fit : callable, optional
        ``fit(increments, previous, ahead)`` returns the rate in terms of the increments; by default the polynomial
        through them.

    Examples
    --------
    >>> from strapgen import KernelBuilder
    >>> Samples(KernelBuilder(), 2).increments
    2
    """

    __repr__ = short_repr

    def _in_words(self) -> str:
        if self.increments is None:
            return "the rate at the nodes of the method"
        return f"{self.increments} increments of the step, {self.previous} before it, {self.ahead} after it"

    def __init__(
        self,
        build: KernelBuilder,
        increments: int | None,
        previous: int = 0,
        nodes: Sequence[Number] = (),
        ahead: int = 0,
        fit: Callable[[int, int, int], Fit] = rate_fit.from_increments,
    ) -> None:
        self._build = build
        self._labels = labels(nodes)
        if increments is None:
            signal, fitted = node_rotations_signal(nodes), rate_fit.from_rates(nodes)
        else:
            signal, fitted = increments_signal(increments, previous, ahead), fit(increments, previous, ahead)
        self.fit: Fit = fitted
        self._symbols = build.input(signal)
        self.increments: int | None = increments
        self.previous: int = previous
        self.ahead: int = ahead

    def order(self, method: int) -> Order:
        """Return the order of a step by a method of this order on any kinematics."""
        if self.increments is None:
            return Order(method, method, None, method)
        limit = rate_fit.step_order(self.increments, self.previous, self.ahead)
        return Order(method, method, self.fit.degree + 1, min(method, limit))

    def turn(self, node: Number, scale: sp.Expr = sp.S.One) -> sp.Matrix:
        """Add a stage for the rate times the step at a node, times `scale`, 1 or 1/2, and return its symbols."""
        half = "half_" if scale == sp.Rational(1, 2) else ""
        meaning = f"{half.replace('_', ' the ')}rate times the step, at node {node}"
        return self.combination(
            f"{half}turn_{self._labels.get(node) or label(node)}", self.fit.at(node), meaning, scale
        )

    def combination(
        self, name: str, weights: Sequence[sp.Expr], meaning: str, scale: sp.Expr = sp.S.One
    ) -> sp.Matrix:
        """Add a stage for a vector that is linear in the samples, and return its symbols.

        Parameters
        ----------
        name, meaning : str
        weights : sequence of Expr
            A weight for every sample.
        scale : Expr, optional
            Factor of all weights.

        Returns
        -------
        Matrix, 3 x 1
        """
        vector = [
            scale * sp.Add(*(weight * self._symbols[k, axis] for k, weight in enumerate(weights)))
            for axis in range(3)
        ]
        if all(element.is_Symbol for element in vector):  # an input itself
            return sp.Matrix(vector)
        return self._build.stage(Signal.vector(name, name, unit="rad", meaning=meaning), vector)
