"""Runs a described system on the generated functions of its stages, cycle by cycle or one rate on many memories."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import Format
from strapgen.ir.interfaces import Argument
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.read_only import ReadOnly
from strapgen.ir.signals import CYCLE
from strapgen.ir.sources import Sources
from strapgen.navigation.systems import system_generation
from strapgen.navigation.systems.fitting import GeneratedStages, fitted
from strapgen.navigation.systems.system import DescribedSystem, Push, Rate, SystemStage
from strapgen.navigation.systems.system_bounds import SystemBounds, bounds
from strapgen.navigation.systems.wiring import Description
from strapgen.run import compiler
from strapgen.run.backend_names import BACKENDS, evaluator_class
from strapgen.run.backends import fit_settings
from strapgen.run.compiled_code import array_type, real_type
from strapgen.run.evaluators import Array, Evaluator, fresh_feedback, in_si, stored
from strapgen.run.increments import pulses
from strapgen.run.kernel_sources import sources_of_choice
from strapgen.targets import TARGETS

#: From this word length on, a word resolves what a double does, and samples are not rounded as sums.
EXACT_BITS = 53
#: Cycles, about, whose outputs are held at a time.
BLOCK = 1 << 14


class SystemRunner:
    """A described system on a back end: calls the generated function of each stage from Python.

    Parameters
    ----------
    fit : GeneratedStages
        Its generated stages.
    backend : str
        Name of the back end.

    Examples
    --------
    >>> from strapgen import read_system, system_runner
    >>> system_runner(read_system("two-speed-euler"))
    <SystemRunner two_speed_euler on numpy: fast, slow, nav>
    """

    __repr__ = short_repr

    def _in_words(self) -> str:
        return f"{self.system.name} on {self.backend}: {', '.join(self.fit.sources)}"

    def __init__(self, fit: GeneratedStages, backend: str) -> None:
        self.fit = fit
        self.backend = backend
        self.system: DescribedSystem = fit.description.system
        self.many_digits: bool = BACKENDS[backend].many_digits

    @cached_property
    def evaluators(self) -> dict[str, Evaluator]:
        """The generated functions of the stages by name; C is compiled in one call of the compiler."""
        compiler.compile_together(self.fit.sources.values())
        make = evaluator_class(BACKENDS[self.backend].target)
        return {name: make(sources) for name, sources in self.fit.sources.items()}

    def fresh(self, runs: int) -> dict[str, Array]:
        """Return the error feedback with which runs begin, by stage, (runs, number of words)."""
        return {name: fresh_feedback(sources.fixed, runs) for name, sources in self.fit.sources.items()}

    def begin(self, runs: int = 1) -> SystemMemory:
        """Return the memory with which a run begins."""
        cells = {}
        for cell in self.system.cells:
            argument = self.fit.arguments.get(cell.name)
            if argument is not None:
                words = [argument.format.nearest(value) for value in cell.initial]
                row: Array = np.array([words], object if argument.format.word > 32 else np.int64)
            else:
                row = stored([[float(value) for value in cell.initial]], self.number)
            cells[cell.name] = np.repeat(row, runs, axis=0)
        return SystemMemory(cells, self.fresh(runs))

    @cached_property
    def rounding(self) -> SystemBounds:
        """Error bounds of one pass."""
        return bounds(self.fit)

    @property
    def number(self) -> np.dtype[Any]:
        """Type of the numbers in floating point; an object is one of mpmath."""
        return next(iter(self.evaluators.values())).number

    def set(self, memory: SystemMemory, cell: str, value: Any) -> None:
        """Set a cell to a value in SI units, for instance an attitude at the start."""
        held = self.system.cell(cell)
        array = checks.real_array(cell, value, held.signal.shape, np.float64).reshape(-1, held.signal.size)
        memory.cells[cell] = np.repeat(
            self.stored(cell, array), len(memory.cells[cell]) // len(array), axis=0
        )

    def settle(self, memory: SystemMemory, known: Set[str]) -> None:
        """Compute what follows from cells that are known, and make it the value of the cycle before.

        A stage that takes known cells and its own alone, and changes no known one, is called twice, so that what it
        keeps of the cycle before is that of this one; so is what other stages keep of a value that follows.
        """
        follows, again = {*known}, True
        while again:
            again = False
            for stage in self.system.stages:
                results = {cell for _, cell in stage.results}
                wires = {wire.source for wire in stage.wires if not wire.external}
                if results & follows or wires - results - follows or any(w.external for w in stage.wires):
                    continue
                for _ in range(2):
                    self.call_stage(memory, stage, {})
                follows |= results
                again = True
        for stage in self.system.stages:
            sources = {wire.input: wire.source for wire in stage.wires}
            for name, source in sources.items():
                kept = sources.get(f"previous_{name}")
                if kept is not None and source in follows and kept not in follows:
                    self.set(memory, kept, self.in_si(source, memory.cells[source]))

    def stored(self, name: str, values: Array) -> Array:
        """Return numbers in SI units as the system stores them."""
        return stored(values, self.number, self.fit.arguments.get(name), self.system.name)

    def in_si(self, name: str, values: Array) -> Array:
        """Return stored values of a cell as numbers in SI units, (count, elements)."""
        return np.asarray(in_si(values, self.fit.arguments.get(name)), np.float64)

    def samples(self, inputs: Mapping[str, Any]) -> dict[str, Array]:
        """Return samples of the inputs as the system takes them, checked.

        In fixed point an increment takes over the rounding error of the one before, as from a sensor that counts
        pulses.

        Parameters
        ----------
        inputs : mapping of str to array_like, (cycles, shape)

        Raises
        ------
        InputError
            If an input is missing or unknown, or has another shape or range.
        """
        names = [signal.name for signal in self.system.inputs]
        for name in [*inputs, *names]:
            if name not in names or name not in inputs:
                raise InputError(
                    f"inputs are {', '.join(sorted(inputs))}; the system has: {', '.join(names)}"
                )
        result, counts = {}, set()
        for signal in self.system.inputs:
            values = checks.real_array(signal.name, inputs[signal.name], signal.shape, np.float64)
            values = values.reshape(-1, signal.size)
            argument = self.fit.arguments.get(signal.name)
            if argument is not None and signal.over == CYCLE and argument.format.word < EXACT_BITS:
                values = carried(values, argument.unit)
            result[signal.name] = self.stored(signal.name, values)
            counts.add(len(values))
        if len(counts) > 1:
            raise InputError(
                f"the inputs have {' and '.join(map(str, sorted(counts)))} samples; one number is needed"
            )
        return result

    def run(self, inputs: Mapping[str, Any], memory: SystemMemory | None = None) -> SystemRun:
        """Run cycles of the fastest rate.

        Parameters
        ----------
        inputs : mapping of str to array_like, (cycles, shape)
            Samples of every input in SI units.
        memory : SystemMemory, optional
            What a run before has left; by default `begin`.

        Returns
        -------
        SystemRun
            The system's outputs after each of their cycles.

        Raises
        ------
        InputError
            If a sample is refused; the message names the stage.
        """
        samples = self.samples(inputs)
        count = len(next(iter(samples.values())))
        return self._block(samples, count, (memory or self.begin()).copy())

    def blocks(self, inputs: Mapping[str, Any], memory: SystemMemory | None = None) -> Iterator[SystemRun]:
        """Run cycles as `run` does, and yield the outputs of some thousands at a time, whole cycles of all rates.

        Parameters
        ----------
        inputs, memory
            As for `run`.
        """
        samples = self.samples(inputs)
        count = len(next(iter(samples.values())))
        after = (memory or self.begin()).copy()
        size = -(-BLOCK // self.system.cycle) * self.system.cycle
        for first in range(0, count, size):
            part = {name: rows[first : first + size] for name, rows in samples.items()}
            run = self._block(part, min(size, count - first), after)
            after = run.memory
            yield run

    def _block(self, samples: Mapping[str, Array], count: int, memory: SystemMemory) -> SystemRun:
        values, after = self._run(samples, count, memory)
        shaped = {
            name: self.in_si(name, rows).reshape(-1, *self.system.cell(name).signal.shape)
            for name, rows in values.items()
        }
        return SystemRun(shaped, after)

    def _run(
        self, samples: Mapping[str, Array], count: int, memory: SystemMemory
    ) -> tuple[dict[str, Array], SystemMemory]:
        """Run checked samples, and return the outputs after each of their cycles and the memory."""
        recorded: dict[str, list[Array]] = {name: [] for name in self.system.outputs}
        every = {name: self.system.every(name) for name in self.system.outputs}
        for k in range(count):
            memory.cycle = (memory.cycle + 1) % self.system.cycle
            due = [rate for rate in self.system.rates if memory.cycle % rate.every == 0]
            self.call(memory, {name: rows[k : k + 1] for name, rows in samples.items()}, due)
            for name, rows in recorded.items():
                if memory.cycle % every[name] == 0:
                    rows.append(memory.cells[name])
        empty = {name: memory.cells[name][:0] for name in recorded}
        return {
            name: np.concatenate(rows) if rows else empty[name] for name, rows in recorded.items()
        }, memory

    def trace(self, samples: Mapping[str, Array], memory: SystemMemory | None = None) -> SystemMemory:
        """Run checked samples cycle by cycle, and return a row of memory before the first cycle and after each.

        Rows are in the numbers of the code. A stage that refuses its input is named.
        """
        after = (memory or self.begin()).copy()
        rows = [after.copy()]
        for k in range(len(next(iter(samples.values())))):
            _, after = self._run({name: values[k : k + 1] for name, values in samples.items()}, 1, after)
            rows.append(after.copy())
        return SystemMemory(
            {name: np.concatenate([row.cells[name] for row in rows]) for name in after.cells},
            {name: np.concatenate([row.feedback[name] for row in rows]) for name in after.feedback},
            after.cycle,
        )

    def call(self, memory: SystemMemory, samples: Mapping[str, Array], rates: Sequence[Rate]) -> None:
        """Run some rates once on every row of a memory, each with its samples.

        Parameters
        ----------
        memory : SystemMemory
            With one row a run; it is changed.
        samples : mapping of str to array, (runs, elements)
            As `samples` returns them.
        rates : sequence of Rate
        """
        for rate in rates:
            for step in rate.steps:
                if isinstance(step, Push):
                    self.push(memory, step, samples)
                else:
                    self.call_stage(memory, step, samples)
            self.clear(memory, rate)

    def clear(self, memory: SystemMemory, rate: Rate) -> None:
        """Set the cells to zero that a rate clears at its end."""
        for name in rate.cleared:
            memory.cells[name] = np.zeros_like(memory.cells[name])

    def push(self, memory: SystemMemory, push: Push, samples: Mapping[str, Array]) -> None:
        """Add a sample to a cell that holds several."""
        new = samples[push.source] if push.external else memory.cells[push.source]
        new = self._moved(new, self.fit.arguments.get(push.source), self.fit.arguments.get(push.cell))
        held = memory.cells[push.cell]
        memory.cells[push.cell] = np.concatenate([held[:, new.shape[1] :], new], axis=1)

    def call_stage(self, memory: SystemMemory, stage: SystemStage, samples: Mapping[str, Array]) -> None:
        """Call a stage on every row."""
        evaluator, arguments = self.evaluators[stage.name], self.fit.arguments_of(stage)
        rows = []
        for wire in stage.wires:
            held = samples[wire.source] if wire.external else memory.cells[wire.source]
            rows.append(self._moved(held, self.fit.arguments.get(wire.source), arguments.get(wire.input)))
        try:
            outputs, memory.feedback[stage.name] = evaluator.run(rows, memory.feedback[stage.name])
        except InputError as error:
            raise InputError(f"stage {stage.name}: {error}") from None
        for (name, cell), output in zip(stage.results, outputs, strict=True):
            memory.cells[cell] = self._moved(output, arguments.get(name), self.fit.arguments.get(cell))

    def _moved(self, values: Array, there: Argument | None, here: Argument | None) -> Array:
        """Return integers in another format, rounded as the generated C rounds them."""
        if there is None or here is None or there.format == here.format:
            return values
        return rescaled(values, there.format, here.format)


def carried(values: Array, unit: Fraction) -> Array:
    """Return increments of any number of elements, (cycles, elements), as differences of rounded sums."""
    count, size = values.shape
    padded = np.pad(values, ((0, 0), (0, -size % 3)))
    triples = padded.reshape(count, -(-size // 3), 1, 3).swapaxes(0, 1)
    return pulses(triples, unit).swapaxes(0, 1).reshape(padded.shape)[:, :size]


@dataclass
class SystemMemory:
    """The memory of a system, in the numbers of its back end."""

    cells: dict[str, Array]  # (runs, elements)
    feedback: dict[str, Array]  # error feedback of each stage, (runs, number of words)
    cycle: int = 0  # cycles since all rates last fell together

    def copy(self) -> SystemMemory:
        """Return a memory that changes by itself."""
        return SystemMemory(dict(self.cells), dict(self.feedback), self.cycle)


@dataclass(frozen=True)
class SystemRun(ReadOnly):
    """The result of a run; its memory can be written, and goes into a next run."""

    values: Mapping[str, Array]  # by the name of the cell, in SI units, (times, shape)
    memory: SystemMemory = field(repr=False)  # at the end, from which a next run goes on


def rescaled(values: Array, there: Format, here: Format) -> Array:
    """Return integers of one format as those of another: to the nearest, halves up, and at most what the word holds.

    >>> rescaled(np.array([[3, -3, 40000]]), Format(32, 20), Format(16, 19)).tolist()
    [[2, -1, 20000]]
    """
    places = here.fraction - there.fraction
    top = here.largest
    whole = np.asarray(values, object)
    moved = whole << places if places >= 0 else (whole + (1 << (-places - 1))) >> -places
    return np.asarray(np.clip(moved, -top - 1, top), object if here.word > 32 else np.int64)


class CompiledSystem(SystemRunner):
    """Runs the C unit of a system: the generated one, or files that are stated."""

    def __init__(self, fit: GeneratedStages, backend: str, sources: Sources | None = None) -> None:
        super().__init__(fit, backend)
        self.sources: Sources = sources or system_generation.unit(fit, f"strapgen system {self.system.name}")
        self.module: Any = compiler.load(self.sources)
        self.name: str = self.sources.function.name

    @property
    def number(self) -> np.dtype[Any]:
        """Type of the numbers in floating point."""
        return real_type(self.fit.target)

    def _type(self, name: str) -> np.dtype[Any]:
        argument = self.fit.arguments.get(name)
        return self.number if argument is None else np.dtype(f"int{argument.format.word}")

    def struct(self, memory: SystemMemory) -> Any:
        """Return a memory as the struct of the generated C."""
        held = self.module.ffi.new(f"{self.name}_memory *")
        for name, rows in memory.cells.items():
            setattr(held, name, rows[0].tolist())
        for name, rows in memory.feedback.items():
            if rows.shape[1]:
                setattr(held, f"residuals_{name}", rows[0].tolist())
        held.cycle = memory.cycle
        return held

    def memory(self, held: Any) -> SystemMemory:
        """Return the struct of the generated C as a memory."""
        cells = {
            cell.name: np.array([list(getattr(held, cell.name))], self._number(cell.name))
            for cell in self.system.cells
        }
        feedback = {}
        for name, words in self.fresh(1).items():
            if words.shape[1]:
                words = np.array([list(getattr(held, f"residuals_{name}"))], words.dtype)
            feedback[name] = words
        return SystemMemory(cells, feedback, int(held.cycle))

    def _number(self, name: str) -> Any:
        argument = self.fit.arguments.get(name)
        if argument is None:
            return self._type(name)
        return object if argument.format.word > 32 else np.int64

    def _run(
        self, samples: Mapping[str, Array], count: int, memory: SystemMemory
    ) -> tuple[dict[str, Array], SystemMemory]:
        ffi, system = self.module.ffi, self.system
        held = self.struct(memory)
        inputs = [np.ascontiguousarray(samples[s.name], self._type(s.name)) for s in system.inputs]
        outputs = [
            np.empty(
                (
                    (memory.cycle + count) // system.every(name) - memory.cycle // system.every(name),
                    system.cell(name).signal.size,
                ),
                self._type(name),
            )
            for name in system.outputs
        ]
        done = ffi.new("size_t *")
        pointers = [ffi.from_buffer(array_type(array.dtype), array) for array in (*inputs, *outputs)]
        status = getattr(self.module.lib, f"{self.name}_run")(count, held, *pointers, done)
        if status:
            raise self._refused(status, held, int(done[0]))
        values = {
            name: array.astype(self._number(name))
            for name, array in zip(system.outputs, outputs, strict=True)
        }
        return values, self.memory(held)

    def trace(self, samples: Mapping[str, Array], memory: SystemMemory | None = None) -> SystemMemory:
        """Run cycle by cycle in C, see `SystemRunner.trace`."""
        ffi = self.module.ffi
        memory = memory or self.begin()
        held = self.struct(memory)
        rows = [np.ascontiguousarray(samples[s.name], self._type(s.name)) for s in self.system.inputs]
        first = [ffi.from_buffer(array_type(array.dtype), array) for array in rows]
        sizes = [signal.size for signal in self.system.inputs]
        cycle, view = getattr(self.module.lib, f"{self.name}_cycle"), ffi.buffer(held)
        states = bytearray(view)
        for k in range(len(rows[0])):
            pointers = [pointer + k * size for pointer, size in zip(first, sizes, strict=True)]
            status = cycle(held, *pointers)
            if status:
                raise self._refused(status, held, k)
            states += view
        structs = np.frombuffer(states, np.uint8).reshape(len(rows[0]) + 1, len(view))
        cells = {
            cell.name: self._column(structs, cell.name, cell.signal.size, self._type(cell.name)).astype(
                self._number(cell.name)
            )
            for cell in self.system.cells
        }
        feedback = {name: np.repeat(words, len(structs), axis=0) for name, words in memory.feedback.items()}
        for name, words in feedback.items():
            fixed = self.fit.sources[name].fixed
            if fixed is not None and words.size:
                kind = np.dtype(f"uint{fixed.settings.word}")
                words[:] = self._column(structs, f"residuals_{name}", words.shape[1], kind)
        return SystemMemory(cells, feedback, int(held.cycle))

    def _column(self, structs: Array, name: str, size: int, kind: np.dtype[Any]) -> Array:
        """Return a member of many structs in memory, one a row of bytes."""
        place = self.module.ffi.offsetof(f"{self.name}_memory", name)
        return np.ascontiguousarray(structs[:, place : place + kind.itemsize * size]).view(kind)

    def _refused(self, status: int, held: Any, done: int) -> InputError:
        """Return the error of a stage that has refused its input."""
        stage = self.system.stages[held.refused - 1].name
        why = "an input lies outside its range" if status == 1 else "its input is too far from a proper one"
        return InputError(f"stage {stage} refuses its input in cycle {done + 1} ({why})")


__all__ = ["SystemMemory", "SystemRun", "SystemRunner", "system_runner"]


def system_runner(
    description: Description, backend: str = "numpy", settings: Settings | None = None
) -> SystemRunner:
    """Return a described system on a back end.

    Parameters
    ----------
    description : Description
        What `strapgen.navigation.systems.wiring.described` returned.
    backend : str, optional
        A key of `strapgen.BACKENDS`.
    settings : Settings, optional
        Word, rounding and error feedback in fixed point where a stage states none.

    Raises
    ------
    InputError
        If a name is not known, or a stage does not go with the settings.
    CompilerError
        If the back end needs a C compiler and there is none.

    Examples
    --------
    >>> from strapgen import read_system
    >>> system_runner(read_system("two-speed-euler"))
    <SystemRunner two_speed_euler on numpy: fast, slow, nav>
    """
    entry = BACKENDS[checks.choice("backend", backend, BACKENDS)]
    chosen = fit_settings(backend, settings)
    if entry.target not in TARGETS:
        sources = {name: sources_of_choice(c, entry.target) for name, c in description.choices.items()}
        return SystemRunner(GeneratedStages(description, entry.target, None, sources), backend)
    fit = fitted(description, entry.target, chosen)
    compiled = TARGETS[entry.target].compiled
    return (CompiledSystem if compiled else SystemRunner)(fit, backend)
