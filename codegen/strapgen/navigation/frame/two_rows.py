"""Derives the attitude kept as two rows of its direction cosine matrix, the third being their cross product."""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from strapgen.catalogue.kernels.two_speed_kernels import NAVIGATION_ROTATION, ROTATION_VECTOR, transition
from strapgen.catalogue.kinematics import DCM, SAVAGE, UNIT
from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import Signal, after
from strapgen.kernel import algebra
from strapgen.kernel.kernel import Kernel, KernelBuilder

#: The rows: the navigation axes x and y in body axes.
ROWS = tuple(
    Signal.vector(
        name,
        name,
        meaning=f"{number} row of the attitude, {axis} of n in body axes",
        bound=UNIT,
        constraint="unit",
        frame="b",
    )
    for name, number, axis in (("row_1", "first", "x"), ("row_2", "second", "y"))
)
_RECURSION = Recursion(
    tuple((row.name, after(row).name) for row in ROWS), retained=tuple(row.name for row in ROWS)
)
_TITLE = "Two rows of the direction cosine matrix"


def _third(rows: list[sp.Matrix]) -> sp.Matrix:
    """Return the third row as a column, equation (43)."""
    return algebra.cross(*rows)


def update(order: int | None = None) -> Kernel:
    """Return the kernel that rotates two rows by the rotation vector of a cycle, equations (2) to (4)."""
    build = KernelBuilder()
    rows = [build.input(row) for row in ROWS]
    turned = transition(build, DCM, build.input(ROTATION_VECTOR), order)
    for signal, row in zip(ROWS, rows, strict=True):
        build.output(after(signal), row.T * turned)
    return build.kernel(
        "dcm-two-rows-update" + (f"-{order}" if order else ""),
        f"{_TITLE}: update by a rotation vector" + (f", order {order}" if order else ", exact"),
        f"{SAVAGE}, equations (2) to (4) for two rows, as section 3.6 says",
        recursion=_RECURSION,
    )


def navigation(order: int | None = None) -> Kernel:
    """Return the kernel that refers two rows to the rotated navigation frame, equations (5), (6) and (43)."""
    build = KernelBuilder()
    rows = [build.input(row) for row in ROWS]
    turn = transition(build, DCM, -build.input(NAVIGATION_ROTATION), order, "n")
    third = build.stage(
        Signal.vector("row_3", "row_3", meaning="third row of the attitude", frame="b"), _third(rows)
    )
    matrix = sp.Matrix.vstack(*(row.T for row in (*rows, third)))
    for number, signal in enumerate(ROWS):
        build.output(after(signal), turn[number, :] * matrix)
    return build.kernel(
        "dcm-two-rows-navigation" + (f"-{order}" if order else ""),
        f"{_TITLE}: update by the rotation of the navigation frame" + (f", order {order}" if order else ""),
        f"{SAVAGE}, equations (5), (6) and (43) for two rows",
        recursion=_RECURSION,
    )


def orthonormalized() -> Kernel:
    """Return two rows made orthonormal to first order, equations (28) to (31)."""
    build = KernelBuilder()
    rows = [build.input(row) for row in ROWS]
    half = build.value("half_error", algebra.dot(*rows) / 2, "half the rows' product")
    factors = [
        build.value(
            f"factor_{number}", 1 + (1 - algebra.dot(row, row)) / 2, f"1/|row {number}| to first order"
        )
        for number, row in enumerate(rows, 1)
    ]
    for signal, row, other, factor in zip(ROWS, rows, rows[::-1], factors, strict=True):
        build.output(after(signal), factor * row - half * other)
    return build.kernel(
        "dcm-two-rows-orthonormalize",
        f"{_TITLE}: made orthonormal, to first order",
        f"{SAVAGE}, equations (28) to (31) for two rows, both corrected from the same rows",
        notes=("Made for rows near orthonormal ones.",),
    )


def matrix() -> Kernel:
    """Return the direction cosine matrix of two rows, equation (43)."""
    build = KernelBuilder()
    rows = [build.input(row) for row in ROWS]
    attitude = replace(DCM.state, name="attitude")
    build.output(attitude, sp.Matrix.vstack(*(row.T for row in (*rows, _third(rows)))))
    return build.kernel(
        "dcm-from-two-rows", "Direction cosine matrix from two rows", f"{SAVAGE}, equation (43)"
    )
