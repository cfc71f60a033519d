"""The results of a page: the JSON data of commands, each under the command line that prints it again."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from strapgen.cli.generated_result import GeneratedSources, GenerateResult
from strapgen.design.frontier import FrontierResult, Standing
from strapgen.ir import checks
from strapgen.ir.fixed_settings import Settings
from strapgen.lab.compare.comparison_report import ComparedKernel, ComparisonResult
from strapgen.lab.converge.convergence_report import ConvergenceResult
from strapgen.lab.simulate.runs_report import RunResult, step_facts
from strapgen.report.conditions import Conditions
from strapgen.report.dossier import REFERENCE, AlgorithmDossier, StepRuns, run_settings
from strapgen.report.gathering import motions
from strapgen.results.display.formulas import KernelResult
from strapgen.targets import contract
from strapgen.thesis.tables_report import ThesisTablesResult
from strapgen.thesis.thesis_tables import TableEntry

#: What makes every command print its data.
_JSON = "--format json"


@dataclass(frozen=True)
class CommandResult:
    """What a command prints as JSON."""

    #: The command line
    command: str
    #: Plain JSON data. The lists of files that `generate` writes are empty, since nothing is written
    data: Any

    def as_dict(self) -> dict[str, Any]:
        """Return the result as plain JSON data."""
        return {"command": self.command, "data": self.data}


def arguments(known: AlgorithmDossier) -> str:
    """Return name and options of a kernel on the command line."""
    stated = known.program.arguments
    return known.choice.kernel if stated.startswith("strapgen ") else stated


def of_algorithm(known: AlgorithmDossier, conditions: Conditions) -> dict[str, CommandResult]:
    """Return the results of one algorithm by the names of the commands; `generate` is that of fixed point."""
    formulas = KernelResult.of(known.kernel, known.program, "operations")
    derive = f"strapgen derive {arguments(known)} --show operations {_JSON}"
    results = {"derive": CommandResult(derive, formulas.data())}
    if known.fixed is not None:
        command = f"{contract.command(known.fixed, 'c-fixed')} {_JSON}"
        generated = GeneratedSources.of(known.choice, known.sources["c-fixed"], "c-fixed", ())
        results["generate"] = CommandResult(command, GenerateResult([generated]).data())
    if known.runs is not None:
        results |= _of_runs(known, known.runs, conditions)
    return results


def _of_runs(known: AlgorithmDossier, runs: StepRuns, conditions: Conditions) -> dict[str, CommandResult]:
    """Return the results of the runs of a step."""
    step, schedule = arguments(known), runs.schedule
    where = f"{conditions.options} {schedule.options}"
    simulate = f"strapgen simulate {step} {where} --record {schedule.record} {_JSON}"
    facts = step_facts(runs.backend, known.choice) | {
        "motion": runs.profile.name,
        "step_s": float(schedule.step),
        "duration_s": float(schedule.duration),
    }
    results = {"simulate": CommandResult(simulate, RunResult(facts, runs.run).data())}
    if runs.comparison:
        names = ",".join(row.backend for row in runs.comparison)
        rounding = _rounding(runs.settings) if any("fixed" in row.backend for row in runs.comparison) else ""
        compare = (
            f"strapgen compare {step} --backend {names} --reference {REFERENCE} {where}{rounding} {_JSON}"
        )
        compared = ComparedKernel(known.choice.kernel, "", runs.comparison)
        results["compare"] = CommandResult(compare, ComparisonResult([compared], REFERENCE, "").data())
    ladder = ConvergenceResult([runs.ladder], "").data()
    results["converge"] = CommandResult(f"strapgen converge {step} {_JSON}", ladder)
    return results


def _rounding(settings: Settings) -> str:
    """Return the options of settings that differ from the default of a run."""
    plain, words = run_settings(None), ""
    for name in ("rounding", "carry"):
        if getattr(settings, name) != getattr(plain, name):
            words += f" --{name} {getattr(settings, name)}"
    return words


def of_tables(entries: Iterable[TableEntry], backends: Sequence[str]) -> CommandResult:
    """Return the tables of the thesis as the result of `tables`."""
    command = f"strapgen tables --backend {','.join(backends)} {_JSON}"
    return CommandResult(command, ThesisTablesResult([*entries]).data())


def of_frontier(
    standings: Sequence[Standing], methods: Sequence[str], conditions: Conditions
) -> CommandResult:
    """Return what algorithms cost and how they drift as the result of `frontier`."""
    words = f"--sample-hz {conditions.sample_hz} --duration {conditions.duration}"
    names = shlex.quote(",".join(methods))
    command = f"strapgen frontier --method {names} {conditions.options} {words} {_JSON}"
    hertz, seconds = (float(checks.number("", text)) for text in (conditions.sample_hz, conditions.duration))
    return CommandResult(command, FrontierResult(standings, hertz, seconds, motions(conditions)).data())
