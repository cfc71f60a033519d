"""Runs generated C on emulated processors, and compares what it returns with the model and with ball arithmetic.

Every integer of a run must be that of the model in Python integers. A million steps with error feedback must end near
the exact states of the same integers.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import re
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from strapgen import pipeline
from strapgen.evidence.collection import Result, Subject, Tool, Verdict, verdict
from strapgen.firmware.vectors import MODEL, model_call
from strapgen.firmware.vectors_c import CallVector
from strapgen.ir.exceptions import CompilerError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.interfaces import Argument, Interface
from strapgen.lab.certificate.certificate import roundings
from strapgen.lab.motions.motions import GENERAL, Motion, motion
from strapgen.lab.processors import RUNNERS, Runner
from strapgen.lab.runner_c import (
    MOST,
    NEEDED,
    NOISE,
    SEED,
    UNTOUCHED,
    CallRun,
    LongRun,
    long_run_files,
    run_files,
)
from strapgen.run.backends import evaluator
from strapgen.run.compiled_code import ModelEvaluator
from strapgen.storage.files import write_files
from strapgen.targets.contract import options

#: Rows of the motion, which a run goes through again and again.
ROWS = 250
#: Longest word that all processors have products of.
LONGEST_WORD = 32
#: Where the million steps are run.
PROCESSOR = "cortex-m3"
#: With error feedback, and with formats for a gyro of 450 deg/s that is read 2000 times a second.
SETTINGS = Settings(carry="full", largest_angle=Fraction(1, 256))
#: Steps of a pass, and passes.
PASS_STEPS, PASSES = 10_000, 100
#: Part of its range that an input fills which has not the constraint of an attitude.
_PART = 0.9
#: Time between two rows in s.
_STEP = Fraction(1, 8)
#: Largest noise of an increment in a million steps, as a part of its range.
_NOISE = Fraction(1, 500)
#: Units in the last place from the exact state that are allowed.
LARGEST_ERROR = 10


@dataclass(frozen=True)
class Part:
    """The report of a part of a run: calls, accepted calls, and the checksum of all integers."""

    name: str
    calls: int
    accepted: int
    checksum: int


def same_bits(subject: Subject, folder: Path) -> list[Verdict]:
    """Return, for each processor, whether a kernel returns the integers of the model."""
    if subject.settings is not None and subject.settings.word > LONGEST_WORD:
        return []
    assert subject.sources.fixed is not None
    place = folder / "processors"
    run = CallRun(subject.sources, motion_rows(subject.sources.fixed, ROWS))
    write_files(place, {**subject.sources.step_files, **run_files(run)})
    expected: list[Part] = []

    def judged(runner: Runner) -> tuple[Result, str]:
        expected.extend(() if expected else model_parts(subject, run))
        return _judge(runner, place, [*_code(subject), f"run_{subject.name}.c"], expected)

    return [
        verdict(subject.name, f"same bits: {runner.name}", tool_of(runner), partial(judged, runner))
        for runner in RUNNERS.values()
    ]


def tool_of(runner: Runner) -> Tool:
    """Return the emulator of a processor as a tool."""
    return Tool(runner.tool, runner.commands, runner.package, runner.version)


def _code(subject: Subject) -> list[str]:
    return [name for name in subject.sources.step_files if name.endswith(".c")]


def _judge(runner: Runner, place: Path, sources: Sequence[str], expected: list[Part]) -> tuple[Result, str]:
    """Return whether the report of a processor agrees with the model."""
    folder = place / runner.name
    folder.mkdir(exist_ok=True)
    try:
        said = runner.run(folder, [f"../{source}" for source in sources])
    except CompilerError as error:
        return "fails", str(error)
    reported = read_parts(said)
    for part in expected:
        if part.accepted < NEEDED:
            return "fails", f"{part.name}: {part.accepted} of {part.calls} calls are accepted"
        if part not in reported:
            other = [text for text in reported if text.name == part.name]
            return (
                "fails",
                f"{part.name}: {_text(part)} in the model, {_text(other[0]) if other else 'no report'}",
            )
    return "agrees", f"{NEEDED} calls of coning and {NEEDED} of random input"


def read_parts(said: str) -> list[Part]:
    """Return the parts of a run that a program reports.

    >>> read_parts("coning 000003e9 000003e8 00c0ffee")
    [Part(name='coning', calls=1001, accepted=1000, checksum=12648430)]
    """
    digits = " ".join(["([0-9a-f]{8})"] * 3)
    rows = re.findall(rf"^(\w+) {digits}\b", said, flags=re.MULTILINE)
    return [Part(name, *(int(number, 16) for number in numbers)) for name, *numbers in rows]


def _text(part: Part) -> str:
    return f"{part.calls} calls, {part.accepted} accepted, CRC-32 {part.checksum:08x}"


@dataclass
class XorShift32:
    """The generator of the program: xorshift of 32 bits."""

    state: int = SEED

    def draw(self) -> int:
        """Return the next number."""
        self.state ^= (self.state << 13) & 0xFFFFFFFF
        self.state ^= self.state >> 17
        self.state ^= (self.state << 5) & 0xFFFFFFFF
        return self.state

    def anywhere(self, low: int, high: int) -> int:
        """Return a number of a range: an end of it in one of four draws."""
        kind, offset = self.draw() & 7, self.draw() % (high - low + 1)
        return {0: low, 1: high}.get(kind, low + offset)

    def near(self, center: int, low: int, high: int, largest: int) -> int:
        """Return a number of a range that lies near another one of it."""
        change = self.draw() % (largest + 1)
        return min(center + change, high) if self.draw() & 1 else max(center - change, low)


@dataclass
class _ModelRun:
    """A part of a run in the model: calls one by one, and all integers that they return."""

    subject: Subject
    run: CallRun
    model: ModelEvaluator
    words: list[int] = field(default_factory=list)
    calls: int = 0
    accepted: int = 0

    def call(self, elements: Sequence[int], feedback: tuple[int, ...]) -> CallVector:
        """Call the model on the elements of all inputs."""
        rest = iter(elements)
        inputs = tuple(
            tuple(next(rest) for _ in range(signal.size)) for signal in self.run.sources.function.inputs
        )
        result = model_call(self.model, inputs, feedback)
        refused = result.status != 0
        self.words.append(result.status)
        self.words += [UNTOUCHED if refused else value for output in result.outputs for value in output]
        self.words += result.next_feedback
        self.calls += 1
        self.accepted += not refused
        return result

    def needs_more_calls(self) -> bool:
        """Return whether another call follows."""
        return self.accepted < NEEDED and self.calls < MOST

    def part(self, name: str) -> Part:
        """Return the expected report of the program."""
        octets = b"".join((word & 0xFFFFFFFF).to_bytes(4, "little") for word in self.words)
        return Part(name, self.calls, self.accepted, zlib.crc32(octets))


def model_parts(subject: Subject, run: CallRun) -> Iterator[Part]:
    """Yield the expected report of each part of a run, from the model in Python integers."""
    model = ModelEvaluator(pipeline.compile(subject.choice, MODEL, subject.settings))
    yield _coning(_ModelRun(subject, run, model))
    yield _random(_ModelRun(subject, run, model))


def _coning(part: _ModelRun) -> Part:
    run = part.run
    assert run.sources.fixed is not None
    fresh = tuple(word.fresh for word in run.sources.fixed.residuals)
    places = run.places
    outputs = [signal.name for signal in run.sources.function.outputs]
    last: CallVector | None = None
    while part.needs_more_calls():
        elements = list(run.rows[part.calls % len(run.rows)])
        feedback = fresh
        if last is not None:
            feedback = last.next_feedback
            for before, after in run.pairs:
                place = places[before.name]
                elements[place : place + before.size] = last.outputs[outputs.index(after.name)]
        result = part.call(elements, feedback)
        last = None if result.status else result
    return part.part("coning")


def _random(part: _ModelRun) -> Part:
    run, draws = part.run, XorShift32()
    assert run.sources.fixed is not None
    words, mask = len(run.sources.fixed.residuals), (1 << run.sources.fixed.settings.word) - 1
    while part.needs_more_calls():
        row = run.rows[draws.draw() % len(run.rows)]
        shift = 2 + draws.draw() % NOISE
        elements = [
            draws.near(center, low, high, (high - low) >> shift)
            if part.calls % 2
            else draws.anywhere(low, high)
            for center, (low, high) in zip(row, run.limits, strict=True)
        ]
        part.call(elements, tuple(draws.draw() & mask for _ in range(words)))
    return part.part("random")


def motion_rows(interface: Interface, count: int) -> tuple[tuple[int, ...], ...]:
    """Return the elements of all inputs along a motion whose axis and angle change."""
    coning = motion("coning", **GENERAL)
    columns = [_column(argument, coning, count) for argument in interface.inputs]
    return tuple(
        tuple(int(value) for column in columns for value in column[number]) for number in range(count)
    )


def _column(argument: Argument, coning: Motion, count: int) -> Any:
    """Return the integers of an input, (count, elements)."""
    signal = argument.signal
    if signal.constraint:
        values = coning.attitude(np.arange(count) * float(_STEP))
        if signal.constraint == "unit":
            (values,) = (np.asarray(evaluator("euler-from-dcm")(values)),)
        scaled = values.reshape(count, signal.size) / float(argument.unit)
    else:
        samples = -(-signal.size // 3)
        values = coning.increments(_STEP, count, samples).reshape(count, 3 * samples)[:, : signal.size]
        scaled = values * (_PART * argument.high / float(np.abs(values).max()))
    return np.clip(np.rint(scaled), float(argument.low), float(argument.high)).astype(object)


def million_steps(subject: Subject, folder: Path) -> list[Verdict]:
    """Compare a million steps with error feedback with exact arithmetic."""
    if not subject.is_reference_step:
        return []
    runner = RUNNERS[PROCESSOR]
    emulator = tool_of(runner)
    tool = Tool(
        f"{emulator.name} and python-flint",
        emulator.commands,
        f"{emulator.package}, python-flint",
        lambda: f"{emulator.version()}, python-flint {importlib.metadata.version('python-flint')}",
        ("flint",),
    )
    place = folder / "million_steps"

    def judge() -> tuple[Result, str]:
        fed_back = Subject(subject.choice, SETTINGS)
        run = noisy_run(fed_back, PASS_STEPS, PASSES)
        write_files(place, {**run.sources.step_files, **long_run_files(run)})
        (place / runner.name).mkdir(exist_ok=True)
        try:
            said = runner.run(
                place / runner.name, [f"../{fed_back.name}.c", f"../long_run_{fed_back.name}.c"]
            )
        except CompilerError as error:
            return "fails", str(error)
        return compared(read_states(said), fed_back, run)

    return [verdict(subject.name, f"error of a million steps: {runner.name}", tool, judge)]


def noisy_run(subject: Subject, rows: int, passes: int) -> LongRun:
    """Return a run along a motion that cones, with noise."""
    assert subject.sources.fixed is not None
    state, samples = subject.sources.fixed.inputs
    motion = tuple(row[state.signal.size :] for row in motion_rows(subject.sources.fixed, rows))
    return LongRun(subject.sources, motion, passes, int(samples.high * _NOISE))


def read_states(said: str) -> list[list[int]]:
    """Return the states that a program reports, up to the first call that is refused.

    >>> read_states("state 00000001 ffffffff")
    [[1, -1]]
    """
    rows = re.findall(r"^state((?: [0-9a-f]{8})+)", said, flags=re.MULTILINE)
    words = [[int(word, 16) for word in row.split()] for row in rows]
    return [[word - (word >> 31 << 32) for word in row] for row in words]


def noisy_integers(run: LongRun) -> Iterator[list[int]]:
    """Yield the increments of each step, as the program draws them."""
    draws, width = XorShift32(), 2 * run.noise + 1
    for _ in range(run.passes):
        for row in run.rows:
            yield [value - run.noise + draws.draw() % width for value in row]


def compared(states: Sequence[Sequence[int]], subject: Subject, run: LongRun) -> tuple[Result, str]:
    """Return whether states are as near to exact ones as is claimed, in units of the last place."""
    fixed = run.sources.fixed
    assert fixed is not None
    state, samples = fixed.inputs
    if len(states) < run.passes:
        return "fails", f"a step is refused in pass {len(states) + 1}"
    steps, drawn = len(run.rows), noisy_integers(run)
    begin = (
        [float(one) for one in subject.program.attitude_step.identity]
        if subject.program.attitude_step
        else []
    )
    numbers = [np.array(begin), *(np.array(words) * float(state.unit) for words in states)]
    passes = (
        np.array([next(drawn) for _ in range(steps)]).reshape(-1, 3) * float(samples.unit)
        for _ in range(run.passes)
    )
    error = 0.0
    for departed in roundings(subject.choice, steps, numbers, passes):
        error = max(error, departed.distance / float(state.unit))
    said = options(fixed.settings, run.sources.function.inputs)
    return "agrees" if error < LARGEST_ERROR else "fails", (
        f"{steps * run.passes} steps of coning with noise, formats of {said}: at most {error:.2f} units of the last "
        "place from exact states, by balls"
    )
