"""Programs as functions of other frameworks: the numbers of the C, and slopes that are finite and right."""

from __future__ import annotations

import sys
from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest

import strapgen
from strapgen.ir.kernel_info import KernelInfo
from strapgen.ir.program import Assignment, Constant, Operation, Program, Reference, Result
from strapgen.ir.signals import Signal
from strapgen.run import exact
from strapgen.run.frameworks import FRAMEWORKS

#: Those that differentiate.
SMOOTH = ("jax", "torch", "casadi")
#: Steps: a fourth-order one, one of sines and cosines of an angle that may be zero, and one in matrices.
STEPS = (("euler", "rk4", 2), ("euler", "coning-combined", 2), ("dcm", "magnus6", 3))
#: Rotations at zero, normalizations, branches, several outputs, scalars, arcs, and angles in whole turns.
KERNELS = (
    *("euler-update", "dcm-update", "euler-normalize", "dcm-orthonormalize", "dcm-orthonormalize-optimal"),
    *("euler-from-dcm", "euler-angles-from-dcm", "pulse-compensate", "coarse-leveling", "north-rate-sphere"),
    *("constant-truth", "coning-increments", "magnetic-heading", "select-hexad"),
)
EPSILON = np.finfo(float).eps


def framework(name: str):
    module = pytest.importorskip(name)
    if name == "jax":
        module.config.update("jax_enable_x64", True)
    return module


def program_of(kernel) -> Program:
    return strapgen.lower(strapgen.derive(kernel) if isinstance(kernel, str) else strapgen.derive(*kernel))


def samples(program: Program, seed: int = 0) -> list[np.ndarray]:
    """Return proper inputs: rotations, unit vectors, small angles."""
    random = np.random.default_rng(seed)
    values = []
    for signal in program.inputs:
        value = np.asarray(random.uniform(-1, 1, signal.shape)) / 8
        if signal.constraint == "rotation":
            value = np.linalg.qr(random.normal(size=(3, 3)))[0]
        elif signal.constraint == "unit":
            value = random.normal(size=signal.shape)
            value /= np.linalg.norm(value)
        values.append(value)
    return values


def called(name: str, program: Program, values) -> list[np.ndarray]:
    """Return the results of a framework's function as arrays in the shapes of the outputs."""
    results = program.function(name)(*(float(x) if not np.ndim(x) else x for x in values))
    results = results if isinstance(results, tuple) else (results,)
    convert = {"casadi": lambda x: x.full(), "sympy": lambda x: getattr(x, "tolist", lambda: x)()}
    arrays = [np.asarray(convert.get(name, np.asarray)(x), float) for x in results]
    return [x.reshape(r.signal.shape) for x, r in zip(arrays, program.outputs, strict=True)]


def slopes(name: str, program: Program, values, backwards: bool = False) -> np.ndarray:
    """Return the derivatives of the first output by all elements of all inputs.

    Forwards as a rule: backwards, a root at zero spoils the slopes of all outputs, even where it has no part in them.
    """
    function, module = program.function(name), framework(name)
    rows = program.outputs[0].signal.size

    def first(results):
        return results[0] if isinstance(results, tuple) else results

    if name == "casadi":
        symbols = [module.SX.sym(f"x{k}", *function.size_in(k)) for k in range(len(values))]
        flat = [module.vec(x.T) for x in (first(function(*symbols)), *symbols)]
        made = module.Function("slopes", symbols, [module.jacobian(flat[0], module.vertcat(*flat[1:]))])
        return made(*values).full()
    library = module.func if name == "torch" else module
    jacobian = name != "casadi" and (library.jacrev if backwards else library.jacfwd)
    if name == "jax":
        each = jacobian(lambda *x: first(function(*x)), argnums=tuple(range(len(values))))(*values)
    else:
        tensors = tuple(map(module.as_tensor, values))
        each = jacobian(lambda *x: first(function(*x)), argnums=tuple(range(len(values))))(*tensors)
    return np.hstack([np.asarray(x).reshape(rows, -1) for x in each])


def true_slopes(program: Program, values) -> np.ndarray:
    """Return the same from differences in 60 digits, whose step is 1e-20."""
    names = [name for signal in program.inputs for name in signal.elements]
    with mpmath.workdps(60):
        point = [mpmath.mpf(float(x)) for value in values for x in np.ravel(value)]
        step = mpmath.mpf(10) ** -20
        columns = []
        for k in range(len(point)):
            ends = []
            for sign in (1, -1):
                moved = [x + sign * step * (i == k) for i, x in enumerate(point)]
                run = program.run(dict(zip(names, moved, strict=True)), exact.number, exact._OPERATIONS)
                ends.append(run[program.outputs[0].signal.name])
            columns.append([float((a - b) / (2 * step)) for a, b in zip(*ends, strict=True)])
    return np.array(columns).T


# Values


@pytest.mark.parametrize("name", FRAMEWORKS)
@pytest.mark.parametrize("kernel", [*KERNELS, *STEPS], ids=str)
def test_the_numbers_are_those_of_the_c_to_its_rounding(name, kernel):
    framework(name)
    if (name, kernel) == ("sympy", "dcm-orthonormalize-optimal"):
        pytest.skip("takes SymPy twenty seconds")
    program = program_of(kernel)
    values = samples(program)
    if isinstance(kernel, str):
        in_c = strapgen.evaluator(kernel, "c")
        expected = in_c(*values)
    else:
        in_c = strapgen.backend(*kernel, backend="c")
        expected = in_c.step(*values)
    expected = expected if isinstance(expected, tuple) else (expected,)
    bounds = strapgen.rounding_bounds(program).errors
    for result, c, other in zip(program.outputs, expected, called(name, program, values), strict=True):
        # Both keep the bound of the header, where it has one.
        bound = 2 * float(max(bounds.get(result.signal.name, [0])))
        allowed = 0 if name == "numba" else np.maximum(bound, 4 * EPSILON * np.maximum(1, np.abs(c)))
        assert (np.abs(other - c) <= allowed).all(), result.signal.name


@pytest.mark.parametrize("name", ["jax", "torch"])
def test_leading_dimensions_are_broadcast(name):
    framework(name)
    program = program_of(STEPS[1])
    state = samples(program)[0]
    turns = np.random.default_rng(2).uniform(-1 / 8, 1 / 8, (5, 1, 2, 3))
    states = np.stack([state, -state, state[::-1]])
    together = np.asarray(program.function(name)(states, turns))
    assert together.shape == (5, 3, 4)
    assert np.abs(together - strapgen.backend(*STEPS[1]).step(states, turns)).max() < 4 * EPSILON


def test_jax_compiles_and_maps_it():
    jax = framework("jax")
    function = program_of(STEPS[0]).function("jax")
    states = np.random.default_rng(0).normal(size=(7, 4))
    turns = np.random.default_rng(1).uniform(-1 / 8, 1 / 8, (7, 2, 3))
    mapped = jax.jit(jax.vmap(function))(states, turns)
    bound = 4 * float(max(strapgen.rounding_bounds(program_of(STEPS[0])).errors["next"]))
    assert mapped.dtype == np.float64
    assert (
        np.abs(np.asarray(mapped) - np.asarray(function(states, turns))).max() <= bound * np.abs(states).max()
    )


def test_numba_calls_it_from_other_code():
    numba = framework("numba")
    step = program_of(STEPS[0]).function("numba")

    @numba.njit
    def run(state, turns):
        for k in range(len(turns)):
            state = step(state, turns[k])
        return state

    turns = np.random.default_rng(1).uniform(-1 / 8, 1 / 8, (20, 2, 3))
    identity = np.array([0.0, 0, 0, 1])
    assert np.array_equal(run(identity, turns), strapgen.backend(*STEPS[0], backend="c").propagate(turns)[-1])
    short = turns[0].astype(np.float32)
    assert np.array_equal(step(np.array([0, 0, 0, 1]), short), step(identity, short.astype(float)))
    with pytest.raises(ValueError, match=r"increments has another shape; \(2, 3\) is needed"):
        step(identity, turns[0].T.copy())


def test_sympy_is_exact():
    program = program_of(STEPS[0])
    names = [name for signal in program.inputs for name in signal.elements]
    numbers = [Fraction(k * k - 11, 3 * k + 5) for k in range(len(names))]
    result = program.function("sympy")(numbers[:4], [numbers[4:7], numbers[7:]])
    assert [Fraction(int(x.p), int(x.q)) for x in result] == program.run(
        dict(zip(names, numbers, strict=True))
    )["next"]


# Slopes


@pytest.mark.parametrize("at", ["zero", "anywhere"])
@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.parametrize(
    "kernel", ["euler-update", "dcm-update", "constant-truth", "coning-increments", *STEPS], ids=str
)
def test_slopes_are_finite_and_right(kernel, name, at):
    framework(name)
    program = program_of(kernel)
    values = samples(program, 3)
    if at == "zero":
        values = [v if s.constraint else 0 * v for v, s in zip(values, program.inputs, strict=True)]
    found, true = slopes(name, program, values), true_slopes(program, values)
    assert np.abs(found - true).max() < 1e-13 * max(1, np.abs(true).max())


@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.parametrize("step", STEPS, ids=str)
def test_slopes_are_those_of_the_exact_jacobian_kernels(step, name):
    framework(name)
    program = program_of(step)
    for values in (samples(program, 4), [samples(program, 4)[0], np.zeros(program.inputs[1].shape)]):
        algorithm, method, increments = step
        exactly = strapgen.evaluator(strapgen.choose(f"{algorithm}-jacobian", method, increments))(*values)
        assert np.abs(slopes(name, program, values) - np.hstack(exactly)).max() < 1e-14


def test_the_second_slope_at_zero_rotation_is_right():
    jax = framework("jax")
    function = program_of("euler-update").function("jax")
    state = np.array([0.0, 0, 0, 1])
    curvature = jax.hessian(lambda phi: function(state, phi))(np.zeros(3))
    expected = np.zeros((4, 3, 3))
    expected[3] = -np.eye(3) / 4  # cos(|phi|/2) = 1 - |phi|^2/8
    assert np.abs(np.asarray(curvature) - expected).max() < EPSILON


@pytest.mark.parametrize("name", SMOOTH)
def test_a_way_that_is_not_taken_has_no_part_in_slopes(name):
    framework(name)
    program = program_of("euler-angles-from-dcm")
    # Vertical: the roll is the previous one, and its arc has no slope.
    vertical = np.array([[0.0, -1, 0], [0, 0, 1], [-1, 0, 0]])
    roll = slopes(name, program, [vertical, np.array([0.3, 0, 0])])[0]
    assert roll.tolist() == [0.0] * 9 + [1.0, 0.0, 0.0]


@pytest.mark.parametrize("at", [(1e30, 0.1, 0.2), (0.3, 0.1, 0.2), (0, 0.1, 0.2)])
@pytest.mark.parametrize("name", SMOOTH)
def test_slopes_backwards_are_finite_where_series_and_ways_are_not_taken(name, at):
    framework(name)
    signal = Signal.vector("phi", "phi")
    x, y, z = map(Reference, signal.elements)
    square = Operation("multiply", (x, x))
    away = Operation("divide", (y, x))
    angle = Operation("atan2", (z, Reference("away")))
    body = (
        Assignment("away", away),
        Assignment("way", Operation("select", (Operation("at_least", (Constant(Fraction(0)), x)), y, angle))),
        Assignment("cosine", Operation("cos", (Operation("sqrt", (square,)),))),
    )
    info = KernelInfo("made-up", "Made up", "this test", arguments="made-up")
    result = Result(Signal("result", (2,), ("way", "cosine")), (Reference("way"), Reference("cosine")))
    found = slopes(name, Program(info, (signal,), body, (result,)), [np.array(at, float)], backwards=True)
    assert np.isfinite(found).all()
    assert at[0] or found[0].tolist() == [0.0, 1.0, 0.0]
    assert abs(found[1, 0] + np.sin(at[0])) < 1e-15


# Refusals


@pytest.mark.parametrize("name", FRAMEWORKS)
def test_a_missing_framework_is_named(name, monkeypatch):
    program = program_of(STEPS[0])
    monkeypatch.setitem(sys.modules, name, None)
    line = rf"^{name} is needed: pip install 'strapgen\[{name}\]'$"
    with pytest.raises(strapgen.MissingExtraError, match=line):
        program.function(name)


def test_an_unknown_framework_is_refused_with_those_there_are():
    with pytest.raises(
        strapgen.InputError, match=r"framework 'jaxx' is not known.*jax, torch, casadi, numba, sympy"
    ):
        program_of(STEPS[0]).function("jaxx")


def test_jax_in_32_bits_is_refused_at_once_and_later():
    jax = framework("jax")
    program = program_of(STEPS[0])
    function, values = program.function("jax"), samples(program)
    jax.config.update("jax_enable_x64", False)
    try:
        for call in (
            lambda: program.function("jax"),
            lambda: function(*values),
            lambda: jax.jit(function)(*values),
        ):
            with pytest.raises(strapgen.InputError, match=r"^jax computes in float32 here; .*jax_enable_x64"):
                call()
    finally:
        jax.config.update("jax_enable_x64", True)


@pytest.mark.parametrize("name", ["jax", "torch", "sympy"])
def test_wrong_arguments_are_refused(name):
    framework(name)
    function = program_of(STEPS[0]).function(name)
    turn = np.zeros((2, 3))
    with pytest.raises(
        strapgen.InputTypeError, match=r"^euler_rk4_2 takes state, increments; 1 arguments are given$"
    ):
        function(turn)
    with pytest.raises(
        strapgen.InputError,
        match=r"^state has shape \(3, 1\); .*4\) is needed$|^state has shape \(3,\); \(\.\.\., 4\)",
    ):
        function(np.zeros(3), turn)
    if name != "sympy":
        with pytest.raises(
            strapgen.InputError, match=r"^the leading dimensions \(2,\), \(3,\) of the inputs"
        ):
            function(np.zeros((2, 4)), np.zeros((3, 2, 3)))


def test_a_functions_help_has_its_arguments():
    function = program_of(STEPS[0]).function("sympy")
    assert function.__name__ == "euler_rk4_2"
    assert "increments (2, 3): " in function.__doc__


def test_frameworks_are_extras():
    import tomllib
    from pathlib import Path

    project = tomllib.loads((Path(__file__).resolve().parents[2] / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    for name in {*FRAMEWORKS} - {"sympy"}:
        assert any(requirement.startswith(name) for requirement in extras[name])


def test_the_old_name_of_the_chosen_name_warns():
    program = program_of(STEPS[0])
    with pytest.warns(DeprecationWarning, match="function is now chosen_name"):
        assert replace(program, function="mine_{}").chosen_name == "mine_{}"
