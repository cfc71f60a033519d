"""The wheel: built from the checkout, installed elsewhere, at work without the checkout."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

from strapgen.catalogue.methods.tableaux import TABLEAUX
from strapgen.storage import resources

pytestmark = pytest.mark.long


def run(*command: str | Path, cwd: Path, environment: dict[str, str] | None = None) -> str:
    done = subprocess.run(
        [str(word) for word in command], cwd=cwd, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    checkout, folder = resources.checkout(), tmp_path_factory.mktemp("wheel")
    assert checkout is not None, "the tests run from a checkout"
    run(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", folder, checkout, cwd=folder)
    (built,) = folder.glob("strapgen-*.whl")
    return built


def test_templates_and_generated_sources_are_in_the_wheel(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    for kind in ("templates", "generated"):
        folder = resources.folder(kind)
        shipped = {
            f"strapgen/_data/{kind}/{path.relative_to(folder).as_posix()}"
            for path in folder.rglob("*")
            if path.is_file() and "__pycache__" not in path.parts
        }
        assert shipped
        assert shipped <= names
    assert {"strapgen/cli/generate_command.py", "strapgen/py.typed"} <= names
    assert {f"strapgen/catalogue/methods/butcher_tableaux/{method}.toml" for method in TABLEAUX} <= names
    assert not any("__pycache__" in name or name.startswith(("tests/", "codegen/")) for name in names)


def test_source_archive_has_the_sources_of_the_wheel(tmp_path):
    run(sys.executable, "-m", "build", "--sdist", "--outdir", tmp_path, resources.checkout(), cwd=tmp_path)
    (built,) = tmp_path.glob("strapgen-*.tar.gz")
    with tarfile.open(built) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {
        "codegen/strapgen/py.typed",
        "codegen/strapgen/__init__.py",
        "pyproject.toml",
        "README.md",
    } <= names
    assert {"templates/two_speed_c/source.c.j2", "generated/c/euler_rk4_2.c"} <= names


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory):
    """Return a function that runs the strapgen of a clean environment, in a folder of its own."""

    folder = tmp_path_factory.mktemp("installed")
    venv.create(folder / "venv")
    # The pip of this environment works on the other: nothing is compiled but what is imported.
    pip = [sys.executable, "-m", "pip", "--python", folder / "venv" / "bin" / "python"]
    run(*pip, "install", "--quiet", "--no-compile", wheel, cwd=folder)
    (folder / "home").mkdir()
    binaries, home = folder / "venv" / "bin", folder / "home"
    kept = {name: os.environ[name] for name in ("PATH", "LANG", "TMPDIR") if name in os.environ}
    environment = kept | {"HOME": str(home), "STRAPGEN_CACHE_DIR": str(folder / "cache")}

    def strapgen(*words: str, cwd: Path = folder, **variables: str) -> str:
        return run(binaries / "strapgen", *words, cwd=cwd, environment=environment | variables)

    def python(code: str, cwd: Path = folder, **variables: str) -> str:
        return run(binaries / "python", "-c", code, cwd=cwd, environment=environment | variables)

    strapgen.python = python
    return strapgen


def test_package_is_the_installed_one(installed):
    place = Path(installed.python("import strapgen; print(strapgen.__file__)").strip())
    assert "site-packages" in place.parts
    assert not place.is_relative_to(resources.checkout())


def test_version(installed):
    lines = installed("--version").splitlines()
    assert lines[0].startswith("strapgen ")
    assert {"sympy", "numpy", "jinja2", "cffi"} <= {line.split()[0] for line in lines}
    assert not any("is not installed" in line for line in lines if not line.startswith("C compiler"))


#: Writes the catalogue, holds the files of the installation to it, and generates one step; all is derived once.
WRITE_AND_CHECK = """
from strapgen.cli import main
from strapgen.run import standard_tree
programs = [*standard_tree.programs()]
standard_tree.programs = lambda: iter(programs)
one = ["generate", "euler", "--target", "c", "--out", "firmware"]
for words in (["generate", "--all"], ["generate", "--all", "--check"], one):
    try:
        main(words)
    except SystemExit as stop:
        assert stop.code == 0, stop.code
"""


def test_whole_catalogue_goes_to_a_folder_of_the_user_and_is_the_same_under_every_hash_seed(
    installed, tmp_path
):
    # Under a hash seed that differs from the one of most runs, on which no text may depend.
    seed = "4711" if os.environ.get("PYTHONHASHSEED") == "0" else "0"
    said = installed.python(WRITE_AND_CHECK, cwd=tmp_path, PYTHONHASHSEED=seed)
    assert "in step\n" in said

    def contents(folder: Path) -> dict[str, bytes]:
        return {
            path.relative_to(folder).as_posix(): path.read_bytes()
            for path in folder.rglob("*")
            if path.is_file()
            and path.name not in ("COST.md", "EVIDENCE.md")
            and "__pycache__" not in path.parts
        }

    generated = contents(resources.folder("generated"))
    assert contents(tmp_path / "generated") == generated
    firmware = contents(tmp_path / "firmware")
    assert {"euler_rk4_2.h", "euler_rk4_2.c"} <= firmware.keys()
    assert {name: generated[f"c/{name}"] for name in firmware} == firmware


def test_simulate(installed, tmp_path):
    words = "simulate euler --motion constant --set x_deg_s=10 --step 1 --duration 3 --format csv --backend"
    code = "from strapgen.cli import main\nfor name in ('numpy', 'c'):\n    try:\n"
    code += f"        main({words.split()} + [name])\n    except SystemExit as stop:\n        assert stop.code == 0"
    said = installed.python(code, cwd=tmp_path).splitlines()
    assert len(said) == 2 * 5
