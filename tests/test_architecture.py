"""The rules of the house: where modules live, which way imports point, how long things get, what they are called."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from gathering import each

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "codegen" / "strapgen"

#: The folders of the package from the ground up, and the front door among them: each imports what stands before it.
ORDER = (
    "support",
    "ir",
    "symbolic",
    "fixedpoint",
    "rounding",
    "catalogue",
    "lowering",
    "targets",
    "pipeline",
    "library",
    "systems",
    "toolchain",
    "backends",
    "simulation",
    "analysis",
    "vibration",
    "design",
    "experiments",
    "evidence",
    "reports",
    "cli",
)
#: Folders that import without SymPy: what is in the cache runs without computer algebra.
WITHOUT_SYMPY = (
    *("support", "ir", "fixedpoint", "rounding", "targets", "library", "systems", "toolchain"),
    *("backends", "simulation"),
    *("cli", "catalogue/__init__.py", "catalogue/names.py", "catalogue/choice.py", "catalogue/choosing.py"),
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
MOST_LINES = 400
MOST_BODY = 60
MOST_COMMAND_BODY = 40
MOST_PARAMETERS = 8
MOST_ENTRIES = 26
BANNED_MODULES = {"utils", "helpers", "common", "misc", "numpy", *sys.stdlib_module_names}
BANNED_IDENTIFIERS = {
    *("made", "found", "given", "taken", "kept", "asked", "wanted", "own", "ready"),
    *("residual", "residuals", "companions"),
}


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


@cache
def imports(path: Path) -> tuple[str, ...]:
    """Return the modules of the package that a file imports, inside functions and for types too."""
    return tuple(_imports(path))


def _imports(path: Path) -> Iterator[str]:
    for node in nodes(tree(path)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "strapgen":
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                yield full if full in MODULES else node.module
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.split(".")[0] == "strapgen")


def room(module: str) -> str:
    return (*module.split("."), "")[1]


def place(path: Path) -> str:
    return path.relative_to(PACKAGE).as_posix()


def circle(graph: dict[str, set[str]]) -> list[str]:
    """Return the modules of one circle of imports; empty if there is none."""
    done: set[str] = set()

    def visit(module: str, trail: list[str]) -> list[str]:
        if module in trail:
            return [*trail[trail.index(module) :], module]
        if module in done:
            return []
        done.add(module)
        return next(filter(None, (visit(other, [*trail, module]) for other in sorted(graph[module]))), [])

    return next(filter(None, (visit(module, []) for module in sorted(graph))), [])


def test_the_top_of_the_package_holds_the_folders_and_the_front_door_alone():
    entries = {path.name for path in PACKAGE.iterdir() if path.name != "__pycache__"}
    folders = set(ORDER) - {"pipeline"}
    assert entries == folders | {"__init__.py", "__main__.py", "pipeline.py", "py.typed"}


def test_the_page_on_architecture_has_a_row_for_every_folder():
    table = (ROOT / "docs" / "architecture.md").read_text().split("## The folders")[1]
    rows = re.findall(r"^\| `(\w+)(?:\.py|/)`", table, flags=re.MULTILINE)
    assert tuple(rows) == ORDER


def test_no_folder_holds_more_than_a_reader_takes_in():
    folders = [PACKAGE, *(path for path in PACKAGE.iterdir() if path.is_dir() and path.name != "__pycache__")]
    counts = {
        folder.name: sum(
            1
            for entry in folder.iterdir()
            if entry.is_dir() or entry.suffix == ".py"
            if entry.name != "__pycache__"
        )
        for folder in folders
    }
    assert not {name: count for name, count in counts.items() if count > MOST_ENTRIES}


def test_imports_point_down():
    upward = []
    for module, path in MODULES.items():
        if room(module) not in ORDER:  # the package's front, which offers everything
            continue
        for other in imports(path):
            if other == "strapgen":
                if room(module) != "cli":
                    upward.append(f"{module} imports the package itself")
            elif ORDER.index(room(other)) > ORDER.index(room(module)):
                upward.append(f"{module} imports {other}")
    assert not upward, "\n".join(upward)


def test_imports_form_no_circle():
    graph = {
        module: {other for other in imports(path) if other in MODULES and other != module}
        for module, path in MODULES.items()
        if room(module) in ORDER
    }
    graph = {module: {other for other in others if other in graph} for module, others in graph.items()}
    assert not (modules := circle(graph)), " imports ".join(modules)


def test_a_circle_is_seen():
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == ["b", "c", "b"]
    assert circle({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []


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
            if re.fullmatch(r"strapgen\.targets\.\w+\.emit\.emit", name)
        ]
        if len(doors := names & DOORS) > 1:
            offenders.append(f"{module} composes {', '.join(sorted(doors))}")
    assert not offenders, "\n".join(offenders)


@each(
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
        if path.relative_to(PACKAGE).parts[0] != "cli" and place(path) != "reports/table.py"
        for line, what in layouts(tree(path))
    ]
    assert not offenders, "\n".join(offenders)


def test_only_reports_and_the_command_line_have_texts_of_results():
    offenders = [
        f"{place(path)}:{node.lineno} {node.name}"
        for path in FILES
        if path.relative_to(PACKAGE).parts[0] not in ("reports", "cli")
        for node in nodes(tree(path))
        if isinstance(node, ast.FunctionDef) and node.name in ("as_text", "as_csv", "as_markdown")
    ]
    assert not offenders, "\n".join(offenders)


@each("text", ["name.ljust(3)", "f'{x:>10.3e}'", "f'{x:<{width}}'", "f'{x:{align}{width}}'", "w.writerow(r)"])
def test_a_layout_is_seen(text):
    assert list(layouts(ast.parse(text)))
    assert not list(layouts(ast.parse("f'{x:.3e} {x:+.2%} {x:{spec}}'")))


def test_no_module_is_named_as_a_known_one_or_says_nothing():
    parts = {(place(path), part) for path in FILES for part in Path(place(path)).with_suffix("").parts}
    assert not sorted(where for where, part in parts if part in BANNED_MODULES)


def test_no_class_name_stands_twice():
    where = defaultdict(list)
    for path in FILES:
        for node in nodes(tree(path)):
            if isinstance(node, ast.ClassDef):
                where[node.name].append(place(path))
    assert not {name: places for name, places in where.items() if len(places) > 1}


@cache
def functions(path: Path) -> tuple[ast.FunctionDef, ...]:
    return tuple(node for node in nodes(tree(path)) if isinstance(node, ast.FunctionDef))


def body_lines(function: ast.FunctionDef) -> int:
    """Return the lines of a function without its signature and its docstring."""
    body = function.body[1:] if ast.get_docstring(function) is not None else function.body
    return body[-1].end_lineno - body[0].lineno + 1 if body else 0


@cache
def commands(path: Path) -> set[str]:
    """Return the functions of a module that are commands: those whose parameters Typer reads."""
    return (
        {f.name for f in functions(path) if not f.name.startswith("_")} if "commands" in path.parts else set()
    )


def test_modules_fit_on_a_few_screens():
    long = {place(path): n for path in FILES if (n := len(path.read_text().splitlines())) > MOST_LINES}
    assert not long


def test_functions_can_be_held_in_mind():
    long = []
    for path in FILES:
        for function in functions(path):
            most = MOST_COMMAND_BODY if function.name in commands(path) else MOST_BODY
            if (lines := body_lines(function)) > most:
                long.append(f"{place(path)}:{function.lineno} {function.name}: {lines} lines, {most} allowed")
    assert not long, "\n".join(long)


def test_signatures_are_short():
    long = []
    for path in FILES:
        for function in functions(path):
            arguments = function.args
            count = len([*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs])
            if count > MOST_PARAMETERS and function.name not in commands(path):
                long.append(f"{place(path)}:{function.lineno} {function.name}: {count} parameters")
    assert not long, "\n".join(long)


def names_of_things(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the names that a file gives to variables, parameters and private fields, with their lines.

    Public parameters and fields keep their names: those of functions and classes without an underscore.
    """
    public = {
        id(argument)
        for function in functions(path)
        if not function.name.startswith("_") or function.name == "__init__"
        for argument in (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)
    }
    for node in nodes(tree(path)):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.lineno, node.id
        elif isinstance(node, ast.arg) and id(node) not in public:
            yield node.lineno, node.arg
        elif (
            isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and node.attr.startswith("_")
        ):
            yield node.lineno, node.attr.lstrip("_")
        elif isinstance(node, ast.alias) and node.asname:
            yield node.lineno, node.asname


def test_names_say_what_things_are():
    offenders = []
    for path in FILES:
        fields = {
            id(statement.target)
            for node in nodes(tree(path))
            if isinstance(node, ast.ClassDef)
            for statement in node.body
            if isinstance(statement, ast.AnnAssign)
        }
        stored = {(n.lineno, n.id) for n in nodes(tree(path)) if isinstance(n, ast.Name) and id(n) in fields}
        for line, name in names_of_things(path):
            if name in BANNED_IDENTIFIERS and (line, name) not in stored:
                offenders.append(f"{place(path)}:{line} {name}")
    counts = Counter(offender.split()[1] for offender in offenders)
    assert not offenders, f"{len(offenders)} names, {dict(counts)}:\n" + "\n".join(offenders)
