"""Prints C for a described system: a struct of what is stored, a function for each rate, and one that runs cycles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from strapgen.ir.interfaces import Argument
from strapgen.ir.kernel_info import KernelInfo
from strapgen.ir.signals import FRAMES, Signal
from strapgen.ir.sources import Function, Sources
from strapgen.ir.version import VERSION
from strapgen.navigation.systems.system import Cell, DescribedSystem, Push, Rate, SystemStage
from strapgen.targets.c import real_of
from strapgen.targets.contract import argument_text, range_text
from strapgen.targets.rendering import render_c, runs_of

#: Status of a null pointer.
NULL = 4


@dataclass(frozen=True)
class Stored:
    """A value in memory: its type in C, and in fixed point its format."""

    type: str
    argument: Argument | None = None


def stored(target: str, argument: Argument | None) -> Stored:
    """Return the place in memory of a value with a format, or of a number in floating point."""
    if argument is None:
        return Stored(real_of(target).name)
    return Stored(f"int{argument.format.word}_t", argument)


def places_between(source: Argument | None, destination: Argument | None) -> int:
    """Return the places by which integers move to the left from one format to another."""
    if source is None or destination is None:
        return 0
    return destination.format.fraction - source.format.fraction


def whole(
    system: DescribedSystem,
    name: str,
    title_and_command: tuple[str, str],
    stages: Mapping[str, Sources],
    arguments: Mapping[str, Argument],
    budget: Sequence[str] = (),
) -> Sources:
    """Generate the C of a system."""
    first = stages[system.stages[0].name]
    printer = _Printer(system, name, first.target, stages, arguments)
    files = render_c("system_c", printer.name, **printer.values(*title_and_command), budget=budget)
    for stage in stages.values():
        files |= stage.step_files
    counts = {
        kind: sum(sources.operations.get(kind, 0) for sources in stages.values()) for kind in first.operations
    }
    outputs = tuple(system.cell(name).signal for name in system.outputs)
    return Sources(
        KernelInfo(system.name, system.title, ""),
        first.target,
        files,
        Function(printer.name, system.inputs, outputs),
        counts,
        sum(sources.temporaries for sources in stages.values()),
        runs=runs_of(printer.name),
    )


@dataclass(frozen=True)
class _Printer:
    """Prints the parts of a system that templates put together."""

    system: DescribedSystem
    name: str
    target: str
    stages: Mapping[str, Sources]
    arguments: Mapping[str, Argument]

    def values(self, title: str, command: str) -> dict[str, object]:
        """Return what the templates are filled with."""
        system, fixed = self.system, bool(self.arguments)
        bodies = {rate.every: list(self._body(rate)) for rate in system.rates}
        return {
            "title": title,
            "command": command,
            "version": VERSION,
            "guard": f"{self.name}_h".upper(),
            "system": system,
            "frames": ", ".join(f"{letter} {name}" for letter, name in FRAMES.items()),
            "fixed": fixed,
            "headers": [f"{sources.function.name}.h" for sources in self.stages.values()],
            "cells": [(cell, self._stored(cell.name).type, self._told(cell)) for cell in system.cells],
            "feedback": list(self._feedback()),
            "inputs": [
                (signal, self._stored(signal.name).type, self._told_input(signal)) for signal in system.inputs
            ],
            "outputs": [
                (system.cell(name), self._stored(name).type, system.every(name)) for name in system.outputs
            ],
            "rates": [(rate, self._parameters(rate), bodies[rate.every]) for rate in system.rates],
            "rescales": sorted(set(self._rescales())),
            "initial": [(cell.name, self._numbers(cell)) for cell in system.cells if any(cell.initial)],
            "stage_numbers": {stage.name: number for number, stage in enumerate(system.stages, 1)},
            "everything": [signal.name for signal in system.inputs],
            "types": {cell.name: self._stored(cell.name).type for cell in system.cells},
            "samples": "".join(f", const {self._stored(s.name).type} *{s.name}" for s in system.inputs),
            "arrays": self._arrays(),
        }

    def _stored(self, name: str) -> Stored:
        return stored(self.target, self.arguments.get(name))

    def _told(self, cell: Cell) -> str:
        """Return a line about a cell."""
        signal = cell.signal
        history = f"the last {cell.samples} samples, the newest last: " if cell.samples else ""
        return f"{cell.name}: {history}{signal.meaning or signal.name}; {self._about(signal, cell.name)}."

    def _told_input(self, signal: Signal) -> str:
        """Return a line about an input."""
        return f"in      {signal.name}[{signal.size}]: {signal.meaning}; {self._about(signal, signal.name)}."

    def _about(self, signal: Signal, name: str) -> str:
        """Return frame, unit, and format or range of a value."""
        frame = f"frame {signal.frame}; " if signal.frame else ""
        argument = self.arguments.get(name)
        if argument is not None:
            return f"{frame}unit {signal.unit}; {argument_text(argument)}"
        return f"{frame}unit {signal.unit}; {range_text(signal)}"

    def _feedback(self) -> Iterator[tuple[str, str, list[str]]]:
        """Return the error feedback of each stage that has some: its name, type and the words that it begins with."""
        for stage in self.system.stages:
            interface = self.stages[stage.name].fixed
            if interface is not None and interface.residuals:
                word = interface.settings.word
                yield stage.name, f"uint{word}_t", [f"UINT{word}_C({r.fresh})" for r in interface.residuals]

    def _numbers(self, cell: Cell) -> str:
        """Return the initial elements of a cell in C."""
        argument = self.arguments.get(cell.name)
        if argument is None:
            suffix = real_of(self.target).suffix
            return ", ".join(f"{_decimal(value)}{suffix}" for value in cell.initial)
        word = argument.format.word
        return ", ".join(f"INT{word}_C({argument.format.nearest(value)})" for value in cell.initial)

    def _parameters(self, rate: Rate) -> str:
        """Return the parameters of the function of a rate."""
        samples = [f"const {self._stored(name).type} *{name}" for name in rate.inputs]
        return ", ".join([f"{self.name}_memory *memory", *samples])

    def _arrays(self) -> str:
        """Return the arrays of the function that runs many cycles."""
        inputs = [f", const {self._stored(s.name).type} *{s.name}" for s in self.system.inputs]
        return "".join([*inputs, *(f", {self._stored(name).type} *{name}" for name in self.system.outputs)])

    def _body(self, rate: Rate) -> Iterator[str]:
        """Return the statements of a rate."""
        for step in rate.steps:
            yield from self._pushed(step) if isinstance(step, Push) else self._called(step)
        for cell in rate.cleared:
            yield f"(void)memset(memory->{cell}, 0, sizeof memory->{cell});"

    def _place(self, name: str, external: bool) -> str:
        return name if external else f"memory->{name}"

    def _pushed(self, push: Push) -> Iterator[str]:
        """Return the statements that add a sample to a cell."""
        cell = self.system.cell(push.cell)
        size = cell.signal.size // cell.samples
        rest = size * (cell.samples - 1)
        place = f"memory->{cell.name}"
        if rest:
            yield f"(void)memmove({place}, {place} + {size}, {rest} * sizeof *{place});"
        yield self._moved(
            f"{place} + {rest}", push.cell, self._place(push.source, push.external), push.source, size
        )

    def _moved(self, to: str, destination: str, source: str, name: str, size: int) -> str:
        """Return the statement that copies a value, rescaled where the formats differ."""
        there, here = self._stored(name), self._stored(destination)
        places = places_between(there.argument, here.argument)
        if there.type == here.type and not places:
            return f"(void)memcpy({to}, {source}, {size} * sizeof *{source});"
        return f"{self._rescale(there, here)}({to}, {source}, {size}, {places});"

    def _rescale(self, there: Stored, here: Stored) -> str:
        """Return the name of the function that rescales from one type to another."""
        return f"{self.name}_{_bits(there)}_to_{_bits(here)}_"

    def _called(self, stage: SystemStage) -> Iterator[str]:
        """Return the statements that call a stage."""
        sources = self.stages[stage.name]
        inputs, before = [], []
        for wire, signal in zip(stage.wires, sources.function.inputs, strict=True):
            source = self._place(wire.source, wire.external)
            if self._differs(stage, wire.input, wire.source):
                here = stored(self.target, self._argument(stage, wire.input))
                there = self._stored(wire.source)
                local = f"{wire.input}_"
                before.append(f"{here.type} {local}[{signal.size}];")
                places = places_between(there.argument, here.argument)
                before.append(f"{self._rescale(there, here)}({local}, {source}, {signal.size}, {places});")
                source = local
            by_value = sources.fixed is None and not signal.shape  # integers are passed by address
            inputs.append(f"*{source}" if by_value else source)
        if sources.fixed is not None and sources.fixed.residuals:
            inputs.append(f"memory->residuals_{stage.name}")
        results = dict(stage.results)
        outputs, after = [], []
        for signal in sources.function.outputs:
            cell = results[signal.name]
            if self._differs(stage, signal.name, cell):
                there = stored(self.target, self._argument(stage, signal.name))
                here = self._stored(cell)
                local = f"{signal.name}_"
                before.append(f"{there.type} {local}[{signal.size}];")
                places = places_between(there.argument, here.argument)
                after.append(
                    f"{self._rescale(there, here)}(memory->{cell}, {local}, {signal.size}, {places});"
                )
                outputs.append(local)
            else:
                outputs.append(f"memory->{cell}")
        call = f"{sources.function.name}({', '.join([*inputs, *outputs])})"
        number = 1 + [other.name for other in self.system.stages].index(stage.name)
        yield from ["{", *(f"    {line}" for line in _declared_first(before))]
        if sources.fixed is None:
            yield f"    {call};"
        else:
            yield f"    const int status = {call};"
            yield from [
                "    if (status != 0) {",
                f"        memory->refused = {number};",
                "        return status;",
                "    }",
            ]
        yield from [*(f"    {line}" for line in after), "}"]

    def _argument(self, stage: SystemStage, name: str) -> Argument | None:
        """Return an argument of a stage's function by its name."""
        interface = self.stages[stage.name].fixed
        if interface is None:
            return None
        return next(a for a in (*interface.inputs, *interface.outputs) if a.signal.name == name)

    def _differs(self, stage: SystemStage, name: str, cell: str) -> bool:
        """Tell whether an argument of a stage has another format or type than the cell on its wire."""
        argument, held = self._argument(stage, name), self.arguments.get(cell)
        return argument is not None and held is not None and argument.format != held.format

    def _rescales(self) -> Iterator[tuple[str, str]]:
        """Return the types between which values are rescaled."""
        for rate in self.system.rates:
            for step in rate.steps:
                if isinstance(step, Push):
                    pairs = [(self.arguments.get(step.source), self.arguments.get(step.cell))]
                else:
                    pairs = [
                        (self.arguments.get(w.source), self._argument(step, w.input)) for w in step.wires
                    ]
                    pairs += [
                        (self._argument(step, name), self.arguments.get(cell)) for name, cell in step.results
                    ]
                for there, here in pairs:
                    if there is not None and here is not None and there.format != here.format:
                        yield str(there.format.word), str(here.format.word)


def _declared_first(lines: Sequence[str]) -> list[str]:
    """Return lines with the declarations before the statements."""
    return sorted(lines, key=lambda line: "(" in line)


def _bits(place: Stored) -> str:
    assert place.argument is not None
    return str(place.argument.format.word)


def _decimal(value: Fraction) -> str:
    text = repr(float(value))
    return text if any(mark in text for mark in ".en") else f"{text}.0"
