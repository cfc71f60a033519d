"""Runs a generated numpy function on arrays with the elements first, without a new array for each result.

The function runs once on recorders, which note its operations. Afterwards the same operations run in the same order,
each into one of few work arrays, which stay in the nearest caches. The bits are those of the function.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from strapgen.run.evaluators import Array

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
        tape: list[_Value] = []
        values = [[_Value(tape) for _ in range(math.prod(shape))] for shape in inputs]
        try:
            results = function(*(np.array(x, object).reshape(s) for x, s in zip(values, inputs, strict=True)))
        except TypeError:
            return
        outputs = [_output(x, tape) for x in results.flat]
        self.temporaries = _allocate([*values, outputs], tape)
        self._operations = _compiled(tape, [*map(len, values), len(outputs), self.temporaries])

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


def _compiled(tape: list[_Value], counts: list[int]) -> Callable[..., None]:
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
