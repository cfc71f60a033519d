"""Writing files: all of them or none, and never half of one."""

from __future__ import annotations

import contextlib
import os
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
    drafts: list[tuple[Path, Path]] = []
    try:
        for name, content in files.items():
            place = folder / name
            place.parent.mkdir(parents=True, exist_ok=True)
            if place.is_dir():
                raise InputError(f"{place} is a folder; a file is to be written there")
            handle, draft = tempfile.mkstemp(prefix=f".{place.name}-", dir=place.parent)
            drafts.append((Path(draft), place))
            with os.fdopen(handle, "wb") as file:
                file.write(content.encode() if isinstance(content, str) else content)
        umask = os.umask(0)
        os.umask(umask)
        for draft_path, place in drafts:
            draft_path.chmod(0o666 & ~umask)
            draft_path.replace(place)
    except OSError as error:
        raise InputError(f"{folder} cannot be written ({error.strerror})") from None
    finally:
        for draft_path, _ in drafts:
            with contextlib.suppress(OSError):
                draft_path.unlink()
    return [place for _, place in drafts]


def write_file(path: str | Path, content: str | bytes) -> Path:
    """Write one file; see `write_files`."""
    path = Path(path)
    return write_files(path.parent, {path.name: content})[0]
