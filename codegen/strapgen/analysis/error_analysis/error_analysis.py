"""`analyse` derives everything that `strapgen series` shows: the errors of one algorithm on one motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import sympy as sp

from strapgen.analysis.growth.growth import Growth, contraction, growth
from strapgen.analysis.series.accumulation import RunDrift, accumulate
from strapgen.analysis.series.constant_rate import ConstantRate, constant_rate
from strapgen.analysis.series.series import PARTS, ErrorSeries, series
from strapgen.catalogue import Choice
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import notebook_latex, short_repr
from strapgen.lab.motions.motion_names import is_file
from strapgen.results.records import INTERNAL, Record, entry


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
