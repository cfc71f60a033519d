"""The numpy target: shapes, `out`, number types, operation counts and documentation of generated modules."""

from __future__ import annotations

import ast
import re
from functools import cache
from types import ModuleType

import numpy as np
import pytest
from derived import programs

from strapgen.catalogue import standard
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.run import compiler
from strapgen.targets import emit

KERNELS = [choice.kernel for choice in standard()]
STEPS = [kernel for kernel in KERNELS if "-rk" in kernel]


@cache
def generated(kernel: str) -> Sources:
    return emit(programs()[kernel], "numpy")


def text(kernel: str) -> str:
    (only,) = generated(kernel).files.values()
    return only


def module(kernel: str) -> ModuleType:
    return compiler.load(generated(kernel))


def function(kernel: str):
    return getattr(module(kernel), generated(kernel).function.name)


def samples(program: Program, batch: tuple[int, ...], rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return inputs in proper use: attitudes near orthonormal, all else small."""
    values = {}
    for signal in program.inputs:
        value = 0.3 * rng.normal(size=(*batch, *signal.shape))
        if signal.shape == (3, 3):
            value = np.linalg.qr(value)[0] + 1e-3 * rng.normal(size=value.shape)
        if signal.shape == (4,):
            value /= np.linalg.norm(value, axis=-1, keepdims=True)
        values[signal.name] = value
    return values


def as_tuple(result) -> tuple[np.ndarray, ...]:
    return result if isinstance(result, tuple) else (result,)


@pytest.mark.long
@pytest.mark.parametrize("kernel", KERNELS)
def test_leading_axes_are_samples(kernel, rng):
    program = programs()[kernel]
    inputs = samples(program, (2, 5), rng)
    together = as_tuple(function(kernel)(*inputs.values()))
    for result, value in zip(program.outputs, together, strict=True):
        assert value.shape == (2, 5, *result.signal.shape)
        assert value.dtype == np.float64
    for place in np.ndindex(2, 5):
        alone = as_tuple(function(kernel)(*(value[place] for value in inputs.values())))
        for one, all_ in zip(alone, together, strict=True):
            # numpy's vector loops may round sin and cos otherwise than its scalar ones.
            np.testing.assert_allclose(one, all_[place], rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("kernel", KERNELS)
def test_result_is_the_program_s(kernel, rng):
    program = programs()[kernel]
    inputs = samples(program, (), rng)
    known = {
        name: float(value)
        for signal in program.inputs
        for name, value in zip(signal.elements, np.ravel(inputs[signal.name]), strict=True)
    }
    wanted = program.run(known)
    got = as_tuple(function(kernel)(*inputs.values()))
    for result, value in zip(program.outputs, got, strict=True):
        expected = [float(x) for x in wanted[result.signal.name]]
        np.testing.assert_allclose(np.ravel(value), expected, rtol=1e-13, atol=1e-15)


def test_inputs_broadcast(rng):
    state = rng.normal(size=(4, 1, 4))
    increments = rng.normal(size=(3, 2, 3))
    result = function("euler-rk4-2")(state, increments)
    assert result.shape == (4, 3, 4)
    assert result[2, 1].tobytes() == function("euler-rk4-2")(state[2, 0], increments[1]).tobytes()


@pytest.mark.parametrize("kernel", KERNELS)
def test_out_may_be_an_input(kernel, rng):
    program = programs()[kernel]
    if len(program.outputs) > 1:
        assert "out=None" not in text(kernel)
        return
    shape = program.outputs[0].signal.shape
    inputs = samples(program, (6,), rng)
    wanted = function(kernel)(*inputs.values())
    fresh = np.full((6, *shape), np.nan)
    assert function(kernel)(*inputs.values(), out=fresh) is fresh
    assert fresh.tobytes() == wanted.tobytes()
    for signal in program.inputs:
        if signal.shape != shape:
            continue
        memory = {name: value.copy() for name, value in inputs.items()}
        shared = memory[signal.name]
        assert function(kernel)(*memory.values(), out=shared) is shared
        assert shared.tobytes() == wanted.tobytes(), signal.name
        # The same memory in another order of the elements.
        memory = {name: value.copy() for name, value in inputs.items()}
        turned = (
            np.swapaxes(memory[signal.name], -1, -2) if len(shape) == 2 else memory[signal.name][..., ::-1]
        )
        function(kernel)(*memory.values(), out=turned)
        np.testing.assert_array_equal(turned, wanted)


@pytest.mark.parametrize("kernel", KERNELS)
def test_inputs_are_left_alone(kernel, rng):
    inputs = samples(programs()[kernel], (3,), rng)
    before = {name: value.tobytes() for name, value in inputs.items()}
    for value in inputs.values():
        value.flags.writeable = False
    for result in as_tuple(function(kernel)(*inputs.values())):
        assert not any(np.shares_memory(result, value) for value in inputs.values())
    assert {name: value.tobytes() for name, value in inputs.items()} == before


def test_whole_numbers_are_not_cut():
    np.testing.assert_allclose(function("euler-normalize")([0, 0, 3, 4]), [0, 0, 0.6, 0.8])
    assert function("euler-normalize")(np.array([0, 0, 3, 4], np.float32)).dtype == np.float32


@pytest.mark.parametrize("kernel", STEPS)
def test_step_is_the_product_with_its_transition(kernel, rng):
    state, increments = samples(programs()[kernel], (7,), rng).values()
    transition = getattr(module(kernel), f"{generated(kernel).function.name}_transition")
    product = kernel.partition("-rk")[0] + "-product"
    separate = function(product)(state, transition(increments))
    np.testing.assert_allclose(function(kernel)(state, increments), separate, rtol=0, atol=4e-16)


# Operation counts, read from the module's syntax tree

BINARY = {ast.Add: "add", ast.Sub: "add", ast.Mult: "multiply", ast.Div: "divide"}
CALLS = {
    "sqrt": "sqrt",
    "maximum": "select",
    "where": "select",
    "sin": "function",
    "cos": "function",
    "arctan2": "function",
    "_sinc": "function",
    "_wrap": "function",
}
NO_OPERATIONS = {"asarray", "copy", "broadcast_shapes", "result_type", "empty"}


def counted(node: ast.AST) -> dict[str, int]:
    counts = dict.fromkeys(("add", "multiply", "divide", "sqrt", "negate", "select", "function"), 0)
    for part in ast.walk(node):
        if isinstance(part, ast.BinOp):
            counts[BINARY[type(part.op)]] += 1
        elif isinstance(part, ast.UnaryOp) and not isinstance(part.operand, ast.Constant):
            counts["negate"] += 1
        elif isinstance(part, ast.Call):
            name = part.func.attr if isinstance(part.func, ast.Attribute) else part.func.id
            if name not in NO_OPERATIONS:
                counts[CALLS[name]] += 1
    return counts


@pytest.mark.parametrize("kernel", KERNELS)
def test_operation_counts(kernel):
    program = programs()[kernel]
    parts = {program.name: program}
    if program.transition is not None:
        parts[f"{program.name}_transition"] = program.transition_program()
    functions = {
        node.name: node for node in ast.parse(text(kernel)).body if isinstance(node, ast.FunctionDef)
    }
    for helper in ("_sinc", "_wrap"):
        functions.pop(helper, None)
    assert functions.keys() == parts.keys()
    for name, part in parts.items():
        assert counted(functions[name]) == part.operations
        said = re.search(r"Operations: (.*?); (\d+) temporaries\.", ast.get_docstring(functions[name]) or "")
        assert said is not None
        shown = dict.fromkeys(part.operations, 0)
        if said[1] != "none":
            shown |= {kind: int(number) for number, kind in (word.split() for word in said[1].split(", "))}
        assert shown == part.operations
        assert int(said[2]) == part.temporaries


# Documentation


@pytest.mark.parametrize("kernel", KERNELS)
def test_module_documents_itself(kernel):
    program = programs()[kernel]
    said = " ".join((module(kernel).__doc__ or "").split())
    assert f"Generated by: strapgen generate {program.arguments} --target numpy" in said
    assert f"Source: {program.source}" in said
    for note in program.notes:
        assert note in said
    contract = " ".join((function(kernel).__doc__ or "").split())
    for signal in (*program.inputs, *(result.signal for result in program.outputs)):
        shape = ", ".join(["...", *map(str, signal.shape)])
        assert f"{signal.name} : array, ({shape}) {signal.meaning}, unit {signal.unit}" in contract
        if signal.bound is not None and signal in program.inputs:
            assert f"at most {signal.bound} in magnitude" in contract


@pytest.mark.parametrize("kernel", KERNELS)
def test_text_is_clean(kernel):
    assert text(kernel).endswith("\n") and not text(kernel).endswith("\n\n")
    assert all(line == line.rstrip() for line in text(kernel).splitlines())
    assert "\t" not in text(kernel) and "\r" not in text(kernel)


def test_sinc_is_one_at_zero():
    sinc = module("coning-increments")._sinc
    with np.errstate(all="raise"):
        np.testing.assert_allclose(sinc(np.array([0.0, -0.0, 0.5])), [1, 1, np.sin(0.5) / 0.5])
