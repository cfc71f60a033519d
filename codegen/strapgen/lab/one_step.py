"""The error matrix of one step as a power series in the step length, for any smooth rate.

The rate is w(t) = w_0 + w_1 t + w_2 t^2/2 + ...; its increments and the true transition are exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import sympy as sp

from strapgen import catalogue, pipeline
from strapgen.catalogue import AnyAlgorithm
from strapgen.catalogue.coefficients import Number
from strapgen.ir.exceptions import InputError
from strapgen.kernel import algebra
from strapgen.kernel.covariants import Frame
from strapgen.kernel.kernel import Kernel
from strapgen.kernel.power_series import Powers, constant, field, outputs
from strapgen.lab import sampled_motion
from strapgen.lab.sampled_motion import Rate

#: For methods whose coefficients are published with about 17 digits: digits of an error, and the largest that may be 0.
_DIGITS = 12
_LEAST = Fraction(1, 10**14)

#: Number of further powers that are tried if a series has no term where its order says it should.
PATIENCE = 4


@dataclass(frozen=True)
class Step:
    """An attitude step and the samples that it takes."""

    kernel: Kernel
    #: Nodes at which it takes the rate, as fractions of the step; None for a step that takes increments
    nodes: tuple[Number, ...] | None
    #: For a method with rounded coefficients, the power of the step at which its error would begin with exact
    #: ones; 0 if the coefficients are exact
    lowest: int = 0

    @property
    def increments_per_step(self) -> int:
        """Number of increments of the step itself."""
        beside = self.kernel.attitude_step.extra_increments if self.kernel.attitude_step else 0
        return int(self.kernel.inputs[1].shape[0]) - beside

    @property
    def intervals(self) -> range:
        """Numbers of the sampling intervals that it takes: 0 is the first of the step, -1 the one before it."""
        step_kernels = self.kernel.attitude_step
        assert step_kernels is not None, "checked by `step`"
        return range(-step_kernels.previous, self.increments_per_step + step_kernels.ahead)

    def shown(self, number: Fraction) -> Fraction:
        """Return a coefficient of the error, rounded to the digits that the coefficients of the method support."""
        if not self.lowest:
            return number
        return Fraction(f"{float(number):.{_DIGITS - 1}e}") if abs(number) > _LEAST else Fraction(0)

    def shares(self, terms: int) -> list[list[sp.Expr]]:
        """Return the share of t^j/j! in each sample, j from 0 on, as a multiple of the (j + 1)-th power of the step."""
        if self.nodes is not None:
            return [sampled_motion.node_shares(node, terms) for node in self.nodes]
        return [sampled_motion.increment_shares(k, self.increments_per_step, terms) for k in self.intervals]

    @property
    def domain(self) -> Any:
        """The smallest domain that holds the numbers of the step and polynomials in its unknowns."""
        expressions = [algebra.exact(node) for node in self.nodes or ()]
        for stage in (*self.kernel.stages, *self.kernel.outputs):
            expressions += stage.expressions
        return field(expressions, self.kernel.unknowns)


def step(algorithm: AnyAlgorithm) -> Step:
    """Return a chosen attitude step."""
    choice = catalogue.choose(algorithm)
    kernel = pipeline.derive(choice)
    if kernel.attitude_step is None:
        raise InputError(f"kernel {kernel.name} is no attitude step")
    nodes = None if kernel.inputs[1].name == "increments" else catalogue.nodes(choice)
    rounded = kernel.order is not None and bool(catalogue.rounding(choice))
    return Step(kernel, nodes, kernel.order.step + 1 if kernel.order and rounded else 0)


def linear_step(algorithm: AnyAlgorithm) -> Step:
    """Return a chosen attitude step that is linear in its state, so that its error is the same at any attitude."""
    attitude_step = step(algorithm)
    attitude_step.kernel.require_known()
    if attitude_step.kernel.transition is None:
        raise InputError(
            f"kernel {attitude_step.kernel.name} is not linear in its state: "
            "what it loses in a run depends on the attitude"
        )
    return attitude_step


def general_rate(attitude_step: Step, count: int) -> tuple[Frame, Any, list[list[Any]]]:
    """Return a general rate: a rotated frame, a ring over the field of the step, and the rate with its derivatives."""
    frame = Frame(count)
    ring = frame.ring.clone(domain=attitude_step.domain)
    return frame, ring, [[element.set_ring(ring) for element in vector] for vector in frame.vectors]


def errors(attitude_step: Step, ring: Any, rate: Rate, top: int) -> dict[str, list[Powers]]:
    """Return the error matrix of one step from zero rotation, and its parts, up to a power of the step.

    `ring`: ring of the coefficients, over the step's own field.
    """
    computed, true = computed_matrix(attitude_step, ring, rate, top), true_matrix(ring, rate, top)
    parts = parts_of_error(computed, true, ring, top)
    if attitude_step.lowest:
        parts = {
            name: [
                Powers(ring, {p: x for p, x in one.parts.items() if p >= attitude_step.lowest}, top)
                for one in elements
            ]
            for name, elements in parts.items()
        }
    return parts


def parts_of_error(
    computed: Sequence[Powers], true: Sequence[Powers], ring: Any, top: int
) -> dict[str, list[Powers]]:
    """Return the error matrix of a computed matrix, and its parts, as `errors` does."""
    split = _error_matrix()
    values: dict[str, Any] = {}
    for signal, elements in zip(split.inputs, (computed, true), strict=True):
        values |= zip(signal.elements, elements, strict=True)
    parts: dict[str, list[Powers]] = split.expand(values, lambda value: constant(ring, value, top))
    return parts


def shown(attitude_step: Step, element: Any) -> Any:
    """Return a ring element with its coefficients rounded as by `Step.shown`."""
    if not attitude_step.lowest:
        return element
    terms = {
        place: attitude_step.shown(Fraction(int(x.numerator), int(x.denominator)))
        for place, x in element.terms()
    }
    return element.ring.from_dict(
        {place: sp.QQ(x.numerator, x.denominator) for place, x in terms.items() if x}
    )


def split(error: Sequence[Any]) -> dict[str, list[Any]]:
    """Return the scale, skew and drift of an error matrix."""
    return {
        name: [sp.Add(*(share * error[place] for place, share in form)) for form in forms]
        for name, forms in _forms_of_error().items()
    }


@cache
def _forms_of_error() -> dict[str, list[list[tuple[int, sp.Rational]]]]:
    """Return the parts of an error matrix as sums of its elements: the place and the share of each."""
    kernel = _error_matrix()
    ring, *elements = sp.ring("e:9", sp.QQ)
    computed, true = (signal.elements for signal in kernel.inputs)
    identity = [ring(int(k % 4 == 0)) for k in range(9)]
    values = dict(zip(computed, (e + one for e, one in zip(elements, identity, strict=True)), strict=True))
    parts = kernel.expand(values | dict(zip(true, identity, strict=True)))
    return {
        name: [
            [(place.index(1), sp.Rational(x.numerator, x.denominator)) for place, x in form.terms()]
            for form in forms
        ]
        for name, forms in parts.items()
    }


def _error_matrix() -> Kernel:
    return pipeline.derive("error-matrix")


def computed_state(attitude_step: Step, ring: Any, rate: Rate, top: int) -> list[Powers]:
    """Return the state after one step from zero rotation, row by row.

    `rate`: the rate in rad/s and its derivatives at the beginning of the step.
    """
    sampled = sampled_motion.elements(ring, rate, attitude_step.shares(len(rate)), top)
    return state_of(attitude_step, sampled, ring, top)


def state_of(attitude_step: Step, sampled: Sequence[Powers], ring: Any, top: int) -> list[Powers]:
    """Return the state after one step from zero rotation, row by row, for samples that are series."""
    kernel, step_kernels = attitude_step.kernel, attitude_step.kernel.attitude_step
    assert step_kernels is not None, "checked by `step`"
    state, samples = kernel.inputs
    values: dict[str, Any] = {
        name: constant(ring, sp.Rational(x.numerator, x.denominator), top)
        for name, x in zip(state.elements, step_kernels.identity, strict=True)
    }
    values |= dict(zip(samples.elements, sampled, strict=True))
    return _evaluate(kernel, values, ring, top)


def computed_matrix(attitude_step: Step, ring: Any, rate: Rate, top: int) -> list[Powers]:
    """Return the direction cosine matrix after one step from zero rotation, body to reference axes, row by row.

    Parameters are those of `computed_state`.
    """
    return matrix_of(attitude_step, computed_state(attitude_step, ring, rate, top), ring, top)


def matrix_of(attitude_step: Step, elements: list[Powers], ring: Any, top: int) -> list[Powers]:
    """Return the direction cosine matrix of a state, row by row."""
    step_kernels = attitude_step.kernel.attitude_step
    if step_kernels is None or step_kernels.attitude is None:
        return elements
    attitude = catalogue.companion(attitude_step.kernel, step_kernels.attitude)
    values = dict(zip(attitude.inputs[0].elements, elements, strict=True))
    return _evaluate(attitude, values, ring, top)


def _evaluate(kernel: Kernel, values: dict[str, Any], ring: Any, top: int) -> list[Powers]:
    """Return the elements of the last output of a kernel."""
    return outputs(kernel, values, ring, top)[kernel.outputs[-1].signal.name]


def true_matrix(ring: Any, rate: Rate, top: int) -> list[Powers]:
    """Return the true direction cosine matrix after the step, row by row.

    For the rate sum_j g_j t^j, dC/dt = C skew(w) leads to (n + 1) C_(n+1) = sum_j C_(n-j) skew(g_j).

    `rate`: the rate in rad/s and its derivatives at the beginning of the step. Returns: nine elements, body to
    reference axes.
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
