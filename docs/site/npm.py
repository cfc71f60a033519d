"""Brings one release of a package from the registry of npm, with a known checksum."""

from __future__ import annotations

import base64
import hashlib
import shutil
import subprocess
import tempfile
from pathlib import Path


def archive(package: str, sha512: str, purpose: str) -> bytes:
    """Return the archive of a package.

    Parameters
    ----------
    package : str
        Name and release, with ``@`` between them.
    sha512 : str
        Checksum of the archive in base64, as the registry states it.
    purpose : str
        What it brings, for the message that npm is missing.

    Raises
    ------
    RuntimeError
        npm is missing or has no network, or what it brings has another checksum.
    """
    if shutil.which("npm") is None:
        raise RuntimeError(f"npm is needed to bring {purpose}: on Debian, apt-get install npm")
    with tempfile.TemporaryDirectory() as place:
        command = ["npm", "pack", "--silent", "--pack-destination", place, package]
        done = subprocess.run(command, capture_output=True, text=True)
        archives = [*Path(place).glob("*.tgz")]
        if done.returncode or not archives:
            said = (done.stderr.strip() or "it brought no archive").splitlines()[-1]
            raise RuntimeError(f"npm pack {package} failed: {said}")
        data = archives[0].read_bytes()
    digest = base64.b64encode(hashlib.sha512(data).digest()).decode()
    if digest != sha512:
        raise RuntimeError(f"{package} from npm has the checksum {digest}, not {sha512}")
    return data
