"""The structure of the package: what imports what, where stages are composed, who lays out tables."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import grimp
import pytest
from without_applications import APPLICATIONS

from strapgen import registration

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "codegen" / "strapgen"
#: Folders that import without SymPy: what is in the cache runs without computer algebra.
WITHOUT_SYMPY = (
    *("ir", "storage", "fixedpoint", "targets", "run", "cli"),
    *(
        "registration.py",
        "registry.py",
        "catalogue/__init__.py",
        "catalogue/names.py",
        "catalogue/choice.py",
        "catalogue/choosing.py",
    ),
)
#: The functions that do the work of a stage, and the folder to which each belongs.
STAGES = {
    "strapgen.catalogue.derivation.derive": "catalogue",
    "strapgen.lowering.lower": "lowering",
    "strapgen.fixedpoint.quantize": "fixedpoint",
    "strapgen.fixedpoint.quantization.lowered": "fixedpoint",
    "strapgen.targets.emit": "targets",
}
#: The stages as the front door offers them.
DOORS = {f"strapgen.pipeline.{name}" for name in ("derive", "lower", "quantize", "generate")}


def module_name(path: Path) -> str:
    parts = ("strapgen", *path.relative_to(PACKAGE).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


FILES = sorted(PACKAGE.rglob("*.py"))
MODULES = {module_name(path): path for path in FILES}


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


@cache
def nodes(source: ast.Module) -> tuple[ast.AST, ...]:
    return tuple(ast.walk(source))


def room(module: str) -> str:
    return (*module.split("."), "")[1]


def place(path: Path) -> str:
    return path.relative_to(PACKAGE).as_posix()


def test_the_contracts_of_imports_hold():
    """Contracts of import-linter in pyproject.toml: storeys, and no circle."""
    program = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run([program, "--no-cache"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


@pytest.fixture(scope="module")
def graph():
    return grimp.build_graph("strapgen", cache_dir=None, exclude_type_checking_imports=True)


def test_applications_require_their_imports(graph):
    registered = registration.built_in()
    built_in = [name for name in registered if name in APPLICATIONS]
    assert {*built_in} == {*APPLICATIONS}
    reached: dict[str, set[str]] = {}
    for name in built_in:
        requires = registered[name].requires
        reached[name] = {*requires}.union(*(reached[other] for other in requires))
        direct = {
            other
            for other in built_in
            for module in graph.find_descendants(f"strapgen.{name}")
            for imported in graph.find_modules_directly_imported_by(module)
            if other != name and imported.startswith(f"strapgen.{other}.")
        }
        assert {*requires} <= direct <= reached[name], name


def test_the_compiler_names_no_module_of_an_application():
    """The public names of `strapgen` apart, which its own module lists, and the object, which asks applications."""
    named = re.compile(rf"strapgen\.({'|'.join(APPLICATIONS)})\b")
    compiler = [path for path in FILES if path.relative_to(PACKAGE).parts[0] not in APPLICATIONS]
    assert [place(path) for path in compiler if named.search(path.read_text())] == [
        "__init__.py",
        "attitude_algorithm.py",
    ]


def test_sympy_ends_at_the_gate():
    prefixes = tuple(f"{name}/" for name in WITHOUT_SYMPY)
    names = [
        m for m, path in MODULES.items() if place(path).startswith(prefixes) or place(path) in WITHOUT_SYMPY
    ]
    assert len(names) > 50
    lines = ["import sys, importlib", "sys.modules['sympy'] = None", f"for name in {names!r}:"]
    code = "\n".join([*lines, "    importlib.import_module(name)"])
    subprocess.run([sys.executable, "-c", code], check=True)


@cache
def names_of_imports(module: ast.Module) -> dict[str, str]:
    """Return what every imported name of a module stands for, inside functions and for types too."""
    names: dict[str, str] = {}
    for node in nodes(module):
        if isinstance(node, ast.ImportFrom):
            names |= {alias.asname or alias.name: f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            for alias in node.names:
                top = alias.name.partition(".")[0]
                names |= {alias.asname: alias.name} if alias.asname else {top: top}
    return names


@cache
def resolved(name: str) -> str:
    """Return the name of a thing where it is defined, through all modules that pass it on."""
    module, _, rest = name.rpartition(".")
    if module in MODULES and name not in MODULES:
        passed_on = names_of_imports(tree(MODULES[module])).get(rest, name)
        return name if passed_on == name else resolved(passed_on)
    return name


def uses(module: ast.Module) -> set[str]:
    """Return the full names of all that a module imports or reaches through what it imports."""
    names = names_of_imports(module)
    full = set(names.values())
    for node in nodes(module):
        parts: list[str] = []
        while isinstance(node, ast.Attribute):
            parts.insert(0, node.attr)
            node = node.value
        if parts and isinstance(node, ast.Name) and node.id in names:
            full.add(".".join([names[node.id], *parts]))
    return {resolved(name) for name in full}


def test_only_the_front_door_composes_stages():
    offenders = []
    for module, path in MODULES.items():
        if module in ("strapgen", "strapgen.pipeline"):  # the first offers what the second has
            continue
        names = uses(tree(path))
        offenders += [
            f"{module} calls {name}" for name in names & set(STAGES) if STAGES[name] != room(module)
        ]
        offenders += [
            f"{module} uses {name}"
            for name in names
            if re.fullmatch(r"strapgen\.targets\.\w+\.emit(_fixed)?", name)
        ]
        if len(doors := names & DOORS) > 1:
            offenders.append(f"{module} composes {', '.join(sorted(doors))}")
    assert not offenders, "\n".join(offenders)


@pytest.mark.parametrize(
    "text",
    [
        "from strapgen.catalogue import derive",
        "from strapgen.catalogue import derive as kernel_of",
        "def f(choice):\n    from strapgen import catalogue as c\n    return c.derive(choice)",
        "import strapgen.catalogue\nkernel = strapgen.catalogue.derivation.derive",
        "from strapgen.catalogue import derivation\nstage = [derivation.derive]",
    ],
)
def test_a_stage_is_seen_however_it_is_called(text):
    assert "strapgen.catalogue.derivation.derive" in uses(ast.parse(text))


def test_the_stages_of_the_rules_exist():
    assert set(uses(tree(MODULES["strapgen.pipeline"]))) >= set(STAGES) - {
        "strapgen.fixedpoint.quantization.lowered"
    }
    functions = {
        f"strapgen.pipeline.{node.name}"
        for node in tree(MODULES["strapgen.pipeline"]).body
        if isinstance(node, ast.FunctionDef)
    }
    assert functions >= DOORS
    assert resolved("strapgen.derive") == "strapgen.pipeline.derive"


def layouts(source: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield what lays out columns in a source: alignment, padding, rows of comma-separated values, and its line."""
    for node in nodes(source):
        if isinstance(node, ast.Attribute) and node.attr in ("ljust", "rjust", "writerow", "writerows"):
            yield node.lineno, node.attr
        elif isinstance(node, ast.FormattedValue) and node.format_spec is not None:
            spec = "".join(
                str(part.value) for part in node.format_spec.values if isinstance(part, ast.Constant)
            )
            align = [part for part in node.format_spec.values[:1] if isinstance(part, ast.FormattedValue)]
            if re.match(r"[<>^]", spec) or any("align" in ast.unparse(part) for part in align):
                yield node.lineno, "aligns"


def test_one_module_lays_out_tables():
    """Beside it the command line prints lists of its own; everything else computes, or says what a column holds."""
    offenders = [
        f"{place(path)}:{line} {what}"
        for path in FILES
        if path.relative_to(PACKAGE).parts[0] != "cli" and place(path) != "results/table.py"
        for line, what in layouts(tree(path))
    ]
    assert not offenders, "\n".join(offenders)


@pytest.mark.parametrize(
    "text", ["name.ljust(3)", "f'{x:>10.3e}'", "f'{x:<{width}}'", "f'{x:{align}{width}}'", "w.writerow(r)"]
)
def test_a_layout_is_seen(text):
    assert list(layouts(ast.parse(text)))
    assert not list(layouts(ast.parse("f'{x:.3e} {x:+.2%} {x:{spec}}'")))
