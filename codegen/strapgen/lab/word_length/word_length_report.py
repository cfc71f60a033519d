"""The word-length study as a result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from strapgen.lab.word_length.word_length import Outcome, noise_of
from strapgen.results.result import Result
from strapgen.results.table import ANGLE, Column, TextTable

_COLUMNS = (
    Column("word", least=6),
    Column("rounding", "<", least=10),
    Column("carry", "<", least=7, gap=1),
    Column("drift", spec=ANGLE, least=8),
    Column("arithmetic", spec=ANGLE),
    Column("certified", spec=ANGLE),
    Column("increments", spec=ANGLE),
    Column("most from", "<"),
)
_NOTES = (
    "all angles in deg, the largest along the run: lengths of the drift vector, where a mean drift adds up what is",
    "largest on each axis; -: the state leaves its range, or no bound is known",
)


def settings_text(outcome: Outcome, separator: str = ", ") -> str:
    """Return the settings of the motion of an outcome as text."""
    return separator.join(f"{key}={value}" for key, value in outcome.case.settings)


def by_method_step_and_pulse(outcomes: Sequence[Outcome]) -> dict[tuple[str, str, str], list[Outcome]]:
    """Return outcomes in groups that differ in word, rounding and carry alone: those of one table, or one panel."""
    groups: dict[tuple[str, str, str], list[Outcome]] = {}
    for outcome in outcomes:
        case = outcome.case
        groups.setdefault((case.method, case.step, case.pulse_arcsec), []).append(outcome)
    return groups


@dataclass(frozen=True)
class WordLengthResult(Result):
    """Drift against word length, with its parts: a row for each run."""

    rows_in = "outcomes"
    row = Outcome
    drawn_by = "strapgen.lab.word_length.word_length_plot:word_length_image"

    outcomes: Sequence[Outcome]

    def text(self) -> str:
        """Return a table for each method, step and pulse, with a row for each word and carry."""
        return _text(self.outcomes)


def _text(outcomes: Sequence[Outcome]) -> str:
    lines: list[str] = []
    for (method, step, pulse), group in by_method_step_and_pulse(outcomes).items():
        first = group[0]
        case = first.case
        gyro = "increments rounded to their format" if float(pulse) == 0 else f"pulses of {pulse} arcsec"
        lines += [
            f"{case.algorithm} {method}, step {step} s, {case.duration} s of {case.motion} motion"
            f"{f' ({settings_text(first)})' if case.settings else ''}, {gyro}",
            f"the method itself drifts by {first.truncation_deg:{ANGLE}} deg",
            *_expected(first),
            "",
            *TextTable(_COLUMNS, [_cells(outcome) for outcome in group]).lines(),
            "",
        ]
    return "\n".join([*lines, *_NOTES])


def _expected(outcome: Outcome) -> list[str]:
    """Return what the pulses of a case are expected to do, in a line of text; none without pulses."""
    if outcome.expected_deg is None:
        return []
    case = outcome.case
    across = noise_of(case.algorithm, case.method, case.increments).across()
    return [
        f"pulses turn it by {outcome.expected_deg:{ANGLE}} deg rms at the end if their errors are independent; the "
        "variance across",
        f"a rate w is {across} for a pulse q, a step h and a time t",
    ]


def _cells(outcome: Outcome) -> list[Any]:
    return [
        outcome.case.word,
        outcome.case.rounding,
        outcome.case.carry,
        outcome.drift_deg,
        outcome.rounding_deg,
        outcome.bound_deg,
        outcome.quantization_deg,
        outcome.dominates,
    ]
