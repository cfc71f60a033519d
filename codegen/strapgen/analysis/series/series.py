"""Truncation-error series: the error of one step as a power series in the step length h.

Series exist for a general smooth rate, whose derivatives at the beginning of the step are w0, w1, ..., and for the
motions of the catalogue in the symbols of their parameters, where t is the time at the beginning of the step.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

import sympy as sp

from strapgen import catalogue, pipeline
from strapgen.analysis.series import motion_rates
from strapgen.analysis.series.invariants import Invariants, covariant_text, invariants, matrix, vector_texts
from strapgen.analysis.series.motion_rates import in_powers_of_the_step
from strapgen.catalogue import AnyAlgorithm
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import notebook_latex, short_repr
from strapgen.ir.read_only import ReadOnly
from strapgen.kernel import reading
from strapgen.kernel.power_series import Powers, outputs
from strapgen.lab import one_step
from strapgen.lab.motions.motion_names import is_file
from strapgen.lab.one_step import Step, errors
from strapgen.results.records import Properties, Record, entry, properties

#: Motions for which a series can be derived.
MOTIONS = ("general", *catalogue.MOTIONS)
#: Most terms of a series.
MOST_TERMS = 6
#: The step length.
STEP = sp.Symbol("h")
#: Parts of an error matrix.
PARTS = ("drift", "scale", "skew")
#: Coefficients of a vector or of three numbers, by power of the step.
Row = tuple[sp.Expr, sp.Expr, sp.Expr]
Coefficients = Mapping[int, Row]


def _sums(terms: Coefficients) -> list[str]:
    return vector_texts(terms, STEP)


class _Invariant(NamedTuple):
    """Terms of one power of the step in vectors."""

    drift: str
    scale_and_skew: str


def _invariant(terms: Mapping[int, Invariants]) -> dict[int, _Invariant] | None:
    """Return the terms as text; None without any."""
    texts = {
        power: _Invariant(covariant_text(one.drift), covariant_text(one.symmetric, symmetric=True))
        for power, one in terms.items()
    }
    return texts or None


def _or_none(names: Sequence[str]) -> Sequence[str] | None:
    return names or None


@dataclass(frozen=True)
class ErrorSeries(ReadOnly, Record):
    """The error of one step.

    Parameters
    ----------
    kernel, motion : str
    drift, scale, skew : dict of int to tuple of Expr
        The first terms that are not zero, three coefficients for each power of the step; scale dimensionless, skew and
        drift in rad. A dict is empty if all terms up to the power `known` are zero.
    known : int
        The last power of the step that was derived.
    invariant : dict of int to Invariants
        For a general rate the same powers in vector-invariant form.
    unknowns : tuple of str
        Coefficients of the kernel that are not known: all terms are polynomials in them.

    Examples
    --------
    >>> from strapgen import algorithm
    >>> error = algorithm("euler", "rk4", increments=2).series("constant", terms=1).step
    >>> error.order, list(error.drift), list(error.scale)
    (4, [5], [6])
    """

    computed: ClassVar[Properties] = properties(order=entry())

    kernel: str
    motion: str
    drift: Coefficients = field(metadata=entry(write=_sums, kind=list[str]))
    scale: Coefficients = field(metadata=entry(write=_sums, kind=list[str]))
    skew: Coefficients = field(metadata=entry(write=_sums, kind=list[str]))
    known: int = field(metadata=entry(key="known_to_power"))
    invariant: Mapping[int, Invariants] = field(
        default_factory=dict, metadata=entry(optional=True, write=_invariant, kind=dict[str, _Invariant])
    )
    unknowns: tuple[str, ...] = field(default=(), metadata=entry(optional=True, write=_or_none))

    __repr__ = short_repr
    _repr_latex_ = notebook_latex

    def _in_words(self) -> str:
        order = "no error" if self.order is None else f"order {self.order}"
        rows = {part: ", ".join(f"h^{power}" for power in self.coefficients(part)) for part in PARTS}
        powers = "; ".join(f"{part} {text}" for part, text in rows.items() if text)
        return f"of {self.kernel}, {self.motion} motion: {order}, known to h^{self.known}\n{powers}"

    @property
    def order(self) -> int | None:
        """Order of the step on this motion, one less than the first power of its error; None if there is no error."""
        powers = [*self.drift, *self.scale, *self.skew]
        return min(powers) - 1 if powers else None

    def coefficients(self, part: str) -> Coefficients:
        """Return the coefficients of "drift", "scale" or "skew"."""
        rows: Coefficients = getattr(self, part)
        return rows

    def expressions(self, part: str) -> list[sp.Expr]:
        """Return the three sums of terms of "drift", "scale" or "skew"."""
        rows = self.coefficients(part).items()
        return [sp.Add(*(row[axis] * STEP**power for power, row in rows)) for axis in range(3)]

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> ErrorSeries:
        """Rebuild a series from `as_dict`, with its unknowns as symbols; its vector-invariant form is left out.

        Raises
        ------
        InputError
            If a text is no expression.
        """
        unknowns = tuple(data.get("unknowns", ()))
        drift, scale, skew = (_read(part, data[part], unknowns) for part in PARTS)
        return cls(data["kernel"], data["motion"], drift, scale, skew, data["known_to_power"], {}, unknowns)


def _read(part: str, texts: Sequence[str], unknowns: Sequence[str]) -> Coefficients:
    """Return the coefficients that three sums hold, by power of the step."""
    names = {name for text in texts for name in re.findall(r"[A-Za-z_]\w*", text)}
    symbols = {name: sp.Symbol(name, real=True if name in unknowns else None) for name in names}
    rows: dict[int, list[sp.Expr]] = {}
    for axis, text in enumerate(texts):
        for term in sp.Add.make_args(reading.expression(part, text, symbols)):
            if term != 0:
                coefficient, (_, power) = term.as_independent(STEP)[0], term.as_coeff_exponent(STEP)
                row = rows.setdefault(int(power), [sp.S.Zero] * 3)
                row[axis] += coefficient
    return {power: (row[0], row[1], row[2]) for power, row in sorted(rows.items())}


def series(choice: AnyAlgorithm, motion: str = "general", terms: int = 2) -> ErrorSeries:
    """Derive the series of the error of a step.

    Parameters
    ----------
    choice : Choice, AttitudeAlgorithm or str
        An attitude step, whose increments or rates are exact. It starts from zero rotation. The steps of the catalogue
        commute with rotations of the reference axes, so the result holds at any attitude, in the axes of the beginning.
    motion : str, optional
        "general", a motion of the catalogue, or a Python file with a rate in SymPy.
    terms : int, optional
        Number of terms of drift, scale and skew, each counted from its first one that is not zero.

    Returns
    -------
    ErrorSeries

    Raises
    ------
    InputError
        If a name or number is not allowed, or the step uses functions that have no series at zero rotation.

    Examples
    --------
    >>> found = series(catalogue.choose("dcm", "rk4"), "constant", terms=1)
    >>> found.order, sp.factor(found.expressions("drift")[2])
    (4, h**5*w_z*(w_x**2 + w_y**2 + w_z**2)**2/120)
    """
    motion_rates.require(motion)
    terms = checks.count("terms", terms, largest=MOST_TERMS)
    attitude_step = one_step.step(choice)
    order = attitude_step.kernel.order
    # At a constant rate every other power is missing.
    top = 1 + (order.step if order else 0) + terms * (2 if motion == "constant" else 1)
    most = top + one_step.PATIENCE
    with in_powers_of_the_step(attitude_step.kernel.name):
        while True:
            if motion == "general":
                candidate = _general(attitude_step, terms, top)
            elif is_file(motion):
                candidate = _of_file(attitude_step, motion, terms, top)
            else:
                candidate = _named(attitude_step, motion, terms, top)
            parts = [candidate.coefficients(part) for part in PARTS]
            enough = all(len(part) >= terms for part in parts if part)
            if top >= most or (enough and any(parts[:2])):
                return candidate
            top = top + 1 if any(parts) else most


def _general(attitude_step: Step, terms: int, top: int) -> ErrorSeries:
    """Derive the series for a general rate, in the rotated frame of its vectors."""
    frame, ring, rate = one_step.general_rate(attitude_step, top)
    error_parts = errors(attitude_step, ring, rate, top)
    powers = {part: _powers(error_parts[part])[:terms] for part in PARTS}
    # Scale and skew are parts of one matrix and differ between axes of the frame, so both need the powers of either.
    symmetric = sorted({*powers["scale"], *powers["skew"]})[:terms]
    powers_shown = sorted({*powers["drift"], *symmetric})
    invariant = {
        power: invariants(
            frame,
            [element.parts.get(power, ring.zero) for element in error_parts["error"]],
            attitude_step.shown,
        )
        for power in powers_shown
    }
    vectors = [[sp.Symbol(f"w{j}_{axis}") for axis in "xyz"] for j in range(top)]
    parts: dict[str, dict[int, Row]] = {part: {} for part in PARTS}
    for power in powers_shown:
        split = one_step.split([sp.expand(element) for element in matrix(invariant[power], vectors)])
        for part in PARTS:
            row = (sp.expand(split[part][0]), sp.expand(split[part][1]), sp.expand(split[part][2]))
            if power in (powers["drift"] if part == "drift" else symmetric) and any(row):
                parts[part][power] = row
    return _series(attitude_step, "general", parts, top, invariant)


def _of_file(attitude_step: Step, motion: str, terms: int, top: int) -> ErrorSeries:
    """Derive the series for a user's rate, whose derivatives take the place of those of a general one."""
    known = _general(attitude_step, top, top)
    inserted = motion_rates.of_file(motion, top)
    parts: dict[str, Coefficients] = {}
    for part in PARTS:
        rows: dict[int, Row] = {}
        for power, row in known.coefficients(part).items():
            elements = (inserted(row[0]), inserted(row[1]), inserted(row[2]))
            if any(elements) and len(rows) < terms:
                rows[power] = elements
        parts[part] = rows
    return _series(attitude_step, motion, parts, top, {})


def _named(attitude_step: Step, motion: str, terms: int, top: int) -> ErrorSeries:
    """Derive the series for a motion of the catalogue, in the symbols of its parameters."""
    rate = motion_rates.at_time(motion, top, attitude_step.domain)
    error_parts = errors(attitude_step, rate.ring, rate.derivatives, top)
    parts: dict[str, Coefficients] = {}
    for part in PARTS:
        rows: dict[int, Row] = {}
        for power in _powers(error_parts[part]):
            elements = [
                one_step.shown(attitude_step, x.parts.get(power, rate.ring.zero)) for x in error_parts[part]
            ]
            row = (rate.expression(elements[0]), rate.expression(elements[1]), rate.expression(elements[2]))
            if any(row) and len(rows) < terms:
                rows[power] = row
        parts[part] = rows
    return _series(attitude_step, motion, parts, top, {})


def _series(
    attitude_step: Step,
    motion: str,
    parts: Mapping[str, Coefficients],
    known: int,
    invariant: Mapping[int, Invariants],
) -> ErrorSeries:
    """Return the series with these coefficients."""
    kernel = attitude_step.kernel
    drift, scale, skew = (parts[part] for part in PARTS)
    return ErrorSeries(kernel.name, motion, drift, scale, skew, known, invariant, kernel.unknowns)


def _powers(elements: Sequence[Powers]) -> list[int]:
    return sorted({power for element in elements for power in element.parts})


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
    order = checks.count("order", order, largest=4)
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
