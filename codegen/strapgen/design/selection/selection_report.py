"""Reports which algorithms meet a brief: every cause of drift, what each costs, and what binds the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from strapgen.design.brief import DesignBrief
from strapgen.design.selection.answer import verdicts
from strapgen.design.selection.judgement import CAUSES, Judgement
from strapgen.design.selection.simulated import RANDOM_RUNS, RandomDrift, Simulated
from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable

#: Format of a drift, and of a cost.
_DRIFT, _COUNT = ".2g", ".0f"
#: Most rows of those that meet the brief, and of the others, in a text for a reader.
_MOST_ACCEPTED, _MOST_REFUSED = 20, 12


def selection_report(
    brief: DesignBrief, ordered: Sequence[Judgement], simulated: Mapping[str, Simulated] | None = None
) -> Report:
    """Return the judgements of algorithms as a report."""
    return Report(
        lambda: _text(brief, ordered, simulated or {}),
        lambda: [_as_dict(one) | _runs(one, simulated or {}) for one in ordered],
        lambda: _flat(ordered),
        lambda: _table(brief, ordered, refused=True),
    )


def _as_dict(one: Judgement) -> dict[str, Any]:
    """Return a judgement as JSON data, the promised keys first."""
    first = {
        "name": one.name,
        "meets": one.meets,
        "binding": one.binding,
        "drift_deg_h": {cause: one.drift_deg_h[cause] for cause in CAUSES},
        "operations_per_s": one.operations_per_s,
    }
    return first | {name: value for name, value in vars(one).items() if name not in first}


def _runs(one: Judgement, simulated: Mapping[str, Simulated]) -> dict[str, Any]:
    """Return the drifts of a time simulation as JSON data, if there is one."""
    if one.name not in simulated:
        return {}
    run = vars(simulated[one.name])
    drifts = {
        cause: drift._asdict() if isinstance(drift, RandomDrift) else drift for cause, drift in run.items()
    }
    return {"simulated_deg_h": drifts}


def _flat(ordered: Sequence[Judgement]) -> TextTable:
    """Return all figures, a row for each algorithm."""
    names = ["name", "meets", "binding", "operations_per_s", "carry"]
    more = ["velocity_m_s", "position_m", "instructions_per_s", "bytes"]
    columns = [*names, *(f"{cause}_deg_h" for cause in CAUSES), *more, "reason"]
    rows = []
    for one in ordered:
        row = vars(one) | {f"{cause}_deg_h": one.drift_deg_h[cause] for cause in CAUSES}
        row |= {"meets": "yes" if one.meets else "no"}
        rows.append([row[name] for name in columns])
    texts = ("name", "meets", "binding", "carry", "reason")
    return TextTable([Column(name, "<" if name in texts else ">", missing="") for name in columns], rows)


def _table(brief: DesignBrief, ordered: Sequence[Judgement], refused: bool) -> TextTable:
    """Return what a reader compares: drifts by cause, and costs."""
    measured = brief.processor.is_measured
    columns = [
        Column("algorithm", "<"),
        *(Column(cause, spec=_DRIFT, group="drift in deg/h") for cause in CAUSES),
        Column("operations/s", spec=_COUNT),
    ]
    if measured:
        columns += [Column("instructions/s", spec=_COUNT), Column("bytes", spec=_COUNT)]
    columns.append(Column("exceeds" if refused else "error feedback", "<"))
    rows = []
    for one in ordered:
        row: list[Any] = [one.name, *(one.drift_deg_h[cause] for cause in CAUSES), one.operations_per_s]
        if measured:
            row += [one.instructions_per_s, one.bytes]
        rows.append([*row, _exceeded(one) if refused else one.carry])
    return TextTable(columns, rows)


def _exceeded(one: Judgement) -> str:
    """Return what an algorithm exceeds."""
    return f"{one.binding}, in its run" if one.run_deg_h is not None else one.binding or ""


def _text(brief: DesignBrief, ordered: Sequence[Judgement], simulated: Mapping[str, Simulated]) -> str:
    """Return the answer for a reader."""
    accepted = [one for one in ordered if one.meets]
    others = [one for one in ordered if not one.meets]
    lines = [
        f"{sentence}." for sentence in (one[:1].upper() + one[1:] for one in verdicts(brief, [*ordered]))
    ]
    if accepted:
        first = accepted[:_MOST_ACCEPTED]
        lines += ["", f"meets the brief, the cheapest {len(first)} of {len(accepted)}{_run_of(first)}", ""]
        lines += _table(brief, first, refused=False).lines()
    if simulated:
        lines += [
            "",
            f"drift in deg/h, predicted and in time; of random causes the 95 % interval of {RANDOM_RUNS} runs",
            "",
            *_simulated(ordered, simulated),
        ]
    if others:
        nearest = sorted(others, key=lambda one: (one.binding == "operations_per_s", one.operations_per_s))
        shown = nearest[:_MOST_REFUSED]
        lines += [
            "",
            f"does not meet it, the cheapest {len(shown)} of {len(others)}; - was not looked at",
            "",
        ]
        lines += _table(brief, shown, refused=True).lines()
    return "\n".join(lines)


def _run_of(accepted: Sequence[Judgement]) -> str:
    """Return which verdicts a run has confirmed."""
    if accepted[0].run_deg_h is None:
        return ""
    return (
        "; its run confirms it"
        if len(accepted) == 1
        else "; the run of the first confirms it, the others are predicted"
    )


def _simulated(accepted: Sequence[Judgement], simulated: Mapping[str, Simulated]) -> list[str]:
    """Return predicted drifts beside those of time simulations."""
    columns = [Column("algorithm", "<")]
    for cause in CAUSES:
        columns += [Column("predicted", spec=_DRIFT, group=cause), Column("run", group=cause)]
    rows = []
    for one in accepted:
        if one.name in simulated:
            pairs = [(one.drift_deg_h[cause], _run(getattr(simulated[one.name], cause))) for cause in CAUSES]
            rows.append([one.name, *(value for pair in pairs for value in pair)])
    return TextTable(columns, rows).lines()


def _run(drift: float | RandomDrift | None) -> str | None:
    """Return the drift of a run, or the interval of random runs."""
    if isinstance(drift, RandomDrift):
        return f"{drift.low:.2g}..{drift.high:.2g}"
    return None if drift is None else f"{drift:{_DRIFT}}"
