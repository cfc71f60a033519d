"""Brings MathJax from the registry of npm, one release with a known checksum, so that pages need no network."""

from __future__ import annotations

import base64
import hashlib
import shutil
import subprocess
import tarfile
import tempfile
from pathlib import Path

#: The last release in which one file holds all fonts as outlines; it loads nothing else.
PACKAGE = "mathjax@3.2.2"
SHA512 = "Bt+SSVU8eBG27zChVewOicYs7Xsdt40qm4+UpHyX7k0/O9NliPc+x77k1/FEsPsjKPZGJvtRZM1vO+geW0OhGw=="
_MEMBERS = {"package/es5/tex-svg.js": "tex-svg.js", "package/LICENSE": "LICENSE"}


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
    if shutil.which("npm") is None:
        raise RuntimeError("npm is needed to bring MathJax: on Debian, apt-get install npm")
    with tempfile.TemporaryDirectory() as place:
        command = ["npm", "pack", "--silent", "--pack-destination", place, PACKAGE]
        done = subprocess.run(command, capture_output=True, text=True)
        archives = [*Path(place).glob("*.tgz")]
        if done.returncode or not archives:
            said = (done.stderr.strip() or "it brought no archive").splitlines()[-1]
            raise RuntimeError(f"npm pack {PACKAGE} failed: {said}")
        digest = base64.b64encode(hashlib.sha512(archives[0].read_bytes()).digest()).decode()
        if digest != SHA512:
            raise RuntimeError(f"{PACKAGE} from npm has the checksum {digest}, not {SHA512}")
        folder.mkdir(parents=True, exist_ok=True)
        with tarfile.open(archives[0]) as archive:
            for member, name in _MEMBERS.items():
                content = archive.extractfile(member)
                assert content is not None
                (folder / name).write_bytes(content.read())
