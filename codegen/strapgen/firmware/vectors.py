"""Chooses test vectors of generated C, and computes the expected results without the C.

In fixed point the model in Python integers says it; in floating point the program is run operation by operation.
"""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from strapgen import pipeline
from strapgen.catalogue import Choice
from strapgen.firmware.vectors_c import CallVector, VectorTable
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.program import OPERATIONS, RESOLUTION, Operation, Program, walk
from strapgen.ir.signals import Signal
from strapgen.ir.sources import Sources
from strapgen.results.result import Result
from strapgen.run.compiled_code import ModelEvaluator
from strapgen.run.evaluators import Array, Evaluator
from strapgen.run.exact import ExactEvaluator
from strapgen.run.kernel_sources import program_of, sources_of_program
from strapgen.targets import BUILT_IN
from strapgen.targets.c import CPrinter, real_of
from strapgen.targets.contract import options
from strapgen.targets.naming import UNNAMED, Naming

#: The target of the integer model.
MODEL = "fixed-model"
#: How many vectors a table has by default, and the seed of its random ones.
COUNT, SEED = 200, 1
#: Largest magnitude of the random elements of an input in floating point that has no bound.
_UNBOUNDED = 1.0
#: Room for a library that rounds its functions in another way: parts of the distance from 40 digits.
_LIBRARY_ROOM = 4
#: Most vectors of a table, which a compiler of a small processor still takes.
_MOST = 10_000
#: The operations that a library computes, in whose last places libraries differ.
LIBRARY_OPERATIONS = frozenset({"sin", "cos", "sinc", "atan2", "direction", "wrap"})


@dataclass(frozen=True)
class VectorsResult(Result):
    """Test vectors that were written."""

    function: str
    files: Sequence[Path]
    #: Number of vectors
    vectors: int
    #: Those that a call must refuse
    refused: int

    def text(self) -> str:
        """Return the numbers of vectors, and the files."""
        head = f"{self.function}: {self.vectors} vectors, {self.refused} of them refused"
        return "\n".join([head, *(f"  {path}" for path in self.files)])


@dataclass(frozen=True)
class _Box:
    """The numbers that an input may have: limits of an element, the unit of a number, and the value without motion.

    `word` is the length of an integer in bits, 0 for a floating-point number.
    """

    signal: Signal
    low: Any
    high: Any
    unit: float
    rest: tuple[Any, ...]
    word: int = 0

    def proper(self, values: Sequence[float]) -> tuple[Any, ...]:
        """Return values in SI units as numbers of the input inside its limits."""
        scaled = [value / self.unit for value in values]
        if isinstance(self.low, int):
            scaled = [round(value) for value in scaled]
        return tuple(min(max(value, self.low), self.high) for value in scaled)


def vectors_of_choice(
    choice: Choice,
    target: str,
    settings: Settings | None = None,
    count: int = COUNT,
    seed: int = SEED,
    naming: Naming = UNNAMED,
) -> VectorTable:
    """Return test vectors of a chosen kernel for a target in C; other parameters are those of `call_vectors`.

    >>> from strapgen.catalogue import choose
    >>> table = vectors_of_choice(choose("euler-product"), "c-fixed", count=1)
    >>> table.rows[0].status, table.rows[0].outputs
    (0, ((0, 0, 0, 1073741824),))
    """
    checks.choice("target", target, [name for name, entry in BUILT_IN.items() if entry.compiled])
    sources = pipeline.compile(choice, target, settings, naming)
    program = pipeline.program(choice)
    command = f"strapgen vectors {sources.info.arguments} --target {target}"
    if sources.fixed is not None:
        command += f" {options(sources.fixed.settings, program.inputs)}"
        reference = pipeline.compile(choice, MODEL, settings)
    else:
        reference = sources_of_program(pipeline.declared(program, target, settings), "exact")
    return call_vectors(sources, reference, f"{command} --count {count} --seed {seed}", count, seed)


def call_vectors(
    sources: Sources, reference: Sources, command: str, count: int = COUNT, seed: int = SEED
) -> VectorTable:
    """Return test vectors of a function."""
    count = checks.count("count", count, largest=_MOST)
    seed = checks.count("seed", seed, smallest=0)
    stream = random.Random(seed)  # its `random` is the same in every release of Python
    if sources.fixed is not None:
        rows, tolerances = _fixed_rows(sources, ModelEvaluator(reference), count, stream)
    else:
        rows, tolerances = _floating_rows(sources, reference, count, stream)
    return VectorTable(sources, command, rows, tolerances)


def _fixed_rows(
    sources: Sources, model: ModelEvaluator, count: int, stream: random.Random
) -> tuple[tuple[CallVector, ...], tuple[float, ...]]:
    """Return vectors of a function on integers, refused ones among them."""
    assert sources.fixed is not None
    boxes = []
    for argument in sources.fixed.inputs:
        scaled = [round(value / float(argument.unit)) for value in _rest(sources, argument.signal)]
        rest = tuple(min(max(value, argument.low), argument.high) for value in scaled)
        unit = float(argument.unit)
        box = _Box(argument.signal, argument.low, argument.high, unit, rest, argument.format.word)
        boxes.append(box)
    words = [feedback.fresh for feedback in sources.fixed.residuals]
    top = (1 << sources.fixed.settings.word) - 1
    ends = [tuple(words), tuple(0 for _ in words), tuple(top for _ in words)]
    before = itertools.chain(
        itertools.islice(itertools.cycle(ends), 3 * len(words)),
        (tuple(_whole(stream, 0, top) for _ in words) for _ in itertools.count()),
    )
    inputs = itertools.chain(_corners(boxes), _outside(boxes), _random(boxes, stream))
    rows = [
        model_call(model, row, feedback)
        for row, feedback in itertools.islice(zip(inputs, before, strict=False), count)
    ]
    return tuple(rows), tuple(0.0 for _ in sources.fixed.outputs)


def model_call(
    model: ModelEvaluator, inputs: tuple[tuple[int, ...], ...], feedback: tuple[int, ...]
) -> CallVector:
    """Return a call of the integer model as a vector; a refused call leaves outputs and error feedback alone."""
    arguments = [*map(list, inputs), *([list(feedback)] if feedback else [])]
    try:
        results = [tuple(map(int, result)) for result in model.generated(*arguments)]
    except model.out_of_range:
        outside = any(
            not argument.low <= value <= argument.high
            for argument, values in zip(model.interface.inputs, inputs, strict=True)
            for value in values
        )
        zeros = tuple((0,) * argument.signal.size for argument in model.interface.outputs)
        return CallVector(inputs, feedback, 1 if outside else 2, zeros, feedback)
    after = results.pop() if feedback else ()
    return CallVector(inputs, feedback, 0, tuple(results), after)


def _floating_rows(
    sources: Sources, reference: Sources, count: int, stream: random.Random
) -> tuple[tuple[CallVector, ...], tuple[float, ...]]:
    """Return vectors of a function on floating-point numbers; those without a finite result are left out."""
    evaluator, exact = ProgramEvaluator(reference, sources.target), ExactEvaluator(reference)
    # The ranges for which the header bounds the rounding, where it does.
    bounded = sources.rounding.inputs if sources.rounding is not None else ()
    stated = {condition.value: float(condition.high) for condition in bounded}
    boxes = []
    for signal in sources.function.inputs:
        limit = stated.get(signal.name, _UNBOUNDED if signal.bound is None else float(signal.bound))
        boxes.append(_Box(signal, -limit, limit, 1.0, tuple(_rest(sources, signal))))
    candidates = itertools.chain(_corners(boxes), _random(boxes, stream))
    rows: list[CallVector] = []
    tries = 4 * count + 100
    for inputs in itertools.islice(candidates, tries):
        rounded = [
            np.array(values, evaluator.dtype).reshape(signal.shape)
            for values, signal in zip(inputs, sources.function.inputs, strict=True)
        ]
        outputs = evaluator.evaluate(rounded, ())
        if all(np.isfinite(output).all() for output in outputs):
            flat = [tuple(array.ravel().tolist()) for array in rounded]
            rows.append(CallVector(tuple(flat), (), 0, tuple(tuple(o.ravel().tolist()) for o in outputs), ()))
        if len(rows) == count:
            break
    else:
        raise InputError(f"kernel {sources.kernel} has finite results for {len(rows)} of {tries} calls")
    operations = {
        node.kind
        for assignment in evaluator.program.body
        for node in walk(assignment.value)
        if isinstance(node, Operation)
    }
    if not operations & LIBRARY_OPERATIONS:
        return tuple(rows), tuple(0.0 for _ in sources.function.outputs)
    return _tolerant(rows, exact, float(np.finfo(evaluator.dtype).eps))


def _tolerant(
    rows: Sequence[CallVector], exact: ExactEvaluator, unit: float
) -> tuple[tuple[CallVector, ...], tuple[float, ...]]:
    """Return the tolerance of each output for other C libraries, from the distance to 40 digits.

    Vectors at which a function jumps, as an angle does from -pi to pi, are left out.
    """
    signals = exact.function.inputs
    columns = [
        np.array([row.inputs[k] for row in rows]).reshape(-1, *signal.shape)
        for k, signal in enumerate(signals)
    ]
    smooth = np.ones(len(rows), bool)
    distances, sizes = [], []
    for k, output in enumerate(exact.evaluate(columns, (len(rows),))):
        results = np.array([row.outputs[k] for row in rows])
        distances.append(np.abs(results - output.reshape(results.shape)).max(axis=1))
        sizes.append(float(np.abs(results).max()))
        smooth &= distances[-1] <= math.sqrt(unit) * max(1.0, sizes[-1])
    tolerances = [
        max(_LIBRARY_ROOM * float(distance[smooth].max()), unit * size)
        for distance, size in zip(distances, sizes, strict=True)
    ]
    return tuple(itertools.compress(rows, smooth)), tuple(tolerances)


def _rest(sources: Sources, signal: Signal) -> list[float]:
    """Return the input without motion: the identity of an attitude, otherwise zeros."""
    if sources.attitude_step is not None and signal == sources.function.inputs[0]:
        return [float(element) for element in sources.attitude_step.identity]
    if signal.constraint == "rotation":
        return [float(place % 4 == 0) for place in range(signal.size)]
    if signal.constraint == "unit":
        return [0.0] * (signal.size - 1) + [1.0]
    return [0.0] * signal.size


def _corners(boxes: Sequence[_Box]) -> Iterator[tuple[tuple[Any, ...], ...]]:
    """Yield no motion, zeros, all inputs at their limits, then each element at its lowest and at its highest."""
    rest = tuple(box.rest for box in boxes)
    yield rest
    yield tuple((0 * box.low,) * box.signal.size for box in boxes)
    yield tuple((box.low,) * box.signal.size for box in boxes)
    yield tuple((box.high,) * box.signal.size for box in boxes)
    for first in (0, 1):
        yield tuple(
            tuple((box.low, box.high)[(first + k) % 2] for k in range(box.signal.size)) for box in boxes
        )
    for box in boxes:
        yield _with(boxes, box, (box.low,) * box.signal.size)
        yield _with(boxes, box, (box.high,) * box.signal.size)
    for box in boxes:
        for place in range(box.signal.size):
            for limit in (box.low, box.high):
                yield _with(boxes, box, _replace(box.rest, place, limit))


def _outside(boxes: Sequence[_Box]) -> Iterator[tuple[tuple[int, ...], ...]]:
    """Yield calls that are refused: each element just outside its range, and at the ends of the word."""
    for box in boxes:
        lowest, highest = -(1 << (box.word - 1)), (1 << (box.word - 1)) - 1
        for place in range(box.signal.size):
            limits = (box.low - 1, box.high + 1) if place else (box.low - 1, box.high + 1, lowest, highest)
            for value in limits:
                if lowest <= value <= highest and not box.low <= value <= box.high:
                    yield _with(boxes, box, _replace(box.rest, place, value))


def _random(boxes: Sequence[_Box], stream: random.Random) -> Iterator[tuple[tuple[Any, ...], ...]]:
    """Yield random calls: in turn proper attitudes, and numbers anywhere in their ranges; increments always so."""
    for number in itertools.count():
        yield tuple(
            box.proper(_attitude(box.signal, stream))
            if box.signal.constraint and number % 2 == 0
            else tuple(_anywhere(box, stream) for _ in range(box.signal.size))
            for box in boxes
        )


def _anywhere(box: _Box, stream: random.Random) -> Any:
    if isinstance(box.low, int):
        return _whole(stream, box.low, box.high)
    return box.low + stream.random() * (box.high - box.low)


def _whole(stream: random.Random, low: int, high: int) -> int:
    """Return a random integer of a range, both ends among them; two draws reach every bit of a long word."""
    drawn = (int(stream.random() * 2**53) << 53) | int(stream.random() * 2**53)
    return low + drawn % (high - low + 1)


def _attitude(signal: Signal, stream: random.Random) -> list[float]:
    """Return a random vector of length 1, or a random rotation by rows."""
    count = 4 if signal.constraint == "rotation" else signal.size
    vector = [stream.random() - 0.5 for _ in range(count)]
    length = math.sqrt(sum(x * x for x in vector)) or 1.0
    unit = [x / length for x in vector]
    if signal.constraint != "rotation":
        return unit
    x, y, z, s = unit
    return [
        *(1 - 2 * (y * y + z * z), 2 * (x * y - z * s), 2 * (x * z + y * s)),
        *(2 * (x * y + z * s), 1 - 2 * (x * x + z * z), 2 * (y * z - x * s)),
        *(2 * (x * z - y * s), 2 * (y * z + x * s), 1 - 2 * (x * x + y * y)),
    ]


def _with(boxes: Sequence[_Box], box: _Box, values: tuple[Any, ...]) -> tuple[tuple[Any, ...], ...]:
    """Return a call without motion but for one input."""
    return tuple(values if other is box else other.rest for other in boxes)


def _replace(values: tuple[Any, ...], place: int, value: Any) -> tuple[Any, ...]:
    return (*values[:place], value, *values[place + 1 :])


def _sinc(x: Array) -> Array:
    safe = np.where(x == 0, np.ones_like(x), x)
    return np.where(x == 0, np.ones_like(x), np.sin(safe) / safe)


def _wrap(x: Array) -> Array:
    turn, half = (np.asarray(x).dtype.type(value) for value in (2 * np.pi, np.pi))
    return np.where(x > half, x - turn, np.where(x < -half, x + turn, x))


_OPERATIONS: Mapping[str, Callable[..., Any]] = {
    **OPERATIONS,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "sinc": _sinc,
    "atan2": np.arctan2,
    "direction": np.arctan2,
    "wrap": _wrap,
    "maximum": np.maximum,
    "select": np.where,
}


class ProgramEvaluator(Evaluator):
    """A program in the numbers of a target in C, "c" or "c-float".

    Examples
    --------
    >>> from strapgen.run.kernel_sources import sources_of_program
    >>> from strapgen.pipeline import derive, lower
    >>> program = lower(derive("euler-normalize"))
    >>> single = ProgramEvaluator(sources_of_program(program, "exact"), "c-float")
    >>> single(np.float32([1, 1, 1, 0]))
    array([0.57735026, 0.57735026, 0.57735026, 0.        ], dtype=float32)
    """

    def __init__(self, sources: Sources, target: str = "c") -> None:
        real = real_of(target)
        super().__init__(sources, np.dtype(real.name if real.name == "double" else "float32"))
        self.program: Program = program_of(sources)
        self._printer = CPrinter(real)
        self._target = target

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the class with the sources and the target."""
        return type(self), (self.sources, self._target)

    def _number(self, value: Any) -> Any:
        """Return the number that the C has for an exact constant."""
        return self.dtype.type(self._printer.constant(value).removesuffix(self._printer.real.suffix))

    def call(self, inputs: Sequence[Any], feedback: Any, where: str = "") -> tuple[Sequence[Any], Any]:
        """Evaluate on the columns of rows, see `Evaluator.call`."""
        values: dict[str, Any] = {RESOLUTION: self._number(self._printer.resolution)}
        for signal, rows in zip(self.function.inputs, inputs, strict=True):
            values |= zip(signal.elements, rows.T, strict=True)
        with np.errstate(all="ignore"):
            results = self.program.run(values, self._number, _OPERATIONS)
        outputs = []
        for signal in self.function.outputs:
            columns = [np.asarray(x, self.dtype) for x in results[signal.name]]
            outputs.append(np.stack([np.broadcast_to(x, len(feedback)) for x in columns], axis=-1))
        return outputs, feedback
