"""Algorithms that users bring: a Python file, or an entry point of an installed package.

Both give a function called ``algorithm`` that returns the `Kernel` of an attitude step. Its parameters, if it has any,
are chosen by name from `OPTIONS`.
"""

from __future__ import annotations

import contextlib
import importlib.util
import inspect
import shlex
import sys
import traceback
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strapgen import checks
from strapgen.exceptions import InputError, StrapgenError

if TYPE_CHECKING:
    from strapgen.kernel import Kernel

#: Entry points of installed packages.
GROUP = "strapgen.algorithms"
#: Name of the function in a file.
FUNCTION = "algorithm"
#: What the function may take: a `Tableau`, and how many increments.
OPTIONS = ("method", "increments", "previous")

#: Kernels that were loaded in this process, by name.
KERNELS: dict[str, Kernel] = {}


def installed() -> dict[str, EntryPoint]:
    """Return the entry points of installed packages by name."""
    return {point.name: point for point in entry_points(group=GROUP)}


def load(name: str, catalogue: frozenset[str], derived: Callable[[str], Kernel], **options: Any) -> Kernel:
    """Load an algorithm, check its kernel and remember it with the kernels of its own.

    Parameters
    ----------
    name : str
        A Python file, or the name of an entry point.
    catalogue : frozenset of str
        Kernels that there are already.
    derived : callable
        Derives one of them.
    **options
        Of `OPTIONS`, those that the user chose.

    Returns
    -------
    Kernel

    Raises
    ------
    InputError
        If there is no such algorithm, its code fails, or what it returns is no attitude step.
    """
    function = _from_file(Path(name)) if name.endswith(".py") else _guarded(name, installed()[name].load)
    if not callable(function):
        raise InputError(f"{name}: {FUNCTION} is no function; one that returns a Kernel is needed")
    parameters = _guarded(name, lambda: inspect.signature(function).parameters)
    takes = [option for option in OPTIONS if option in parameters]
    for option in options:
        if option not in takes:
            raise InputError(
                f"{name}: its {FUNCTION}({', '.join(takes)}) takes no {option}; {_allowed(takes)}"
            )
    kernel = _guarded(name, lambda: function(**options))
    _require(name, kernel, catalogue, derived)
    kernel = replace(kernel, arguments=_arguments(name, options))
    for made in (kernel, *kernel.own):
        KERNELS[made.name] = made
    return kernel  # type: ignore[no-any-return]


def _arguments(name: str, options: dict[str, Any]) -> str:
    """Return what makes a kernel again on the command line: file or entry point as they were given, and the options."""
    words = [shlex.quote(checks.text("the name of the file", name))]
    for option, value in options.items():
        if option == "method":
            words.append(value.option)
        else:
            words += [f"--{option}", str(value)]
    return " ".join(words)


def _require(name: str, kernel: Any, catalogue: frozenset[str], derived: Callable[[str], Kernel]) -> None:
    """Check what a user's function returned."""
    from strapgen.catalogue import admission
    from strapgen.kernel import Kernel

    if not isinstance(kernel, Kernel):
        raise InputError(f"{name}: {FUNCTION}() returned {type(kernel).__name__}; a Kernel is needed")
    try:
        admission.require(kernel, catalogue, derived)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def _allowed(takes: list[str]) -> str:
    return f"it takes {', '.join(takes)}" if takes else "it takes no options"


def _from_file(path: Path) -> Callable[..., Any]:
    if not path.is_file():
        raise InputError(f"algorithm {path} is no file; a Python file with a function {FUNCTION} is needed")
    spec = importlib.util.spec_from_file_location(f"strapgen_user_{path.stem}", path)
    assert spec is not None and spec.loader is not None, "a .py file has a loader"
    module = importlib.util.module_from_spec(spec)
    _guarded(str(path), partial(spec.loader.exec_module, module))
    if not hasattr(module, FUNCTION):
        raise InputError(f"{path} defines no function {FUNCTION}; one that returns a Kernel is needed")
    function: Callable[..., Any] = getattr(module, FUNCTION)
    return function


def _guarded(name: str, run: Callable[[], Any]) -> Any:
    """Run a user's code; where it fails, say where and why in one line.

    What lies beside its file can be imported, and what it prints is no output of ours.
    """
    beside = [str(Path(name).resolve().parent)] if name.endswith(".py") else []
    before = list(sys.path)
    sys.path[:0] = beside
    try:
        with contextlib.redirect_stdout(sys.stderr):
            return run()
    except SystemExit:
        raise InputError(f"{name} ends the program with sys.exit; it must return a Kernel") from None
    except StrapgenError:
        raise
    except Exception as error:
        frames = traceback.extract_tb(error.__traceback__)
        own = [frame for frame in frames if Path(frame.filename).name == Path(name).name]
        line = error.lineno if isinstance(error, SyntaxError) else own[-1].lineno if own else None
        where = "" if line is None else f", line {line}"
        said = error.msg if isinstance(error, SyntaxError) else " ".join(str(error).split())
        raise InputError(f"{name}{where}: {type(error).__name__}: {said}") from error
    finally:
        sys.path[:] = before
