"""Functions of users in Python and in MATLAB: how their arguments are read, and how they are called."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from strapgen.firmware.check_code import foreign
from strapgen.firmware.check_code.foreign_arguments import PRECISIONS, ForeignArguments, read_arguments
from strapgen.ir import checks
from strapgen.ir.exceptions import CompilerError, InputError
from strapgen.run import octave
from strapgen.storage import drafts

#: What parameters are whose names say it. Any other name needs --arguments.
_KNOWN = {
    "state[4]": ("state", "q", "quat", "quaternion", "attitude"),
    "state[3][3]": ("dcm", "C", "rotation_matrix"),
    "increments[3]": ("increments", "increment", "delta_angle", "delta_theta", "dtheta"),
    "rates[3]": ("rates", "rate", "gyro", "omega", "angular_rate"),
    "dt": ("dt",),
    "step": ("step",),
}
_UNITS = {"increments": " in rad", "rates": " in rad/s", "dt": " in s", "step": " in s"}
#: Python and Octave take so many times longer for a call than compiled code.
_SLOWER = 3
_MATLAB = ".m"
_CALLABLE = re.compile(r"(?P<place>.+):(?P<name>[^\W\d]\w*(\.[^\W\d]\w*)*)")


def is_callable(text: str) -> bool:
    """Return whether a text names a callable of Python, or a file in MATLAB.

    >>> [is_callable(text) for text in ("package.module:function", "a.py:Class.update", "step.m", "a.py", "euler")]
    [True, True, True, False, False]
    """
    return bool(_CALLABLE.fullmatch(text)) or Path(text).suffix == _MATLAB


@dataclass(frozen=True)
class InterpretedSource:
    """A user's function in Python or MATLAB."""

    #: The file, or the name of the module
    file: Path
    #: The name of the function, or of a class and its method
    function: str
    arguments: ForeignArguments
    init: str = ""
    #: "double" or "float", the type of the arrays that it gets
    precision: str = "double"
    #: Names of the parameters where they say what they are
    names: tuple[str, ...] = ()
    #: Calls to a result, which is one here
    publishes: ClassVar[int] = 1
    is_integer: ClassVar[bool] = False

    def run(self, identity: Any, rows: Any) -> foreign.ForeignRun:
        """Call the function once for each row, see `strapgen.firmware.check_code.foreign.run_calls`."""
        return foreign.run_calls(
            self._command(), identity, rows, patience=_SLOWER * foreign.PATIENCE, plan=self._plan()
        )

    @property
    def reading(self) -> str:
        """What its parameters are taken for, where their names say it; else nothing."""
        if not self.names:
            return ""
        known = zip(self.names, self._parameters, strict=True)
        words = [f"{name}: {what}{shape or ''}{_UNITS.get(what, '')}" for name, (what, shape) in known]
        return f"reads: {self.function}({', '.join(words)}) -> {self.arguments.elements} elements"

    @property
    def _parameters(self) -> list[tuple[str, list[int]]]:
        """Names and shapes of what it is called with; results that it returns are none of them."""
        arguments = self.arguments
        returned = [each for each in arguments.results if arguments.before(each) != each]
        return [
            (each.name, list(each.shape))
            for each in arguments.parameters
            if not each.type and each not in returned
        ]

    def _command(self) -> list[str]:
        if self.file.suffix == _MATLAB:
            return [*octave.command(), "--norc", "--no-history", "--quiet", str(_runner("octave_runner.m"))]
        return _PYTHON

    def _plan(self) -> str:
        arguments = self.arguments
        held = [arguments.before(result) for result in arguments.results]
        plan = _place(self.file) | {
            "function": self.function,
            "init": self.init,
            "type": self.precision,
            "parameters": self._parameters,
            "names": self.names,
            "fed": [(each.name, each.size) for each in arguments.fed],
            "results": [
                (each.name, each.size, before.name if before else "")
                for each, before in zip(arguments.results, held, strict=True)
            ],
        }
        return json.dumps(plan)


def _runner(name: str) -> Path:
    return Path(__file__).with_name(name)


_PYTHON = [sys.executable, "-P", str(_runner("python_runner.py"))]


def _place(file: Path) -> dict[str, Any]:
    """Return where a function is found: a module by its name from the present folder, or a file."""
    is_file = file.suffix in (".py", _MATLAB)
    found = file.resolve()
    return {"folder": str(found.parent if is_file else Path.cwd()), "module": file.stem if is_file else str(file),
            "file": str(found) if is_file else ""}  # fmt: skip


def interpreted_source(
    text: str, function: str | None, arguments: str | None, init: str, precision: str
) -> InterpretedSource:
    """Return the function that a text names; its parameters say what they are unless arguments are stated."""
    checks.choice("precision", precision, PRECISIONS)
    matched = _CALLABLE.fullmatch(text)
    file = Path(matched["place"] if matched else text)
    if file.suffix in (".py", _MATLAB) and not file.is_file():
        raise InputError(f"{file} is no file")
    if matched and function is not None:
        raise InputError(f"--function {function} goes with a file; {text} names a function already")
    name = matched["name"] if matched else function or file.stem
    parameters = _signature_of_matlab(file, name) if not matched else _signature_of_python(file, name)
    names: tuple[str, ...] = ()
    if arguments is None:
        names, arguments = _read(name, parameters)
    if re.search(r"->\s*self\.", arguments):
        arguments = f"object *self, {arguments}"
    known = read_arguments(arguments)
    for each in (*known.parameters, *known.results):
        if not each.shape and not each.type and each.name not in ("dt", "step"):
            raise InputError(
                f"--arguments: {each.name} needs its numbers, as state[4], for code that declares none"
            )
    return InterpretedSource(file, name, known, init, precision, names)


def _read(function: str, parameters: list[str]) -> tuple[tuple[str, ...], str]:
    """Return the names of parameters that say what they are, and the same as --arguments."""
    meant = {name: what for what, names in _KNOWN.items() for name in names}
    needed = [name for name in parameters if not name.endswith("=")]
    for name in needed:
        if name not in meant:
            known = ", ".join(name for names in _KNOWN.values() for name in names)
            raise InputError(
                f"{function}({', '.join(needed)}): {name} does not say what it is; --arguments says it, as "
                f'"state[4], increments[3] -> state[4]"; known names: {known}'
            )
    state = next((meant[name] for name in needed if meant[name].startswith("state")), "state[4]")
    return tuple(needed), f"{', '.join(meant[name] for name in needed)} -> {state.replace('state', 'next')}"


def _signature_of_python(file: Path, function: str) -> list[str]:
    """Return the names of the parameters of a callable; one with a default value has "=" behind it.

    It is imported in a process of its own.
    """
    with drafts.temporary_folder() as folder:
        plan = json.dumps(_place(file) | {"function": function})
        (folder / "plan").write_text(plan, encoding="utf-8", newline="\n")
        try:
            done = subprocess.run(
                [*_PYTHON, str(folder)],
                capture_output=True,
                stdin=subprocess.DEVNULL,
                timeout=foreign.PATIENCE,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise InputError(f"{file}: its import has not come to an end in {foreign.PATIENCE} s") from None
        refused, signature = folder / "refused", folder / "signature"
        if refused.is_file():
            raise InputError(" ".join(refused.read_text(encoding="utf-8").split()))
        if not signature.is_file():
            raise CompilerError(f"{file}: its import ends the program, with exit status {done.returncode}")
        read: list[str] = json.loads(signature.read_text(encoding="utf-8"))
    return read


def _signature_of_matlab(file: Path, function: str) -> list[str]:
    """Return the names of the parameters of a function in a file of MATLAB."""
    octave.command()  # it says what is missing
    text = re.sub(r"%[^\n]*|\.\.\.[^\n]*\n", "", file.read_text(encoding="utf-8", errors="replace"))
    found = re.findall(r"^\s*function\s+(?:[^=\n]*=\s*)?(\w+)\s*(?:\(([^)]*)\))?", text, flags=re.MULTILINE)
    if not found or found[0][0] != function:
        first = found[0][0] if found else "none"
        raise InputError(f"{file} has no function {function} at first; its first function is {first}")
    return [name.strip() for name in found[0][1].split(",") if name.strip()]
