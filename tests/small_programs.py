"""Small programs for tests of rounding, and their values: as the code computes them, and exactly."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from strapgen.fixedpoint.floating.errors import NUMBERS
from strapgen.ir.kernel_info import KernelInfo
from strapgen.ir.program import OPERATIONS, Assignment, Constant, Node, Operation, Program, Reference, Result
from strapgen.ir.signals import Signal
from strapgen.run.exact import FUNCTIONS

TYPES = {"double": np.float64, "float": np.float32}


def node(kind: str, *arguments: Node | str | Fraction | int) -> Operation:
    """Return an operation on names, numbers and other operations."""
    nodes = [
        Reference(a) if isinstance(a, str) else a if isinstance(a, Node) else Constant(Fraction(a))
        for a in arguments
    ]
    return Operation(kind, tuple(nodes))


def program(body: Mapping[str, Node], bounds: Mapping[str, Fraction | int], result: str = "y") -> Program:
    """Return a program of scalar inputs with their largest magnitudes, which returns one value."""
    inputs = tuple(Signal.scalar(name, bound=Fraction(bound)) for name, bound in bounds.items())
    output = Result(Signal.scalar("out"), (Reference(result),))
    assignments = tuple(Assignment(name, value) for name, value in body.items())
    return Program(KernelInfo("small", "small", ""), inputs, assignments, (output,))


def _fraction(value: mpmath.mpf) -> Fraction:
    sign, digits, power, _ = mpmath.mpf(value)._mpf_
    return (-1) ** sign * int(digits) * Fraction(2) ** power


def _exactly(kind: str):
    function = mpmath.sqrt if kind == "sqrt" else FUNCTIONS[kind]

    def of(*arguments: Fraction) -> Fraction:
        with mpmath.workprec(400):
            return _fraction(function(*(mpmath.mpf(a.numerator) / a.denominator for a in arguments)))

    return of


#: Operations on fractions; roots and functions to 400 binary digits.
EXACT = {**OPERATIONS, **{kind: _exactly(kind) for kind in ("sqrt", *FUNCTIONS)}}


def exactly(code: Program, values: Mapping[str, Any]) -> dict[str, list[Fraction]]:
    """Return the outputs of a program on the numbers that floats are, in exact arithmetic."""
    return code.run({name: Fraction(float(value)) for name, value in values.items()}, operations=EXACT)


def _in(type_: type) -> dict[str, Any]:
    # The sine of C, which is within a unit in the last place; that of arrays in float is not.
    def sine(x: Any) -> Any:
        return np.vectorize(math.sin, otypes=[float])(x).astype(type_)

    def cosine(x: Any) -> Any:
        return np.vectorize(math.cos, otypes=[float])(x).astype(type_)

    return OPERATIONS | {
        "sqrt": np.sqrt,
        "sin": sine,
        "cos": cosine,
        "sinc": lambda x: np.where(x == 0, type_(1), sine(x) / np.where(x == 0, type_(1), x)),
        "maximum": np.maximum,
        "select": np.where,
    }


def computed(code: Program, values: Mapping[str, NDArray], number: str) -> dict[str, list[NDArray]]:
    """Return the outputs of a program on arrays of numbers of a type, operation by operation as the C has them."""
    type_ = TYPES[number]
    return code.run(
        {name: np.asarray(value, type_) for name, value in values.items()},
        lambda value: type_(float(NUMBERS[number].rounded(value))),
        _in(type_),
    )


def in_long_double(code: Program, values: Mapping[str, NDArray]) -> dict[str, list[NDArray]]:
    """Return the outputs of a program of sums and products on arrays, rounded 2,000 times finer than doubles."""
    return code.run(
        {name: np.asarray(value, np.longdouble) for name, value in values.items()},
        lambda value: np.longdouble(value.numerator) / np.longdouble(value.denominator),
    )
