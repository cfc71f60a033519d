"""The names of the package: complete, documented, loaded when used, and typed for a user's scripts."""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys
import textwrap
import types
import venv
from pathlib import Path

import pytest
from public_names import public

import strapgen

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = Path(strapgen.__file__).parent


def in_a_new_process(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def after_imports() -> list[str]:
    """Return in a line each the names that `dir` shows after some modules were imported, and the names with kinds."""
    modules = ("cli", "navigation.two_speed.two_speed_runner", "firmware.check_code.conformance")
    return in_a_new_process(
        f"import {', '.join(f'strapgen.{module}' for module in modules)}, strapgen as s; s.derive('euler')\n"
        "print(*dir(s))\n"
        "print(*(n + ':' + type(getattr(s, n)).__name__ for n in s.__all__))"
    ).splitlines()


@pytest.mark.long
def test_dir_shows_the_public_names_and_nothing_else(after_imports):
    shown = after_imports[0].split()
    assert shown == sorted(strapgen.__all__)
    assert [name for name in shown if name.startswith("_")] == ["__version__"]
    hidden = {"annotations", "TYPE_CHECKING", "Any", "import_module", "pipeline", "checks", "cli"}
    assert hidden & {*shown} == set()


def test_neither_numpy_nor_sympy_is_loaded_with_the_package():
    loaded = in_a_new_process("import sys, strapgen; dir(strapgen); print(*sys.modules)").split()
    assert {"strapgen"} <= {*loaded}
    assert {"numpy", "sympy", "mpmath", "jinja2", "cffi"} & {*loaded} == set()


def test_names_are_independent_of_earlier_imports(after_imports):
    for name in strapgen.__all__:
        assert getattr(strapgen, name) is not None
    assert after_imports[1].split() == [
        f"{name}:{type(getattr(strapgen, name)).__name__}" for name in strapgen.__all__
    ]


def test_the_algebra_of_kernels_is_whole():
    algebra = strapgen.algebra
    assert [name for name in algebra.__all__ if not hasattr(algebra, name)] == []
    # Functions that admission allows in kernels of users, beside those of SymPy.
    assert {"Direction", "Wrapped"} <= {*algebra.__all__}
    public = {n for n, v in vars(algebra).items() if getattr(v, "__module__", "") == algebra.__name__}
    assert {name for name in public if not name.startswith("_")} <= {*algebra.__all__}


def test_a_name_that_is_not_there():
    with pytest.raises(AttributeError, match=r"^module 'strapgen' has no attribute 'derve'$"):
        strapgen.derve  # noqa: B018


def test_type_checkers_see_the_names_that_python_loads():
    tree = ast.parse((PACKAGE / "__init__.py").read_text())
    (block,) = (
        node
        for node in tree.body
        if isinstance(node, ast.If)
        and isinstance(node.test, ast.Attribute)
        and node.test.attr == "TYPE_CHECKING"
    )
    seen = {}
    for statement in block.body:
        if isinstance(statement, ast.Assign):  # a namespace that has another name than its module
            (target,) = statement.targets
            seen[target.id] = seen.pop(statement.value.id)
            continue
        assert isinstance(statement, ast.ImportFrom) and statement.level == 0
        for alias in statement.names:
            module = statement.module.removeprefix("strapgen").lstrip(".")
            private = alias.asname == f"_{alias.name}"
            assert private or alias.asname == alias.name, "a strict checker does not see the name"
            full = f"{module}.{alias.name}".lstrip(".")
            seen[alias.asname] = full if private or full in strapgen._NAMESPACES.values() else module
    loaded = dict(strapgen._EXPORTS) | dict(strapgen._NAMESPACES)
    assert seen == loaded
    assert ["__version__", *loaded] == strapgen.__all__
    assert len(loaded) == len(strapgen._EXPORTS) + len(strapgen._NAMESPACES)


def test_every_public_name_has_a_docstring():
    undocumented = []
    for name in strapgen.__all__:
        value = getattr(strapgen, name)
        if isinstance(value, types.FunctionType | type | types.ModuleType):
            text = value.__doc__ or ""
            if not inspect.cleandoc(text) or text.startswith(
                f"{name}("
            ):  # dataclasses write one of their own
                undocumented.append(name)
        elif name != "__version__":
            source = (PACKAGE / f"{strapgen._EXPORTS[name].replace('.', '/')}.py",)
            source += (PACKAGE / strapgen._EXPORTS[name].replace(".", "/") / "__init__.py",)
            text = next(path for path in source if path.is_file()).read_text()
            if not re.search(rf"^#: .*\n(?:#.*\n)*{name}\b", text, flags=re.MULTILINE):
                undocumented.append(name)
    assert undocumented == []


def without_example(values: dict[str, object]) -> list[str]:
    """Return the names of functions, methods, properties, classes and modules whose docstring has no example."""
    return [name for name, value in values.items() if ">>>" not in (inspect.getdoc(value) or "")]


def test_every_public_name_has_an_example():
    """`pytest` runs the examples of all docstrings; constants show themselves."""
    values = {name: getattr(strapgen, name) for name in strapgen.__all__} | public()
    members = vars(strapgen.AttitudeAlgorithm).items()
    values |= {f"AttitudeAlgorithm.{name}": value for name, value in members if not name.startswith("_")}
    kinds = types.FunctionType | types.ModuleType | type | property
    asked = {name: value for name, value in values.items() if isinstance(value, kinds)}
    assert len(asked) > 200
    assert without_example(asked) == []


def test_a_missing_example_is_seen():
    def documented():
        """>>> 1 + 1
        2
        """

    def silent():
        """Return nothing."""

    assert without_example({"documented": documented, "silent": silent}) == ["silent"]


def test_every_public_name_is_on_the_page_of_the_api():
    page = (ROOT / "docs" / "python-api.md").read_text()
    assert [name for name in strapgen.__all__ if not re.search(rf"\b{name}\b", page)] == []


@pytest.mark.parametrize("page", ["docs/python-api.md", "docs/own-algorithms.md", "README.md", "examples"])
def test_pages_and_examples_need_no_module_but_the_package(page):
    paths = sorted((ROOT / page).glob("*.py")) if page == "examples" else [ROOT / page]
    for path in paths:
        text = path.read_text()
        assert re.findall(r"(?:from|import) strapgen\.[\w.]+", text) == []
        for names in re.findall(r"from strapgen import (\([^)]*\)|.*)", text):
            assert {*re.findall(r"\w+", names)} <= {*strapgen.__all__}
        used = set(re.findall(r"(?<![\w/.-])strapgen\.(\w+)", text)) - {"exceptions", "algorithms"}
        assert used <= {*strapgen.__all__}


SCRIPT = """
    import numpy as np
    import strapgen
    from strapgen import KernelBuilder, Signal, gyro, tableaux

    kernel = strapgen.derive("euler", strapgen.TABLEAUX["rk4"], 2)
    backend = strapgen.build(strapgen.generate(strapgen.lower(kernel), "c"))
    run = strapgen.simulate(backend, strapgen.motion("constant", x_deg_s=1), "0.1", 1)
    reveal_type(kernel)  # strapgen.kernel.kernel.Kernel
    reveal_type(backend)  # strapgen.run.backends.Backend
    reveal_type(run)  # strapgen.lab.runs.Run
    reveal_type(strapgen.compare)  # strapgen.lab.comparison.Comparisons
    alg = strapgen.algorithm("euler", "rk4", increments=2)
    reveal_type(alg.formulas.latex)  # strapgen.results.display.formulas._Text
    reveal_type(alg.generate("c-fixed", word=16, step="0.01"))  # strapgen.ir.sources.Sources
    reveal_type(alg.quantize(word=16))  # strapgen.ir.integer_program.FixedProgram
    reveal_type(strapgen.check(alg).holds)  # bool
    reveal_type(alg.compare()[0])  # strapgen.lab.comparison.Comparison
    reveal_type(strapgen.METHODS["rk4"])  # str
    reveal_type(gyro.pulses)  # def (
    reveal_type(tableaux.read("heun.toml"))  # strapgen.catalogue.methods.tableaux.Tableau
    reveal_type(KernelBuilder().input(Signal.vector("rate", "w")))  # Any
"""

WRONG = """
    import strapgen

    strapgen.derve("euler")  # [attr-defined]
    strapgen.lower("euler")  # [arg-type]
    strapgen.build(strapgen.derive("euler"))  # [arg-type]
    strapgen.algorithm("euler").generate("c-fixed", word="16")  # [arg-type]
"""


def checked(folder: Path, **scripts: str) -> str:
    """Return what mypy says of scripts by strict rules, in an environment where `py.typed` of the package counts."""
    venv.create(folder / "venv", with_pip=False)
    (packages,) = (folder / "venv").glob("lib/python*/site-packages")
    import numpy as np

    (packages / "places.pth").write_text(f"{PACKAGE.parent}\n{Path(np.__file__).parents[1]}\n")
    for name, script in scripts.items():
        (folder / f"{name}.py").write_text(script)
    python = str(folder / "venv" / "bin" / "python")
    command = [sys.executable, "-m", "mypy", "--strict", "--no-incremental", "--python-executable", python]
    command += [f"{name}.py" for name in scripts]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True).stdout


@pytest.mark.long
def test_a_user_s_script_is_typed(tmp_path):
    scripts = {"right": textwrap.dedent(SCRIPT), "wrong": textwrap.dedent(WRONG)}
    said = checked(tmp_path, **scripts)
    expected = {
        (name, number): line.split("  # ")[1]
        for name, script in scripts.items()
        for number, line in enumerate(script.splitlines(), 1)
        if "  # " in line
    }
    found = {}
    for name, line, text in re.findall(r"^(\w+)\.py:(\d+): (?:note|error): (.*)$", said, flags=re.MULTILINE):
        found.setdefault((name, int(line)), text)
    assert found.keys() == expected.keys(), said
    for place, words in expected.items():
        assert words in found[place], said


#: Names that are SymPy's own, which has no types.
OF_SYMPY = {"EPSILON", "algebra.CROSS", "algebra.PAULI"}


def untyped(lines: list[str], said: str) -> dict[str, str]:
    """Return the expressions of a script's lines whose revealed type is not known, each with that type."""
    types_ = dict(re.findall(r'^all\.py:(\d+): note: Revealed type is "(.*)"$', said, flags=re.MULTILINE))
    asked = {line[12:-1]: types_.get(str(number), "") for number, line in enumerate(lines, 1) if "(" in line}
    return {name: kind for name, kind in asked.items() if re.fullmatch(r"|Any|.*cache_wrapper.*", kind)}


@pytest.mark.long
def test_every_public_name_has_a_known_type(tmp_path):
    names = [f"strapgen.{name}" for name in public()]
    methods = [name for name in vars(strapgen.AttitudeAlgorithm) if not name.startswith("_")]
    names += [f'strapgen.algorithm("euler").{name}' for name in methods]
    lines = ["import strapgen", *(f"reveal_type({name})" for name in names)]
    said = checked(tmp_path, all="\n".join(lines))
    assert len(names) > 200 and "error" not in re.sub(r"note: .*", "", said)
    assert {name.removeprefix("strapgen.") for name in untyped(lines, said)} <= OF_SYMPY


def test_an_unknown_type_is_seen():
    lines = [
        "import strapgen",
        "reveal_type(strapgen.a)",
        "reveal_type(strapgen.b)",
        "reveal_type(strapgen.c)",
    ]
    said = 'all.py:2: note: Revealed type is "Any"\nall.py:3: note: Revealed type is "def (x: int) -> int"\n'
    assert untyped(lines, said) == {"strapgen.a": "Any", "strapgen.c": ""}


def test_the_package_says_that_it_is_typed():
    assert (PACKAGE / "py.typed").is_file()
