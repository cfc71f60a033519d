"""Runge-Kutta attitude steps: kinematics + tableau + rate extraction, fused, in transition form."""

from __future__ import annotations

from fractions import Fraction

import sympy as sp

from strapgen.catalogue.coefficients import Number
from strapgen.catalogue.kinematics import KINEMATICS, Kinematics
from strapgen.catalogue.rates import extraction
from strapgen.catalogue.tableaux import Tableau
from strapgen.companions import Companions
from strapgen.kernel import Kernel, KernelBuilder
from strapgen.signal import Signal


def increments_signal(count: int) -> Signal:
    """Return the signal of the angle increments of one step, oldest first."""
    return Signal(
        "increments",
        (count, 3),
        tuple(f"d{k}_{axis}" for k in range(1, count + 1) for axis in "xyz"),
        unit="rad",
        meaning="angle increments of the step, body axes, oldest first: exact integrals of the body rate",
        bound=Fraction(1),
    )


def turns_signal(nodes: tuple[Number, ...]) -> Signal:
    """Return the signal of the body rates of one step, each times the step length, in the order of the nodes."""
    return Signal(
        "turns",
        (len(nodes), 3),
        tuple(f"turn_{label}_{axis}" for label in _labels(nodes).values() for axis in "xyz"),
        unit="rad",
        meaning=f"body rate times the step length, body axes, at nodes {', '.join(map(str, nodes))} of the step",
        bound=Fraction(1),
    )


def step(kinematics: Kinematics, tableau: Tableau, increments: int | None) -> Kernel:
    """Derive one integration step from angle increments, or from rates, to the next state.

    The method is applied to the identity, which gives the transition: the step is linear in the state. The
    step length cancels, since increments and rates differ by it alone.

    Parameters
    ----------
    kinematics : Kinematics
        The attitude representation.
    tableau : Tableau
        The integration method.
    increments : int or None
        Angle increments a step, 1 to 8; None for a step that is given the rate at every node.

    Returns
    -------
    Kernel
        Inputs ``state`` and ``increments`` (increments, 3) in rad, or ``turns`` (nodes, 3) in rad: the rates
        times the step length; output ``next``.
    """
    build = KernelBuilder()
    state = build.input(kinematics.state)
    turns = _turns(build, kinematics, tableau, increments)
    end = advance(build, kinematics, tableau, turns, kinematics.identity, "the identity")
    transition = build.stage(kinematics.transition, end)
    build.output(kinematics.next, kinematics.product(state, transition))
    if increments is None:
        given = f"the rate at {len(turns)} {'node' if len(turns) == 1 else 'nodes'}"
        option, extracted = "--rates", ""
    else:
        given = f"{increments} angle {'increment' if increments == 1 else 'increments'}"
        option, extracted = f"--increments {increments}", "rate extraction chapter 3 A; "
    return build.kernel(
        f"{kinematics.name}-{tableau.name}-{increments or 'rates'}",
        f"{kinematics.title}: step by {tableau.title} from {given}",
        f"{kinematics.source}; {extracted}{tableau.title}: {tableau.source}",
        transition=kinematics.transition.name,
        companions=Companions(
            f"{kinematics.name}-product",
            kinematics.orthonormalize,
            kinematics.attitude,
            tuple(Fraction(int(x)) for x in kinematics.identity),
        ),
        arguments=f"{kinematics.name} --method {tableau.name} {option}",
    )


def staged_step(kinematics: Kinematics, tableau: Tableau, increments: int | None) -> Kernel:
    """Write one integration step as textbooks do: slopes of the state itself, no transition.

    `step` is the same polynomial of its inputs. This form is for comparison.

    Parameters
    ----------
    kinematics, tableau, increments
        As for `step`.
    """
    build = KernelBuilder()
    state = build.input(kinematics.state)
    turns = _turns(build, kinematics, tableau, increments)
    build.output(kinematics.next, advance(build, kinematics, tableau, turns, state, "the state"))
    return build.kernel(
        f"{kinematics.name}-{tableau.name}-{increments or 'rates'}-staged",
        f"{kinematics.title}: staged step by {tableau.title}",
        f"{kinematics.source}; {tableau.title}: {tableau.source}",
    )


def advance(
    build: KernelBuilder,
    kinematics: Kinematics,
    tableau: Tableau,
    turns: dict[Number, sp.Matrix],
    start: sp.Matrix,
    origin: str,
) -> sp.Matrix:
    """Write the stages of a method from a start, called `origin` in their meanings, and return where they lead.

    Parameters
    ----------
    turns : dict of Fraction or Expr to Matrix
        The generator at each node, times the step length.
    start : Matrix
        A state, of numbers or symbols.
    """
    slopes: list[sp.Matrix] = []
    for number, (node, row) in enumerate(zip(tableau.nodes, tableau.matrix, strict=True), 1):
        point = start + _combination(row, slopes, start)
        if any(row):
            signal = _like(kinematics, f"point_{number}", f"argument of slope {number}, from {origin}")
            point = build.stage(signal, point)
        slope = kinematics.derivative(point, turns[node])
        signal = _like(kinematics, f"slope_{number}", f"derivative times the step at stage {number}")
        slopes.append(build.stage(signal, slope))
    return start + _combination(tableau.weights, slopes, start)


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


def _turns(
    build: KernelBuilder, kinematics: Kinematics, tableau: Tableau, increments: int | None
) -> dict[Number, sp.Matrix]:
    """Declare the samples and name the generator, times the step length, at every node."""
    nodes = tuple(dict.fromkeys(tableau.nodes))
    samples = build.input(turns_signal(nodes) if increments is None else increments_signal(increments))
    turns: dict[Number, sp.Matrix] = {}
    labels = _labels(nodes)
    for place, node in enumerate(nodes):
        if increments is None:
            weights = [sp.Integer(k == place) for k in range(len(nodes))]
        else:
            weights = extraction(increments, node)
        turns[node] = _turn(build, kinematics, samples, weights, node, labels[node])
    return turns


def _turn(
    build: KernelBuilder,
    kinematics: Kinematics,
    samples: sp.Matrix,
    weights: list[sp.Expr],
    node: Number,
    label: str,
) -> sp.Matrix:
    """Name the generator at a node: the rate times the step, scaled for the kinematics."""
    half = "half_" if kinematics.scale == sp.Rational(1, 2) else ""
    turn = [
        kinematics.scale * sp.Add(*(weight * samples[k, axis] for k, weight in enumerate(weights)))
        for axis in range(3)
    ]
    if all(element.is_Symbol for element in turn):  # an input itself
        return sp.Matrix(turn)
    meaning = f"{half.replace('_', ' the ')}rate times the step, at node {node}"
    name = f"{half}turn_{label}"
    return build.stage(Signal.vector(name, name, unit="rad", meaning=meaning), turn)


def _labels(nodes: tuple[Number, ...]) -> dict[Number, str]:
    """Return nodes as parts of names: short fractions as they are, others by their place among the nodes."""
    labels = {}
    for place, node in enumerate(nodes, 1):
        text = str(node).replace("/", "_").replace("-", "minus_")
        labels[node] = text if isinstance(node, Fraction) and len(text) < 12 else f"n{place}"
    return labels


def _combination(coefficients: tuple[Number, ...], slopes: list[sp.Matrix], like: sp.Matrix) -> sp.Matrix:
    total = sp.zeros(*like.shape)
    for coefficient, slope in zip(coefficients, slopes, strict=True):
        total += sp.sympify(coefficient) * slope
    return total


def _like(kinematics: Kinematics, name: str, meaning: str) -> Signal:
    """Return a signal of the state's shape whose elements carry the state's labels."""
    elements = tuple(f"{name}_{element.rsplit('_', 1)[1]}" for element in kinematics.transition.elements)
    return Signal(name, kinematics.transition.shape, elements, meaning=meaning)
