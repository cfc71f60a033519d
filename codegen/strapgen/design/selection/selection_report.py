"""The selection for a brief as a result: drifts by cause, costs, exceeded limits; and the firmware files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from strapgen import registration
from strapgen.catalogue.methods.shaped_coning import ShapedConing
from strapgen.catalogue.methods.window import Window
from strapgen.design import coning_design, family
from strapgen.design.brief import DesignBrief
from strapgen.design.frontier import Candidate
from strapgen.design.selection import causes
from strapgen.design.selection.candidates import TUNED, Algorithm, AttitudeStep, is_tuned_window, window_brief
from strapgen.design.selection.judgement import CAUSES, Judgement, verdicts
from strapgen.design.selection.simulated import RANDOM_RUNS, RandomDrift, Simulated
from strapgen.results.records import entry, keyed_table
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable

#: Format of a drift, and of a cost.
_DRIFT, _COUNT = ".2g", ".0f"
#: Most rows of those that meet the brief, and of the others, in a text for a reader.
_MOST_ACCEPTED, _MOST_REFUSED = 20, 12


@dataclass(frozen=True)
class JudgedAlgorithm:
    """An algorithm with its drift by cause and its cost, and whether it meets a brief."""

    judgement: Judgement = field(metadata=entry(spread=True))
    #: Drifts in time simulations by cause
    simulated_deg_h: Simulated | None = field(metadata=entry(optional=True))


@dataclass(frozen=True)
class SelectionResult(Result):
    """The algorithms for a brief: drifts by cause, costs, and exceeded limits."""

    row: ClassVar[type | None] = JudgedAlgorithm
    drawn_by: ClassVar[str] = "strapgen.design.design_plots:selection_image"

    brief: DesignBrief
    ordered: Sequence[Judgement]
    simulated: Mapping[str, Simulated] | None
    #: Name of the brief
    name: str

    def rows(self) -> list[JudgedAlgorithm]:
        """Return the algorithms in their order."""
        return [JudgedAlgorithm(one, (self.simulated or {}).get(one.name)) for one in self.ordered]

    def table(self) -> TextTable:
        """Return all figures, a row for each algorithm."""
        names = ["name", "meets", "binding", "operations_per_s", "carry"]
        more = ["velocity_m_s", "position_m", "instructions_per_s", "bytes"]
        columns = [*names, *(f"{cause}_deg_h" for cause in CAUSES), *more, "reason"]
        rows = []
        for one in self.ordered:
            row = vars(one) | {f"{cause}_deg_h": one.drift_deg_h[cause] for cause in CAUSES}
            row |= {"meets": "yes" if one.meets else "no"}
            rows.append({name: row[name] for name in columns})
        return keyed_table(rows)

    def reader(self) -> TextTable:
        """Return what a reader compares."""
        return _table(self.brief, self.ordered, refused=True)

    def text(self) -> str:
        """Return the answer for a reader."""
        return _text(self.brief, self.ordered, self.simulated or {})


def _table(brief: DesignBrief, ordered: Sequence[Judgement], refused: bool) -> TextTable:
    """Return the table for a reader: drifts by cause, and costs."""
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
    """Return the exceeded limit of an algorithm."""
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


#: The report, the coefficients that a design has computed, and the description of two speeds.
REPORT, COEFFICIENTS, SYSTEM = "design.txt", "coefficients.toml", "system.toml"


def firmware_files(
    brief: DesignBrief, judgement: Judgement, algorithm: Algorithm, report: str, command: str
) -> dict[str, str]:
    """Return the files of a selected algorithm by their names."""
    if not isinstance(algorithm, AttitudeStep):
        described: Any = algorithm  # the loops of two speeds, the code of a described system
        options = f"--target c-fixed --word {brief.processor.word}"
        code = described.sources(f"strapgen system {SYSTEM} {options}").step_files
        return {**code, SYSTEM: described.file(), REPORT: report}
    choice = algorithm.choice
    settings = causes.settings(choice, brief, judgement.carry)
    if judgement.method.startswith(TUNED) and isinstance(choice.method, ShapedConing | Window):
        choice = replace(choice, method=replace(choice.method, file=COEFFICIENTS))
    writer = registration.extension("generate.project", "--out")
    files: dict[str, str] = writer.project_files(choice, "c-fixed", settings)
    if judgement.method.startswith(TUNED) and isinstance(choice.method, ShapedConing):
        files[COEFFICIENTS] = coning_design.written(choice.method, command)
    if is_tuned_window(judgement.method):
        samples = judgement.increments, judgement.previous, judgement.ahead
        wanted = window_brief(brief, Candidate(judgement.method, *samples))
        files[COEFFICIENTS] = family.written(family.design(wanted), command)
    return files | {REPORT: report}
