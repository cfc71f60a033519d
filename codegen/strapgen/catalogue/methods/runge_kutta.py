"""Explicit Runge-Kutta methods: the stages of a tableau for any differential equation, and methods on rotations.

Munthe-Kaas methods apply a tableau to the rotation vector of the step, and take its exponential. Crouch-Grossman
methods are a product of exponentials of the rate at the nodes, each times a weight and the step; on attitude kinematics
the rate does not depend on the attitude, so that nodes and weights are all that is left of the tableau.

>>> from strapgen import TABLEAUX, runge_kutta
>>> [str(node) for node in runge_kutta.nodes(TABLEAUX["rk4"])]
['0', '1/2', '1']
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import cache

import sympy as sp

from strapgen.catalogue.coefficients import Number
from strapgen.catalogue.kinematics import Kinematics
from strapgen.catalogue.methods import tableaux
from strapgen.catalogue.methods.method import PHI, Method, Samples, combination, exponential
from strapgen.catalogue.methods.order_conditions import attitude_order
from strapgen.catalogue.methods.tableaux import TABLEAUX, Tableau
from strapgen.ir.exceptions import InputError
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import cross, exact
from strapgen.kernel.kernel import Kernel, KernelBuilder


def verified(tableau: Tableau) -> Method:
    """Return the method of a tableau, a built-in one too, if it meets the conditions of its order.

    Examples
    --------
    >>> from strapgen import TABLEAUX
    >>> verified(TABLEAUX["rk4"]).order
    4
    """
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
    """Return the method of a tableau.

    Examples
    --------
    >>> from strapgen import TABLEAUX
    >>> method(TABLEAUX["ralston3"]).order
    3
    """

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

    Examples
    --------
    >>> from strapgen import EULER, TABLEAUX
    >>> [stage.signal.name for stage in staged_step(EULER, TABLEAUX["rk2"], 2).stages][-2:]
    ['point_2', 'slope_2']
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

    Examples
    --------
    >>> from strapgen import TABLEAUX, Signal
    >>> build, axis = KernelBuilder(), Signal.vector("axis", "u")
    >>> start, turns = build.input(axis), {0: sp.Matrix([0, 0, 1])}
    >>> end = advance(build, TABLEAUX["rk1"], turns, start, sp.Matrix.cross, like=axis, origin="axis")
    >>> end.T
    Matrix([[slope_1_x + u_x, slope_1_y + u_y, slope_1_z + u_z]])
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
    """Return the distinct nodes at which the result needs the rate, as fractions of the step.

    Examples
    --------
    >>> from strapgen import TABLEAUX
    >>> [str(node) for node in nodes(TABLEAUX["rk4"])]
    ['0', '1/2', '1']
    """
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


def munthe_kaas(order: int) -> Method:
    """Return the method of an order on the classical tableau `rk<order>`.

    Examples
    --------
    >>> munthe_kaas(4).order
    4
    """
    tableau = TABLEAUX[f"rk{order}"]
    nodes = tuple(dict.fromkeys(tableau.nodes))

    def rotation_vector(build: KernelBuilder, samples: Samples) -> sp.Matrix:
        end = advance(
            build,
            tableau,
            {node: samples.turn(node) for node in nodes},
            sp.zeros(3, 1),
            lambda phi, turn: bortz(phi, turn, order - 2),
            like=Signal.vector("phi", "phi"),
            origin="zero",
        )
        return build.stage(PHI, end)

    return exponential(
        f"munthe-kaas{order}",
        f"Runge-Kutta-Munthe-Kaas method of order {order}",
        "H. Munthe-Kaas, Appl. Numer. Math. 29 (1999) 115-127",
        order,
        rotation_vector,
        nodes=nodes,
    )


def bortz(phi: sp.Matrix, turn: sp.Matrix, products: int) -> sp.Matrix:
    """Return the derivative of the rotation vector by Bortz's equation, with so many nested cross products at most.

    The equation is dphi/dt = sum_k (-1)^k B_k/k! phi x (phi x ... w) with Bernoulli's numbers B_k, B_1 = -1/2, which
    begins w + phi x w/2 + phi x (phi x w)/12 (J. E. Bortz, IEEE Trans. Aerosp. Electron. Syst. 7 (1971) 61-66).

    Examples
    --------
    >>> phi, turn = sp.Matrix([0, 0, sp.Symbol("p")]), sp.Matrix([sp.Symbol("w"), 0, 0])
    >>> bortz(phi, turn, 2).T
    Matrix([[-p**2*w/12 + w, p*w/2, 0]])
    """
    total, nested = turn, turn
    for k in range(1, products + 1):
        nested = cross(phi, nested)
        total += bortz_coefficient(k) * nested
    return total


def bortz_coefficient(products: int) -> sp.Rational:
    """Return the coefficient of a number of nested cross products in Bortz's equation.

    Examples
    --------
    >>> [bortz_coefficient(products) for products in range(5)]
    [1, 1/2, 1/12, 0, -1/720]
    """
    # B_1 of SymPy is +1/2 or -1/2, depending on its release.
    if products == 1:
        return abs(sp.bernoulli(1))
    return sp.bernoulli(products) / sp.factorial(products)


_CROUCH_GROSSMAN_SOURCE = (
    "P. E. Crouch, R. Grossman, J. Nonlinear Sci. 3 (1993) 1-33; coefficients as in E. Hairer, C. Lubich, G. Wanner, "
    "Geometric Numerical Integration, 2nd ed. (2006), IV.8"
)
#: Nodes and weights of the method of third order.
_NODES = (Fraction(0), Fraction(3, 4), Fraction(17, 24))
_WEIGHTS = (Fraction(13, 51), Fraction(-2, 3), Fraction(24, 17))


def crouch_grossman(order: int) -> Method:
    """Return the method of third order.

    Examples
    --------
    >>> crouch_grossman(3).order
    3
    """

    def transition(build: KernelBuilder, kinematics: Kinematics, samples: Samples) -> sp.Matrix:
        total = None
        for number, (node, weight) in enumerate(zip(_NODES, _WEIGHTS, strict=True), 1):
            exponential = kinematics.exponential(exact(weight) * samples.turn(node))
            if total is not None:
                exponential = kinematics.product(total, exponential)
            if number == len(_NODES):
                return exponential
            elements = tuple(f"part{number}_{e.rsplit('_', 1)[1]}" for e in kinematics.transition.elements)
            signal = Signal(
                f"part{number}",
                kinematics.transition.shape,
                elements,
                meaning=f"product of the first {number} exponentials",
            )
            total = build.stage(signal, exponential)
        raise AssertionError("there are nodes")

    return Method(
        f"crouch-grossman{order}",
        f"Crouch-Grossman method of order {order}",
        _CROUCH_GROSSMAN_SOURCE,
        order,
        transition,
        nodes=_NODES,
        isometry=lambda count: True,
    )
