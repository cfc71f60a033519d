"""Generates the stages of a system, in fixed point with ranges and formats that follow from wire to wire."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

from strapgen import pipeline, targets
from strapgen.fixedpoint.format_plan import ranges_of_copies
from strapgen.fixedpoint.sensor_scale import counted
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import DEFAULT_ANGLE, ROTATION_INPUTS, Settings, rounded_limit
from strapgen.ir.formats import Format
from strapgen.ir.interfaces import Argument
from strapgen.ir.program import Operation, Program, Reference
from strapgen.ir.signals import CYCLE, Signal
from strapgen.ir.sources import Sources
from strapgen.navigation.systems.system import Push, SystemStage
from strapgen.navigation.systems.wiring import Description
from strapgen.targets import TARGETS
from strapgen.targets.c import real_of
from strapgen.targets.names import MOST_CHOSEN
from strapgen.targets.naming import UNNAMED, Naming


@dataclass(frozen=True)
class GeneratedStages:
    """The generated stages of a system, and in fixed point the formats between them."""

    description: Description
    #: Target of the stages
    target: str
    #: Word and rounding where a stage states none; None in floating point
    settings: Settings | None
    #: Of each stage by its name
    sources: Mapping[str, Sources]
    #: Format and range of cells and of the inputs of the system; empty in floating point
    arguments: Mapping[str, Argument] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the unit in C; code in other numbers has another, so that both link into one program."""
        return self.description.system.name + _suffix(self.target, self.settings)

    def arguments_of(self, stage: SystemStage) -> dict[str, Argument]:
        """Return the inputs and outputs of a stage's function by their names; none in floating point."""
        interface = self.sources[stage.name].fixed
        return (
            {} if interface is None else {a.signal.name: a for a in (*interface.inputs, *interface.outputs)}
        )

    def held(self, name: str) -> list[Argument]:
        """Return the ranges of a cell or an input: its own first, then those of the outputs stored in it."""
        outputs = [
            self.arguments_of(stage)[output]
            for stage in self.description.system.stages
            for output, cell in stage.results
            if cell == name and self.arguments
        ]
        return [self.arguments[name], *outputs] if name in self.arguments else []


def clipped(held: Sequence[Argument], here: Argument | None) -> bool:
    """Return whether a stored value may exceed the word to which it is rescaled."""
    if here is None or not held or held[0].format == here.format:
        return False
    largest = max(argument.unit * max(argument.high, -argument.low) for argument in held)
    return math.floor(largest / here.unit + Fraction(1, 2)) > here.format.largest


def fitted(description: Description, target: str, settings: Settings | None = None) -> GeneratedStages:
    """Generate the stages of a system.

    In fixed point an input takes the format of what is wired to it, where that holds its range; where it does not, or
    the words differ, the wire is rescaled.
    """
    targets.require(target, settings)
    if TARGETS[target].fixed:
        return _Fit(description, target, settings or Settings()).run()
    sources = {}
    for stage in description.system.stages:
        try:
            sources[stage.name] = _generated(description, stage, target, None)
        except InputError as error:
            raise InputError(f"stage {stage.name}: {error}") from None
    return GeneratedStages(description, target, None, sources)


def _suffix(target: str, settings: Settings | None) -> str:
    """Return the ending of names in C for a kind of numbers."""
    if settings is not None:
        return f"_w{settings.word}"
    return real_of(target).infix if TARGETS[target].compiled else ""


def _generated(
    description: Description, stage: SystemStage, target: str, settings: Settings | None
) -> Sources:
    if not TARGETS[target].compiled:
        return pipeline.compile(description.choices[stage.name], target, settings, UNNAMED)
    name = f"{description.system.name}_{stage.name}{_suffix(target, settings)}"
    if len(name) > MOST_CHOSEN:
        raise InputError(f"its function would be called {name}; at most {MOST_CHOSEN} characters are allowed")
    naming = Naming(name=name)
    return pipeline.compile(description.choices[stage.name], target, settings, naming)


def without_needless_feedback(generate: Callable[[Settings], Sources], settings: Settings) -> Sources:
    """Generate a stage; without error feedback if it rounds nothing that the next call takes."""
    result = generate(settings)
    if settings.carry == "none" or result.fixed is None or result.fixed.residuals:
        return result
    # The same sources as from `strapgen generate` without the option.
    return generate(replace(settings, carry="none"))


@dataclass
class _Fit:
    """The formats while they are worked out."""

    description: Description
    target: str
    settings: Settings
    sources: dict[str, Sources] = field(default_factory=dict)
    arguments: dict[str, Argument] = field(default_factory=dict)

    def run(self) -> GeneratedStages:
        """Generate all stages, each with the formats of those before it."""
        system = self.description.system
        self.inputs = {signal.name: signal for signal in system.inputs}
        self.gyros = {name for name, signal in self.inputs.items() if signal.is_angle_increment}
        if self.settings.input_bits is not None and not self.gyros:
            what = "an lsb" if self.settings.sensor is not None else "a number of input bits"
            raise InputError(
                f"no input of {system.name} is an angle increment in body axes, in rad; {what} does not go with it"
            )
        self.pushed = {
            step.cell: step for rate in system.rates for step in rate.steps if isinstance(step, Push)
        }
        for stage in system.stages:
            try:
                self.sources[stage.name] = self._stage(stage)
            except InputError as error:
                raise InputError(f"stage {stage.name}: {error}") from None
            self._note(stage, self.sources[stage.name])
        self._check_initial()
        fit = GeneratedStages(self.description, self.target, self.settings, self.sources, self.arguments)
        self._check_ends(fit)
        return fit

    def _check_ends(self, fit: GeneratedStages) -> None:
        """Check that every stage refuses what is rescaled to the end of a word, which stands for all beyond it."""
        for stage in self.description.system.stages:
            arguments = fit.arguments_of(stage)
            for wire in stage.wires:
                here = arguments[wire.input]
                if here.high == here.format.largest and clipped(fit.held(wire.source), here):
                    raise InputError(
                        f"stage {stage.name}: the range of {wire.input} ends where its word of {here.format.word} bits "
                        f"does, so that more of {wire.source} would pass for its end; state another under ranges"
                    )

    def _check_initial(self) -> None:
        """Check that the values before the first cycle lie inside the ranges of their cells."""
        for cell in self.description.system.cells:
            argument = self.arguments.get(cell.name)
            if argument is None:
                continue
            for value in cell.initial:
                if not argument.low <= argument.format.nearest(value) <= argument.high:
                    largest = float(argument.high * argument.unit)
                    raise InputError(
                        f"{cell.name} begins with {float(value):g}, beyond its range of {largest:g}"
                    )

    def _stage(self, stage: SystemStage) -> Sources:
        """Return the sources of a stage, in the formats of what is wired to it as far as they fit."""
        stated = self.description.formats[stage.name]
        wired = {name: text for name, text in self._formats(stage).items() if name not in stated}
        settings = self._settings(stage)
        while True:
            try:
                return self._without_needless_feedback(stage, replace(settings, formats={**stated, **wired}))
            except InputError:
                if not wired:
                    raise
            # The formats of states are shared; those of wires give way, the last first.
            movable = [name for name in wired if name not in self._shared_signals(stage)]
            if not movable:
                return self._without_needless_feedback(stage, replace(settings, formats={**stated, **wired}))
            del wired[movable[-1]]

    def _without_needless_feedback(self, stage: SystemStage, settings: Settings) -> Sources:
        return without_needless_feedback(
            lambda chosen: _generated(self.description, stage, self.target, chosen), settings
        )

    def _settings(self, stage: SystemStage) -> Settings:
        """Return word, error feedback, the ranges of a stage's inputs, and the gyro if it takes counts."""
        ranges: dict[str, Fraction] = {}
        angle, sources = DEFAULT_ANGLE, {wire.input: wire.source for wire in stage.wires}
        copied = self._copies(stage)
        for wire, signal in zip(stage.wires, self._signals(stage), strict=True):
            known = copied.get(wire.input, wire.input)
            largest = self._range(stage, known, sources[known], signal)
            if signal.constraint or largest is None:
                continue
            if wire.input in ROTATION_INPUTS:
                angle = largest
            else:
                ranges[wire.input] = largest
        settings = self.settings if self._count_inputs(stage) else self.settings.without_counts()
        settings = replace(
            settings,
            word=stage.word or self.settings.word,
            carry=self._carry(stage),
            ranges=ranges,
            formats={},
            largest_angle=angle if settings.sensor is None else rounded_limit(angle),
            stated="",
        )
        wider = ranges_of_copies(self.description.programs[stage.name], settings, copied)
        return replace(settings, ranges=ranges | wider)

    def _count_inputs(self, stage: SystemStage) -> set[str]:
        """Return the inputs of a stage that are counts of the gyro."""
        if self.settings.input_bits is None:
            return set()
        takers = {signal.name for signal in counted(self.description.programs[stage.name])}
        wired = {wire.input: wire.source for wire in stage.wires if self._origin(wire.source) in self.gyros}
        for name in sorted({*wired} ^ takers if wired else ()):
            raise InputError(
                f"{name} takes an angle in rad, and {', '.join(sorted(self.gyros))} would be counts; no lsb goes "
                "with it"
            )
        return {*wired}

    def _origin(self, source: str) -> str:
        """Return where the samples of a wire come from: the other end of a cell that collects them, or the wire's."""
        while source in self.pushed:
            source = self.pushed[source].source
        return source

    def _copies(self, stage: SystemStage) -> dict[str, str]:
        """Return the states that are copies of inputs of the call before, with these inputs; not those with ranges."""
        stated = self.description.ranges[stage.name]
        known = copies(self.description.programs[stage.name])
        return {state: name for state, name in known.items() if state not in stated}

    def _carry(self, stage: SystemStage) -> str:
        """Return the error feedback of a stage: in full it is that of all that goes on, sums and increments too."""
        carry = stage.carry or self.settings.carry
        return (
            "all"
            if carry == "full" and self.description.programs[stage.name].attitude_step is None
            else carry
        )

    def _signals(self, stage: SystemStage) -> tuple[Signal, ...]:
        return self.description.programs[stage.name].inputs

    def _range(self, stage: SystemStage, name: str, source: str, signal: Signal) -> Fraction | None:
        """Return the range of an input: the stated one, or that of what is wired to it, at most the kernel's bound."""
        stated = self.description.ranges[stage.name].get(name)
        if stated is not None:
            return stated
        source = self._origin(source)
        if source in self.inputs:
            known = self.inputs[source].bound
        else:
            argument = self.arguments.get(source)
            known = None if argument is None else argument.unit * max(-argument.low, argument.high)
        if known is None or not known:
            return signal.bound
        if name in self._shared_signals(stage) or signal.bound is None:
            return known
        return min(known, signal.bound)

    def _shared_signals(self, stage: SystemStage) -> set[str]:
        """Return the inputs and outputs of a stage that are held in cells of another stage."""
        names = {wire.input for wire in stage.wires if wire.source in dict(stage.results).values()}
        names |= {output for output, _ in stage.results}
        cells = {wire.input: wire.source for wire in stage.wires} | dict(stage.results)
        return {name for name in names if cells[name] in self.arguments}

    def _formats(self, stage: SystemStage) -> dict[str, str]:
        """Return the formats of what is wired to a stage, and of the cells that its outputs replace, in its word."""
        word = stage.word or self.settings.word
        wired: dict[str, str] = {}
        counts = self._count_inputs(stage)  # their format follows from their bits
        for wire, signal in zip(stage.wires, self._signals(stage), strict=True):
            if wire.input in counts:
                continue
            if wire.external and self.inputs[wire.source].unit == "1" and signal.over == CYCLE:
                wired[wire.input] = str(Format(word, 0))  # counts are whole numbers
                continue
            argument = self.arguments.get(wire.source)
            if argument is None or argument.format.word != word or wire.source in self.pushed:
                continue
            if not signal.constraint or wire.input in self._shared_signals(stage):
                wired[wire.input] = str(argument.format)
        wired |= {state: wired[name] for state, name in self._copies(stage).items() if name in wired}
        states = {output for output, cell in stage.results if cell in {w.source for w in stage.wires}}
        for output, cell in stage.results:
            argument = self.arguments.get(cell)
            if argument is not None and argument.format.word == word and output not in states:
                wired[output] = str(argument.format)
        return wired

    def _note(self, stage: SystemStage, sources: Sources) -> None:
        """Note the formats of a stage's cells, and of the inputs and samples that it is the first to take."""
        assert sources.fixed is not None
        arguments = {argument.signal.name: argument for argument in sources.fixed.inputs}
        for wire in stage.wires:
            argument = arguments[wire.input]
            if wire.external or wire.source in self.pushed or wire.source in dict(stage.results).values():
                self.arguments.setdefault(wire.source, argument)
            push = self.pushed.get(wire.source)
            if push is not None and push.external:
                self.arguments.setdefault(push.source, argument)
        for argument in sources.fixed.outputs:
            self.arguments.setdefault(dict(stage.results)[argument.signal.name], argument)


def copies(program: Program) -> dict[str, str]:
    """Return the states that are copies of inputs of the call before, with these inputs.

    >>> from strapgen import pipeline
    >>> from strapgen.catalogue import Choice
    >>> copies(pipeline.program(Choice("two-speed-fast-2")))
    {'previous_increment': 'increment'}
    """
    inputs = {signal.elements: signal.name for signal in program.inputs}
    result = {}
    for state, elements in _next_elements(program).items():
        if elements in inputs:
            result[state] = inputs[elements]
    return result


def summed(program: Program) -> dict[str, str]:
    """Return the states that add up an input and nothing else until they are reset, with these inputs.

    >>> from strapgen import pipeline
    >>> from strapgen.catalogue import Choice
    >>> summed(pipeline.program(Choice("two-speed-fast-2")))
    {'angle_sum': 'increment', 'velocity_sum': 'velocity_increment'}
    """
    signals = {signal.name: signal for signal in program.inputs}
    values = {assignment.name: assignment.value for assignment in program.body}
    cleared = () if program.recursion is None else program.recursion.reset
    result = {}
    for state, elements in _next_elements(program).items():
        sums = {_added(values.get(element)) for element in elements}
        for name, signal in signals.items():
            pairs = {frozenset(pair) for pair in zip(signals[state].elements, signal.elements, strict=False)}
            if state in cleared and len(pairs) == len(elements) and sums == pairs:
                result[state] = name
    return result


def _next_elements(program: Program) -> dict[str, tuple[str, ...]]:
    """Return the names of the values that become the elements of each state."""
    outputs = {result.signal.name: result.nodes for result in program.outputs}
    states = () if program.recursion is None else program.recursion.states
    return {
        state: tuple(node.name for node in outputs[output] if isinstance(node, Reference))
        for state, output in states
    }


def _added(node: object) -> frozenset[str]:
    """Return the names of the two values that a node adds up; none if it is something else."""
    if not isinstance(node, Operation) or node.kind != "add":
        return frozenset()
    names = [each.name for each in node.arguments if isinstance(each, Reference)]
    return frozenset(names if len(names) == len(node.arguments) == 2 else ())
