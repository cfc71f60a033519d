"""Kernels of a filter: the time update, and a scalar update for each measurement.

Online gains take the covariance: in Joseph's form P + is (I - K h) P (I - K h)' + K R K'; as factors U D U' the time
update is Thornton's weighted Gram-Schmidt orthogonalization, and the measurement update that of Bierman. Fixed gains
take a scalar for each state, so that each has a format of its own in fixed point.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

import sympy as sp

from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import exact
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.kalman.kalman_file import Quantity
from strapgen.navigation.kalman.kalman_model import FilterModel

_SOURCES = {
    "joseph": "P. S. Maybeck, Stochastic Models, Estimation and Control 1 (1979), Joseph's form",
    "ud": "G. J. Bierman, Factorization Methods for Discrete Sequential Estimation (1977); C. L. Thornton (1976)",
    "fixed": "R. E. Kalman, A New Approach to Linear Filtering and Prediction Problems (1960); gains computed before",
}


class FilterKernel(NamedTuple):
    """A kernel of a filter: the time update, or the update of a measurement."""

    kernel: Kernel
    #: None for the time update
    measurement: Quantity | None


def kernels(
    model: FilterModel, gains: Mapping[str, Sequence[Sequence[Fraction]]] | None
) -> list[FilterKernel]:
    """Return the kernels of a filter; without `gains` its covariance is computed online.

    `gains`: rows of gains by the measurement; a single row is a constant of the code.
    """
    form = "fixed" if gains is not None else model.text.form
    builders: dict[str, type[_Builder]] = {"joseph": _Joseph, "ud": _Factors, "fixed": _Fixed}
    build = builders[form]
    return [
        FilterKernel(build(model, None, gains).time_update(), None),
        *(FilterKernel(build(model, one, gains).update(), one) for one in model.text.measurements),
    ]


def triangle(size: int) -> list[tuple[int, int]]:
    """Return the places of the upper triangle by rows, as a covariance is stored."""
    return [(i, j) for i in range(size) for j in range(i, size)]


class _Builder:
    """What all forms share: signals, the estimate, and names of intermediate quantities."""

    form: str

    def __init__(
        self,
        model: FilterModel,
        measurement: Quantity | None,
        gains: Mapping[str, Sequence[Sequence[Fraction]]] | None,
    ) -> None:
        self.model, self.text, self.measurement, self.gains = model, model.text, measurement, gains
        self.build, self.size = KernelBuilder(), len(model.x)
        self.states = self.declare_states()
        self.declare_covariance()
        used = self.used()
        for one in self.text.inputs:
            if one.symbol in used:
                self.build.scalar(_signal(one))
        if measurement is not None:
            self.measured = self.build.scalar(
                replace(_signal(measurement), name="measured", elements=("measured",))
            )

    def time_update(self) -> Kernel:
        """Return the time update."""
        raise NotImplementedError

    def update(self) -> Kernel:
        """Return the update by the measurement."""
        raise NotImplementedError

    def used(self) -> set[sp.Symbol]:
        """Return the symbols in what the kernel computes."""
        if self.measurement is not None:
            return set(self.measurement.expression.free_symbols)
        return set(self.model.f.free_symbols | self.model.G.free_symbols)

    def declare_states(self) -> list[sp.Symbol]:
        """Declare the states, and return their symbols."""
        names = ", ".join(f"{one.name} in {one.unit}" for one in self.text.states)
        self.vector = Signal.labelled(
            "state", "X", (one.name for one in self.text.states), meaning=f"estimates of {names}"
        )
        return list(self.build.input(self.vector))

    def declare_covariance(self) -> None:
        """Declare the covariance, where there is one."""

    def declare_triangle(self, meaning: str, diagonal: str = "P") -> sp.Matrix:
        """Declare an upper triangle, and return its symbols in a matrix."""
        labels = [f"{i + 1}_{j + 1}" for i, j in triangle(self.size)]
        self.upper = Signal.labelled(
            "covariance", "P", labels, constraint="covariance", meaning=f"{meaning}, upper triangle by rows"
        )
        matrix = sp.zeros(self.size)
        for (i, j), element in zip(triangle(self.size), self.build.input(self.upper), strict=True):
            matrix[i, j] = element
        return matrix

    def named(self, name: str, expression: sp.Expr) -> sp.Expr:
        """Return an expression, as a quantity with a name if it is no number, symbol or negative of one."""
        if expression.is_number or expression.is_Symbol or (-expression).is_Symbol:
            return expression
        return self.build.value(name, expression)

    def named_all(self, name: str, matrix: sp.Matrix) -> sp.Matrix:
        """Return a matrix whose elements have names."""
        return sp.Matrix(
            *matrix.shape,
            [
                self.named(f"{name}_{i + 1}_{j + 1}", matrix[i, j])
                for i in range(matrix.rows)
                for j in range(matrix.cols)
            ],
        )

    def at(self, expression: sp.Expr) -> sp.Expr:
        """Return an expression in the symbols of the estimate."""
        return expression.xreplace(dict(zip(self.model.x, self.states, strict=True)))

    def discretize(self) -> None:
        """Name transition and noise of the step, and set the estimate after it."""
        model, T = self.model, exact(self.text.interval)
        self.gamma: sp.Matrix | None = None
        self.weights: list[sp.Expr] = []
        if model.is_constant:
            self.transition = model.transition
            moved = model.transition * sp.Matrix(self.states) + model.forcing * model.drift.applyfunc(self.at)
            self.after = list(moved)
            return
        F, G = (
            self.named_all(name, part.applyfunc(self.at)) for name, part in (("F", model.F), ("G", model.G))
        )
        terms = [sp.eye(self.size)]
        for j in range(1, model.order + 1):
            terms.append(self.named_all(f"F{j}", multiply(terms[-1], F * T / j)))
        self.transition = self.named_all("Phi", sum(terms[1:], terms[0]))
        self.gamma, self.weights = model.factors_of(
            [multiply(term, G) for term in terms[: model.noise_terms]]
        )
        self.gamma = self.named_all("Gamma", self.gamma)
        change = self.named_all("f1", model.f.applyfunc(self.at))
        total = change * T
        for j in range(1, model.order):
            change = self.named_all(f"f{j + 1}", multiply(F, change) * T / (j + 1))
            total += change * T
        self.after = [x + dx for x, dx in zip(self.states, total, strict=True)]

    def finish(self, kind: str, notes: Iterable[str] = ()) -> Kernel:
        """Return the kernel."""
        what = "time update" if self.measurement is None else f"update by {self.measurement.meaning}"
        name = "time" if self.measurement is None else self.measurement.name.replace("_", "-")
        return self.build.kernel(
            f"{self.text.name.replace('_', '-')}-{name}-update",
            f"{self.text.title}: {what}{kind}",
            _SOURCES[self.form],
            arguments=self.text.command,
            notes=tuple(notes),
        )

    def innovation(self) -> sp.Symbol:
        """Return the innovation, as an output."""
        assert self.measurement is not None
        meaning = f"{self.measurement.meaning} less what was expected"
        signal = Signal.scalar("innovation", unit=self.measurement.unit, meaning=meaning)
        return self.build.output(signal, [self.measured - self.at(self.measurement.expression)])[0]

    def row(self) -> list[sp.Expr]:
        """Return the derivatives of the measurement by the states."""
        assert self.measurement is not None
        place = self.text.measurements.index(self.measurement)
        return [self.named(f"h_{k + 1}", self.at(entry)) for k, entry in enumerate(self.model.H[place, :])]

    @property
    def variance(self) -> sp.Rational:
        """Variance of the noise of the measurement."""
        assert self.measurement is not None
        return exact(self.measurement.deviation**2)

    def corrected(self, gain: Sequence[sp.Expr], variance: sp.Expr, upper: sp.Matrix) -> Kernel:
        """Return the update of estimate and covariance."""
        assert self.measurement is not None
        innovation = self.innovation()
        meaning = "variance of the innovation"
        unit = self.measurement.unit
        squared = "1" if unit == "1" else f"({unit})^2"
        self.build.output(Signal.scalar("innovation_variance", unit=squared, meaning=meaning), [variance])
        self.build.feedback(self.vector, [x + k * innovation for x, k in zip(self.states, gain, strict=True)])
        self.build.feedback(self.upper, [upper[place] for place in triangle(self.size)])
        return self.finish(f", {self.form}")


class _Joseph(_Builder):
    """Covariance in Joseph's form."""

    form = "joseph"

    def declare_covariance(self) -> None:
        upper = self.declare_triangle("covariance")
        self.covariance = upper + upper.T - sp.diag(*upper.diagonal())

    def time_update(self) -> Kernel:
        """Return the time update, Phi P Phi' + Q."""
        self.discretize()
        half = self.named_all("A", multiply(self.transition, self.covariance))
        gamma = self.gamma
        Q = self.model.Q if gamma is None else multiply(gamma, sp.diag(*self.weights) * gamma.T)
        upper = sp.zeros(self.size)
        for i, j in triangle(self.size):
            upper[i, j] = dot(half[i, :], self.transition[j, :]) + Q[i, j]
        self.build.feedback(self.vector, self.after)
        self.build.feedback(self.upper, [upper[place] for place in triangle(self.size)])
        return self.finish(", covariance")

    def update(self) -> Kernel:
        """Return the update by a measurement."""
        h, P, R = self.row(), self.covariance, self.variance
        c = [self.named(f"c_{i + 1}", dot(P[i, :], h)) for i in range(self.size)]
        S = self.named("S", dot(c, h) + R)
        inverse = self.build.value("inverse_S", 1 / S)
        K = [self.named(f"K_{i + 1}", entry * inverse) for i, entry in enumerate(c)]
        A = sp.Matrix(self.size, self.size, lambda i, j: 0)
        for i in range(self.size):
            for j in range(self.size):
                if j >= i or h[j] != 0:
                    A[i, j] = self.named(f"A_{i + 1}_{j + 1}", P[i, j] - K[i] * c[j])
        b = [self.named(f"b_{i + 1}", dot(A[i, :], h) - R * K[i]) for i in range(self.size)]
        upper = sp.Matrix(self.size, self.size, lambda i, j: A[i, j] - b[i] * K[j] if j >= i else 0)
        return self.corrected(K, S, upper)


class _Factors(_Builder):
    """Covariance as U D U', D on the diagonal of the triangle."""

    form = "ud"

    def declare_covariance(self) -> None:
        upper = self.declare_triangle("factors U above the diagonal and D on it, of the covariance U D U'")
        self.D = list(upper.diagonal())
        self.U = upper - sp.diag(*self.D) + sp.eye(self.size)

    def time_update(self) -> Kernel:
        """Return the time update by weighted Gram-Schmidt orthogonalization."""
        self.discretize()
        gamma, weights = factors(self.model.Q) if self.gamma is None else (self.gamma, self.weights)
        product = sp.Matrix.hstack(self.named_all("W", multiply(self.transition, self.U)), gamma)
        rows = [list(product[i, :]) for i in range(self.size)]
        weights = [*self.D, *weights]
        upper = sp.zeros(self.size)
        for j in reversed(range(self.size)):
            weighted = [
                self.named(f"V_{j + 1}_{c + 1}", w * a)
                for c, (w, a) in enumerate(zip(weights, rows[j], strict=True))
            ]
            upper[j, j] = self.build.value(f"D_{j + 1}", dot(rows[j], weighted))
            inverse = self.build.value(f"inverse_D_{j + 1}", 1 / upper[j, j]) if j else None
            for i in range(j):
                upper[i, j] = self.named(f"U_{i + 1}_{j + 1}", dot(rows[i], weighted) * inverse)
                rows[i] = [
                    self.named(f"A_{i + 1}_{c + 1}_{j + 1}", a - upper[i, j] * b)
                    for c, (a, b) in enumerate(zip(rows[i], rows[j], strict=True))
                ]
        self.build.feedback(self.vector, self.after)
        self.build.feedback(self.upper, [upper[place] for place in triangle(self.size)])
        return self.finish(", ud")

    def update(self) -> Kernel:
        """Return Bierman's update by a measurement."""
        h, alpha = self.row(), self.variance
        b: list[sp.Expr] = [sp.S.Zero] * self.size
        upper = sp.zeros(self.size)
        for j in range(self.size):
            f = self.named(f"f_{j + 1}", dot(self.U[: j + 1, j], h[: j + 1]))
            upper[j, j] = self.D[j]
            for i in range(j):
                upper[i, j] = self.U[i, j]
            if f == 0:
                continue
            v = self.named(f"v_{j + 1}", self.D[j] * f)
            before, alpha = alpha, self.build.value(f"alpha_{j + 1}", alpha + f * v)
            upper[j, j] = self.D[j] * before / alpha
            slope = self.named(f"lambda_{j + 1}", -f / before) if any(b[:j]) else sp.S.Zero
            for i in range(j):
                upper[i, j] = self.U[i, j] + b[i] * slope
                b[i] = self.named(f"b_{i + 1}_{j + 1}", b[i] + self.U[i, j] * v)
            b[j] = v
        inverse = self.build.value("inverse_S", 1 / alpha)
        return self.corrected([entry * inverse for entry in b], alpha, upper)


class _Fixed(_Builder):
    """Gains that were computed before: constants, or inputs."""

    form = "fixed"

    def declare_states(self) -> list[sp.Symbol]:
        return [self.build.scalar(_signal(one)) for one in self.text.states]

    def time_update(self) -> Kernel:
        """Return the time update of the estimate."""
        self.discretize()
        return self._next(self.after)

    def update(self) -> Kernel:
        """Return the update by a measurement."""
        assert self.measurement is not None and self.gains is not None
        rows = self.gains[self.measurement.name]
        if len(rows) == 1:
            gain: list[sp.Expr] = [exact(number) for number in rows[0]]
        else:
            gain = [
                self.build.scalar(gain_signal(one, self.measurement, max(abs(row[k]) for row in rows)))
                for k, one in enumerate(self.text.states)
            ]
        innovation = self.innovation()
        return self._next([x + k * innovation for x, k in zip(self.states, gain, strict=True)])

    def _next(self, after: Sequence[sp.Expr]) -> Kernel:
        for one, expression in zip(self.text.states, after, strict=True):
            self.build.feedback(_signal(one), [expression])
        return self.finish(f", {self.text.kind} gains")


def gain_signal(state: Quantity, measurement: Quantity, largest: Fraction) -> Signal:
    """Return the signal of the gain from a measurement to a state."""
    unit = f"({state.unit})/({measurement.unit})"
    meaning = f"gain from {measurement.meaning} to {state.meaning}, a number of the schedule"
    return Signal.scalar(f"gain_{state.name}", unit=unit, meaning=meaning, bound=largest or Fraction(1))


def _signal(one: Quantity) -> Signal:
    return Signal.scalar(one.name, unit=one.unit, meaning=one.meaning, bound=one.range)


def dot(left: Iterable[sp.Expr], right: Iterable[sp.Expr]) -> sp.Expr:
    """Return a scalar product, not multiplied out."""
    return sp.Add(*(a * b for a, b in zip(left, right, strict=True) if a != 0 and b != 0))


def multiply(left: sp.Matrix, right: sp.Matrix) -> sp.Matrix:
    """Return a product of matrices, not multiplied out."""
    return sp.Matrix(left.rows, right.cols, lambda i, j: dot(left[i, :], right[:, j]))


def factors(Q: sp.Matrix) -> tuple[sp.Matrix, list[sp.Expr]]:
    """Return columns and weights of a positive semidefinite matrix of numbers, Q = sum of weight column column'."""
    rest, columns, weights = Q.copy(), [], []
    for j in reversed(range(Q.rows)):
        if rest[j, j] > 0:
            column = rest[:, j] / rest[j, j]
            columns.append(column)
            weights.append(rest[j, j])
            rest -= column * column.T * rest[j, j]
    return (sp.Matrix.hstack(*columns) if columns else sp.zeros(Q.rows, 0)), weights
