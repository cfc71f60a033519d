"""Compiles a user's function in C or C++, runs it in another process, and reads its states as attitudes.

What the function does wrong stays in the process that runs it: a crash or an endless loop ends that one. A run consists
of segments. A segment begins with a reset and with calls without rotation, so that increments of the segment before are
forgotten. Its attitudes are relative to the one before its first call: functions that hold the attitude themselves need
no more than those that take it as an argument.
"""

from __future__ import annotations

import math
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from itertools import accumulate, dropwhile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from strapgen.firmware.check_code.bridge import ForeignSource, bridge_text, is_cpp
from strapgen.firmware.check_code.foreign_arguments import (
    FORCES,
    FRAME_RATE,
    GRAVITY,
    INTERVALS,
    PUSHES,
    RATES,
    STEP,
    VELOCITY,
    is_whole,
)
from strapgen.firmware.check_code.reading import in_words
from strapgen.ir import checks
from strapgen.ir.exceptions import CompilerError, InputError
from strapgen.ir.renamed import warn
from strapgen.ir.timing import timed
from strapgen.ir.units import STANDARD_GRAVITY
from strapgen.lab.recordings.rest import EARTH_RATE_RAD_S
from strapgen.lab.runs import drift_between
from strapgen.run import compiler
from strapgen.run.backends import evaluator
from strapgen.run.increments import windows
from strapgen.storage import cache, drafts

if TYPE_CHECKING:
    from strapgen.firmware.check_code.interpreted import InterpretedSource

Array = NDArray[np.float64]
SCALARS = ("last", "first")
SENSES = ("body-to-reference", "reference-to-body")
#: Rates are means over the sampling interval, or those at the time of the sample, which is the interval's end.
ENDS = "instants"
#: The name of these before.
_OLD_ENDS = "rates-at-ends"
RATE_INPUTS = (RATES, ENDS)
INPUTS = ("increments", *RATE_INPUTS)
#: Time between samples in s, unless another one is stated.
INTERVAL = Fraction(1, 100)
#: Samples that a function may remember; calls without rotation push so many out of its memory.
REMEMBERED = 8
#: What a function is handed unless something else is stated: gravity in m/s^2 with z up, and the rate of north, east
#: and down in rad/s at 45 degrees of latitude.
STANDARD_GRAVITY_DOWN = (0.0, 0.0, -STANDARD_GRAVITY)
EARTH_RATE_AT_45_DEG = (EARTH_RATE_RAD_S * math.sqrt(0.5), 0.0, -EARTH_RATE_RAD_S * math.sqrt(0.5))
_NOTHING = (0.0, 0.0, 0.0)
#: Longest time in s that a run may take.
PATIENCE = 20
#: Largest rate in rad/s that is fed while the interval is short: a gyro measures it (2000 deg/s are 34.9 rad/s).
_MOST_RATE = 30
_PRECISION_IN_WORDS = {"float": "single precision", "double": "double precision"}
#: Elements of an attitude that are larger are none; their products stay finite.
_LARGEST = 1e30
#: Smallest ratio of the least to the largest stretch of a state that has a direction.
_FLAT = 1e-3
#: Without contraction to fused multiply-add every machine computes the same bits.
_FLAGS = ("-O1", "-ffp-contract=off", "-g0", "-fPIC", "-fvisibility=hidden")
#: Largest part of an interval by which one in whole numbers may be another.
_WHOLE_WITHIN = 1e-3
#: Calls in which a function that has a result after several calls has two at least.
_MOST_CALLS = 130
_NOT_FINITE = "it leaves no finite numbers in its result, or does not write all of it"
_MODULE = "strapgen_foreign"
_DECLARATION = (
    "int strapgen_foreign_run(long calls, const double *identity, const double *input, double *output);"
)


@dataclass(frozen=True)
class Convention:
    """How the elements of a user's attitude are read."""

    #: Where the scalar part of four elements stands, "last" or "first"
    scalar: str = "last"
    #: "body-to-reference" or "reference-to-body"
    sense: str = "body-to-reference"

    def __post_init__(self) -> None:
        checks.choice("scalar", self.scalar, SCALARS)
        checks.choice("sense", self.sense, SENSES)

    def identity(self, elements: int) -> Array:
        """Return the elements of no rotation."""
        if elements != 4:
            return np.eye(3).ravel() if elements == 9 else np.zeros(elements)
        identity: Array = np.eye(4)[3 if self.scalar == "last" else 0]
        return identity

    def matrices(self, states: Array) -> Array:
        """Return direction cosine matrices, body to reference, of states (N, elements).

        A state of another length than 1 is read as the rotation nearest to it. Rotation vectors, which have three
        elements, turn the attitude one after the other. Without elements there is no rotation.
        """
        if states.shape[-1] == 0:
            return np.broadcast_to(np.eye(3), (len(states), 3, 3))
        if states.shape[-1] == 9:
            matrices = _nearest(states.reshape(-1, 3, 3))
        elif states.shape[-1] == 3:
            matrices = np.array(list(accumulate(rotations(states), np.matmul)))
        else:
            matrices = evaluator("dcm-from-euler")(self.ours(states / _or_one(lengths(states))[:, None]))
        return matrices if self.sense == SENSES[0] else np.swapaxes(matrices, -1, -2)

    def ours(self, states: Array) -> Array:
        """Return states of four elements with the scalar part last."""
        return states if self.scalar == "last" else np.roll(states, -1, axis=-1)


@dataclass(frozen=True)
class Segment:
    """Increments of one run."""

    #: (N, K, 3): of N calls, in rad. A function that takes rates gets them divided by the time between samples
    increments: Array
    #: Whether calls without rotation come first, which empty a memory of samples
    settled: bool = True
    #: (N, K, 3): velocity increments of the same samples in m/s; None for none
    velocities: Array | None = None
    #: (N,): sampling interval in s that each call is told; None for that of the function
    intervals: Array | None = None
    #: Whether the run begins in memory that has what is left of the one before
    used: bool = False


@dataclass(frozen=True)
class SegmentRun:
    """The states of a function along a segment."""

    #: (N, elements): the results of its calls
    states: Array
    #: (N, 3, 3): the same as direction cosine matrices, body to reference
    matrices: Array
    #: (1 + N, 3, 3): the attitudes relative to the one before the first call
    relative: Array
    #: By their meanings the results beside the attitude, (1 + N, 3) each: before the first call, and after every call
    translations: Mapping[str, Array] = field(default_factory=dict)

    @property
    def start(self) -> Array:
        """The attitude before the first call."""
        start: Array = self.matrices[0] @ self.relative[1].T
        return start

    def in_resting_frame(self, frame: Array) -> SegmentRun:
        """Return the run as it would be in reference axes that stand still.

        `frame` (3,): rotation vector in rad by which a call turns the attitude without rotation of the body,
        reference axes.
        """
        counts = np.arange(len(self.relative))[:, None]
        return replace(self, relative=self.start.T @ rotations(-counts * frame) @ self.start @ self.relative)


@dataclass(frozen=True)
class ForeignRun:
    """The outcome of a run."""

    #: (N, elements): the result of every call, in the order of the function's elements; no rows if the run
    #: stopped
    outputs: NDArray[np.float64]
    #: The reason why the run came to no end; "" if it did
    stopped: str = ""
    #: Whether the function wrote beside its arrays, or into arguments that are no result
    writes_beyond: bool = False
    changes_inputs: bool = False
    #: Number of calls from a result to the next, as the function says; 0 if it says none
    period: int = 1
    #: The same read as attitudes, for each segment; empty if the run stopped
    segments: tuple[SegmentRun, ...] = ()


@dataclass(frozen=True)
class ForeignStep:
    """A user's function that is compiled, and how it is fed."""

    source: ForeignSource | InterpretedSource
    convention: Convention = Convention()
    #: "increments" in rad, or "rates" in rad/s, which are the means over the time between samples, or "instants", which
    #: are those at the time of each sample
    takes: str = "increments"
    #: Time between samples in s
    interval: Fraction = INTERVAL
    #: Gravity in m/s^2 and rate of the reference axes in rad/s, reference axes: what the function has in it, or is
    #: handed; None where nothing is stated
    gravity: tuple[float, ...] | None = None
    frame_rate: tuple[float, ...] | None = None
    #: The function's unit of angles in rad, and the fraction bits of the integers of its attitude
    angle_unit: float = 1.0
    state_bits: int = 0
    #: Calls the function once for each row, see `run_calls`
    calls: Callable[[Any, Any], ForeignRun] = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        if self.takes == _OLD_ENDS:
            warn(f"--input {_OLD_ENDS}", f"--input {ENDS}")
            object.__setattr__(self, "takes", ENDS)
        checks.choice("input", self.takes, INPUTS)
        if self.source.arguments.named(RATES) and self.takes == "increments":
            raise InputError(
                f"--input {self.takes} contradicts the argument rates; --input {RATES} or {ENDS} fits it"
            )
        arguments, source = self.source.arguments, self.source
        if self.takes == ENDS and arguments.translations:
            raise InputError(f"--input {ENDS} goes without a velocity behind the arrow of --arguments")
        if self.gravity is not None and VELOCITY not in arguments.meanings:
            raise InputError("--gravity-m-s2 goes with a velocity behind the arrow of --arguments")
        if self.frame_rate is not None and arguments.elements <= 3:
            raise InputError("--frame-rate-rad-s goes with an attitude behind the arrow of --arguments")
        if isinstance(source, ForeignSource):
            self._require_scales(source)
            self._require_whole_intervals(source)
            source = self._with_period(source)
            object.__setattr__(self, "source", source)
            calls: Callable[[Any, Any], ForeignRun] = partial(run_foreign, compile_foreign(source))
        else:
            calls = source.run
        object.__setattr__(self, "calls", calls)

    def _with_period(self, source: ForeignSource) -> ForeignSource:
        """Return the same with the number of calls to a result, if the function says when it has one."""
        if source.publishes:
            return source
        arguments = source.arguments
        rows = self._rows(Segment(np.zeros((_MOST_CALLS, arguments.count, 3)), settled=False))
        period = run_foreign(compile_foreign(source), np.zeros(arguments.numbers), rows).period
        if source.counter and not period:
            raise InputError(f"--publishes: the number that it names does not change in {_MOST_CALLS} calls")
        if period > 1 and len(arguments.fed) > 1:
            raise InputError(f"--publishes {period} does not go with {arguments.fed[-1].name}")
        return replace(source, publishes=max(period, 1))

    def _require_scales(self, source: ForeignSource) -> None:
        """Refuse integers whose scale is not known."""
        if source.is_integer and self.angle_unit == 1:
            raise InputError(
                f"{source.function} computes in {source.precision}; --angle-unit is needed, the angle of a count in "
                "rad, as 2**-20"
            )
        if is_whole(source.arguments.results[0]) and source.arguments.elements > 3 and not self.state_bits:
            raise InputError(
                f"{source.function} computes an attitude in integers; --state-bits is needed, the bits behind the "
                "point, as 30 where 2**30 stands for 1"
            )

    def _require_whole_intervals(self, source: ForeignSource) -> None:
        """Refuse an integer that does not hold the sampling interval in its unit."""
        for argument in source.arguments.parameters:
            if argument.name not in (*INTERVALS, STEP) or argument.type or not is_whole(argument):
                continue
            count = source.arguments.count if argument.name == STEP else 1
            units = float(self.interval) * count / INTERVALS.get(argument.name, 1.0)
            if abs(round(units) - units) > _WHOLE_WITHIN * units:
                unit = argument.name.partition("_")[2] or "s"
                ways = (
                    "--arguments with dt_ms or dt_us says what it counts"
                    if unit == "s"
                    else "--sample-hz states another interval"
                )
                raise InputError(
                    f"`{argument.carriers[0].text}` is a whole number, and the interval is {units:.6g} {unit}; {ways}"
                )

    @property
    def reading(self) -> str:
        """How the function is called, in one line."""
        unit = {1.0: "rad", math.radians(1): "deg"}.get(self.angle_unit, f"{self.angle_unit:.6g} rad")
        every = f", a result every {self.source.publishes} calls" if self.source.publishes > 1 else ""
        return f"reads: {in_words(self.source.function, self.source.arguments, self.takes, unit)}{every}"

    @property
    def samples(self) -> int:
        """Number of samples in a call, or of all calls to a result."""
        return self.source.arguments.count * max(self.source.publishes, 1)

    @property
    def unit(self) -> float:
        """The step from 1 to the next number of the function's precision."""
        if self.source.is_integer:
            return max(self.angle_unit, 2.0**-self.state_bits if self.state_bits else 0.0)
        return float(np.finfo(np.float32 if self.source.precision == "float" else np.float64).eps)

    @property
    def rounding(self) -> str:
        """What rounds, in words."""
        whole = self.source.is_integer
        return f"rounding to {self.source.precision}" if whole else _PRECISION_IN_WORDS[self.source.precision]

    @property
    def most(self) -> float:
        """The largest angle of a sample in rad that a gyro measures."""
        return float(_MOST_RATE * self.interval)

    @property
    def acceleration(self) -> Array:
        """Gravity in m/s^2 that the function is to add, (3,), reference axes."""
        handed = STANDARD_GRAVITY_DOWN if self.source.arguments.named(GRAVITY) else _NOTHING
        return np.array(handed if self.gravity is None else self.gravity, float)

    @property
    def frame(self) -> Array:
        """Rate in rad/s of the reference axes that the function is to follow, (3,), in these axes."""
        handed = EARTH_RATE_AT_45_DEG if self.source.arguments.named(FRAME_RATE) else _NOTHING
        return np.array(handed if self.frame_rate is None else self.frame_rate, float)

    def calls_for(self, angle: float, fewest: int) -> int:
        """Return the number of calls that a rotation by an angle in rad takes, at rates that a gyro measures."""
        return max(fewest, math.ceil(angle / (self.samples * self.most)))

    @property
    def settling(self) -> int:
        """Number of calls that push all samples out of a memory."""
        return -(-REMEMBERED // self.samples)

    def outputs(self, segments: Sequence[Segment], convention: Convention) -> tuple[ForeignRun, list[Array]]:
        """Run segments one after the other in one process, and return the results of the calls of each as they are."""
        rows = [self._rows(segment) for segment in segments]
        arguments = self.source.arguments
        scale = self.angle_unit if arguments.elements == 3 else 2.0**-self.state_bits
        scales = np.where(np.arange(arguments.numbers) < arguments.elements, scale, 1.0)
        done = self.calls(self._identity(convention) / scales, np.concatenate(rows))
        done = replace(done, outputs=done.outputs * scales)
        ends = np.cumsum([len(part) for part in rows])[:-1]
        return done, [] if done.stopped else np.split(done.outputs, ends)

    def _identity(self, convention: Convention) -> Array:
        """Return the results before any call: no rotation, and no velocity."""
        arguments = self.source.arguments
        identity = convention.identity(arguments.elements)
        return np.concatenate([identity, np.zeros(arguments.numbers - len(identity))])

    def run(self, segments: Sequence[Segment], convention: Convention | None = None) -> ForeignRun:
        """Run segments one after the other in one process."""
        read = convention or self.convention
        arguments = self.source.arguments
        elements = arguments.elements
        identity = self._identity(read)
        done, parts = self.outputs(segments, read)
        if not done.stopped and not np.abs(done.outputs).max() < _LARGEST:  # not finite: no number compares
            done = replace(done, stopped=_NOT_FINITE)
        if done.stopped:
            return done
        runs = []
        for segment, outputs in zip(segments, parts, strict=True):
            first = self.settling if segment.settled else 0
            before = outputs[first - 1] if first else identity
            whole = np.vstack([before, outputs[first:]])
            states = whole[:, :elements]
            matrices = read.matrices(states)
            ends = range(elements + 3, arguments.numbers + 1, 3)
            translations = {
                name: whole[:, end - 3 : end] for name, end in zip(arguments.meanings, ends, strict=True)
            }
            runs.append(SegmentRun(states[1:], matrices[1:], matrices[0].T @ matrices, translations))
        return replace(done, segments=tuple(runs))

    def _rows(self, segment: Segment) -> Array:
        """Return the rows of the calls of a segment, see `run_foreign`."""
        count, previous = self.samples, self.source.arguments.previous
        quiet = np.zeros((self.settling if segment.settled else 0, count, 3))
        samples = np.concatenate([quiet, segment.increments]).reshape(-1, 3)
        numbers = windows(np.concatenate([np.zeros((previous, 3)), samples]), count, previous)
        numbers = numbers / self.angle_unit
        if self.takes != "increments":
            numbers = numbers / float(self.interval)
        if is_whole(self.source.arguments.samples):
            numbers = np.diff(np.round(np.cumsum(numbers.reshape(-1, 3), axis=0)), axis=0, prepend=0.0)
        numbers = numbers.reshape(len(segment.increments) + len(quiet), -1)
        calls = len(numbers)
        beside = [
            np.broadcast_to(each, (calls, each.shape[-1])) for each in self._beside(segment, len(quiet))
        ]
        begins, intervals = np.zeros(calls), np.full(calls, float(self.interval))
        begins[0] = 2 if segment.used else 1
        if segment.intervals is not None:
            intervals[len(quiet) :] = segment.intervals
        return np.column_stack([begins, intervals, intervals * self.source.arguments.count, numbers, *beside])

    def _beside(self, segment: Segment, quiet: int) -> Iterator[Array]:
        """Yield what calls get beside the samples of the gyro, a row for each of them or one for all."""
        arguments = self.source.arguments
        if pushes := arguments.named(*PUSHES):
            size = 1.0 if pushes.name != FORCES else float(self.interval)
            rows = np.zeros((quiet + len(segment.increments), pushes.size))
            if segment.velocities is not None:
                rows[quiet:] = segment.velocities.reshape(len(segment.velocities), -1) / size
            yield rows
        for name, vector in ((GRAVITY, self.acceleration), (FRAME_RATE, self.frame)):
            if arguments.named(name):
                yield vector


def compile_foreign(source: ForeignSource) -> Path:
    """Compile a user's function."""
    bridge, of = bridge_text(source), compiler.COMPILERS["C++"] if source.read.is_cpp else compiler.C
    with drafts.temporary_folder() as folder:
        text = folder / f"bridge{of.ending}"
        text.write_text(bridge, encoding="utf-8", newline="\n")
        preprocessed = [
            _preprocess(source, each).replace(str(text), "bridge") for each in (text, *source.sources)
        ]
    identities = compiler.C.identity(_FLAGS), of.identity()
    key = cache.digest([*preprocessed, bridge, repr((source.read.options, source.libraries)), *identities])

    def fill(draft: Path) -> None:
        with timed("compile", source.function):
            files, flags = {f"bridge{of.ending}": bridge}, [*_options(source), *source.read.options, *_FLAGS]
            for each in source.sources:
                flags += ["-x", "c++" if is_cpp(each) else "c", str(each.resolve()), "-x", "none"]
            if source.read.is_cpp:
                flags.append("-fno-access-control")
            flags += source.libraries
            declared = (_DECLARATION, _DECLARATION)
            if reasons := compiler.compile_module(draft, _MODULE, files, *declared, flags, of):
                raise CompilerError(_diagnostics(source, reasons))

    folder_of_build = cache.entry("builds", key, fill, f"compiled {source.function}")
    return next(path for path in folder_of_build.iterdir() if path.name.startswith(f"{_MODULE}."))


def run_foreign(module: Path, identity: Any, rows: Any) -> ForeignRun:
    """Call a compiled function once for each row, see `run_calls`."""
    runner = str(Path(__file__).with_name("foreign_runner.py"))
    with cache.loadable(module) as (path, descriptor):
        handed = [] if path == str(module) else [descriptor]
        return run_calls([sys.executable, "-P", runner, path], identity, rows, handed)


def run_calls(
    command: Sequence[str],
    identity: Any,
    rows: Any,
    descriptors: Sequence[int] = (),
    patience: float | None = None,
    **files: str,
) -> ForeignRun:
    """Have a command, in a process of its own, call a function once for each row.

    `command` gets two more words, a folder and the number of rows. The folder holds the doubles of `identity` and
    `input`, and further `files`; the command writes `output`, and `flags` last. What it refuses it says in `refused`,
    and why the function ended early in `stopped`.

    `identity` (elements,): the state that a run begins with. `rows` (N, 3 + numbers): for each call whether a run
    begins, 1, or 2 in memory as it is, the sampling interval in s, the duration of the call in s, and the numbers of
    its arguments, the previous samples before those of the call.
    """
    values = np.ascontiguousarray(rows, np.float64)
    start = np.ascontiguousarray(identity, np.float64)
    nothing, seconds = np.empty((0, start.size)), PATIENCE if patience is None else patience
    with drafts.temporary_folder() as folder:
        (folder / "input").write_bytes(values.tobytes())
        (folder / "identity").write_bytes(start.tobytes())
        for name, text in files.items():
            (folder / name).write_text(text, encoding="utf-8", newline="\n")
        try:
            done = subprocess.run(
                [*command, str(folder), str(len(values))],
                cwd=folder,
                pass_fds=descriptors,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                timeout=seconds,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return ForeignRun(nothing, f"{len(values)} calls have not come to an end in {seconds} s")
        said = {name: _line(folder / name) for name in ("refused", "stopped", "flags")}
        if said["refused"]:
            raise CompilerError(said["refused"])
        if done.returncode or not said["flags"]:
            return ForeignRun(nothing, said["stopped"] or _reason(done.returncode))
        bits = int(said["flags"])
        outputs = np.frombuffer((folder / "output").read_bytes()).reshape(len(values), start.size)
    stopped = "it has its result after another number of calls than before" if bits & 4 else ""
    return ForeignRun(outputs, stopped, bool(bits & 1), bool(bits & 2), bits >> 8)


def _line(file: Path) -> str:
    """Return the text of a file as one line; "" if there is none."""
    return " ".join(file.read_text(encoding="utf-8", errors="replace").split()) if file.is_file() else ""


def _reason(status: int) -> str:
    """Return in words how the process has ended that ran the function."""
    if status >= 0:
        return f"it ends the program, with exit status {status}"
    try:
        return f"it ends with {signal.Signals(-status).name}"
    except ValueError:
        return f"it ends with signal {-status}"


def _preprocess(source: ForeignSource, text: Path) -> str:
    """Return all that the compiler reads, headers included."""
    language = "c++" if is_cpp(text) else "c"
    command = [*compiler.C.command(), *source.read.options, "-E", "-x", language, str(text)]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    if done.returncode:
        raise CompilerError(_diagnostics(source, done.stderr.splitlines()))
    return done.stdout


def _options(source: ForeignSource) -> list[str]:
    """Return the options of $CC for a file in C++, which another command may compile."""
    words = compiler.C.command() if source.read.is_cpp else []
    return list(dropwhile(lambda word: not word.startswith("-"), words))


def _diagnostics(source: ForeignSource, lines: list[str]) -> str:
    """Return the first error of the compiler, with the path of the file as the user wrote it."""
    errors = [line.strip() for line in lines if re.search(r"\berror\b:", line)] or lines[:1] or ["no reason"]
    error = errors[0].replace(str(source.file.resolve()), str(source.file))
    reason = re.sub(r"^--\w+:[\d:]* *", "", error)
    if error.startswith("--init:"):
        return f"{source.init} of --init cannot be called: {reason}; --show-shim shows the call"
    if error.startswith("--arguments:"):
        return f"{source.function} cannot be called so: {reason}; --show-shim shows the call"
    return f"{source.file} does not compile: {error}"


def rotations(vectors: Array) -> Array:
    """Return the rotations (..., 3, 3) by rotation vectors (..., 3) in rad."""
    turned: Array = evaluator("dcm-update")(np.broadcast_to(np.eye(3), (*vectors.shape[:-1], 3, 3)), vectors)
    return turned


def rotation_vectors(matrices: Array) -> Array:
    """Return the rotation vectors of rotations.

    `matrices` has shape (..., 3, 3). Returns (..., 3): in rad.

    >>> rotation_vectors(rotations(np.array([0.0, 0.0, 2.0]))).round(12) + 0.0
    array([0., 0., 2.])
    """
    sines = drift_between(np.broadcast_to(np.eye(3), matrices.shape), matrices)
    size = np.linalg.norm(sines, axis=-1, keepdims=True)
    cosine = (np.trace(matrices, axis1=-2, axis2=-1)[..., None] - 1) / 2
    vectors: Array = sines * np.where(size > 0, np.arctan2(size, cosine) / _or_one(size), 1.0)
    return vectors


def lengths(states: Array) -> Array:
    """Return the lengths of states (N, elements), 1 for a rotation: of Euler parameters, or of the mean row.

    `states` (N, 4): rotation vectors, which have three elements, are of no length. Returns (N,).
    """
    if states.shape[-1] == 3:
        return np.ones(len(states))
    rows = 3 if states.shape[-1] == 9 else 1
    size: Array = np.linalg.norm(states, axis=-1) / np.sqrt(rows)
    return size


def departure(states: Array) -> float:
    """Return the largest departure of C C' from the unit matrix, of the matrices C of states (N, elements).

    `states` has shape (N, 4).
    """
    if states.shape[-1] != 9:
        return float(np.abs(lengths(states) ** 4 - 1).max())
    matrices = states.reshape(-1, 3, 3)
    return float(np.abs(matrices @ np.swapaxes(matrices, -1, -2) - np.eye(3)).max())


def _or_one(size: Array) -> Array:
    return np.where(size > 0, size, 1.0)


def _nearest(matrices: Array) -> Array:
    """Return the orthogonal matrices nearest to matrices (N, 3, 3); one without a direction stays as it is."""
    left, stretch, right = np.linalg.svd(matrices)
    turns: Array = left @ right
    return np.where((stretch[:, 2] > _FLAT * stretch[:, 0])[:, None, None], turns, matrices)
