"""Compiles generated C, C++ and Rust, and calls it through cffi; all loops are in that language."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, cached_property, partial
from itertools import accumulate, pairwise
from operator import le
from typing import Any

import numpy as np

from strapgen.ir.exceptions import InputError
from strapgen.ir.program import COUNTED_AS
from strapgen.ir.sources import Sources
from strapgen.run import compiler
from strapgen.run.evaluators import Array, Evaluator, Loop, fresh_feedback
from strapgen.run.orders import ORDERS
from strapgen.targets import TARGETS

#: The types of floating-point targets in numpy.
_TYPES: dict[str, np.dtype[Any]] = {"double": np.dtype(np.float64), "float": np.dtype(np.float32)}
#: Operations of `Program.operations` of which none with a number that is not finite is finite.
_SPREADING = frozenset(("add", "multiply", "negate"))
#: The other ones.
_OTHERS = frozenset(kind for kind in COUNTED_AS.values() if kind is not None) - _SPREADING
#: The generated loop of each order.
_LOOPS = dict(zip(ORDERS, ("propagate", "scan"), strict=True))
#: Runs that generated loops take side by side, in any type.
_GROUP = 16


def real_type(target: str) -> np.dtype[Any]:
    """Return the type of the numbers that go in and out of the code of a target: doubles in fixed point."""
    return _TYPES.get(TARGETS[target].number, np.dtype(np.float64))


@cache
def array_type(kind: np.dtype[Any]) -> str:
    """Return the C type of an array, whose name takes numpy longer to find than a short step takes."""
    if kind.kind in "iu":
        return f"{kind.name}_t[]"
    return next(f"{name}[]" for name, other in _TYPES.items() if other == kind)


class CEvaluator(Evaluator):
    """A generated function in C, C++ or Rust, in floating or fixed point."""

    def __init__(self, sources: Sources) -> None:
        fixed = sources.fixed
        super().__init__(sources, real_type(sources.target))
        #: Types of the inputs, of all outputs and of error feedback in C.
        self.input_types: list[np.dtype[Any]] = [self.dtype] * len(self.function.inputs)
        self.word_type: np.dtype[Any] = self.dtype
        self.feedback_type: np.dtype[Any] = self.dtype
        if fixed is not None:
            word = fixed.settings.word
            self.input_types = [np.dtype(f"int{argument.format.word}") for argument in fixed.inputs]
            self.word_type, self.feedback_type = np.dtype(f"int{word}"), np.dtype(f"uint{word}")
        self.module: Any = compiler.load(sources)
        self._array = getattr(self.module.lib, f"{self.function.name}_array")
        #: Memory for calls on one sample, of which every thread takes its own.
        self._idle: list[_OneSample | _OneFixedSample] = []
        self.scans = hasattr(self.module.lib, f"{self.function.name}_scan")

    @property
    def name(self) -> str:
        """Name of the back end."""
        fixed = self.sources.fixed
        return self.sources.target if fixed is None else f"{self.sources.target}{fixed.settings.word}"

    def __call__(self, *values: Any) -> Any:
        """Evaluate the kernel, see `Evaluator.__call__`: one sample with memory that is there."""
        if self.one_sample(values):
            try:
                one = self._idle.pop()
            except IndexError:
                one = _OneSample(self) if self.sources.fixed is None else _OneFixedSample(self)
            results = one.run(values)
            self._idle.append(one)
            if results is not None:
                return results
        return super().__call__(*values)

    def call(self, inputs: Sequence[Any], feedback: Any, where: str = "") -> tuple[Sequence[Any], Any]:
        """Call the function on rows, see `Evaluator.call`."""
        count = len(feedback)
        words = [
            np.ascontiguousarray(rows, kind) for rows, kind in zip(inputs, self.input_types, strict=True)
        ]
        outputs = [np.empty((count, signal.size), self.word_type) for signal in self.function.outputs]
        if self.sources.fixed is None:
            self._array(count, *map(self.pointer, (*words, *outputs)))
            return outputs, feedback
        feedback = np.array(feedback, self.feedback_type)
        status = self.module.ffi.new("int *")
        carried = [feedback] if self.sources.fixed.residuals else []
        done = self._array(count, status, *map(self.pointer, (*words, *carried, *outputs)))
        if status[0]:
            raise self.refused(status[0], f" (sample {done})" if count > 1 else where)
        return outputs, feedback

    def refused(self, status: int, where: str = "") -> InputError:
        """Return the error of a user's input for a status of the generated code."""
        if status == 1:
            limits = ", ".join(
                f"{a.signal.name} up to {float(a.high * a.unit):.6g}" for a in self.interface.inputs
            )
            return InputError(
                f"{self.kernel} refuses its input{where}: its formats were chosen for {limits}; orthonormalize more "
                "often, or allow for a larger drift or rate"
            )
        return InputError(f"{self.kernel} refuses its input{where}: it is too far from a proper one")

    @cached_property
    def spreads_nonfinite(self) -> bool:
        """Whether no state after a sample that is not finite is finite.

        No sum or product with a number that is not finite is finite. So it is where a step has no other operations,
        and every element of its inputs reaches the next state, as one that is no number shows.
        """
        if self.sources.fixed is not None or any(self.sources.operations[kind] for kind in _OTHERS):
            return False
        sizes = [signal.size for signal in self.function.inputs]
        rows = np.zeros((sum(sizes), sum(sizes)))
        np.fill_diagonal(rows, np.nan)
        outputs, _ = self.call(np.split(rows, np.cumsum(sizes)[:-1], axis=1), np.empty((len(rows), 0)))
        return bool(np.isnan(outputs[0]).any(axis=1).all())

    def pointer(self, array: Array) -> Any:
        """Return the C pointer to a contiguous array's first element."""
        return self.module.ffi.from_buffer(array_type(array.dtype), array)

    def address(self) -> int:
        """Return the address of the function on one sample."""
        ffi = self.module.ffi
        return int(ffi.cast("uintptr_t", ffi.addressof(self.module.lib, self.function.name)))

    def loop(self, samples: Array, loop: Loop) -> tuple[Array, Array]:
        """Run the loop in C, see `Evaluator.loop`; threads share independent runs in floating point."""
        ffi, name, fixed = self.module.ffi, self.function.name, self.sources.fixed
        propagate = getattr(self.module.lib, f"{name}_{_LOOPS[loop.order]}")
        runs, steps = samples.shape[:2]
        state, rows = (
            np.ascontiguousarray(array, kind)
            for array, kind in zip((loop.state, samples), self.input_types, strict=True)
        )
        feedback = np.array(loop.feedback, self.feedback_type)
        history = loop.room((runs, 1 + steps // loop.record_every, state.shape[1]), self.word_type)
        restore = ffi.NULL
        if isinstance(loop.restore, CEvaluator):
            restore = ffi.cast(f"{name}_orthonormalizer", loop.restore.address())
        stopped = ffi.new("size_t[2]")
        carried = [feedback] if fixed is not None and fixed.residuals else []

        def work(part: slice) -> int:
            arrays = [self.pointer(array[part]) for array in (state, rows, *carried, history)]
            last = [] if fixed is None else [stopped]
            count = len(range(runs)[part])
            status: int = propagate(
                count, steps, loop.record_every, loop.restore_every, restore, *arrays, *last
            )
            return status

        # Error feedback and the place of a refusal are those of one call.
        parts = _parts(runs, loop.jobs if fixed is None else 1)
        if len(parts) == 1:
            statuses = [work(parts[0])]
        else:
            with ThreadPoolExecutor(len(parts)) as pool:  # cffi calls C without the interpreter's lock
                statuses = list(pool.map(work, parts))
        if any(statuses) and fixed is None:
            raise RuntimeError(
                f"{self.kernel}: the generated loop refused its arguments with status {max(statuses)}"
            )
        if any(statuses):
            of_run = f" of run {stopped[0] + 1}" if runs > 1 else ""
            raise self.refused(statuses[0], f" in step {loop.first + stopped[1] + 1}{of_run}")
        return history, feedback.astype(loop.feedback.dtype)


def _parts(runs: int, jobs: int) -> list[slice]:
    """Return contiguous parts of some runs for so many threads, all but the last of whole groups."""
    groups = -(-runs // _GROUP)
    jobs = min(jobs, groups)
    edges = [min(runs, groups * job // jobs * _GROUP) for job in range(jobs + 1)]
    return [slice(first, stop) for first, stop in pairwise(edges) if first < stop]


class _OneSample:
    """Memory of a function in floating point for one sample, whose pointers are made once."""

    def __init__(self, evaluator: CEvaluator) -> None:
        signals, results = evaluator.function.inputs, evaluator.function.outputs
        self._numbers = np.empty(sum(signal.size for signal in signals), evaluator.dtype)
        self._inputs = _parts_of(self._numbers, [signal.shape for signal in signals])
        self._results = [np.empty(signal.shape, evaluator.dtype) for signal in results]
        pointers = map(evaluator.pointer, (*self._inputs, *self._results))
        self._call = partial(evaluator._array, 1, *pointers)

    def run(self, values: Sequence[Array]) -> Any:
        """Return the output of the function, or its outputs, for finite inputs; None for others."""
        for place, value in zip(self._inputs, values):  # noqa: B905  # of one length
            place[...] = value
        if not math.isfinite(sum(self._numbers.tolist())):
            return None
        self._call()
        results = self._results
        return results[0].copy() if len(results) == 1 else tuple([result.copy() for result in results])


class _OneFixedSample:
    """Memory of a function in fixed point for one sample: its numbers, and the integers that stand for them."""

    def __init__(self, evaluator: CEvaluator) -> None:
        fixed = evaluator.interface
        shapes = [signal.shape for signal in evaluator.function.inputs]
        elements = [argument for argument in fixed.inputs for _ in range(argument.signal.size)]
        self._units = np.array([float(argument.unit) for argument in elements])
        self._lows, self._highs = [a.low for a in elements], [a.high for a in elements]
        self._numbers, self._scaled = np.empty(len(elements)), np.empty(len(elements))
        self._inputs = _parts_of(self._numbers, shapes)
        self._rounded = _parts_of(self._scaled, shapes)
        self._words = [
            np.empty(shape, kind) for shape, kind in zip(shapes, evaluator.input_types, strict=True)
        ]
        self._fresh = fresh_feedback(fixed, 1).astype(evaluator.feedback_type)
        self._feedback = self._fresh.copy()
        self._results = [
            (np.empty(argument.signal.shape, evaluator.word_type), float(argument.unit))
            for argument in fixed.outputs
        ]
        self._status = evaluator.module.ffi.new("int *")
        carried = [self._feedback] if fixed.residuals else []
        arrays = (*self._words, *carried, *(words for words, _ in self._results))
        self._call = partial(evaluator._array, 1, self._status, *map(evaluator.pointer, arrays))

    def run(self, values: Sequence[Array]) -> Any:
        """Return the output of the function, or its outputs; None for inputs out of their ranges, or refused."""
        for place, value in zip(self._inputs, values):  # noqa: B905  # of one length
            place[...] = value
        with np.errstate(all="ignore"):  # what overflows is out of its range
            np.divide(self._numbers, self._units, self._scaled)  # exact for formats: powers of two
        integers = np.rint(self._scaled, self._scaled).tolist()
        # No comparison holds of what is no number.
        if not (all(map(le, self._lows, integers)) and all(map(le, integers, self._highs))):
            return None
        for words, rounded in zip(self._words, self._rounded):  # noqa: B905  # of one length
            words[...] = rounded
        self._feedback[...] = self._fresh
        self._status[0] = 0
        self._call()
        if self._status[0]:
            return None
        results = [np.multiply(words, unit, np.empty(words.shape)) for words, unit in self._results]
        return results[0] if len(results) == 1 else tuple(results)


def _parts_of(numbers: Array, shapes: Sequence[tuple[int, ...]]) -> list[Array]:
    """Return the parts of a row of numbers that are arrays of some shapes, one after the other."""
    edges = [0, *accumulate(map(math.prod, shapes))]
    return [numbers[i:j].reshape(shape) for (i, j), shape in zip(pairwise(edges), shapes, strict=True)]


class ModelEvaluator(Evaluator):
    """A generated Python function on integers that checks the range of every value."""

    def __init__(self, sources: Sources) -> None:
        super().__init__(sources, np.float64)
        self._carries = bool(self.interface.residuals)
        module = compiler.load(sources)
        self.generated: Callable[..., Any] = getattr(module, self.function.name)
        self.out_of_range: type[Exception] = module.OutOfRange

    def pack(self, rows: Array) -> Any:
        """Return the elements of rows; those of one row are Python's own integers, which are faster."""
        return rows[0].tolist() if len(rows) == 1 else [*rows.astype(self.number, copy=False).T]

    def unpack(self, packed: Any, count: int) -> Array:
        """Return elements as rows, see `Evaluator.unpack`."""
        if count == 1:
            return np.array([packed], self.number)
        rows = np.empty((count, len(packed)), self.number)
        for place, element in enumerate(packed):
            rows[:, place] = element
        return rows

    def call(self, inputs: Sequence[Any], feedback: Any, where: str = "") -> tuple[Sequence[Any], Any]:
        """Call the function on the elements of rows, see `Evaluator.call`."""
        if not self._carries:
            return self.step(*inputs, where=where), feedback
        *outputs, after = self.step(*inputs, feedback, where=where)
        return outputs, after

    def step(self, *arguments: Any, where: str = "") -> Any:
        """Call the generated function; a value out of range is raised as the error of a user's input."""
        try:
            return self.generated(*arguments)
        except self.out_of_range as error:
            raise InputError(f"{self.kernel} refuses its input{where}: {error}") from None
