"""Wires the stages of a described system, and checks every wire: units, frames, rates, cycles and ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

from strapgen.catalogue import Choice
from strapgen.ir.checks import unknown
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import ROTATION_INPUTS
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.program import Program
from strapgen.ir.read_only import ReadOnly
from strapgen.ir.signals import ANY, Signal
from strapgen.navigation.systems import built_in, system_file
from strapgen.navigation.systems.ports import (
    Ports,
    Source,
    check_direction,
    check_initial,
    check_order,
    check_range,
    check_rates,
    check_shape,
    check_undelayed,
    ports,
)
from strapgen.navigation.systems.system import Cell, DescribedSystem, Push, Rate, SystemStage, Wire
from strapgen.navigation.systems.system_file import SystemText


@dataclass(frozen=True)
class Description(ReadOnly):
    """A described system: its structure, and the settings of each stage."""

    system: DescribedSystem
    #: The kernel of each stage, with its constants, by the name of the stage
    choices: Mapping[str, Choice]
    programs: Mapping[str, Program]
    #: Stated ranges of inputs, by stage and input
    ranges: Mapping[str, Mapping[str, Fraction]]
    #: Stated formats, by stage and argument
    formats: Mapping[str, Mapping[str, str]]

    __repr__ = short_repr

    def _in_words(self) -> str:
        return f"{self.system.name}: {', '.join(self.programs)}"


def read_system(path: str | Path, sample_hz: Fraction | None = None) -> Description:
    """Read the file of a system and wire it.

    Parameters
    ----------
    path : path
    sample_hz : Fraction, optional
        Cycles of the fastest rate in a second, in place of those in the file.

    Returns
    -------
    Description

    Raises
    ------
    InputError
        If anything in the file is wrong; the message names the stage and the wire.

    Examples
    --------
    >>> read_system("two-speed-euler")
    <Description two_speed_euler: fast, slow, nav>
    """
    text = system_file.read(built_in.file_of(path), sample_hz)
    try:
        return wired(text)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


#: The name by which modules of the package call it.
described = read_system


def wired(text: SystemText) -> Description:
    """Return a described system with its stages wired; parameters and errors are those of `read_system`."""
    stages = [ports(stage, place) for place, stage in enumerate(text.stages)]
    for stage in stages:
        _check_rate(stage, text.sample_hz / stage.text.every)
    wiring = _Wiring(text, stages)
    wiring.run()
    names = [stage.name for stage in stages]
    system = DescribedSystem(
        text.name,
        text.title,
        text.sample_hz,
        tuple(wiring.inputs.values()),
        tuple(wiring.cells.values()),
        wiring.rates(),
        wiring.recorded(),
    )
    return Description(
        system,
        {stage.name: stage.choice for stage in stages},
        {stage.name: stage.program for stage in stages},
        dict(zip(names, (stage.text.ranges for stage in stages), strict=True)),
        dict(zip(names, (stage.text.formats for stage in stages), strict=True)),
    )


def _check_rate(stage: Ports, stage_hz: Fraction) -> None:
    """Refuse a stage whose file is for another rate."""
    file_hz = getattr(stage.choice.layout, "sample_hz", stage_hz)
    if file_hz != stage_hz:
        raise InputError(
            f"stage {stage.name}: {stage.text.layout} is for {float(file_hz):g} samples in a second; the stage has "
            f"{float(stage_hz):g}"
        )


@dataclass
class _Wiring:
    """The wiring of a system, under construction."""

    text: SystemText
    stages: Sequence[Ports]
    inputs: dict[str, Signal] = field(default_factory=dict)
    cells: dict[str, Cell] = field(default_factory=dict)
    wires: dict[tuple[str, str], Wire] = field(default_factory=dict)
    pushes: dict[int, list[tuple[int, Push]]] = field(default_factory=dict)
    cleared: dict[str, int] = field(default_factory=dict)
    read: set[str] = field(default_factory=set)

    def run(self) -> None:
        """Wire all stages."""
        check_order(self.stages)
        self.by_name = {stage.name: stage for stage in self.stages}
        self.described = {entry.name: entry for entry in self.text.inputs}
        self.shared: dict[tuple[str, str], str] = {}
        for stage in self.stages:
            self._share_states(stage)
        for stage in self.stages:
            self._settle(stage)
        for stage in self.stages:
            self._add_cells(stage)
        for stage in self.stages:
            for name in stage.inputs:
                if (stage.name, name) not in self.wires:
                    self._connect(stage, name)
        self._check_used()

    def rates(self) -> tuple[Rate, ...]:
        """Return the steps of each rate, from the fastest."""
        result = []
        for every in sorted({stage.text.every for stage in self.stages} | set(self.pushes)):
            steps: list[tuple[int, int, Push | SystemStage]] = [
                (place, 1, push) for place, push in self.pushes.get(every, [])
            ]
            steps += [
                (stage.place, 0, self._stage(stage)) for stage in self.stages if stage.text.every == every
            ]
            steps.sort(key=lambda entry: entry[:2])
            cleared = tuple(cell for cell, when in self.cleared.items() if when == every)
            result.append(Rate(every, tuple(step for *_, step in steps), cleared))
        return tuple(result)

    def recorded(self) -> tuple[str, ...]:
        """Return the cells that a run records: those that the file names, or outputs that no stage takes."""
        if self.text.outputs:
            return tuple(dict.fromkeys(self._output(reference) for reference in self.text.outputs))
        attitudes = [name for name, cell in self.cells.items() if cell.signal.constraint and not cell.samples]
        ends = [
            self._cell(stage, output)
            for stage in self.stages
            for output in stage.outputs
            if self._cell(stage, output) not in self.read and stage.state_of(output) is None
        ]
        return tuple(dict.fromkeys([*attitudes, *ends]))

    def _output(self, reference: str) -> str:
        name, _, signal = reference.partition(".")
        if name not in self.by_name or not signal:
            raise InputError(f"outputs: {unknown('stage', name, self.by_name, 'as stage.output')}")
        self._source(f"outputs: {reference}", reference)
        return self._cell(self.by_name[name], signal)

    def _stage(self, stage: Ports) -> SystemStage:
        return SystemStage(
            stage.name,
            stage.choice.kernel,
            stage.text.every,
            tuple(self.wires[stage.name, name] for name in stage.inputs),
            tuple((output, self._cell(stage, output)) for output in stage.outputs),
            stage.text.word,
            stage.text.carry,
        )

    def _share_states(self, stage: Ports) -> None:
        """Note the states that are those of another stage, and the outputs that replace them."""
        for state in stage.states:
            if state in stage.text.wires:
                check_undelayed(stage, state, "the same memory as a state of another stage")
                self.shared[stage.name, state] = self._shared_state(stage, "wires", state)
        for output, reference in stage.text.writes.items():
            if stage.state_of(output) is not None:
                raise InputError(
                    f"stage {stage.name}: writes: {output} is the next {stage.state_of(output)} already"
                )
            self.shared[stage.name, output] = self._shared_state(stage, "writes", output)
            target = self._source(f"stage {stage.name}: writes: {output}", reference)
            check_shape(f"stage {stage.name}: writes: {output}", stage.outputs[output], target.signal)

    def _shared_state(self, stage: Ports, table: str, name: str) -> str:
        """Return the cell of a state that belongs to another stage."""
        where = f"stage {stage.name}: {table}: {name}"
        reference = dict(stage.text.wires if table == "wires" else stage.text.writes)[name]
        source = self._source(where, reference)
        other = source.stage
        state = None if other is None else other.state_of(reference.partition(".")[2])
        if other is None or state is None or other.name == stage.name:
            raise InputError(
                f"{where} = {reference!r} is no state of another stage, as a state can be wired to"
            )
        if table == "wires":
            check_shape(where, stage.inputs[name], source.signal)
        earlier = self.shared.get((other.name, state))
        return earlier or f"{other.name}_{state}"

    def _settle(self, stage: Ports) -> None:
        """Determine the units and frames that are "any" in a stage, and check those of its wires."""
        for name, reference in stage.text.wires.items():
            where = f"stage {stage.name}: {name} = {reference!r}"
            signal, source = stage.inputs[name], self._source(where, reference)
            self._check_same(where, stage, signal, source)
        for name, reference in stage.text.writes.items():
            where = f"stage {stage.name}: writes: {name} = {reference!r}"
            self._check_same(where, stage, stage.outputs[name], self._source(where, reference))

    def _check_same(self, where: str, stage: Ports, signal: Signal, source: Source) -> None:
        """Check that unit and frame are the same at both ends of a wire."""
        for what in ("unit", "frame"):
            needed, there = getattr(signal, what), getattr(source.signal, what)
            if needed == ANY:
                needed = stage.known.setdefault(what, there)
            if there != needed:
                raise InputError(f"{where}: {what} {there or 'none'} meets {what} {needed or 'none'}")

    def _source(self, where: str, reference: str) -> Source:
        """Return the source of a reference: "input", "stage.output" or "stage.state"."""
        name, _, signal = reference.partition(".")
        if not signal:
            if name not in self.described:
                raise InputError(f"{where}: {unknown('input', name, self.described, 'stage.output')}")
            entry = self.described[name]
            return Source(
                name, Signal.scalar(name, unit=entry.unit, frame=entry.frame, meaning=entry.meaning)
            )
        if name not in self.by_name:
            raise InputError(f"{where}: {unknown('stage', name, self.by_name)}")
        stage = self.by_name[name]
        values = stage.outputs | {state: stage.inputs[state] for state in stage.states}
        if signal not in values:
            raise InputError(f"{where}: {unknown(f'value of stage {name}', signal, values)}")
        return Source(
            reference, stage.settled(values[signal]), stage, (stage.state_of(signal) or "") in stage.sums
        )

    def _cell(self, stage: Ports, signal: str) -> str:
        """Return the name of the cell of an output or a state of a stage."""
        name = stage.state_of(signal) or signal
        return self.shared.get((stage.name, name), f"{stage.name}_{name}")

    def _add_cells(self, stage: Ports) -> None:
        """Add the cells of a stage, and wire its states to them."""
        for name, signal in stage.inputs.items():
            if name in stage.states:
                cell = self._cell(stage, name)
                self.wires[stage.name, name] = Wire(name, cell)
                if (stage.name, name) not in self.shared:
                    self._add(stage, cell, name, signal)
                elif name in stage.text.initial:
                    raise InputError(
                        f"stage {stage.name}: initial {name} is that of another stage; state it there"
                    )
        for name, signal in stage.outputs.items():
            if stage.state_of(name) is None and (stage.name, name) not in self.shared:
                self._add(stage, f"{stage.name}_{name}", name, signal)

    def _add(self, stage: Ports, cell: str, name: str, signal: Signal) -> None:
        output = stage.states.get(name, name)
        initial = stage.text.initial.get(name, stage.text.initial.get(output))
        if initial is not None:
            check_initial(stage, name, signal, initial)
        if cell in self.cells or cell in self.described:
            raise InputError(f"stage {stage.name}: {name} would be called {cell} in code, which is taken")
        self.cells[cell] = Cell(
            cell, stage.settled(signal), stage.start(signal) if initial is None else initial
        )

    def _connect(self, stage: Ports, name: str) -> None:
        """Wire an input that is no state."""
        where, signal = f"stage {stage.name}: {name}", stage.settled(stage.inputs[name])
        if name not in stage.text.wires:
            raise InputError(
                f"{where} is not wired; wire it to an input or a stage.output, or state a constant"
            )
        reference = stage.text.wires[name]
        where = f"{where} = {reference!r}"
        source = self._source(where, reference)
        many = self._samples(stage, signal, source)
        if source.stage is None:
            check_undelayed(stage, name, "an input of the system")
            self._add_input(where, reference, signal, many)
        else:
            if not many:
                check_shape(where, signal, source.signal)
            check_direction(stage, name, source)
        check_rates(where, stage, signal, source, many)
        if source.sum:
            self._clear(where, stage, source)
        check_range(stage, name, signal, source)
        cell = reference if source.stage is None else self._cell(source.stage, reference.partition(".")[2])
        self.read.add(cell)
        if many:
            cell = self._add_samples(stage, name, signal, source, cell)
        self.wires[stage.name, name] = Wire(name, cell, source.stage is None and not many)

    def _samples(self, stage: Ports, signal: Signal, source: Source) -> int:
        """Return how many samples of its source an input collects; 0 if it takes one."""
        if len(signal.shape) == 2 and stage.program.attitude_step is not None:
            return signal.shape[0]
        return 0

    def _add_samples(self, stage: Ports, name: str, signal: Signal, source: Source, cell: str) -> str:
        """Add a cell that collects the samples of a wire, and return its name."""
        collected = f"{stage.name}_{name}"
        if collected in self.cells:
            raise InputError(
                f"stage {stage.name}: {name} would be called {collected} in code, which is taken"
            )
        self.cells[collected] = Cell(collected, signal, (Fraction(0),) * signal.size, signal.shape[0])
        every = 1 if source.stage is None else source.stage.text.every
        place = -1 if source.stage is None else source.stage.place
        self.pushes.setdefault(every, []).append((place, Push(collected, cell, source.stage is None)))
        return collected

    def _add_input(self, where: str, reference: str, signal: Signal, many: int) -> None:
        """Give an input of the system the shape that its stage needs."""
        entry = self.described[reference]
        shape = signal.shape[1:] if many else signal.shape
        labels = [f"{reference}_{axis}" for axis in "xyz"] if shape == (3,) else None
        elements = tuple(
            labels or ([reference] if not shape else [f"{reference}_{k}" for k in range(_size(shape))])
        )
        stated = Signal(
            reference,
            shape,
            elements,
            entry.unit,
            entry.meaning,
            entry.range,
            frame=entry.frame,
            over=signal.over,
        )
        known = self.inputs.setdefault(reference, stated)
        if known.shape != stated.shape:
            raise InputError(f"{where}: shape {stated.shape} meets shape {known.shape}")

    def _clear(self, where: str, stage: Ports, source: Source) -> None:
        """Note that a sum is cleared when a stage has taken it, which is one rate for all that take it."""
        assert source.stage is not None
        cell = self._cell(source.stage, source.name.partition(".")[2])
        every = stage.text.every
        if self.cleared.setdefault(cell, every) != every:
            raise InputError(
                f"{where}: a sum that is cleared every {self.cleared[cell]} cycles is taken every {every} too"
            )

    def _check_used(self) -> None:
        """Check that every input is taken, every sum too, and every state has a range."""
        for name in self.described:
            if name not in self.inputs:
                raise InputError(f"input {name} is taken by no stage")
        for stage in self.stages:
            for state in stage.states:
                cell, signal = self._cell(stage, state), stage.inputs[state]
                if state in stage.sums and cell not in self.cleared:
                    raise InputError(f"stage {stage.name}: {state} is a sum that no stage takes")
                known = signal.bound is not None or signal.constraint or state in ROTATION_INPUTS
                if not known and state not in stage.text.ranges:
                    raise InputError(
                        f"stage {stage.name}: the range of {state} is missing; state it under ranges"
                    )


def _size(shape: tuple[int, ...]) -> int:
    size = 1
    for count in shape:
        size *= count
    return size
