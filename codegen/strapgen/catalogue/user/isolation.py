"""Isolation of users' code: it runs as if in a separate process, and every file that it reads is recorded.

Modules that belong to no installed package are imported again from source for every file, and afterwards the program's
modules are restored. So a user's file never sees a module that lies beside another user's file.
"""

from __future__ import annotations

import importlib.util
import os
import site
import stat
import sys
import sysconfig
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from importlib.machinery import ExtensionFileLoader, ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any
from weakref import WeakKeyDictionary

from strapgen.storage.cache import digest
from strapgen.storage.resources import PACKAGE

#: Audit events beyond reading a file. The files read cannot tell whether a kernel that depends on one has changed.
_OUTSIDE = {
    "ctypes.dlsym": "calls a compiled library",
    "os.listdir": "lists a folder",
    "os.scandir": "lists a folder",
    "os.exec": "starts a program",
    "os.fork": "starts a process",
    "os.forkpty": "starts a process",
    "os.posix_spawn": "starts a program",
    "os.system": "starts a program",
    "subprocess.Popen": "starts a program",
    "socket.connect": "asks the network",
    "socket.getaddrinfo": "asks the network",
    "sqlite3.connect": "asks a database",
    "urllib.Request": "asks the network",
}
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_ONE_AT_A_TIME = threading.RLock()


@dataclass
class Record:
    """The files and modules that a user's code read, by which a cached kernel is found to be out of date."""

    #: Digest of every file by its path, "" if the file was missing. Files of Python, of installed packages and of
    #: strapgen are left out, because their versions are part of the cache's key.
    files: dict[str, str] = field(default_factory=dict)
    #: File of every module that was searched on the path, "" if there was none.
    modules: dict[str, str] = field(default_factory=dict)
    #: Folders that the code put on Python's path.
    path: list[str] = field(default_factory=list)
    #: Another thing that the kernel may depend on, such as a program that ran; "" if there is none.
    outside: str = ""

    def read(self, path: str) -> None:
        """Record a file with its digest."""
        if Path(path).exists() and not Path(path).is_file():  # a device or a pipe
            self.outside = f"reads {path}, which is no file"
            return
        try:
            self.files.setdefault(path, content(path))
        except OSError as error:
            self.outside = f"reads {path}: {error.strerror}"

    def holds(self, folder: Path | None) -> bool:
        """Return whether every file and module is unchanged."""
        try:
            if any(content(path) != before for path, before in self.files.items()):
                return False
        except OSError:
            return False
        importlib.invalidate_caches()
        search = [*([str(folder)] if folder else []), *self.path, *sys.path]
        return all(_origin(PathFinder.find_spec(name, search)) == at for name, at in self.modules.items())


def content(path: str) -> str:
    """Return the digest of a file, "" if there is none."""
    try:
        return digest([Path(path).read_bytes()])
    except FileNotFoundError:
        return ""


def _folders(paths: Iterable[str]) -> tuple[str, ...]:
    """Return the prefixes of all paths in folders, with links resolved and not."""
    return tuple(
        f"{place}{os.sep}" for path in paths for place in dict.fromkeys((path, os.path.realpath(path)))
    )


@cache
def _roots() -> tuple[str, ...]:
    """Return the folders of Python, of installed packages and of strapgen."""
    paths = sysconfig.get_paths()
    return _folders((paths["stdlib"], paths["platstdlib"], *installed_folders(), str(PACKAGE)))


def installed_folders() -> list[str]:
    """Return the folders of installed packages."""
    paths = sysconfig.get_paths()
    folders = [paths["purelib"], paths["platlib"], *site.getsitepackages(), site.getusersitepackages()]
    return sorted({os.path.realpath(path) for path in folders})


def _origin(spec: ModuleSpec | None) -> str:
    return "" if spec is None else spec.origin or str(list(spec.submodule_search_locations or ()))


def _is_installed(path: str) -> bool:
    return path.startswith(_roots()) or os.path.realpath(path).startswith(_roots())


#: The places of modules with whether they belong to an installed package: a module stays where it was loaded from.
_places: WeakKeyDictionary[ModuleType, tuple[str, bool]] = WeakKeyDictionary()


def _place(module: ModuleType | None) -> tuple[str, bool]:
    """Return the file or folder of a module, "" for a built-in one, and whether it belongs to an installed package."""
    if type(module) is not ModuleType:  # it may answer anything, and differently each time
        place = _file_or_folder(module)
        return place, _is_installed(place)
    if module not in _places:
        place = _file_or_folder(module)
        _places[module] = place, _is_installed(place)
    return _places[module]


def _file_or_folder(module: ModuleType | None) -> str:
    file = getattr(module, "__file__", None)
    if file:
        return str(file)
    try:
        return str(next(iter(getattr(module, "__path__", ())), ""))
    except (KeyError, TypeError):  # a namespace package whose parent is gone
        return ""


class _Loader(SourceFileLoader):
    """Loads a module from its source; bytecode can be out of date when a file is edited twice in a second."""

    def __init__(self, name: str, path: str, record: Record) -> None:
        super().__init__(name, path)
        self._record = record

    def get_code(self, fullname: str) -> CodeType:
        """Compile the source and record its digest."""
        source = self.get_data(self.path)
        self._record.files[os.path.realpath(self.path)] = digest([source])
        code: CodeType = self.source_to_code(source, self.path)
        return code


class _Finder:
    """Finds and records modules; those of no installed package are loaded from source."""

    def __init__(self, record: Record, anew: tuple[str, ...]) -> None:
        self._record = record
        self._anew = anew

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        """Find a module, as importlib asks."""
        spec = PathFinder.find_spec(name, path, target)
        if path is None:
            self._record.modules[name] = _origin(spec)
        if spec is None or type(spec.loader) is not SourceFileLoader or not spec.origin:
            return spec
        if name.partition(".")[0] in self._anew or not _is_installed(spec.origin):
            spec.loader = _Loader(name, spec.origin, self._record)
        return spec


#: Records of the sessions that run, the last one at the end; None while strapgen itself reads a file.
_watching: list[Record | None] = []


def _watch(event: str, arguments: tuple[Any, ...]) -> None:
    """Record files, programs and network access of a user's code from Python's audit events."""
    if not _watching or (event != "open" and event not in _OUTSIDE):
        return
    if sys._getframe(1).f_code.co_filename.startswith("<frozen importlib"):
        return  # what is imported is noted by the loader
    record = _watching[-1]
    if record is None:
        return
    if event != "open":
        record.outside = _OUTSIDE[event]
        return
    path, _, flags = arguments
    if isinstance(path, int):
        # `multiprocessing` starts a process without an event, and writes to it by a pipe.
        if not stat.S_ISREG(os.fstat(path).st_mode):
            record.outside = "asks another process, by a pipe"
        return
    place = os.path.realpath(os.fsdecode(path))
    if place.startswith(_roots()):
        return
    if isinstance(flags, int) and flags & _WRITING:
        record.outside = f"writes {place}"
    elif place not in record.files:
        _watching.append(None)
        try:
            record.read(place)
        finally:
            _watching.pop()


@cache
def _begin_watching() -> None:
    """Install `_watch` as an audit hook, which Python cannot remove while the process lives."""
    sys.addaudithook(_watch)


def depends_on(what: str) -> None:
    """Record that the user's code that runs, if any, depends on more than the files it reads."""
    record = _watching[-1] if _watching else None
    if record is not None:
        record.outside = what


def load_source(path: Path, name: str, record: Record) -> ModuleType:
    """Run a file as a module, which is in `sys.modules` until the session ends."""
    spec = importlib.util.spec_from_file_location(name, path, loader=_Loader(name, str(path), record))
    assert spec is not None and spec.loader is not None, "it has the loader that it was given"
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


@contextmanager
def session(folder: Path | None = None, anew: tuple[str, ...] = ()) -> Iterator[Record]:
    """Isolate the user's code in the block, one block at a time; the record is complete after the block.

    What lies in `folder` can be imported; the installed packages `anew` are imported again, as they are the user's.
    """
    with _ONE_AT_A_TIME:
        record = Record()
        _begin_watching()
        path, before = list(sys.path), dict(sys.modules)
        for name in _removable(before, anew, record):
            del sys.modules[name]
        finder = _Finder(record, anew)
        sys.meta_path.insert(_place_of_path_finder(), finder)
        sys.path[:0] = [] if folder is None else [str(folder)]
        importlib.invalidate_caches()
        _watching.append(record)
        try:
            yield record
        finally:
            _watching.pop()
            record.path = [entry for entry in sys.path if entry not in (*path, str(folder))]
            sys.path[:] = path
            sys.meta_path.remove(finder)
            _put_back(before, anew, record)


def _place_of_path_finder() -> int:
    return sys.meta_path.index(PathFinder) if PathFinder in sys.meta_path else len(sys.meta_path)


def _is_compiled(module: ModuleType | None) -> bool:
    return isinstance(getattr(module, "__loader__", None), ExtensionFileLoader)


def _is_users(name: str, module: ModuleType | None, anew: tuple[str, ...]) -> bool:
    top = name.partition(".")[0]
    if top in ("strapgen", "__main__", "__mp_main__") or (
        name.startswith("strapgen_") and _is_compiled(module)
    ):
        return False  # the last ones are generated C
    place, is_installed = _place(module)
    return bool(place) and (top in anew or not is_installed)


def _removable(modules: dict[str, ModuleType], anew: tuple[str, ...], record: Record) -> list[str]:
    """Return the modules of no installed package, except packages with compiled modules, which cannot load twice."""
    users = [name for name, module in modules.items() if _is_users(name, module, anew)]
    compiled = {name.partition(".")[0] for name in users if _is_compiled(modules[name])}
    if compiled:
        record.outside = f"may import {', '.join(sorted(compiled))}, which is compiled and loaded already"
    return [name for name in users if name.partition(".")[0] not in compiled]


def _put_back(before: dict[str, ModuleType], anew: tuple[str, ...], record: Record) -> None:
    """Record the modules that were imported, remove the user's, and restore those from before the session."""
    for name, module in list(sys.modules.items()):
        if before.get(name) is module:
            continue
        place, _ = _place(module)
        if place and not Path(place).exists():
            record.outside = f"imports {name} from an archive"
        if _is_users(name, module, anew):  # versions tell of all others
            if Path(place).is_file():
                record.read(os.path.realpath(place))
            del sys.modules[name]
    for name, module in before.items():
        sys.modules.setdefault(name, module)
