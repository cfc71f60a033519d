"""Writes files all together or not at all, and never half of one.

The files are first written in full into a hidden folder beside their places, and then renamed into these one by one, in
order. A process that is killed leaves that folder; the next one that writes there removes it. The caller puts last what
tells of the others.
"""

from __future__ import annotations

import errno
import os
import re
import stat
from collections.abc import Iterable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path

from strapgen.ir.exceptions import InputError
from strapgen.storage import drafts

#: Beginning of the name of the hidden folder.
STAGING = ".strapgen-draft-"
#: Flags of a file that must not be there yet.
_NEW = os.O_CREAT | os.O_EXCL | os.O_WRONLY | getattr(os, "O_BINARY", 0)


def write_files(folder: str | Path, files: Mapping[str, str | bytes]) -> list[Path]:
    """Write files, by names that may have folders in them, and return their paths; if one cannot be, change none.

    A file that exists keeps its permissions; a new one has those that the umask leaves.
    """
    folder = Path(folder)
    places = [folder / name for name in files]
    writing = folder
    added: list[Path] = []
    try:
        with ExitStack() as stack:
            resolved = []
            for nominal in places:
                writing = nominal.parent
                _make_folder(nominal.parent, added)
                resolved.append(_place(nominal))
            homes = [_home(place, folder.resolve()) for place in resolved]
            _tidy({*homes, *(place.parent for place in resolved)})
            staging = {home: stack.enter_context(drafts.draft_folder(home, STAGING)) for home in {*homes}}
            whole = []
            for number, (place, content) in enumerate(zip(resolved, files.values(), strict=True)):
                writing = places[number].parent
                draft = staging[homes[number]] / str(number)
                # The system applies the umask to a new file; that of an existing one is private until it has its mode.
                handle = os.open(draft, _NEW, 0o600 if place.exists() else 0o666)
                with os.fdopen(handle, "wb") as file:
                    file.write(content.encode() if isinstance(content, str) else content)
                whole.append((draft, place))
            _put_in_place(whole)
        added.clear()
    except (FileExistsError, NotADirectoryError):
        raise InputError(
            f"{writing} cannot be written: it is a file, or lies below one; a folder is needed"
        ) from None
    except OSError as error:
        raise InputError(f"{writing} cannot be written ({error.strerror})") from None
    finally:
        for empty in reversed(added):
            with suppress(OSError):
                empty.rmdir()
    return places


def write_file(path: str | Path, content: str | bytes) -> Path:
    """Write one file; see `write_files`."""
    path = Path(path)
    return write_files(path.parent, {path.name: content})[0]


def is_staged(path: Path) -> bool:
    """Return whether a path leads into the hidden folder of a process that writes files, or was killed doing so."""
    return any(re.fullmatch(re.escape(STAGING) + "[0-9a-f]{8}", part) for part in path.parts)


def check_folder(folder: str | Path) -> None:
    """Check that files can be written into a folder, before the work that makes them; nothing is created."""
    folder = Path(folder)
    for place in (folder, *folder.absolute().parents):
        try:
            is_folder, is_open = stat.S_ISDIR(place.stat().st_mode), os.access(place, os.W_OK)
            number = errno.ENOTDIR if not is_folder else 0 if is_open else errno.EACCES
        except FileNotFoundError:
            continue
        except OSError as error:
            number = error.errno or errno.EACCES
        if number:
            raise InputError(f"{folder} cannot be written ({os.strerror(number)})")
        return


def _make_folder(folder: Path, added: list[Path]) -> None:
    """Make a folder and those above it that are missing, and add these to a list."""
    for place in reversed((folder, *folder.parents)):
        if not place.exists():
            with suppress(FileExistsError):
                place.mkdir()
                added.append(place)
    folder.mkdir(exist_ok=True)  # says what is wrong with what stands there


def _place(nominal: Path) -> Path:
    """Return where a file is written: a link stays, what it points to is written."""
    if nominal.is_dir():
        raise InputError(f"{nominal} is a folder; a file is to be written there")
    place = nominal.resolve()
    if place.exists() and not place.is_file():  # a device or a pipe must not be replaced by a file
        raise InputError(f"{nominal} is no ordinary file; only those are written")
    return place


def _home(place: Path, folder: Path) -> Path:
    """Return the parent of the hidden folder: the common folder, unless a file cannot be renamed from there."""
    inside = place.is_relative_to(folder) and os.access(folder, os.W_OK)
    return folder if inside and folder.stat().st_dev == place.parent.stat().st_dev else place.parent


def _tidy(folders: Iterable[Path]) -> None:
    """Remove the hidden folders of killed processes, but none that holds anything which these do not write."""
    for folder in folders:
        for gone in drafts.forgotten(folder, STAGING):
            with suppress(OSError):
                entries = list(gone.iterdir())
                if all(entry.name.isdecimal() and entry.is_file() for entry in entries):
                    for entry in entries:
                        entry.unlink()
                    gone.rmdir()


def _put_in_place(drafts: list[tuple[Path, Path]]) -> None:
    """Rename drafts into their places; put back what was there if one of them cannot be."""
    replaced: list[tuple[Path, bytes | None]] = []
    try:
        for draft, place in drafts:
            before = place.read_bytes() if place.exists() else None
            if before is not None:
                draft.chmod(stat.S_IMODE(place.stat().st_mode))
            draft.replace(place)
            replaced.append((place, before))
    except BaseException:
        for place, before in replaced:
            with suppress(OSError):
                place.unlink() if before is None else place.write_bytes(before)
        raise
