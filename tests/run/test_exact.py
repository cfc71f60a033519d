"""Arithmetic of many digits: the reference itself."""

from __future__ import annotations

import pickle
import subprocess
import sys
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from derived import program

import strapgen
from strapgen.catalogue import Choice, choose
from strapgen.ir.exceptions import InputTypeError
from strapgen.run import exact


@pytest.mark.parametrize("method", ["rk1", "rk4"])
def test_exact_runs_are_those_of_rationals(algorithm, method, rng):
    made = program(Choice(algorithm, method, 2))
    increments = rng.normal(scale=0.01, size=(3, 2, 3))
    state = list(made.attitude_step.identity)
    for row in increments.reshape(3, -1).tolist():
        values = dict(zip(made.inputs[0].elements, state, strict=True))
        values |= zip(made.inputs[1].elements, map(Fraction, row), strict=True)
        (state,) = made.run(values).values()
    wanted = np.array([float(element) for element in state])
    np.testing.assert_array_equal(exact.propagate(made, increments)[-1].ravel(), wanted)


@pytest.mark.long
def test_double_is_near_the_exact_run(algorithm, rng):
    increments = rng.normal(scale=0.01, size=(200, 2, 3))
    wanted = exact.propagate(program(Choice(algorithm, "rk4", 2)), increments)
    computed = strapgen.backend(algorithm, backend="numpy").propagate(increments)
    # 16 units of round-off a step bound the rounding in double.
    assert np.abs(computed - wanted).max() <= 200 * 16 * 2.0**-53
    start = wanted[100]
    rest = exact.propagate(program(Choice(algorithm, "rk4", 2)), increments[100:], start)
    assert np.abs(rest[-1] - wanted[-1]).max() <= 8 * 2.0**-53


def test_only_steps_are_run():
    with pytest.raises(ValueError, match="kernel error-matrix is no attitude step"):
        exact.propagate(program(Choice("error-matrix")), np.zeros((1, 2, 3)))


def test_the_back_end_is_the_reference_on_every_record(algorithm, rng):
    """Runs side by side, records and orthonormalization: each state is the rounded one of the run in 40 digits."""
    increments = rng.normal(scale=0.01, size=(2, 12, 2, 3))
    backend = strapgen.backend(algorithm, "rk4", backend="exact")
    states = backend.propagate(increments, 3)
    for run, history in zip(increments, states, strict=True):
        whole = exact.propagate(program(Choice(algorithm, "rk4", 2)), run)
        np.testing.assert_array_equal(history, whole[::3])
    restored = backend.propagate(increments[0], 1, 12)
    # The last state is restored before it is rounded: once in 40 digits, not twice in double.
    assert np.abs(restored[-1] - backend.orthonormalize(states[0, -1])).max() <= 4 * 2.0**-53
    np.testing.assert_array_equal(restored[:-1:3], states[0, :-1])


@pytest.mark.parametrize("backend_name", ["numpy", "exact"])
def test_nan_in_floating_point_is_nan_in_many_digits(backend_name):
    """A zero quaternion has no direction: its length divides by zero, and nothing raises."""
    normalize = strapgen.evaluator("euler-normalize", backend_name)
    with np.errstate(all="ignore"):
        states = normalize([[0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 2.0]])
    assert np.isnan(states[0]).all()
    np.testing.assert_array_equal(states[1], [0, 0, 0, 1])


def test_run_with_division_by_zero_continues_as_nan():
    backend = strapgen.backend("euler", "rk1", backend="exact")
    states = backend.propagate(np.zeros((4, 2, 3)), orthonormalize_every=2, initial=np.zeros(4))
    np.testing.assert_array_equal(states[:2], np.zeros((2, 4)))
    assert np.isnan(states[2:]).all()


@pytest.mark.long
def test_no_computer_algebra_where_the_program_is_cached(tmp_path):
    backend = strapgen.backend("euler", "rk2", backend="exact")
    backend.matrices(backend.orthonormalize(backend.identity))
    code = (
        "import sys; sys.modules['sympy'] = None; import numpy as np, strapgen;"
        "backend = strapgen.backend('euler', 'rk2', backend='exact');"
        "backend.matrices(backend.propagate(np.full((3, 2, 3), 0.01), orthonormalize_every=2))"
    )
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True)


def test_sources_with_text_are_refused():
    with pytest.raises(
        InputTypeError, match="sources of euler-rk4-2 for numpy hold text; a program is needed"
    ):
        exact.ExactEvaluator(strapgen.backend("euler").sources)


#: Sums and products, divisions and roots, choices, functions, and a step.
INTERPRETED = ("euler-product", "euler-normalize", "euler-from-dcm", "euler-angles-from-dcm", "coning-truth")


@pytest.mark.parametrize("digits", [15, exact.DIGITS, 61])
@pytest.mark.parametrize("kernel", INTERPRETED)
def test_integers_have_the_bits_of_mpmath(kernel, digits, rng):
    program = strapgen.pipeline.program(choose(kernel))
    with mpmath.workdps(digits):
        interpreter = exact.Interpreter(program)
        for scale in (1e-30, 1e-3, 1.0, 1e9):
            inputs = [
                [mpmath.mpf(x) * scale / 3 for x in rng.normal(size=signal.size).tolist()]
                for signal in program.inputs
            ]
            inputs[0][0] *= 0  # a zero has no bits
            elements = [name for signal in program.inputs for name in signal.elements]
            values = dict(zip(elements, (x for each in inputs for x in each), strict=True))
            wanted = program.run(values, exact.number, exact._OPERATIONS)
            assert interpreter._on_integers(values) == wanted
            for _ in range(exact._FIRST_RUNS):
                assert interpreter.outputs(*inputs) == wanted


def test_a_program_is_compiled_when_it_runs_often():
    interpreter = exact.Interpreter(strapgen.pipeline.program(choose("euler-normalize")))
    state = [mpmath.mpf(x) for x in (1, 2, 4, 2)]
    for _ in range(exact._FIRST_RUNS):
        first = interpreter(state)
    assert "_on_integers" not in vars(interpreter)
    assert interpreter(state) == first
    assert "_on_integers" in vars(interpreter)


def test_halves_are_rounded_to_the_even_number():
    with mpmath.workprec(4):
        product = exact.Interpreter(strapgen.pipeline.program(choose("euler-product")))
        one = [mpmath.mpf(x) for x in (0, 0, 0, 1)]
        # Of 5 and of 6 bits, half-way between two numbers of 4; 39 is no half.
        for value, nearest in ((17, 16), (19, 20), (-17, -16), (-19, -20), (34, 32), (38, 40), (39, 40)):
            many = mpmath.mp.make_mpf(mpmath.libmp.from_man_exp(value, 0))
            (state,) = product.outputs([many, *one[:2], one[2]], one).values()
            assert state == [nearest, 0, 0, 0]


def test_numbers_beyond_all_bounds_are_those_of_mpmath():
    normalize = exact.Interpreter(strapgen.pipeline.program(choose("euler-normalize")))
    with mpmath.workdps(exact.DIGITS):
        assert all(map(mpmath.isnan, normalize([mpmath.inf, *[mpmath.mpf(0)] * 3])[:1]))
        with pytest.raises(ZeroDivisionError):
            normalize([mpmath.mpf(0)] * 4)
        assert float(pickle.loads(pickle.dumps(normalize))([mpmath.mpf(2), *[mpmath.mpf(0)] * 3])[0]) == 1
