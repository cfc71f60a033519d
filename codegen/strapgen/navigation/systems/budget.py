"""The budget of a described system: operations a second at each rate, and bytes of memory and constants."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import ClassVar

from strapgen.ir.exceptions import CompilerError
from strapgen.ir.program import Constant, Node, Operation, Program
from strapgen.lab import cost as costs
from strapgen.navigation.systems.fitting import GeneratedStages
from strapgen.navigation.systems.system import Rate
from strapgen.results.records import INTERNAL, Properties, entry, properties
from strapgen.targets import TARGETS

#: Bytes of a number in floating point, by its type in C.
_FLOATING = {"double": 8, "float": 4}
#: Bytes of the counter of cycles, and of the number of the stage that refused its input.
_COUNTER = 4


@dataclass(frozen=True)
class StageBudget:
    """Operations, memory and code of a stage."""

    name: str
    kernel: str
    #: Operations of a call by kind
    operations: Mapping[str, int]
    #: Different numbers in the code, other than 0, 1 and -1, and in fixed point other than powers of two, which
    #: are shifts
    constants: int
    #: Instructions of a call, bytes of object code and of stack on a processor; None where it was not measured
    executed: int | None = None
    code_bytes: int | None = None
    stack_bytes: int | None = None


@dataclass(frozen=True)
class RateBudget:
    """Operations and instructions of the stages of one rate in a second."""

    computed: ClassVar[Properties] = properties(
        operations=entry(),
        per_second=entry(key="operations_per_second", write=float, kind=float),
        executed_per_second=entry(key="instructions_per_second", write=float, kind=float | None),
    )

    #: Cycles of the fastest rate from one time to the next
    every: int
    hz: Fraction = field(metadata=entry(write=float, kind=float))
    stages: tuple[StageBudget, ...] = field(metadata=INTERNAL)

    @property
    def operations(self) -> dict[str, int]:
        """Of a call of all stages by kind, without those that do not occur."""
        total: dict[str, int] = {}
        for stage in self.stages:
            for kind, count in stage.operations.items():
                total[kind] = total.get(kind, 0) + count
        return total

    @property
    def per_second(self) -> Fraction:
        """Operations in a second, of all kinds."""
        return sum(self.operations.values()) * self.hz

    @property
    def executed_per_second(self) -> Fraction | None:
        """Instructions in a second; None where they were not measured."""
        counts = [stage.executed for stage in self.stages]
        return None if None in counts else sum(filter(None, counts)) * self.hz


@dataclass(frozen=True)
class Budget:
    """Operations, memory and code of a system."""

    computed: ClassVar[Properties] = properties(
        per_second=entry(key="operations_per_second", write=float, kind=float),
        executed_per_second=entry(key="instructions_per_second", write=float, kind=float | None),
        memory_bytes=entry(),
    )

    #: From the fastest, without those at which no stage runs
    rates: tuple[RateBudget, ...]
    #: Memory between calls: values
    cell_bytes: int
    #: Memory between calls: error feedback
    feedback_bytes: int
    #: Memory between calls: counters
    counter_bytes: int
    #: What a compiler puts between members so that each lies at a multiple of its size
    padding_bytes: int
    #: Of the different constants of all stages, and of initial values that are not zero
    constant_bytes: int
    #: Processor on which instructions were counted
    cpu: str | None = None

    @property
    def memory_bytes(self) -> int:
        """Size of the struct of the memory: values, error feedback, counters and padding."""
        return self.cell_bytes + self.feedback_bytes + self.counter_bytes + self.padding_bytes

    @property
    def code_bytes(self) -> int | None:
        """Bytes of object code of all stages; None where they were not measured."""
        sizes = [stage.code_bytes for rate in self.rates for stage in rate.stages]
        return None if None in sizes else sum(filter(None, sizes))

    @property
    def per_second(self) -> Fraction:
        """Operations of all rates in a second."""
        return sum((rate.per_second for rate in self.rates), Fraction(0))

    @property
    def executed_per_second(self) -> Fraction | None:
        """Instructions of all rates in a second; None where they were not measured."""
        counts = [rate.executed_per_second for rate in self.rates]
        return None if None in counts else sum(filter(None, counts), Fraction(0))


def budget(
    fit: GeneratedStages,
    measured: Mapping[str, tuple[int | None, int, int]] | None = None,
    cpu: str | None = None,
) -> Budget:
    """Return the budget of a system with generated stages.

    The copies of values between calls are not counted, nor are rescalings.
    """
    sizes = list(_sizes(fit))
    bytes_of = dict.fromkeys(("cell", "feedback", "counter"), 0)
    for kind, count, size in sizes:
        bytes_of[kind] += count * size
    padding = _align([(count, size) for _, count, size in sizes]) - sum(bytes_of.values())
    system = fit.description.system
    constants = sum(
        _bytes(fit, stage.name) * len(_constants(fit.description.programs[stage.name], _is_fixed(fit)))
        for stage in system.stages
    )
    initial = sum(
        count * size
        for (kind, count, size), cell in zip(sizes, system.cells, strict=False)
        if kind == "cell" and any(cell.initial)
    )
    rates = tuple(_rate(fit, rate, measured or {}) for rate in system.rates if rate.stages)
    cells, feedback, counters = bytes_of.values()
    return Budget(rates, cells, feedback, counters, padding, constants + initial, cpu)


def lines(needs: Budget) -> list[str]:
    """Return a budget in lines of text, for the head of generated files."""
    result = ["Budget of the stages' calls, without copies between them:"]
    for rate in needs.rates:
        names = ", ".join(stage.name for stage in rate.stages)
        counts = ", ".join(f"{count} {kind}" for kind, count in rate.operations.items())
        result.append(
            f"every {rate.every} ({float(rate.hz):g} Hz; {names}): {counts or 'no operations'}; "
            f"{_thousands(rate.per_second)} operations a second"
            + (
                f"; {_thousands(rate.executed_per_second)} instructions a second"
                if rate.executed_per_second
                else ""
            )
            + "."
        )
    result.append(f"All rates: {_thousands(needs.per_second)} operations a second.")
    if needs.executed_per_second is not None and needs.cpu:
        stack = max(stage.stack_bytes or 0 for rate in needs.rates for stage in rate.stages)
        result.append(
            f"On {needs.cpu}: {_thousands(needs.executed_per_second)} instructions a second, {needs.code_bytes} bytes "
            f"of object code, at most {stack} bytes of stack in a stage."
        )
    parts = [f"{needs.cell_bytes} of values"]
    parts += [f"{needs.feedback_bytes} of error feedback"] if needs.feedback_bytes else []
    parts += [f"{needs.counter_bytes} of counters"]
    parts += [f"{needs.padding_bytes} of padding"] if needs.padding_bytes else []
    result.append(
        f"Memory: {needs.memory_bytes} bytes, {', '.join(parts)}; constants and initial values: "
        f"{needs.constant_bytes} bytes."
    )
    return result


def _thousands(number: Fraction | None) -> str:
    """Return a number as digits in groups of three; parts of one are rounded."""
    return "-" if number is None else f"{round(number):,}".replace(",", " ")


def _rate(
    fit: GeneratedStages, rate: Rate, measured: Mapping[str, tuple[int | None, int, int]]
) -> RateBudget:
    stages = []
    for stage in rate.stages:
        counts = {kind: count for kind, count in fit.sources[stage.name].operations.items() if count}
        constants = len(_constants(fit.description.programs[stage.name], _is_fixed(fit)))
        seen = measured.get(stage.name, (None, None, None))
        stages.append(StageBudget(stage.name, stage.kernel, counts, constants, *seen))
    return RateBudget(rate.every, fit.description.system.sample_hz / rate.every, tuple(stages))


def _is_fixed(fit: GeneratedStages) -> bool:
    return TARGETS[fit.target].fixed


def _bytes(fit: GeneratedStages, stage: str) -> int:
    """Return the bytes of a number inside a stage."""
    interface = fit.sources[stage].fixed
    if interface is None:
        return _FLOATING.get(TARGETS[fit.target].number, 8)
    return -(-interface.settings.word // 8)


def _sizes(fit: GeneratedStages) -> Iterator[tuple[str, int, int]]:
    """Return kind, count and size of each member of the memory, in its order."""
    system = fit.description.system
    for cell in system.cells:
        argument = fit.arguments.get(cell.name)
        size = (
            _FLOATING.get(TARGETS[fit.target].number, 8)
            if argument is None
            else -(-argument.format.word // 8)
        )
        yield "cell", cell.signal.size, size
    for stage in system.stages:
        interface = fit.sources[stage.name].fixed
        if interface is not None and interface.residuals:
            yield "feedback", len(interface.residuals), _bytes(fit, stage.name)
    yield "counter", 2 if _is_fixed(fit) else 1, _COUNTER


def _align(members: list[tuple[int, int]]) -> int:
    """Return the size of a struct whose members lie at multiples of the size of their numbers."""
    place = 0
    for count, size in members:
        place = -(-place // size) * size + count * size
    widest = max(size for _, size in members)
    return -(-place // widest) * widest


def _constants(program: Program, shifts: bool) -> set[Constant]:
    """Return the different numbers in the code of a program; with shifts, without powers of two."""
    numbers = {abs(node.value) for assignment in program.body for node in _leaves(assignment.value)}
    numbers |= {abs(n.value) for result in program.outputs for n in result.nodes if isinstance(n, Constant)}
    return {
        Constant(number) for number in numbers if number not in (0, 1) and not (shifts and _is_power(number))
    }


def _leaves(node: Node) -> Iterator[Constant]:
    """Return the constants of a tree."""
    if isinstance(node, Constant):
        yield node
    elif isinstance(node, Operation):
        for argument in node.arguments:
            yield from _leaves(argument)


def _is_power(number: Fraction) -> bool:
    """Return whether a number is a power of two."""
    top, bottom = number.numerator, number.denominator
    return top & (top - 1) == 0 and bottom & (bottom - 1) == 0


def measured_budget(fit: GeneratedStages, cpu: str) -> Budget:
    """Return the budget of a system, with the instructions of every stage on a processor."""
    (name,) = costs.processors(None, [cpu])
    counts = {}
    for stage, sources in fit.sources.items():
        try:
            one = costs.cost(sources, name)
        except CompilerError as error:
            raise CompilerError(f"stage {stage}: {error}") from None
        counts[stage] = one.executed, one.code_bytes, one.stack_bytes
    return budget(fit, counts, name)
