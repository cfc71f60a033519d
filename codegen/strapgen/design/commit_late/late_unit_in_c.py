"""Commits an attitude late and answers it now in generated C."""

from __future__ import annotations

from typing import Any

import numpy as np

from strapgen.design.commit_late.late_unit import GapError, refusal
from strapgen.ir.exceptions import InputError
from strapgen.ir.sources import Sources
from strapgen.run import compiler
from strapgen.run.compiled_code import array_type, real_type
from strapgen.run.evaluators import Array


class LateUnitInC:
    """Commits late and answers now in the C of `commit_late_sources.sources`; its interface is that of `LateUnit`."""

    def __init__(self, sources: Sources) -> None:
        module = compiler.load(sources)
        self._ffi, self._lib, self._name = module.ffi, module.lib, sources.function.name
        self.fixed = sources.fixed
        self.dtype = real_type(sources.target) if sources.fixed is None else np.dtype(np.int32)
        self._state = sources.function.inputs[0]
        self._memory = self._ffi.new(f"{self._name}_memory *")
        self._call("init")
        self.committed: list[Array] = []

    @property
    def attitude(self) -> Array:
        """The committed attitude."""
        values = self._ffi.unpack(self._memory.state, self._state.size)
        return np.array(values, self.dtype).reshape(self._state.shape)

    @property
    def pending(self) -> int:
        """Intervals that are not committed."""
        return int(self._memory.pending)

    def reset(self, attitude: Array) -> None:
        """Replace the committed attitude."""
        self._call("reset", self._pointer(np.ascontiguousarray(attitude, self.dtype)))

    def push(self, sample: Array, kind: int) -> int:
        """Take a sample and return how many intervals it commits, see `LateUnit.push`."""
        gap, count = self._memory.gap, self._memory.count
        status = self._call("push", self._pointer(np.ascontiguousarray(sample, self.dtype)), kind)
        if status < 0:
            raise self._refused(status, kind, gap, count)
        return self._commit(status)

    def now(self) -> Array:
        """Return the attitude at the end of the last interval."""
        attitude = np.empty(self._state.shape, self.dtype)
        self._accepted("now", self._pointer(attitude))
        return attitude

    def flush(self) -> int:
        """Commit all intervals with the samples that are there, and return how many."""
        return self._commit(self._accepted("flush"))

    def _accepted(self, what: str, *arguments: Any) -> int:
        """Call a function and return its result, unless it refuses the state."""
        status = self._call(what, *arguments)
        if status < 0:
            raise self._refused(status, 0, 0, 0)
        return status

    def _refused(self, status: int, kind: int, gap: int, count: int) -> InputError:
        """Return the error that a status stands for."""
        if self.fixed is not None and status == -1:
            return InputError("a sample lies outside the range of its format")
        if self.fixed is not None and status == -2:
            return InputError("the state is too far from a proper one to be advanced; reset it")
        return GapError(refusal(kind, gap, count))

    def _commit(self, count: int) -> int:
        self.committed = [self.attitude] if count else []
        return count

    def _call(self, what: str, *arguments: Any) -> int:
        return int(getattr(self._lib, f"{self._name}_{what}")(self._memory, *arguments))

    def _pointer(self, array: Array) -> Any:
        """Return the C pointer to a contiguous array's first element."""
        return self._ffi.from_buffer(array_type(array.dtype), array)
