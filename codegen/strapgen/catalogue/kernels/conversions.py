"""Conversions between attitude representations, and the error matrix of a computed attitude."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import sympy as sp

from strapgen.catalogue.kinematics import (
    CAYLEY_KLEIN,
    DCM,
    DCM_MEANING,
    EULER,
    KINEMATICS,
    SAVAGE,
    THESIS,
    UNIT,
    Kinematics,
)
from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import ANY, Signal
from strapgen.kernel import algebra
from strapgen.kernel.algebra import Direction, Wrapped
from strapgen.kernel.kernel import EPSILON, Kernel, KernelBuilder

_CONVERTED = Signal.matrix(
    "attitude", "C", meaning=DCM.state.meaning, bound=DCM.state.bound, constraint="rotation", frame="b to n"
)


def _result(kinematics: Kinematics) -> Signal:
    state = kinematics.state
    elements = tuple(f"next_{element.split('_')[1]}" for element in state.elements)
    return replace(state, name="converted", elements=elements)


def converted(to: str, source: str) -> Kernel:
    """Derive the conversion between two attitude representations."""
    if to == "dcm":
        return _dcm_from_euler() if source == "euler" else _dcm_from_cayley_klein()
    if source == "dcm":
        return _from_dcm(KINEMATICS[to])
    return _reordered(KINEMATICS[source], KINEMATICS[to])


def _dcm_from_euler() -> Kernel:
    """Derive the direction cosine matrix from v -> e v e*."""
    build = KernelBuilder()
    e = build.input(EULER.state)
    build.output(_CONVERTED, algebra.quaternion_matrix(e).applyfunc(sp.expand))
    return build.kernel(
        "dcm-from-euler",
        "Direction cosine matrix from Euler parameters",
        f"{THESIS}, chapter 2",
        notes=("The result is |state|^2 times a rotation: a rotation for a state of length 1.",),
    )


def _dcm_from_cayley_klein() -> Kernel:
    """Derive the direction cosine matrix from C_jk = 1/2 tr(s_j U' s_k U), U' the conjugate transpose."""
    build = KernelBuilder()
    U = algebra.cayley_klein_matrix(build.input(CAYLEY_KLEIN.state))
    build.output(
        _CONVERTED,
        [
            sp.expand((algebra.PAULI[j] * U.H * algebra.PAULI[k] * U).trace() / 2)
            for j in range(3)
            for k in range(3)
        ],
    )
    return build.kernel(
        "dcm-from-cayley-klein",
        "Direction cosine matrix from Cayley-Klein parameters",
        f"{THESIS}, chapter 2",
        notes=("The result is |state|^2 times a rotation: a rotation for a state of length 1.",),
    )


def _largest_column(build: KernelBuilder) -> tuple[sp.Matrix, sp.Symbol, sp.Matrix]:
    """Return the column of 4 e e' through its largest diagonal element, that element, and the diagonal, scalar last.

    4 e e' is linear in the matrix.
    """
    C = build.input(DCM.state)
    trace = build.value("trace", C.trace(), "trace of C")
    diagonal = [build.value(f"four_{k}{k}", 1 + 2 * C[i, i] - trace) for i, k in enumerate("xyz")]
    diagonal.append(build.value("four_ss", 1 + trace, "4 e_s^2; the others are 4 e_x^2, 4 e_y^2, 4 e_z^2"))
    four = sp.zeros(4, 4)  # 4 e e', scalar last
    for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        label = "xyz"[j] + "xyz"[k]
        four[j, k] = four[k, j] = build.value(f"four_{label}", C[j, k] + C[k, j])
        label = "s" + "xyz"[i]
        four[i, 3] = four[3, i] = build.value(f"four_{label}", C[k, j] - C[j, k])
        four[i, i] = diagonal[i]
    four[3, 3] = diagonal[3]
    largest = build.value("largest", sp.Max(*diagonal), "4 times the square of the largest parameter")
    column = build.stage(
        Signal.labelled("column", "column", "xyzs", meaning="the column of 4 e e' through the largest"),
        [_of_largest([four[i, k] for k in range(4)], diagonal, largest) for i in range(4)],
    )
    return column, largest, sp.Matrix(diagonal)


def _of_largest(values: Sequence[Any], diagonal: Sequence[sp.Symbol], largest: sp.Symbol) -> sp.Piecewise:
    """Return the one of four values whose diagonal element is largest; of equal ones the scalar (the last) wins."""
    return sp.Piecewise(*((values[k], diagonal[k] >= largest) for k in (3, 0, 1)), (values[2], True))


def _sign(expression: sp.Expr) -> sp.Piecewise:
    """Return 1 for a number from 0 up, else -1."""
    return sp.Piecewise((sp.Integer(1), expression >= 0), (sp.Integer(-1), True))


def _from_dcm(kinematics: Kinematics) -> Kernel:
    """Derive a unit quaternion whose scalar part is not negative, accurate at every attitude."""
    build = KernelBuilder()
    column, largest, _ = _largest_column(build)
    factor = build.value(
        "factor", _sign(column[3]) / (2 * sp.sqrt(largest)), "makes the scalar part positive"
    )
    converted = _result(kinematics)
    by_label = dict(zip("xyzs", column, strict=True))
    build.output(converted, [factor * by_label[element[-1]] for element in converted.elements])
    return build.kernel(
        f"{kinematics.name}-from-dcm",
        f"{kinematics.title} from a direction cosine matrix",
        f"{THESIS}, chapter 2, inverted; largest element first as in S. W. Shepperd, J. Guidance and Control"
        " 1 (1978) 223-224",
        notes=("The scalar part of the result is not negative.",),
    )


_PREVIOUS = replace(
    EULER.state,
    name="previous",
    elements=tuple(f"last_{label}" for label in "xyzs"),
    meaning=f"{EULER.state.meaning}, of the call before",
)


def euler_from_dcm_followed(rule: str) -> Kernel:
    """Derive Euler parameters from a direction cosine matrix, with a sign continuous from call to call.

    By the rule "element" the largest element keeps its sign, equation (18), correct below 60 degrees a call; by
    "product" the scalar product with the previous parameters is not negative, correct up to 180 degrees.
    """
    build = KernelBuilder()
    column, largest, diagonal = _largest_column(build)
    previous = build.input(_PREVIOUS)
    if rule == "element":
        before = build.value(
            "before", _of_largest(previous, diagonal, largest), "the largest parameter, before"
        )
        name, words, note = "sheppard", "the largest keeps its sign", "60"
    else:
        before = build.value(
            "along", algebra.dot(previous, column), "4 times the largest, times their product"
        )
        name, words, note = "continuous", "continued", "180"
    factor = build.value("factor", _sign(before) / (2 * sp.sqrt(largest)), "carries the sign")
    converted = _result(EULER)
    build.output(converted, factor * column)
    return build.kernel(
        f"euler-from-dcm-{name}",
        f"Euler parameters from a direction cosine matrix, {words}",
        f"{SAVAGE}, equation (18){'' if rule == 'element' else ', its sign by the scalar product'}",
        recursion=Recursion((("previous", converted.name),), retained=("previous",)),
        notes=(f"The sign is continuous for turns of less than {note} degrees from call to call.",),
    )


def _reordered(source: Kinematics, target: Kinematics) -> Kernel:
    """Derive one unit quaternion from another: the scalar moves to the other end."""
    build = KernelBuilder()
    x = build.input(source.state)
    by_label = {symbol.name[-1]: symbol for symbol in x}
    converted = _result(target)
    build.output(converted, [by_label[element[-1]] for element in converted.elements])
    return build.kernel(
        f"{target.name}-from-{source.name}",
        f"{target.title} from {source.title}",
        f"{THESIS}, chapter 2: a1 = e4, a2 = e1, a3 = e2, a4 = e3",
    )


ANGLES = Signal(
    "angles",
    (3,),
    ("roll", "pitch", "heading"),
    unit="rad",
    meaning="Euler angles: roll, pitch, heading",
    bound=Fraction(355, 113),
    frame=ANY,
)
#: Squared cosine of pitch below which heading is computed from its sum or difference with roll.
_STEEP = sp.Rational(1, 4)
#: Cosine of pitch, in units of the resolution, up to which the matrix does not determine roll and heading separately.
_VERTICAL = 2


def dcm_from_euler_angles() -> Kernel:
    """Derive the direction cosine matrix of Euler angles, equation (60)."""
    build = KernelBuilder()
    roll, pitch, heading = build.input(ANGLES)

    def turned(angle: sp.Expr, name: str, axis: int) -> sp.Matrix:
        c, s = build.value(f"cos_{name}", sp.cos(angle)), build.value(f"sin_{name}", sp.sin(angle))
        matrix, (j, k) = sp.eye(3), ((1, 2), (2, 0), (0, 1))[axis]
        matrix[j, j] = matrix[k, k] = c
        matrix[k, j], matrix[j, k] = s, -s
        return matrix

    product = turned(heading, "heading", 2) * turned(pitch, "pitch", 1) * turned(roll, "roll", 0)
    build.output(replace(DCM.state, name="attitude", frame=ANY), product)
    return build.kernel(
        "dcm-from-euler-angles", "Direction cosine matrix from Euler angles", f"{SAVAGE}, equation (60)"
    )


def followed_angles(
    build: KernelBuilder, C: sp.Matrix, before: sp.Symbol, names: tuple[str, str, str]
) -> tuple[sp.Symbol, sp.Symbol, sp.Symbol]:
    """Name roll, pitch and heading of a rotation in rad, equations (61) to (63); a vertical pitch keeps `before`."""
    square = build.value("cosine_squared", C[0, 0] ** 2 + C[1, 0] ** 2, f"square of the cosine of {names[1]}")
    pitch = build.value(f"next_{names[1]}", sp.atan2(-C[2, 0], sp.sqrt(square)), names[1])
    vertical = (_VERTICAL * EPSILON) ** 2
    roll = build.value(
        f"next_{names[0]}",
        sp.Piecewise((before, square <= vertical), (sp.atan2(C[2, 1], C[2, 2]), True)),
        f"{names[0]}; held where {names[1]} is vertical",
    )
    up = C[2, 0] <= 0
    sine = build.value(
        "steep_sine",
        sp.Piecewise((C[1, 2] - C[0, 1], up), (-C[1, 2] - C[0, 1], True)),
        f"{names[2]} - {names[0]}, or +",
    )
    cosine = build.value("steep_cosine", sp.Piecewise((C[1, 1] + C[0, 2], up), (C[1, 1] - C[0, 2], True)))
    apart = build.value("apart", Direction(sine, cosine), "the angle between or together")
    heading = build.value(
        f"next_{names[2]}",
        sp.Piecewise(
            (sp.atan2(C[1, 0], C[0, 0]), square >= _STEEP),
            (Wrapped(apart + sp.Piecewise((roll, up), (-roll, True))), True),
        ),
        names[2],
    )
    return roll, pitch, heading


def euler_angles_from_dcm() -> Kernel:
    """Derive the Euler angles of a direction cosine matrix, equations (61) to (63).

    Equation (63) holds at every pitch: C23 - C12 and C13 + C22 are 1 + sin(pitch) times the sine and cosine of
    heading - roll. It is used at steep pitch, so that heading - roll (or their sum) is as accurate as the matrix even
    where neither angle is by itself. If the pitch is vertical to the last digit, roll does not change.
    """
    build = KernelBuilder()
    C = build.input(replace(DCM.state, frame=ANY))
    before = build.input(
        replace(
            ANGLES,
            name="previous",
            elements=tuple(f"last_{e}" for e in ANGLES.elements),
            meaning="the angles before",
        )
    )
    roll, pitch, heading = followed_angles(build, C, before[0], ("roll", "pitch", "heading"))
    build.output(
        replace(ANGLES, name="next", elements=tuple(f"found_{e}" for e in ANGLES.elements)),
        [roll, pitch, heading],
    )
    return build.kernel(
        "euler-angles-from-dcm",
        "Euler angles from a direction cosine matrix",
        f"{SAVAGE}, equations (61) to (63), the root of (61) of C11^2 + C21^2",
        recursion=Recursion((("previous", "next"),), retained=("previous",)),
        notes=(
            "Heading - roll at pitch up, heading + roll at pitch down, are as good as the matrix at every pitch.",
            "Errors of angles are told without whole turns.",
        ),
    )


def error_matrix() -> Kernel:
    """Derive E = C_computed C_true' - I and its parts, reference axes, in rad.

    Scale is the diagonal, skew the symmetric part off the diagonal, and drift the skew-symmetric part. If
    C_computed = exp(skew(eps)) C_true, the drift is -eps to first order.
    """
    build = KernelBuilder()
    computed = build.input(
        Signal.matrix(
            "computed",
            "C",
            meaning=f"{DCM_MEANING}, computed",
            bound=UNIT,
            constraint="rotation",
            frame="b to n",
        )
    )
    truth = build.input(
        Signal.matrix(
            "truth", "T", meaning=f"{DCM_MEANING}, true", bound=UNIT, constraint="rotation", frame="b to n"
        )
    )
    E = build.output(
        Signal.matrix("error", "E", meaning="error matrix, reference axes", frame="n"),
        computed * truth.T - sp.eye(3),
    )
    symmetric, turning = (E + E.T) / 2, (E - E.T) / 2
    build.output(
        Signal.vector("scale", "scale", meaning="scale errors, reference axes", frame="n"), E.diagonal()
    )
    build.output(
        Signal.vector("skew", "skew", unit="rad", meaning="skew errors, reference axes", frame="n"),
        [symmetric[1, 2], symmetric[0, 2], symmetric[0, 1]],
    )
    build.output(
        Signal.vector(
            "drift",
            "drift",
            unit="rad",
            meaning="drift errors, reference axes: the rotation from the computed frame to the true one",
            frame="n",
        ),
        [-turning[2, 1], -turning[0, 2], -turning[1, 0]],
    )
    return build.kernel(
        "error-matrix",
        "Error matrix of a computed attitude: scale, skew and drift",
        f"{THESIS}, chapter 4 A",
        notes=("The true matrix is a rotation.",),
    )
