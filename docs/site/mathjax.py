"""Brings MathJax from the registry of npm, one release with a known checksum, so that pages need no network."""

from __future__ import annotations

import io
import tarfile
from pathlib import Path

import npm

#: The last release in which one file holds all extensions, and all fonts as outlines; it loads nothing else.
PACKAGE = "mathjax@3.2.2"
SHA512 = "Bt+SSVU8eBG27zChVewOicYs7Xsdt40qm4+UpHyX7k0/O9NliPc+x77k1/FEsPsjKPZGJvtRZM1vO+geW0OhGw=="
_MEMBERS = {"package/es5/tex-svg-full.js": "tex-svg-full.js", "package/LICENSE": "LICENSE"}


def vendor(folder: Path) -> None:
    """Put MathJax into a folder, unless it is there.

    Parameters
    ----------
    folder : Path
        Where its file and its licence go.

    Raises
    ------
    RuntimeError
        npm is missing or has no network, or what it brings has another checksum.
    """
    if all((folder / name).is_file() for name in _MEMBERS.values()):
        return
    data = npm.archive(PACKAGE, SHA512, "MathJax")
    folder.mkdir(parents=True, exist_ok=True)
    with tarfile.open(fileobj=io.BytesIO(data)) as archive:
        for member, name in _MEMBERS.items():
            content = archive.extractfile(member)
            assert content is not None
            (folder / name).write_bytes(content.read())
