"""Compares two algorithms by the exact ratio of their leading errors, with the next term of the ratio."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import sympy as sp

from strapgen import catalogue
from strapgen.analysis.series.constant_rate import constant_rate
from strapgen.analysis.series.error_rate import accumulate
from strapgen.analysis.series.invariants import sum_text
from strapgen.analysis.series.motion_rates import TIME
from strapgen.analysis.series.series import MOTIONS, STEP, series
from strapgen.catalogue import Choice
from strapgen.ir import checks
from strapgen.results.display.expressions import expression_latex
from strapgen.results.display.latex import PAGE, equations, unbroken
from strapgen.results.records import INTERNAL, Properties, Record, entry, properties
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable

#: The angle of a step at a constant rate, |w| h.
STEP_ANGLE = sp.Symbol("x")
#: Most terms of a quotient that is reduced and factored.
_LONG = 100
#: Coefficients of a drift by power of the step or of the angle; each is a vector, or one number in a tuple.
Terms = Mapping[int, Sequence[sp.Expr]]


@dataclass(frozen=True)
class Ratio(Record):
    """The ratio of the errors of two algorithms."""

    computed: ClassVar[Properties] = properties(
        first_terms=entry(),
        second_terms=entry(),
        expression=entry(key="ratio", write=lambda ratio: sp.sstr(ratio, order="lex"), kind=str | None),
    )

    #: The kernels
    first: str
    second: str
    motion: str
    #: The compared quantity and its unit
    quantity: str
    #: The variable of both series
    symbol: sp.Symbol
    #: The terms of both, by power of the symbol
    terms: tuple[Terms, Terms] = field(metadata=INTERNAL)
    #: The first terms of the quotient by power of the symbol; None if one of the two has no error, or their
    #: drifts are not parallel
    ratio: dict[int, sp.Expr] | None = field(metadata=INTERNAL)

    @property
    def expression(self) -> sp.Expr | None:
        """The quotient as a sum of its known terms."""
        if self.ratio is None:
            return None
        return sp.Add(*(x * self.symbol**power for power, x in self.ratio.items()))

    @property
    def first_terms(self) -> list[str]:
        """The terms of the first, a sum for each element."""
        return [sum_text(row, self.symbol) for row in columns(self.terms[0])]

    @property
    def second_terms(self) -> list[str]:
        """The terms of the second, a sum for each element."""
        return [sum_text(row, self.symbol) for row in columns(self.terms[1])]


def columns(terms: Terms) -> list[dict[int, sp.Expr]]:
    """Return the coefficients of each element by power: one dict for a number, three for a vector."""
    length = max((len(row) for row in terms.values()), default=1)
    return [{power: row[k] for power, row in terms.items()} for k in range(length)]


def versus(first: Choice, second: Choice, motion: str = "general", terms: int = 2) -> Ratio:
    """Compare the errors of two algorithms on a motion.

    >>> found = versus(catalogue.choose("euler", "rk1"), catalogue.choose("dcm", "rk1"), "constant")
    >>> found.ratio
    {0: 1/4, 2: 9/80}
    """
    checks.choice("motion", motion, MOTIONS)
    kernels = [choice.kernel for choice in (first, second)]
    one: Terms
    other: Terms
    if motion == "constant":
        one, other = ({p: (x,) for p, x in constant_rate(c).series(terms).items()} for c in (first, second))
        quantity, symbol = "angle lost in a step, rad", STEP_ANGLE
    elif motion == "general":
        one, other = (series(c, motion, terms).drift for c in (first, second))
        quantity, symbol = "drift of a step, rad", STEP
    else:
        runs = [accumulate(c, motion, terms) for c in (first, second)]
        if motion == "coning":
            one, other = ({p: tuple(row) for p, row in run.secular.items()} for run in runs)
            quantity = "secular drift rate, rad/s"
        else:
            one, other = (_whole(run.secular, run.bounded) for run in runs)
            quantity = "drift after the time t, rad"
        symbol = STEP
    ratio = quotient(one, other, terms)
    return Ratio(kernels[0], kernels[1], motion, quantity, symbol, (one, other), ratio)


def _whole(secular: Mapping[int, sp.Matrix], bounded: Mapping[int, sp.Matrix]) -> Terms:
    zero = sp.zeros(3, 1)
    return {
        power: tuple(TIME * secular.get(power, zero) + bounded.get(power, zero))
        for power in sorted({*secular, *bounded})
    }


def quotient(first: Terms, second: Terms, terms: int = 2) -> dict[int, sp.Expr] | None:
    """Return the first terms of the quotient of two series of parallel vectors.

    >>> quotient({3: (sp.Rational(1, 12),)}, {3: (sp.Rational(1, 3),)})
    {0: 1/4}
    """
    if not first or not second:
        return None
    begin = min(second)
    direction = second[begin]
    place = next(k for k, x in enumerate(direction) if x)
    rows = []
    for series_terms in (first, second):
        row = {}
        for power, vector in series_terms.items():
            if vector is not direction and not _parallel(vector, direction, place):
                return None
            row[power] = vector[place]
        rows.append(row)
    upper, lower = rows
    # The quotient is known only as far as both series are; after a single term nothing is known.
    reach = min(max(upper) - min(upper), max(lower) - begin)
    leading: dict[int, sp.Expr] = {}
    for power in range(min(upper) - begin, min(upper) - begin + reach + 1):
        rest = upper.get(power + begin, sp.S.Zero)
        rest -= sum(
            (x * lower.get(power + begin - other, sp.S.Zero) for other, x in leading.items()), sp.S.Zero
        )
        value = _reduce(sp.expand(rest), lower[begin])
        if value:
            leading[power] = value
    return dict(list(leading.items())[:terms])


def _parallel(vector: Sequence[sp.Expr], direction: Sequence[sp.Expr], place: int) -> bool:
    """Return whether the elements are proportional to a direction, without quotients of long sums."""
    return all(
        sp.expand(x * direction[place] - vector[place] * d) == 0
        for k, (x, d) in enumerate(zip(vector, direction, strict=True))
        if k != place
    )


def _reduce(upper: sp.Expr, lower: sp.Expr) -> sp.Expr:
    """Return a quotient as a number if it is one, otherwise in lowest terms and factored unless it is too long."""
    if not upper:
        return sp.S.Zero
    denominator, numerator = sp.expand(lower).as_coefficients_dict(), upper.as_coefficients_dict()
    first = next(iter(numerator))
    number = numerator[first] / denominator[first] if first in denominator else None
    if number is not None and sp.expand(upper - number * lower) == 0:
        return number
    if len(numerator) + len(denominator) > _LONG:
        return upper / lower
    reduced = sp.factor(sp.cancel(upper / lower))
    return sp.trigsimp(reduced) if reduced.has(sp.cos) else reduced


@dataclass(frozen=True)
class Claim(Record):
    """A ratio that the thesis states, with its derived value."""

    #: What is compared
    statement: str
    #: Its first terms by power of the angle x = |w| h of a step
    ratio: dict[int, sp.Expr] = field(
        metadata=entry(write=lambda ratio: sum_text(ratio, STEP_ANGLE), kind=str)
    )


def claims() -> list[Claim]:
    """Derive the ratios at a constant rate that section 5 of the thesis takes from its tables.

    >>> claims()[0].ratio
    {0: 1/4, 2: 9/80}
    """

    def lost(algorithm: str, order: int) -> Terms:
        leading = constant_rate(catalogue.choose(algorithm, f"rk{order}", 2)).series(3)
        return {power: (x,) for power, x in leading.items()}

    ratios = []
    for order in (1, 2, 3, 4):
        ratio = quotient(lost("euler", order), lost("dcm", order))
        ratios.append((f"Euler parameters over direction cosines, order {order}", ratio))
    ratios.append(("second order over first", quotient(lost("dcm", 2), lost("dcm", 1))))
    ratios.append(("fourth order over third", quotient(lost("dcm", 4), lost("dcm", 3))))
    fourth = quotient(lost("dcm", 4), lost("dcm", 1))
    assert fourth is not None
    # Equal rates on three axes make |w| larger than one of them by the factor 3^(1/2).
    three = {power: (sp.sqrt(3) ** power * x,) for power, x in fourth.items()}
    one = {power: (x,) for power, x in fourth.items()}
    ratios.append(("fourth order over first, three equal axes over one axis", quotient(three, one)))
    return [Claim(statement, ratio) for statement, ratio in ratios if ratio is not None]


def ratio_text(comparison: Ratio) -> str:
    """Return a comparison as text."""
    lines = [
        f"{comparison.first} over {comparison.second}, {comparison.motion} motion: {comparison.quantity}"
    ]
    if comparison.symbol == STEP_ANGLE:
        lines.append("x = |w| h, the angle of a step")
    both = ((comparison.first, comparison.first_terms), (comparison.second, comparison.second_terms))
    for name, terms in both:
        axes = ("",) if len(terms) == 1 else (", x", ", y", ", z")
        lines += ["", *(f"{name}{axis} = {text}" for axis, text in zip(axes, terms, strict=True))]
    ratio = comparison.as_dict()["ratio"]
    lines += ["", _no_ratio(comparison) if ratio is None else f"ratio = {ratio}"]
    return "\n".join(lines)


def _no_ratio(comparison: Ratio) -> str:
    names = (comparison.first, comparison.second)
    exact = [name for name, terms in zip(names, comparison.terms, strict=True) if not terms]
    if exact:
        return f"no ratio: {' and '.join(exact)} loses nothing"
    return "no ratio: the vectors are not parallel"


def ratio_latex(comparison: Ratio) -> str:
    """Return a comparison as one align environment; a ratio that no line holds as a numerator and a denominator."""
    rows = []
    for name, terms in zip((comparison.first, comparison.second), comparison.terms, strict=True):
        rates = [*columns(terms)]
        for axis, row in zip("xyz" if len(rates) == 3 else ("",), rates, strict=True):
            total = sp.Add(*(x * comparison.symbol**power for power, x in row.items()))
            left = rf"\text{{{name}}}" + (f"_{{{axis}}}" if axis else "")
            rows.append((left, expression_latex(total)))
    if comparison.expression is not None:
        text = sp.latex(comparison.expression)
        if unbroken(text) <= PAGE / 2:
            rows.append((r"\text{ratio}", text))
        else:
            rows.append((r"\text{ratio}", "N / D"))
            rows += zip(("N", "D"), map(expression_latex, sp.fraction(comparison.expression)), strict=True)
    return f"% {comparison.quantity}, {comparison.motion} motion\n{equations(rows)}"


@dataclass(frozen=True)
class RatioResult(Result):
    """The ratio of the errors of two algorithms; expressions are text that SymPy can read."""

    comparison: Ratio = field(metadata=entry(spread=True))

    def text(self) -> str:
        """Return the terms of both, and the ratio."""
        return ratio_text(self.comparison)

    def latex(self) -> str:
        """Return the same as an align environment."""
        return ratio_latex(self.comparison)


def claims_text(claims: Sequence[Claim]) -> str:
    """Return claims as a table."""
    rows = [(claim.statement, _leading_terms(claim)) for claim in claims]
    title = "Ratios of the drift at a constant rate, x = |w| h (for three axes: of the one axis)"
    return "\n".join([title, *TextTable([Column(align="<")] * 2, rows).lines("  ")])


def _leading_terms(claim: Claim) -> str:
    terms = [f"{value}" + (f" x^{power}" if power else "") for power, value in claim.ratio.items()]
    return " + ".join(terms).replace("+ -", "- ")
