"""`analyse` derives everything that `strapgen series` shows: the errors of one algorithm on one motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import sympy as sp

from strapgen.analysis.growth import Growth, contraction, growth
from strapgen.analysis.series.constant_rate import ConstantRate, constant_rate
from strapgen.analysis.series.error_rate import RunDrift, accumulate
from strapgen.analysis.series.invariants import LATEX, Invariants, covariant_text, intervals_text, scalar_text
from strapgen.analysis.series.motion_rates import is_plain
from strapgen.analysis.series.series import PARTS, STEP, ErrorSeries, series
from strapgen.catalogue import Choice
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import notebook_latex, short_repr
from strapgen.lab.motions.motion_names import is_file
from strapgen.results.display.expressions import expression_latex
from strapgen.results.display.latex import equations
from strapgen.results.records import INTERNAL, Record, entry
from strapgen.results.result import Result

if TYPE_CHECKING:
    from strapgen.analysis.series.prediction import Agreement


@dataclass(frozen=True)
class ClosedForm:
    """The errors at a constant rate in closed form, as text that SymPy can read; x is the angle of a step."""

    angle_lost: str
    stretch_squared: str
    #: Intervals of x in which no state grows
    contractive: list[tuple[float, float | None]] | None
    errors: dict[str, list[str]] = field(metadata=entry(key="errors_after_N_steps"))
    errors_orthonormalized: dict[str, list[str]] = field(
        metadata=entry(key="errors_after_N_steps_orthonormalized")
    )

    @staticmethod
    def of(constant: ConstantRate) -> ClosedForm:
        """Return the closed form of a step."""
        return ClosedForm(
            sp.sstr(constant.angle_lost),
            sp.sstr(constant.stretch_squared),
            contraction(constant),
            _texts(constant.errors()),
            _texts(constant.errors_orthonormalized()),
        )


def _texts(errors: Mapping[str, Sequence[sp.Expr]]) -> dict[str, list[str]]:
    return {part: [sp.sstr(x) for x in errors[part]] for part in PARTS}


@dataclass(frozen=True)
class ErrorAnalysis(Record):
    """The errors of an algorithm on a motion."""

    #: Errors of one step
    step: ErrorSeries = field(metadata=entry(spread=True))
    #: Change of length and determinant in a step
    growth: Growth
    #: Drift of a run; None for a general motion, or for the reason in `no_run`
    run: RunDrift | None = field(metadata=entry(optional=True))
    #: Closed form of the errors at a constant rate
    constant: ConstantRate | None = field(
        metadata=entry(key="closed_form", optional=True, write=ClosedForm.of, kind=ClosedForm)
    )
    #: The reason why there is no closed form of a run; "" if there is one
    no_run: str = field(default="", metadata=INTERNAL)

    __repr__ = short_repr
    _repr_latex_ = notebook_latex

    def _in_words(self) -> str:
        run = self.no_run
        if self.run is not None:
            powers = [f"h^{power}" for power in self.run.secular]
            run = f"drift that adds up in a run {', '.join(powers) or 'none'}"
        step = repr(self.step).removeprefix("<ErrorSeries ").removesuffix(">")
        return f"{step}\n{run}".strip()

    @property
    def growth_powers(self) -> list[int]:
        """Powers of the step in the growth of the errors per second."""
        return [power - 1 for part in PARTS for power in self.step.coefficients(part)]


def analyse(choice: Choice, motion: str = "general", terms: int = 2) -> ErrorAnalysis:
    """Derive the series, the growth and the drift of an algorithm on a motion."""
    step = series(choice, motion, terms)
    run, why = None, ""
    if step.unknowns:
        why = "" if motion == "general" else f"kernel {step.kernel} holds unknowns"
    elif is_file(motion):
        why = f"{motion} is any function of time"
    elif motion != "general":
        try:
            run = accumulate(choice, motion, terms)
        except InputError as error:
            why = str(error)
    constant = constant_rate(choice) if motion == "constant" and run is not None else None
    return ErrorAnalysis(step, growth(choice, motion, terms), run, constant, why)


def series_text(analysis: ErrorAnalysis) -> str:
    """Return a report as text."""
    step = analysis.step
    lines = [f"{step.kernel}, {step.motion} motion: what one step of length h loses"]
    if step.order is None:
        lines.append(f"nothing, to the power {step.known} of h")
    else:
        lines.append(f"order {step.order}; terms to the power {step.known} of h were looked at")
    if step.invariant:
        lines.append(
            "w0, w1, ... : the rate and its derivatives; a x b: cross product; S(a, b) = a b' + b a'"
        )
        for power, one in step.invariant.items():
            lines += ["", f"h^{power}  drift           {covariant_text(one.drift)}"]
            if one.symmetric:
                lines.append(f"     scale and skew  {covariant_text(one.symmetric, symmetric=True)}")
    elif step.order is not None:
        for part in PARTS:
            lines += ["", *_vector(part, step.expressions(part))]
    if analysis.run is not None and analysis.run.motion != "polynomial":
        lines += ["", "in a run, orthonormalized or not, to first order in the error"]
        if min(analysis.run.secular, default=0) >= 2 * min(analysis.growth_powers, default=9):
            lines[-1] = (
                "in a run that is not orthonormalized; what adds up is known to all orders in the error"
            )
        lines += _vector("drift gained in a second", _sums(analysis.run.secular), "drift that adds up: none")
        if analysis.run.bounded:
            lines += _vector("drift that is bounded", _sums(analysis.run.bounded))
    if analysis.no_run:
        lines += ["", f"no closed form of a run: {analysis.no_run}"]
    if analysis.constant is not None:
        constant = analysis.constant
        lines += [
            "",
            "in closed form, x = |w| h",
            f"angle lost in a step = {sp.sstr(constant.angle_lost)}",
            f"square of the stretch across the axis = {sp.sstr(constant.stretch_squared)}",
            f"no state grows where x is: {intervals_text(contraction(constant))}",
            "after N steps the drift is stretch^N sin(N angle lost) along w; orthonormalized sin(N angle lost)",
        ]
    lines += ["", *_growth_lines(analysis.growth)]
    return "\n".join(lines)


@dataclass(frozen=True)
class SeriesResult(Result):
    """The errors of one step as power series in its length, with the drift of a run; expressions are text for SymPy."""

    each: ClassVar[type | None] = ErrorAnalysis
    drawn_by: ClassVar[str] = "strapgen.analysis.analysis_plots:agreement_image"

    analyses: Sequence[ErrorAnalysis]
    #: Predicted and simulated drift, for a plot, with its title
    agreements: Sequence[Agreement] = ()
    plot_title: str = ""

    def results(self) -> Sequence[ErrorAnalysis]:
        """Return the analyses."""
        return self.analyses

    def text(self) -> str:
        """Return the analyses one after the other."""
        return "\n\n".join(map(series_text, self.analyses))

    def latex(self) -> str:
        """Return the analyses as align environments."""
        return "\n\n".join(map(series_latex, self.analyses))


def _growth_lines(gain: Growth) -> Iterator[str]:
    yield "growth in a step"
    for name, title in (("length", "length of the state - 1"), ("determinant", "determinant of C - 1")):
        terms = getattr(gain, name)
        if terms is None:
            continue
        if gain.invariant:
            rows = gain.invariant[name]
            text = " + ".join(f"h^{power} ({scalar_text(one)})" for power, one in rows.items())
            yield f"{title} = {text or 0}"
        else:
            yield f"{title} = {_series(sp.Add(*(x * STEP**p for p, x in terms.items())))}"


def _sums(rows: Mapping[int, sp.Matrix]) -> list[sp.Expr]:
    return [sp.Add(*(row[axis] * STEP**power for power, row in rows.items())) for axis in range(3)]


def _vector(title: str, expressions: Sequence[sp.Expr], none: str = "") -> list[str]:
    if none and not any(expressions):
        return [none]
    return [
        f"{title}, {axis} = {_series(expression)}"
        for axis, expression in zip("xyz", expressions, strict=True)
    ]


def _series(expression: sp.Expr) -> str:
    """Return a series as text, every coefficient in factors, from the lowest power on."""
    collected = sp.collect(sp.expand(expression), STEP, evaluate=False)
    text = ""
    for power in sorted(collected, key=lambda power: sp.degree(power, STEP)):
        coefficient = collected[power]
        term = sp.sstr((sp.factor(coefficient) if is_plain(coefficient) else coefficient) * power)
        sign, term = ("-", term[1:]) if term.startswith("-") else ("+", term)
        text += f" {sign} {term}" if text else term if sign == "+" else f"-{term}"
    return text or "0"


def invariant_rows(power: int, one: Invariants) -> list[tuple[str, str]]:
    """Return drift, and scale and skew where there are some, at a power of the step in vectors, as LaTeX."""
    rows = [(rf"h^{{{power}}}\!:\ \mathbf{{d}}", covariant_text(one.drift, notation=LATEX))]
    if one.symmetric:
        text = covariant_text(one.symmetric, symmetric=True, notation=LATEX)
        rows.append((rf"h^{{{power}}}\!:\ \mathbf{{Y}}", text))
    return rows


def series_latex(analysis: ErrorAnalysis) -> str:
    """Return a report as LaTeX: lines of an align environment of the package amsmath."""
    step = analysis.step
    rows: list[tuple[str, str]] = []
    if step.invariant:
        for power, one in step.invariant.items():
            rows += invariant_rows(power, one)
    else:
        for part in PARTS:
            rows += _latex_rows(rf"\mathrm{{{part}}}", step.expressions(part))
    if analysis.run is not None:
        rows += _latex_rows(r"\dot{\mathrm{drift}}", _sums(analysis.run.secular))
        rows += _latex_rows(r"\mathrm{bounded}", _sums(analysis.run.bounded))
    if analysis.constant is not None:
        rows.append((r"\delta(x)", expression_latex(analysis.constant.angle_lost)))
        rows.append((r"\rho(x)^{2}", expression_latex(analysis.constant.stretch_squared)))
    for name, symbol in (("length", r"|e| - 1"), ("determinant", r"\det C - 1")):
        terms = getattr(analysis.growth, name)
        if terms is None:
            continue
        if analysis.growth.invariant:
            text = " + ".join(
                rf"h^{{{power}}} \left({scalar_text(one, LATEX)}\right)"
                for power, one in analysis.growth.invariant[name].items()
            )
            rows.append((symbol, text or "0"))
        else:
            rows.append((symbol, expression_latex(sp.Add(*(x * STEP**p for p, x in terms.items())))))
    head = (
        f"% {step.kernel}, {step.motion} motion: what one step of length h loses\n"
        "% d: drift; Y: scale and skew, S(a, b) = a b' + b a'; delta: angle lost, rho: stretch, x = |w| h"
    )
    return f"{head}\n{equations(rows, head='  ')}"


def _latex_rows(name: str, expressions: Sequence[sp.Expr]) -> list[tuple[str, str]]:
    return [
        (f"{name}_{axis}", expression_latex(expression))
        for axis, expression in zip("xyz", expressions, strict=True)
    ]
