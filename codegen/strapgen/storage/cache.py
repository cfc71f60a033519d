"""The cache holds folders of generated and compiled files under a hash of everything that they depend on.

An entry is filled in a separate folder and then renamed into place. Two processes can therefore create the same entry
at once, and a process that is killed or fails leaves nothing that is ever read. Every entry holds the hashes of its
files, and a damaged one is created again.

What is in the cache runs. Nothing is taken from it that anybody but the user could have put there: the cache folder and
all below it must belong to the user and be writable by nobody else, see `ownership`. An entry for which this does not
hold is created again; where it does not hold for the folder, a temporary one takes its place.
"""

from __future__ import annotations

import atexit
import hashlib
import inspect
import json
import os
import pickle
import secrets
import shutil
import stat
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, wraps
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from strapgen.ir.exceptions import InputError
from strapgen.ir.timing import LOGGER, from_cache
from strapgen.storage import drafts, ownership, resources
from strapgen.storage.ownership import ForeignFileError

_UNUSED_DAYS = 60
_MANIFEST = "manifest.json"
#: The file of an entry that holds the result of some work.
_RESULT = "result.pickle"
#: Beginning of the name of a folder in which an entry is filled, of one that is to be removed, and of one that stands
#: for a cache folder which others can write.
_DRAFT, _REMOVED, _TEMPORARY = ".filling-", ".removed-", "strapgen-cache-"
#: How often work is begun again whose entries others remove.
_TRIALS = 5
#: The number of folders that are the user's alone: the cache folder, that of a kind, that of an entry.
_PRIVATE = 3

#: Temporary folders by the cache folders that they stand for; a process that is forked uses them too.
_replaced: dict[Path, Path] = {}
#: Folders of a kind in which this process has looked for what others have left.
_tidied: set[Path] = set()

Result = TypeVar("Result")


def root() -> Path:
    """Return the cache folder: $STRAPGEN_CACHE_DIR, or the place for caches of the user on this system."""
    try:
        if chosen := os.environ.get("STRAPGEN_CACHE_DIR"):
            return Path(chosen).expanduser().absolute()
        from platformdirs import user_cache_path  # here, since most have chosen a folder or need none

        return user_cache_path("strapgen", appauthor=False).expanduser().absolute()
    except RuntimeError:  # a user without a home folder, as in some containers
        raise InputError(
            "no home folder to keep the cache in; set STRAPGEN_CACHE_DIR to a folder that can be written"
        ) from None


def digest(parts: Iterable[str | bytes]) -> str:
    """Return a hash of a sequence of texts or bytes, 24 hexadecimal digits."""
    total = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        total.update(len(data).to_bytes(8, "big") + data)
    return total.hexdigest()[:24]


@cache
def generator_digest() -> str:
    """Return a hash of everything that determines generated code: this package, its templates, and SymPy's version."""
    return digest([_release_of_sympy(), *(path.read_bytes() for path in resources.package_files())])


def _release_of_sympy() -> bytes:
    """Return the file in which SymPy states its version; what reads the descriptions of packages imports much."""
    spec = PathFinder.find_spec("sympy")
    if spec is not None and spec.origin is not None:
        with suppress(OSError):
            return Path(spec.origin).with_name("release.py").read_bytes()
    from importlib.metadata import version

    return version("sympy").encode()


def stored(kind: str, parts: Iterable[str | bytes], work: Callable[[], Result], what: str = "") -> Result:
    """Return the result of some work, from the cache if it is there; see `entry`.

    It can be pickled, and depends on this package and the parts of its key alone.
    """
    key = digest([generator_digest(), *parts])
    with suppress(FileNotFoundError):  # another process has removed it meanwhile
        if (place := lookup(kind, key)) is not None:
            known: Result = pickle.loads(read(place, _RESULT))
            if what:
                from_cache(what)
            return known
    result = work()

    def fill(draft: Path) -> None:
        (draft / _RESULT).write_bytes(pickle.dumps(result))

    entry(kind, key, fill)
    return result


def lookup(kind: str, key: str) -> Path | None:
    """Return the folder of an entry; None if there is none, if it is damaged, or if it is not the user's alone."""
    place = _folder(create=False) / kind / key
    if place.parent not in _tidied:  # once: another process may have made the entry that a killed one began
        _tidied.add(place.parent)
        drafts.remove_forgotten(place.parent, _DRAFT)
    return place if _is_whole(place) else None


def discard(kind: str, key: str) -> None:
    """Remove an entry whose content no longer holds."""
    shutil.rmtree(_folder(create=False) / kind / key, ignore_errors=True)


def entry(kind: str, key: str, fill: Callable[[Path], None], what: str = "") -> Path:
    """Return the folder of an entry; if there is none, create it by `fill`, which writes files into an empty folder.

    The name of the kind is that of a folder in the cache, the key a hash of all that the content depends on. The log
    says of `what` that it comes from the cache, if it does.
    """
    if (there := lookup(kind, key)) is not None:
        if what:
            from_cache(what)
        return there
    for _ in range(_TRIALS):  # another process, whose clock may be wrong, can remove it again
        place = _fill(kind, key, fill)
        if _is_whole(place):
            _prune(place.parent)
            return place
    raise InputError(f"cache entry {place} cannot be made; remove it")


def _fill(kind: str, key: str, fill: Callable[[Path], None]) -> Path:
    """Fill an entry beside its place, and rename it there."""
    advice = "; set STRAPGEN_CACHE_DIR to one that can"
    try:
        place = _folder(create=True) / kind / key
        _make_way(place)
        with drafts.draft_folder(place.parent, _DRAFT) as draft:
            advice = ""
            fill(draft)
            (draft / _MANIFEST).write_text(json.dumps(_hashes(draft)), encoding="utf-8", newline="\n")
            for path in draft.iterdir():  # the user's alone, whatever the umask
                path.chmod(stat.S_IMODE(path.stat().st_mode) & ~0o022)
            with suppress(OSError):  # another process was first: its entry is the same
                draft.rename(place)
    except OSError as error:
        raise InputError(
            f"cache folder {root()} cannot be written ({error.strerror or error}){advice}"
        ) from error
    return place


def persistently(work: Callable[[], Result]) -> Result:
    """Return the result of work with entries; repeat it if another process removes one meanwhile.

    A clock that was set wrong makes entries look as if nobody had used them for long.
    """
    for _ in range(_TRIALS - 1):
        with suppress(FileNotFoundError):
            return work()
    return work()


def read(place: Path, name: str) -> bytes:
    """Return the content of a file in the folder of an entry; an OSError if it is not the user's alone."""
    with ownership.private_folder(place, _PRIVATE) as folder:
        return folder.read(name)


@contextmanager
def loadable(file: Path) -> Iterator[tuple[str, int]]:
    """Open a file of an entry for what loads it by a path; an OSError if it is not the user's alone.

    Yields a path to the very file that was checked, wherever the system has one, and its descriptor, which the path
    needs in a process that is started.
    """
    with ownership.private_folder(file.parent, _PRIVATE) as folder, folder.opened(file.name) as descriptor:
        yield ownership.path_of(descriptor, file), descriptor


def _folder(create: bool) -> Path:
    """Return the cache folder without links, or the temporary one in its place."""
    nominal = root()
    place = nominal.resolve()
    if place in _replaced and _replaced[place].is_dir():
        return _replaced[place]
    try:
        if create:
            _make_private(place)
        with ownership.private_folder(place):
            return place
    except ForeignFileError as error:
        _replaced[place] = _temporary(nominal, error.reason)
        return _replaced[place]
    except OSError:  # there is none, or it cannot be opened: then neither can its entries
        if create:
            raise
        return place


def _temporary(nominal: Path, reason: str) -> Path:
    """Return a folder in place of the cache folder until the process ends, and say so."""
    parent = Path(tempfile.gettempdir()).resolve()
    drafts.remove_forgotten(parent, _TEMPORARY)
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
    lasts = "what is generated lasts until the program ends"
    LOGGER.warning("strapgen: cache folder %s is not used, since %s; %s", nominal, reason, lasts)
    return place


def _make_private(place: Path) -> None:
    """Make a folder and those above it that are missing, for the user alone."""
    for folder in reversed((place, *place.parents)):
        if not folder.is_dir():
            folder.mkdir(mode=0o700, exist_ok=True)


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


def _hashes(folder: Path) -> dict[str, str]:
    return {path.name: digest([path.read_bytes()]) for path in folder.iterdir() if path.name != _MANIFEST}


def _is_whole(place: Path) -> bool:
    """Return whether an entry exists, undamaged and owned by the user; warn of one with another owner."""
    try:
        with ownership.private_folder(place, _PRIVATE) as folder:
            hashes = {name: digest([folder.read(name)]) for name in folder.names() if name != _MANIFEST}
            if json.loads(folder.read(_MANIFEST)) != hashes:
                return False
            with suppress(OSError):
                folder.touch()  # in use: not to be pruned
            return True
    except ForeignFileError as error:
        _warn(error.reason)
    except (OSError, ValueError):
        pass
    return False


@cache
def _warn(reason: str) -> None:
    """Say once that an entry is not used."""
    LOGGER.warning("strapgen: %s: it is not used, and made again", reason)


def _prune(folder: Path) -> None:
    """Remove entries that have not been used for long, and what processes that are gone have left."""
    drafts.remove_forgotten(folder, _DRAFT)
    oldest = time.time() - _UNUSED_DAYS * 86400
    with os.scandir(folder) as places:
        for place in places:
            with suppress(OSError):
                is_old = not place.name.startswith(_DRAFT) and place.stat().st_mtime < oldest
                if is_old or place.name.startswith(_REMOVED):
                    shutil.rmtree(place.path, ignore_errors=True)


# Results of stages, in memory too

P = ParamSpec("P")
R = TypeVar("R")

#: What this process has had last, by the folder of the cache and all that it depends on.
_results: dict[tuple[Any, ...], Any] = {}
#: So many results are remembered; one takes some ten kilobytes.
_MOST_RESULTS = 512


def cached(
    kind: str, label: str, *, depends: Callable[..., str] = lambda *_: ""
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator that caches the results of a stage, whose first argument is a choice.

    The key of an entry is the generator itself, its code and templates, with the `identity` of each argument, or its
    text: after a change of either, the stage runs again, and what runs agrees with the derivation.

    `kind` is the folder of the entries in the cache, and `label` the format of the log's words for a result from the
    arguments, such as "program of {0.kernel}". `depends`, of the arguments behind the choice, refuses what does not go
    together, and returns what else the result depends on. All calls share a result, which cannot be written.
    """

    def decorate(stage: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(stage)

        @wraps(stage)
        def recall(*args: P.args, **kwargs: P.kwargs) -> R:
            bound = signature.bind(*args, **kwargs)
            bound.apply_defaults()
            parts = [str(getattr(argument, "identity", argument)) for argument in bound.args]
            parts.append(depends(*bound.args[1:]))
            what = label.format(*bound.args)
            result: R = _load(kind, parts, what, lambda: stage(*args, **kwargs))
            return result

        return recall

    return decorate


def _load(kind: str, parts: list[str], what: str, work: Callable[[], Any]) -> Any:
    """Return a result, which a process checks and reads once; the log has every use."""
    place = root(), kind, generator_digest(), *parts
    result = _results.pop(place, None)
    if result is None:
        result = stored(kind, parts, work, what)
    else:
        from_cache(what)
    _results[place] = result  # the last one now
    if len(_results) > _MOST_RESULTS:
        oldest, *_ = tuple(_results)  # at once, as other threads may add some
        _results.pop(oldest, None)
    return result
