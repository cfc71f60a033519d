"""The error of the velocity and position change of a step as power series in the step length, for any smooth motion.

The rate is w(t) = w0 + w1 t + w2 t^2/2 + ... and the specific force f(t) = f0 + f1 t + f2 t^2/2 + ..., both in body
axes. Their increments are exact, and so are the true changes: the integral of R f, where dR/dt = R skew(w).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from strapgen import pipeline
from strapgen.analysis import invariants, one_step
from strapgen.analysis.notation import TEXT, covariant_text, with_forces
from strapgen.catalogue import Choice
from strapgen.support import checks
from strapgen.support.exceptions import InputError
from strapgen.symbolic.covariants import Coefficients, Frame
from strapgen.symbolic.kernel import Kernel
from strapgen.symbolic.power_series import Powers, field, outputs

#: The name of the kernels in the catalogue, and the parts of a series.
NAME = "velocity-position"
PARTS = ("velocity", "position")
#: Most terms of a series: the number of products grows fast.
MOST_TERMS = 3


@dataclass(frozen=True)
class VelocitySeries:
    """The error of one step, computed less true change.

    Parameters
    ----------
    kernel : str
    velocity, position : dict of int to Coefficients
        The first terms that are not zero, by power of the step: of the velocity change, and of the position change
        divided by the step length. The vector i is the i-th derivative of the rate, and the vector `known` + i that of
        the specific force.
    known : int
        The last power of the step that was derived.
    """

    kernel: str
    velocity: dict[int, Coefficients]
    position: dict[int, Coefficients]
    known: int

    @property
    def order(self) -> int | None:
        """One less than the first power of the error of the velocity; None if there is no error."""
        return min(self.velocity) - 1 if self.velocity else None

    def coefficients(self, part: str) -> dict[int, Coefficients]:
        """Return the terms of "velocity" or "position"."""
        rows: dict[int, Coefficients] = getattr(self, part)
        return rows

    def as_dict(self) -> dict[str, Any]:
        """Return the series as plain JSON data."""
        notation = with_forces(TEXT, self.known)
        data: dict[str, Any] = {"kernel": self.kernel, "motion": "general", "order": self.order}
        for part in PARTS:
            data[part] = {
                str(power): covariant_text(one, notation=notation)
                for power, one in self.coefficients(part).items()
            }
        return data | {"known_to_power": self.known}


def series(choice: Choice, terms: int = 1) -> VelocitySeries:
    """Derive the error of the velocity and position change of a step.

    Parameters
    ----------
    choice : Choice
        A kernel "velocity-position", by any method.
    terms : int, optional
        Number of terms of each, counted from its first one that is not zero.

    Returns
    -------
    VelocitySeries

    Raises
    ------
    InputError
        If the kernel is another one, or a number is not allowed.

    Examples
    --------
    >>> from strapgen import choose
    >>> one = series(choose("velocity-position", "magnus2", 1))
    >>> one.order, one.as_dict()["velocity"]["3"]
    (2, '-1/12 w0 x f1 + 1/12 w1 x f0')
    """
    checks.count("terms", terms, largest=MOST_TERMS)
    if not isinstance(choice, Choice) or choice.name != NAME:
        raise InputError(f"a series of velocity and position needs the kernel {NAME}")
    kernel = pipeline.derive(choice)
    top = 1 + (kernel.order.step if kernel.order else 0) + terms
    most = top + one_step.PATIENCE
    while True:
        candidate = _series(choice, kernel, terms, top)
        rows = [candidate.velocity, candidate.position]
        if top >= most or all(len(row) >= terms for row in rows):
            return candidate
        top += 1


def errors(
    choice: Choice, kernel: Kernel, ring: Any, motion: Sequence[Any], top: int
) -> dict[str, list[Powers]]:
    """Return the errors of the velocity and position change up to a power of the step.

    Parameters
    ----------
    choice : Choice
    kernel : Kernel
    ring : PolyRing
        Ring of the coefficients, over the field of the kernel.
    motion : sequence of two sequences
        The rate and its derivatives, and the specific force and its derivatives, at the beginning of the step.
    top : int
        The last power of the series.
    """
    rate, force = motion
    count = choice.increments_per_step
    intervals = range(-choice.previous, count + choice.ahead)
    values: dict[str, Any] = {}
    for signal, vectors in zip(kernel.inputs, (rate, force), strict=True):
        elements = one_step.increments(ring, vectors, count, intervals, top)
        values |= zip(signal.elements, elements, strict=True)
    computed = outputs(kernel, values, ring, top)
    true = true_changes(ring, rate, force, top)
    return {
        part: [a - b for a, b in zip(computed[f"{part}_change"], true[part], strict=True)] for part in PARTS
    }


def true_changes(ring: Any, rate: Sequence[Any], force: Sequence[Any], top: int) -> dict[str, list[Powers]]:
    """Return the true changes of a step: the integrals of R f and of (1 - t) R f.

    Parameters and powers are those of `errors`.
    """
    turned = one_step.true_matrix(ring, rate, top)
    changes: dict[str, list[Powers]] = {}
    for part in PARTS:
        rows = []
        for i in range(3):
            total: dict[int, Any] = {}
            for j, vector in enumerate(force):
                for k in range(3):
                    for n, element in turned[3 * i + k].parts.items():
                        power = n + j + 1
                        share = sp.Rational(1, power)
                        share = (
                            share if part == "velocity" else share - sp.Rational(1, power + 1)
                        ) / sp.factorial(j)
                        term = element * vector[k] * ring.domain.from_sympy(share)
                        total[power] = total.get(power, ring.zero) + term
            rows.append(Powers(ring, total, top))
        changes[part] = rows
    return changes


def _series(choice: Choice, kernel: Kernel, terms: int, top: int) -> VelocitySeries:
    """Derive the series up to a power, in the rotated frame of the vectors."""
    frame = Frame(2 * top)
    expressions = [x for stage in (*kernel.stages, *kernel.outputs) for x in stage.expressions]
    ring = frame.ring.clone(domain=field(expressions))
    vectors = [[element.set_ring(ring) for element in vector] for vector in frame.vectors]
    parts: dict[str, dict[int, Coefficients]] = {}
    for part, elements in errors(choice, kernel, ring, (vectors[:top], vectors[top:]), top).items():
        powers = sorted({power for element in elements for power in element.parts})[:terms]
        parts[part] = {
            power: invariants.vector(frame, [x.parts.get(power, ring.zero) for x in elements])
            for power in powers
        }
    return VelocitySeries(kernel.name, parts["velocity"], parts["position"], top)
