"""Explicit Runge-Kutta methods: the stages of a tableau for any differential equation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache

import sympy as sp

from strapgen.catalogue.coefficients import Number
from strapgen.catalogue.kinematics import Kinematics
from strapgen.catalogue.methods import tableaux
from strapgen.catalogue.methods.method import Method, combination
from strapgen.catalogue.methods.order_conditions import attitude_order
from strapgen.catalogue.methods.samples import Samples
from strapgen.catalogue.methods.tableau import Tableau
from strapgen.ir.exceptions import InputError
from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder


def verified(tableau: Tableau) -> Method:
    """Return the method of a tableau, a built-in one too, if it meets the conditions of its order."""
    _require_conditions(tableau)
    return method(tableau)


@cache
def _require_conditions(tableau: Tableau) -> None:
    """Refuse a tableau that misses a condition of its order."""
    try:
        tableaux.verify(tableau)
    except InputError as error:
        raise InputError(f"tableau {tableau.name}: {error}") from None


def method(tableau: Tableau) -> Method:
    """Return the method of a tableau."""

    def transition(build: KernelBuilder, kinematics: Kinematics, samples: Samples) -> sp.Matrix:
        turns = {node: samples.turn(node, kinematics.scale) for node in nodes(tableau)}
        return advance(
            build,
            tableau,
            turns,
            kinematics.identity,
            kinematics.derivative,
            like=kinematics.transition,
            origin="the identity",
        )

    return Method(
        tableau.name,
        tableau.title,
        tableau.source,
        tableau.order,
        transition,
        nodes=nodes(tableau),
        attitude_order=lambda degree: attitude_order(tableau, degree),
        option=tableau.option,
    )


def staged_step(kinematics: Kinematics, tableau: Tableau, increments: int | None) -> Kernel:
    """Return one integration step in the textbook form, with slopes of the state instead of a transition.

    The step from `method` is the same polynomial of its inputs; this form is for comparison. It takes so many angle
    increments in rad, or the rate at every node if they are None.
    """
    build = KernelBuilder()
    state = build.input(kinematics.state)
    samples = Samples(build, increments, nodes=nodes(tableau))
    turns = {node: samples.turn(node, kinematics.scale) for node in nodes(tableau)}
    end = advance(
        build,
        tableau,
        turns,
        state,
        kinematics.derivative,
        like=kinematics.transition,
        origin="the state",
    )
    build.output(kinematics.next, end)
    return build.kernel(
        f"{kinematics.name}-{tableau.name}-{increments or 'rates'}-staged",
        f"{kinematics.title}: staged step by {tableau.title}",
        f"{kinematics.source}; {tableau.title}: {tableau.source}",
    )


def advance(
    build: KernelBuilder,
    tableau: Tableau,
    turns: Mapping[Number, sp.Matrix],
    start: sp.Matrix,
    derivative: Callable[[sp.Matrix, sp.Matrix], sp.Matrix],
    *,
    like: Signal,
    origin: str,
) -> sp.Matrix:
    """Write the stages of a tableau into a kernel under construction and return the state after the step.

    Parameters
    ----------
    build : KernelBuilder
    tableau : Tableau
    turns : mapping of node to Matrix
        The input of the derivative at each node, such as the body rate, times the step length.
    start : Matrix
        A state, of numbers or symbols.
    derivative : callable
        ``derivative(x, turn)`` returns dx/dt times the step length.
    like : Signal
        The state, whose shape and element labels the stages have too.
    origin : str
        Words for the start in the meanings of the stages.

    Returns
    -------
    Matrix
    """

    def named(name: str, meaning: str) -> Signal:
        elements = tuple(f"{name}_{element.rsplit('_', 1)[1]}" for element in like.elements)
        return Signal(name, like.shape, elements, meaning=meaning)

    slopes: list[sp.Matrix] = []
    used = _used(tableau)
    for number, (node, row) in enumerate(zip(tableau.nodes, tableau.matrix, strict=True), 1):
        if number - 1 not in used:
            slopes.append(sp.zeros(*start.shape))
            continue
        point = start + combination(row, slopes, start)
        if any(row):
            point = build.stage(named(f"point_{number}", f"argument of slope {number}, from {origin}"), point)
        slope = derivative(point, turns[node])
        slopes.append(
            build.stage(named(f"slope_{number}", f"derivative times the step at stage {number}"), slope)
        )
    return start + combination(tableau.weights, slopes, start)


def nodes(tableau: Tableau) -> tuple[Number, ...]:
    """Return the distinct nodes at which the result needs the rate, as fractions of the step."""
    used = _used(tableau)
    return tuple(dict.fromkeys(node for place, node in enumerate(tableau.nodes) if place in used))


def _used(tableau: Tableau) -> set[int]:
    """Return the indices of the stages that the result needs; others only serve the embedded weights."""
    used: set[int] = set()
    for place in reversed(range(len(tableau.nodes))):
        behind = (tableau.matrix[later][place] for later in used)
        if tableau.weights[place] or any(behind):
            used.add(place)
    return used
