"""Attitude steps in transition form from a kinematics, a method and samples of the rate."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import count

import sympy as sp

from strapgen.catalogue.kinematics import KINEMATICS, Kinematics
from strapgen.catalogue.methods.method import Method
from strapgen.catalogue.methods.samples import Samples
from strapgen.ir.kernel_info import AttitudeStep, Order, Truncation
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import dot
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
