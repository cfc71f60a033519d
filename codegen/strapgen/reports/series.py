"""The complete series report of one algorithm on one motion, as data and as text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from strapgen.analysis.accumulation import RunDrift, accumulate
from strapgen.analysis.constant_rate import ConstantRate, constant_rate
from strapgen.analysis.growth import Growth, contraction, growth, intervals_text
from strapgen.analysis.invariants import LATEX, as_text, scalar_as_text
from strapgen.analysis.motion_rates import is_plain
from strapgen.analysis.series import PARTS, STEP, ErrorSeries, series
from strapgen.catalogue import Choice
from strapgen.support.exceptions import InputError


@dataclass(frozen=True)
class Report:
    """The errors of an algorithm on a motion.

    Parameters
    ----------
    step : ErrorSeries
        Errors of one step.
    growth : Growth
        Change of length and determinant in a step.
    run : RunDrift or None
        Drift of a run; None for a general motion, or for the reason in `no_run`.
    constant : ConstantRate or None
        Closed form of the errors at a constant rate.
    no_run : str
        The reason why there is no closed form of a run; "" if there is one.
    """

    step: ErrorSeries
    growth: Growth
    run: RunDrift | None
    constant: ConstantRate | None
    no_run: str = ""

    @property
    def growth_powers(self) -> list[int]:
        """Powers of the step in the growth of the errors per second."""
        return [power - 1 for part in PARTS for power in self.step.coefficients(part)]

    def as_dict(self) -> dict[str, Any]:
        """Return the report as plain JSON data, with expressions as text that SymPy can read."""
        data = self.step.as_dict()
        data["growth"] = self.growth.as_dict()
        if self.run is not None:
            data["run"] = self.run.as_dict()
        if self.constant is not None:
            data["closed_form"] = {
                "angle_lost": sp.sstr(self.constant.angle_lost),
                "stretch_squared": sp.sstr(self.constant.stretch_squared),
                "contractive": contraction(self.constant),
                "errors_after_N_steps": _texts(self.constant.errors()),
                "errors_after_N_steps_orthonormalized": _texts(self.constant.errors_orthonormalized()),
            }
        return data


def _texts(errors: Mapping[str, Sequence[sp.Expr]]) -> dict[str, list[str]]:
    return {part: [sp.sstr(x) for x in errors[part]] for part in PARTS}


def report(choice: Choice, motion: str = "general", terms: int = 2) -> Report:
    """Derive the series, the growth and the drift of an algorithm on a motion.

    Parameters
    ----------
    choice : Choice
        An attitude step.
    motion : str, optional
        "general", or a motion of the catalogue.
    terms : int, optional
        Number of terms that are not zero.

    Returns
    -------
    Report

    Raises
    ------
    InputError
        If a name or number is not allowed, or the step has no series.
    """
    step = series(choice, motion, terms)
    run, why = None, ""
    if motion != "general":
        try:
            run = accumulate(choice, motion, terms)
        except InputError as error:
            why = str(error)
    constant = constant_rate(choice) if motion == "constant" and run is not None else None
    return Report(step, growth(choice, motion, terms), run, constant, why)


def as_report(found: Report) -> str:
    """Return a report as text."""
    step = found.step
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
            lines += ["", f"h^{power}  drift           {as_text(one.drift)}"]
            if one.symmetric:
                lines.append(f"     scale and skew  {as_text(one.symmetric, symmetric=True)}")
    elif step.order is not None:
        for part in PARTS:
            lines += ["", *_vector(part, step.expressions(part))]
    if found.run is not None and found.run.motion != "polynomial":
        lines += ["", "in a run, orthonormalized or not, to first order in the error"]
        if min(found.run.secular, default=0) >= 2 * min(found.growth_powers, default=9):
            lines[-1] = (
                "in a run that is not orthonormalized; what adds up is known to all orders in the error"
            )
        lines += _vector("drift gained in a second", _sums(found.run.secular), "drift that adds up: none")
        if found.run.bounded:
            lines += _vector("drift that is bounded", _sums(found.run.bounded))
    if found.no_run:
        lines += ["", f"no closed form of a run: {found.no_run}"]
    if found.constant is not None:
        constant = found.constant
        lines += [
            "",
            "in closed form, x = |w| h",
            f"angle lost in a step = {sp.sstr(constant.angle_lost)}",
            f"square of the stretch across the axis = {sp.sstr(constant.stretch_squared)}",
            f"no state grows where x is: {intervals_text(contraction(constant))}",
            "after N steps the drift is stretch^N sin(N angle lost) along w; orthonormalized sin(N angle lost)",
        ]
    lines += ["", *_growth_lines(found.growth)]
    return "\n".join(lines)


def _growth_lines(gain: Growth) -> Iterator[str]:
    yield "growth in a step"
    for name, title in (("length", "length of the state - 1"), ("determinant", "determinant of C - 1")):
        terms = getattr(gain, name)
        if terms is None:
            continue
        if gain.invariant:
            rows = gain.invariant[name]
            text = " + ".join(f"h^{power} ({scalar_as_text(one)})" for power, one in rows.items())
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


def as_latex(found: Report) -> str:
    """Return a report as LaTeX: lines of an align environment of the package amsmath."""
    step = found.step
    rows: list[tuple[str, str]] = []
    if step.invariant:
        for power, one in step.invariant.items():
            rows.append((rf"h^{{{power}}}\!:\ \mathbf{{d}}", _wrapped(as_text(one.drift, notation=LATEX))))
            if one.symmetric:
                text = as_text(one.symmetric, symmetric=True, notation=LATEX)
                rows.append((rf"h^{{{power}}}\!:\ \mathbf{{Y}}", _wrapped(text)))
    else:
        for part in PARTS:
            rows += _latex_rows(rf"\mathrm{{{part}}}", step.expressions(part))
    if found.run is not None:
        rows += _latex_rows(r"\dot{\mathrm{drift}}", _sums(found.run.secular))
        rows += _latex_rows(r"\mathrm{bounded}", _sums(found.run.bounded))
    if found.constant is not None:
        rows.append((r"\delta(x)", sp.latex(found.constant.angle_lost)))
        rows.append((r"\rho(x)^{2}", sp.latex(found.constant.stretch_squared)))
    for name, symbol in (("length", r"|e| - 1"), ("determinant", r"\det C - 1")):
        terms = getattr(found.growth, name)
        if terms is None:
            continue
        if found.growth.invariant:
            text = " + ".join(
                rf"h^{{{power}}} \left({scalar_as_text(one, LATEX)}\right)"
                for power, one in found.growth.invariant[name].items()
            )
            rows.append((symbol, text or "0"))
        else:
            rows.append((symbol, sp.latex(sp.Add(*(x * STEP**p for p, x in terms.items())))))
    body = " \\\\\n".join(f"  {left} &= {right}" for left, right in rows)
    head = (
        f"% {step.kernel}, {step.motion} motion: what one step of length h loses\n"
        "% d: drift; Y: scale and skew, S(a, b) = a b' + b a'; delta: angle lost, rho: stretch, x = |w| h"
    )
    return f"{head}\n\\begin{{align*}}\n{body}\n\\end{{align*}}"


def _latex_rows(name: str, expressions: Sequence[sp.Expr]) -> list[tuple[str, str]]:
    return [
        (f"{name}_{axis}", sp.latex(expression)) for axis, expression in zip("xyz", expressions, strict=True)
    ]


def _wrapped(text: str, terms: int = 4) -> str:
    """Break a long sum of an align environment into lines."""
    parts = text.replace(" + ", "\n+ ").replace(" - ", "\n- ").split("\n")
    lines = [" ".join(parts[k : k + terms]) for k in range(0, len(parts), terms)]
    return " \\\\\n    &\\quad ".join(lines)
