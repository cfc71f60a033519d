"""What one step loses: the error matrix of a kernel as a power series in the step length, for any smooth rate.

The rate is w(t) = w_0 + w_1 t + w_2 t^2/2 + ..., its increments are exact, and so is the true transition.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy as sp

from strapgen import algebra, catalogue
from strapgen.analysis.powers import Powers, function
from strapgen.exceptions import InputError
from strapgen.kernel import Kernel, evaluate_stages

#: A vector of polynomials for every derivative of the rate.
Rate = Sequence[Sequence[Any]]


def errors(kernel: Kernel, ring: Any, rate: Rate, top: int) -> dict[str, list[Powers]]:
    """Return the error matrix of one step, and its scale, skew and drift, up to a power of the step.

    Parameters
    ----------
    kernel : Kernel
        An attitude step that takes increments.
    ring : PolyRing
        Ring of the coefficients.
    rate : sequence of sequence of ring element
        The rate and its derivatives at the beginning of the step; those that are left out are zero.
    top : int
        The last power that is kept.

    Returns
    -------
    dict of str to list of Powers
        "error", nine elements row by row, "scale", "skew" and "drift", three each: the outputs of the kernel
        error-matrix.
    """
    both = (computed_matrix(kernel, ring, rate, top), true_matrix(ring, rate, top))
    split = _error_matrix()
    values: dict[str, Any] = {}
    for signal, elements in zip(split.inputs, both, strict=True):
        values |= zip(signal.elements, elements, strict=True)

    def number(value: sp.Rational) -> Powers:
        return Powers(ring, {0: ring(ring.domain.from_sympy(value))}, top)

    return split.expand(values, number)


def split(error: Sequence[Any]) -> dict[str, list[Any]]:
    """Return scale, skew and drift of an error matrix that is given row by row in expressions.

    Parameters
    ----------
    error : sequence of Expr
    """
    kernel = _error_matrix()
    computed, true = (signal.elements for signal in kernel.inputs)
    values = dict(zip(computed, (element + int(k % 4 == 0) for k, element in enumerate(error)), strict=True))
    values |= zip(true, (sp.Integer(int(k % 4 == 0)) for k in range(9)), strict=True)
    return kernel.expand(values)


def _error_matrix() -> Kernel:
    return catalogue.derive(catalogue.choose("error-matrix"))


def computed_matrix(kernel: Kernel, ring: Any, rate: Rate, top: int) -> list[Powers]:
    """Return the direction cosine matrix after one step from zero rotation, row by row."""
    companions = kernel.companions
    if companions is None or kernel.inputs[1].name != "increments":
        raise InputError(f"kernel {kernel.name} takes no increments; a step that does is needed")
    state, samples = kernel.inputs

    def number(value: Any) -> Powers:
        return Powers(ring, {0: ring(ring.domain.from_sympy(sp.sympify(value)))}, top)

    values: dict[str, Any] = {
        name: number(sp.Rational(x.numerator, x.denominator))
        for name, x in zip(state.elements, companions.identity, strict=True)
    }
    taken = increments(ring, rate, samples.shape[0] - companions.previous, companions.previous, top)
    values |= dict(zip(samples.elements, taken, strict=True))
    (result,) = kernel.outputs
    known = evaluate_stages((*kernel.stages, result), values, number, function)
    elements = [known[name] for name in result.signal.elements]
    if companions.attitude is None:
        return elements
    attitude = catalogue.derive(catalogue.choose(companions.attitude))
    values = dict(zip(attitude.inputs[0].elements, elements, strict=True))
    known = evaluate_stages((*attitude.stages, *attitude.outputs), values, number, function)
    return [known[name] for name in attitude.outputs[-1].signal.elements]


def increments(ring: Any, rate: Rate, count: int, previous: int, top: int) -> list[Powers]:
    """Return the elements of the exact increments that a step takes, row by row."""
    found = []
    for k in range(-previous, count):
        begin, end = sp.Rational(k, count), sp.Rational(k + 1, count)
        for axis in range(3):
            parts = {
                j + 1: vector[axis]
                * ring.domain.from_sympy((end ** (j + 1) - begin ** (j + 1)) / sp.factorial(j + 1))
                for j, vector in enumerate(rate)
            }
            found.append(Powers(ring, parts, top))
    return found


def true_matrix(ring: Any, rate: Rate, top: int) -> list[Powers]:
    """Return the true direction cosine matrix after the step, row by row.

    With the rate sum_j g_j t^j, dC/dt = C skew(w) gives (n + 1) C_(n+1) = sum_j C_(n-j) skew(g_j).
    """
    zero, one = ring.zero, ring.one
    skews = [
        [[x * ring.domain.from_sympy(1 / sp.factorial(j)) for x in row] for row in _skew(vector)]
        for j, vector in enumerate(rate)
    ]
    terms = [[[one if i == j else zero for j in range(3)] for i in range(3)]]
    for n in range(top):
        share = ring.domain.from_sympy(sp.Rational(1, n + 1))
        total = [[zero] * 3 for _ in range(3)]
        for j, skew in enumerate(skews[: n + 1]):
            left = terms[n - j]
            for i in range(3):
                for k in range(3):
                    total[i][k] = total[i][k] + sum((left[i][m] * skew[m][k] for m in range(3)), zero)
        terms.append([[element * share for element in row] for row in total])
    return [
        Powers(ring, {n: term[i][j] for n, term in enumerate(terms)}, top) for i in range(3) for j in range(3)
    ]


def _skew(vector: Sequence[Any]) -> list[list[Any]]:
    columns = [algebra.cross_elements(vector, [int(axis == k) for k in range(3)]) for axis in range(3)]
    return [list(row) for row in zip(*columns, strict=True)]
