"""`effect` derives what an orthonormalization scheme does to a small error, as appendix B of the thesis does."""

from __future__ import annotations

import sympy as sp

from strapgen import catalogue, pipeline
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.kernel.power_series import Powers, outputs

#: The error P of the computed matrix (I + s P) C, where C is the true matrix and s the size of the error.
ERROR = sp.Matrix(3, 3, sp.symbols("p11 p12 p13 p21 p22 p23 p31 p32 p33"))


def effect(scheme: str, order: int = 2) -> dict[int, sp.Matrix]:
    """Return the error after a scheme of orthonormalization, as a series in the error before it.

    The scheme changes the matrix (I + s P) C into (I + s F_1(P) + s^2 F_2(P) + ...) C. To first order every scheme
    leaves the skew part of P: scale and skew vanish, and the drift does not change (B.4). To second order the nearest
    rotation changes the drift by -(K Y + Y K)/2, where K and Y are the skew and symmetric parts of P (B.14).

    >>> (effect("dcm-orthonormalize")[1] - (ERROR - ERROR.T) / 2).expand().is_zero_matrix
    True
    """
    checks.choice("scheme", scheme, catalogue.orthonormalizations("dcm"))
    checks.count("order", order, largest=4)
    kernel = pipeline.derive(scheme)
    ring, *elements = sp.ring([str(symbol) for symbol in ERROR], sp.QQ)

    (computed,) = kernel.inputs
    values = {
        name: Powers(ring, {0: ring(int(k % 4 == 0)), 1: element}, order)
        for k, (name, element) in enumerate(zip(computed.elements, elements, strict=True))
    }
    try:
        results = outputs(kernel, values, ring, order)
    except ArithmeticError as error:
        raise InputError(f"kernel {scheme} has no series in the error: {error}") from None
    result = results[kernel.outputs[-1].signal.name]
    return {
        power: sp.Matrix(3, 3, [x.parts.get(power, ring.zero).as_expr() for x in result])
        for power in range(1, order + 1)
    }
