"""Kernels of a filter: the time update, and a scalar update for each measurement.

Online gains take the covariance: in Joseph's form P + is (I - K h) P (I - K h)' + K R K'; as factors U D U' the time
update is Thornton's weighted Gram-Schmidt orthogonalization, and the measurement update that of Bierman. Fixed gains
take a scalar for each state, so that each has a format of its own in fixed point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

import sympy as sp

from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import exact
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.kalman.kalman_file import Quantity
from strapgen.navigation.kalman.kalman_model import FilterModel, Step, dot, multiply

_SOURCES = {
    "joseph": "P. S. Maybeck, Stochastic Models, Estimation and Control 1 (1979), Joseph's form",
    "ud": "G. J. Bierman, Factorization Methods for Discrete Sequential Estimation (1977); C. L. Thornton (1976)",
    "fixed": "R. E. Kalman, A New Approach to Linear Filtering and Prediction Problems (1960); gains computed before",
}


#: Part of the noise of a state below which it is that of others alone.
_RANK = sp.Rational(1, 10**40)


def kernels(model: FilterModel, gains: Mapping[str, Sequence[Sequence[Fraction]]] | None) -> list[Kernel]:
    """Return the kernels of a filter, the time update first; without `gains` its covariance is computed online.

    `gains`: rows of gains by the measurement; a single row is a constant of the code.
    """
    form = "fixed" if gains is not None else model.text.form
    builders: dict[str, type[_Builder]] = {"joseph": _Joseph, "ud": _Factors, "fixed": _Fixed}
    build = builders[form]
    updates = [build(model, one, gains).update() for one in model.text.measurements]
    return [build(model, None, gains).time_update(), *updates]


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

    def declare_triangle(self, meaning: str) -> sp.Matrix:
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
        return sp.Matrix(*matrix.shape, lambda i, j: self.named(f"{name}_{i + 1}_{j + 1}", matrix[i, j]))

    def at(self, expression: sp.Expr) -> sp.Expr:
        """Return an expression in the symbols of the estimate."""
        return expression.xreplace(dict(zip(self.model.x, self.states, strict=True)))

    def discretize(self) -> Step | None:
        """Set the estimate after the step; return transition and noise where they are not constant."""
        model, T = self.model, exact(self.text.interval)
        if model.is_constant:
            drift = model.forcing * model.drift.applyfunc(self.at)
            self.after = list(model.transition * sp.Matrix(self.states) + drift)
            return None
        F, G = (self.named_all(name, getattr(model, name).applyfunc(self.at)) for name in "FG")
        step = model.discretized(F, G, self.named_all)
        change = self.named_all("f1", model.f.applyfunc(self.at))
        total = change * T
        for j in range(1, model.order):
            change = self.named_all(f"f{j + 1}", multiply(F, change) * T / (j + 1))
            total += change * T
        self.after = [x + dx for x, dx in zip(self.states, total, strict=True)]
        return step

    def finish(self, kind: str) -> Kernel:
        """Return the kernel."""
        what = "time update" if self.measurement is None else f"update by {self.measurement.meaning}"
        name = "time" if self.measurement is None else self.measurement.name.replace("_", "-")
        return self.build.kernel(
            f"{self.text.name.replace('_', '-')}-{name}-update",
            f"{self.text.title}: {what}{kind}",
            _SOURCES[self.form],
            arguments=self.text.command,
        )

    def moved(self, upper: sp.Matrix) -> Kernel:
        """Return the change of estimate and covariance."""
        self.build.feedback(self.vector, self.after)
        self.build.feedback(self.upper, [upper[place] for place in triangle(self.size)])
        return self.finish(f", {self.form}")

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
        unit = "1" if self.measurement.unit == "1" else f"({self.measurement.unit})^2"
        signal = Signal.scalar("innovation_variance", unit=unit, meaning="variance of the innovation")
        self.build.output(signal, [variance])
        self.after = [x + k * innovation for x, k in zip(self.states, gain, strict=True)]
        return self.moved(upper)


class _Joseph(_Builder):
    """Covariance in Joseph's form."""

    form = "joseph"

    def declare_covariance(self) -> None:
        upper = self.declare_triangle("covariance")
        self.covariance = upper + upper.T - sp.diag(*upper.diagonal())

    def time_update(self) -> Kernel:
        """Return the time update, Phi P Phi' + Q."""
        step, model = self.discretize(), self.model
        transition = step.transition if step else model.transition
        Q = multiply(step.gamma, sp.diag(*step.weights) * step.gamma.T) if step else model.Q
        half = self.named_all("A", multiply(transition, self.covariance))
        upper = sp.zeros(self.size)
        for i, j in triangle(self.size):
            upper[i, j] = dot(half[i, :], transition[j, :]) + Q[i, j]
        return self.moved(upper)

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


#: What a smaller element of D counts as where a column is divided by it: that of a state that decays becomes zero.
LEAST_D = sp.Rational(1, 1 << 120)


class _Factors(_Builder):
    """Covariance as U D U', D on the diagonal of the triangle."""

    form = "ud"

    def declare_covariance(self) -> None:
        upper = self.declare_triangle("factors U above the diagonal and D on it, of the covariance U D U'")
        self.D = list(upper.diagonal())
        self.U = upper - sp.diag(*self.D) + sp.eye(self.size)

    def time_update(self) -> Kernel:
        """Return the time update by weighted Gram-Schmidt orthogonalization."""
        step = self.discretize()
        gamma, weights = (step.gamma, step.weights) if step else factors(self.model.Q)
        transition = step.transition if step else self.model.transition
        product = sp.Matrix.hstack(self.named_all("W", multiply(transition, self.U)), gamma)
        rows = [list(product[i, :]) for i in range(self.size)]
        weights = [*self.D, *weights]
        upper = sp.zeros(self.size)
        for j in reversed(range(self.size)):
            weighted = [
                self.named(f"V_{j + 1}_{c + 1}", w * a)
                for c, (w, a) in enumerate(zip(weights, rows[j], strict=True))
            ]
            upper[j, j] = self.build.value(f"D_{j + 1}", dot(rows[j], weighted))
            if j:
                limited = self.build.value(f"limited_D_{j + 1}", sp.Max(upper[j, j], LEAST_D))
                inverse = self.build.value(f"inverse_D_{j + 1}", 1 / limited)
            for i in range(j):
                upper[i, j] = self.named(f"U_{i + 1}_{j + 1}", dot(rows[i], weighted) * inverse)
                rows[i] = [
                    self.named(f"A_{i + 1}_{c + 1}_{j + 1}", a - upper[i, j] * b)
                    for c, (a, b) in enumerate(zip(rows[i], rows[j], strict=True))
                ]
        return self.moved(upper)

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
        gain: list[sp.Expr] = [exact(number) for number in rows[0]]
        if self.text.kind == "scheduled":
            gain = [self.build.scalar(self._gain(k, rows)) for k in range(self.size)]
        innovation = self.innovation()
        return self._next([x + k * innovation for x, k in zip(self.states, gain, strict=True)])

    def _gain(self, place: int, rows: Sequence[Sequence[Fraction]]) -> Signal:
        """Return the signal of the gain of a state, by its place."""
        one, measurement = self.text.states[place], self.measurement
        assert measurement is not None
        largest = max(abs(row[place]) for row in rows) or Fraction(1)
        meaning = f"gain from {measurement.meaning} to {one.meaning}, of the schedule"
        unit = f"({one.unit})/({measurement.unit})"
        return Signal.scalar(f"gain_{one.name}", unit=unit, meaning=meaning, bound=largest)

    def _next(self, after: Sequence[sp.Expr]) -> Kernel:
        for one, expression in zip(self.text.states, after, strict=True):
            self.build.feedback(_signal(one), [expression])
        return self.finish(f", {self.text.kind} gains")


def _signal(one: Quantity) -> Signal:
    return Signal.scalar(one.name, unit=one.unit, meaning=one.meaning, bound=one.range)


def factors(Q: sp.Matrix) -> tuple[sp.Matrix, list[sp.Expr]]:
    """Return columns and weights of a positive semidefinite matrix of numbers, Q = sum of weight column column'."""
    rest, columns, weights = Q.copy(), [], []
    for j in reversed(range(Q.rows)):
        if rest[j, j] > Q[j, j] * _RANK:
            column = rest[:, j] / rest[j, j]
            columns.append(column)
            weights.append(rest[j, j])
            rest -= column * column.T * rest[j, j]
    return (sp.Matrix.hstack(*columns) if columns else sp.zeros(Q.rows, 0)), weights
