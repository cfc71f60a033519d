"""Writing files: all of them or none, and never half of one."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
import tempfile
from collections.abc import Mapping
from pathlib import Path

from strapgen.exceptions import InputError


def write_files(folder: str | Path, files: Mapping[str, str | bytes]) -> list[Path]:
    """Write files into a folder, which is made if need be.

    Every text is first written in full beside its place; only then are they renamed into it.

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
            handle, draft = tempfile.mkstemp(prefix=f".{place.name}-", dir=place.parent)
            drafts.append((Path(draft), place))
            with os.fdopen(handle, "wb") as file:
                file.write(content.encode() if isinstance(content, str) else content)
        umask = os.umask(0)
        os.umask(umask)
        _put_in_place(drafts, 0o666 & ~umask)
    except OSError as error:
        raise InputError(f"{writing} cannot be written ({error.strerror})") from None
    finally:
        for draft_path, _ in drafts:
            with contextlib.suppress(OSError):
                draft_path.unlink()
    return places


def check_folder(folder: str | Path) -> None:
    """Check that files can be written into a folder, before the work that makes them; nothing is made.

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


def _put_in_place(drafts: list[tuple[Path, Path]], mode: int) -> None:
    """Rename drafts into their places; put back what was there if one of them cannot be."""
    replaced: list[tuple[Path, bytes | None]] = []
    try:
        for draft, place in drafts:
            before = place.read_bytes() if place.exists() else None
            draft.chmod(mode)
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
