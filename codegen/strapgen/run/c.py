"""The C back ends compile generated C in double or float and call it through cffi; all loops are in C."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any

import numpy as np

from strapgen.ir.sources import Sources
from strapgen.run import compiler
from strapgen.run.evaluators import Array, Evaluator
from strapgen.run.protocol import Backend
from strapgen.run.step_sources import StepSources
from strapgen.targets import TARGETS

#: The types of C in numpy.
_TYPES = {"double": np.float64, "float": np.float32}
#: Runs that generated loops take side by side, in any type.
_GROUP = 16


def real_type(target: str) -> tuple[str, Any]:
    """Return the name of the C type of a target's numbers, and the same type in numpy."""
    name = TARGETS[target].number
    return name, _TYPES[name]


class CEvaluator(Evaluator):
    """A generated C function."""

    def __init__(self, sources: Sources) -> None:
        self.real, dtype = real_type(sources.target)
        super().__init__(sources, dtype)
        self.module = compiler.load(sources)
        self._array = getattr(self.module.lib, f"{sources.function.name}_array")

    def evaluate(self, arrays: list[Array], batch: tuple[int, ...]) -> tuple[Array, ...]:
        """Evaluate on checked arrays."""
        inputs = [
            np.ascontiguousarray(np.broadcast_to(array, batch + signal.shape))
            for signal, array in zip(self.function.inputs, arrays, strict=True)
        ]
        outputs = tuple(np.empty(batch + signal.shape, self.dtype) for signal in self.function.outputs)
        count = int(np.prod(batch, dtype=int))
        self._array(count, *(self.pointer(array) for array in (*inputs, *outputs)))
        return outputs

    def pointer(self, array: Array) -> Any:
        """Return the C pointer to a contiguous array's first element."""
        return self.module.ffi.from_buffer(f"{self.real}[]", array)

    def address(self) -> int:
        """Return the address of the function on one sample."""
        ffi = self.module.ffi
        function = ffi.addressof(self.module.lib, self.function.name)
        return int(ffi.cast("uintptr_t", function))


class CBackend(Backend):
    """Runs generated C."""

    def __init__(self, parts: StepSources) -> None:
        step = CEvaluator(parts.step)
        super().__init__(parts, step)
        self._module, self._pointer = step.module, step.pointer
        name = self.sources.function.name
        self._generated_propagate = getattr(self._module.lib, f"{name}_propagate")
        self._orthonormalizer = self._module.ffi.NULL
        if self._orthonormalization is not None:
            address = self.beside(self._orthonormalization).address()
            self._orthonormalizer = self._module.ffi.cast(f"{name}_orthonormalizer", address)

    def beside(self, kernel: str) -> CEvaluator:
        """Return another kernel in C, see `Backend.beside`."""
        return CEvaluator(self._sources(kernel))

    def _propagate(
        self, increments: Array, record_every: int, orthonormalize_every: int, initial: Array
    ) -> Array:
        return self._in_threads(increments, record_every, orthonormalize_every, initial, 1)

    def _in_threads(
        self, increments: Array, record_every: int, orthonormalize_every: int, initial: Array, jobs: int
    ) -> Array:
        runs, steps = increments.shape[:2]
        history = np.empty((runs, 1 + steps // record_every, *self.state_shape), self.dtype)

        def work(part: slice) -> int:
            arrays = (initial[part], increments[part], history[part])
            status: int = self._generated_propagate(
                len(arrays[0]),
                steps,
                record_every,
                orthonormalize_every,
                self._orthonormalizer,
                *map(self._pointer, arrays),
            )
            return status

        parts = _parts(runs, jobs)
        if len(parts) == 1:
            statuses = [work(parts[0])]
        else:
            with ThreadPoolExecutor(len(parts)) as pool:  # cffi calls C without the interpreter's lock
                statuses = list(pool.map(work, parts))
        if any(statuses):
            raise RuntimeError(
                f"{self.kernel}: the generated loop refused its arguments with status {max(statuses)}"
            )
        return history


def _parts(runs: int, jobs: int) -> list[slice]:
    """Return contiguous parts of some runs for so many threads, all but the last of whole groups."""
    groups = -(-runs // _GROUP)
    jobs = min(jobs, groups)
    edges = [min(runs, groups * job // jobs * _GROUP) for job in range(jobs + 1)]
    return [slice(first, stop) for first, stop in pairwise(edges) if first < stop]
