"""Delete the folder of each application in turn in a copy of strapgen, and see that the rest works without it.

In each copy ``strapgen generate --all --check`` must find `generated/` in step, and the quick tests of the compiler and
of the applications that do not need the deleted one must pass, but those that import it. The applications that need it
go with it: the last copy is the compiler alone.

    python tests/without_applications.py [--tests] [NAME ...]
"""

from __future__ import annotations

import argparse
import ast
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from strapgen import registration

ROOT = Path(__file__).resolve().parents[1]
#: The folders of the package, each above those that it may import.
LAYERS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"][0][
    "layers"
]
#: The applications, each after those that it needs.
APPLICATIONS = [
    name for name in LAYERS[: LAYERS.index("cli")][::-1] if (ROOT / "codegen" / "strapgen" / name).is_dir()
]
#: What a copy leaves out.
LEFT_OUT = shutil.ignore_patterns(".*", "__pycache__", "_build", "build", "dist")


def gone_with(name: str) -> set[str]:
    """Return an application and all that need it."""
    gone = {name}
    for other, one in registration.built_in().items():
        if gone & {*one.requires}:
            gone.add(other)
    return gone


def imported(path: Path, helpers: dict[str, Path], known: dict[Path, set[str]]) -> set[str]:
    """Return the folders of strapgen that a test imports, itself or through a module of the tests."""
    if path in known:
        return known[path]
    folders = known[path] = set()
    text = path.read_text()
    for node in ast.walk(ast.parse(text)):
        names = []
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        for name in names:
            if name.startswith("strapgen."):
                second = name.split(".")[1]
                folders.add(public_names().get(second, second).split(".")[0])
            elif name.partition(".")[0] in helpers:
                folders |= imported(helpers[name.partition(".")[0]], helpers, known)
    return folders


def tests_without(gone: set[str]) -> Iterator[str]:
    """Yield the tests of the folders that are left, but those that use what is gone."""
    tests = ROOT / "tests"
    helpers = {path.stem: path for path in tests.glob("*.py")}
    known: dict[Path, set[str]] = {}
    public = {name: module.split(".")[0] for name, module in public_names().items()}
    kernels = [
        f'"{name}'
        for one in gone
        for table in registration.built_in()[one].kernels
        for name in registration.load(table)
    ]
    for path in sorted(tests.rglob("test_*.py")):
        folder = path.relative_to(tests).parts[0]
        if folder in gone or folder in ("cli", "data") or path.parent == tests:
            continue
        text = path.read_text()
        through = {place for name, place in public.items() if f"strapgen.{name}" in text}
        uses = gone & (imported(path, helpers, known) | through) or any(name in text for name in kernels)
        if not uses and not any(word in text for word in ("cli import main", "benchmarks")):
            yield path.relative_to(ROOT).as_posix()


@cache
def public_names() -> dict[str, str]:
    """Return the modules of the public names."""
    import strapgen

    return {**strapgen._EXPORTS, **strapgen._NAMESPACES}


def main() -> None:
    """Go through the applications, and exit with 1 at the first that is missed."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="applications; by default all")
    parser.add_argument("--tests", action="store_true", help="run the tests too")
    options = parser.parse_args()
    for name in options.names or reversed(APPLICATIONS):
        gone = gone_with(name)
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / "strapgen"
            shutil.copytree(ROOT, copy, ignore=LEFT_OUT)
            for one in gone:
                shutil.rmtree(copy / "codegen" / "strapgen" / one)
            environment = {**os.environ, "PYTHONPATH": str(copy / "codegen")}
            check = [sys.executable, "-m", "strapgen", "generate", "--all", "--check"]
            subprocess.run(check, cwd=copy, env=environment, check=True)
            chosen = [*tests_without(gone)] if options.tests else []
            if chosen:
                tests = [
                    sys.executable,
                    "-m",
                    "pytest",
                    "-q",
                    "-m",
                    "not long",
                    "-n",
                    "auto",
                    "-p",
                    "no:cacheprovider",
                ]
                subprocess.run([*tests, *chosen], cwd=copy, env=environment, check=True)
        print(
            f"without {', '.join(sorted(gone))}: generated/ in step, {len(chosen)} files of tests passed",
            flush=True,
        )


if __name__ == "__main__":
    main()
