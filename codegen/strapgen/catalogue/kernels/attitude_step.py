"""Attitude steps in transition form from a kinematics, a method and samples of the rate, and vectors of a step.

A step from the Legendre coefficients of the rate takes what any filters of samples estimate. The sculling term of a
step follows from its coning term, to which it is dual.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import count

import sympy as sp

from strapgen.catalogue.kinematics import KINEMATICS, Kinematics
from strapgen.catalogue.methods import rate_fit, windowed
from strapgen.catalogue.methods.method import (
    Method,
    Samples,
    increments_signal,
    sample_names,
    velocities_signal,
)
from strapgen.catalogue.methods.window import Window
from strapgen.ir.kernel_info import AttitudeStep, Order, Truncation
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import cross, dot, exact
from strapgen.kernel.kernel import Kernel, KernelBuilder


def step(
    kinematics: Kinematics, method: Method, increments: int | None, previous: int = 0, ahead: int = 0
) -> Kernel:
    """Derive a step from angle increments, or from rates times the step at nodes if `increments` is None, all in rad.

    The method is applied to the identity, which gives the transition: the step is linear in the state. The
    step length cancels, since increments and rates differ by it alone.
    """
    build = KernelBuilder()
    state = build.input(kinematics.state)
    samples = Samples(build, increments, previous, method.nodes, ahead, method.fit)
    transition = build.stage(kinematics.transition, method.transition(build, kinematics, samples))
    build.output(kinematics.next, kinematics.product(state, transition))
    suffix, option, source = chosen(method, increments, previous, ahead)
    fitted = increments is not None and method.conditions is None
    extracted = "rate extraction chapter 3 A; " if fitted else ""
    order = method.step_order(increments, previous, ahead)
    truncation = None if method.truncation is None else method.truncation(kinematics)
    return build.kernel(
        f"{kinematics.name}-{suffix}",
        f"{kinematics.title}: step by {method.title} from {source}",
        f"{kinematics.source}; {extracted}{method.title}: {method.source}",
        transition=kinematics.transition.name,
        attitude_step=AttitudeStep(
            f"{kinematics.name}-product",
            kinematics.orthonormalize,
            kinematics.attitude,
            tuple(Fraction(int(x)) for x in kinematics.identity),
            previous,
            method.isometry(None if increments is None else increments + previous + ahead),
            ahead,
            truncation,
        ),
        order=order,
        arguments=f"{kinematics.name} {option}",
        notes=_notes(order, truncation),
    )


def _notes(order: Order, truncation: Truncation | None) -> tuple[str, ...]:
    """Return notes on a limited order and on a series that is cut off."""
    notes: tuple[str, ...] = (f"{str(order).capitalize()}.",) if order.limited else ()
    if truncation is not None:
        text = f"The exponential of the rotation vector is a series to its power {truncation.order}"
        notes += (f"{text}; error bounds have what it leaves out.",)
    return notes


def rotation_vector(method: Method, increments: int | None, previous: int = 0, ahead: int = 0) -> Kernel:
    """Derive the rotation vector of a step, in rad, body axes, from increments or from rates times the step."""
    if method.rotation_vector is None:
        raise ValueError(f"{method.name} has no rotation vector")
    build = KernelBuilder()
    samples = Samples(build, increments, previous, method.nodes, ahead, method.fit)
    vector = method.rotation_vector(build, samples)
    build.output(
        Signal.vector(
            "rotation_vector",
            "rotation_vector",
            unit="rad",
            meaning="rotation vector of the step, body axes",
            frame="b",
            over="cycle",
        ),
        vector,
    )
    suffix, option, source = chosen(method, increments, previous, ahead)
    order = method.step_order(increments, previous, ahead)
    return build.kernel(
        f"rotation-vector-{suffix}",
        f"Rotation vector of a step by {method.title} from {source}",
        method.source,
        order=order,
        arguments=f"rotation-vector {option}",
        notes=(str(order).capitalize() + ".",) if order.limited else (),
    )


def chosen(method: Method, increments: int | None, previous: int = 0, ahead: int = 0) -> tuple[str, str, str]:
    """Return the ending of a kernel's name, its options on the command line, and its inputs in words."""
    suffix = f"{method.name}-{increments or 'rates'}"
    option = stated = method.option or f"--method {method.name}"
    if increments is None:
        source = f"the rate at {len(method.nodes)} {'node' if len(method.nodes) == 1 else 'nodes'}"
        option = f"{option} --rates"
    else:
        source = f"{increments} angle {'increment' if increments == 1 else 'increments'}"
        option = f"{option} --increments {increments}"
    if previous:
        suffix, option = f"{suffix}-previous{previous}", f"{option} --previous {previous}"
        source += f"{',' if ahead else ' and'} {previous} before {'it' if increments == 1 else 'them'}"
    if ahead:
        suffix, option = f"{suffix}-ahead{ahead}", f"{option} --ahead {ahead}"
        source += f" and {ahead} after {'it' if increments == 1 else 'them'}"
    if method.conditions is not None:
        suffix, option = method.name, stated
    return suffix, option, source


def smooth(build: KernelBuilder, kinematics: Kinematics, order: int) -> Kinematics:
    """Return a kinematics whose exponential is a series to the power `order`, which has a derivative everywhere."""
    numbers = count(1)

    def exponential(v: sp.Matrix, *_: object) -> sp.Matrix:
        name = f"square_{next(numbers)}"
        named = build.stage(
            Signal.vector(f"{name}_of", f"{name}_of", unit="rad", meaning="a rotation vector"), v
        )
        return kinematics.exponential(
            named, order, build.value(name, dot(named, named), "square of its length")
        )

    return replace(kinematics, exponential=exponential)


def product(name: str) -> Kernel:
    """Derive the state after a transition; likewise a transition after another."""
    kinematics = KINEMATICS[name]
    build = KernelBuilder()
    state, transition = build.input(kinematics.state), build.input(kinematics.transition)
    build.output(kinematics.next, kinematics.product(state, transition))
    return build.kernel(f"{name}-product", f"{kinematics.title}: state after a transition", kinematics.source)


_SOURCE = "the rate as a Legendre series"


def legendre_step(name: str, degree: int, terms: int = 0) -> Kernel:
    """Derive the step of a window after its filters: from Legendre coefficients of the rate times the step, in rad.

    `terms` of the power series give the exact rotation; with 0 the rotation vector is to fourth order.
    """
    kinematics = KINEMATICS[name]
    build = KernelBuilder()
    state = build.input(kinematics.state)
    samples = Coefficients(build, [build.input(_coefficient_signal(m)) for m in range(degree + 1)])
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


def _coefficient_signal(m: int) -> Signal:
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


def sculling(method: Method, increments: int, previous: int = 0) -> Kernel:
    """Derive the sculling term of a step in m/s, body axes, by duality with the coning coefficients of a method.

    The term is half the integral of (integral of w) x a + (integral of a) x w.
    """
    if method.coning is None:
        raise ValueError(f"{method.name} has no coning coefficients")
    pairs = method.coning(increments, previous)
    build = KernelBuilder()
    angles = increments_signal(increments, previous)
    names = [sample_names(increments, previous, letter=letter) for letter in "dv"]
    velocities = velocities_signal(increments, previous)
    d, v = build.input(angles), build.input(velocities)
    rows = [d[k, :].T for k in range(d.rows)], [v[k, :].T for k in range(v.rows)]
    total = sp.zeros(3, 1)
    for newer in range(1, d.rows):
        for levered, crossed, what in ((0, 1, "angle"), (1, 0, "velocity")):
            weights = {older: c for (older, other), c in pairs.items() if other == newer and c}
            if not weights:
                continue
            name = f"{what}_lever_{names[crossed][newer]}"
            signal = Signal.vector(
                name,
                name,
                unit=(angles, velocities)[levered].unit,
                meaning=f"sum of older {what} increments that is crossed with {names[crossed][newer]}",
            )
            terms = (exact(c) * rows[levered][older] for older, c in weights.items())
            lever = build.stage(signal, sum(terms, sp.zeros(3, 1)))
            total += cross(lever, rows[crossed][newer])
    build.output(
        Signal.vector(
            "sculling",
            "sculling",
            unit="m/s",
            meaning="sculling term of the velocity change, body axes",
            frame="b",
            over="cycle",
        ),
        total,
    )
    suffix, option, samples_text = chosen(method, increments, previous)
    samples_text = samples_text.replace("angle ", "angle and velocity ")
    return build.kernel(
        f"sculling-{suffix}",
        f"Sculling term of a step by {method.title.partition(',')[0]} from {samples_text}",
        f"{method.source.partition('; ')[0]}; by duality: K. M. Roscoe, J. Guid. Control Dyn. 24 (2001) 201-205",
        arguments=f"sculling {option}",
    )
