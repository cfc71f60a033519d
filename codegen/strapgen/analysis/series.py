"""Truncation-error series: what an algorithm loses in one step, as a power series in the step length h.

For a general smooth rate, whose derivatives at the beginning of the step are w0, w1, ..., and for the motions of the
catalogue in their own symbols, where t is the time at the beginning of the step.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import sympy as sp

from strapgen import catalogue, checks
from strapgen.analysis.invariants import Invariants, as_text, invariants, matrix
from strapgen.analysis.one_step import errors
from strapgen.analysis.powers import Powers
from strapgen.catalogue import Choice
from strapgen.exceptions import InputError
from strapgen.kernel import Kernel
from strapgen.lowering.canonical.decomposition import Frame

#: Motions that a series is made for.
MOTIONS = ("general", *catalogue.MOTIONS)
#: Most terms of a series.
MOST_TERMS = 6
#: The step length.
STEP = sp.Symbol("h")
#: Powers beyond the order that are looked at where a series does not begin.
_PATIENCE = 4

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
        """The order that the series shows: one less than its first power; None where nothing is lost."""
        powers = [*self.drift, *self.scale, *self.skew]
        return min(powers) - 1 if powers else None

    def expressions(self, part: str) -> list[sp.Expr]:
        """Return the three sums of terms of "drift", "scale" or "skew"."""
        coefficients: Coefficients = getattr(self, part)
        return [
            sp.Add(*(row[axis] * STEP**power for power, row in coefficients.items())) for axis in range(3)
        ]

    def as_dict(self) -> dict[str, Any]:
        """Return the series as plain JSON data; expressions as text that SymPy reads."""
        data: dict[str, Any] = {"kernel": self.kernel, "motion": self.motion, "order": self.order}
        for part in ("drift", "scale", "skew"):
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
        An attitude step that takes increments.
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
    kernel = catalogue.derive(choice)
    if kernel.companions is None or kernel.inputs[1].name != "increments":
        raise InputError(f"kernel {kernel.name} takes no increments; a step that does is needed")
    begin = 1 + (kernel.order.step if kernel.order else 0)
    # At a constant rate every other power is missing.
    top = begin + terms * (2 if motion == "constant" else 1)
    most = top + _PATIENCE
    try:
        while True:
            found = (
                _general(kernel, terms, top) if motion == "general" else _named(kernel, motion, terms, top)
            )
            enough = all(len(part) >= terms for part in (found.drift, found.scale, found.skew) if part)
            if top >= most or (enough and (found.drift or found.scale)):
                return found
            top += 1
    except ArithmeticError as error:
        raise InputError(f"kernel {kernel.name} has no series in the step length: {error}") from None


def _general(kernel: Kernel, terms: int, top: int) -> ErrorSeries:
    """Derive the series for a general rate, in the rotated frame of its vectors."""
    frame = Frame(top)
    made = errors(kernel, frame.ring, frame.vectors, top)
    powers = {part: _powers(made[part])[:terms] for part in ("drift", "scale", "skew")}
    # Scale and skew are parts of one matrix: each axis looks different in the frame, so all their powers are kept.
    symmetric = sorted({*powers["scale"], *powers["skew"]})[:terms]
    wanted = sorted({*powers["drift"], *symmetric})
    zero = frame.ring.zero
    invariant = {
        power: invariants(frame, [element.parts.get(power, zero) for element in made["error"]])
        for power in wanted
    }
    vectors = [[sp.Symbol(f"w{j}_{axis}") for axis in "xyz"] for j in range(top)]
    drift: Coefficients = {}
    scale: Coefficients = {}
    skew: Coefficients = {}
    for power in wanted:
        split = _split([sp.expand(element) for element in matrix(invariant[power], vectors)])
        for name, into, kept in (
            ("drift", drift, powers["drift"]),
            ("scale", scale, symmetric),
            ("skew", skew, symmetric),
        ):
            row = tuple(sp.expand(element) for element in split[name])
            if power in kept and any(row):
                into[power] = row
    return ErrorSeries(kernel.name, "general", drift, scale, skew, top, invariant)


def _named(kernel: Kernel, motion: str, terms: int, top: int) -> ErrorSeries:
    """Derive the series for a motion of the catalogue, in its own symbols."""
    ring, rate, back = _rate(motion, top)
    made = errors(kernel, ring, rate, top)
    parts: dict[str, Coefficients] = {}
    for name in ("drift", "scale", "skew"):
        reduced = [back(element) for element in made[name]]
        powers = sorted({power for element in reduced for power, value in element.items() if value})[:terms]
        parts[name] = {power: tuple(element.get(power, sp.S.Zero) for element in reduced) for power in powers}
    return ErrorSeries(kernel.name, motion, parts["drift"], parts["scale"], parts["skew"], top)


def as_json(found: ErrorSeries) -> str:
    """Return a series as JSON."""
    return json.dumps(found.as_dict(), indent=1)


def as_report(found: ErrorSeries, latex: bool = False) -> str:
    """Return a series as text, or as lines of LaTeX."""
    lines = [f"{found.kernel}, {found.motion} motion: what one step of length h loses"]
    if found.order is None:
        return "\n".join([*lines, f"nothing, to the power {found.known} of h"])
    lines.append(f"order {found.order}; terms to the power {found.known} of h were looked at")
    if found.invariant and not latex:
        lines.append(
            "w0, w1, ... : the rate and its derivatives; a x b: cross product; S(a, b) = a b' + b a'"
        )
        for power, one in found.invariant.items():
            lines += ["", f"h^{power}  drift           {as_text(one.drift)}"]
            if one.symmetric:
                lines.append(f"     scale and skew  {as_text(one.symmetric, symmetric=True)}")
        return "\n".join(lines)
    for part in ("drift", "scale", "skew"):
        lines.append("")
        for axis, expression in zip("xyz", found.expressions(part), strict=True):
            shown = sp.latex(expression) if latex else sp.sstr(_by_power(expression))
            lines.append(f"{part}_{axis} = {shown}")
    return "\n".join(lines)


def _by_power(expression: sp.Expr) -> sp.Expr:
    """Return a series with every coefficient factored."""
    terms = [sp.factor(term) for term in sp.Add.make_args(sp.collect(sp.expand(expression), STEP))]
    return sp.Add(*terms)


def _rate(motion: str, count: int) -> tuple[Any, list[list[Any]], Any]:
    """Return a ring, the rate of a motion and its derivatives in it, and what turns coefficients into expressions."""
    from strapgen.catalogue.motions import MOTIONS as MODELS

    if motion == "constant":
        ring, *w = sp.ring("w_x w_y w_z", sp.QQ)
        return ring, [w], lambda element: {p: part.as_expr() for p, part in element.parts.items()}
    if motion == "polynomial":
        return _polynomial_rate(count)
    time = sp.Symbol("t")
    parameters = [sp.Symbol(name) for name in catalogue.MOTIONS[motion]]
    cosine, sine = sp.symbols("cosine sine")
    frequency = next((p for p in parameters if p.name == "b"), None)
    ring, *_ = sp.ring([*parameters, time, cosine, sine], sp.QQ)
    waves = {} if frequency is None else {sp.cos(frequency * time): cosine, sp.sin(frequency * time): sine}
    vector = MODELS[motion].rate(time, *parameters)
    rate = []
    for _ in range(count):
        rate.append([ring.from_expr(sp.expand(element).subs(waves)) for element in vector])
        vector = vector.diff(time)
    unity = ring.from_expr(cosine**2 + sine**2 - 1)

    def back(element: Powers) -> dict[int, sp.Expr]:
        """Return coefficients with sines squared written as cosines, which tells what is zero."""
        found = {}
        for power, part in element.parts.items():
            expression = part.rem([unity]).as_expr()
            found[power] = sp.factor(expression).subs({value: key for key, value in waves.items()})
        return found

    return ring, rate, back


def _polynomial_rate(count: int) -> tuple[Any, list[list[Any]], Any]:
    """Return what `_rate` does: the derivatives of the one component are put in at the end, or products explode."""
    from strapgen.catalogue.motions import MOTIONS as MODELS

    time = sp.Symbol("t")
    parameters = [sp.Symbol(name) for name in catalogue.MOTIONS["polynomial"]]
    rate = MODELS["polynomial"].rate(time, *parameters)
    count = min(count, len(parameters))  # the others are zero
    ring, *r = sp.ring([f"r{j}" for j in range(count)], sp.QQ)
    meant = {sp.Symbol(f"r{j}"): sp.diff(rate[1], time, j) for j in range(count)}

    def back(element: Powers) -> dict[int, sp.Expr]:
        return {power: sp.factor(part.as_expr()).subs(meant) for power, part in element.parts.items()}

    return ring, [[ring.zero, one, ring.zero] for one in r], back


def _powers(elements: Sequence[Powers]) -> list[int]:
    return sorted({power for element in elements for power in element.parts})


def _split(error: Sequence[sp.Expr]) -> dict[str, list[sp.Expr]]:
    """Return drift, scale and skew of an error matrix."""
    from strapgen.analysis.one_step import split

    return split(list(error))
