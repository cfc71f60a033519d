"""Brings what the page that runs strapgen in the browser needs: Python for WebAssembly, SymPy, and strapgen itself.

`bring` downloads releases with known checksums, once; `write` puts them beside the page with its own files. Python
comes from npm; SymPy, mpmath, Jinja and MarkupSafe come from PyPI.
"""

from __future__ import annotations

import hashlib
import io
import json
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

import npm

import strapgen
from strapgen import pipeline
from strapgen.catalogue.methods.method_spec import MOST_INCREMENTS
from strapgen.catalogue.methods.tableaux import TITLES
from strapgen.catalogue.names import ALGORITHMS, INTEGRATORS, METHODS
from strapgen.fixedpoint.floating import proved, rounding_bounds
from strapgen.ir.exceptions import InputError
from strapgen.storage import cache, resources

HERE = Path(__file__).resolve().parent
#: Python for WebAssembly.
PACKAGE = "pyodide@0.29.4"
SHA512 = "tCseTsqU3kSxZIjkue5zXxTMNEwrKZwOIIEQRBA/VzHxFN1hoCxe4w41phfCdHd9it9RcCNQb5K/Re0InqMgvA=="
_PYTHON = ("pyodide.js", "pyodide.asm.js", "pyodide.asm.wasm", "python_stdlib.zip", "pyodide-lock.json")
#: The platform of which PyPI has all of the wheels; nothing that depends on it is used.
_WHEELS = "--only-binary :all: --platform manylinux2014_x86_64 --implementation cp --python-version 3.13"
#: The files of the page itself.
_PAGE = ("try.js", "chart.js", "highlight.js", "worker.js", "style.css")
#: What a release brings that nobody needs to derive an algorithm.
_UNUSED = re.compile(r"(^|/)(tests|benchmarks|testing)/|\.dist-info/|\.data/|^isympy")

#: Headings over the methods of the page, and what is under each: tableaux by the order of their method.
GROUPS = {
    "Runge-Kutta methods": tuple(TITLES),
    "Coning corrections": tuple(name for name in INTEGRATORS if name.startswith("coning")),
    "Exact rotations": ("fit-exact", "magnus2", "magnus4", "magnus6", "munthe-kaas4", "crouch-grossman3"),
    "Taylor series": tuple(name for name in INTEGRATORS if name.startswith("taylor")),
    "Windows and shaped coning": tuple(name for name in METHODS if name not in {*TITLES, *INTEGRATORS}),
}
#: Steps whose bounds of rounding come with the page, because their proof takes seconds here and numpy there.
PROVED = (
    *("rk1", "rk2", "midpoint", "ralston2", "rk3", "ralston3", "rk4", "three-eighths", "fehlberg4"),
    *("coning-compressed", "coning-uncompressed", "coning-combined", "magnus2", "magnus4"),
    *("taylor1", "taylor2", "taylor3", "taylor4"),
)
PROVED_INCREMENTS = range(1, 5)


def bring(folder: Path) -> None:
    """Download into a folder what is not there yet.

    Parameters
    ----------
    folder : Path
        Keeps the downloads from one build to the next.

    Raises
    ------
    RuntimeError
        A registry cannot be reached, or what it brings has another checksum.
    """
    if not all((folder / name).is_file() for name in _PYTHON):
        data = npm.archive(PACKAGE, SHA512, "Python for the browser")
        folder.mkdir(parents=True, exist_ok=True)
        with tarfile.open(fileobj=io.BytesIO(data)) as archive:
            for name in _PYTHON:
                member = archive.extractfile(f"package/{name}")
                assert member is not None
                (folder / name).write_bytes(member.read())
    if len(_wheels(folder)) != len(_checksums()):
        _download_wheels(folder)


def _checksums() -> set[str]:
    return set(re.findall(r"sha256:(\w+)", (HERE / "requirements.txt").read_text()))


def _wheels(folder: Path) -> list[Path]:
    """Return the wheels in a folder that have one of the known checksums."""
    known = _checksums()
    wheels = sorted(folder.glob("*.whl"))
    return [path for path in wheels if hashlib.sha256(path.read_bytes()).hexdigest() in known]


def _download_wheels(folder: Path) -> None:
    requirements = str(HERE / "requirements.txt")
    with tempfile.TemporaryDirectory() as place:
        options = ["--quiet", "--no-deps", "--require-hashes", *_WHEELS.split()]
        command = [
            sys.executable,
            "-m",
            "pip",
            "download",
            *options,
            "--dest",
            place,
            "--requirement",
            requirements,
        ]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            said = [line for line in done.stderr.splitlines() if line.startswith("ERROR: ")]
            raise RuntimeError(f"pip download failed: {(said or ['ERROR: it said nothing'])[-1][7:]}")
        for path in Path(place).glob("*.whl"):
            shutil.move(path, folder / path.name)


def write(folder: Path, downloads: Path) -> None:
    """Write the files of the page: its scripts, Python, and an archive with all that Python imports.

    Parameters
    ----------
    folder : Path
        Where they go, beside the page.
    downloads : Path
        Where `bring` has put the releases.
    """
    (folder / "pyodide").mkdir(parents=True, exist_ok=True)
    for name in _PYTHON:
        shutil.copy2(downloads / name, folder / "pyodide" / name)
    for name in _PAGE:
        shutil.copy2(HERE / name, folder / name)
    data = _archive(downloads)
    (folder / "python.zip").write_bytes(data)
    manifest = {
        "archive": f"python.zip?{hashlib.sha256(data).hexdigest()[:16]}",
        "bytes": len(data)
        + sum((folder / "pyodide" / n).stat().st_size for n in _PYTHON if not n.endswith(".js")),
        "version": strapgen.__version__,
        "algorithms": dict(ALGORITHMS),
        "methods": {title: {name: METHODS[name] for name in names} for title, names in GROUPS.items()},
        "most_increments": MOST_INCREMENTS,
    }
    (folder / "manifest.json").write_text(json.dumps(manifest, indent=1, ensure_ascii=False))


def _archive(downloads: Path) -> bytes:
    """Return a zip archive that is the same whenever its files are."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in _members(downloads):
            archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    return file.getvalue()


def _members(downloads: Path) -> Iterator[tuple[str, bytes]]:
    for path in _wheels(downloads):
        with zipfile.ZipFile(path) as wheel:
            for name in wheel.namelist():
                is_code = name.endswith(".py") and not _UNUSED.search(name)
                if is_code or "LICENSE" in name:
                    yield name, wheel.read(name)
    templates = resources.folder("templates")
    for path in resources.package_files():
        if path.is_relative_to(templates):
            yield f"strapgen/_data/templates/{path.relative_to(templates).as_posix()}", path.read_bytes()
        else:
            yield f"strapgen/{path.relative_to(resources.PACKAGE).as_posix()}", path.read_bytes()
    yield "answers.py", (HERE / "answers.py").read_bytes()
    yield "bounds.json", bounds()


def bounds() -> bytes:
    """Return the bounds of `PROVED` on `PROVED_INCREMENTS` for every state, as `proved.load` takes them."""
    key = [*PROVED, str(PROVED_INCREMENTS)]
    what = "bounds of rounding for the site"
    return cache.stored("site-bounds", key, lambda: json.dumps(dict(_proved_bounds())).encode(), what)


def _proved_bounds() -> Iterator[tuple[str, dict[str, object]]]:
    for method in PROVED:
        for increments in PROVED_INCREMENTS:
            for algorithm in ALGORITHMS:
                try:
                    choice = strapgen.choose_step(algorithm, method, increments)
                except InputError:  # a method that does not go with so many increments
                    continue
                program = pipeline.program(choice)
                yield proved.key(program, "double"), rounding_bounds(program).as_dict()
