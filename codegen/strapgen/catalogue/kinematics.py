"""Kinematics of the attitude representations: the differential equations of their states.

Every state obeys a linear equation dx/dt = f(x, g) with the generator g = scale * w, where w is the body rate. A step
applied to the identity is the transition, and the product of state and transition is the same step applied to the
state.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

import sympy as sp

from strapgen.ir.notebook_display import short_repr
from strapgen.ir.signals import Signal
from strapgen.kernel import algebra

THESIS = "MIT Measurement Systems Laboratory thesis on NASA grant NGR 22-009-229"
SAVAGE = "P. G. Savage, Strapdown System Algorithms, AGARD Lecture Series 133 (1984), paper 3"


@dataclass(frozen=True)
class Kinematics:
    """An attitude representation and its differential equation.

    Parameters
    ----------
    name : str
        Name of the algorithm on the command line.
    title : str
        Name of the state in the field.
    source : str
        Source of the equation.
    state, transition, next : Signal
        The state, the transition over one step, and the state after it.
    identity : ImmutableMatrix
        The state of zero rotation.
    scale : Rational
        Factor of the body rate in the generator.
    derivative : callable
        ``derivative(x, g)`` returns dx/dt for the generator g; bilinear.
    product : callable
        ``product(x, p)`` returns the state x after the transition p; bilinear.
    exponential : callable
        ``exponential(v, order, square)`` returns the transition of the rotation vector v in rad. With an order it
        omits products of the elements of v above that degree; ``square`` is v . v if that has a name.
    orthonormalize, attitude : str, str or None
        Names of the kernels that restore the constraint of the state and that convert it to a direction cosine
        matrix; the latter is None if the state is one.

    Examples
    --------
    >>> from strapgen import EULER
    >>> EULER.state.name, EULER.state.shape
    ('state', (4,))
    """

    name: str
    title: str
    source: str
    state: Signal
    transition: Signal
    next: Signal
    identity: sp.ImmutableMatrix
    scale: sp.Rational
    derivative: Callable[[sp.Matrix, sp.Matrix], sp.Matrix]
    product: Callable[[sp.Matrix, sp.Matrix], sp.Matrix]
    exponential: Callable[..., sp.Matrix]
    orthonormalize: str
    attitude: str | None

    __repr__ = short_repr

    def _in_words(self) -> str:
        return f"{self.name}: {self.title}, state {', '.join(self.state.elements)}"


def cayley_klein_derivative(a: sp.Matrix, g: sp.Matrix) -> sp.Matrix:
    """Return da/dt from dU/dt = i (g . s) U, where g is half the body rate."""
    turning = sp.I * sum((g[k] * algebra.PAULI[k] for k in range(3)), sp.zeros(2, 2))
    return algebra.cayley_klein_parameters(turning * algebra.cayley_klein_matrix(a))


def cayley_klein_product(a: sp.Matrix, p: sp.Matrix) -> sp.Matrix:
    """Return the parameters of the matrix product P U of the transition P and the state U."""
    return algebra.cayley_klein_parameters(algebra.cayley_klein_matrix(p) * algebra.cayley_klein_matrix(a))


def _scalar_first(q: sp.Matrix) -> list[sp.Expr]:
    return [q[3], *q[:3]]


UNIT = Fraction(1)
DCM_MEANING = "direction cosine matrix, body to reference"
EULER_MEANING = "Euler parameters, body to reference, scalar last"
CAYLEY_KLEIN_MEANING = "Cayley-Klein parameters, body to reference, scalar first"

#: The direction cosine matrix: signals of a step, its derivative, the kernels that go with it.
DCM = Kinematics(
    name="dcm",
    title="Direction cosine matrix",
    source=f"{THESIS}, chapter 2, equation (2.1): dC/dt = C skew(w)",
    state=Signal.matrix("state", "C", meaning=DCM_MEANING, bound=UNIT, constraint="rotation", frame="b to n"),
    transition=Signal.matrix(
        "transition",
        "A",
        meaning="the step applied to the identity",
        bound=UNIT,
        constraint="rotation",
        frame="b to b",
    ),
    next=Signal.matrix(
        "next",
        "next",
        meaning=f"{DCM_MEANING}, after the step",
        bound=UNIT,
        constraint="rotation",
        frame="b to n",
    ),
    identity=sp.ImmutableMatrix.eye(3),
    scale=sp.Integer(1),
    derivative=lambda C, g: C * algebra.skew(g),
    product=lambda C, A: C * A,
    exponential=algebra.rotation,
    orthonormalize="dcm-orthonormalize",
    attitude=None,
)

#: Euler parameters, scalar last, likewise.
EULER = Kinematics(
    name="euler",
    title="Euler parameters",
    source=f"{THESIS}, chapter 2: de/dt = 1/2 e (w, 0), quaternion product",
    state=Signal.labelled(
        "state", "e", "xyzs", meaning=EULER_MEANING, bound=UNIT, constraint="unit", frame="b to n"
    ),
    transition=Signal.labelled(
        "transition",
        "p",
        "xyzs",
        meaning="the step applied to the identity",
        bound=UNIT,
        constraint="unit",
        frame="b to b",
    ),
    next=Signal.labelled(
        "next",
        "next",
        "xyzs",
        meaning=f"{EULER_MEANING}, after the step",
        bound=UNIT,
        constraint="unit",
        frame="b to n",
    ),
    identity=sp.ImmutableMatrix([0, 0, 0, 1]),
    scale=sp.Rational(1, 2),
    derivative=lambda e, g: algebra.quaternion_product(e, sp.Matrix([*g, 0])),
    product=algebra.quaternion_product,
    exponential=algebra.quaternion,
    orthonormalize="euler-normalize",
    attitude="dcm-from-euler",
)

#: Cayley-Klein parameters, scalar first, likewise.
CAYLEY_KLEIN = Kinematics(
    name="cayley-klein",
    title="Cayley-Klein parameters",
    source=f"{THESIS}, chapter 2: dU/dt = (i/2) (w . s) U, s the Pauli matrices",
    state=Signal.labelled(
        "state", "a", "sxyz", meaning=CAYLEY_KLEIN_MEANING, bound=UNIT, constraint="unit", frame="b to n"
    ),
    transition=Signal.labelled(
        "transition",
        "p",
        "sxyz",
        meaning="the step applied to the identity",
        bound=UNIT,
        constraint="unit",
        frame="b to b",
    ),
    next=Signal.labelled(
        "next",
        "next",
        "sxyz",
        meaning=f"{CAYLEY_KLEIN_MEANING}, after the step",
        bound=UNIT,
        constraint="unit",
        frame="b to n",
    ),
    identity=sp.ImmutableMatrix([1, 0, 0, 0]),
    scale=sp.Rational(1, 2),
    derivative=cayley_klein_derivative,
    product=cayley_klein_product,
    exponential=lambda v, *rest: sp.Matrix(_scalar_first(algebra.quaternion(v, *rest))),
    orthonormalize="cayley-klein-normalize",
    attitude="dcm-from-cayley-klein",
)

KINEMATICS = {kinematics.name: kinematics for kinematics in (DCM, EULER, CAYLEY_KLEIN)}
