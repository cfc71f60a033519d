"""Code under -ffast-math keeps its bound in any order and sees numbers that are not finite, or is refused."""

from __future__ import annotations

import ctypes
import json
import shutil
import subprocess
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from mpmath import mp, mpf

import strapgen
from strapgen import rounding_bounds
from strapgen.fixedpoint.bounded_series import with_declared_ranges
from strapgen.ir.interfaces import RoundingBounds
from strapgen.ir.program import DOUBLE_RESOLUTION, OPERATIONS, RESOLUTION, Operation, Program, walk

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "generated-code.md").read_text()
COMPILERS = pytest.mark.parametrize("compiler", ["gcc", "clang"])
TYPES = {"c": np.float64, "c-float": np.float32}


def program(name: str, method: str | None = None, increments: int | None = None) -> Program:
    return strapgen.lower(strapgen.derive(name, method, increments))


STEP = program("euler", "rk4", 2)
EXACT = program("euler", "magnus2", 2)
#: Steps, a recursion, a product, normalizations with roots and quotients, a step with series in place of sines.
PROGRAMS = {
    "step": STEP,
    "matrix": program("dcm", "rk3", 3),
    "recursion": program("coning-fast"),
    "product": program("euler-product"),
    "normalization": program("euler-normalize"),
    "dual rows": program("dcm-orthonormalize"),
    "conversion": program("dcm-from-euler"),
    "series": with_declared_ranges(EXACT, strapgen.Settings.of(largest_angle="1/8")),
}
#: The program whose exact results are wanted, where it is not that of the code.
MEANT = {"series": EXACT}
REFUSED = {"cosines": program("dcm-from-euler-angles"), "order": program("euler-from-dcm")}
NOT_FINITE = [np.nan, -np.nan, np.inf, -np.inf]


def compiled(
    folder: Path, compiler: str, program: Program, *options: str, target: str = "c"
) -> subprocess.CompletedProcess[str]:
    """Compile a function; it is linked without the options, whose start-up code would set the whole process."""
    if shutil.which(compiler) is None:
        pytest.skip(f"needs {compiler}")
    sources = strapgen.generate(program, target)
    for name, text in sources.step_files.items():
        (folder / name).write_text(text)
    words = [compiler, "-c", "-fPIC", "-Wall", "-Wextra", "-Wconversion", "-Werror", *options]
    words += [f"{sources.function.name}.c", "-o", "step.o"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True)
    if done.returncode == 0:
        subprocess.run([compiler, "-shared", "step.o", "-o", "step.so", "-lm"], cwd=folder, check=True)
    return done


class Call:
    """A compiled function on numbers of its type."""

    def __init__(self, folder: Path, program: Program, target: str) -> None:
        self.program, self.number = program, TYPES[target]
        name = strapgen.generate(program, target).function.name
        self._function = getattr(ctypes.CDLL(str(folder / "step.so")), name)

    def __call__(self, inputs: dict[str, np.ndarray]) -> np.ndarray:
        given = [np.array(inputs[s.name], self.number) for s in self.program.inputs]
        results = [np.zeros(r.signal.size, self.number) for r in self.program.outputs]
        self._function(*(ctypes.c_void_p(array.ctypes.data) for array in (*given, *results)))
        return np.concatenate(results)


def samples(program: Program, bounds: RoundingBounds, number: type, count: int = 200):
    """Yield inputs on corners of their ranges, inside and near zero; those of a normalization are nearly proper."""
    random, limits = np.random.default_rng(5), {c.value: float(c.high) for c in bounds.inputs}
    for k in range(count):
        inputs = {}
        for signal in program.inputs:
            if bounds.conditions:
                proper = np.eye(3).ravel() if signal.size == 9 else np.full(4, 0.5)
                values = proper * random.choice([-1.0, 1.0]) + random.uniform(-1, 1, signal.size) / 16
            else:
                spread = 1 if k % 2 else random.uniform(0, 1, signal.size) ** (4 if k % 4 else 400)
                values = random.choice([-1.0, 1.0], signal.size) * spread * limits[signal.name]
            inputs[signal.name] = values.astype(number)
        yield inputs


def exact(program: Program, inputs: dict[str, np.ndarray]) -> list:
    """Return the results in arithmetic of 50 digits."""
    values = {RESOLUTION: mpf(float(DOUBLE_RESOLUTION))}
    for signal in program.inputs:
        values |= dict(zip(signal.elements, map(mpf, map(float, inputs[signal.name])), strict=True))
    functions = {"sqrt": mp.sqrt, "sin": mp.sin, "cos": mp.cos, "sinc": mp.sinc}
    results = program.run(values, lambda c: mpf(c.numerator) / c.denominator, {**OPERATIONS, **functions})
    return [x for result in program.outputs for x in results[result.signal.name]]


def largest_share(call: Call, bounds: RoundingBounds, meant: Program) -> float:
    """Return the largest error of an element as a part of its bound, 0 where both are."""
    with mp.workdps(50):
        limits = [mpf(e.numerator) / e.denominator for each in bounds.any_order.errors.values() for e in each]
        worst = mpf(0)
        for inputs in samples(call.program, bounds, call.number):
            for computed, value, limit in zip(call(inputs), exact(meant, inputs), limits, strict=True):
                error = abs(mpf(float(computed)) - value)
                assert limit or not error
                worst = max(worst, error / limit if limit else mpf(0))
        return float(worst)


@COMPILERS
@pytest.mark.parametrize("target", TYPES)
@pytest.mark.parametrize("name", PROGRAMS)
def test_any_order_of_operations_stays_in_the_bound_of_the_header(tmp_path, compiler, target, name):
    code = PROGRAMS[name]
    done = compiled(tmp_path, compiler, code, "-O3", "-ffast-math", "-march=native", target=target)
    assert done.returncode == 0, done.stderr
    bounds = rounding_bounds(code, "float" if target == "c-float" else "double")
    share = largest_share(Call(tmp_path, code, target), bounds, MEANT.get(name, code))
    assert 0 < share <= 1


@COMPILERS
@pytest.mark.parametrize(
    "options", [("-Ofast",), ("-O3", "-ffast-math"), ("-O1", "-ffast-math")], ids=" ".join
)
@pytest.mark.parametrize("target", TYPES)
def test_a_number_that_is_not_finite_makes_all_outputs_nan(tmp_path, compiler, options, target):
    assert not compiled(tmp_path, compiler, STEP, *options, target=target).returncode
    call, largest = Call(tmp_path, STEP, target), float(np.finfo(TYPES[target]).max)
    proper = {"state": np.array([0.0, 0, 0, 1]), "increments": np.full(6, 0.01)}
    assert np.isfinite(call(proper)).all()
    for name, values in proper.items():
        for place in range(len(values)):
            for number in NOT_FINITE:
                inputs = {**proper, name: np.where(np.arange(len(values)) == place, number, values)}
                assert np.isnan(call(inputs)).all(), (name, place, number)
            for number in (largest, -largest, float(np.finfo(TYPES[target]).smallest_subnormal), -0.0):
                inputs = {**proper, name: np.where(np.arange(len(values)) == place, number, values)}
                finite = abs(number) < 1 or name == "state"
                assert not finite or np.isfinite(call(inputs)).all(), (name, place, number)


def test_numbers_beyond_the_range_of_the_bound_are_computed_as_without_the_option(tmp_path):
    inputs = {"state": np.array([2.0, -1, 0.5, 1]), "increments": np.array([0.5, -1, 0.25, 1, 0.75, -0.5])}
    (tmp_path / "fast").mkdir()
    results = []
    for folder, options in ((tmp_path, ("-O2",)), (tmp_path / "fast", ("-O3", "-ffast-math"))):
        assert not compiled(folder, "gcc", STEP, *options).returncode
        results.append(Call(folder, STEP, "c")(inputs))
    np.testing.assert_allclose(results[1], results[0], rtol=1e-12)


def test_an_output_may_be_an_input_that_is_not_finite(tmp_path):
    assert not compiled(tmp_path, "gcc", STEP, "-O3", "-ffast-math").returncode
    state, increments = np.array([0.0, 0, np.inf, 1]), np.zeros(6)
    step = ctypes.CDLL(str(tmp_path / "step.so")).euler_rk4_2
    step(*(ctypes.c_void_p(array.ctypes.data) for array in (state, increments, state)))
    assert np.isnan(state).all()


def test_without_the_test_of_its_bits_a_nan_does_not_reach_all_outputs(tmp_path):
    """Results that do not depend on it stay finite."""
    program = PROGRAMS["recursion"]
    sources = strapgen.generate(program, "c")
    text = sources.step_files["coning_fast.c"]
    for name, file in {
        **sources.step_files,
        "coning_fast.c": text.replace("_i(increment, 3)", "_i(increment, 0)"),
    }.items():
        (tmp_path / name).write_text(file)
    words = ["gcc", "-O3", "-ffast-math", "-shared", "-fPIC", "coning_fast.c", "-o", "step.so"]
    subprocess.run(words, cwd=tmp_path, check=True)
    inputs = {signal.name: np.zeros(signal.size) for signal in program.inputs}
    results = Call(tmp_path, program, "c")(inputs | {"increment": np.array([np.nan, 0, 0])})
    assert not np.isnan(results).all()


@COMPILERS
@pytest.mark.parametrize("name", REFUSED)
def test_code_without_such_a_bound_is_refused(tmp_path, compiler, name):
    done = compiled(tmp_path, compiler, REFUSED[name], "-O3", "-ffast-math")
    assert done.returncode != 0
    assert "never -ffast-math" in done.stderr


def test_loops_that_promise_the_bits_of_a_call_are_refused(tmp_path):
    for name, text in strapgen.generate(STEP, "c").files.items():
        (tmp_path / name).write_text(text)
    words = ["gcc", "-O2", "-ffast-math", "-c", "euler_rk4_2_runs.c"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode != 0
    assert "never -ffast-math" in done.stderr


@COMPILERS
def test_the_other_options_leave_the_program_as_it_is(tmp_path, compiler):
    """What only -ffast-math needs is no part of the program without it."""
    for number, text in enumerate((strapgen.generate(STEP, "c").step_files["euler_rk4_2.c"],) * 2):
        if number:
            kept, skipped = [], False
            for line in text.splitlines():
                skipped |= line == "#if defined(__FAST_MATH__)"
                kept += [line] * (not skipped)
                skipped &= line != "#endif"
            text = "\n".join(kept)
        (tmp_path / f"{number}.c").write_text(text)
    (tmp_path / "euler_rk4_2.h").write_text(strapgen.generate(STEP, "c").step_files["euler_rk4_2.h"])
    if shutil.which(compiler) is None:
        pytest.skip(f"needs {compiler}")
    programs = [
        subprocess.run(
            [compiler, "-E", "-P", f"{number}.c"], cwd=tmp_path, capture_output=True, text=True, check=True
        ).stdout
        for number in (0, 1)
    ]
    assert programs[0] == programs[1]
    assert "memcpy" not in programs[0]


CPP = """#include "euler_rk4_2.hpp"
#include <cstdio>
#include <cstring>
constexpr auto fixed = strapgen::euler_rk4_2(strapgen::euler_rk4_2_identity, {{0.0, 0.0, 0.0, 0.0, 0.0, 0.0}});
static_assert(fixed[3] <= 1.0 && fixed[3] >= 1.0, "known when compiled");
int main()
{
    std::array<double, 6> increments{};
    const std::uint64_t infinity = UINT64_C(0xfff0000000000000);
    std::memcpy(&increments[4], &infinity, sizeof infinity);
    const auto next = strapgen::euler_rk4_2(strapgen::euler_rk4_2_identity, increments);
    for (const double &element : next) {
        std::uint64_t bits;
        std::memcpy(&bits, &element, sizeof bits);
        std::printf("%llx\\n", static_cast<unsigned long long>(bits));
    }
}
"""


@pytest.mark.parametrize("compiler", ["g++", "clang++"])
def test_cpp_sees_them_too_and_stays_a_constant_expression(tmp_path, compiler):
    if shutil.which(compiler) is None:
        pytest.skip(f"needs {compiler}")
    for name, text in strapgen.generate(STEP, "cpp").step_files.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "main.cpp").write_text(CPP)
    words = [
        compiler,
        "-std=c++14",
        "-O3",
        "-ffast-math",
        "-Wall",
        "-Wextra",
        "-Werror",
        "main.cpp",
        "-o",
        "main",
    ]
    subprocess.run(words, cwd=tmp_path, check=True)
    said = subprocess.run(["./main"], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert said.split() == ["7ff8000000000000"] * 4


def monomials() -> Fraction:
    """Return the largest sum of the magnitudes of all monomials, which no association or factoring changes."""
    box = [Fraction(17, 16)] * 4 + [Fraction(1, 8)] * 6
    names = [name for signal in STEP.inputs for name in signal.elements]
    of_magnitudes = {**OPERATIONS, "subtract": OPERATIONS["add"], "negate": lambda x: x}
    return max(STEP.run(dict(zip(names, box, strict=True)), abs, of_magnitudes)["next"])


def test_the_bound_is_that_of_the_page():
    literals = [
        n.value
        for a in STEP.body
        for n in walk(a.value)
        if not isinstance(n, Operation) and hasattr(n, "value")
    ]
    inexact = sum(Fraction(float(value)) != value for value in literals)
    count = sum(STEP.operations.values())
    size = monomials()
    known = rounding_bounds(STEP)
    bound = ((1 + Fraction(1, 1 << 53)) ** (count + inexact) - 1) * size
    worst = max(known.any_order.errors["next"])
    assert bound <= worst <= bound * (1 + Fraction(1, 10**12))
    assert known.any_order.roundings == count + inexact
    said = (
        f"M is {float(size):.3f} and N {count + inexact}, the {count} operations and {inexact} literals of the source, "
        f"which gives {float(worst):.2e} in place of {float(max(known.errors['next'])):.2e}."
    )
    assert said in PAGE.replace("\n", " ")


def test_a_larger_error_would_be_found(tmp_path):
    """Code in float is off by more than the bound of a double."""
    assert not compiled(tmp_path, "gcc", STEP, "-O2", target="c-float").returncode
    assert largest_share(Call(tmp_path, STEP, "c-float"), rounding_bounds(STEP), STEP) > 1


def test_bounds_survive_json_and_say_why_there_are_none():
    bounds = rounding_bounds(PROGRAMS["dual rows"], "float")
    assert RoundingBounds.from_dict(json.loads(json.dumps(bounds.as_dict()))) == bounds
    assert bounds.as_data()["errors_in_any_order"].keys() == bounds.errors.keys()
    refused = rounding_bounds(REFUSED["cosines"])
    assert refused.errors and refused.any_order.without == "cosines"
    assert RoundingBounds.from_dict(refused.as_dict()) == refused
    assert "With -ffast-math: refused; there is no bound for cosines." in strapgen.generate(
        REFUSED["cosines"], "c"
    ).step_files["dcm_from_euler_angles.h"].replace("\n *     ", " ")


def test_a_series_adds_what_it_leaves_out():
    bounds = rounding_bounds(PROGRAMS["series"])
    unlimited = [replace(a, remainder=Fraction(0)) for a in PROGRAMS["series"].body]
    without = rounding_bounds(replace(PROGRAMS["series"], body=tuple(unlimited)))
    for more, less, whole in zip(
        *(b.any_order.errors["next"] for b in (bounds, without)), bounds.errors["next"], strict=True
    ):
        assert more == less + whole
