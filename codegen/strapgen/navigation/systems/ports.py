"""The inputs, outputs and states of a stage's kernel, with units and frames after wiring."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

from strapgen import catalogue, pipeline
from strapgen.catalogue import Choice
from strapgen.ir import checks
from strapgen.ir.checks import counted
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.program import Program
from strapgen.ir.signals import ANY, CYCLE, Signal
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
        """Return the default value of a signal before the first cycle: no rotation, or zero."""
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
        """Return a signal with actual unit and frame in place of "any"."""
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


@dataclass(frozen=True)
class Source:
    """The source of a wire: an input of the system, or a value of a stage."""

    #: As the file writes it
    name: str
    signal: Signal
    #: The stage; None for an input
    stage: Ports | None = None
    #: Whether it is a sum that is cleared when a slower stage has taken it
    sum: bool = False

    @property
    def every(self) -> int:
        """Cycles of the fastest rate from one value to the next."""
        return 1 if self.stage is None else self.stage.text.every


def check_order(stages: Sequence[Ports]) -> None:
    """Check that stages stand from the fastest to the slowest, and that each rate divides the next.

    The fastest runs in every cycle, unless it is an attitude step that collects the samples of several.
    """
    for before, stage in itertools.pairwise(stages):
        if stage.text.every < before.text.every:
            raise InputError(
                f"stage {stage.name} (every {stage.text.every}) stands after {before.name} "
                f"(every {before.text.every}); stages stand from the fastest to the slowest"
            )
        if stage.text.every % before.text.every:
            raise InputError(
                f"stage {stage.name}: every {stage.text.every} is no multiple of the {before.text.every} "
                f"of {before.name}; rates divide"
            )
    if stages[0].text.every != 1 and stages[0].program.attitude_step is None:
        raise InputError(
            f"stage {stages[0].name}: every is {stages[0].text.every}; the fastest stage has 1, unless it "
            "collects samples"
        )


def check_shape(where: str, needed: Signal, there: Signal) -> None:
    """Check that both ends of a wire have one shape."""
    if needed.shape != there.shape:
        raise InputError(f"{where}: shape {there.shape} meets shape {needed.shape}")


def check_direction(stage: Ports, name: str, source: Source) -> None:
    """Check that a wire to an earlier stage, or to the stage itself, is delayed, and no other is."""
    assert source.stage is not None
    back = source.stage.place >= stage.place
    if source.stage is stage and name not in stage.text.delay:
        raise InputError(
            f"stage {stage.name}: {name} = {source.name!r} comes from the stage itself; state its delay, "
            f"delay = {{ {name} = 1 }}"
        )
    if back and name not in stage.text.delay:
        raise InputError(
            f"stage {stage.name}: {name} = {source.name!r} goes back from a later stage to an earlier one; "
            f"state its delay, delay = {{ {name} = 1 }}"
        )
    if not back and name in stage.text.delay:
        raise InputError(
            f"stage {stage.name}: delay of {name}, which comes from the earlier stage {source.stage.name}; "
            "only wires that go back are delayed"
        )


def check_undelayed(stage: Ports, name: str, what: str) -> None:
    """Check that no delay is stated for an input that cannot have one."""
    if name in stage.text.delay:
        raise InputError(
            f"stage {stage.name}: delay of {name}, which is {what}; only wires that go back are delayed"
        )


def check_initial(stage: Ports, name: str, signal: Signal, initial: Sequence[Fraction]) -> None:
    """Check that the value of a cell before the first cycle lies inside its range."""
    largest = stage.text.ranges.get(name, signal.bound)
    if largest is None and signal.constraint:
        largest = Fraction(1)
    beyond = next((value for value in initial if largest is not None and abs(value) > largest), None)
    if largest is not None and beyond is not None:
        raise InputError(
            f"stage {stage.name}: initial {name} holds {float(beyond):g}, beyond its range of {float(largest):g}"
        )


def check_rates(where: str, stage: Ports, signal: Signal, source: Source, samples: int) -> None:
    """Check that what changes over a cycle passes between stages of one rate."""
    here, there = stage.text.every, source.every
    step = stage.program.attitude_step
    if samples and step is not None:
        taken = samples - step.extra_increments
        if here != there * taken:
            raise InputError(
                f"{where}: a step takes {counted(taken, 'sample')} of every {there}, so that its every is "
                f"{there * taken}, not {here}"
            )
    elif source.sum:
        if here < there:
            raise InputError(
                f"{where}: a sum is taken by a stage that is not faster; every is {here}, below {there}"
            )
    elif signal.over == CYCLE and here != there:
        raise InputError(
            f"{where}: increments of every {there} meet a stage of every {here}; sum-3 sums them up, hold-3 "
            "shares them out"
        )


def check_range(stage: Ports, name: str, signal: Signal, source: Source) -> None:
    """Check that the range of an input is known before its stage is generated."""
    known = signal.bound is not None or signal.constraint or name in stage.text.ranges
    forward = source.stage is None or source.stage.place < stage.place
    if not known and not forward:
        raise InputError(f"stage {stage.name}: the range of {name} is missing; state it under ranges")
