"""Agreement runs an algorithm with smaller and smaller steps and sets its drift beside the predicted drift.

Both are computed in many digits, so that rounding does not hide a difference.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any

import mpmath

from strapgen.analysis.series.error_rate import error_rate
from strapgen.analysis.series.prediction import Prediction, follow, parts_of, transfers_of
from strapgen.catalogue import Choice
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motions import GENERAL, Motion
from strapgen.lab.runs import exact_attitudes, step_of_increments
from strapgen.results.table import SECONDS, Column, TextTable
from strapgen.run import exact


@dataclass(frozen=True)
class StepAgreement:
    """Predicted and simulated drift for one step length."""

    step_s: float
    #: In s
    times: list[float]
    #: Drift on x, y, z at each time, in rad
    simulated: list[list[float]]
    predicted: list[list[float]]
    #: Largest simulated drift, in rad
    drift: float
    #: Largest difference of predicted and simulated drift, in rad
    difference: float


@dataclass(frozen=True)
class Agreement:
    """Predicted and simulated drift for a sequence of step lengths."""

    kernel: str
    motion: str
    #: Number of powers of the step in the prediction
    terms: int
    #: The first power of the error rate; None if there is no error
    order: int | None
    #: One for each step length, from the longest to the shortest
    rungs: tuple[StepAgreement, ...]

    @property
    def slopes(self) -> list[float]:
        """Slope of the difference against the step in a log-log plot, from each step to the next."""
        return [
            math.log(long.difference / short.difference) / math.log(long.step_s / short.step_s)
            for long, short in pairwise(self.rungs)
            if long.difference and short.difference
        ]


def agreement(
    choice: Choice,
    motion: Motion,
    steps: Sequence[float | str | Fraction],
    duration: float | str | Fraction,
    terms: int = 2,
) -> Agreement:
    """Compare predicted with simulated drift.

    `steps`: steps in s; each divides the longest one, and that divides the duration. `duration`: in s.

    >>> from strapgen import catalogue
    >>> from strapgen.lab.motions.motions import motion
    >>> turn = motion("constant", y_rad_s=1)
    >>> found = agreement(catalogue.choose("dcm", "rk2", 1), turn, ["1/8", "1/16"], 1, terms=1)
    >>> found.order, round(found.slopes[0], 1)
    (2, 4.0)
    """
    kernel = step_of_increments(choice)
    total = checks.number("duration", duration, positive=True)
    lengths = sorted({checks.number("step", step, positive=True) for step in steps}, reverse=True)
    if not lengths:
        raise InputError("at least one step is needed")
    longest = lengths[0]
    checks.multiple("duration", total, "step", longest)
    for length in lengths:
        checks.multiple("the longest step", longest, "step", length)
    run = exact_attitudes(choice, motion)
    rates = error_rate(choice, motion.name, terms)
    transfers = transfers_of(rates, motion)
    rungs = []
    for length in lengths:
        every = checks.multiple("the longest step", longest, "step", length)
        expected = follow(choice, motion, transfers, length, total, record=longest)
        with mpmath.workdps(exact.DIGITS):
            split = parts_of()
            states = list(run(length, int(total / length)))[::every]
            drifts = [split(computed, true)[2] for computed, true in states]
            rungs.append(_at_step(length, expected, drifts))
    return Agreement(kernel.name, motion.name, terms, rates.order, tuple(rungs))


def _at_step(length: Fraction, expected: Prediction, drifts: list[list[Any]]) -> StepAgreement:
    rows = list(zip(expected.drift, drifts, strict=True))
    return StepAgreement(
        float(length),
        [float(time) for time in expected.times],
        [[float(x) for x in row] for row in drifts],
        [[float(x) for x in row] for row in expected.drift],
        float(max(abs(x) for row in drifts for x in row)),
        float(max(abs(a - b) for one, other in rows for a, b in zip(one, other, strict=True))),
    )


#: Default parameters of the motions, with rates of about 1 rad/s.
SETTINGS: dict[str, dict[str, str]] = {
    "constant": {"x_rad_s": "0.5", "y_rad_s": "0.7", "z_rad_s": "-0.3"},
    "sinusoidal": {"a_rad_s": "1", "b_rad_s": "1.5"},
    "coning": GENERAL,
    "polynomial": {"a0": "30", "a1": "40", "a2": "-20", "a3": "10", "a4": "5"},
}


def default_steps(choice: Choice) -> tuple[str, ...]:
    """Return steps in s, halved from one to the next, on which the term after the predicted ones can be seen."""
    return (
        ("1/4", "1/8", "1/16", "1/32") if choice.increments_per_step > 4 else ("1/8", "1/16", "1/32", "1/64")
    )


_COLUMNS = (
    Column("step, s", spec=SECONDS, least=12),
    Column("simulated", spec=".4e", least=12),
    Column("difference", spec=".4e", least=12),
    Column("relative", spec=".1e", least=9),
    Column("slope", "<", ".2f", missing=""),
)


def agreement_text(agreement: Agreement) -> str:
    """Return the agreement as a table: a row for every step length."""
    slopes: list[float | None] = [None, *agreement.slopes]
    slopes += [None] * (len(agreement.rungs) - len(slopes))
    rows = [
        (
            rung.step_s,
            rung.drift,
            rung.difference,
            rung.difference / rung.drift if rung.drift else None,
            slope,
        )
        for rung, slope in zip(agreement.rungs, slopes, strict=True)
    ]
    title = (
        f"{agreement.kernel}, {agreement.motion} motion: drift in rad, "
        f"simulated and predicted by {agreement.terms} terms"
    )
    return f"{title}\n{TextTable(_COLUMNS, rows).as_text()}"
