"""Change of velocity and of position over a step, from the attitude step of the same method.

Rigid motions are rotations in dual numbers a + b eps with eps^2 = 0 (Kotelnikov's principle of transference). Put
w + f eps in place of the body rate w, with the specific force f: the step that turned by p turns by p + q eps, and
v = 2 q p* is the integral of R f over the step, R the rotation since its beginning. So every method for the attitude
has one for the velocity, of its order, and no formula is derived a second time. In the rotation vector phi the dual
part is nu, the change of phi when the increments change by those of the velocity; then v = J(phi) nu with the left
Jacobian J(phi) nu = nu + (1 - cos x)/x^2 phi x nu + (x - sin x)/x^3 phi x (phi x nu), x = |phi|.

The position changes by the integral of (1 - t) R f times the step: it is the velocity for the force (1 - t) f, whose
samples are linear in those of f. A pair is right where rate and force have one frequency, as in sculling, and its
position is half its velocity, the integral for the middle of the step, and what is odd about the middle:
-a1/6 - c0 x (a0 + a1)/12 - c0 x (c0 x (a0/24 + a1/30)), of which c1 x a1/60 and higher coefficients are left out.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import sympy as sp

from strapgen.catalogue.kernels.attitude_step import Coefficients, chosen, smooth, unfiltered
from strapgen.catalogue.kinematics import EULER
from strapgen.catalogue.methods import polynomial_rotation, rotation_series, windowed
from strapgen.catalogue.methods.method import (
    Method,
    Samples,
    exponential,
    increments_signal,
    velocities_signal,
)
from strapgen.catalogue.methods.window import Window
from strapgen.catalogue.methods.windowed import DEGREE
from strapgen.ir.signals import Signal
from strapgen.kernel import algebra
from strapgen.kernel.algebra import cross, dot
from strapgen.kernel.derivatives import add_tangents
from strapgen.kernel.kernel import Kernel, KernelBuilder, symbols

#: Highest power of the rotation vector in the left Jacobian, and of the angles in a method's own exponentials.
SERIES = 12

#: Highest power of the step in the products of third and fourth order of a window; c_m counts as the power m + 1.
_POWER = 7

_MEANINGS = {
    "velocity": "velocity change over the step, body axes at its start: integral of the specific force there",
    "position": "position change over the step, divided by the step length, without that by the velocity at its start, "
    "body axes there",
}
#: The outputs, by what changes.
CHANGES = {
    part: Signal.vector(
        f"{part}_change", f"{part}_change", unit="m/s", meaning=meaning, frame="b", over="cycle"
    )
    for part, meaning in _MEANINGS.items()
}


def step(method: Method, increments: int, previous: int = 0, ahead: int = 0) -> Kernel:
    """Derive the change of velocity and position over a step, in m/s, body axes at its start.

    The position is divided by the step length. Gravity and the velocity before the step are in neither.
    """
    build = KernelBuilder()
    _, changes = changes_over_step(build, method, (increments, previous, ahead))
    for part, signal in CHANGES.items():
        build.output(signal, changes[part])
    suffix, option, source = chosen(method, increments, previous, ahead)
    order = method.step_order(increments, previous, ahead)
    return build.kernel(
        f"velocity-position-{suffix}",
        f"Velocity and position change of a step by {method.title} from {source}".replace(
            "angle ", "angle and velocity "
        ),
        f"{method.source}; velocity by transference: V. N. Branets, I. P. Shmyglevskii, Use of Quaternions in Problems "
        "of Orientation of Rigid Bodies (1973)",
        order=order,
        arguments=f"velocity-position {option}",
        previous=previous,
        ahead=ahead,
    )


def changes_over_step(
    build: KernelBuilder, method: Method, counts: tuple[int, int, int]
) -> tuple[StepRotation, dict[str, sp.Matrix]]:
    """Add stages for a step, and return its rotation and its changes by their names in `CHANGES`."""
    rate = _Rate(build, method, counts)
    turn = StepRotation(build, rate)
    known = add_tangents(build, turn.stages, rate.changes["velocity"](), "velocity", "m/s")
    changes = {"velocity": turn.velocity(known, "velocity")}
    if rate.coefficients:
        meaning = "velocity change over the step"
        signal = Signal.vector("pushed", "pushed", unit="m/s", meaning=meaning)
        changes["velocity"] = build.stage(signal, changes["velocity"])
        changes["position"] = _position_by_pair(build, rate.coefficients, known, changes["velocity"])
    else:
        known = add_tangents(build, turn.stages, rate.changes["position"](), "position", "m/s")
        changes["position"] = turn.velocity(known, "position")
    return turn, changes


def _position_by_pair(
    build: KernelBuilder,
    coefficients: tuple[sp.Matrix, ...],
    changes: dict[sp.Symbol, sp.Expr],
    velocity: sp.Matrix,
) -> sp.Matrix:
    """Return the position change from that of the velocity, the first two coefficients and the changes of all stages.

    Half the velocity change is the integral for the middle of the step; what is left is odd about the middle.
    """
    a0, a1 = (vector.applyfunc(changes.__getitem__) for vector in coefficients)
    c0 = coefficients[0]
    lever = build.stage(
        Signal.vector(
            "position_lever", "position_lever", unit="m/s", meaning="what c_0 is crossed with twice"
        ),
        a0 / 24 + a1 / 30,
    )
    return velocity / 2 - a1 / 6 - cross(c0, (a0 + a1) / 12 + cross(c0, lever))


class _Rate:
    """Samples of the body rate and of the specific force as a method takes them, for a window Legendre coefficients."""

    def __init__(self, build: KernelBuilder, method: Method, counts: tuple[int, int, int]) -> None:
        increments, previous, ahead = counts
        samples = Samples(build, increments, previous, method.nodes, ahead, method.fit)
        forces = build.input(velocities_signal(increments, previous, ahead))
        angles = symbols(increments_signal(increments, previous, ahead))
        changes: dict[sp.Symbol, sp.Expr] = dict(zip(angles, forces, strict=True))
        self.samples, self.method = samples, method
        self._vectors = [angles[k, :].T for k in range(angles.rows)]
        #: Of a pair, its c_0 and c_1
        self.coefficients: tuple[sp.Matrix, ...] = ()
        if method.window is not None and method.window.form == "pair":
            filtered = windowed.Filtered(build, samples, method.window)
            self.coefficients = filtered.coefficient(0), filtered.coefficient(1)
            changes = add_tangents(build, build.stages, changes, "velocity", "m/s")
            self.method = windowed.method(method.window, filtered)
        elif method.window is None:
            times = [Fraction(k, increments) for k in range(-previous, increments + ahead + 1)]
            remaining = samples.fit.times_remaining()
            self._weights = [remaining.integral(*ends) for ends in pairwise(times)]
        else:
            exact = method.window.rotation == "exact"
            degree = method.window.degree if exact else min(method.window.degree, DEGREE)
            filtered = windowed.Filtered(build, samples, method.window)
            self._vectors = [filtered.coefficient(m) for m in range(degree + 1)]
            changes = add_tangents(build, build.stages, changes, "velocity", "m/s")
            self.samples = Coefficients(build, self._vectors)
            self.method = _of_coefficients(method.window, degree)
            remaining = self.samples.fit.times_remaining()
            self._weights = [remaining.legendre(m) for m in range(degree + 1)]
        self._build, self._changes = build, changes
        self.changes = {"velocity": lambda: self._changes, "position": self._position}

    def _position(self) -> dict[sp.Symbol, sp.Expr]:
        """Add stages for the samples of the force times 1 - t, and return them as the changes of the samples."""
        changes: dict[sp.Symbol, sp.Expr] = {}
        forces = [vector.applyfunc(self._changes.__getitem__) for vector in self._vectors]
        for k, (vector, weights) in enumerate(zip(self._vectors, self._weights, strict=True)):
            total = sp.zeros(3, 1)
            for weight, force in zip(weights, forces, strict=True):
                total += weight * force
            name = f"remaining_{k}"
            meaning = f"sample {k} of the specific force times the part of the step that is to come"
            signal = Signal.vector(name, name, unit="m/s", meaning=meaning)
            changes |= dict(zip(vector, self._build.stage(signal, total), strict=True))
        return changes


def _of_coefficients(window: Window, degree: int) -> Method:
    """Return the method of a window after its filters.

    The lean form of the rotation vector leaves out products that a turn of the force makes felt before one of the rate
    does; here all of them are in it up to the power `_POWER` of the step.
    """
    if window.rotation == "exact":
        return windowed.method(replace(unfiltered(degree, window.terms), increments=window.increments))
    series = rotation_series.legendre_terms(degree + 1, 4)
    third, fourth = (
        {word: c for word, c in words.items() if sum(word) + len(word) <= _POWER} for words in series[2:]
    )
    terms = rotation_series.pairs(series[1]), third, fourth

    def rotation_vector(build: KernelBuilder, samples: Samples) -> sp.Matrix:
        return rotation_series.rotation_vector(
            build, polynomial_rotation.legendre_coefficients(samples), terms
        )

    return exponential(window.name, window.title, rotation_series.SOURCE, _POWER, rotation_vector)


class StepRotation:
    """The rotation over a step under construction, and the velocity that follows from its change."""

    def __init__(self, build: KernelBuilder, rate: _Rate) -> None:
        begin = len(build.stages)
        self._build = build
        self._by_vector = rate.method.rotation_vector is not None
        if rate.method.rotation_vector is not None:
            self.vector = rate.method.rotation_vector(build, rate.samples)
        else:
            self.vector = build.stage(
                EULER.transition, rate.method.transition(build, smooth(build, EULER, SERIES), rate.samples)
            )
        self.stages = tuple(build.stages[begin:])
        if self._by_vector:
            self.square = square = build.value(
                "turn_square", dot(self.vector, self.vector), "square of the angle of the step"
            )
            self.first = build.value("jacobian_1", algebra.wave_series(square, 2, SERIES), "(1 - cos x)/x^2")
            self.second = build.value("jacobian_2", algebra.wave_series(square, 3, SERIES), "(x - sin x)/x^3")

    def velocity(self, changes: dict[sp.Symbol, sp.Expr], name: str) -> sp.Matrix:
        """Return the velocity of a step from the changes of its rotation."""
        dual = self.vector.applyfunc(changes.__getitem__)
        if not self._by_vector:
            conjugate = algebra.quaternion_conjugate(self.vector)
            return 2 * algebra.quaternion_product(dual, conjugate)[:3, :]
        crossed = self._build.stage(
            Signal.vector(
                f"{name}_cross", f"{name}_cross", unit="m/s", meaning=f"phi x change of phi, {name}"
            ),
            cross(self.vector, dual),
        )
        return dual + self.first * crossed + self.second * cross(self.vector, crossed)
