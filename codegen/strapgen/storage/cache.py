"""The cache holds folders of generated and compiled files under a hash of everything that they depend on.

An entry is filled in a separate folder and then renamed into place. Two processes can therefore create the same entry
at once, and a process that is killed or fails leaves nothing that is ever read. Every entry holds the hashes of its
files, and a damaged one is created again.

What is in the cache runs. Nothing is taken from it that anybody but the user could have put there: the cache folder and
all below it must belong to the user and be writable by nobody else, see `ownership`. An entry for which this does not
hold is created again; where it does not hold for the folder, a temporary one takes its place.

The cache is part of the ground, and not of the library that fills most of it, because the catalogue needs it too: it
keeps the kernels of users' files here.
"""

from __future__ import annotations

import atexit
import hashlib
import json
import os
import secrets
import shutil
import stat
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TypeVar

from strapgen.ir.exceptions import InputError
from strapgen.ir.timing import LOGGER, from_cache
from strapgen.storage import drafts, ownership, resources
from strapgen.storage.ownership import ForeignFileError

_UNUSED_DAYS = 60
_MANIFEST = "manifest.json"
#: Beginning of the name of a folder in which an entry is filled, and of one that is to be removed.
_DRAFT, _REMOVED = ".filling-", ".removed-"
#: Beginning of the name of a folder that stands for a cache folder which others can write.
_TEMPORARY = "strapgen-cache-"
#: How often work is begun again whose entries others remove.
_TRIALS = 5
#: As many entries of a kind are filled before the folder is not looked through after every one.
_FEW = 16
#: The number of folders that are the user's alone: the cache folder, that of a kind, that of an entry.
_PRIVATE = 3

Result = TypeVar("Result")


def root() -> Path:
    """Return the cache folder: $STRAPGEN_CACHE_DIR, or `strapgen` in the user's cache folder.

    Raises
    ------
    InputError
        If the folder would be in the user's home folder, but there is none.
    """
    try:
        chosen = os.environ.get("STRAPGEN_CACHE_DIR")
        if chosen:
            return Path(chosen).expanduser().absolute()
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "strapgen"
    except RuntimeError:  # a user without a home folder, as in some containers
        raise InputError(
            "no home folder to keep the cache in; set STRAPGEN_CACHE_DIR to a folder that can be written"
        ) from None


def digest(parts: Iterable[str | bytes]) -> str:
    """Return a hash of a sequence of texts or bytes.

    Parameters
    ----------
    parts : iterable of str or bytes

    Returns
    -------
    str
        24 hexadecimal digits.
    """
    total = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        total.update(len(data).to_bytes(8, "big") + data)
    return total.hexdigest()[:24]


@cache
def generator_digest() -> str:
    """Return a hash of everything that determines generated code: this package, its templates, and SymPy's version."""
    return digest([version("sympy"), *(path.read_bytes() for path in resources.package_files())])


def lookup(kind: str, key: str) -> Path | None:
    """Return the folder of a cache entry; None if there is none, if it is damaged, or if it is not the user's alone.

    Parameters
    ----------
    kind, key : str
        As for `entry`.
    """
    place = _folder(create=False) / kind / key
    if (
        place.parent not in _tidied
    ):  # once, since another process may have made the entry that a killed one began
        _tidied.add(place.parent)
        _tidy(place.parent)
    return place if _is_whole(place) else None


def discard(kind: str, key: str) -> None:
    """Remove a cache entry whose content no longer holds."""
    shutil.rmtree(_folder(create=False) / kind / key, ignore_errors=True)


def entry(kind: str, key: str, fill: Callable[[Path], None], what: str = "") -> Path:
    """Return the folder of a cache entry; if there is none, create it by `fill`.

    Parameters
    ----------
    kind : str
        Kind of entry, which is the name of a folder in the cache.
    key : str
        Hash of everything that the content depends on.
    fill : callable
        ``fill(folder)`` writes the files of the entry into an empty folder.
    what : str, optional
        What the entry holds, for the log: a line says that it comes from the cache, if it does.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If the cache folder cannot be written.
    """
    if (there := lookup(kind, key)) is not None:
        if what:
            from_cache(what)
        return there
    for _ in range(_TRIALS):  # another process, whose clock may be wrong, can remove it again
        place = _filled(kind, key, fill)
        if _is_whole(place):
            _prune(place.parent)
            return place
    raise InputError(f"cache entry {place} cannot be made; remove it")


def _filled(kind: str, key: str, fill: Callable[[Path], None]) -> Path:
    """Fill an entry beside its place, and rename it there."""
    with ExitStack() as stack:
        try:
            place = _folder(create=True) / kind / key
            _make_way(place)
            draft = stack.enter_context(drafts.draft_folder(place.parent, _DRAFT))
        except OSError as error:
            raise InputError(
                f"cache folder {root()} cannot be written ({error.strerror}); set STRAPGEN_CACHE_DIR to one that can"
            ) from None
        try:
            fill(draft)
            (draft / _MANIFEST).write_text(json.dumps(_hashes(draft)))
            _protect(draft)
            with suppress(OSError):  # another process was first: its entry is the same
                draft.rename(place)
        except OSError as error:
            raise InputError(f"cache folder {root()} cannot be written ({error.strerror})") from error
    return place


def persistently(work: Callable[[], Result]) -> Result:
    """Return what some work with entries returns; begin it again if another process removes one meanwhile.

    A clock that was set wrong makes entries look as if nobody had used them for long.

    Parameters
    ----------
    work : callable
        It gets its entries by `entry` or `lookup`.
    """
    for _ in range(_TRIALS - 1):
        with suppress(FileNotFoundError):
            return work()
    return work()


def read(place: Path, name: str) -> bytes:
    """Return the content of a file of an entry.

    Parameters
    ----------
    place : Path
        The folder of the entry, from `entry` or `lookup`.
    name : str

    Raises
    ------
    OSError
        If it cannot be read, or is not the user's alone.
    """
    with ownership.private_folder(place, _PRIVATE) as folder:
        return folder.read(name)


@contextmanager
def loadable(file: Path) -> Iterator[tuple[str, int]]:
    """Open a file of an entry for what loads it by a path.

    Parameters
    ----------
    file : Path
        Below the folder of the entry.

    Yields
    ------
    str
        A path to the very file that was checked, wherever the system has one.
    int
        The descriptor of the file, which the path needs in a process that is started.

    Raises
    ------
    OSError
        If it cannot be read, or is not the user's alone.
    """
    with ownership.private_folder(file.parent, _PRIVATE) as folder, folder.opened(file.name) as descriptor:
        yield ownership.path_of(descriptor, file), descriptor


def _folder(create: bool) -> Path:
    """Return the cache folder without links, or the temporary one in its place."""
    nominal = root()
    place = nominal.resolve()
    if place in _replaced and _replaced[place].is_dir():
        return _replaced[place]
    if not create and place in _private:  # every entry is checked from the root of the file system down
        return place
    try:
        if create:
            _make_private(place)
        with ownership.private_folder(place):
            _private.add(place)
    except ForeignFileError as error:
        _replaced[place] = _temporary(nominal, error.reason)
        return _replaced[place]
    except OSError:  # there is none, or it cannot be opened: then neither can its entries
        if create:
            raise
    return place


#: Temporary folders by the cache folders that they stand for; a process that is forked uses them too.
_replaced: dict[Path, Path] = {}
#: Cache folders that were the user's alone when they were looked at first.
_private: set[Path] = set()
#: How many entries this process has filled in the folder of a kind.
_filled_here: Counter[Path] = Counter()
#: Folders of a kind in which this process has looked for what others have left.
_tidied: set[Path] = set()


def _temporary(nominal: Path, reason: str) -> Path:
    """Return a folder in place of the cache folder until the process ends, and say so."""
    parent = Path(tempfile.gettempdir()).resolve()
    for gone in drafts.forgotten(parent, _TEMPORARY):
        shutil.rmtree(gone, ignore_errors=True)
    folder = drafts.draft_folder(parent, _TEMPORARY)
    try:
        place = folder.__enter__()
        with ownership.private_folder(place):
            pass
    except OSError as error:
        raise InputError(
            f"cache folder {nominal} is not used, since {reason}; nor is a temporary one ({error.strerror})"
        ) from None
    atexit.register(folder.__exit__, None, None, None)
    LOGGER.warning(
        "strapgen: cache folder %s is not used, since %s; what is generated lasts until the program ends",
        nominal,
        reason,
    )
    return place


def _make_private(place: Path) -> None:
    """Make a folder and those above it that are missing, for the user alone."""
    missing = [folder for folder in (place, *place.parents) if not folder.exists()]
    for folder in reversed(missing):
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
    place.mkdir(exist_ok=True)  # says what is wrong with what stands there


def _make_way(place: Path) -> None:
    """Make the folder of a kind, and remove what stands in the place of an entry and is none."""
    try:
        _make_private(place.parent)
        with ownership.private_folder(place.parent, _PRIVATE - 1):
            pass
    except (ForeignFileError, FileExistsError, NotADirectoryError):
        _remove(place.parent)
        _make_private(place.parent)
    if os.path.lexists(place) and not _is_whole(
        place
    ):  # looked at again: another process may have been first
        _remove(place)


def _remove(place: Path) -> None:
    """Remove a folder or a file; what others have in it may stay, under another name."""
    removed = place.with_name(f"{_REMOVED}{secrets.token_hex(4)}")
    with suppress(FileNotFoundError):
        place.rename(removed)
        if removed.is_dir() and not removed.is_symlink():
            shutil.rmtree(removed, ignore_errors=True)
        else:
            removed.unlink()


def _protect(folder: Path) -> None:
    """Let nobody but the user write the files of an entry, whatever the umask."""
    for path in folder.iterdir():
        path.chmod(stat.S_IMODE(path.stat().st_mode) & ~0o022)


def _hashes(folder: Path) -> dict[str, str]:
    return {
        path.name: digest([path.read_bytes()]) for path in sorted(folder.iterdir()) if path.name != _MANIFEST
    }


def _is_whole(place: Path) -> bool:
    """Return whether an entry is there, the user's alone and undamaged; one that is others' is told of."""
    try:
        with ownership.private_folder(place, _PRIVATE) as folder:
            manifest = json.loads(folder.read(_MANIFEST))
            hashes = {name: digest([folder.read(name)]) for name in folder.names() if name != _MANIFEST}
            if manifest != hashes:
                return False
            with suppress(OSError):
                folder.touch()  # in use: not to be pruned
            return True
    except ForeignFileError as error:
        _warn(error.reason)
        return False
    except (OSError, ValueError):
        return False


@cache
def _warn(reason: str) -> None:
    """Say once that an entry is not used."""
    LOGGER.warning("strapgen: %s: it is not used, and made again", reason)


def _prune(folder: Path) -> None:
    """Remove entries that have not been used for long, and what processes that are gone have left.

    A process that fills many entries looks through them now and then.
    """
    _filled_here[folder] += 1
    if _filled_here[folder] > _FEW and _filled_here[folder] % _FEW:
        return
    _tidy(folder)
    oldest = time.time() - _UNUSED_DAYS * 86400
    with os.scandir(folder) as places:
        for place in places:
            with suppress(OSError):
                if place.name.startswith(_REMOVED) or (
                    not place.name.startswith(_DRAFT) and place.stat().st_mtime < oldest
                ):
                    shutil.rmtree(place.path, ignore_errors=True)


def _tidy(folder: Path) -> None:
    """Remove the drafts of processes that are gone."""
    for gone in drafts.forgotten(folder, _DRAFT):
        shutil.rmtree(gone, ignore_errors=True)
