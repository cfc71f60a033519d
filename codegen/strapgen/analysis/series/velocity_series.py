"""The error of the velocity and position change of a step as power series in the step length, for any smooth motion.

The rate is w(t) = w0 + w1 t + w2 t^2/2 + ... and the specific force f(t) = f0 + f1 t + f2 t^2/2 + ..., both in body
axes. Their increments are exact, and so are the true changes: the integral of R f, where dR/dt = R skew(w).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, ClassVar, NamedTuple

import sympy as sp

from strapgen import pipeline
from strapgen.analysis.series import invariants
from strapgen.analysis.series.invariants import LATEX, TEXT, covariant_text, with_forces
from strapgen.analysis.series.motion_rates import in_powers_of_the_step
from strapgen.catalogue import AnyAlgorithm
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import notebook_latex, short_repr
from strapgen.ir.read_only import ReadOnly
from strapgen.kernel import power_series, reading
from strapgen.kernel.algebra import exact
from strapgen.kernel.covariants import Coefficients, Frame
from strapgen.kernel.kernel import Kernel
from strapgen.kernel.power_series import Powers, outputs
from strapgen.lab import one_step, sampled_motion
from strapgen.results.display.latex import equations
from strapgen.results.records import entry, plain_record
from strapgen.results.result import Result

#: The parts of a series, which are the outputs of a kernel by what changes.
PARTS = ("velocity", "position")
#: Most terms of a series: the number of products grows fast.
MOST_TERMS = 3
#: The last power that is looked at where a kernel does not say its order.
_MOST_POWER = 8


@dataclass(frozen=True)
class VelocitySeries(ReadOnly):
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
    parts : tuple of str, optional
        What the kernel computes, of `PARTS`; the terms of another part are empty.
    unknowns : tuple of str, optional
        Coefficients of the kernel that are not known: all terms are polynomials in them.

    Examples
    --------
    >>> from strapgen import choose, unknowns
    >>> unknowns.velocity_series(choose("velocity-position", "magnus2", 1)).order
    2
    """

    kernel: str
    velocity: Mapping[int, Coefficients]
    position: Mapping[int, Coefficients]
    known: int
    parts: tuple[str, ...] = PARTS
    unknowns: tuple[str, ...] = ()

    __repr__ = short_repr
    _repr_latex_ = notebook_latex

    def _in_words(self) -> str:
        order = "no error" if self.order is None else f"order {self.order}"
        return f"of {self.kernel}: {order}, known to h^{self.known}"

    @property
    def order(self) -> int | None:
        """One less than the first power of the error of the velocity, or else the position; None without an error."""
        first = self.coefficients(self.parts[0])
        return min(first) - 1 if first else None

    def coefficients(self, part: str) -> Mapping[int, Coefficients]:
        """Return the terms of "velocity" or "position"."""
        rows: Mapping[int, Coefficients] = getattr(self, part)
        return rows

    def as_dict(self) -> dict[str, Any]:
        """Return the series as plain JSON data."""
        return plain_record(VelocityTerms.of(self))

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> VelocitySeries:
        """Rebuild a series from `as_dict`, with its unknowns as symbols.

        Raises
        ------
        InputError
            If a text is no expression.
        """
        unknowns = tuple(data.get("unknowns", ()))
        parts = {
            part: {int(power): _of_terms(one, unknowns) for power, one in rows.items()}
            for part, rows in data["terms"].items()
        }
        velocity, position = (parts.get(part, {}) for part in PARTS)
        return cls(data["kernel"], velocity, position, data["known_to_power"], tuple(parts), unknowns)


class _Term(NamedTuple):
    """A term of an error: numbers of vectors, the scalar products that stand before them, and a number."""

    vectors: list[int]
    products: list[list[int]]
    number: str


@dataclass(frozen=True)
class VelocityTerms:
    """The errors of a step of velocity and position by power of its length, as text and as terms."""

    kernel: str
    motion: str
    order: int | None
    #: Error of the velocity change by power of the step
    velocity: dict[str, str] | None = field(metadata=entry(optional=True))
    #: Error of the position change, divided by the step, by power of the step
    position: dict[str, str] | None = field(metadata=entry(optional=True))
    #: The last power of the step that was derived
    known_to_power: int
    #: The terms of velocity and position by power of the step
    terms: dict[str, dict[str, list[_Term]]]
    #: Coefficients of the kernel that are not known
    unknowns: tuple[str, ...] | None = field(metadata=entry(optional=True))

    @staticmethod
    def of(series: VelocitySeries) -> VelocityTerms:
        """Return a series as text and terms."""
        notation = with_forces(TEXT, series.known)
        rows = {part: series.coefficients(part) for part in series.parts}
        texts = {
            part: {str(power): covariant_text(one, notation=notation) for power, one in row.items()}
            for part, row in rows.items()
        }
        terms = {
            part: {str(power): _as_terms(one) for power, one in row.items()} for part, row in rows.items()
        }
        both = (texts.get("velocity"), texts.get("position"))
        facts = (series.kernel, "general", series.order)
        return VelocityTerms(*facts, *both, series.known, terms, series.unknowns or None)


def _as_terms(coefficients: Coefficients) -> list[_Term]:
    return [
        _Term([*covariant], [[*product] for product in monomial], sp.sstr(exact(number)))
        for covariant, polynomial in coefficients.items()
        for monomial, number in polynomial.items()
    ]


def _of_terms(terms: Sequence[Mapping[str, Any]], unknowns: Sequence[str]) -> Coefficients:
    symbols = {name: sp.Symbol(name, real=True) for name in unknowns}
    coefficients: Coefficients = {}
    for term in terms:
        value = reading.expression("number", term["number"], symbols)
        number = Fraction(int(value.p), int(value.q)) if value.is_Rational else value
        monomial = tuple(tuple(product) for product in term["products"])
        coefficients.setdefault(tuple(term["vectors"]), {})[monomial] = number
    return coefficients


def series(choice: AnyAlgorithm, terms: int = 1) -> VelocitySeries:
    """Derive the error of the velocity and position change of a step.

    Parameters
    ----------
    choice : Choice or str
        The kernel "velocity-position" by any method, or a user's step of velocity and position.
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
    terms = checks.count("terms", terms, largest=MOST_TERMS)
    kernel = pipeline.derive(choice)
    if not kernel.takes_velocity:
        raise InputError(
            "a series of velocity and position needs the kernel velocity-position, or one like it"
        )
    top = 1 + (kernel.order.step if kernel.order else 0) + terms
    most = top + one_step.PATIENCE if kernel.order else _MOST_POWER
    with in_powers_of_the_step(kernel.name):
        while True:
            candidate = _series(kernel, terms, top)
            if top >= most or all(len(candidate.coefficients(part)) >= terms for part in candidate.parts):
                return candidate
            top += 1


def parts_of(kernel: Kernel) -> tuple[str, ...]:
    """Return which of `PARTS` a kernel computes."""
    names = {stage.signal.name for stage in kernel.outputs}
    return tuple(part for part in PARTS if f"{part}_change" in names)


def shares(kernel: Kernel, terms: int) -> list[list[sp.Expr]]:
    """Return the share of t^j/j! in each sample of a kernel, as a multiple of the (j + 1)-th power of the step."""
    count = kernel.inputs[0].shape[0] - kernel.previous - kernel.ahead
    intervals = range(-kernel.previous, count + kernel.ahead)
    return [sampled_motion.increment_shares(k, count, terms) for k in intervals]


def errors(kernel: Kernel, ring: Any, motion: Sequence[Any], top: int) -> dict[str, list[Powers]]:
    """Return the errors of the velocity and position change up to a power of the step."""
    rate, force = motion
    values: dict[str, Any] = {}
    for signal, vectors in zip(kernel.inputs, (rate, force), strict=True):
        elements = sampled_motion.elements(ring, vectors, shares(kernel, len(vectors)), top)
        values |= zip(signal.elements, elements, strict=True)
    computed = outputs(kernel, values, ring, top)
    true = true_changes(ring, rate, force, top)
    return {
        part: [a - b for a, b in zip(computed[f"{part}_change"], true[part], strict=True)]
        for part in parts_of(kernel)
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
                        share = ring.domain.from_sympy(share_of_change(part, n, j))
                        term = element * vector[k] * share
                        total[power] = total.get(power, ring.zero) + term
            rows.append(Powers(ring, total, top))
        changes[part] = rows
    return changes


def share_of_change(part: str, n: int, j: int) -> sp.Expr:
    """Return the integral over a step of length 1 of t^n t^j/j!, and for the position of that times 1 - t."""
    power = n + j + 1
    share = sp.Rational(1, power) if part == "velocity" else sp.Rational(1, power * (power + 1))
    return share / sp.factorial(j)


def domain(kernel: Kernel) -> Any:
    """Return the smallest domain that holds the numbers of a kernel and polynomials in its unknowns."""
    expressions = [x for stage in (*kernel.stages, *kernel.outputs) for x in stage.expressions]
    return power_series.field(expressions, kernel.unknowns)


def coefficients(kernel: Kernel, top: int, terms: int | None = None) -> dict[str, dict[int, Coefficients]]:
    """Return the errors for any smooth motion by part and power, in vector-invariant form."""
    frame = Frame(2 * top)
    ring = frame.ring.clone(domain=domain(kernel))
    vectors = [[element.set_ring(ring) for element in vector] for vector in frame.vectors]
    parts: dict[str, dict[int, Coefficients]] = {}
    for part, elements in errors(kernel, ring, (vectors[:top], vectors[top:]), top).items():
        powers = sorted({power for element in elements for power in element.parts})[:terms]
        parts[part] = {
            power: invariants.vector_invariants(frame, [x.parts.get(power, ring.zero) for x in elements])
            for power in powers
        }
    return parts


def _series(kernel: Kernel, terms: int, top: int) -> VelocitySeries:
    """Derive the series up to a power, in the rotated frame of the vectors."""
    parts = coefficients(kernel, top, terms)
    velocity, position = (parts.get(part, {}) for part in PARTS)
    return VelocitySeries(kernel.name, velocity, position, top, parts_of(kernel), kernel.unknowns)


#: Names of the errors in LaTeX.
_SYMBOLS = {"velocity": r"\delta\mathbf{v}", "position": r"\delta\mathbf{r}/h"}


@dataclass(frozen=True)
class VelocitySeriesResult(Result):
    """The errors of one step of velocity and position, as power series in its length."""

    each: ClassVar[type | None] = VelocityTerms

    several: Sequence[VelocitySeries]

    def results(self) -> Sequence[VelocityTerms]:
        """Return the series as text and terms."""
        return [VelocityTerms.of(one) for one in self.several]

    def text(self) -> str:
        """Return the series one after the other."""
        return "\n\n".join(map(_text, self.several))

    def latex(self) -> str:
        """Return the series as align environments."""
        return "\n\n".join(map(velocity_series_latex, self.several))


def _text(series: VelocitySeries) -> str:
    lines = [f"{series.kernel}, any motion: what one step of length h loses, computed less true"]
    if series.order is None:
        return "\n".join([*lines, f"nothing in the {series.parts[0]}, to the power {series.known} of h"])
    lines += [
        f"order {series.order} in the {series.parts[0]}; terms to the power {series.known} of h were looked at",
        "w0, w1, ... : the rate and its derivatives; f0, f1, ... : the specific force and its derivatives",
    ]
    notation = with_forces(TEXT, series.known)
    for part in series.parts:
        title = "velocity" if part == "velocity" else "position/h"
        for power, one in series.coefficients(part).items():
            lines += ["", f"h^{power}  {title:10}  {covariant_text(one, notation=notation)}"]
    return "\n".join(lines)


def velocity_series_latex(series: VelocitySeries) -> str:
    """Return the errors of a step as one align environment."""
    notation = with_forces(LATEX, series.known, r"\mathbf{{f}}_{{{}}}".format)
    rows = [
        (rf"h^{{{power}}}\!:\ {_SYMBOLS[part]}", covariant_text(one, notation=notation))
        for part in series.parts
        for power, one in series.coefficients(part).items()
    ]
    return equations(rows)
