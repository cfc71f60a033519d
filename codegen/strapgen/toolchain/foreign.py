"""Compiles a function of a user's C or C++ file together with a loop that calls it, and runs it in another process.

The file is included in a text that knows its arguments, so that the compiler checks them against the function. What
the function does wrong stays in the process that runs it: a crash or an endless loop ends that one.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.support import cache, checks
from strapgen.support.exceptions import CompilerError, InputError
from strapgen.support.suggestions import suggestions
from strapgen.support.timing import timed
from strapgen.toolchain import compiler
from strapgen.toolchain.foreign_arguments import (
    CPP_SUFFIXES,
    FOREIGN_SUFFIXES,
    NEXT,
    PREVIOUS,
    STATE,
    ForeignArgument,
    ForeignArguments,
    is_foreign,
)

PRECISIONS = ("double", "float")
#: Longest time in s that a run may take.
PATIENCE = 20

#: Without contraction to fused multiply-add every machine computes the same bits.
_FLAGS = ("-O1", "-ffp-contract=off", "-g0", "-fvisibility=hidden")
_MODULE = "strapgen_foreign"
_DECLARATION = (
    "int strapgen_foreign_run(long calls, const double *identity, const double *input, double *output);"
)

_BRIDGE = """
#include "{file}"
#include <math.h>
#include <string.h>
/* The arguments are those of --arguments: what does not fit the function is an error. */
#pragma GCC diagnostic error "-Wincompatible-pointer-types"
#pragma GCC diagnostic error "-Wimplicit-function-declaration"
#pragma GCC diagnostic error "-Wint-conversion"
#ifdef __clang__
#pragma clang diagnostic ignored "-Wincompatible-pointer-types-discards-qualifiers"
#endif
typedef {precision} strapgen_number;
/* An array between bytes that must stay as they are. */
#define STRAPGEN_GUARDED(name, size, shape) \\
    static struct {{ \\
        unsigned char before[64]; \\
        union {{ strapgen_number all[size]; strapgen_number array shape; }} of; \\
        unsigned char after[64]; \\
    }} name, name##_before
{declarations}
#ifdef __cplusplus
extern "C"
#endif
__attribute__((visibility("default"))) int strapgen_foreign_run(
    long calls, const double *identity, const double *input, double *output)
{{
    int flags = 0;
    for (long call = 0; call < calls; ++call) {{
        if (*input++ != 0.0) {{
            {reset}
        }}
        const strapgen_number strapgen_dt = (strapgen_number)*input++;
        const strapgen_number strapgen_step = (strapgen_number)*input++;
        (void)strapgen_dt;
        (void)strapgen_step;
        {before}
#line 1 "--arguments"
        {call};
        {after}
    }}
    (void)identity;
    return flags;
}}
"""


@dataclass(frozen=True)
class ForeignSource:
    """A function in a user's file.

    Parameters
    ----------
    file : Path
        The file in C or C++.
    function : str
        Name of the function.
    arguments : ForeignArguments
    init : str
        Name of the function that begins a run; "" if there is none.
    precision : str
        "double" or "float".
    """

    file: Path
    function: str
    arguments: ForeignArguments
    init: str = ""
    precision: str = "double"

    def __post_init__(self) -> None:
        checks.choice("precision", self.precision, PRECISIONS)
        for option, name in (("--function", self.function), ("--init", self.init)):
            if not re.fullmatch(r"[A-Za-z_]\w*(::[A-Za-z_]\w*)*", name) and (name or option == "--function"):
                raise InputError(f"{option} is {name!r}; the name of a function is needed")
        if not is_foreign(self.file):
            raise InputError(
                f"{self.file} is no file in C or C++ by its suffix; allowed: {', '.join(FOREIGN_SUFFIXES)}"
            )
        if not self.file.is_file():
            raise InputError(f"{self.file} is no file")

    @property
    def is_cpp(self) -> bool:
        """Whether it is C++."""
        return self.file.suffix == ".C" or self.file.suffix.lower() in CPP_SUFFIXES


@dataclass(frozen=True)
class ForeignRun:
    """What came of a run.

    Parameters
    ----------
    outputs : array, (N, elements)
        The result of every call, in the order of the function's elements; no rows if the run stopped.
    stopped : str
        The reason why the run came to no end; "" if it did.
    writes_beyond, changes_inputs : bool
        Whether the function wrote beside its arrays, or into arguments that are no result.
    """

    outputs: NDArray[np.float64]
    stopped: str = ""
    writes_beyond: bool = False
    changes_inputs: bool = False


def compile_foreign(source: ForeignSource) -> Path:
    """Compile a user's function.

    Parameters
    ----------
    source : ForeignSource

    Returns
    -------
    Path
        The compiled module; it is in the cache by all that the preprocessor reads.

    Raises
    ------
    CompilerError
        If there is no compiler, or the file or the call of the function does not compile: the first error.
    """
    bridge = bridge_text(source)
    suffix = ".cpp" if source.is_cpp else ".c"
    with tempfile.TemporaryDirectory() as folder:
        text = Path(folder) / f"bridge{suffix}"
        text.write_text(bridge)
        preprocessed = _preprocessed(source, text)
    key = cache.digest([preprocessed, bridge, compiler.build_key([], _FLAGS), os.environ.get("CXX", "")])

    def fill(draft: Path) -> None:
        with timed("compile", source.function):
            _compile(source, bridge, suffix, draft)

    folder_of_build = cache.entry("builds", key, fill, f"compiled {source.function}")
    return next(path for path in folder_of_build.iterdir() if path.name.startswith(f"{_MODULE}."))


def run_foreign(module: Path, identity: Any, rows: Any) -> ForeignRun:
    """Call a compiled function once for each row, in a process of its own.

    Parameters
    ----------
    module : Path
        Of `compile_foreign`.
    identity : array_like, (elements,)
        The state that a run begins with.
    rows : array_like, (N, 3 + numbers)
        For each call whether a run begins, the sampling interval in s, the duration of the call in s, and the numbers
        of its arguments, the previous samples before those of the call.

    Returns
    -------
    ForeignRun
    """
    values = np.ascontiguousarray(rows, np.float64)
    start = np.ascontiguousarray(identity, np.float64)
    nothing = np.empty((0, start.size))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "input").write_bytes(values.tobytes())
        (folder / "identity").write_bytes(start.tobytes())
        command = [sys.executable, "-P", str(Path(__file__).with_name("foreign_runner.py"))]
        try:
            done = subprocess.run(
                [*command, str(module), name, str(len(values))],
                cwd=name,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                timeout=PATIENCE,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return ForeignRun(nothing, f"{len(values)} calls have not come to an end in {PATIENCE} s")
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
    command = [*compiler.command(), "-E", "-x", language, str(text)]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    if done.returncode:
        raise CompilerError(_said(source, done.stderr.splitlines()))
    return done.stdout.replace(str(text), "bridge")


def _compile(source: ForeignSource, bridge: str, suffix: str, draft: Path) -> None:
    (draft / f"bridge{suffix}").write_text(bridge)
    request = {
        "name": _MODULE,
        "cdef": _DECLARATION,
        "header": _DECLARATION,
        "sources": [str(draft / f"bridge{suffix}")],
        "flags": [*_FLAGS],
        "libraries": [] if sys.platform == "win32" else ["m"],
        "folder": str(draft),
    }
    built, reasons = compiler.run_request(request)
    if built is None:
        raise CompilerError(_said(source, reasons))
    compiler.leave_only(built, draft)


def _said(source: ForeignSource, lines: list[str]) -> str:
    """Return the first error of the compiler, with the path of the file as the user wrote it."""
    errors = [line.strip() for line in lines if re.search(r"\berror\b:", line)] or lines[:1] or ["no reason"]
    error = errors[0].replace(str(source.file.resolve()), str(source.file))
    names = _functions(source.file)
    for option, name in (("--function", source.function), ("--init", source.init)):
        unknown = re.search(r"implicit declaration|undeclared|not declared|undefined|has not been", error)
        if name and unknown and name not in names and re.search(rf"\b{re.escape(name)}\b", error):
            meant = suggestions("function", name, names)
            guess = f" (did you mean {' or '.join(meant)}?)" if meant else ""
            return (
                f"{option}: {source.file} has no function {name}{guess}; it has {', '.join(names) or 'none'}"
            )
    if error.startswith("--arguments:"):
        reason = re.sub(r"^--arguments:[\d:]* *", "", error)
        return (
            f"{source.function} does not take these --arguments in --precision {source.precision}: {reason}"
        )
    return f"{source.file} does not compile: {error}"


def _functions(file: Path) -> list[str]:
    """Return the names of the functions that a file defines."""
    text = re.sub(r"/\*.*?\*/|//[^\n]*", "", file.read_text(errors="replace"), flags=re.DOTALL)
    names = re.findall(
        r"^[A-Za-z_][\w\s*&:<>]*?[\s*&]([A-Za-z_]\w*)\s*\([^;{}()]*\)\s*\{", text, flags=re.MULTILINE
    )
    return [name for name in dict.fromkeys(names) if name not in ("if", "for", "while", "switch")]


def bridge_text(source: ForeignSource) -> str:
    """Return the text that includes a user's file and calls its function.

    Parameters
    ----------
    source : ForeignSource
    """
    arguments = source.arguments
    arrays = [argument for argument in arguments.parameters if argument.shape]
    memory = arguments.memory
    declarations = [
        f"STRAPGEN_GUARDED(strapgen_{argument.name}, {argument.size}, {_shape(argument)});"
        for argument in arrays
    ]
    if memory:
        declarations.append(f"static {memory.type} {memory.name};")
    return _BRIDGE.format(
        file=source.file.resolve().as_posix(),
        precision=source.precision,
        declarations="\n".join(declarations),
        reset=" ".join(_reset(source, memory)),
        before=" ".join(_before(arguments, arrays)),
        call=f"{source.function}({', '.join(map(_passed, arguments.parameters))})",
        after=" ".join(_after(arguments, arrays)),
    )


def _shape(argument: ForeignArgument) -> str:
    return "".join(f"[{length}]" for length in argument.shape)


def _passed(argument: ForeignArgument) -> str:
    if argument.type:
        return f"&{argument.name}" if argument.reference == "*" else argument.name
    return f"strapgen_{argument.name}" + (".of.array" if argument.shape else "")


def _reset(source: ForeignSource, memory: ForeignArgument | None) -> list[str]:
    """Return the statements that begin a run."""
    lines = []
    if memory:
        cleared = (
            f"{memory.name} = {memory.type}();"
            if source.is_cpp
            else (f"memset(&{memory.name}, 0, sizeof {memory.name});")
        )
        lines.append(cleared)
    if source.init:
        lines.append(f"{source.init}({_passed(memory) if memory else ''});")
    state = source.arguments.named(STATE)
    if state:
        lines.append(
            f"for (int k = 0; k < {state.size}; ++k) strapgen_state.of.all[k] = (strapgen_number)identity[k];"
        )
    return lines


def _before(arguments: ForeignArguments, arrays: list[ForeignArgument]) -> list[str]:
    """Return the statements before a call, which fill the inputs and mark the outputs."""
    lines = []
    samples = [each for each in (arguments.named(PREVIOUS), arguments.samples) if each]
    for argument in samples:
        lines.append(
            f"for (int k = 0; k < {argument.size}; ++k) "
            f"strapgen_{argument.name}.of.all[k] = (strapgen_number)*input++;"
        )
    if arguments.named(NEXT):
        lines.append(f"for (int k = 0; k < {arguments.elements}; ++k) strapgen_next.of.all[k] = NAN;")
    for argument in arrays:
        name = f"strapgen_{argument.name}"
        lines.append(f"memset({name}.before, 0x5a, 64); memset({name}.after, 0x5a, 64);")
        lines.append(f"{name}_before = {name};")
    return lines


def _after(arguments: ForeignArguments, arrays: list[ForeignArgument]) -> list[str]:
    """Return the statements after a call, which look at what it wrote and keep its result."""
    lines = []
    for argument in arrays:
        name = f"strapgen_{argument.name}"
        for side in ("before", "after"):
            lines.append(f"flags |= memcmp({name}.{side}, {name}_before.{side}, 64) != 0;")
        if argument != arguments.result:
            lines.append(f"flags |= memcmp(&{name}.of, &{name}_before.of, sizeof {name}.of) != 0 ? 2 : 0;")
    result = arguments.result
    place = f"strapgen_{result.name}.of.array"
    if result.name not in (STATE, NEXT):  # a field or a global array, of any type of numbers
        place = result.name.removeprefix("global ")
    element = f"({place})[k / 3][k % 3]" if len(result.shape) == 2 else f"({place})[k]"
    for_all = f"for (int k = 0; k < {arguments.elements}; ++k)"
    lines.append(f"{for_all} *output++ = (double){element};")
    if arguments.named(STATE) and not arguments.in_place:
        lines.append(f"{for_all} strapgen_state.of.all[k] = (strapgen_number){element};")
    return lines
