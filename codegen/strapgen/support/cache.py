"""The cache holds folders of generated and compiled files under a hash of everything that they depend on.

An entry is filled in a separate folder and then renamed into place. Two processes can therefore create the same entry
at once, and a process that is killed or fails leaves nothing that is ever read. Every entry holds the hashes of its
files, and a damaged one is created again.

The cache is part of the ground, and not of the library that fills most of it, because the catalogue needs it too: it
keeps the kernels of users' files here.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterable
from functools import cache
from importlib.metadata import version
from pathlib import Path

from strapgen.support import resources
from strapgen.support.exceptions import InputError
from strapgen.support.timing import from_cache

_UNUSED_DAYS = 60
_MANIFEST = "manifest.json"


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
    """Return the folder of a cache entry; None if there is none, or if it is damaged.

    Parameters
    ----------
    kind, key : str
        As for `entry`.
    """
    place = root() / kind / key
    if not _is_whole(place):
        return None
    with contextlib.suppress(OSError):
        os.utime(place)  # in use: not to be pruned
    return place


def discard(kind: str, key: str) -> None:
    """Remove a cache entry whose content no longer holds."""
    shutil.rmtree(root() / kind / key, ignore_errors=True)


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
    place = root() / kind / key
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        if place.is_dir():
            if not _is_whole(place):  # looked at again: another process may have been first
                shutil.rmtree(place, ignore_errors=True)
        elif place.exists():
            place.unlink()
        draft = Path(tempfile.mkdtemp(prefix=".draft-", dir=place.parent))
    except OSError as error:
        raise InputError(
            f"cache folder {root()} cannot be written ({error.strerror}); set STRAPGEN_CACHE_DIR to one that can"
        ) from None
    try:
        fill(draft)
        (draft / _MANIFEST).write_text(json.dumps(_hashes(draft)))
        with contextlib.suppress(OSError):  # another process was first: its entry is the same
            draft.rename(place)
        if not _is_whole(place):
            raise InputError(f"cache entry {place} cannot be made; remove it")
    except OSError as error:
        raise InputError(f"cache folder {root()} cannot be written ({error.strerror})") from error
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    _prune(place.parent)
    return place


def _hashes(folder: Path) -> dict[str, str]:
    return {
        path.name: digest([path.read_bytes()]) for path in sorted(folder.iterdir()) if path.name != _MANIFEST
    }


def _is_whole(place: Path) -> bool:
    try:
        return bool(json.loads((place / _MANIFEST).read_text()) == _hashes(place))
    except (OSError, ValueError):
        return False


def _prune(folder: Path) -> None:
    """Remove entries that have not been used for long, and drafts of processes that were killed."""
    oldest = time.time() - _UNUSED_DAYS * 86400
    for path in folder.iterdir():
        with contextlib.suppress(OSError):
            age_limit = time.time() - 3600 if path.name.startswith(".draft-") else oldest
            if path.stat().st_mtime < age_limit:
                shutil.rmtree(path, ignore_errors=True)
