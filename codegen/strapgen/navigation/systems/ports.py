"""The inputs, outputs and states of a stage's kernel, and what its units and frames are once it is wired."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction

from strapgen import catalogue, pipeline
from strapgen.catalogue import Choice
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.program import Program
from strapgen.ir.signals import ANY, Signal
from strapgen.navigation.systems.system_file import StageText


@dataclass
class Ports:
    """A stage with its kernel."""

    text: StageText
    choice: Choice
    program: Program
    #: Place among the stages
    place: int
    #: What "any" stands for, by "unit" and "frame", as far as it is known
    known: dict[str, str] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the stage."""
        return self.text.name

    @property
    def inputs(self) -> dict[str, Signal]:
        """The inputs of the kernel by name."""
        return {signal.name: signal for signal in self.program.inputs}

    @property
    def outputs(self) -> dict[str, Signal]:
        """The outputs of the kernel by name."""
        return {result.signal.name: result.signal for result in self.program.outputs}

    @property
    def states(self) -> dict[str, str]:
        """The output that each state becomes, by the name of the input."""
        if self.program.recursion is not None:
            return dict(self.program.recursion.states)
        if self.program.attitude_step is not None:
            return {self.program.inputs[0].name: self.program.outputs[0].signal.name}
        return {}

    @property
    def sums(self) -> tuple[str, ...]:
        """States that are cleared when a slower stage has taken them."""
        recursion = self.program.recursion
        return () if recursion is None else recursion.reset

    def state_of(self, signal: str) -> str | None:
        """Return the state that a name stands for: its own, or that of the output that it becomes."""
        if signal in self.states:
            return signal
        return next((state for state, output in self.states.items() if output == signal), None)

    def start(self, signal: Signal) -> tuple[Fraction, ...]:
        """Return what a signal is before the first cycle if the file does not say so: no rotation, or zero."""
        step = self.program.attitude_step
        if step is not None and signal.name == self.program.inputs[0].name:
            return step.identity
        if signal.identity is not None:
            return signal.identity
        if signal.constraint and signal.name in self.states:
            raise InputError(
                f"stage {self.name}: {signal.name} is of length 1, and zero is none; state it under initial"
            )
        return (Fraction(0),) * signal.size

    def settled(self, signal: Signal) -> Signal:
        """Return a signal with the unit and the frame that "any" stands for."""
        unit = self.known.get("unit", ANY) if signal.unit == ANY else signal.unit
        frame = self.known.get("frame", ANY) if signal.frame == ANY else signal.frame
        return replace(signal, unit=unit, frame=frame)


def ports(text: StageText, place: int) -> Ports:
    """Return a stage with its kernel, the constants folded into it."""
    try:
        choice = catalogue.choose(text.kernel, constants=text.constants or None, **text.options)
        program = pipeline.program(choice)
    except (InputError, InputTypeError) as error:
        raise InputError(f"stage {text.name}: {error}") from None
    stage = Ports(text, choice, program, place)
    _check_names(stage)
    return stage


def _check_names(stage: Ports) -> None:
    """Check that every table of a stage names inputs or outputs that its kernel has."""
    text, inputs, outputs = stage.text, stage.inputs, stage.outputs
    tables: tuple[tuple[str, Mapping[str, object], dict[str, Signal], str], ...] = (
        ("wires", text.wires, inputs, "input"),
        ("delay", text.delay, inputs, "input"),
        ("ranges", text.ranges, inputs, "input"),
        ("writes", text.writes, outputs, "output"),
        ("initial", text.initial, {**{s: inputs[s] for s in stage.states}, **outputs}, "state or output"),
        ("formats", text.formats, {**inputs, **outputs}, "input or output"),
    )
    for name in text.wires:
        if name in text.constants:
            raise InputError(f"stage {text.name}: {name} is wired and stated as a constant; one is needed")
    for table, entries, signals, what in tables:
        for name in entries:
            try:
                checks.choice(f"{what} of {text.kernel}", name, signals)
            except InputError as error:
                raise InputError(f"stage {text.name}: {table}: {error}") from None
    for name in text.delay:
        if name not in text.wires:
            raise InputError(f"stage {text.name}: delay of {name}, which is not wired")
    for name, numbers in text.initial.items():
        size = (inputs | outputs)[name].size
        if len(numbers) != size:
            raise InputError(
                f"stage {text.name}: initial {name} has {len(numbers)} numbers; {size} are needed"
            )
