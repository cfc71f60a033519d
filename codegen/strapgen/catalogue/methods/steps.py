"""Attitude steps: kinematics + method + what is known of the rate, fused, in transition form."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy as sp

from strapgen.catalogue.kinematics import KINEMATICS, Kinematics
from strapgen.catalogue.methods import rate_fit
from strapgen.catalogue.methods.coefficients import Number
from strapgen.ir.attitude_step import Companions
from strapgen.ir.order import Order
from strapgen.ir.signals import Signal
from strapgen.symbolic.kernel import Kernel, KernelBuilder
from strapgen.symbolic.rotations import exact

#: Signal of the rotation vector of a step.
PHI = Signal.vector("phi", "phi", unit="rad", meaning="rotation vector of the step")


def sample_names(count: int, previous: int = 0, letter: str = "d") -> list[str]:
    """Return the names of the samples that a step takes, oldest first.

    Parameters
    ----------
    count, previous : int
        Samples of the step itself, and those before it.
    letter : str, optional
        What a sample of the step is called.

    Examples
    --------
    >>> sample_names(2, previous=1)
    ['past1', 'd1', 'd2']
    """
    past = "past" if letter == "d" else f"past_{letter}"
    return [f"{past}{k}" for k in range(previous, 0, -1)] + [f"{letter}{k}" for k in range(1, count + 1)]


def increments_signal(count: int, previous: int = 0) -> Signal:
    """Return the signal of the angle increments that a step takes, oldest first.

    Parameters
    ----------
    count : int
        Increments of the step itself.
    previous : int, optional
        Increments before the step.
    """
    return Signal(
        "increments",
        (previous + count, 3),
        tuple(f"{name}_{axis}" for name in sample_names(count, previous) for axis in "xyz"),
        unit="rad",
        meaning="angle increments of the step, body axes, oldest first: exact integrals of the body rate"
        + kept(previous),
        bound=Fraction(1),
    )


def kept(previous: int) -> str:
    """Return what a description of samples says of those before the step."""
    return f"; the first {previous} are those before the step" if previous else ""


def turns_signal(nodes: Sequence[Number]) -> Signal:
    """Return the signal of the body rates of one step, each times the step length, in the order of the nodes."""
    return Signal(
        "turns",
        (len(nodes), 3),
        tuple(f"turn_{name}_{axis}" for name in labels(nodes).values() for axis in "xyz"),
        unit="rad",
        meaning=f"body rate times the step length, body axes, at nodes {', '.join(map(str, nodes))} of the step",
        bound=Fraction(1),
    )


def label(node: Number) -> str:
    """Return a node as part of a name: a short fraction with its numbers, another number with four decimals."""
    text = str(node)
    if not isinstance(node, Fraction) or len(text) > 11:
        text = f"{float(node):.4f}"
    return text.replace("/", "_").replace(".", "_").replace("-", "minus_")


def labels(nodes: Sequence[Number]) -> dict[Number, str]:
    """Return nodes with a label of its own for each: where two are the same, the later one gets a number."""
    found: dict[Number, str] = {}
    for node in dict.fromkeys(nodes):
        name, number = label(node), 1
        while name in found.values():
            number += 1
            name = f"{label(node)}_{number}"
        found[node] = name
    return found


class Samples:
    """What a step is given, and the rate that it knows from that.

    Parameters
    ----------
    build : KernelBuilder
        The kernel under construction; samples are declared as its input.
    increments : int or None
        Angle increments a step; None for rates at nodes.
    previous : int
        Increments before the step.
    nodes : sequence of Fraction or Expr
        Nodes at which the rate is needed, and given where there are no increments.
    """

    def __init__(
        self,
        build: KernelBuilder,
        increments: int | None,
        previous: int = 0,
        nodes: Sequence[Number] = (),
    ) -> None:
        self._build = build
        self._labels = labels(nodes)
        if increments is None:
            signal, self.fit = turns_signal(nodes), rate_fit.from_rates(nodes)
        else:
            signal = increments_signal(increments, previous)
            self.fit = rate_fit.from_increments(increments, previous)
        self._symbols = build.input(signal)
        self.increments, self.previous = increments, previous

    def order(self, method: int) -> Order:
        """Return the order of a step by a method of this order on any kinematics."""
        if self.increments is None:
            return Order(method, method, None, method)
        limit = rate_fit.step_order(self.increments, self.previous)
        return Order(method, method, self.increments + self.previous, min(method, limit))

    def turn(self, node: Number, scale: sp.Expr = sp.S.One) -> sp.Matrix:
        """Name the rate times the step at a node, times `scale`, which is 1 or 1/2."""
        half = "half_" if scale == sp.Rational(1, 2) else ""
        meaning = f"{half.replace('_', ' the ')}rate times the step, at node {node}"
        return self.combination(
            f"{half}turn_{self._labels.get(node) or label(node)}", self.fit.at(node), meaning, scale
        )

    def combination(
        self, name: str, weights: Sequence[sp.Expr], meaning: str, scale: sp.Expr = sp.S.One
    ) -> sp.Matrix:
        """Name a vector that is linear in the samples.

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
        ``attitude_order(degree)``: order on the kinematics of the attitude for a rate that is a polynomial of at
        most this degree, None for any; by default the classical order.
    isometry : callable, optional
        ``isometry(count)``: whether its transition from so many samples, None for rates at the nodes, is a rotation
        whatever they are; by default it is not.
    option : str
        How the command line names it.
    rotation_vector : callable, optional
        ``rotation_vector(build, samples)`` writes the stages of the rotation vector of the step and returns it, where
        the transition is its exponential.
    limit : callable, optional
        ``limit(increments, previous)``: order to which these samples can be used; by default that of the polynomial
        through them.
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
    limit: Callable[[int, int], int] = rate_fit.step_order

    def step_order(self, increments: int | None, previous: int = 0) -> Order:
        """Return the order of the step from so many increments, None for rates at the nodes."""
        of = self.attitude_order or (lambda degree: self.order)
        attitude = of(None)
        if increments is None:
            return Order(self.order, attitude, None, attitude)
        count = increments + previous
        step = min(of(count - 1), self.limit(increments, previous))
        return Order(self.order, attitude, count, step)


def exponential(
    name: str,
    title: str,
    source: str,
    order: int,
    rotation_vector: Callable[[KernelBuilder, Samples], sp.Matrix],
    **rest: Any,
) -> Method:
    """Return the method whose transition is the exponential of a rotation vector.

    Parameters
    ----------
    name, title, source, order
        As in `Method`.
    rotation_vector : callable
        ``rotation_vector(build, samples)`` writes its stages and returns the rotation vector of the step.
    **rest
        As in `Method`.
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


def step(kinematics: Kinematics, method: Method, increments: int | None, previous: int = 0) -> Kernel:
    """Derive one integration step from angle increments, or from rates, to the next state.

    The method is applied to the identity, which gives the transition: the step is linear in the state. The
    step length cancels, since increments and rates differ by it alone.

    Parameters
    ----------
    kinematics : Kinematics
        The attitude representation.
    method : Method
        The integration method.
    increments : int or None
        Angle increments a step, 1 to 8; None for a step that is given the rate at every node.
    previous : int, optional
        Increments before the step from which the rate is extracted too, 0 to 3.

    Returns
    -------
    Kernel
        Inputs ``state`` and ``increments`` (previous + increments, 3) in rad, or ``turns`` (nodes, 3) in rad: the
        rates times the step length; output ``next``.
    """
    build = KernelBuilder()
    state = build.input(kinematics.state)
    samples = Samples(build, increments, previous, method.nodes)
    transition = build.stage(kinematics.transition, method.transition(build, kinematics, samples))
    build.output(kinematics.next, kinematics.product(state, transition))
    suffix, option, given = chosen(method, increments, previous)
    extracted = "" if increments is None else "rate extraction chapter 3 A; "
    order = method.step_order(increments, previous)
    return build.kernel(
        f"{kinematics.name}-{suffix}",
        f"{kinematics.title}: step by {method.title} from {given}",
        f"{kinematics.source}; {extracted}{method.title}: {method.source}",
        transition=kinematics.transition.name,
        companions=Companions(
            f"{kinematics.name}-product",
            kinematics.orthonormalize,
            kinematics.attitude,
            tuple(Fraction(int(x)) for x in kinematics.identity),
            previous,
            method.isometry(None if increments is None else increments + previous),
        ),
        order=order,
        arguments=f"{kinematics.name} {option}",
        notes=(str(order).capitalize() + ".",) if order.limited else (),
    )


def rotation_vector(method: Method, increments: int | None, previous: int = 0) -> Kernel:
    """Derive the rotation vector of one step from angle increments, or from rates.

    Parameters
    ----------
    method : Method
        A method whose transition is the exponential of a rotation vector.
    increments, previous : int
        As in `step`.

    Returns
    -------
    Kernel
        Input ``increments`` (previous + increments, 3) in rad, or ``turns``; output ``rotation_vector`` (3,) in rad.

    Raises
    ------
    ValueError
        If the method has no rotation vector.
    """
    if method.rotation_vector is None:
        raise ValueError(f"{method.name} has no rotation vector")
    build = KernelBuilder()
    vector = method.rotation_vector(build, Samples(build, increments, previous, method.nodes))
    build.output(
        Signal.vector(
            "rotation_vector",
            "rotation_vector",
            unit="rad",
            meaning="rotation vector of the step, body axes",
        ),
        vector,
    )
    suffix, option, given = chosen(method, increments, previous)
    order = method.step_order(increments, previous)
    return build.kernel(
        f"rotation-vector-{suffix}",
        f"Rotation vector of a step by {method.title} from {given}",
        method.source,
        order=order,
        arguments=f"rotation-vector {option}",
        notes=(str(order).capitalize() + ".",) if order.limited else (),
    )


def chosen(method: Method, increments: int | None, previous: int) -> tuple[str, str, str]:
    """Return the ending of a kernel's name, its options on the command line, and what it is given, in words."""
    suffix = f"{method.name}-{increments or 'rates'}"
    option = method.option or f"--method {method.name}"
    if increments is None:
        given = f"the rate at {len(method.nodes)} {'node' if len(method.nodes) == 1 else 'nodes'}"
        option = f"{option} --rates"
    else:
        given = f"{increments} angle {'increment' if increments == 1 else 'increments'}"
        option = f"{option} --increments {increments}"
    if previous:
        suffix, option = f"{suffix}-previous{previous}", f"{option} --previous {previous}"
        given += f" and {previous} before {'it' if increments == 1 else 'them'}"
    return suffix, option, given


def product(name: str) -> Kernel:
    """Return the kernel that advances a state by a transition, and a transition by the one that follows it.

    Parameters
    ----------
    name : str
        Name of the attitude algorithm.
    """
    kinematics = KINEMATICS[name]
    build = KernelBuilder()
    state, transition = build.input(kinematics.state), build.input(kinematics.transition)
    build.output(kinematics.next, kinematics.product(state, transition))
    return build.kernel(f"{name}-product", f"{kinematics.title}: state after a transition", kinematics.source)


def combination(coefficients: Sequence[Number], terms: Sequence[sp.Matrix], like: sp.Matrix) -> sp.Matrix:
    """Return the sum of terms, each times its coefficient; zero of the shape of `like` if there are none."""
    total = sp.zeros(*like.shape)
    for coefficient, term in zip(coefficients, terms, strict=True):
        total += exact(coefficient) * term
    return total
