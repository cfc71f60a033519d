"""From one step to a run: the drift that grows with time, and the part that stays bounded.

To first order in the error the error matrix of a run is the integral of the error rate, carried along with the motion.
Where the frame turns evenly about an axis s, what lies along s adds up and the rest swings with |s| t.
Orthonormalization leaves the drift as it is, to that order, and keeps scale and skew from adding up.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import sympy as sp

from strapgen import algebra, catalogue, checks
from strapgen.analysis import one_step
from strapgen.analysis.error_rate import ErrorRate, error_rate
from strapgen.analysis.motion_rates import TIME, is_plain
from strapgen.analysis.series import MOST_TERMS, STEP
from strapgen.catalogue import Choice
from strapgen.powers import Powers


@dataclass(frozen=True)
class Accumulation:
    """The drift of a run that begins at time 0.

    Parameters
    ----------
    kernel, motion : str
    secular : dict of int to Matrix, 3 x 1
        Drift in rad that is gained in a second, reference axes: coefficients by power of the step length.
    bounded : dict of int to Matrix, 3 x 1
        What swings about it, as a function of the time t, zero at time 0; to first order in the error.
    growth : dict of int to Expr
        What the logarithm of the scale across the drift gains in a second.
    """

    kernel: str
    motion: str
    secular: dict[int, sp.Matrix]
    bounded: dict[int, sp.Matrix]
    growth: dict[int, sp.Expr]

    def drift(self, time: sp.Expr = TIME) -> list[sp.Expr]:
        """Return the drift after a time as a sum of the terms that are known, x, y, z."""
        total = sp.zeros(3, 1)
        for power, row in self.secular.items():
            total += time * row * STEP**power
        for power, row in self.bounded.items():
            total += row.subs(TIME, time) * STEP**power
        return list(total)

    def as_dict(self) -> dict[str, Any]:
        """Return the terms as plain JSON data: three sums each, in the symbols h and t."""

        def sums(rows: dict[int, sp.Matrix]) -> list[str]:
            return [
                sp.sstr(sp.Add(*(row[axis] * STEP**p for p, row in rows.items())), order="lex")
                for axis in range(3)
            ]

        return {
            "drift_rate": sums(self.secular),
            "drift_bounded": sums(self.bounded),
            "growth_rate": sp.sstr(sp.Add(*(x * STEP**p for p, x in self.growth.items())), order="lex"),
        }


def accumulate(choice: Choice, motion: str, terms: int = 2) -> Accumulation:
    """Derive the drift of a run on a motion of the catalogue.

    Parameters
    ----------
    choice : Choice
        An attitude step that is linear in its state.
    motion : str
    terms : int, optional
        How many terms of the drift that grows and of the one that is bounded. They are looked for among the first
        powers of the error rate, twice as many: every other one may be zero.

    Returns
    -------
    Accumulation

    Raises
    ------
    InputError
        If a name or number is not allowed, or the step has no closed form of a run.

    Examples
    --------
    >>> from strapgen import catalogue
    >>> run = accumulate(catalogue.choose("dcm", "rk2"), "coning", terms=1)
    >>> sp.factor(run.secular[2][1])
    -(b + g)*(a**4 + a**2*b**2 + a**2*b*g + 2*a**2*g**2 + b*g**3 + g**4)/(6*(a**2 + b**2 + 2*b*g + g**2))
    """
    checks.choice("motion", motion, catalogue.MOTIONS)
    checks.count("terms", terms, largest=MOST_TERMS)
    found = error_rate(choice, motion, 2 * terms)
    made = _steady(found) if found.steady else _about_an_axis(found)
    return replace(
        made,
        secular=_first(made.secular, terms),
        bounded=_first(made.bounded, terms),
        growth=_first(made.growth, terms),
    )


def _first(rows: dict[int, Any], terms: int) -> dict[int, Any]:
    return dict(list(rows.items())[:terms])


def _steady(found: ErrorRate) -> Accumulation:
    """Return the drift of a motion whose frame turns evenly.

    The eigenvalues of turning and error rate together are those of the run. Their imaginary part, less the turning, is
    the secular drift to all orders in the error.
    """
    powers = list(found.matrices)
    if not powers:
        return Accumulation(found.kernel, found.motion, {}, {}, {})
    shifts = _eigenvalue(found, max(powers))
    secular, growth = {}, {}
    for power, (real, imaginary) in shifts.items():
        row = (-imaginary * found.axis).applyfunc(_short)
        if any(row):
            secular[power] = row
        if real := _short(real):
            growth[power] = real
    bounded = {}
    # Products of two errors are of twice the first power: where that is not the second one, all of the second is there.
    known = [power for power in powers if power < 2 * powers[0]]
    for power in known if found.motion != "constant" else ():
        row = _swing(_drift(found.matrices[power]), found.axis)
        if any(row):
            bounded[power] = row
    return Accumulation(found.kernel, found.motion, secular, bounded, growth)


def _drift(matrix: sp.Matrix) -> sp.Matrix:
    return sp.Matrix(one_step.split(list(matrix))["drift"])


def _swing(drift: sp.Matrix, axis: sp.Matrix) -> sp.Matrix:
    """Return what swings when a drift rate turns with a frame: its part across the axis, integrated."""
    square = algebra.dot(axis, axis)
    across = drift - algebra.dot(drift, axis) / square * axis
    turned = algebra.cross(axis, drift)
    length = sp.sqrt(sp.expand(square))
    return across.applyfunc(_short) * sp.sin(length * TIME) / length + turned.applyfunc(_short) * (
        1 - sp.cos(length * TIME)
    ) / sp.expand(square)


def _short(expression: sp.Expr) -> sp.Expr:
    """Return an expression in lowest terms and factors, where its numbers are short fractions."""
    return sp.factor(sp.cancel(expression)) if is_plain(expression) else expression


def _eigenvalue(found: ErrorRate, top: int) -> dict[int, tuple[sp.Expr, sp.Expr]]:
    """Return the eigenvalue of the run next to i |s|, as pairs u, v by power of the step: u + i |s| v.

    With y = i |s| the characteristic polynomial at power 0 is y^3 + S y, whose derivative is -2 S; so every further
    coefficient follows from those before it by one division.
    """
    ring = found.ring
    first = min(found.matrices)
    names = [str(symbol) for symbol in ring.symbols]
    extended, y, half, *_ = sp.ring(["y", "half_over_S", *names], ring.domain)

    def lifted(element: Powers) -> Powers:
        # log(M R')/h: one power less. What lies below the first power of the error rate is zero but for rounding.
        parts = {
            power - 1: part.set_ring(extended)
            for power, part in element.parts.items()
            if power == 1 or power > first
        }
        return Powers(extended, parts, top)

    m = [[lifted(element) for element in row] for row in found.raw]
    trace = m[0][0] + m[1][1] + m[2][2]
    minors = sum(
        (m[i][i] * m[j][j] - m[i][j] * m[j][i] for i, j in ((0, 1), (0, 2), (1, 2))),
        Powers(extended, {}, top),
    )
    determinant = algebra.dot(m[0], algebra.cross_elements(m[1], m[2]))
    axis = [extended.from_expr(sp.expand(x)) for x in found.axis]
    square = algebra.dot(axis, axis)
    value = Powers(extended, {0: y}, top)
    known = 1 / (2 * square.as_expr())
    shifts: dict[int, tuple[sp.Expr, sp.Expr]] = {}
    for power in range(first, top + 1):
        cubic = ((value - trace) * value + minors) * value - determinant
        shift = cubic.parts.get(power, extended.zero).rem([y**2 + square]) * half
        value = value + Powers(extended, {power: shift}, top)
        expression = shift.as_expr().subs(sp.Symbol("half_over_S"), known)
        imaginary = expression.coeff(sp.Symbol("y"), 1)
        shifts[power] = (expression.subs(sp.Symbol("y"), 0), imaginary)
    return {power: pair for power, pair in shifts.items() if any(pair)}


def _about_an_axis(found: ErrorRate) -> Accumulation:
    """Return the drift of a rate that keeps its axis: the integral of the error rate."""
    secular, bounded, growth = {}, {}, {}
    for power, matrix in found.matrices.items():
        mean, swing = _integrated(_drift(matrix), found)
        if any(mean):
            secular[power] = mean
        if any(swing):
            bounded[power] = swing
        across = (matrix[0, 0] + matrix[2, 2]) / 2
        (gained,), _ = _integrated(sp.Matrix([across]), found)
        if gained:
            growth[power] = gained
    return Accumulation(found.kernel, found.motion, secular, bounded, growth)


def _integrated(rates: sp.Matrix, found: ErrorRate) -> tuple[sp.Matrix, sp.Matrix]:
    """Return the mean of rates and the integral of what is left, zero at time 0; of a polynomial there is no mean."""
    if found.motion == "polynomial":
        return sp.zeros(*rates.shape), rates.applyfunc(lambda x: sp.Poly(x, TIME).integrate().as_expr())
    b = sp.Symbol("b")
    means, swings = [], []
    for rate in rates:
        mean, swing = _fourier(rate, b)
        means.append(_short(mean))
        swings.append(swing)
    return sp.Matrix(means), sp.Matrix(swings)


def antiderivative(matrix: sp.Matrix, found: ErrorRate) -> sp.Matrix:
    """Return the integral from time 0 to t of a term of the error rate of a motion about a fixed axis."""
    mean, swing = _integrated(matrix, found)
    return mean.reshape(*matrix.shape) * TIME + swing.reshape(*matrix.shape)


def _fourier(expression: sp.Expr, b: sp.Symbol) -> tuple[sp.Expr, sp.Expr]:
    """Return the mean of a polynomial in cos(b t) and sin(b t), and the integral from 0 to t of its waves."""
    z = sp.Symbol("z")
    cosine, sine = (z + 1 / z) / 2, (z - 1 / z) / (2 * sp.I)
    written = sp.expand(sp.expand(expression).subs({sp.cos(b * TIME): cosine, sp.sin(b * TIME): sine}))
    mean, swing = sp.S.Zero, sp.S.Zero
    terms = sp.collect(written, z, evaluate=False)
    for term, coefficient in terms.items():
        harmonic = int(sp.degree(term, z)) if term.is_polynomial(z) else -int(sp.degree(1 / term, z))
        if harmonic == 0:
            mean += coefficient
        elif harmonic > 0:
            other = terms.get(z**-harmonic, sp.S.Zero)
            even, odd = sp.expand(coefficient + other), sp.expand(sp.I * (coefficient - other))
            angle = harmonic * b * TIME
            swing += _short(even / (harmonic * b)) * sp.sin(angle)
            swing += _short(odd / (harmonic * b)) * (1 - sp.cos(angle))
    return sp.expand(mean), swing
