"""The word-length study as a result."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from strapgen.lab.word_length import Outcome, noise_of
from strapgen.results import figures
from strapgen.results.result import Result
from strapgen.results.table import ANGLE, Column, TextTable

_COLUMNS = (
    Column("word", least=6),
    Column("rounding", "<", least=10),
    Column("carry", "<", least=7, gap=1),
    Column("drift", spec=ANGLE, least=8),
    Column("arithmetic", spec=ANGLE),
    Column("+-", spec=".1e"),
    Column("certified", spec=ANGLE),
    Column("increments", spec=ANGLE),
    Column("most from", "<"),
)
_NOTES = (
    "all angles in deg, the largest along the run: lengths of the drift vector, where a mean drift adds up what is",
    "largest on each axis; +-: radius in which the angle of the arithmetic is certain; -: the state leaves its range,",
    "or no bound is known",
)

#: Which rounding errors each carry feeds back, in the words of the legend.
_FEEDBACK = {"none": "no error feedback", "state": "feedback of the state", "full": "full feedback"}


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
    row: ClassVar[type | None] = Outcome
    drawn_by: ClassVar[str] = "strapgen.lab.word_length_report:word_length_image"

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
    """Return the expected noise of the pulses of a case in a line of text; none without pulses."""
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
        outcome.rounding_radius_deg,
        outcome.bound_deg,
        outcome.quantization_deg,
        outcome.dominates,
    ]


def word_length_image(result: WordLengthResult, path: str | Path) -> bytes:
    """Return drift against word length: a panel for each method, step and pulse, a line for each rounding and carry.

    Of one word and several steps it is drift against operations, see `_operations_image`. Dotted, in the colour of its
    line, the certified bound of the rounding, on top of what else moves the drift; dashed the floor of the method, and
    where gyro pulses set a higher one, that.
    """
    outcomes = result.outcomes
    steps, words = ({getattr(o.case, name) for o in outcomes} for name in ("step", "word"))
    if len(words) == 1 and len(steps) > 1:
        return _operations_image(outcomes, path)
    panels = by_method_step_and_pulse(outcomes)
    columns = min(3, len(panels))
    rows = -(-len(panels) // columns)
    size = (2.6 + 4.6 * columns, 0.9 + 3.9 * rows)
    figure, grid = figures.grid_of_axes(rows, columns, size, sharey=True)
    used, unused = list(grid.flat)[: len(panels)], list(grid.flat)[len(panels) :]
    for axes, ((method, step, pulse), group) in zip(used, panels.items(), strict=True):
        _draw_panel(axes, group)
        pulses = "" if float(pulse) == 0 else f", pulses of {pulse}\u2033"
        axes.set_title(f"{method}, step {step} s{pulses}", loc="left", fontsize=10)
    for axes in unused:
        axes.set_visible(False)
    for axes in grid[-1]:
        axes.set_xlabel("word, bits")
    for axes in grid[:, 0]:
        axes.set_ylabel("largest drift of the run, deg")
    figures.common_legend(figure, used, loc="outside right center")
    case = outcomes[0].case
    figures.title(
        figure,
        f"{case.algorithm}: drift against word length\n"
        f"{case.duration} s of {case.motion} motion, {settings_text(outcomes[0])}",
    )
    return figures.image(figure, path)


def _operations_image(outcomes: Sequence[Outcome], path: str | Path) -> bytes:
    """Return drift against operations in a second, a line for each method over its steps; dashed what truncation is."""
    figure, grid = figures.grid_of_axes(1, 1, (9.5, 5.2))
    axes = grid[0, 0]
    kinds = list(
        dict.fromkeys((o.case.method, o.case.rounding, o.case.carry, o.case.pulse_arcsec) for o in outcomes)
    )
    varied = [len({kind[place] for kind in kinds}) > 1 for place in range(4)]
    for kind, colour in zip(kinds, figures.several_colours(len(kinds)), strict=True):
        line = [
            o for o in outcomes if (o.case.method, o.case.rounding, o.case.carry, o.case.pulse_arcsec) == kind
        ]
        line.sort(key=lambda outcome: outcome.operations_per_s)
        rates = [outcome.operations_per_s for outcome in line]
        drifts = [math.nan if outcome.drift_deg is None else outcome.drift_deg for outcome in line]
        label = ", ".join(part for part, several in zip(kind, varied, strict=True) if several) or kind[0]
        axes.plot(rates, drifts, "o-", color=colour, linewidth=1.4, markersize=4, label=label)
        axes.plot(rates, [o.truncation_deg for o in line], "--", color=colour, linewidth=0.9)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("operations in a second")
    axes.set_ylabel("largest drift of the run, deg")
    axes.plot([], [], "--", color="0.4", linewidth=0.9, label="truncation alone")
    axes.legend(fontsize=9, frameon=False)
    figures.style(axes)
    case = outcomes[0].case
    figures.title(
        figure,
        f"{case.algorithm}, words of {case.word} bits: drift against operations, a point for each step\n"
        f"{case.duration} s of {case.motion} motion, {settings_text(outcomes[0])}",
    )
    return figures.image(figure, path)


def _draw_panel(axes: Any, group: Sequence[Outcome]) -> None:
    """Draw the outcomes of one method, step and pulse."""
    lines: dict[tuple[str, str], list[Outcome]] = {}
    for outcome in group:
        lines.setdefault((outcome.case.rounding, outcome.case.carry), []).append(outcome)
    for number, ((rounding, carry), line) in enumerate(lines.items()):
        label = _FEEDBACK[carry] if rounding == "nearest" else f"{_FEEDBACK[carry]}, {rounding}"
        _draw_line(axes, number, line, label)
    first = group[0]
    floor = {"color": "0.35", "linewidth": 1.0}
    axes.axhline(first.truncation_deg, linestyle="--", label="floor of the method", **floor)
    longest = max(group, key=lambda outcome: outcome.case.word)
    if float(longest.case.pulse_arcsec) and longest.quantization_deg > first.truncation_deg:
        axes.axhline(longest.quantization_deg, linestyle="-.", label="floor of the pulses", **floor)
    axes.set_xticks(sorted({outcome.case.word for outcome in group}))
    axes.set_yscale("log")
    figures.style(axes)
    # More than half a turn is as wrong as can be.
    low = min((o.truncation_deg for o in group if o.truncation_deg), default=1e-12)
    axes.set_ylim(low / 10, 360)


def _draw_line(axes: Any, number: int, line: Sequence[Outcome], label: str) -> None:
    """Draw drift and certified bound of one rounding and carry."""
    ordered = sorted(line, key=lambda outcome: outcome.case.word)
    words = [outcome.case.word for outcome in ordered]
    drifts = [math.nan if outcome.drift_deg is None else outcome.drift_deg for outcome in ordered]
    certified = [
        math.nan if o.bound_deg is None else o.bound_deg + o.truncation_deg + o.quantization_deg
        for o in ordered
    ]
    colour = figures.COLOURS[number % len(figures.COLOURS)]
    # Lines that fall together stay apart by their markers.
    style = {"marker": "osD^v<>"[number % 7], "markersize": 7 - 1.5 * (number % 3), "fillstyle": "none"}
    axes.plot(words, drifts, color=colour, linewidth=1.4, label=label, **style)
    axes.plot(
        words,
        certified,
        color=colour,
        linewidth=1.4,
        linestyle=":",
        label=f"{label}: certified",
    )
