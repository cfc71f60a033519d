"""The part of the page on one algorithm: interface, formulas, formats, bounds, code and evidence."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from strapgen.cli.generated_result import GeneratedSources, GenerateResult
from strapgen.design.frontier import DriftAndCost, FrontierResult
from strapgen.evidence.collection import Subject
from strapgen.evidence.evidence_report import EvidencePage
from strapgen.ir import checks
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import above, below
from strapgen.ir.integer_program import FixedProgram, used_by
from strapgen.ir.signals import FRAMES, Signal
from strapgen.lab.comparison_report import ComparedKernel, ComparisonResult
from strapgen.lab.convergence_report import ConvergenceResult
from strapgen.lab.runs_report import RunResult, step_facts
from strapgen.report.dossier import REFERENCE, AlgorithmDossier, Conditions, StepRuns, motions, run_settings
from strapgen.report.mathml import FormulaRow, equations
from strapgen.results.display.formulas import KernelResult, as_latex
from strapgen.targets import contract
from strapgen.targets.contract import operations_text
from strapgen.thesis.tables_report import ThesisTablesResult
from strapgen.thesis.thesis_tables import TableEntry

#: What targets are called on the page.
TARGET_TITLES = {
    "numpy": "Python with numpy",
    "c": "C in double",
    "c-float": "C in float",
    "c-fixed": "C in fixed point",
}

#: The "command" that prints a result, and its plain JSON "data". The lists of files that `generate` writes are empty,
#: since nothing is written.
CommandResult = dict[str, Any]


@dataclass(frozen=True)
class _SignalRow:
    """A row of the table of inputs and outputs."""

    #: "in" or "out"
    direction: str
    #: In words
    name: str
    shape: str
    unit: str
    frame: str
    meaning: str
    #: Of fixed point; "" where there is none
    format: str = ""
    range: str = ""
    bound: str = ""


@dataclass(frozen=True)
class AlgorithmView:
    """The content of the page on one algorithm."""

    #: The kernel in words; `order` is "" for what is no step
    name: str
    title: str
    source: str
    operations: str
    order: str
    notes: tuple[str, ...]
    signals: tuple[_SignalRow, ...]
    formulas: tuple[FormulaRow, ...]
    #: Name, format, range and error bound of every value on the way in fixed point
    values: tuple[tuple[str, str, str, str], ...]
    #: Why there is no fixed point
    no_fixed: str
    #: By the title of the target, for each file its name, text, and language, "python" or "c", which the page colours
    code: dict[str, list[dict[str, str]]]
    #: A result by claim; empty where the tools have not run on this very code
    evidence: dict[str, str]
    #: What back ends say that do not hold the run
    refused: dict[str, str]


def view(known: AlgorithmDossier, evidence: EvidencePage | None) -> AlgorithmView:
    """Return the content of the page on an algorithm."""
    kernel, order = known.kernel, known.kernel.order
    return AlgorithmView(
        known.choice.kernel,
        kernel.title,
        kernel.source,
        operations_text(known.program),
        "" if order is None else f"{order.step}: {order}",
        tuple(known.program.notes),
        tuple(_signals(known)),
        tuple(equations(as_latex(kernel))),
        () if known.fixed is None else tuple(_values(known.fixed)),
        known.no_fixed,
        {TARGET_TITLES[target]: _files(sources.step_files) for target, sources in known.sources.items()},
        {} if evidence is None or known.fixed is None else _evidence(known, known.fixed, evidence),
        {} if known.runs is None else known.runs.refused,
    )


def _signals(known: AlgorithmDossier) -> Iterable[_SignalRow]:
    arguments = (
        {}
        if known.fixed is None
        else {a.signal.name: a for a in (*known.fixed.interface.inputs, *known.fixed.interface.outputs)}
    )
    outputs = (("out", stage.signal) for stage in known.kernel.outputs)
    for direction, signal in (*(("in", signal) for signal in known.kernel.inputs), *outputs):
        fixed: dict[str, str] = {}
        if (argument := arguments.get(signal.name)) is not None:
            low, high, bound = (
                argument.low * argument.unit,
                argument.high * argument.unit,
                max(argument.errors),
            )
            fixed = {"format": str(argument.format), "range": f"{below(low)} to {above(high)}"}
            fixed["bound"] = "" if direction == "in" else above(bound, 4) if bound else "exact"
        yield _SignalRow(
            direction,
            signal.name,
            " × ".join(map(str, signal.shape)) or "scalar",
            signal.unit,
            _frame(signal),
            signal.meaning,
            **fixed,
        )


def _frame(signal: Signal) -> str:
    """Return the frame of a signal in words."""
    return " to ".join(FRAMES.get(part, part) for part in signal.frame.split(" to "))


def _values(fixed: FixedProgram) -> Iterable[tuple[str, str, str, str]]:
    formats, ranges = fixed.formats, fixed.ranges
    inputs = {name for argument in fixed.interface.inputs for name in argument.values}
    for value in fixed.body:
        if value.name in inputs and not used_by(value):
            continue
        low, high = ranges[value.name]
        error = above(value.error, 3) if value.error else "exact"
        yield value.name, str(formats[value.name]), f"{below(low)} to {above(high)}", error


def _files(files: dict[str, str]) -> list[dict[str, str]]:
    return [
        {"name": name, "text": text, "language": "python" if name.endswith(".py") else "c"}
        for name, text in files.items()
    ]


def _evidence(known: AlgorithmDossier, fixed: FixedProgram, evidence: EvidencePage) -> dict[str, str]:
    """Return the results of tools on the code that the page shows: none on code that has changed since."""
    subject = Subject(known.choice, fixed.interface.settings)
    if evidence.digests.get(subject.name) != subject.digest:
        return {}
    return evidence.results.get(subject.name, {})


def _result(command: str, data: Any) -> CommandResult:
    return {"command": f"{command} --format json", "data": data}


def arguments(known: AlgorithmDossier) -> str:
    """Return name and options of a kernel on the command line."""
    stated = known.program.arguments
    return known.choice.kernel if stated.startswith("strapgen ") else stated


def of_algorithm(known: AlgorithmDossier, conditions: Conditions) -> dict[str, CommandResult]:
    """Return the results of one algorithm by the names of the commands; `generate` is that of fixed point."""
    formulas = KernelResult.of(known.kernel, known.program, "operations")
    derive = f"strapgen derive {arguments(known)} --show operations"
    results = {"derive": _result(derive, formulas.data())}
    if known.fixed is not None:
        command = contract.command(known.fixed, "c-fixed")
        generated = GeneratedSources.of(known.choice, known.sources["c-fixed"], "c-fixed", ())
        results["generate"] = _result(command, GenerateResult([generated]).data())
    if known.runs is not None:
        results |= _of_runs(known, known.runs, conditions)
    return results


def _of_runs(known: AlgorithmDossier, runs: StepRuns, conditions: Conditions) -> dict[str, CommandResult]:
    """Return the results of the runs of a step."""
    step, schedule = arguments(known), runs.schedule
    where = f"{conditions.options} {schedule.options}"
    simulate = f"strapgen simulate {step} {where} --record {schedule.record}"
    facts = step_facts(runs.backend, known.choice) | {
        "motion": runs.profile.name,
        "step_s": float(schedule.step),
        "duration_s": float(schedule.duration),
    }
    results = {"simulate": _result(simulate, RunResult(facts, runs.run).data())}
    if runs.comparison:
        names = ",".join(row.backend for row in runs.comparison)
        rounding = _rounding(runs.settings) if any("fixed" in row.backend for row in runs.comparison) else ""
        compare = f"strapgen compare {step} --backend {names} --reference {REFERENCE} {where}{rounding}"
        compared = ComparedKernel(known.choice.kernel, "", runs.comparison)
        results["compare"] = _result(compare, ComparisonResult([compared], REFERENCE, "").data())
    ladder = ConvergenceResult([runs.ladder], "").data()
    results["converge"] = _result(f"strapgen converge {step}", ladder)
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
    command = f"strapgen tables --backend {','.join(backends)}"
    return _result(command, ThesisTablesResult([*entries]).data())


def of_frontier(
    drifts_and_costs: Sequence[DriftAndCost], methods: Sequence[str], conditions: Conditions
) -> CommandResult:
    """Return drifts and costs of algorithms as the result of `frontier`."""
    words = f"--sample-hz {conditions.sample_hz} --duration {conditions.duration}"
    names = shlex.quote(",".join(methods))
    command = f"strapgen frontier --method {names} {conditions.options} {words}"
    hertz, seconds = (float(checks.number("", text)) for text in (conditions.sample_hz, conditions.duration))
    return _result(command, FrontierResult(drifts_and_costs, hertz, seconds, motions(conditions)).data())
