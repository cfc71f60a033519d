"""Prints Python for a described system: the same memory, rates and cycles as the C unit, in numpy or on integers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from strapgen.ir.interfaces import Argument
from strapgen.ir.kernel_info import KernelInfo
from strapgen.ir.signals import Signal
from strapgen.ir.sources import Function, Sources
from strapgen.navigation.systems.system import Cell, DescribedSystem, Push, Rate, SystemStage
from strapgen.targets.contract import argument_text, range_text
from strapgen.targets.rendering import render


def module_name(system: DescribedSystem, stage: str) -> str:
    """Return the name of the module of a stage."""
    return f"{system.name}_{stage}"


def whole(
    system: DescribedSystem,
    title_and_command: tuple[str, str],
    stages: Mapping[str, Sources],
    arguments: Mapping[str, Argument],
    budget: Sequence[str] = (),
) -> Sources:
    """Generate the Python of a system."""
    first = stages[system.stages[0].name]
    printer = _TwinPrinter(system, stages, arguments)
    files = {f"{system.name}.py": printer.module(*title_and_command, budget)}
    for stage, sources in stages.items():
        (text,) = sources.files.values()
        files[f"{module_name(system, stage)}.py"] = text
    counts = {
        kind: sum(sources.operations.get(kind, 0) for sources in stages.values()) for kind in first.operations
    }
    outputs = tuple(system.cell(name).signal for name in system.outputs)
    temporaries = sum(sources.temporaries for sources in stages.values())
    function = Function("run", system.inputs, outputs)
    info = KernelInfo(system.name, system.title, "")
    return Sources(info, first.target, files, function, counts, temporaries)


@dataclass(frozen=True)
class _TwinPrinter:
    """Prints the parts of a module that the template puts together."""

    system: DescribedSystem
    stages: Mapping[str, Sources]
    arguments: Mapping[str, Argument]

    def module(self, title: str, command: str, budget: Sequence[str]) -> str:
        """Return the text of the module."""
        system = self.system
        return render(
            "system_python/module.py.j2",
            title=title,
            command=command,
            budget=budget,
            system=system,
            fixed=bool(self.arguments),
            imports=[
                (module_name(system, s.name), self.stages[s.name].function.name, s.name)
                for s in system.stages
            ],
            cells=[(cell, self._told(cell.signal, cell), self._initial(cell)) for cell in system.cells],
            inputs=[(signal, self._told(signal)) for signal in system.inputs],
            feedback=[
                (stage.name, [word.fresh for word in interface.residuals])
                for stage in system.stages
                if (interface := self.stages[stage.name].fixed) is not None and interface.residuals
            ],
            rates=[(rate, list(self._body(rate))) for rate in system.rates],
            rescaled=any(self._rescales()),
            outputs=[(name, system.every(name)) for name in system.outputs],
        )

    def _told(self, signal: Signal, cell: Cell | None = None) -> str:
        """Return a line about a cell or an input."""
        history = f"the last {cell.samples} samples, the newest last: " if cell and cell.samples else ""
        argument = self.arguments.get(signal.name if cell is None else cell.name)
        frame = f"frame {signal.frame}; " if signal.frame else ""
        about = range_text(signal) if argument is None else argument_text(argument)
        return f"{history}{signal.meaning or signal.name}; {frame}unit {signal.unit}; {about}"

    def _initial(self, cell: Cell) -> str:
        """Return the value of a cell before the first cycle."""
        argument = self.arguments.get(cell.name)
        if argument is not None:
            return f"[{', '.join(str(argument.format.nearest(value)) for value in cell.initial)}]"
        if not any(cell.initial):
            return f"np.zeros({cell.signal.shape})"
        numbers = ", ".join(repr(float(value)) for value in cell.initial)
        return f"np.array([{numbers}]).reshape({cell.signal.shape})"

    def _body(self, rate: Rate) -> Iterator[str]:
        """Return the statements of a rate."""
        for step in rate.steps:
            yield from self._pushed(step) if isinstance(step, Push) else self._called(step)
        for name in rate.cleared:
            cell = self.system.cell(name)
            zero = f"[0] * {cell.signal.size}" if self.arguments else f"np.zeros({cell.signal.shape})"
            yield f"memory.{name} = {zero}"

    def _pushed(self, push: Push) -> Iterator[str]:
        """Return the statement that adds a sample to a cell."""
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
        """Return the statements that call a stage."""
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

    def _argument(self, stage: SystemStage, name: str) -> Argument | None:
        """Return an argument of a stage's function by its name."""
        interface = self.stages[stage.name].fixed
        if interface is None:
            return None
        return next(a for a in (*interface.inputs, *interface.outputs) if a.signal.name == name)

    def _rescales(self) -> Iterator[bool]:
        """Return for each way of a value whether it is rescaled."""
        for rate in self.system.rates:
            for line in self._body(rate):
                yield "_moved(" in line


def _moved(place: str, there: Argument | None, here: Argument | None) -> str:
    """Return a value in the format of its destination."""
    if there is None or here is None or there.format == here.format:
        return place
    places = here.format.fraction - there.format.fraction
    return f"_moved({place}, {places}, {here.format.largest})"
