"""A described system as a result: stages, values with units, frames, formats and bounds, and the budget."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from strapgen.ir.formats import above, float_above
from strapgen.ir.interfaces import Argument
from strapgen.ir.signals import Signal
from strapgen.navigation.systems.budget import Budget, lines
from strapgen.navigation.systems.fitting import GeneratedStages
from strapgen.navigation.systems.system_bounds import SystemBounds
from strapgen.results.records import INTERNAL, entry, reader_table
from strapgen.results.result import Result
from strapgen.results.table import ERROR, TextTable


@dataclass(frozen=True)
class StageRow:
    """A stage of a system."""

    name: str = field(metadata=entry("stage", align="<"))
    #: Cycles of the fastest rate from one call to the next
    every: int = field(metadata=entry("every"))
    hz: float = field(metadata=entry("Hz", ".6g"))
    kernel: str = field(metadata=entry("kernel", align="<"))
    #: Bits of a word in fixed point
    word: int | None = field(metadata=entry("word"))
    #: Error feedback in fixed point
    carry: str | None
    #: What each input is wired to
    wires: dict[str, str]
    #: Operations of a call by kind
    operations: dict[str, int] = field(metadata=entry("operations", cell=lambda counts: sum(counts.values())))
    #: Number of constants
    constants: Any
    #: Instructions of a call
    executed: int | None = field(metadata=entry("instructions"))
    code_bytes: int | None
    stack_bytes: int | None


@dataclass(frozen=True)
class InputRow:
    """An input of a system."""

    name: str = field(metadata=entry("value", align="<"))
    every: int = field(metadata=entry("every"))
    unit: str = field(metadata=entry("unit", align="<"))
    frame: str = field(metadata=entry("frame", align="<"))
    shape: tuple[int, ...] = field(
        metadata=entry("shape", align="<", cell=lambda shape: " x ".join(map(str, shape)))
    )
    #: In fixed point, or the bits of the counts
    format: str | None = field(metadata=entry("format", align="<"))
    #: Largest magnitude of an element
    range: float | None = field(metadata=entry("range", ".6g", align="<"))


@dataclass(frozen=True)
class ValueRow(InputRow):
    """A value that is stored between calls."""

    #: Number of samples that are kept
    samples: int
    initial: list[float]
    #: Certified error of a pass
    error: float | None = field(metadata=entry("error of a pass", ERROR))
    #: Why there is no bound
    no_bound: str | None


@dataclass(frozen=True)
class SystemResult(Result):
    """A described system: its stages, its values with units, frames, formats and bounds, and its budget."""

    bounds: SystemBounds = field(metadata=INTERNAL)
    name: str
    title: str
    target: str
    sample_hz: float
    #: From the fastest
    stages: list[StageRow]
    inputs: list[InputRow]
    values: list[ValueRow]
    outputs: tuple[str, ...]
    budget: Budget
    files: Sequence[Path]

    @staticmethod
    def of(
        fit: GeneratedStages, needs: Budget, bounds: SystemBounds, files: Sequence[Path] = ()
    ) -> SystemResult:
        """Return a system with its budget, and the written files."""
        system = fit.description.system
        return SystemResult(
            bounds=bounds,
            name=system.name,
            title=system.title,
            target=fit.target,
            sample_hz=float(system.sample_hz),
            stages=list(_stages(fit, needs)),
            inputs=[InputRow(signal.name, 1, *_about(fit, signal.name, signal)) for signal in system.inputs],
            values=list(_values(fit, bounds)),
            outputs=tuple(system.outputs),
            budget=needs,
            files=files,
        )

    def text(self) -> str:
        """Return the files, stages, values and the budget."""
        written = [f"{self.name} for {self.target}", *(f"  {path}" for path in self.files), ""]
        values = [*reader_table(self.inputs, InputRow).rows, *reader_table(self.values, InputRow).rows]
        errors = [None] * len(self.inputs) + [value.error for value in self.values]
        shown = [[*row, error] for row, error in zip(values, errors, strict=True)]
        columns = reader_table((), ValueRow).columns
        return "\n".join(
            [
                *(written if self.files else []),
                f"{self.title} ({self.name}, {self.target}, {self.sample_hz:.6g} Hz)",
                "",
                *_used_columns(reader_table(self.stages, StageRow)).lines(),
                "",
                *_used_columns(TextTable(columns, shown)).lines(),
                "",
                f"outputs: {', '.join(self.outputs)}",
                *(f"no bound for {name}: {reason}" for name, reason in self.bounds.reasons.items()),
                "",
                *lines(self.budget),
            ]
        )


def _used_columns(table: TextTable) -> TextTable:
    """Return a table without the columns in which no row has a value; what is missing in the others is left empty."""
    used = [k for k in range(len(table.columns)) if any(row[k] is not None for row in table.rows)]
    columns = [replace(table.columns[k], missing="") for k in used]
    return TextTable(columns, [[row[k] for k in used] for row in table.rows])


def bound_lines(fit: GeneratedStages, errors: SystemBounds) -> list[str]:
    """Return the error bounds of a pass in lines of text, for the head of generated files."""
    outputs = fit.description.system.outputs
    known = [name for name in outputs if name in errors.errors]
    result = []
    if known:
        bounds = ", ".join(
            f"{name} {above(max(errors.errors[name]), 4, 'e')} {_unit(fit, name)}".rstrip() for name in known
        )
        result.append(
            "Error of one pass through all rates, at most, against exact arithmetic on the same memory and samples: "
            f"{bounds}."
        )
    result += [
        f"No such bound for {name}: {errors.reasons[name]}." for name in outputs if name in errors.reasons
    ]
    return result


def _unit(fit: GeneratedStages, name: str) -> str:
    unit = fit.description.system.cell(name).signal.unit
    return "" if unit == "1" else unit


def _stages(fit: GeneratedStages, needs: Budget) -> Iterator[StageRow]:
    """Return the stages, from the fastest."""
    words = {stage.name: stage for stage in fit.description.system.stages}
    for rate in needs.rates:
        for stage in rate.stages:
            interface = fit.sources[stage.name].fixed
            yield StageRow(
                name=stage.name,
                kernel=stage.kernel,
                every=rate.every,
                hz=float(rate.hz),
                word=None if interface is None else interface.settings.word,
                carry=None if interface is None else interface.settings.carry,
                wires={wire.input: wire.source for wire in words[stage.name].wires},
                operations=dict(stage.operations),
                constants=stage.constants,
                executed=stage.executed,
                code_bytes=stage.code_bytes,
                stack_bytes=stage.stack_bytes,
            )


def _values(fit: GeneratedStages, errors: SystemBounds) -> Iterator[ValueRow]:
    """Return the values that are stored between calls."""
    system = fit.description.system
    for cell in system.cells:
        bounds = errors.errors.get(cell.name)
        yield ValueRow(
            cell.name,
            system.every(cell.name),
            *_about(fit, cell.name, cell.signal),
            samples=cell.samples,
            initial=[float(value) for value in cell.initial],
            error=None if bounds is None else float_above(max(bounds, default=Fraction(0))),
            no_bound=errors.reasons.get(cell.name),
        )


def _about(
    fit: GeneratedStages, name: str, signal: Signal
) -> tuple[str, str, tuple[int, ...], str | None, float | None]:
    """Return unit, frame, shape, format and range of a value."""
    argument = fit.arguments.get(name)
    largest = signal.bound if argument is None else argument.unit * max(argument.high, -argument.low)
    return (
        signal.unit,
        signal.frame,
        tuple(signal.shape),
        None if argument is None else _format(argument),
        None if largest is None else float_above(Fraction(largest)),
    )


def _format(argument: Argument) -> str:
    """Return the format of a value, or the bits of the counts that it is."""
    return str(argument.format) if argument.sensor is None else f"{argument.format.word}-bit counts"
