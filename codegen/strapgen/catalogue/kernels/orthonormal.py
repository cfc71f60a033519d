"""Orthonormalizations, which restore the constraint that a computed attitude loses to numerical errors."""

from __future__ import annotations

import sympy as sp

from strapgen.catalogue.kinematics import DCM_MEANING, KINEMATICS, SAVAGE, THESIS, UNIT
from strapgen.ir.signals import Signal
from strapgen.kernel import algebra
from strapgen.kernel.kernel import Kernel, KernelBuilder

_COMPUTED = Signal.matrix(
    "computed", "C", meaning=f"{DCM_MEANING}, as computed", bound=UNIT, constraint="rotation", frame="b to n"
)
_RESULT = Signal.matrix(
    "orthonormalized",
    "next",
    meaning=f"{DCM_MEANING}, orthonormalized",
    bound=UNIT,
    constraint="rotation",
    frame="b to n",
)
_NEAR = "Made for a matrix near a rotation: all products of its transpose and itself near the identity."


def normalized(name: str) -> Kernel:
    """Derive the exact normalization of Euler or Cayley-Klein parameters."""
    kinematics = KINEMATICS[name]
    build = KernelBuilder()
    x = build.input(kinematics.state)
    factor = build.value("inverse_norm", 1 / sp.sqrt(algebra.dot(x, x)), "1/|state|")
    build.output(kinematics.next, factor * x)
    return build.kernel(
        kinematics.orthonormalize,
        f"{kinematics.title}: normalization to length 1, exact",
        f"{THESIS}, chapter 3 C: x / sqrt(x . x)",
        notes=(
            "The state must not be zero, which has no direction: in floating point the result is then NaN.",
        ),
    )


def dcm() -> Kernel:
    """Derive the scheme of the thesis, which adds its dual to each row and divides the sum by its length."""
    build = KernelBuilder()
    C = build.input(_COMPUTED)
    rows = [C[k, :].T for k in range(3)]
    normalized = []
    for k in range(3):
        dual = algebra.cross(rows[(k + 1) % 3], rows[(k + 2) % 3])
        row = build.stage(
            Signal.vector(f"row_{k + 1}", f"row_{k + 1}", meaning=f"row {k + 1} and its dual, added"),
            rows[k] + dual,
        )
        length = build.value(
            f"inverse_length_{k + 1}", 1 / sp.sqrt(algebra.dot(row, row)), f"1/|row {k + 1}|"
        )
        normalized.append((length * row).T)
    build.output(_RESULT, sp.Matrix.vstack(*normalized))
    return build.kernel(
        "dcm-orthonormalize",
        "Direction cosine matrix: orthonormalization by dual rows",
        f"{THESIS}, chapter 3 C, subroutine ORTHO",
        notes=(_NEAR,),
    )


def _symmetric(build: KernelBuilder, name: str, meaning: str, A: sp.Matrix) -> sp.Matrix:
    """Name the six independent elements of a symmetric matrix and return the matrix of their symbols."""
    places = [(i, j) for i in range(3) for j in range(i, 3)]
    elements = tuple(f"{name}_{i + 1}{j + 1}" for i, j in places)
    signal = Signal(name, (6,), elements, meaning=meaning)
    named = dict(zip(places, build.stage(signal, [A[place] for place in places]), strict=True))
    return sp.Matrix(3, 3, lambda i, j: named[min(i, j), max(i, j)])


def dcm_optimal() -> Kernel:
    """Derive the rotation nearest to the computed matrix, C (C'C)^(-1/2).

    Let G = C'C and let i1, i2, i3 be the invariants of U = G^(1/2). The theorem of Cayley and Hamilton leads to
    U (G + i2 I) = i1 G + i3 I, so the inverse root is (G + i2 I) (i1 G + i3 I)^-1. The eigenvalues of G follow from the
    trigonometric solution of the cubic, which atan2 makes regular at equal eigenvalues.
    """
    build = KernelBuilder()
    C = build.input(_COMPUTED)
    G = _symmetric(build, "gram", "C' C", C.T * C)
    mean = build.value("mean", G.trace() / 3, "mean of the eigenvalues of C' C")
    B = _symmetric(build, "deviator", "C' C less its mean", G - mean * sp.eye(3))
    spread = build.value("spread", (B * B).trace() / 6, "mean square spread of the eigenvalues, halved")
    half_determinant = build.value(
        "half_determinant", algebra.dot(B[:, 0], algebra.cross(B[:, 1], B[:, 2])) / 2
    )
    radicand = sp.Max(0, spread**3 - half_determinant**2, evaluate=False)
    angle = build.value("angle", sp.atan2(sp.sqrt(radicand), half_determinant) / 3, "angle of the cubic")
    radius = build.value("radius", sp.sqrt(spread))
    along = build.value("along", radius * sp.cos(angle))
    across = build.value("across", sp.sqrt(3) * radius * sp.sin(angle))
    stretches = [
        build.value(f"stretch_{k}", sp.sqrt(eigenvalue), f"singular value {k} of C")
        for k, eigenvalue in enumerate((mean + 2 * along, mean - along + across, mean - along - across), 1)
    ]
    u, v, w = stretches
    i1 = build.value("invariant_1", u + v + w, "invariants of (C' C)^(1/2)")
    i2 = build.value("invariant_2", u * v + v * w + w * u)
    i3 = build.value("invariant_3", u * v * w)
    N = _symmetric(build, "denominator", "i1 C' C + i3 I", i1 * G + i3 * sp.eye(3))
    adjugate = _symmetric(build, "adjugate", "adjugate of the denominator", algebra.adjugate(N))
    determinant = algebra.dot(N[0, :], adjugate[:, 0])
    factor = build.value("inverse_determinant", 1 / determinant)
    M = build.stage(
        Signal.matrix("root", "root", meaning="inverse root of C' C, times the determinant"),
        (G + i2 * sp.eye(3)) * adjugate,
    )
    build.output(_RESULT, factor * (C * M))
    return build.kernel(
        "dcm-orthonormalize-optimal",
        "Direction cosine matrix: the nearest rotation, least sum of squared differences",
        f"{THESIS}, appendix B, equation (B.1)",
        notes=(
            "The determinant of the matrix must be above 0: below 0 the result is the nearest reflection. "
            "Round-off grows with the fourth power of the condition.",
        ),
    )


def dcm_expansion(order: int) -> Kernel:
    """Derive the nearest rotation to first order, C (I - S/2) with S = C'C - I, or to second, C (I - S/2 + 3/8 S^2)."""
    build = KernelBuilder()
    C = build.input(_COMPUTED)
    S = _symmetric(build, "excess", "C' C - I", C.T * C - sp.eye(3))
    series = sp.eye(3) - S / 2
    words = "first"
    if order == 2:
        words = "second"
        square = _symmetric(build, "excess_squared", "(C' C - I)^2", S * S)
        series += sp.Rational(3, 8) * square
    root = _symmetric(build, "root", f"inverse root of C' C to {words} order", series)
    build.output(_RESULT, C * root)
    return build.kernel(
        f"dcm-orthonormalize-{words}-order",
        f"Direction cosine matrix: the nearest rotation to {words} order in C'C - I",
        f"{THESIS}, appendix B, equation {'(B.4)' if order == 1 else '(B.14)'} in terms of the computed matrix",
        notes=(_NEAR,),
    )


def rows_orthogonalized() -> Kernel:
    """Derive the rows of a matrix, each minus half its projections on the others, equations (28) and (29)."""
    build = KernelBuilder()
    C = build.input(_COMPUTED)
    rows = [C[k, :] for k in range(3)]
    error = {
        frozenset((i, j)): build.value(
            f"error_{i + 1}{j + 1}", algebra.dot(rows[i], rows[j]), f"rows {i + 1} and {j + 1}, multiplied"
        )
        for i, j in ((0, 1), (0, 2), (1, 2))
    }
    corrected = [
        rows[i] - sum((error[frozenset((i, j))] * rows[j] for j in range(3) if j != i), sp.zeros(1, 3)) / 2
        for i in range(3)
    ]
    build.output(_RESULT, sp.Matrix.vstack(*corrected))
    return build.kernel(
        "dcm-rows-orthogonalize",
        "Direction cosine matrix: rows made orthogonal, to first order",
        f"{SAVAGE}, equations (28) and (29), all rows corrected from the same matrix",
        notes=(_NEAR,),
    )


def rows_normalized() -> Kernel:
    """Derive the rows of a matrix, normalized to length 1 to first order, equations (30) and (31)."""
    build = KernelBuilder()
    C = build.input(_COMPUTED)
    corrected = []
    for k in range(3):
        row = C[k, :]
        factor = build.value(
            f"factor_{k + 1}", 1 + (1 - algebra.dot(row, row)) / 2, f"1/|row {k + 1}| to first order"
        )
        corrected.append(factor * row)
    build.output(_RESULT, sp.Matrix.vstack(*corrected))
    return build.kernel(
        "dcm-rows-normalize",
        "Direction cosine matrix: rows made of length 1, to first order",
        f"{SAVAGE}, equations (30) and (31), whose minus sign is a plus",
        notes=(_NEAR,),
    )


def third_row() -> Kernel:
    """Derive a matrix whose third row is the cross product of the first two, equation (43)."""
    build = KernelBuilder()
    C = build.input(_COMPUTED)
    rows = [C[k, :].T for k in range(2)]
    build.output(_RESULT, sp.Matrix.vstack(C[:2, :], algebra.cross(*rows).T))
    return build.kernel(
        "dcm-third-row",
        "Direction cosine matrix: third row from the first two",
        f"{SAVAGE}, equation (43)",
    )


def normalized_first_order(name: str) -> Kernel:
    """Derive the normalization of a unit quaternion to first order, equations (41) and (42)."""
    kinematics = KINEMATICS[name]
    build = KernelBuilder()
    x = build.input(kinematics.state)
    error = build.value("error", algebra.dot(x, x) - 1, "|state|^2 - 1")
    factor = build.value("factor", 1 - error / 2, "1/|state| to first order")
    build.output(kinematics.next, factor * x)
    return build.kernel(
        f"{kinematics.orthonormalize}-first-order",
        f"{kinematics.title}: normalization to length 1, to first order",
        f"{SAVAGE}, equations (41) and (42)",
        notes=("Made for a state whose length is near 1.",),
    )
