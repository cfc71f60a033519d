"""`analyse` derives everything that `strapgen series` shows: the errors of one algorithm on one motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from strapgen.analysis.growth.growth import Growth, contraction, growth
from strapgen.analysis.series.accumulation import RunDrift, accumulate
from strapgen.analysis.series.constant_rate import ConstantRate, constant_rate
from strapgen.analysis.series.series import PARTS, ErrorSeries, series
from strapgen.catalogue import Choice
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import notebook_latex, short_repr
from strapgen.lab.motions.motion_files import is_file


@dataclass(frozen=True)
class ErrorAnalysis:
    """The errors of an algorithm on a motion."""

    #: Errors of one step
    step: ErrorSeries
    #: Change of length and determinant in a step
    growth: Growth
    #: Drift of a run; None for a general motion, or for the reason in `no_run`
    run: RunDrift | None
    #: Closed form of the errors at a constant rate
    constant: ConstantRate | None
    #: The reason why there is no closed form of a run; "" if there is one
    no_run: str = ""

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

    def as_dict(self) -> dict[str, Any]:
        """Return the analysis as plain JSON data, with expressions as text that SymPy can read."""
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
