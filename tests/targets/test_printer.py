"""The printers: parentheses keep the order of the operations, whatever tree is printed."""

from __future__ import annotations

import math
import random
import re
import shutil
import subprocess
from fractions import Fraction
from itertools import count
from typing import Any

import numpy as np
import pytest
from cffi import FFI
from hypothesis import assume, example, given
from hypothesis import strategies as st

from strapgen.ir.kernel_info import KernelInfo
from strapgen.ir.program import Assignment, Constant, Node, Operation, Program, Reference, Result
from strapgen.ir.signals import Signal
from strapgen.run.compiler import C_FLAGS
from strapgen.targets import c
from strapgen.targets.numpy_code import _NumpyPrinter
from strapgen.targets.numpy_code import emit as emit_numpy
from strapgen.targets.printer import fill, fill_arguments, fill_definition, fill_expression

NAMES = ("x_1", "x_2", "x_3", "x_4")
VALUES = dict(zip(NAMES, (1.1, -0.37, 3.0000000000000004, 7e-3), strict=True))
ARITHMETIC = ("add", "subtract", "multiply", "divide")


def program(*trees: Node) -> Program:
    """Return a program with one output element a tree."""
    names = tuple(f"y_{k}" for k in range(len(trees)))
    outputs = Signal("result", (len(trees),), names, meaning="the values")
    return Program(
        KernelInfo("trees", "Random trees", "a test", arguments="trees"),
        inputs=(Signal("argument", (len(NAMES),), NAMES, meaning="numbers"),),
        body=tuple(Assignment(name, tree) for name, tree in zip(names, trees, strict=True)),
        outputs=(Result(outputs, tuple(map(Reference, names))),),
    )


def run(tree: Node, number: Any) -> Any:
    """Run a tree as a program on numbers of the type `number`, its constants rounded to that type too."""
    constants: dict[str, Any] = {}
    fresh = (f"constant_{k}" for k in count())

    def without_constants(node: Node) -> Node:
        if isinstance(node, Constant):
            name = next(fresh)
            constants[name] = number(float(node.value))
            return Reference(name)
        if isinstance(node, Operation):
            return Operation(node.kind, tuple(map(without_constants, node.arguments)))
        return node

    twin = without_constants(tree)
    inputs = (Signal("argument", (len(NAMES),), NAMES), *map(Signal.scalar, constants))
    whole = Program(KernelInfo("twin", "", ""), inputs, (Assignment("y", twin),), (_scalar_result("y"),))
    with np.errstate(all="ignore"):
        return whole.run({name: number(value) for name, value in VALUES.items()} | constants)["result"][0]


def _scalar_result(name: str) -> Result:
    return Result(Signal.scalar("result"), (Reference(name),))


leaves = st.one_of(
    st.sampled_from(NAMES).map(Reference),
    st.fractions(-50, 50, max_denominator=24).map(Constant),
    st.sampled_from([Fraction(1, 10**9), Fraction(-(10**20))]).map(Constant),
)


def branches(children: st.SearchStrategy[Node]) -> st.SearchStrategy[Node]:
    two = st.tuples(children, children)
    test = two.map(lambda pair: Operation("at_least", pair))
    return st.one_of(
        st.builds(Operation, st.sampled_from((*ARITHMETIC, "maximum")), two),
        st.builds(Operation, st.just("negate"), st.tuples(children)),
        st.builds(Operation, st.just("select"), st.tuples(test, children, children)),
    )


trees = st.recursive(leaves, branches, max_leaves=24)

x, y, z = map(Reference, NAMES[:3])


def op(kind: str, *arguments: Node) -> Operation:
    return Operation(kind, arguments)


@given(trees)
@example(op("subtract", x, op("subtract", y, z)))
@example(op("subtract", x, op("add", y, z)))
@example(op("divide", x, op("multiply", y, z)))
@example(op("multiply", x, op("divide", y, z)))
@example(op("multiply", op("negate", op("add", x, y)), op("negate", z)))
@example(op("negate", op("negate", op("negate", x))))
@example(op("subtract", x, Constant(Fraction(-1, 3))))
@example(op("negate", Constant(Fraction(-1, 3))))
def test_python_text_has_the_value_of_the_tree(tree):
    try:
        wanted = run(tree, float)
    except ZeroDivisionError:
        assume(False)
    text = _NumpyPrinter().text(tree)
    values = {name: np.float64(value) for name, value in VALUES.items()}
    with np.errstate(all="ignore"):
        got = float(eval(text, {"np": np, **values}))
    assert got == wanted or (math.isnan(got) and math.isnan(wanted)), text


@pytest.mark.parametrize(
    ("tree", "text"),
    [
        (op("add", op("add", x, y), z), "x_1 + x_2 + x_3"),
        (op("add", x, op("add", y, z)), "x_1 + (x_2 + x_3)"),
        (op("subtract", x, op("multiply", y, z)), "x_1 - x_2 * x_3"),
        (op("multiply", op("add", x, y), z), "(x_1 + x_2) * x_3"),
        (op("divide", x, op("divide", y, z)), "x_1 / (x_2 / x_3)"),
        (op("divide", op("multiply", x, y), z), "x_1 * x_2 / x_3"),
        (op("negate", op("multiply", x, y)), "-(x_1 * x_2)"),
        (op("negate", op("negate", x)), "-(-x_1)"),
        (op("multiply", Constant(Fraction(-1, 2)), x), "-0.5 * x_1"),
    ],
)
def test_no_more_parentheses_than_needed(tree, text):
    assert _NumpyPrinter().text(tree) == text
    assert c.CPrinter(c.DOUBLE).text(tree) == text


def random_tree(draw: random.Random, depth: int) -> Node:
    if depth == 0 or draw.random() < 0.1:
        return draw.choice([*map(Reference, NAMES), Constant(Fraction(draw.randint(-60, 60) or 1, 24))])
    kind = draw.choice([*ARITHMETIC, *ARITHMETIC, "negate", "maximum", "select"])
    if kind == "select":
        test = op("at_least", random_tree(draw, depth - 1), random_tree(draw, depth - 1))
        return op(kind, test, random_tree(draw, depth - 1), random_tree(draw, depth - 1))
    return op(kind, *(random_tree(draw, depth - 1) for _ in range(1 if kind == "negate" else 2)))


def finite_trees(number: Any, wanted: int) -> list[Node]:
    """Return random trees whose value is finite and is reached without a division by zero."""
    draw = random.Random(1969)
    found: list[Node] = [op("negate", op("negate", x)), op("negate", Constant(Fraction(-1, 3)))]
    while len(found) < wanted:
        tree = random_tree(draw, draw.randint(2, 6))
        try:
            value = run(tree, number)
        except ZeroDivisionError:
            continue
        if isinstance(tree, Operation) and np.isfinite(value):
            found.append(tree)
    return found


@pytest.mark.parametrize(
    ("target", "real", "number"), [("c", c.DOUBLE, np.float64), ("c-float", c.FLOAT, np.float32)]
)
def test_compiled_text_has_the_value_of_the_tree(target, real, number, tmp_path):
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not on this machine")
    chosen = finite_trees(number, 50)
    sources = c.emit(program(*chosen), target)
    for name, text in sources.files.items():
        (tmp_path / name).write_text(text)
    source = next(tmp_path / name for name in sources.step_files if name.endswith(".c"))
    built = tmp_path / "trees.so"
    command = ["gcc", *C_FLAGS, "-shared", "-fPIC", "-o", str(built), str(source), "-lm"]
    subprocess.run(command, check=True)
    ffi = FFI()
    name = sources.function.name
    ffi.cdef(f"void {name}(const {real.name} *argument, {real.name} *result);")
    result = np.empty(len(chosen), number)
    argument = np.array(list(VALUES.values()), number)
    kind = f"{real.name}[]"
    getattr(ffi.dlopen(str(built)), name)(ffi.from_buffer(kind, argument), ffi.from_buffer(kind, result))
    np.testing.assert_array_equal(result, np.array([run(tree, number) for tree in chosen]))


def test_emitted_numpy_module_has_the_values_of_the_trees():
    """Long expressions are broken over lines; that must not change them."""
    chosen = finite_trees(np.float64, 200)
    (text,) = emit_numpy(program(*chosen), "numpy").files.values()
    scope: dict[str, Any] = {}
    exec(text, scope)
    wanted = np.array([run(tree, np.float64) for tree in chosen])
    with np.errstate(all="ignore"):
        got = scope["trees"](np.array(list(VALUES.values())))
    np.testing.assert_array_equal(got, wanted)


@given(trees)
@example(op("select", op("at_least", x, op("maximum", Constant(Fraction(1, 3)), x)), x, x))
def test_lines_break_at_spaces_and_behind_parentheses(tree):
    text = _NumpyPrinter().text(tree)
    wrapped = fill_expression(text, " " * 8, 40)
    assert re.sub(r"\(\n +", "(", wrapped).split() == text.split()


@pytest.mark.parametrize("filled", [fill_arguments, fill_expression])
def test_a_line_may_be_as_long_as_the_width(filled):
    text = "first, second, third"
    assert filled(text, "    ", len(text)) == text
    assert filled(text, "    ", len(text) - 1) == "first, second,\n    third"


def test_prose_is_wrapped_at_spaces_and_written_with_single_spaces_for_ends_of_lines():
    text = "first second third"
    assert fill(text, "    ", len(text)) == fill(f"{text} ", "", len(text) + 1) == text
    assert fill(text, "    ", len(text) - 1) == "first second\n    third"
    assert fill("first\nsecond", "", 40) == "first second"
    assert fill("", "") == fill("  ", "") == ""


@pytest.mark.parametrize("width", range(40, 60))
def test_no_line_of_a_macro_is_longer_than_the_width(width):
    values = ", ".join(f"{10**k}" for k in range(12))
    lines = fill_definition("NAME_OF_A_MACRO", f"{{{values}}}", "powers of ten", width).split("\n")
    assert lines[:2] == ["/* powers of ten */", "#define NAME_OF_A_MACRO \\"]
    assert max(map(len, lines)) <= width
    assert " ".join(line.strip(" \\") for line in lines[2:]) == f"{{{values}}}"
