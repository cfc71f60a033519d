"""Conversions between direction cosine matrix, Euler parameters and Cayley-Klein parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import sympy as sp

from strapgen.catalogue.kinematics import CAYLEY_KLEIN, DCM, EULER, SAVAGE, THESIS, Kinematics
from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import Signal
from strapgen.kernel import algebra
from strapgen.kernel.kernel import Kernel, KernelBuilder

_CONVERTED = Signal.matrix(
    "attitude", "C", meaning=DCM.state.meaning, bound=DCM.state.bound, constraint="rotation", frame="b to n"
)


def _result(kinematics: Kinematics) -> Signal:
    state = kinematics.state
    elements = tuple(f"next_{element.split('_')[1]}" for element in state.elements)
    return replace(state, name="converted", elements=elements)


def dcm_from_euler() -> Kernel:
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


def dcm_from_cayley_klein() -> Kernel:
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


def _from_dcm(kinematics: Kinematics, name: str) -> Kernel:
    """Derive a unit quaternion whose scalar part is not negative."""
    build = KernelBuilder()
    column, largest, _ = _largest_column(build)
    factor = build.value(
        "factor", _sign(column[3]) / (2 * sp.sqrt(largest)), "makes the scalar part positive"
    )
    converted = _result(kinematics)
    by_label = dict(zip("xyzs", column, strict=True))
    build.output(converted, [factor * by_label[element[-1]] for element in converted.elements])
    return build.kernel(
        name,
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


def euler_from_dcm() -> Kernel:
    """Derive Euler parameters from a direction cosine matrix, accurate at every attitude."""
    return _from_dcm(EULER, "euler-from-dcm")


def cayley_klein_from_dcm() -> Kernel:
    """Derive Cayley-Klein parameters from a direction cosine matrix, accurate at every attitude."""
    return _from_dcm(CAYLEY_KLEIN, "cayley-klein-from-dcm")


def _reorder(source: Kinematics, target: Kinematics) -> Kernel:
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


def euler_from_cayley_klein() -> Kernel:
    """Derive Euler parameters from Cayley-Klein parameters: the scalar moves to the end."""
    return _reorder(CAYLEY_KLEIN, EULER)


def cayley_klein_from_euler() -> Kernel:
    """Derive Cayley-Klein parameters from Euler parameters: the scalar moves to the front."""
    return _reorder(EULER, CAYLEY_KLEIN)
