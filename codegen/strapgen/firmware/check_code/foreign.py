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
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import accumulate, dropwhile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.firmware.check_code.foreign_arguments import (
    FORCES,
    FRAME_RATE,
    GRAVITY,
    PUSHES,
    RATES,
    VELOCITY,
    ForeignSource,
    bridge_text,
    definitions,
)
from strapgen.ir import checks
from strapgen.ir.checks import suggestions
from strapgen.ir.exceptions import CompilerError, InputError
from strapgen.ir.timing import timed
from strapgen.ir.units import STANDARD_GRAVITY
from strapgen.lab.recordings.rest import EARTH_RATE_RAD_S
from strapgen.lab.runs import drift_between
from strapgen.run import compiler
from strapgen.run.backends import evaluator
from strapgen.run.increments import windows
from strapgen.storage import cache, drafts

Array = NDArray[np.float64]
SCALARS = ("last", "first")
SENSES = ("body-to-reference", "reference-to-body")
#: Rates are means over the sampling interval, or those at its end.
ENDS = "rates-at-ends"
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
#: Elements of an attitude that are larger are none; their products stay finite.
_LARGEST = 1e30
#: Smallest ratio of the least to the largest stretch of a state that has a direction.
_FLAT = 1e-3
#: Without contraction to fused multiply-add every machine computes the same bits.
_FLAGS = ("-O1", "-ffp-contract=off", "-g0", "-fPIC", "-fvisibility=hidden")
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
            turns = evaluator("dcm-update")(np.broadcast_to(np.eye(3), (len(states), 3, 3)), states)
            matrices = np.array(list(accumulate(turns, np.matmul)))
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
        back = evaluator("dcm-update")(np.broadcast_to(np.eye(3), (len(counts), 3, 3)), -counts * frame)
        return replace(self, relative=self.start.T @ back @ self.start @ self.relative)


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
    #: The same read as attitudes, for each segment; empty if the run stopped
    segments: tuple[SegmentRun, ...] = ()


@dataclass(frozen=True)
class ForeignStep:
    """A user's function that is compiled, and how it is fed."""

    source: ForeignSource
    convention: Convention = Convention()
    #: "increments" in rad, or "rates" in rad/s, which are the means over the time between samples, or "rates-
    #: at-ends", which are those at the end of each
    takes: str = "increments"
    #: Time between samples in s
    interval: Fraction = INTERVAL
    #: Gravity in m/s^2 and rate of the reference axes in rad/s, reference axes: what the function has in it, or is
    #: handed; None where nothing is stated
    gravity: tuple[float, ...] | None = None
    frame_rate: tuple[float, ...] | None = None
    module: Path = field(init=False)

    def __post_init__(self) -> None:
        checks.choice("input", self.takes, INPUTS)
        if self.source.arguments.named(RATES) and self.takes == "increments":
            raise InputError(
                f"--input {self.takes} contradicts the argument rates; --input {RATES} or {ENDS} fits it"
            )
        arguments = self.source.arguments
        if self.takes == ENDS and arguments.translations:
            raise InputError(f"--input {ENDS} goes without a velocity behind the arrow of --arguments")
        if self.gravity is not None and VELOCITY not in arguments.meanings:
            raise InputError("--gravity-m-s2 goes with a velocity behind the arrow of --arguments")
        if self.frame_rate is not None and arguments.elements <= 3:
            raise InputError("--frame-rate-rad-s goes with an attitude behind the arrow of --arguments")
        object.__setattr__(self, "module", compile_foreign(self.source))

    @property
    def samples(self) -> int:
        """Number of samples in a call."""
        return self.source.arguments.count

    @property
    def unit(self) -> float:
        """The step from 1 to the next number of the function's precision."""
        return float(np.finfo(np.float32 if self.source.precision == "float" else np.float64).eps)

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

    def run(self, segments: Sequence[Segment], convention: Convention | None = None) -> ForeignRun:
        """Run segments one after the other in one process."""
        read = convention or self.convention
        arguments = self.source.arguments
        rows = np.concatenate([self._rows(segment) for segment in segments])
        elements = arguments.elements
        identity = np.concatenate([read.identity(elements), np.zeros(arguments.numbers - elements)])
        done = run_foreign(self.module, identity, rows)
        if not done.stopped and not np.abs(done.outputs).max() < _LARGEST:  # not finite: no number compares
            done = replace(
                done, stopped="it leaves no finite numbers in its result, or does not write all of it"
            )
        if done.stopped:
            return done
        runs, place = [], 0
        for segment in segments:
            first = self.settling if segment.settled else 0
            count = len(segment.increments)
            outputs = done.outputs[place : place + first + count]
            before = outputs[first - 1] if first else identity
            place += first + count
            whole = np.vstack([before, outputs[first:]])
            states = whole[:, :elements]
            matrices = read.matrices(states)
            translations = dict(
                zip(
                    arguments.meanings, np.split(whole[:, elements:], len(arguments.meanings), 1), strict=True
                )
                if arguments.meanings
                else ()
            )
            runs.append(SegmentRun(states[1:], matrices[1:], matrices[0].T @ matrices, translations))
        return replace(done, segments=tuple(runs))

    def _rows(self, segment: Segment) -> Array:
        """Return the rows of the calls of a segment, see `run_foreign`."""
        count, previous = self.samples, self.source.arguments.previous
        quiet = np.zeros((self.settling if segment.settled else 0, count, 3))
        samples = np.concatenate([quiet, segment.increments]).reshape(-1, 3)
        numbers = windows(np.concatenate([np.zeros((previous, 3)), samples]), count, previous)
        if self.takes != "increments":
            numbers = numbers / float(self.interval)
        numbers = numbers.reshape(len(numbers), -1)
        beside = self._beside(segment, len(quiet))
        numbers = np.hstack(
            [numbers, *(np.broadcast_to(each, (len(numbers), each.shape[-1])) for each in beside)]
        )
        rows = np.empty((len(numbers), 3 + numbers[0].size))
        rows[:, 0] = np.arange(len(numbers)) == 0
        rows[:, 1] = float(self.interval)
        rows[:, 2] = float(self.interval * count)
        rows[:, 3:] = numbers
        return rows

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
    bridge, of = bridge_text(source), compiler.COMPILERS["C++"] if source.is_cpp else compiler.C
    with drafts.temporary_folder() as folder:
        text = folder / f"bridge{of.ending}"
        text.write_text(bridge, encoding="utf-8", newline="\n")
        preprocessed = _preprocess(source, text)
    key = cache.digest([preprocessed, bridge, compiler.C.identity(_FLAGS), of.identity()])

    def fill(draft: Path) -> None:
        with timed("compile", source.function):
            files, flags = {f"bridge{of.ending}": bridge}, [*_options(source), *_FLAGS]
            if reasons := compiler.compile_module(
                draft, _MODULE, files, _DECLARATION, _DECLARATION, flags, of
            ):
                raise CompilerError(_diagnostics(source, reasons))

    folder_of_build = cache.entry("builds", key, fill, f"compiled {source.function}")
    return next(path for path in folder_of_build.iterdir() if path.name.startswith(f"{_MODULE}."))


def run_foreign(module: Path, identity: Any, rows: Any) -> ForeignRun:
    """Call a compiled function once for each row, in a process of its own.

    `identity` (elements,): the state that a run begins with. `rows` (N, 3 + numbers): for each call whether a
    run begins, the sampling interval in s, the duration of the call in s, and the numbers of its arguments, the
    previous samples before those of the call.
    """
    values = np.ascontiguousarray(rows, np.float64)
    start = np.ascontiguousarray(identity, np.float64)
    nothing = np.empty((0, start.size))
    with drafts.temporary_folder() as folder:
        (folder / "input").write_bytes(values.tobytes())
        (folder / "identity").write_bytes(start.tobytes())
        command = [sys.executable, "-P", str(Path(__file__).with_name("foreign_runner.py"))]
        try:
            with cache.loadable(module) as (path, descriptor):
                done = subprocess.run(
                    [*command, path, str(folder), str(len(values))],
                    cwd=folder,
                    pass_fds=[] if path == str(module) else [descriptor],
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    timeout=PATIENCE,
                    check=False,
                )
        except subprocess.TimeoutExpired:
            return ForeignRun(nothing, f"{len(values)} calls have not come to an end in {PATIENCE} s")
        unloaded = folder / "unloaded"
        if unloaded.is_file():
            reason = unloaded.read_text(encoding="utf-8").rpartition(path)[2].strip(": ")
            raise CompilerError(
                f"the function cannot be linked: {reason}; include the file that defines it in the one to check"
            )
        flags = folder / "flags"
        if done.returncode or not flags.is_file():
            return ForeignRun(nothing, _reason(done.returncode))
        bits = int(flags.read_text(encoding="utf-8"))
        outputs = np.frombuffer((folder / "output").read_bytes()).reshape(len(values), start.size)
    return ForeignRun(outputs, "", bool(bits & 1), bool(bits & 2))


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
    language = "c++" if source.is_cpp else "c"
    command = [*compiler.C.command(), "-E", "-x", language, str(text)]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    if done.returncode:
        raise CompilerError(_diagnostics(source, done.stderr.splitlines()))
    return done.stdout.replace(str(text), "bridge")


def _options(source: ForeignSource) -> list[str]:
    """Return the options of $CC for a file in C++, which another command may compile."""
    words = compiler.C.command() if source.is_cpp else []
    return list(dropwhile(lambda word: not word.startswith("-"), words))


def _diagnostics(source: ForeignSource, lines: list[str]) -> str:
    """Return the first error of the compiler, with the path of the file as the user wrote it."""
    errors = [line.strip() for line in lines if re.search(r"\berror\b:", line)] or lines[:1] or ["no reason"]
    error = errors[0].replace(str(source.file.resolve()), str(source.file))
    names = list(definitions(source.file))
    for option, name in (("--function", source.function), ("--init", source.init)):
        unknown = re.search(r"implicit declaration|undeclared|not declared|undefined|has not been", error)
        if name and unknown and name not in names and re.search(rf"\b{re.escape(name)}\b", error):
            meant = suggestions("function", name, names)
            guess = f" (did you mean {' or '.join(meant)}?)" if meant else ""
            return (
                f"{option}: {source.file} has no function {name}{guess}; it has {', '.join(names) or 'none'}"
            )
    if error.startswith("--init:"):
        reason = re.sub(r"^--init:[\d:]* *", "", error)
        return f"{source.init} of --init does not take the memory, the state or nothing: {reason}"
    if error.startswith("--arguments:"):
        reason = re.sub(r"^--arguments:[\d:]* *", "", error)
        return (
            f"{source.function} does not take these --arguments in --precision {source.precision}: {reason}"
        )
    return f"{source.file} does not compile: {error}"


def rotation_vectors(matrices: Array) -> Array:
    """Return the rotation vectors of rotations.

    `matrices` has shape (..., 3, 3). Returns (..., 3): in rad.

    >>> rotation_vectors(evaluator("dcm-update")(np.eye(3), np.array([0.0, 0.0, 2.0]))).round(12) + 0.0
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
