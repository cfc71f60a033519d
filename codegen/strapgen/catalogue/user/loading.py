"""Loading users' algorithms from a Python file, or from an entry point of an installed package.

Either has a function ``algorithm`` that returns the `Kernel` of an attitude step; its parameters, if it has any, are
names in `OPTIONS`. It runs in isolation, see `isolation`. Its kernel is cached, and derived again only if its file, a
file that it reads, or an option changes.
"""

from __future__ import annotations

import contextlib
import inspect
import json
import os
import pickle
import shlex
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strapgen.catalogue.choice import UserKernel, packed
from strapgen.catalogue.user import isolation
from strapgen.catalogue.user.isolation import Record, installed_folders
from strapgen.ir import checks, packages
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import full_text
from strapgen.ir.packages import entry_points
from strapgen.ir.timing import from_cache, timed
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
            _isolate(path.parent) as record,
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
            kernel = _call(name, getattr(module, FUNCTION), options)
        return kernel, record

    return cached_kernel(["file", str(path), cache.digest([source]), *texts], path.parent, derive)


def _of_entry_point(name: str, options: dict[str, Any], texts: list[str]) -> UserKernel:
    point = installed()[name]

    def derive() -> tuple[Kernel, isolation.Record]:
        anew = (point.module.partition(".")[0],)
        with _isolate(None, anew) as record, packages.guarded(name, DUTY, packages.belongs_to(point.module)):
            kernel = _call(name, point.load(), options)
        return kernel, record

    return cached_kernel(["entry point", name, point.value, *texts], None, derive)


@contextlib.contextmanager
def _isolate(folder: Path | None, anew: tuple[str, ...] = ()) -> Iterator[isolation.Record]:
    """Begin a session; the modules and the names that strapgen needs in it are read before."""
    from strapgen.catalogue.names import reserved
    from strapgen.catalogue.user import admission  # noqa: F401

    reserved()
    with isolation.session(folder, anew) as record:
        yield record


def _call(name: str, function: Any, options: dict[str, Any]) -> Kernel:
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


_KIND = "kernels"
_KERNEL, _HEAD, _RECORD = "kernel.pickle", "head.pickle", "record.json"


def cached_kernel(
    what: list[str], folder: Path | None, derive: Callable[[], tuple[Kernel, Record]]
) -> UserKernel:
    """Return a user's kernel from the cache, or derive and store it; the file lies in `folder`.

    The key is `what`: kind, name, content of the file or entry point, and options.
    """
    key = cache.digest([cache.generator_digest(), sys.version, *_installed(), *what])
    with contextlib.suppress(InputError):  # no cache folder: derived every time
        if (stored := _stored(key, folder, derive)) is not None:
            from_cache(f"kernel of {what[1]}")
            return stored
    with timed("derive", what[1]):
        derived, record = derive()
    data = None if record.outside or not record.holds(folder) else _pickle(derived)
    if data is not None:
        with contextlib.suppress(InputError):
            _store(key, data, packed(derived), record)
    return UserKernel.of(derived)


def _installed() -> list[str]:
    """Return the installed packages with their versions: the names of their metadata folders."""
    return sorted(
        path.name
        for folder in map(Path, installed_folders())
        if folder.is_dir()
        for path in folder.iterdir()
        if path.suffix in (".dist-info", ".egg-info")
    )


def _stored(key: str, folder: Path | None, derive: Callable[[], tuple[Kernel, Record]]) -> UserKernel | None:
    place = cache.lookup(_KIND, key)
    if place is None:
        return None
    try:
        record = Record(**json.loads(cache.read(place, _RECORD)))
        if not record.holds(folder):
            return None
        data, head = cache.read(place, _KERNEL), cache.read(place, _HEAD)
        if not head:
            return UserKernel.of(pickle.loads(data))
        return UserKernel(pickle.loads(head), lambda: _restore(data, derive))
    except Exception:  # of another Python, or removed meanwhile: derived again
        return None


def _restore(data: bytes, derive: Callable[[], tuple[Kernel, Record]]) -> Kernel:
    try:
        stored: Kernel = pickle.loads(data)
    except Exception:  # of another SymPy: derived again
        stored, _ = derive()
    return stored


def _store(key: str, data: bytes, head: bytes | None, record: Record) -> None:
    def fill(draft: Path) -> None:
        (draft / _KERNEL).write_bytes(data)
        (draft / _HEAD).write_bytes(head or b"")
        (draft / _RECORD).write_text(json.dumps(asdict(record)), encoding="utf-8", newline="\n")

    cache.discard(_KIND, key)
    cache.entry(_KIND, key, fill)


def _pickle(derived: Kernel) -> bytes | None:
    """Return a kernel as bytes; None if they do not restore it, for instance because it holds a user's class."""
    try:
        data = pickle.dumps(derived)
        restored: Any = pickle.loads(data)
    except Exception:  # pickle raises what the objects in a kernel raise
        return None
    return data if _alike(restored, derived) else None


def _alike(one: Any, other: Any) -> bool:
    """Return whether two values are equal and of the same classes in every part.

    A class of SymPy is known to hold nothing beside its arguments; of any other, `repr` must agree too.
    """
    from sympy import Basic

    if type(one) is not type(other):
        return False
    if is_dataclass(one) and type(one).__module__.startswith("strapgen."):
        return all(_alike(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    if type(one) in (tuple, list):
        return len(one) == len(other) and all(map(_alike, one, other))
    known = isinstance(one, Basic) and str(type(one).__module__).startswith(("sympy.", "strapgen."))
    if known and one.args:
        return len(one.args) == len(other.args) and all(map(_alike, one.args, other.args))
    return bool(one == other) and (known or repr(one) == repr(other))
