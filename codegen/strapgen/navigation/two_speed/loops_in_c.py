"""Runs the loops of an algorithm in two speeds in one generated C function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from strapgen.ir.exceptions import InputTypeError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Sources
from strapgen.navigation.two_speed import two_speed_sources
from strapgen.navigation.two_speed.loops import Cycles, Loops, LoopsFromPython, LoopSources
from strapgen.run import compiler
from strapgen.run.c import real_type
from strapgen.run.evaluators import Array, Evaluator
from strapgen.run.fixed_numbers import array_type


class LoopsInC(Loops):
    """Runs all loops in one call of a generated C function."""

    def __init__(self, sources: LoopSources, evaluator: Callable[[Sources], Evaluator]) -> None:
        super().__init__(sources, evaluator)
        if sources.whole is None:
            raise InputTypeError("the loops have no C of the whole; LoopsInC.generated returns it")
        if sources.loops[0].fixed is None:
            self.dtype = np.dtype(real_type(sources.whole.target)[1])
        self._target = sources.whole.target
        self._function = sources.whole.function.name
        self._module = compiler.load(sources.whole)

    @classmethod
    def generated(cls, algorithm: str, sculling: int, target: str, settings: Settings | None) -> LoopSources:
        """Return the loops and the C of the whole, see `Loops.generated`."""
        parts = super().generated(algorithm, sculling, target, settings)
        return replace(parts, whole=two_speed_sources.sources(algorithm, sculling, target, settings))

    def run(self, cycles: Cycles) -> tuple[Array, Array]:
        """Run whole navigation cycles in C, see `Loops.run`."""
        ffi, lib = self._module.ffi, self._module.lib
        memory = ffi.new(f"{self._function}_memory *")
        values = {
            name: np.ascontiguousarray(array, self._kind(name))
            for name, array in {**cycles.samples, **cycles.start}.items()
        }
        getattr(lib, f"{self._function}_begin")(memory, self._pointer(values["state"]))
        for name in ("previous_turn", "previous_increment"):
            getattr(memory, name)[0:3] = values[name][0].tolist()
        slow_cycles = len(values["turn"])
        navigation_cycles = slow_cycles // cycles.slow
        attitudes = np.empty((slow_cycles, values["state"].shape[1]), self._kind("state"))
        changes = np.empty((navigation_cycles, 3), self._kind("velocity_change"))
        if navigation_cycles:
            inputs = [values[signal.name] for group in self.wires.samples for signal in group]
            status = getattr(lib, f"{self._function}_run")(
                navigation_cycles,
                cycles.slow,
                cycles.fast,
                memory,
                *map(self._pointer, (*inputs, attitudes, changes)),
            )
            if status:
                # One by one, the loops raise the error that names the loop and its input.
                LoopsFromPython(self.sources, self.evaluator).run(cycles)
                raise AssertionError("the loops by themselves refuse what the whole refuses")
        return attitudes, changes

    def _kind(self, name: str) -> np.dtype[Any]:
        """Return the type of an argument's elements."""
        held = self._arguments.get(name)
        kind: np.dtype[Any] = self.dtype if held is None else np.dtype(f"int{held[0].format.word}")
        return kind

    def _pointer(self, array: Array) -> Any:
        """Return the C pointer to a contiguous array's first element."""
        kind = array_type(array.dtype) if array.dtype.kind == "i" else f"{real_type(self._target)[0]}[]"
        return self._module.ffi.from_buffer(kind, array)
