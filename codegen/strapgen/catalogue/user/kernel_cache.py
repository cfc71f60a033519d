"""Cache of users' kernels: one is derived again only if its file, a file that it reads, or an option changes."""

from __future__ import annotations

import contextlib
import json
import pickle
import sys
from collections.abc import Callable
from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strapgen.catalogue.user.isolation import Record, installed_folders
from strapgen.catalogue.user_kernel import UserKernel, packed
from strapgen.ir.exceptions import InputError
from strapgen.ir.timing import from_cache, timed
from strapgen.storage import cache

if TYPE_CHECKING:
    from strapgen.kernel.kernel import Kernel

_KIND = "kernels"
_KERNEL, _HEAD, _RECORD = "kernel.pickle", "head.pickle", "record.json"


def kernel(what: list[str], folder: Path | None, derive: Callable[[], tuple[Kernel, Record]]) -> UserKernel:
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
    data = None if record.outside or not record.holds(folder) else _pickled(derived)
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
        return UserKernel(pickle.loads(head), lambda: _restored(data, derive))
    except Exception:  # of another Python, or removed meanwhile: derived again
        return None


def _restored(data: bytes, derive: Callable[[], tuple[Kernel, Record]]) -> Kernel:
    try:
        stored: Kernel = pickle.loads(data)
    except Exception:  # of another SymPy: derived again
        stored, _ = derive()
    return stored


def _store(key: str, data: bytes, head: bytes | None, record: Record) -> None:
    def fill(draft: Path) -> None:
        (draft / _KERNEL).write_bytes(data)
        (draft / _HEAD).write_bytes(head or b"")
        (draft / _RECORD).write_text(json.dumps(asdict(record)))

    cache.discard(_KIND, key)
    cache.entry(_KIND, key, fill)


def _pickled(derived: Kernel) -> bytes | None:
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
