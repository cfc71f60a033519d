"""The boxes of a drawing of a system and the wires between them, before they have places."""

from __future__ import annotations

from strapgen.ir.signals import Signal
from strapgen.navigation.systems.drawing.drawing_parts import Box, Link, Port
from strapgen.navigation.systems.system import Cell, DescribedSystem, Push, SystemStage


class Graph:
    """Boxes with ports, and the wires between them, before they are placed."""

    def __init__(self, system: DescribedSystem) -> None:
        self.system = system
        self.cells = {cell.name: cell for cell in system.cells}
        self.inputs = {signal.name: signal for signal in system.inputs}
        self.boxes = {signal.name: Box(signal.name, "", 0) for signal in system.inputs}
        self.boxes |= {stage.name: Box(stage.name, stage.kernel, stage.every) for stage in system.stages}
        self.owners = {cell: stage.name for stage in reversed(system.stages) for _, cell in stage.results}
        self.pushed = {
            step.cell: step for rate in system.rates for step in rate.steps if isinstance(step, Push)
        }
        self.cleared = {cell for rate in system.rates for cell in rate.cleared}
        self.places = {stage.name: place for place, stage in enumerate(system.stages)}
        self.links: list[Link] = []

    def run(self) -> tuple[list[Box], list[Link]]:
        """Return boxes and wires."""
        for stage in self.system.stages:
            self._wire(stage)
        for name in self.system.outputs:
            if name in self.owners:
                self._port(name).mark = "out"
        return list(self.boxes.values()), self.links

    def _port(self, source: str) -> Port:
        """Return the port of an input, or of a cell at its owner; it is added when it is first needed."""
        owner = source if source in self.inputs else self.owners[source]
        name = source if source in self.inputs else source.removeprefix(f"{owner}_")
        box = self.boxes[owner]
        for port in box.outputs:
            if port.name == name:
                return port
        signal: Signal = self.inputs[source] if source in self.inputs else self.cells[source].signal
        box.outputs.append(Port(name, signal.unit, signal.frame, "sum" if source in self.cleared else ""))
        return box.outputs[-1]

    def _wire(self, stage: SystemStage) -> None:
        """Add the wires that end at a stage."""
        results = dict(stage.results).values()
        for wire in stage.wires:
            cell: Cell | None = self.cells.get(wire.source)
            push = self.pushed.get(wire.source)
            source = wire.source if push is None else push.source
            owner = source if source in self.inputs else self.owners[source]
            is_state = cell is not None and push is None and source in results
            if is_state and source == f"{stage.name}_{wire.input}":
                continue  # a state of the stage alone
            kind = "forward"
            if is_state and owner != stage.name:
                kind = "shared"
            elif owner in self.places and self.places[owner] >= self.places[stage.name]:
                kind = "delayed"
            self._link(stage, wire.input, source, kind)
        read = {wire.source for wire in stage.wires}
        for output, cell_name in stage.results:
            if self.owners[cell_name] != stage.name and cell_name not in read:
                self._link(stage, output, cell_name, "shared")

    def _link(self, stage: SystemStage, name: str, source: str, kind: str) -> None:
        start = self._port(source)
        owner = source if source in self.inputs else self.owners[source]
        box = self.boxes[stage.name]
        box.inputs.append(Port(name, start.unit, start.frame))
        if kind not in start.kinds:
            start.kinds.append(kind)
        self.links.append(Link((self.boxes[owner], start), (box, box.inputs[-1]), kind))
