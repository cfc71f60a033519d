"""Imports point one way: the README's table of the architecture, read as the order of layers."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from gathering import each

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "codegen" / "strapgen"


def layers() -> dict[str, int]:
    """Return the row of the README's table in which each module or folder of the package stands."""
    readme = (ROOT / "README.md").read_text()
    rows = re.findall(r"^\| (`.*?) \| ", readme.split("## Architecture")[1], flags=re.MULTILINE)
    names = [re.findall(r"`(\w+)(?:\.py|/)`", row.split("with")[0]) for row in rows]
    return {name: row for row, members in enumerate(names) for name in members}


LAYERS = layers()


def part(module: str) -> str:
    return module.removeprefix("strapgen.").split(".")[0]


def imported(path: Path) -> set[str]:
    """Return the parts of the package that a file imports, inside functions too."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "strapgen":
            if node.module == "strapgen":
                found |= {alias.name for alias in node.names if alias.name in LAYERS}
            else:
                found.add(part(node.module))
        elif isinstance(node, ast.Import):
            found |= {part(a.name) for a in node.names if a.name.startswith("strapgen.")}
    return found


def test_every_part_stands_in_the_table():
    parts = {
        path.stem for path in PACKAGE.iterdir() if path.suffix == ".py" or (path / "__init__.py").is_file()
    }
    assert parts - {"__init__", "__main__"} == set(LAYERS)


@each("path", sorted(PACKAGE.rglob("*.py")), ids=lambda p: p.relative_to(PACKAGE).as_posix())
def test_imports_point_up_the_table(path):
    own = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    if own in ("__init__", "__main__"):  # the package's front offers everything
        return
    later = {name for name in imported(path) if LAYERS[name] > LAYERS[own]}
    assert not later, f"{own} imports {later}, which stand below it"


def test_sympy_ends_at_the_gate():
    for name in (
        "program.py",
        "signal.py",
        "companions.py",
        "targets",
        "backends",
        "cache.py",
        "simulation.py",
    ):
        files = (PACKAGE / name).rglob("*.py") if (PACKAGE / name).is_dir() else [PACKAGE / name]
        for path in files:
            assert not re.search(r"^\s*(import|from) sympy", path.read_text(), flags=re.MULTILINE), path
