"""Functions of users in Python and in MATLAB: how their arguments are read, and how they are called."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from strapgen.firmware.check_code import foreign, reading
from strapgen.firmware.check_code.foreign_arguments import (
    CONSTANT,
    MEMORY,
    PRECISIONS,
    ForeignArgument,
    ForeignArguments,
    read_arguments,
)
from strapgen.firmware.check_code.signature import Signature, SourceFile, Value
from strapgen.ir import checks
from strapgen.ir.exceptions import CompilerError, InputError
from strapgen.run import octave
from strapgen.storage import drafts

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
    #: Calls to a result, which is one here
    publishes: ClassVar[int] = 1
    is_integer: ClassVar[bool] = False

    def run(self, identity: Any, rows: Any) -> foreign.ForeignRun:
        """Call the function once for each row, see `strapgen.firmware.check_code.foreign.run_calls`."""
        return foreign.run_calls(
            self._command(), identity, rows, patience=_SLOWER * foreign.PATIENCE, plan=self._plan()
        )

    def _command(self) -> list[str]:
        if self.file.suffix == _MATLAB:
            return [*octave.command(), "--norc", "--no-history", "--quiet", str(_runner("octave_runner.m"))]
        return _PYTHON

    def _plan(self) -> str:
        arguments, constants = self.arguments, {}
        parameters: list[tuple[str, list[int], int]] = []
        names: list[str] = []
        for each in arguments.parameters:
            carriers = [value for value in each.carriers if value.passed != "return"]
            name = f"constant_{len(parameters)}" if each.name == CONSTANT else each.name
            if each.name == CONSTANT:
                constants[name] = _constant(each.text)
            if not each.type:
                names += [value.name for value in carriers]
                one_by_one = len(carriers) > 1 and len(carriers) == each.size
                parameters += [
                    (name, [] if one_by_one else list(each.shape), k if one_by_one else -1)
                    for k in range(len(carriers))
                ]
        held = [arguments.before(result) for result in arguments.results]
        plan = _place(self.file) | {
            "function": self.function,
            "init": self.init,
            "type": self.precision,
            "parameters": parameters,
            "constants": constants,
            "names": names,
            "fed": [(each.name, each.size) for each in arguments.fed],
            "results": [
                (each.name, each.size, before.name if before else "", _places(each))
                for each, before in zip(arguments.results, held, strict=True)
            ],
        }
        return json.dumps(plan)


def _constant(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        raise InputError(f"--arguments: the constant {text!r} is no number, true or false") from None


def _places(result: ForeignArgument) -> list[str]:
    """Return where the numbers of a result are read after a call; nothing if they are returned or changed in place."""
    at = f"{reading.variable(ForeignArgument(MEMORY))}."
    return [value.name.replace(at, f"{MEMORY}.") for value in result.carriers if not value.type]


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
    text: str,
    function: str | None,
    arguments: str | None,
    init: str,
    precision: str,
    *,
    takes: str = "",
    is_angle_said: bool = False,
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
    reader = _Names(file, _described(file, name, init) if matched else {"parameters": _of_matlab(file, name)})
    proposed = "" if arguments else reading.proposed(reader.signature(name), reader, takes, is_angle_said)
    said = arguments or proposed.replace("[9]", "[3][3]")  # whose elements C cannot tell
    known = reading.joined(reader.signature(name, said), said, reader)
    return InterpretedSource(file, name, known, init, precision)


class _Names:
    """The names that a module has: of parameters, of fields of an object, and of variables; see `reading.Reader`."""

    def __init__(self, file: Path, described: dict[str, Any]) -> None:
        self.file = SourceFile(file, is_cpp=False)
        self.described = described

    def signature(self, name: str, stated: str = "") -> Signature:
        """Return the signature of the function, of what is stated where it has none that can be read."""
        returns, names = self.described.get("returns", True), self.described["parameters"]
        if names is None:
            if not stated:
                raise InputError(f"{name} has no signature that can be read; --arguments is needed")
            known = read_arguments(stated, (MEMORY,))
            names = [
                each.name for each in known.parameters if each.name != MEMORY and each not in known.results
            ]
        values = [self._value(each, "object", written=not returns) for each in names]
        owner = name.rpartition(".")[0] if self.described.get("owner") else ""
        return Signature(name, tuple(values), owner, self._value("result", "object") if returns else None)

    def _value(self, text: str, kind: str, count: int = 0, *, written: bool = False) -> Value:
        """Return a value with a name, of so many numbers, or of any number of them."""
        elements = tuple(f"[{k}]" for k in range(count)) if count > 1 else ("",)
        return Value(text.rstrip("="), text, kind, (), "", written, elements, "double", open=not count)

    def results(self, places: Iterable[str], before: Sequence[str] = ()) -> dict[str, Value]:
        """Return what is read after a call; of what a call makes first, the number of its numbers is open."""
        at = reading.variable(ForeignArgument(MEMORY))
        known = self.described.get("variables", {}) | {
            f"{at}.{name}": count for name, count in self.described.get("fields", {}).items()
        }
        return {place: self._value(place, "", known.get(place, 0)) for place in places}

    def fields(self, name: str, before: Sequence[str]) -> list[tuple[str, bool]]:
        """Return the fields of the object, each with whether its name is public."""
        return [(f"{name}.{each}", not each.startswith("_")) for each in self.described.get("fields", {})]

    def variables(self) -> list[str]:
        """Return the names of the variables of the module."""
        return [*self.described.get("variables", {})]


def _described(file: Path, function: str, init: str) -> dict[str, Any]:
    """Return what python_runner.py writes of a callable, which it imports in a process of its own."""
    with drafts.temporary_folder() as folder:
        plan = json.dumps(_place(file) | {"function": function, "init": init})
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
        refused, described = folder / "refused", folder / "described"
        if refused.is_file():
            raise InputError(" ".join(refused.read_text(encoding="utf-8").split()))
        if not described.is_file():
            raise CompilerError(f"{file}: its import ends the program, with exit status {done.returncode}")
        read: dict[str, Any] = json.loads(described.read_text(encoding="utf-8"))
    return read


def _of_matlab(file: Path, function: str) -> list[str]:
    """Return the names of the parameters of a function in a file of MATLAB."""
    octave.command()  # it says what is missing
    text = re.sub(r"%[^\n]*|\.\.\.[^\n]*\n", "", file.read_text(encoding="utf-8", errors="replace"))
    found = re.findall(r"^\s*function\s+(?:[^=\n]*=\s*)?(\w+)\s*(?:\(([^)]*)\))?", text, flags=re.MULTILINE)
    if not found or found[0][0] != function:
        first = found[0][0] if found else "none"
        raise InputError(f"{file} has no function {function} at first; its first function is {first}")
    return [name.strip() for name in found[0][1].split(",") if name.strip()]
