"""Code that others bring: its place, its contents, and its failures told in one line."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import sys
import traceback
from collections.abc import Callable, Hashable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from strapgen.ir.exceptions import InputError, StrapgenError

if TYPE_CHECKING:
    from importlib import metadata


def entry_points(group: str) -> tuple[metadata.EntryPoint, ...]:
    """Return the entry points of installed packages in a group.

    They are read again when the path changes or a package is installed or removed, which shows in its folder's time.
    """
    return _entry_points(group, _state_of_path())


@lru_cache(maxsize=32)
def _entry_points(group: str, state: Hashable) -> tuple[metadata.EntryPoint, ...]:
    from importlib import metadata

    return tuple(metadata.entry_points(group=group))


def _state_of_path() -> Hashable:
    """Return a value that changes with the packages to be found: the path, the times of its entries, other finders."""
    times: list[tuple[str, int | None]] = []
    for entry in sys.path:  # of a name of any kernel: pathlib would take four times as long
        there = os.path.abspath(entry)  # noqa: PTH100
        try:
            times.append((there, os.stat(there).st_mtime_ns))  # noqa: PTH116
        except (OSError, ValueError):
            times.append((there, None))
    return (*times, *(finder for finder in sys.meta_path if hasattr(finder, "find_distributions")))


def place(module: str) -> Path | None:
    """Return the folder of a module's package, or the file of a module in no package; None if there is neither."""
    try:
        spec = importlib.util.find_spec(module.partition(".")[0])
    except ValueError:  # a module that was put among the imported ones by hand
        return None
    if spec is None:
        return None
    folders = spec.submodule_search_locations
    there = spec.origin if folders is None else next(iter(folders), None)
    return None if there is None else Path(there)


def contents(module: str) -> list[str | bytes]:
    """Return the names and contents of all files of a module's package: code, templates and data."""
    root = place(module)
    if root is None or not root.exists():
        return []
    files = sorted(path for path in root.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    return [part for path in files or [root] for part in (str(path.relative_to(root)), path.read_bytes())]


def installed_with(point: metadata.EntryPoint) -> list[str | bytes]:
    """Return name and version of an entry point's distribution, and all files that it installed."""
    if point.dist is None:
        return []
    parts: list[str | bytes] = [point.dist.name, point.dist.version]
    for file in sorted(point.dist.files or (), key=str):
        path = Path(str(file.locate()))
        if path.is_file() and "__pycache__" not in path.parts:
            parts += [str(file), path.read_bytes()]
    return parts


def belongs_to(module: str) -> Callable[[Path], bool]:
    """Return a function that says whether a file belongs to a module's package."""
    root = place(module)
    return lambda path: root is not None and (path == root or root in path.parents)


@contextlib.contextmanager
def guarded(label: str, duty: str, belongs: Callable[[Path], bool]) -> Iterator[None]:
    """Run a user's code, which must do its `duty`, such as "return a Kernel", and not end the program.

    A failure becomes one line, with the last place in a file that `belongs` to the user; prints go to stderr.
    """
    try:
        with contextlib.redirect_stdout(sys.stderr):
            yield
    except SystemExit:
        raise InputError(f"{label} ends the program with sys.exit; it must {duty}") from None
    except StrapgenError:
        raise
    except Exception as error:
        places = [(frame.filename, frame.lineno) for frame in traceback.extract_tb(error.__traceback__)]
        if isinstance(error, SyntaxError):
            places.append((error.filename or "", error.lineno))
        users = [(Path(file).name, line) for file, line in places if belongs(Path(file))]
        where = ""
        if users:
            file, line = users[-1]
            where = f", line {line}" if file in label else f", {file}, line {line}"
        said = error.msg if isinstance(error, SyntaxError) else " ".join(str(error).split())
        raise InputError(f"{label}{where}: {type(error).__name__}: {said}") from error


@contextlib.contextmanager
def importing_beside(file: Path) -> Iterator[None]:
    """Let a file import the modules beside it; forget them afterwards, since another file may have others of a name."""
    folder, known = str(file.resolve().parent), {*sys.modules}
    sys.path.insert(0, folder)
    try:
        yield
    finally:
        sys.path.remove(folder)
        for module in {*sys.modules} - known:
            origin = getattr(sys.modules[module], "__file__", None)
            if origin is not None and Path(origin).resolve().is_relative_to(folder):
                del sys.modules[module]
