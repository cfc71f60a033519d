"""Runs generated numpy functions; a run takes the transitions of all steps at once, then their blocked scan."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np

from strapgen.ir.sources import Function, Sources
from strapgen.run import compiler
from strapgen.run.evaluators import Array, Evaluator, Loop
from strapgen.run.increments import PART

#: Samples that are evaluated together: the two or three arrays of an operation stay in the nearest caches, and a call
#: of numpy costs little beside its work.
_BLOCK = 1 << 13
#: Largest number of steps times runs in one span: some megabytes, which stay in the processor's cache. A run that comes
#: part by part has the same spans.
_SPAN = PART


class NumpyEvaluator(Evaluator):
    """A generated numpy function; `generated` is the function itself, which checks nothing."""

    needs_product = True

    def __init__(self, sources: Sources) -> None:
        super().__init__(sources, np.float64)
        self.generated: Callable[..., Any] = getattr(compiler.load(sources), self.function.name)

    def __call__(self, *values: Any) -> Any:
        """Evaluate the kernel, see `Evaluator.__call__`: one sample on Python's floats, to the same bits."""
        if self._on_floats is not None and self.one_sample(values):
            results = self._on_floats([value.ravel().tolist() for value in values])
            if results is not None:
                return results
        return super().__call__(*values)

    @cached_property
    def _on_floats(self) -> FloatProgram | None:
        """The operations of the function on one sample; None of a function that selects by a condition."""
        try:
            return FloatProgram(self.generated, self.function)
        except TypeError:
            return None

    def evaluate(self, arrays: Sequence[Array], batch: tuple[int, ...]) -> tuple[Array, ...]:
        """Evaluate on checked arrays, many samples in blocks whose temporaries stay in the cache."""
        count = math.prod(batch)
        if count <= _BLOCK:
            return self._results(arrays)
        signals = self.function.inputs
        rows = [
            array
            if array.shape == signal.shape
            else np.broadcast_to(array, batch + signal.shape).reshape(count, *signal.shape)
            for array, signal in zip(arrays, signals, strict=True)
        ]
        outputs = [np.empty((count, *signal.shape)) for signal in self.function.outputs]
        for first in range(0, count, _BLOCK):
            block = slice(first, first + _BLOCK)
            results = self._results(
                row if row.shape == signal.shape else row[block]
                for row, signal in zip(rows, signals, strict=True)
            )
            for output, result in zip(outputs, results, strict=True):
                output[block] = result
        return tuple(output.reshape(batch + output.shape[1:]) for output in outputs)

    def _results(self, arrays: Iterable[Array]) -> tuple[Array, ...]:
        """Return the outputs of the generated function."""
        results = self.generated(*arrays)
        return results if isinstance(results, tuple) else (results,)

    def call(self, inputs: Sequence[Any], feedback: Any, where: str = "") -> tuple[Sequence[Any], Any]:
        """Call the function on rows, see `Evaluator.call`."""
        count = len(feedback)
        signals, results = self.function.inputs, self.function.outputs
        arrays = [rows.reshape(count, *signal.shape) for rows, signal in zip(inputs, signals, strict=True)]
        outputs = zip(self.evaluate(arrays, (count,)), results, strict=True)
        return [np.asarray(output).reshape(count, signal.size) for output, signal in outputs], feedback

    @cached_property
    def _transition(self) -> ArrayProgram:
        """The transition of a step's increments, as a scan calls it."""
        transition = getattr(compiler.load(self.sources), f"{self.function.name}_transition")
        return ArrayProgram(transition, [self.function.inputs[1].shape])

    @cached_property
    def _product(self) -> ArrayProgram:
        """The state after a transition, as a scan calls it."""
        return ArrayProgram(self.generated, [signal.shape for signal in self.function.inputs])

    def loop(self, samples: Array, loop: Loop) -> tuple[Array, Array]:
        """Run a step with no Python loop over the steps of a long run or over many runs, see `Evaluator.loop`.

        A step that is not linear in the state has no product, and runs one step after the other.
        """
        if not isinstance(loop.product, NumpyEvaluator):
            return super().loop(samples, loop)
        runs, steps = samples.shape[:2]
        shape = self.function.inputs[0].shape
        history = loop.room((runs, 1 + steps // loop.record_every, *shape), self.number)
        history[:, 0] = state = loop.state.reshape(runs, *shape)
        assert self.sources.attitude_step is not None, "only an attitude step has a product"
        identity = np.array([float(x) for x in self.sources.attitude_step.identity])
        scan = _BlockedScan(self._transition, loop.product._product, identity)
        for first, length, segments in _spans(steps, loop.restore_every, max(1, _SPAN // max(runs, 1))):
            span = samples[:, first : first + length * segments]
            complete = loop.restore_every and (first + length) % loop.restore_every == 0
            restore = (
                loop.restore.generated if complete and isinstance(loop.restore, NumpyEvaluator) else None
            )
            count = span.shape[1]
            direct = loop.record_every == 1
            states = history[:, 1 + first : 1 + first + count] if direct else np.empty((runs, count, *shape))
            state = _run_span(scan, loop.product.generated, restore, span, length, segments, state, states)
            if direct:
                continue
            # Records of this span: steps first + 1, ..., counted from 1.
            offset = -first % loop.record_every or loop.record_every
            recorded = states[:, offset - 1 :: loop.record_every]
            if recorded.shape[1]:
                place = (first + offset) // loop.record_every
                history[:, place : place + recorded.shape[1]] = recorded
        return history.reshape(*history.shape[:2], math.prod(shape)), loop.feedback


def _run_span(
    scan: _BlockedScan,
    product: Callable[..., Array],
    restore: Callable[..., Array] | None,
    samples: Array,
    length: int,
    segments: int,
    state: Array,
    states: Array,
) -> Array:
    """Run segments of `length` steps, of which the last may be shorter; store all states and return the last.

    The segments are scanned side by side from the identity. A loop over them then takes the state through their
    products and restores it between them.
    """
    (runs, steps), shape = samples.shape[:2], state.shape[1:]
    size = math.prod(shape)
    totals = scan.totals(samples, length, segments)
    starts = np.empty((runs, segments, *shape))
    ends = np.empty_like(starts)
    segment_totals = totals[:, -1].reshape(size, runs, segments).transpose(2, 1, 0)
    full = steps // length
    for segment, total in enumerate(segment_totals.reshape(segments, runs, *shape)):
        starts[:, segment] = state
        state = product(state, total)
        if restore is not None and segment < full:
            state = restore(state)
        ends[:, segment] = state
    begin = np.ascontiguousarray(starts.reshape(runs * segments, size).T)
    blocks = totals.shape[1]
    depth = -(-length // blocks)
    exact = segments * blocks * depth == steps
    places = (runs, segments, blocks, depth, size)
    # The first splits axes, and copies nothing.
    by_time = states.reshape(places) if exact else np.empty(places)
    scan.states(begin, totals, by_time.transpose(4, 3, 2, 0, 1))
    if not exact:
        padded = by_time.reshape(runs, segments, blocks * depth, *shape)[:, :, :length]
        states[...] = padded.reshape(runs, segments * length, *shape)[:, :steps]
    if restore is not None:
        whole = states[:, : full * length].reshape(runs, full, length, *shape)
        whole[:, :, -1] = ends[:, :full]
    return states[:, -1].copy()  # so a run that goes on from a record of its last state has the same bits


def _spans(steps: int, segment: int, most: int) -> list[tuple[int, int, int]]:
    """Cut the steps into spans: first step, steps per segment, number of segments.

    A segment lies between two orthonormalizations; a span holds whole segments, or a part of a long one.
    """
    spans: list[tuple[int, int, int]] = []
    first = 0
    if segment and segment <= most:
        together = most // segment
        while first < steps:
            segments = min(together, -(-(steps - first) // segment))
            spans.append((first, segment, segments))
            first += segment * segments
        return spans
    while first < steps:
        until_end = segment - first % segment if segment else steps
        length = min(most, until_end, steps - first)
        spans.append((first, length, 1))
        first += length
    return spans


#: Number of products in one numpy call of a scan, large enough to hide the cost of the call. Rows of a power of two
#: would lie in the same lines of the cache.
_WIDTH = 8000
#: Steps in one elementwise pass, whose temporaries stay in the nearest caches.
_PASS = 12_000


class _BlockedScan:
    """Turns the increments of many steps into their states, by the transition of a step and the product of two.

    It holds the memory in which it works; calls in several threads need one scan each.
    """

    def __init__(self, transition: ArrayProgram, product: ArrayProgram, identity: Array) -> None:
        self._transition, self._product, self._identity = transition, product, identity
        self._memory: dict[str, Array] = {}
        self._views: dict[tuple[str, int, tuple[int, ...]], Array] = {}
        self._rows = 0
        self._local = np.empty(0)

    def totals(self, increments: Array, length: int, segments: int) -> Array:
        """Return the products of transitions up to the end of each block, (elements, blocks, runs * segments).

        Samples are (runs, N, numbers of a step); each run consists of so many segments of `length` steps, of which the
        last may be shorter. Steps beyond its end do not turn it.
        """
        width = increments.shape[0] * segments
        blocks, depth = _cut(length, width)
        # Each result lies where nothing is needed any more: products before their transitions, states after both.
        self._rows = min(depth, max(1, _PASS // (blocks * width)))
        self._local = self._room("local", len(self._identity), (depth + self._rows, blocks, width))
        transitions = self._local[:, self._rows :]
        self._turn(increments, length, segments, transitions)
        self._accumulate(transitions, self._local)
        return self._scan(self._local[:, depth - 1])

    def states(self, begin: Array, totals: Array, out: Array) -> None:
        """Store the states after each step of the last call of `totals`, which returned `totals`.

        They go from those at the beginning of each segment, (elements, runs * segments), to `out` by the depth in their
        block, (elements, depth, blocks, runs, segments), in memory of any order.
        """
        depth, rows, local = out.shape[1], self._rows, self._local
        heads = self._room("heads", len(totals), totals.shape[1:])
        heads[:, 0] = begin
        if totals.shape[1] > 1:
            self._multiply(begin[:, None], totals[:, :-1], heads[:, 1:])
        for k in reversed(range(0, depth, rows)):
            products = local[:, k : min(k + rows, depth)]
            self._multiply(heads[:, None], products, local[:, k + rows : k + rows + products.shape[1]])
        for element, by_place in zip(out, local[:, rows:], strict=True):
            element[...] = by_place.reshape(element.shape)

    def _turn(self, increments: Array, length: int, segments: int, out: Array) -> None:
        """Store the transitions, (elements, depth, blocks, runs * segments); those beyond the end are the identity."""
        runs, steps = increments.shape[:2]
        depth, blocks, width = out.shape[1:]
        exact = steps == segments * blocks * depth
        padded = increments if exact else _pad(increments, length, segments, blocks * depth)
        by_block = padded.reshape(width, blocks, depth, -1).transpose(3, 1, 0, 2)
        columns = out.reshape(len(out), depth, -1).transpose(0, 2, 1)
        first = 0
        for tile in _tiles(blocks, width, max(1, _PASS // depth)):
            part = by_block[:, *tile]
            count = part.shape[1] * part.shape[2]
            work = self._room("work", len(part) + self._transition.temporaries, (count, depth))
            numbers = work[: len(part)]
            numbers.reshape(part.shape)[...] = part
            self._transition((numbers,), columns[:, first : first + count], work[len(part) :])
            first += count
        if not exact:
            place = np.arange(blocks * depth).reshape(blocks, depth).T[:, :, None, None]
            beyond = (place >= length) | (place + length * np.arange(segments) >= steps)
            for element, value in zip(out, self._identity, strict=True):
                np.copyto(element.reshape(depth, blocks, runs, segments), value, where=beyond)

    def _scan(self, transitions: Array) -> Array:
        """Return the product of all transitions up to each place, (elements, length, width)."""
        elements, length, width = transitions.shape
        blocks, depth = _cut(length, width)
        by_time = np.empty((elements, blocks * depth, width))
        by_time[:, :length] = transitions
        by_time[:, length:] = self._identity[:, None, None]
        by_place = by_time.reshape(elements, blocks, depth, width).transpose(0, 2, 1, 3)
        local = np.empty((elements, depth + 1, blocks, width))
        local[:, 1:] = by_place
        self._accumulate(local[:, 1:], local[:, :-1])
        by_place[:, :, 0] = local[:, :-1, 0]
        if blocks > 1:
            totals = self._scan(local[:, -2])
            self._multiply(totals[:, None, :-1], local[:, :-1, 1:], by_place[:, :, 1:])
        return by_time[:, :length]

    def _accumulate(self, transitions: Array, products: Array) -> None:
        """Store the product of transitions up to each, in every block at once, (elements, depth, ...).

        A product may lie where any transition before it did.
        """
        depth = transitions.shape[1]
        before, after = (x.reshape(*x.shape[:2], -1) for x in (transitions, products))
        after[:, 0] = before[:, 0]
        for k in range(1, depth):
            self._multiply(after[:, k - 1], before[:, k], after[:, k])

    def _multiply(self, state: Array, transition: Array, out: Array) -> None:
        """Store states advanced by transitions, all (elements, ...); a state of length 1 serves along a whole axis."""
        shape = out.shape[1:]
        most = max(1, _PASS // math.prod(shape[:-1]))
        if shape[-1] > most:
            for first in range(0, shape[-1], most):
                columns = (..., slice(first, first + most))
                self._multiply(state[columns], transition[columns], out[columns])
            return
        work = self._room("work", self._product.temporaries, shape)
        self._product((state, transition), out, work)

    def _room(self, name: str, count: int, shape: tuple[int, ...]) -> Array:
        """Return memory (count, *shape), which the next call for the same name overwrites."""
        view = self._views.get((name, count, shape))
        if view is None:
            size = math.prod(shape)
            memory = self._memory.get(name)
            if memory is None or len(memory) < count or memory.shape[1] < size:
                memory = self._memory[name] = work_arrays(count, size)
            view = self._views[name, count, shape] = memory[:count, :size].reshape(count, *shape)
        return view


# A blocked scan over the transitions of a run, which has the state after every step in few calls of numpy.
#
# The state after n steps is the product of n transitions, and the product is associative. The steps are therefore cut
# into blocks whose products grow side by side, as in a parallel prefix sum: Python loops over the places in a block,
# numpy over the blocks. Arrays have the element first, (elements, depth, blocks, ...), so that every operation runs
# over contiguous memory.


def _cut(length: int, width: int) -> tuple[int, int]:
    """Return the number of blocks for a scan of `length` steps in `width` columns, and the places in each."""
    blocks = max(1, min(round(_WIDTH / width), length // 4))
    return blocks, -(-length // blocks)


def _tiles(blocks: int, width: int, most: int) -> Iterator[tuple[slice, slice]]:
    """Cut (blocks, width) into parts of up to `most` columns, which follow each other in memory."""
    if width <= most:
        for first in range(0, blocks, most // width):
            yield slice(first, first + most // width), slice(None)
        return
    for block in range(blocks):
        for first in range(0, width, most):
            yield slice(block, block + 1), slice(first, first + most)


def _pad(increments: Array, length: int, segments: int, places: int) -> Array:
    """Return the increments of segments, each with zeros up to so many places, (runs, segments, places, numbers)."""
    runs, steps = increments.shape[:2]
    rows = increments.reshape(runs, steps, -1)
    result = np.zeros((runs, segments, places, rows.shape[2]))
    full = steps // length
    result[:, :full, :length] = rows[:, : full * length].reshape(runs, full, length, rows.shape[2])
    if full < segments:
        result[:, full, : steps - full * length] = rows[:, full * length :]
    return result


#: Doubles in a line of the cache. Vectors of AVX-512 are as long, and slow where they cross from line to line.
_LINE = 8


class _Value(np.lib.mixins.NDArrayOperatorsMixin):
    """A value of the function: the result of an operation, or an input, which has none."""

    def __init__(self, tape: list[_Value], operation: Any = None, operands: Iterable[Any] = ()) -> None:
        self.tape, self.operation = tape, operation
        self.operands = tuple(x.item() if isinstance(x, np.ndarray) else x for x in operands)
        self.place = ""
        self.last = -1
        if operation is not None:
            tape.append(self)

    def __array_ufunc__(self, operation: np.ufunc, method: str, *operands: Any, **options: Any) -> _Value:
        """Record an operation."""
        if method != "__call__" or options or operation.nout != 1:
            raise TypeError(f"{operation.__name__} is recorded as an operation on elements alone")
        return _Value(self.tape, operation, operands)

    def __getattr__(self, name: str) -> Callable[..., _Value]:
        """Return an operation, such as a sine, that numpy calls on an element of an array as its method."""
        operation = getattr(np, name, None)
        if not isinstance(operation, np.ufunc):
            raise AttributeError(name)
        return partial(operation, self)

    def __bool__(self) -> bool:
        """Refuse a branch, which all samples would take."""
        raise TypeError("a recorded value is neither true nor false")


class ArrayProgram:
    """The operations of a generated function with one output, whose inputs have shapes, on arrays (elements, ...).

    A function that selects by a condition runs as it is. A call needs so many work arrays as `temporaries`.

    Examples
    --------
    >>> program = ArrayProgram(lambda x: np.stack([x[..., 0] * x[..., 1] + 2.0, x[..., 0]], axis=-1), [(2,)])
    >>> result = np.empty((2, 3))
    >>> program([np.array([[1.0, 2, 3], [4, 5, 6]])], result, np.empty((program.temporaries, 3)))
    >>> result
    array([[ 6., 12., 20.],
           [ 1.,  2.,  3.]])
    """

    def __init__(self, function: Callable[..., Array], inputs: list[tuple[int, ...]]) -> None:
        self._function, self._shapes = function, inputs
        self._operations: Callable[..., None] = self._whole
        self.temporaries = 0
        try:
            values, (results,), tape = _record(function, inputs)
        except TypeError:
            return
        outputs = [_output(x, tape) for x in results]
        self.temporaries = _allocate([*values, outputs], tape)
        self._operations = _compile(tape, [*map(len, values), len(outputs), self.temporaries])

    def __call__(self, inputs: Sequence[Array], out: Array, work: Array) -> None:
        """Evaluate on arrays (elements, ...) that broadcast to the output, which shares no memory with them."""
        self._operations(*inputs, out, work)

    def _whole(self, *arrays: Array) -> None:
        """Run the function itself."""
        *inputs, out, _ = arrays
        split = [
            np.moveaxis(x, 0, -1).reshape(*x.shape[1:], *shape)
            for x, shape in zip(inputs, self._shapes, strict=True)
        ]
        out[...] = np.moveaxis(self._function(*split).reshape(*out.shape[1:], len(out)), -1, 0)


#: Operations on Python's own floats with the bits of numpy's; those on its floats, of any other operation, cost more.
_OF_FLOATS = {
    "add": "{} + {}",
    "subtract": "{} - {}",
    "multiply": "{} * {}",
    "divide": "{} / {}",
    "negative": "-{}",
    "positive": "{}",
    "sqrt": "root({})",
}


class FloatProgram:
    """The operations of a generated function on the floats of one sample.

    Numpy takes as long for an operation on one number as on hundreds. A function that selects by a condition cannot be
    recorded, which is a TypeError.

    Examples
    --------
    >>> from strapgen import evaluator
    >>> made = evaluator("euler-normalize")
    >>> FloatProgram(made.generated, made.function)([[0.0, 0.0, 0.0, 2.0]])
    array([0., 0., 0., 1.])
    """

    def __init__(self, function: Callable[..., Any], signature: Function) -> None:
        self._shapes = [signal.shape for signal in signature.outputs]
        values, results, tape = _record(function, [signal.shape for signal in signature.inputs])
        known: dict[str, Any] = {"root": math.sqrt}
        for k, signal in enumerate(values):
            for i, value in enumerate(signal):
                value.place = f"x{k}_{i}"
        lines = [f"def run({', '.join(f'x{k}' for k in range(len(values)))}):"]
        lines += [f"    {', '.join(value.place for value in x)}, = x{k}" for k, x in enumerate(values) if x]
        for number, step in enumerate(tape):
            name, operands = step.operation.__name__, [_text(x) for x in step.operands]
            known[name] = step.operation
            call = _OF_FLOATS.get(name, f"float({name}({', '.join(operands)}))").format(*operands)
            step.place = f"t{number}"
            lines.append(f"    {step.place} = {call}")
        listed = [f"[{', '.join(map(_text, elements))}]" for elements in results]
        lines.append(f"    return {', '.join(listed)},")
        exec(compile("\n".join(lines), "<operations of a generated function>", "exec"), known)
        self._run: Callable[..., tuple[list[float], ...]] = known["run"]

    def __call__(self, rows: list[list[float]]) -> Array | tuple[Array, ...] | None:
        """Return the output, or the outputs; None where a number is not finite, of which numpy would warn."""
        try:
            results = self._run(*rows)
        except (ArithmeticError, ValueError):
            return None
        if not math.isfinite(sum(map(sum, (*rows, *results)))):
            return None
        arrays = [np.array(x).reshape(shape) for x, shape in zip(results, self._shapes, strict=True)]
        return arrays[0] if len(arrays) == 1 else tuple(arrays)


def _text(value: Any) -> str:
    """Return an operand as Python writes it."""
    return value.place if isinstance(value, _Value) else f"({float(value)!r})"


def _record(
    function: Callable[..., Any], inputs: list[tuple[int, ...]]
) -> tuple[list[list[_Value]], list[list[Any]], list[_Value]]:
    """Return the elements of a function's inputs, those of its outputs, and its operations in order."""
    tape: list[_Value] = []
    values = [[_Value(tape) for _ in range(math.prod(shape))] for shape in inputs]
    results = function(*(np.array(x, object).reshape(s) for x, s in zip(values, inputs, strict=True)))
    return values, [[*x.flat] for x in (results if isinstance(results, tuple) else (results,))], tape


def _output(value: Any, tape: list[_Value]) -> _Value:
    """Return an output that is stored by an operation of its own, though it may be an input or a constant too."""
    if isinstance(value, _Value) and value.operation is not None and not value.place:
        value.place = "output"
        return value
    return _Value(tape, np.positive, (value,))


def _allocate(signals: list[list[_Value]], tape: list[_Value]) -> int:
    """Give each value a place in the arrays of the inputs and the output or in a work array; return their number.

    A work array serves again where its value is needed last, first of all for the result of that operation.
    """
    for number, step in enumerate(tape):
        for value in step.operands:
            if isinstance(value, _Value):
                value.last = number
    for k, values in enumerate(signals):
        for i, value in enumerate(values):
            value.place = f"x{k}_{i}"
    count = 0
    free: list[str] = []
    for number, step in enumerate(tape):
        for value in {id(x): x for x in step.operands if isinstance(x, _Value)}.values():
            if value.last == number and value.place.startswith("work"):
                free.append(value.place)
        if not step.place:
            if not free:
                free.append(f"work{count}")
                count += 1
            step.place = free.pop()
    return count


def _compile(tape: list[_Value], counts: list[int]) -> Callable[..., None]:
    """Return a function of the inputs, the output and the work arrays, of which there are so many each.

    It is one line of Python for each operation: a loop over them would take as long as numpy does for short arrays.
    """
    *signals, work = counts
    places = [[f"x{k}_{i}" for i in range(count)] for k, count in enumerate(signals)]
    places.append([f"work{i}" for i in range(work)])
    known: dict[str, Any] = {}
    lines = [f"def run({', '.join(f'a{k}' for k in range(len(places)))}):"]
    lines += [f"    {', '.join(names)}, = a{k}" for k, names in enumerate(places) if names]
    for step in tape:
        arguments = []
        for value in step.operands:
            if isinstance(value, _Value):
                arguments.append(value.place)
            else:  # numpy takes longer to read a float than an array
                arguments.append(f"constant{len(known)}")
                known[arguments[-1]] = np.array(float(value))
        name = step.operation.__name__
        known[name] = step.operation
        lines.append(f"    {name}({', '.join([*arguments, step.place])})")
    exec(compile("\n".join(lines), "<operations of a generated function>", "exec"), known)
    run: Callable[..., None] = known["run"]
    return run


def work_arrays(count: int, length: int) -> Array:
    """Return uninitialized arrays, (count, `length` or more), each of which begins with a line of the cache."""
    whole = -(-length // _LINE) * _LINE
    memory = np.empty(count * whole + _LINE)
    skipped = -memory.ctypes.data % (_LINE * memory.itemsize) // memory.itemsize
    return memory[skipped : skipped + count * whole].reshape(count, whole)
