"""Measures the size of compiled C, and keeps it in the cache."""

from __future__ import annotations

import re
import shutil
import subprocess
from contextlib import suppress
from functools import partial
from pathlib import Path

from strapgen.ir.sources import Sources
from strapgen.run.compiler import C_FLAGS, C, build_key
from strapgen.storage import cache, drafts

#: Kind of cache entry that holds the size of object code, and its file.
_SIZES, _SIZE = "sizes", "size.txt"


def code_size(sources: Sources) -> int | None:
    """Return the size in bytes of the code and constants of a compiled C source; None if it cannot be determined.

    The cache keeps it: to measure it takes a compilation of its own.
    """
    if not any(name.endswith(".c") for name in sources.files):
        return None
    words, counter = C.command(), shutil.which("size")
    if counter is None:
        return None
    key = build_key([sources], C_FLAGS)
    place = cache.lookup(_SIZES, key)
    if place is not None:
        with suppress(FileNotFoundError):  # another process has removed it meanwhile
            return int(cache.read(place, _SIZE))
    size = _measured_size(sources, words, counter)
    if size is not None:
        cache.entry(_SIZES, key, partial(_note_size, size))
    return size


def _note_size(size: int, draft: Path) -> None:
    (draft / _SIZE).write_text(str(size))


def _measured_size(sources: Sources, words: list[str], counter: str) -> int | None:
    """Return the size of compiled sources, measured by a program."""
    with drafts.temporary_folder() as folder:
        for name, text in sources.files.items():
            (folder / name).write_text(text)
        code = next(name for name in sources.files if name.endswith(".c"))
        compiling = [*words, *C_FLAGS, "-c", code, "-o", "code.o"]
        if subprocess.run(compiling, cwd=folder, capture_output=True, check=False).returncode:
            return None
        said = subprocess.run([counter, "code.o"], cwd=folder, capture_output=True, text=True, check=False)
    match = re.match(r"\s*(\d+)\s", said.stdout.partition("\n")[2])
    return int(match[1]) if match else None
