"""Truncation-error series: what an algorithm loses in one step, as a power series in the step length h.

For a general smooth rate, whose derivatives at the beginning of the step are w0, w1, ..., and for the motions of the
catalogue in their own symbols, where t is the time at the beginning of the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import sympy as sp

from strapgen import catalogue, checks
from strapgen.analysis import motion_rates, one_step
from strapgen.analysis.invariants import Invariants, as_text, invariants, matrix
from strapgen.analysis.one_step import Step, errors
from strapgen.catalogue import Choice
from strapgen.exceptions import InputError
from strapgen.powers import Powers

#: Motions that a series is made for.
MOTIONS = ("general", *catalogue.MOTIONS)
#: Most terms of a series.
MOST_TERMS = 6
#: The step length.
STEP = sp.Symbol("h")
#: Parts of an error matrix.
PARTS = ("drift", "scale", "skew")
#: Coefficients of a vector or of three numbers, by power of the step.
Coefficients = dict[int, tuple[sp.Expr, sp.Expr, sp.Expr]]


@dataclass(frozen=True)
class ErrorSeries:
    """What one step loses.

    Parameters
    ----------
    kernel, motion : str
    drift, scale, skew : dict of int to tuple of Expr
        The first terms that are not zero: for every power of the step three coefficients. A dict is empty where
        nothing is lost up to the power `known`.
    known : int
        The last power that was looked at.
    invariant : dict of int to Invariants
        For a general rate the same powers in vector-invariant form.
    """

    kernel: str
    motion: str
    drift: Coefficients
    scale: Coefficients
    skew: Coefficients
    known: int
    invariant: dict[int, Invariants] = field(default_factory=dict)

    @property
    def order(self) -> int | None:
        """Order of the step on this motion: one less than the first power that is lost; None where nothing is lost."""
        powers = [*self.drift, *self.scale, *self.skew]
        return min(powers) - 1 if powers else None

    def coefficients(self, part: str) -> Coefficients:
        """Return the coefficients of "drift", "scale" or "skew"."""
        found: Coefficients = getattr(self, part)
        return found

    def expressions(self, part: str) -> list[sp.Expr]:
        """Return the three sums of terms of "drift", "scale" or "skew"."""
        rows = self.coefficients(part).items()
        return [sp.Add(*(row[axis] * STEP**power for power, row in rows)) for axis in range(3)]

    def as_dict(self) -> dict[str, Any]:
        """Return the series as plain JSON data; expressions as text that SymPy reads."""
        data: dict[str, Any] = {"kernel": self.kernel, "motion": self.motion, "order": self.order}
        for part in PARTS:
            data[part] = [sp.sstr(expression, order="lex") for expression in self.expressions(part)]
        data["known_to_power"] = self.known
        if self.motion == "general":
            data["invariant"] = {
                str(power): {
                    "drift": as_text(found.drift),
                    "scale_and_skew": as_text(found.symmetric, symmetric=True),
                }
                for power, found in self.invariant.items()
            }
        return data


def series(choice: Choice, motion: str = "general", terms: int = 2) -> ErrorSeries:
    """Derive the series of what a step loses.

    Parameters
    ----------
    choice : Choice
        An attitude step, whose increments or rates are exact. It starts from zero rotation: for every step that turns
        with its state, as all of the catalogue do, that is what it loses anywhere, in the axes of the beginning.
    motion : str, optional
        "general", or a motion of the catalogue.
    terms : int, optional
        How many terms of drift, scale and skew, each from its first one that is not zero.

    Returns
    -------
    ErrorSeries

    Raises
    ------
    InputError
        If a name or number is not allowed, or the step has no series: it calls functions that have none there.

    Examples
    --------
    >>> found = series(catalogue.choose("dcm", "rk4"), "constant", terms=1)
    >>> found.order, sp.factor(found.expressions("drift")[2])
    (4, h**5*w_z*(w_x**2 + w_y**2 + w_z**2)**2/120)
    """
    checks.choice("motion", motion, MOTIONS)
    checks.count("terms", terms, largest=MOST_TERMS)
    taken = one_step.step(choice)
    order = taken.kernel.order
    # At a constant rate every other power is missing.
    top = 1 + (order.step if order else 0) + terms * (2 if motion == "constant" else 1)
    most = top + one_step.PATIENCE
    try:
        while True:
            found = _general(taken, terms, top) if motion == "general" else _named(taken, motion, terms, top)
            parts = [found.coefficients(part) for part in PARTS]
            enough = all(len(part) >= terms for part in parts if part)
            if top >= most or (enough and any(parts[:2])):
                return found
            top = top + 1 if any(parts) else most
    except ArithmeticError as error:
        raise InputError(f"kernel {taken.kernel.name} has no series in the step length: {error}") from None


def _general(taken: Step, terms: int, top: int) -> ErrorSeries:
    """Derive the series for a general rate, in the rotated frame of its vectors."""
    frame, ring, rate = one_step.general_rate(taken, top)
    made = errors(taken, ring, rate, top)
    powers = {part: _powers(made[part])[:terms] for part in PARTS}
    # Scale and skew are parts of one matrix: each axis looks different in the frame, so all their powers are kept.
    symmetric = sorted({*powers["scale"], *powers["skew"]})[:terms]
    wanted = sorted({*powers["drift"], *symmetric})
    invariant = {
        power: invariants(
            frame, [element.parts.get(power, ring.zero) for element in made["error"]], taken.shown
        )
        for power in wanted
    }
    vectors = [[sp.Symbol(f"w{j}_{axis}") for axis in "xyz"] for j in range(top)]
    parts: dict[str, Coefficients] = {part: {} for part in PARTS}
    for power in wanted:
        split = one_step.split([sp.expand(element) for element in matrix(invariant[power], vectors)])
        for part in PARTS:
            row = (sp.expand(split[part][0]), sp.expand(split[part][1]), sp.expand(split[part][2]))
            if power in (powers["drift"] if part == "drift" else symmetric) and any(row):
                parts[part][power] = row
    return ErrorSeries(
        taken.kernel.name, "general", parts["drift"], parts["scale"], parts["skew"], top, invariant
    )


def _named(taken: Step, motion: str, terms: int, top: int) -> ErrorSeries:
    """Derive the series for a motion of the catalogue, in its own symbols."""
    rate = motion_rates.at_time(motion, top, taken.domain)
    made = errors(taken, rate.ring, rate.derivatives, top)
    parts: dict[str, Coefficients] = {}
    for part in PARTS:
        rows: Coefficients = {}
        for power in _powers(made[part]):
            elements = [one_step.shown(taken, x.parts.get(power, rate.ring.zero)) for x in made[part]]
            row = (rate.expression(elements[0]), rate.expression(elements[1]), rate.expression(elements[2]))
            if any(row) and len(rows) < terms:
                rows[power] = row
        parts[part] = rows
    return ErrorSeries(taken.kernel.name, motion, parts["drift"], parts["scale"], parts["skew"], top)


def _powers(elements: Sequence[Powers]) -> list[int]:
    return sorted({power for element in elements for power in element.parts})
