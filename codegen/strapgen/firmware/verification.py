"""Verifies generated C files against their headers: the text, and the results of the compiled files."""

from __future__ import annotations

import difflib
import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar

import mpmath
import numpy as np
from numpy.typing import NDArray

from strapgen import pipeline
from strapgen.firmware.vectors import MODEL, vectors_of_choice
from strapgen.firmware.vectors_c import CallVector
from strapgen.ir.checks import counted
from strapgen.ir.exceptions import CompilerError, InputError
from strapgen.ir.fixed_settings import ROTATION_INPUTS
from strapgen.ir.formats import float_above, places_above
from strapgen.ir.interfaces import Argument, Interface
from strapgen.ir.sources import Sources
from strapgen.results.records import Properties, entry, properties
from strapgen.results.result import Result
from strapgen.run.backends import Backend
from strapgen.run.compiled_code import CEvaluator, ModelEvaluator
from strapgen.run.evaluators import Evaluator
from strapgen.run.exact import DIGITS, Interpreter, number
from strapgen.run.kernel_sources import Request, StepSources
from strapgen.run.standard_tree import command_of, text_of
from strapgen.targets.contract_lines import Contract

Array = NDArray[Any]
#: Calls on corners and random input, and steps of the run.
CALLS, STEPS = 300, 300
#: What the commands begin with that generate several functions and a whole that calls them.
_COMMANDS = ("strapgen system ", "strapgen two-speed ", "strapgen window generate ", "strapgen stamped ")
#: The command that generates a whole in one header of C++.
_IN_CPP = "strapgen preintegrate "
#: Folders of a project that has headers apart from sources.
_PLACES = ("include", "src")
_VERSION = re.compile(r'_VERSION "(.*)"')


@dataclass(frozen=True)
class Verification(Result):
    """The outcome of verifying a generated file."""

    computed: ClassVar[Properties] = properties(in_step=entry(), holds=entry())

    file: Path
    #: What differs from the file that its command generates, a line of text each; empty if nothing does
    differences: tuple[str, ...]
    #: Calls that did not return what the reference returns: the integer model in fixed point
    wrong: int = field(metadata=entry(key="wrong_calls"))
    #: Calls in all
    calls: int
    #: Largest distance from arithmetic of 40 digits, in units in the last place of the output; None if the file
    #: was not run
    max_ulp: float | None
    #: The certified bound of that distance; None where there is none
    bound_ulp: float | None

    @property
    def in_step(self) -> bool:
        """Whether the file equals the output of its command."""
        return not self.differences

    @property
    def within(self) -> bool:
        """Whether all calls agree with the reference, within the bound."""
        if self.max_ulp is None or self.wrong:
            return False
        return self.bound_ulp is None or self.max_ulp <= self.bound_ulp

    @property
    def holds(self) -> bool:
        """Whether the file does not differ and meets its contract."""
        return self.in_step and self.within

    @property
    def in_words(self) -> str:
        """The results of the calls in words."""
        if self.max_ulp is None:
            return "not compiled, since it differs; --run-differing compiles and runs it as it stands"
        right = f"{self.calls - self.wrong} of {self.calls} calls return what they must"
        bound = "" if self.bound_ulp is None else f", certified {places_above(Fraction(self.bound_ulp))}"
        return f"{right}; error {self.max_ulp:.4f} of the last place{bound}"

    def text(self) -> str:
        """Return the differences, and the results of the calls."""
        state = f"{self.file}: {'in step' if self.in_step else 'out of step'} with its command"
        return "\n".join([*self.differences, state, self.in_words])


@dataclass(frozen=True)
class WholeVerification(Result):
    """The outcome of verifying the files of several functions and a whole that calls them."""

    computed: ClassVar[Properties] = properties(holds=entry())

    #: Header of the whole
    header: Path
    #: Number of files that were compared
    files: int
    #: What differs from generated files, a line of text each; empty if nothing does
    differences: tuple[str, ...]
    #: The function of each stage, held to its contract
    stages: tuple[Verification, ...]

    @property
    def holds(self) -> bool:
        """Whether no file differs, and every stage meets its contract."""
        return not self.differences and all(stage.holds for stage in self.stages)

    def text(self) -> str:
        """Return the differences, and the results of the calls of each stage."""
        state = "out of step" if self.differences else "in step"
        lines = [*self.differences, f"{self.header}: {counted(self.files, 'file')}, {state} with the command"]
        return "\n".join([*lines, *(f"{stage.file.stem}: {stage.in_words}" for stage in self.stages)])


def beside(folder: Path, name: str) -> Path:
    """Return a file of a folder; a project may have headers in ``include`` and sources in ``src``."""
    path = folder / name
    for other in (folder.parent / place / name for place in _PLACES if folder.name in _PLACES):
        if other.is_file() and not path.is_file():
            return other
    return path


def paths_of(file: Path) -> tuple[Path, Path]:
    """Return the header and the source of a generated function, given one of them."""
    if file.suffix not in (".c", ".h"):
        raise InputError(f"{file} is no C file; a source or a header that strapgen generated is needed")
    pair = beside(file.parent, f"{file.stem}.h"), beside(file.parent, f"{file.stem}.c")
    for path in (file, *pair):
        if not path.is_file():
            raise InputError(f"{path} is not there; a function has a header and a source in one folder")
        command = command_of(text_of(path))
        if command is None:
            raise InputError(f"{path} does not say by which command strapgen generated it")
        if command.endswith(" --with-runs"):
            raise InputError(
                f"{path} holds loops over runs; they are verified with the file of their function"
            )
    return pair


def whole_header(place: Path) -> Path | None:
    """Return the header of a whole: in a folder, or the named file; None for a file of another kind."""
    if not place.is_dir():
        header = place if place.suffix == ".hpp" else place.with_suffix(".h")
        return header if place.suffix in (".c", ".h", ".hpp") and _is_whole(header) else None
    found = [*place.glob("*.h*"), *(path for one in _PLACES for path in place.glob(f"{one}/*.h"))]
    headers = sorted(path for path in found if _is_whole(path))
    if len(headers) != 1:
        names = ", ".join(path.name for path in headers) or "none"
        raise InputError(
            f"{place} holds {names} of the headers of a system, of two speeds, of a commit-late unit, of stamped "
            "samples or of a preintegration; a folder with one is needed"
        )
    return headers[0]


def _is_whole(header: Path) -> bool:
    if not header.is_file():
        return False
    command = command_of(text_of(header)) or ""
    return command.startswith(_IN_CPP if header.suffix == ".hpp" else _COMMANDS) and not is_beside(command)


def is_beside(command: str) -> bool:
    """Return whether the file of a command lies beside the C: a loop over runs, or a part of a project."""
    return re.search(" --(with-runs$|project)", command) is not None


def verify(
    file: Path, request: Request, increments: Array | None = None, *, run_differing: bool = False
) -> Verification:
    """Compare a file with what its command generates; compile and run it if nothing differs.

    `increments` (N, elements): increments of a run in rad, for a step; by default a cone near the largest
    increments.
    """
    sources, here = _read(file, request)
    differences = tuple(_differences(file.parent, here, sources))
    if differences and not run_differing:
        return Verification(file, differences, 0, 0, None, None)
    compiled = replace(sources, files={**sources.files, **here})
    table = vectors_of_choice(request.choice, request.target, request.settings, CALLS, naming=request.naming)
    try:
        if sources.fixed is None:
            measured = _floating(compiled, table.rows, table.tolerances, request)
            return Verification(file, differences, *measured)
        run = _cone(sources.fixed) if increments is None else _words(sources.fixed, increments)
        return Verification(
            file, differences, *_fixed(compiled, table.rows, run, request, increments is None)
        )
    except CompilerError as error:
        if not differences:
            raise
        return Verification(file, (*differences, f"{file}: does not compile: {error}"), 0, 0, None, None)


def verify_whole(
    header: Path, sources: Sources, stages: Mapping[str, Request], *, run_differing: bool = False
) -> WholeVerification:
    """Compare the files of a whole with generated ones, and hold its stages to their contracts."""
    folder, generated = header.parent, sources.step_files
    here = _present(header, sources)
    expected = [*generated, *(present_runs(folder, sources))]
    checked = tuple(
        verify(beside(folder, name), request, run_differing=run_differing)
        for name, request in stages.items()
        if all(beside(folder, f"{Path(name).stem}{ending}").is_file() for ending in (".h", ".c"))
    )
    return WholeVerification(
        header, len(expected), tuple(_whole_differences(header, sources, here, expected)), checked
    )


def file_backend(file: Path, request: Request, *, run_differing: bool = False) -> Backend:
    """Return a file as a back end; parameters and errors are those of `verify`."""
    sources, here = _read(file, request)
    if sources.attitude_step is None:
        raise InputError(f"{file} is the kernel {sources.kernel}, which is no attitude step")
    differences = list(_differences(file.parent, here, sources))
    if differences and not run_differing:
        raise InputError(f"{differences[0]}; --run-differing compiles and runs the file as it stands")
    step = StepSources(replace(sources, files={**sources.files, **here}), request.choice)
    backend = Backend(step)
    backend.name = str(file)
    return backend


def sources_of_files(header: Path, sources: Sources, *, run_differing: bool = False) -> Sources:
    """Return the sources of a whole with the text of its files, which must be what their command generates."""
    here = _present(header, sources)
    expected = [*sources.step_files, *(present_runs(header.parent, sources))]
    difference = next(_whole_differences(header, sources, here, expected), None)
    if difference is not None and not run_differing:
        raise InputError(f"{difference}; --run-differing compiles and runs the file as it stands")
    return replace(sources, files={**sources.files, **here})


def _read(file: Path, request: Request) -> tuple[Sources, dict[str, str]]:
    """Return the output of the command of a file, and the text of the file, of its header and of its loops."""
    sources = pipeline.compile(*request)
    here = {path.name: text_of(path) for path in paths_of(file)}
    if not {*here} <= {*sources.step_files}:
        names = " and ".join(sources.step_files)
        raise InputError(f"the command in {file} generates {names}; another name goes with --name")
    return sources, here | present_runs(file.parent, sources)


def present_runs(folder: Path, sources: Sources) -> dict[str, str]:
    """Return the text of the loops over runs in a folder, "" for one that is missing beside others; none if all are."""
    runs = {name: folder / name for name in sources.runs}
    if not any(os.path.lexists(path) for path in runs.values()):
        return {}
    return {name: text_of(path) if path.is_file() else "" for name, path in runs.items()}


def _present(header: Path, sources: Sources) -> dict[str, str]:
    """Return the text of the files of a whole that are there."""
    folder = header.parent
    paths = {name: beside(folder, name) for name in sources.step_files}
    here = {name: text_of(path) for name, path in paths.items() if path.is_file()}
    return here | {name: text for name, text in present_runs(folder, sources).items() if text}


def _differences(folder: Path, here: dict[str, str], sources: Sources) -> Iterator[str]:
    """Yield the lines of files that differ from generated ones, and why they may."""
    (reason,) = (
        _reason(text, sources.files[name])
        for name, text in here.items()
        if name.endswith(".h") and name not in sources.runs
    )
    for name, text in here.items():
        new = sources.files[name]
        if name.endswith(".h") and name not in sources.runs and reason == "other options":
            line = text[: text.index("Generated by:")].count("\n") + 1
            yield f"{beside(folder, name)}:{line}: other options: the file is not what this command generates"
        if text or not new:
            yield from differing_lines(beside(folder, name), text, new, reason)
        else:
            yield f"{beside(folder, name)}: is empty or not there"


def _whole_differences(
    header: Path, sources: Sources, here: Mapping[str, str], expected: Iterable[str]
) -> Iterator[str]:
    """Yield the differences from generated files, a line of text each."""
    if header.name not in sources.step_files:
        first = next(name for name in sources.step_files if name.endswith((".h", ".hpp")))
        yield f"{header}: other options: the command in it generates {first}"
    for name in expected:
        path, text = beside(header.parent, name), sources.files[name]
        if name in here:
            yield from differing_lines(path, here[name], text, _whole_reason(here[name], text))
        else:
            yield f"{path}: is not there"


def differing_lines(path: Path, text: str, new: str, reason: str) -> Iterator[str]:
    """Yield the lines of a file that differ from the generated ones."""
    lines = text.splitlines(), new.splitlines()
    for kind, a, b, c, d in difflib.SequenceMatcher(None, *lines, autojunk=False).get_opcodes():
        if kind == "equal":
            continue
        for k in range(max(b - a, d - c)):
            was = _show(lines[0][a + k]) if a + k < b else "nothing"
            expected = lines[1][c + k].strip() if c + k < d else "nothing"
            yield f"{path}:{min(a + k, max(b - 1, a)) + 1}: {reason}: {was}; generated: {expected}"
    if text != new and lines[0] == lines[1]:
        yield f"{path}:{len(lines[0])}: edited: ends of lines; generated: ends of lines of Unix"


def _show(line: str) -> str:
    """Return a line of a file without characters that would act on a terminal."""
    return "".join(character if character.isprintable() else "?" for character in line.strip())


def _reason(header: str, generated: str) -> str:
    """Return why a header may differ from the generated one."""
    old, new = Contract.read(header), Contract.read(generated)
    if old is None or new is None:
        return "edited"
    if old.version != new.version:
        return f"strapgen {old.version}, this is {new.version}"
    return "other options" if old.digest != new.digest else "edited"


def _whole_reason(here: str, generated: str) -> str:
    """Return why a file may differ from the generated one."""
    old, new = _VERSION.search(here), _VERSION.search(generated)
    if old is not None and new is not None and old[1] != new[1]:
        return f"strapgen {old[1]}, this is {new[1]}"
    if command_of(here) != command_of(generated):
        return "other options"
    return "edited"


def _fixed(
    sources: Sources, rows: Sequence[CallVector], run: Array | None, request: Request, restarts: bool
) -> tuple[int, int, float, float]:
    """Run a function on integers; return wrong calls, calls, the largest error and its bound in last places.

    A run that `restarts` begins again at the identity attitude where the code has to refuse its state.
    """
    assert sources.fixed is not None
    of = CEvaluator(sources)
    model = ModelEvaluator(pipeline.compile(request.choice, MODEL, request.settings))
    exact, wrong, worst = _Exact(request, sources.fixed), 0, 0.0
    for row in rows:
        inputs, outputs = _call(of, row)
        same = outputs == (row.outputs if row.status == 0 else None)
        wrong += not same
        if outputs is not None:
            worst = max(worst, exact.error(inputs, outputs))
    calls = len(rows)
    if run is not None:
        start = np.array([_identity(sources)])
        state, feedback = start, of.fresh(1)
        for increments in run:
            arguments = [state, increments[None]]
            if restarts and state is not start and _refused(model, arguments, feedback):
                wrong, calls = wrong + (not _refused(of, arguments, feedback)), calls + 1
                arguments, feedback = [start, increments[None]], of.fresh(1)
            after, feedback_after = of.run(arguments, feedback)
            expected, expected_feedback = model.run(arguments, feedback)
            equal = np.array_equal(after[0], expected[0]) and np.array_equal(
                feedback_after, expected_feedback
            )
            wrong, calls = wrong + (not equal), calls + 1
            values = [tuple(map(int, array.ravel())) for array in (*arguments, *after)]
            worst = max(worst, exact.error(values[:2], values[2:]))
            state, feedback = np.asarray(expected[0]), expected_feedback
    bound = max(max(a.errors) / a.format.unit for a in sources.fixed.outputs)
    return wrong, calls, worst, float_above(bound)


def _refused(evaluator: Evaluator, arguments: Sequence[Array], feedback: Array) -> bool:
    """Return whether a back end refuses its inputs."""
    try:
        evaluator.run(arguments, feedback)
    except InputError:
        return True
    return False


def _call(of: CEvaluator, row: CallVector) -> tuple[list[tuple[int, ...]], Any]:
    """Return the inputs and outputs of a call as integers; None for a refusal."""
    inputs = [tuple(map(int, values)) for values in row.inputs]
    feedback = np.array([row.feedback], of.feedback_type).reshape(1, -1)
    try:
        outputs, _ = of.run([np.array([values]) for values in inputs], feedback)
    except InputError:
        return inputs, None
    return inputs, tuple(tuple(map(int, output.ravel())) for output in outputs)


class _Exact:
    """Measures the error of a call in units in the last place, in arithmetic of 40 digits."""

    def __init__(self, request: Request, interface: Interface) -> None:
        self.interpreter = Interpreter(pipeline.program(request.choice))
        self.interface = interface

    def error(self, inputs: Sequence[Sequence[int]], outputs: Sequence[Sequence[int]]) -> float:
        """Return the largest error of the elements of all outputs."""
        with mpmath.workdps(DIGITS):
            numbers = [
                [word * number(argument.unit) for word in words]
                for words, argument in zip(inputs, self.interface.inputs, strict=True)
            ]
            results = self.interpreter.outputs(*numbers)
            return max(
                float(abs(word - _store(value, argument) / number(argument.format.unit)))
                for argument, words in zip(self.interface.outputs, outputs, strict=True)
                for word, value in zip(words, results[argument.signal.name], strict=True)
            )


def _store(value: Any, argument: Argument) -> Any:
    """Return the exact value of an output, at the end of the range of one that saturates."""
    return min(max(value, mpmath.mpf(-1)), mpmath.mpf(1)) if argument.saturates else value


def _floating(
    sources: Sources, rows: Sequence[CallVector], tolerances: Sequence[float], request: Request
) -> tuple[int, int, float, float | None]:
    """Run a function on floating-point numbers; return wrong calls, calls and the largest error in last places of 1."""
    of = CEvaluator(sources)
    exact = Interpreter(pipeline.program(request.choice))
    wrong, worst, unit = 0, 0.0, float(np.finfo(of.dtype).eps)
    bound = _bound(sources)
    for row in rows:
        arrays = [
            np.array(values, of.dtype).reshape(signal.shape)
            for values, signal in zip(row.inputs, sources.function.inputs, strict=True)
        ]
        outputs = [output.ravel() for output in of.evaluate(arrays, ())]
        wrong += any(
            not np.all(np.abs(output - np.array(expected, of.dtype)) <= tolerance)
            for output, expected, tolerance in zip(outputs, row.outputs, tolerances, strict=True)
        )
        if bound is not None and not _inside(row, sources):
            continue  # the bound says nothing there
        with mpmath.workdps(DIGITS):
            results = exact.outputs(*([mpmath.mpf(float(x)) for x in array.ravel()] for array in arrays))
            for output, values in zip(outputs, results.values(), strict=True):
                distances = [abs(float(x) - value) for x, value in zip(output, values, strict=True)]
                worst = max(worst, *(float(distance) / unit for distance in distances))
    return wrong, len(rows), worst, None if bound is None else bound / unit


def _bound(sources: Sources) -> float | None:
    """Return the certified bound of a call in floating point; None where there is none without conditions."""
    known = sources.rounding
    if known is None or not known.errors or known.conditions:
        return None
    return float_above(max(known.worst.values()))


def _inside(row: CallVector, sources: Sources) -> bool:
    """Return whether the inputs of a call lie in the ranges for which the bound holds."""
    assert sources.rounding is not None
    ranges = {condition.value: condition for condition in sources.rounding.inputs}
    return all(
        ranges[signal.name].low <= value <= ranges[signal.name].high
        for signal, values in zip(sources.function.inputs, row.inputs, strict=True)
        for value in values
    )


def _identity(sources: Sources) -> list[int]:
    """Return the integers of the state of zero rotation."""
    assert sources.fixed is not None and sources.attitude_step is not None
    return [sources.fixed.inputs[0].format.nearest(x) for x in sources.attitude_step.identity]


def _cone(interface: Interface) -> Array | None:
    """Return the increments of a cone whose angles are near the largest ones; None for what is no step."""
    if len(interface.inputs) != 2 or interface.inputs[1].signal.name not in ROTATION_INPUTS:
        return None
    argument = interface.inputs[1]
    angles = np.arange(STEPS * argument.signal.size // 3) * (math.pi / 37)
    axes = np.stack([np.cos(angles), np.sin(angles), np.full_like(angles, 0.5)], axis=-1)
    words = np.rint(axes * (0.95 * argument.high))
    return words.astype(np.int64).reshape(STEPS, argument.signal.size)


def _words(interface: Interface, increments: Array) -> Array:
    """Return increments as the integers of the second input."""
    argument = interface.inputs[1]
    scaled = np.rint(increments.reshape(len(increments), -1) / float(argument.unit))
    if np.abs(scaled).max() > argument.high:
        raise InputError(
            f"the run has increments of {float(np.abs(increments).max()):.6g} rad; the file takes at most "
            f"{float(Fraction(argument.high) * argument.unit):.6g} rad"
        )
    return scaled.astype(np.int64)
