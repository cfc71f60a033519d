"""Writes files all together or not at all, and never half of one."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import stat
from collections.abc import Mapping
from pathlib import Path

from strapgen.support.exceptions import InputError

#: Flags of a file that must not be there yet.
_NEW = os.O_CREAT | os.O_EXCL | os.O_WRONLY | getattr(os, "O_BINARY", 0)


def write_files(folder: str | Path, files: Mapping[str, str | bytes]) -> list[Path]:
    """Write files into a folder, which is created if it does not exist.

    Every text is first written in full beside its place; only then are they renamed into it. A file that exists keeps
    its permissions; a new one has those that the umask leaves.

    Parameters
    ----------
    folder : path
    files : mapping of str to str or bytes
        Content by name; a name may have folders in it.

    Returns
    -------
    list of Path
        The files, in order.

    Raises
    ------
    InputError
        If the folder or a file cannot be written; no file has been changed then.
    """
    folder = Path(folder)
    places = [folder / name for name in files]
    drafts: list[tuple[Path, Path]] = []
    writing = folder
    try:
        for nominal, content in zip(places, files.values(), strict=True):
            writing = nominal.parent
            nominal.parent.mkdir(parents=True, exist_ok=True)
            if nominal.is_dir():
                raise InputError(f"{nominal} is a folder; a file is to be written there")
            place = nominal.resolve()  # a link stays, what it points to is written
            if place.exists() and not place.is_file():  # a device or a pipe must not be replaced by a file
                raise InputError(f"{nominal} is no ordinary file; only those are written")
            draft = place.with_name(f".{place.name}-{secrets.token_hex(4)}")
            # The system applies the umask to a new file; the draft of an existing one is private until it has its mode.
            handle = os.open(draft, _NEW, 0o600 if place.exists() else 0o666)
            drafts.append((draft, place))
            with os.fdopen(handle, "wb") as file:
                file.write(content.encode() if isinstance(content, str) else content)
        _put_in_place(drafts)
    except (FileExistsError, NotADirectoryError):
        raise InputError(
            f"{writing} cannot be written: it is a file, or lies below one; a folder is needed"
        ) from None
    except OSError as error:
        raise InputError(f"{writing} cannot be written ({error.strerror})") from None
    finally:
        for draft_path, _ in drafts:
            with contextlib.suppress(OSError):
                draft_path.unlink()
    return places


def check_folder(folder: str | Path) -> None:
    """Check that files can be written into a folder, before the work that makes them; nothing is created.

    Raises
    ------
    InputError
        If a file stands in its way, or the place for it cannot be written.
    """
    folder = Path(folder)
    for place in (folder, *folder.absolute().parents):
        try:
            mode = place.stat().st_mode
        except FileNotFoundError:
            continue
        except OSError as error:
            raise InputError(f"{folder} cannot be written ({error.strerror})") from None
        number = 0 if os.access(place, os.W_OK) else errno.EACCES
        if not stat.S_ISDIR(mode):
            number = errno.ENOTDIR
        if number:
            raise InputError(f"{folder} cannot be written ({os.strerror(number)})")
        return


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
            with contextlib.suppress(OSError):
                place.unlink() if before is None else place.write_bytes(before)
        raise


def write_file(path: str | Path, content: str | bytes) -> Path:
    """Write one file; see `write_files`."""
    path = Path(path)
    return write_files(path.parent, {path.name: content})[0]
