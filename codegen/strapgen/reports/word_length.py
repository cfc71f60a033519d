"""Word lengths and their drift, as text and CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence

from strapgen.experiments.word_length import Outcome


def word_length_csv(outcomes: Sequence[Outcome]) -> str:
    """Return outcomes as comma-separated values."""
    buffer = io.StringIO()
    rows = [outcome.as_dict() for outcome in outcomes]
    for row in rows:
        row["settings"] = " ".join(f"{key}={value}" for key, value in row["settings"].items())
    writer = csv.DictWriter(buffer, rows[0].keys(), lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: "" if value is None else value for key, value in row.items()} for row in rows)
    return buffer.getvalue()


def word_length_text(outcomes: Sequence[Outcome]) -> str:
    """Return outcomes as tables for a reader: one for each method, step and pulse, a row for each word and carry."""
    lines: list[str] = []
    groups: dict[tuple[str, str, str], list[Outcome]] = {}
    for outcome in outcomes:
        case = outcome.case
        groups.setdefault((case.method, case.step, case.pulse_arcsec), []).append(outcome)
    for (method, step, pulse), group in groups.items():
        case, first = group[0].case, group[0]
        words = ", ".join(f"{key}={value}" for key, value in case.settings)
        gyro = "increments rounded to their format" if float(pulse) == 0 else f"pulses of {pulse} arcsec"
        lines += [
            f"{case.algorithm} {method}, step {step} s, {case.duration} s of {case.motion} motion ({words}), {gyro}",
            f"the method itself drifts by {first.truncation_deg:.3g} deg",
            "",
            f"{'word':>6}  {'rounding':<11}{'carry':<7}{'drift':>10}{'arithmetic':>12}{'certified':>11}"
            f"{'increments':>12}  most from",
        ]
        for outcome in group:
            lines.append(
                f"{outcome.case.word:>6}  {outcome.case.rounding:<11}{outcome.case.carry:<7}"
                f"{_angle(outcome.drift_deg):>10}{_angle(outcome.rounding_deg):>12}"
                f"{_angle(outcome.bound_deg):>11}{_angle(outcome.quantization_deg):>12}  {outcome.dominates}"
            )
        lines.append("")
    lines += [
        "all angles in deg, the largest along the run: lengths of the drift vector, where a mean drift adds up what is",
        "largest on each axis; -: the state leaves its range, or no bound is known",
    ]
    return "\n".join(lines)


def _angle(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"
