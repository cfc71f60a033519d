"""Loading users' algorithms from a Python file, or from an entry point of an installed package.

Either has a function ``algorithm`` that returns the `Kernel` of an attitude step; its parameters, if it has any, are
names in `OPTIONS`. It runs in isolation, see `isolation`, and its kernel is cached.
"""

from __future__ import annotations

import contextlib
import inspect
import os
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strapgen.catalogue.user import isolation, kernel_cache
from strapgen.catalogue.user_kernel import UserKernel
from strapgen.ir import checks, packages
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import full_text
from strapgen.ir.packages import entry_points
from strapgen.storage import cache

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

    from strapgen.kernel.kernel import Kernel

#: Entry points of installed packages.
GROUP = "strapgen.algorithms"
#: Name of the function in a file.
FUNCTION = "algorithm"
#: The duty of a user's code, in messages.
DUTY = "return a Kernel"
#: Parameters that the function may have: a `Tableau`, and numbers of increments.
OPTIONS = ("method", "increments", "previous", "ahead")


def installed() -> dict[str, EntryPoint]:
    """Return the entry points of installed packages by name."""
    return {point.name: point for point in entry_points(group=GROUP)}


def load(name: str, **options: Any) -> UserKernel:
    """Return the checked kernel of a Python file or entry point, cached until it changes; options as in `OPTIONS`."""
    arguments = _arguments(name, options)
    texts = [f"{option} {full_text(value)} {getattr(value, 'file', '')}" for option, value in options.items()]
    isolation.depends_on(f"loads {name}, another algorithm")
    find = _of_file if name.endswith(".py") else _of_entry_point
    return find(name, options, texts).with_arguments(arguments)


def _of_file(name: str, options: dict[str, Any], texts: list[str]) -> UserKernel:
    path = Path(os.path.realpath(name))  # which a circle of links does not stop
    try:
        if not path.is_file():
            raise InputError(
                f"algorithm {name} is no file; a Python file with a function {FUNCTION} is needed"
            )
        source = path.read_bytes()
    except OSError as error:
        raise InputError(f"algorithm {name} cannot be read ({error.strerror})") from None

    def derive() -> tuple[Kernel, isolation.Record]:
        with (
            _isolated(path.parent) as record,
            packages.guarded(name, DUTY, lambda file: file.name == path.name),
        ):
            # Two files may have one name: each module gets a name of its own.
            module = isolation.load_source(
                path, f"strapgen_user_{path.stem}_{cache.digest([str(path)])}", record
            )
            if not hasattr(module, FUNCTION):
                raise InputError(
                    f"{name} defines no function {FUNCTION}; one that returns a Kernel is needed"
                )
            kernel = _called(name, getattr(module, FUNCTION), options)
        return kernel, record

    return kernel_cache.kernel(["file", str(path), cache.digest([source]), *texts], path.parent, derive)


def _of_entry_point(name: str, options: dict[str, Any], texts: list[str]) -> UserKernel:
    point = installed()[name]

    def derive() -> tuple[Kernel, isolation.Record]:
        anew = (point.module.partition(".")[0],)
        with _isolated(None, anew) as record, packages.guarded(name, DUTY, packages.belongs_to(point.module)):
            kernel = _called(name, point.load(), options)
        return kernel, record

    return kernel_cache.kernel(["entry point", name, point.value, *texts], None, derive)


@contextlib.contextmanager
def _isolated(folder: Path | None, anew: tuple[str, ...] = ()) -> Iterator[isolation.Record]:
    """Begin a session; the modules and the names that strapgen needs in it are read before."""
    from strapgen.catalogue.names import reserved
    from strapgen.catalogue.user import admission  # noqa: F401

    reserved()
    with isolation.session(folder, anew) as record:
        yield record


def _called(name: str, function: Any, options: dict[str, Any]) -> Kernel:
    """Return the checked kernel that a user's function returns."""
    if not callable(function):
        raise InputError(f"{name}: {FUNCTION} is no function; one that returns a Kernel is needed")
    parameters = inspect.signature(function).parameters
    takes = [option for option in OPTIONS if option in parameters]
    for option in options:
        if option not in takes:
            raise InputError(
                f"{name}: its {FUNCTION}({', '.join(takes)}) takes no {option}; "
                f"it takes {', '.join(takes) or 'no options'}"
            )
    kernel = function(**options)
    _require(name, kernel)
    return kernel  # type: ignore[no-any-return]


def _arguments(name: str, options: dict[str, Any]) -> str:
    """Return the arguments that choose the kernel on the command line."""
    words = [shlex.quote(checks.text("the name of the file", name))]
    for option, value in options.items():
        if option == "method":
            words.append(value.option)
        else:
            words += [f"--{option}", str(value)]
    return " ".join(words)


def _require(name: str, kernel: Any) -> None:
    from strapgen.catalogue.user import admission
    from strapgen.kernel.kernel import Kernel

    if not isinstance(kernel, Kernel):
        raise InputError(f"{name}: {FUNCTION}() returned {type(kernel).__name__}; a Kernel is needed")
    try:
        admission.require(kernel)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
