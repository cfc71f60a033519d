"""Runs the generated C unit of a described system."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from strapgen.ir.exceptions import InputError
from strapgen.ir.sources import Sources
from strapgen.navigation.systems import system_generation
from strapgen.navigation.systems.fitting import Fitted
from strapgen.navigation.systems.system_memory import SystemMemory
from strapgen.navigation.systems.system_runner import SystemRunner
from strapgen.run import compiler
from strapgen.run.compiled_code import array_type, real_type
from strapgen.run.evaluators import Array


class CompiledSystem(SystemRunner):
    """Runs the C unit of a system: the generated one, or files that are stated."""

    def __init__(self, fit: Fitted, backend: str, sources: Sources | None = None) -> None:
        super().__init__(fit, backend)
        self.sources = sources or system_generation.unit(fit, f"strapgen system {self.system.name}")
        self.module = compiler.load(self.sources)
        self.name = self.sources.function.name

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

    def trace(self, samples: Mapping[str, Array], memory: SystemMemory | None = None) -> dict[str, Array]:
        """Run checked samples cycle by cycle, and return every cell before the first cycle and after each.

        Cells are (cycles + 1, elements), in the numbers of the C. A stage that refuses its input is named.
        """
        ffi = self.module.ffi
        held = self.struct(memory or self.begin())
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
        return self._cells_of(np.frombuffer(states, np.uint8).reshape(len(rows[0]) + 1, len(view)))

    def _cells_of(self, structs: Array) -> dict[str, Array]:
        """Return the cells of many structs in memory, one a row of bytes."""
        ffi, result = self.module.ffi, {}
        for cell in self.system.cells:
            place, kind = ffi.offsetof(f"{self.name}_memory", cell.name), self._type(cell.name)
            columns = structs[:, place : place + kind.itemsize * cell.signal.size]
            result[cell.name] = np.ascontiguousarray(columns).view(kind).astype(self._number(cell.name))
        return result

    def _refused(self, status: int, held: Any, done: int) -> InputError:
        """Return the error of a stage that has refused its input."""
        stage = self.system.stages[held.refused - 1].name
        why = "an input lies outside its range" if status == 1 else "its input is too far from a proper one"
        return InputError(f"stage {stage} refuses its input in cycle {done + 1} ({why})")
