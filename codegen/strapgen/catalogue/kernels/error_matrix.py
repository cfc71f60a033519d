"""The error matrix of a computed attitude, and its parts scale, skew and drift."""

from __future__ import annotations

import sympy as sp

from strapgen.catalogue.kinematics import DCM_MEANING, THESIS, UNIT
from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder


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
