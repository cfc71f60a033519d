"""Compiles a function of a user's C or C++ file together with a loop that calls it, and runs it in another process.

What the function does wrong stays in the process that runs it: a crash or an endless loop ends that one.
"""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from dataclasses import dataclass
from itertools import dropwhile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.firmware.check_code.foreign_bridge import ForeignSource, bridge_text, definitions
from strapgen.ir.checks import suggestions
from strapgen.ir.exceptions import CompilerError
from strapgen.ir.timing import timed
from strapgen.run import compiler
from strapgen.storage import cache, drafts

#: Longest time in s that a run may take.
PATIENCE = 20

#: Without contraction to fused multiply-add every machine computes the same bits.
_FLAGS = ("-O1", "-ffp-contract=off", "-g0", "-fPIC", "-fvisibility=hidden")
_MODULE = "strapgen_foreign"
_DECLARATION = (
    "int strapgen_foreign_run(long calls, const double *identity, const double *input, double *output);"
)


@dataclass(frozen=True)
class ForeignRun:
    """What came of a run."""

    #: (N, elements): the result of every call, in the order of the function's elements; no rows if the run
    #: stopped
    outputs: NDArray[np.float64]
    #: The reason why the run came to no end; "" if it did
    stopped: str = ""
    #: Whether the function wrote beside its arrays, or into arguments that are no result
    writes_beyond: bool = False
    changes_inputs: bool = False


def compile_foreign(source: ForeignSource) -> Path:
    """Compile a user's function."""
    bridge, of = bridge_text(source), compiler.COMPILERS["C++"] if source.is_cpp else compiler.C
    with drafts.temporary_folder() as folder:
        text = folder / f"bridge{of.ending}"
        text.write_text(bridge)
        preprocessed = _preprocessed(source, text)
    key = cache.digest([preprocessed, bridge, compiler.C.identity(_FLAGS), of.identity()])

    def fill(draft: Path) -> None:
        with timed("compile", source.function):
            files, flags = {f"bridge{of.ending}": bridge}, [*_options(source), *_FLAGS]
            if reasons := compiler.compile_module(
                draft, _MODULE, files, _DECLARATION, _DECLARATION, flags, of
            ):
                raise CompilerError(_said(source, reasons))

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
            reason = unloaded.read_text().rpartition(path)[2].strip(": ")
            raise CompilerError(
                f"the function cannot be linked: {reason}; include the file that defines it in the one to check"
            )
        flags = folder / "flags"
        if done.returncode or not flags.is_file():
            return ForeignRun(nothing, _reason(done.returncode))
        bits = int(flags.read_text())
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


def _preprocessed(source: ForeignSource, text: Path) -> str:
    """Return all that the compiler reads, headers included."""
    language = "c++" if source.is_cpp else "c"
    command = [*compiler.C.command(), "-E", "-x", language, str(text)]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    if done.returncode:
        raise CompilerError(_said(source, done.stderr.splitlines()))
    return done.stdout.replace(str(text), "bridge")


def _options(source: ForeignSource) -> list[str]:
    """Return the options of $CC for a file in C++, which another command may compile."""
    words = compiler.C.command() if source.is_cpp else []
    return list(dropwhile(lambda word: not word.startswith("-"), words))


def _said(source: ForeignSource, lines: list[str]) -> str:
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
