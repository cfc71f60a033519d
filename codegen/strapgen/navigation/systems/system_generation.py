"""Generates a described system: its stages, and the unit that stores, calls and runs them, in C or in Python."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from strapgen.ir import checks
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.interfaces import Argument
from strapgen.ir.kernel_info import KernelInfo
from strapgen.ir.signals import FRAMES, Signal
from strapgen.ir.sources import Function, Sources
from strapgen.ir.version import VERSION
from strapgen.navigation.systems.fitting import GeneratedStages, fitted
from strapgen.navigation.systems.system import Cell, DescribedSystem, Push, Rate, SystemStage
from strapgen.navigation.systems.wiring import Description
from strapgen.targets import TARGETS, system_targets
from strapgen.targets.c import real_of
from strapgen.targets.contract import argument_text, range_text
from strapgen.targets.rendering import render, render_c, runs_of


def sources(
    description: Description, target: str = "c", settings: Settings | None = None, command: str = ""
) -> Sources:
    """Return the C of a described system, or its twin in Python."""
    checks.choice("target", target, system_targets())
    return unit(fitted(description, target, settings), command)


def unit(fit: GeneratedStages, command: str, budget: Sequence[str] = ()) -> Sources:
    """Return the C of a system whose stages are generated, or its twin in Python."""
    system, stages = fit.description.system, fit.sources
    if TARGETS[fit.target].language == "Python":
        name = "run"
        files = _PythonPrinter(system, stages, fit.arguments).files(command, budget)
    else:
        name = fit.name
        files = _CPrinter(system, stages, fit.arguments, name, fit.target).files(command, budget)
    counts = {
        kind: sum(one.operations.get(kind, 0) for one in stages.values())
        for kind in stages[system.stages[0].name].operations
    }
    outputs = tuple(system.cell(output).signal for output in system.outputs)
    return Sources(
        KernelInfo(system.name, system.title, ""),
        fit.target,
        files,
        Function(name, system.inputs, outputs),
        counts,
        sum(one.temporaries for one in stages.values()),
        runs=runs_of(name) if TARGETS[fit.target].compiled else (),
    )


@dataclass(frozen=True)
class _Printer:
    """Common parts of the printers for C and Python."""

    system: DescribedSystem
    stages: Mapping[str, Sources]
    arguments: Mapping[str, Argument]

    def _describe(self, signal: Signal, cell: Cell | None = None) -> str:
        """Return the description of a cell or an input: meaning, frame, unit, and format or range."""
        history = f"the last {cell.samples} samples, the newest last: " if cell and cell.samples else ""
        argument = self.arguments.get(signal.name if cell is None else cell.name)
        frame = f"frame {signal.frame}; " if signal.frame else ""
        about = range_text(signal) if argument is None else argument_text(argument)
        return f"{history}{signal.meaning or signal.name}; {frame}unit {signal.unit}; {about}"

    def _argument(self, stage: SystemStage, name: str) -> Argument | None:
        """Return an argument of a stage's function by its name."""
        interface = self.stages[stage.name].fixed
        if interface is None:
            return None
        return next(a for a in (*interface.inputs, *interface.outputs) if a.signal.name == name)

    def _feedback(self) -> Iterator[tuple[str, int, list[int]]]:
        """Yield the stages with error feedback: name, bits of a word, and the words that it begins with."""
        for stage in self.system.stages:
            interface = self.stages[stage.name].fixed
            if interface is not None and interface.residuals:
                yield stage.name, interface.settings.word, [word.fresh for word in interface.residuals]

    def _body(self, rate: Rate) -> Iterator[str]:
        """Yield the statements of a rate."""
        for step in rate.steps:
            yield from self._pushed(step) if isinstance(step, Push) else self._called(step)
        for cell in rate.cleared:
            yield self._cleared(cell)

    def _pushed(self, push: Push) -> Iterator[str]:
        """Yield the statements that add a sample to a cell."""
        raise NotImplementedError

    def _called(self, stage: SystemStage) -> Iterator[str]:
        """Yield the statements that call a stage."""
        raise NotImplementedError

    def _cleared(self, cell: str) -> str:
        """Return the statement that sets a cell to zero."""
        raise NotImplementedError


# C: a struct of what is stored, a function for each rate, and one that runs cycles


def places_between(source: Argument | None, destination: Argument | None) -> int:
    """Return the places by which integers move to the left from one format to another."""
    if source is None or destination is None:
        return 0
    return destination.format.fraction - source.format.fraction


@dataclass(frozen=True)
class _CPrinter(_Printer):
    """Prints the parts of the C that templates put together."""

    name: str
    target: str

    def files(self, command: str, budget: Sequence[str]) -> dict[str, str]:
        """Return the files of the unit and of its stages."""
        system = self.system
        samples = "".join(f", const {self._type(s.name)} *{s.name}" for s in system.inputs)
        outputs = "".join(f", {self._type(name)} *{name}" for name in system.outputs)
        values = {
            "title": system.title,
            "command": command,
            "version": VERSION,
            "guard": f"{self.name}_h".upper(),
            "system": system,
            "frames": ", ".join(f"{letter} {name}" for letter, name in FRAMES.items()),
            "fixed": bool(self.arguments),
            "headers": [f"{sources.function.name}.h" for sources in self.stages.values()],
            "cells": [
                (cell, self._type(cell.name), f"{cell.name}: {self._describe(cell.signal, cell)}.")
                for cell in system.cells
            ],
            "feedback": [
                (stage, f"uint{word}_t", [f"UINT{word}_C({number})" for number in fresh])
                for stage, word, fresh in self._feedback()
            ],
            "inputs": [
                (s, self._type(s.name), f"in      {s.name}[{s.size}]: {self._describe(s)}.")
                for s in system.inputs
            ],
            "outputs": [(system.cell(name), self._type(name), system.every(name)) for name in system.outputs],
            "rates": [(rate, self._parameters(rate), list(self._body(rate))) for rate in system.rates],
            "rescales": sorted(set(self._rescales())),
            "initial": [(cell.name, self._numbers(cell)) for cell in system.cells if any(cell.initial)],
            "stage_numbers": {stage.name: number for number, stage in enumerate(system.stages, 1)},
            "everything": [signal.name for signal in system.inputs],
            "types": {cell.name: self._type(cell.name) for cell in system.cells},
            "samples": samples,
            "arrays": samples + outputs,
        }
        files = render_c("system_c", self.name, **values, budget=budget)
        for stage in self.stages.values():
            files |= stage.step_files
        return files

    def _type(self, name: str) -> str:
        """Return the type of the elements of a cell or an input."""
        return self._type_of(self.arguments.get(name))

    def _type_of(self, argument: Argument | None) -> str:
        return real_of(self.target).name if argument is None else f"int{argument.format.word}_t"

    def _numbers(self, cell: Cell) -> str:
        """Return the initial elements of a cell."""
        argument = self.arguments.get(cell.name)
        if argument is None:
            suffix = real_of(self.target).suffix
            return ", ".join(f"{_decimal(value)}{suffix}" for value in cell.initial)
        word = argument.format.word
        return ", ".join(f"INT{word}_C({argument.format.nearest(value)})" for value in cell.initial)

    def _parameters(self, rate: Rate) -> str:
        """Return the parameters of the function of a rate."""
        samples = [f"const {self._type(name)} *{name}" for name in rate.inputs]
        return ", ".join([f"{self.name}_memory *memory", *samples])

    def _cleared(self, cell: str) -> str:
        return f"(void)memset(memory->{cell}, 0, sizeof memory->{cell});"

    def _place(self, name: str, external: bool) -> str:
        return name if external else f"memory->{name}"

    def _pushed(self, push: Push) -> Iterator[str]:
        cell = self.system.cell(push.cell)
        size = cell.signal.size // cell.samples
        rest = size * (cell.samples - 1)
        place, source = f"memory->{cell.name}", self._place(push.source, push.external)
        if rest:
            yield f"(void)memmove({place}, {place} + {size}, {rest} * sizeof *{place});"
        there, here = self.arguments.get(push.source), self.arguments.get(push.cell)
        if self._type_of(there) == self._type_of(here) and not places_between(there, here):
            yield f"(void)memcpy({place} + {rest}, {source}, {size} * sizeof *{source});"
        else:
            yield self._rescaled(f"{place} + {rest}", source, size, there, here)

    def _rescaled(
        self, to: str, source: str, size: int, there: Argument | None, here: Argument | None
    ) -> str:
        """Return the statement that copies integers in another format."""
        assert there is not None and here is not None, "numbers in floating point have one type"
        function = f"{self.name}_{there.format.word}_to_{here.format.word}_"
        return f"{function}({to}, {source}, {size}, {places_between(there, here)});"

    def _called(self, stage: SystemStage) -> Iterator[str]:
        sources = self.stages[stage.name]
        inputs, declared, before = [], [], []
        for wire, signal in zip(stage.wires, sources.function.inputs, strict=True):
            source = self._place(wire.source, wire.external)
            if self._differs(stage, wire.input, wire.source):
                here, local = self._argument(stage, wire.input), f"{wire.input}_"
                declared.append(f"{self._type_of(here)} {local}[{signal.size}];")
                there = self.arguments.get(wire.source)
                before.append(self._rescaled(local, source, signal.size, there, here))
                source = local
            by_value = sources.fixed is None and not signal.shape  # integers are passed by address
            inputs.append(f"*{source}" if by_value else source)
        if sources.fixed is not None and sources.fixed.residuals:
            inputs.append(f"memory->residuals_{stage.name}")
        results = dict(stage.results)
        outputs, after = [], []
        for signal in sources.function.outputs:
            cell = results[signal.name]
            place = f"memory->{cell}"
            if self._differs(stage, signal.name, cell):
                there, local = self._argument(stage, signal.name), f"{signal.name}_"
                declared.append(f"{self._type_of(there)} {local}[{signal.size}];")
                after.append(self._rescaled(place, local, signal.size, there, self.arguments.get(cell)))
                place = local
            outputs.append(place)
        call = f"{sources.function.name}({', '.join([*inputs, *outputs])})"
        yield from ["{", *(f"    {line}" for line in (*declared, *before))]
        if sources.fixed is None:
            yield f"    {call};"
        else:
            number = 1 + [other.name for other in self.system.stages].index(stage.name)
            yield from [
                f"    const int status = {call};",
                "    if (status != 0) {",
                f"        memory->refused = {number};",
                "        return status;",
                "    }",
            ]
        yield from [*(f"    {line}" for line in after), "}"]

    def _differs(self, stage: SystemStage, name: str, cell: str) -> bool:
        """Return whether an argument of a stage has another format or type than the cell on its wire."""
        argument, held = self._argument(stage, name), self.arguments.get(cell)
        return argument is not None and held is not None and argument.format != held.format

    def _rescales(self) -> Iterator[tuple[str, str]]:
        """Yield the types between which values are rescaled."""
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


def _decimal(value: Fraction) -> str:
    text = repr(float(value))
    return text if any(mark in text for mark in ".en") else f"{text}.0"


# Python: the same memory, rates and cycles, in numpy or on integers


@dataclass(frozen=True)
class _PythonPrinter(_Printer):
    """Prints the parts of the module that the template puts together."""

    def files(self, command: str, budget: Sequence[str]) -> dict[str, str]:
        """Return the module of the system and those of its stages."""
        system = self.system
        bodies = [(rate, list(self._body(rate))) for rate in system.rates]
        module = render(
            "system_python/module.py.j2",
            title=system.title,
            command=command,
            budget=budget,
            system=system,
            fixed=bool(self.arguments),
            imports=[
                (f"{system.name}_{s.name}", self.stages[s.name].function.name, s.name) for s in system.stages
            ],
            cells=[(cell, self._describe(cell.signal, cell), self._initial(cell)) for cell in system.cells],
            inputs=[(signal, self._describe(signal)) for signal in system.inputs],
            feedback=[(stage, fresh) for stage, _, fresh in self._feedback()],
            rates=bodies,
            rescaled=any("_moved(" in line for _, lines in bodies for line in lines),
            outputs=[(name, system.every(name)) for name in system.outputs],
        )
        files = {f"{system.name}.py": module}
        for stage, sources in self.stages.items():
            (files[f"{system.name}_{stage}.py"],) = sources.files.values()
        return files

    def _initial(self, cell: Cell) -> str:
        """Return the value of a cell before the first cycle."""
        argument = self.arguments.get(cell.name)
        if argument is not None:
            return f"[{', '.join(str(argument.format.nearest(value)) for value in cell.initial)}]"
        if not any(cell.initial):
            return f"np.zeros({cell.signal.shape})"
        numbers = ", ".join(repr(float(value)) for value in cell.initial)
        return f"np.array([{numbers}]).reshape({cell.signal.shape})"

    def _cleared(self, cell: str) -> str:
        signal = self.system.cell(cell).signal
        return f"memory.{cell} = " + (
            f"[0] * {signal.size}" if self.arguments else f"np.zeros({signal.shape})"
        )

    def _pushed(self, push: Push) -> Iterator[str]:
        place = f"memory.{push.cell}"
        source = push.source if push.external else f"memory.{push.source}"
        here = self.arguments.get(push.cell)
        if here is None:
            yield f"{place} = np.vstack([{place}[1:], [{source}]])"
            return
        cell = self.system.cell(push.cell)
        moved = _moved(source, self.arguments.get(push.source), here)
        yield f"{place} = [*{place}[{cell.signal.size // cell.samples}:], *{moved}]"

    def _called(self, stage: SystemStage) -> Iterator[str]:
        sources = self.stages[stage.name]
        values = []
        for wire in stage.wires:
            place = wire.source if wire.external else f"memory.{wire.source}"
            here = self._argument(stage, wire.input)
            values.append(_moved(place, self.arguments.get(wire.source), here))
        results = dict(stage.results)
        cells = [results[signal.name] for signal in sources.function.outputs]
        names = [f"memory.{cell}" for cell in cells]
        if sources.fixed is None:
            targets = names[0] if len(names) == 1 else f"({', '.join(names)})"
            yield f"{targets} = {stage.name}({', '.join(values)})"
            return
        if sources.fixed.residuals:
            values.append(f"memory.residuals_{stage.name}")
            names.append(f"memory.residuals_{stage.name}")
        targets = f"({', '.join(names)}{',' if len(names) == 1 else ''})"
        yield f'{targets} = _called("{stage.name}", {", ".join([stage.name, *values])})'
        for signal, cell in zip(sources.function.outputs, cells, strict=True):
            there, here = self._argument(stage, signal.name), self.arguments.get(cell)
            if there is not None and here is not None and there.format != here.format:
                yield f"memory.{cell} = {_moved(f'memory.{cell}', there, here)}"


def _moved(place: str, there: Argument | None, here: Argument | None) -> str:
    """Return a value in the format of its destination."""
    if there is None or here is None or there.format == here.format:
        return place
    return f"_moved({place}, {places_between(there, here)}, {here.format.largest})"
