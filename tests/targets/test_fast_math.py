"""Code in floating point is refused under -ffast-math; any order of its operations has a bound all the same."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import strapgen
from strapgen.ir.program import OPERATIONS

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "generated-code.md").read_text()
PROGRAM = strapgen.algorithm("euler", "rk4", increments=2).program()
NAMES = [name for signal in PROGRAM.inputs for name in signal.elements]
#: The box of the header: a state of at most 17/16, increments of at most 1/8 rad.
BOX = [Fraction(17, 16)] * 4 + [Fraction(1, 8)] * 6


def monomials() -> Fraction:
    """Return the largest sum of the magnitudes of all monomials, which no association or factoring changes."""
    of_magnitudes = {**OPERATIONS, "subtract": OPERATIONS["add"], "negate": lambda x: x}
    return max(PROGRAM.run(dict(zip(NAMES, BOX, strict=True)), abs, of_magnitudes)["next"])


def bound() -> Fraction:
    count = sum(PROGRAM.operations.values())
    return ((1 + Fraction(1, 1 << 53)) ** count - 1) * monomials()  # what is flushed adds 1e-306


def compiled(
    folder: Path, compiler: str, *options: str, target: str = "c"
) -> subprocess.CompletedProcess[str]:
    if shutil.which(compiler) is None:
        pytest.skip(f"needs {compiler}")
    sources = strapgen.generate(PROGRAM, target)
    for name, text in sources.step_files.items():
        (folder / name).write_text(text)
    words = [compiler, "-c", "-fPIC", *options, f"{sources.function.name}.c", "-o", "step.o"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True)
    if (
        done.returncode == 0
    ):  # linked without the options, whose start-up code flushes subnormals in the whole process
        subprocess.run([compiler, "-shared", "step.o", "-o", "step.so", "-lm"], cwd=folder, check=True)
    return done


def largest_error(folder: Path, name: str, number: type) -> Fraction:
    """Return the largest error of a compiled step on corners of the box and between them, against exact arithmetic."""
    step, out = getattr(ctypes.CDLL(str(folder / "step.so")), name), np.empty(4, number)
    random, worst = np.random.default_rng(5), Fraction(0)
    for k in range(400):
        spread = random.choice([-1.0, 1.0], 10) * (1 if k % 2 else random.uniform(0, 1, 10) ** 4)
        values = (spread * np.array(BOX, float)).astype(number)
        arrays = values[:4].copy(), values[4:].copy(), out
        step(*(ctypes.c_void_p(array.ctypes.data) for array in arrays))
        exact = PROGRAM.run(dict(zip(NAMES, map(Fraction, map(float, values)), strict=True)))["next"]
        worst = max(worst, *(abs(Fraction(float(a)) - b) for a, b in zip(out, exact, strict=True)))
    return worst


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("options", [("-Ofast",), ("-O3", "-ffast-math")], ids=" ".join)
def test_fast_mathematics_is_refused(tmp_path, compiler, options):
    said = compiled(tmp_path, compiler, *options)
    assert said.returncode != 0
    assert "never -ffast-math" in said.stderr


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("options", [(), ("-march=native",)], ids=["sse2", "native"])
def test_any_order_of_operations_stays_in_its_bound_and_passes_a_nan_on(tmp_path, compiler, options):
    done = compiled(tmp_path, compiler, "-Ofast", "-U__FAST_MATH__", *options)
    assert done.returncode == 0, done.stderr
    assert 0 < largest_error(tmp_path, "euler_rk4_2", np.float64) <= bound()
    step = ctypes.CDLL(str(tmp_path / "step.so")).euler_rk4_2
    state, increments, out = np.array([0.0, 0, 0, 1]), np.full(6, np.nan), np.zeros(4)
    step(*(ctypes.c_void_p(array.ctypes.data) for array in (state, increments, out)))
    assert np.isnan(out).all()


def test_code_with_larger_roundings_leaves_that_bound(tmp_path):
    assert compiled(tmp_path, "gcc", "-O2", "-ffp-contract=off", target="c-float").returncode == 0
    assert largest_error(tmp_path, "euler_rk4_2_float", np.float32) > bound()


def test_the_page_has_these_numbers():
    certified = max(strapgen.rounding_bounds(PROGRAM).errors["next"])
    count = sum(PROGRAM.operations.values())
    said = f"M is {float(monomials()):.3f} and N at most the {count} operations of the source, which gives "
    said += f"{float(bound()):.1e} in place of {float(certified):.1e}."
    assert said in PAGE.replace("\n", " ")
