"""Motions of a rate in SymPy: increments and attitude are true within proved bounds, or the file is refused."""

from __future__ import annotations

import math
import shlex
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from mpmath import iv, mp

import strapgen
from strapgen.analysis.series.series import series
from strapgen.cli import main
from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.rate_expressions import Jets, UnboundedError, operations_of, time_symbol
from strapgen.lab.motions.rate_motion import DIGITS, RATE_DEGREE, Integrated
from strapgen.lab.motions.users_motions import read_motion
from strapgen.run.exact import interpreter

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "own_rate.py"
T = time_symbol()

#: The motions of the thesis with numbers, as the built-in ones take them, and as a user writes their rate.
THESIS = {
    "constant": ({"x_deg_s": 10, "y_deg_s": -20, "z_deg_s": 5}, "[sp.pi / 18, -sp.pi / 9, sp.pi / 36]"),
    "sinusoidal": ({"a_deg_s": 30, "b_rad_s": 2}, "[0, sp.pi / 6 * sp.cos(2 * t), 0]"),
    "coning": (
        {"a_deg_s": 10, "b_deg_s": 90, "g_deg_s": 10},
        "[sp.pi / 18 * sp.sin(sp.pi * t / 2), sp.pi / 18, sp.pi / 18 * sp.cos(sp.pi * t / 2)]",
    ),
    "polynomial": (
        {"a0": 10, "a1": -2, "a2": 1, "a3": "-1/10", "a4": "1/200"},
        "[0, sp.pi / 180 * (10 - 2 * t + t**2 - t**3 / 10 + t**4 / 200), 0]",
    ),
}


def written(folder: Path, rate: str, before: str = "") -> str:
    path = folder / "rate.py"
    path.write_text(f"import sympy as sp\n{before}\ndef rate_expression(t):\n    return {rate}\n")
    return str(path)


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.long) if n in ("sinusoidal", "polynomial") else n for n in THESIS],
)
def test_the_motions_of_the_thesis_are_those_that_are_built_in(name, tmp_path):
    settings, rate = THESIS[name]
    built_in, users = strapgen.motion(name, **settings), read_motion(written(tmp_path, rate), 10)
    times = np.linspace(0, 10, 41)
    assert np.abs(users.attitude(times) - built_in.attitude(times)).max() < 1e-12
    assert np.abs(users.rate(times) - built_in.rate(times)).max() < 1e-12
    for window in ((2, 0, 0), (1, 3, 0), (1, 2, 4)):
        rows = [motion.increments(Fraction(1, 8), 80, *window) for motion in (users, built_in)]
        assert rows[0].shape == (80, sum(window), 3)
        assert np.abs(rows[0] - rows[1]).max() < 1e-12


def test_increments_have_forty_digits_and_the_attitude_is_within_its_bound():
    a, b, g = sp.pi / 10, sp.Integer(3), sp.Rational(1, 7)
    rate = [a * sp.sin(b * T), g, a * sp.cos(b * T)]
    integrated = Integrated("coning", *operations_of("coning", rate))
    with mp.workdps(DIGITS):
        truth = interpreter("coning-truth")
        for time in (mp.mpf(7) / 3, mp.mpf(10)):
            piece = integrated.piece(time)
            angle = [a * (1 - mp.cos(b * time)) / b, g * time, a * mp.sin(b * time) / b]
            angle = [mp.mpf(sp.N(x, DIGITS)) for x in angle]
            off = max(abs(x - y) for x, y in zip(piece.angle_at(time), angle, strict=True))
            assert off <= piece.angle_error < 1e-38
            values = [[mp.mpf(sp.N(x, DIGITS))] for x in (a, b, g)]
            true = truth([time], *values)
            computed = [x for row in piece.attitude_at(time) for x in row]
            assert max(abs(x - y) for x, y in zip(computed, true, strict=True)) <= piece.error < 1e-22


def test_what_the_polynomial_of_a_rate_leaves_out_is_within_the_bound():
    """A power of the time leaves out one term, which is known: of a longer piece it would be above the tolerance."""
    power = RATE_DEGREE + 1
    integrated = Integrated(
        "power", *operations_of("power", [2**60 * T**power, sp.Integer(0), sp.Integer(0)])
    )
    with mp.workdps(DIGITS):
        piece = integrated.piece(mp.mpf(0))
        true = mp.mpf(2) ** 60 * piece.middle ** (power + 1) / (power + 1)
        assert abs(piece.angle_at(piece.middle)[0] - true) <= piece.angle_error < 1e-39
        longer = mp.mpf(2) ** 60 * (2 * piece.half) ** (power + 1) / (power + 1)
        assert longer > piece.angle_error


def test_time_runs_backwards_too():
    integrated = Integrated("odd", *operations_of("odd", [sp.exp(T), T**3, sp.sqrt(4 + T)]))
    with mp.workdps(DIGITS):
        piece = integrated.piece(mp.mpf(-2))
        true = [mp.exp(-2) - 1, mp.mpf(4), (mp.sqrt(2) ** 3 - 8) * 2 / 3]
        assert max(abs(x - y) for x, y in zip(piece.angle_at(mp.mpf(-2)), true, strict=True)) < 1e-38


@pytest.mark.parametrize(
    "expression",
    [
        T**3 - 2 * T + 1,
        1 / (2 + sp.cos(T)),
        sp.sqrt(3 + sp.sin(T)),
        sp.exp(-(T**2) / 2) * sp.log(2 + T),
        sp.tan(T / 3) ** -2,
    ],
)
def test_bounds_of_taylor_coefficients_hold_over_the_interval(expression):
    operations, (place, *_) = operations_of("this", [expression] * 3)
    order, (low, high) = 6, (1.0, 1.25)
    bounds = Jets(order, bounds=True).evaluated(operations, iv.mpf([low, high]))[place].coefficients
    derivatives = [expression]
    for _ in range(order):
        derivatives.append(sp.diff(derivatives[-1], T))
    with mp.workdps(DIGITS):
        for time in (low, 1.1, high):
            exact = [
                derivative.subs(T, sp.Rational(time)) / sp.factorial(k)
                for k, derivative in enumerate(derivatives)
            ]
            jet = Jets(order, bounds=False).evaluated(operations, mp.mpf(time))[place].coefficients
            for bound, coefficient, value in zip(bounds, jet, exact, strict=True):
                assert abs(coefficient - mp.mpf(sp.N(value, DIGITS))) < 1e-40 * (1 + abs(coefficient))
                assert abs(float(coefficient)) <= bound * (1 + 1e-12)


def test_a_divisor_that_may_vanish_has_no_bound():
    operations, _ = operations_of("this", [1 / (T - 1)] * 3)
    with pytest.raises(UnboundedError):
        Jets(3, bounds=True).evaluated(operations, iv.mpf([0.5, 1.5]))


@pytest.mark.long
def test_attitudes_are_rotations_and_begin_without_one():
    users = read_motion(EXAMPLE, 5)
    assert (users.attitude(0.0) == np.eye(3)).all()
    matrices = users.attitude(np.linspace(0, 5, 6).reshape(2, 3))
    assert matrices.shape == (2, 3, 3, 3)
    # Nine elements, each rounded once to double.
    assert np.abs(matrices @ np.swapaxes(matrices, -1, -2) - np.eye(3)).max() < 1e-15
    assert users.error_bound(5.0) < 1e-20


@pytest.mark.long
def test_the_order_of_a_step_is_seen_on_it():
    backend = strapgen.backend("euler", "rk4", 2)
    users = read_motion(EXAMPLE, 2)
    true = users.attitude(2.0)
    errors = []
    for steps in (16, 32):
        run = strapgen.simulate(backend, users, Fraction(2, steps), 2)
        errors.append(np.abs(run.computed[-1] - true).max())
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.2)


def test_a_rate_shows_an_order_below_the_rounding_of_double():
    # Sixth order at steps of 1/32 s is off by 1e-15 rad, which is hidden in double.
    choice = strapgen.choose("euler", "butcher6", 6)
    ladder = strapgen.converge(choice, read_motion(EXAMPLE, 1), ["1/8", "1/16", "1/32"], 1)
    assert all(rung.used for rung in ladder.rungs)
    assert ladder.rungs[-1].error_rad < 5e-13
    assert ladder.observed == pytest.approx(6, abs=0.15)


def test_functions_of_a_file_run_in_many_digits_down_to_their_own_rounding():
    users = read_motion(EXAMPLE.with_name("own_motion.py"), 1)
    steps = ["1/8", "1/16", "1/32", "1/64", "1/128"]
    ladder = strapgen.converge(strapgen.choose("euler", "butcher6", 6), users, steps, 1)
    assert [rung.used for rung in ladder.rungs] == [
        rung.error_rad > 8 * 2.0**-52 / rung.step_s for rung in ladder.rungs
    ]  # rounding of the file's doubles adds at most eight units a step
    assert sum(rung.used for rung in ladder.rungs) == 2
    assert ladder.observed == pytest.approx(6, abs=0.2)


def test_a_step_with_samples_ahead_runs_in_many_digits_as_in_double():
    choice = strapgen.choose("euler", "window-3-3", 1)
    for name in ("own_rate.py", "own_motion.py"):
        users = read_motion(EXAMPLE.with_name(name), 1)
        double, digits = (
            strapgen.converge(choice, users, ["1/2", "1/4"], 1, name) for name in ("numpy", "exact")
        )
        for one, other in zip(double.rungs, digits.rungs, strict=True):
            assert one.error_rad == pytest.approx(other.error_rad, rel=1e-3)


def test_series_of_a_rate_in_sympy_are_those_of_the_built_in_motion(tmp_path):
    path = written(tmp_path, "[sp.sin(2 * t) / 3, sp.Rational(1, 5), sp.cos(2 * t) / 3]")
    choice = strapgen.choose("euler", "rk2", 1)
    users, built_in = series(choice, path, 1), series(choice, "coning", 1)
    values = {sp.Symbol("a"): sp.Rational(1, 3), sp.Symbol("b"): 2, sp.Symbol("g"): sp.Rational(1, 5)}
    assert users.drift.keys() == built_in.drift.keys() == {3}
    for one, other in zip(users.drift[3], built_in.drift[3], strict=True):
        assert sp.simplify(one - other.subs(values)) == 0


COMMANDS = (
    "simulate euler --method window-7-7 --step 0.25 --duration 1 --format json",
    "simulate euler --rates --step 0.25 --duration 1 --format json",
    "compare euler --step 0.25 --duration 1 --backend numpy,exact --format json",
    "converge euler --steps 0.5,0.25 --duration 1 --backend numpy --format json",
    "converge euler --method window-7-7 --steps 0.5,0.25 --duration 1 --format json",
    "study word-length --words 16 --increments 1 --methods window-3-3 --duration 1 --steps 0.25 --format json",
    "frontier --method coning-compressed:1+1 --duration 1 --format json",
    "study velocity-position --method rk4:2 --duration 1 --format json",
    "series euler --method rk2 --terms 1 --format json",
)


@pytest.mark.parametrize("command", [pytest.param(command, marks=pytest.mark.long) for command in COMMANDS])
def test_commands_take_a_rate(command, capsys):
    with pytest.raises(SystemExit) as stop:
        main([*shlex.split(command), "--motion", str(EXAMPLE)])
    assert stop.value.code == 0, capsys.readouterr().err


BAD = {
    "[0.1 * t, 0, 0]": "the rate about x holds the inexact number 0.1; sympy.Rational writes it exactly",
    "[t, 0]": "rate_expression returns 2 elements; three expressions are needed",
    "5": "rate_expression returns int; three expressions are needed",
    "['import os', 0, 0]": "three expressions are needed",
    "[sp.Symbol('k') * t, 0, 0]": "the rate about x holds k; t alone is allowed",
    "[0, sp.Abs(t), 0]": "the rate holds Abs(t); allowed are exact numbers, t,",
    "[0, t**sp.Rational(1, 3), 0]": "the rate holds t**(1/3); allowed are",
    "[0, 0, sp.I * t]": "the rate holds I, which is no real number",
    "[1 / (t - 1), 0, 0]": "the rate has no bound, or no smooth course, near t = 1.000 s",
    "[sp.sqrt(1 - t), 0, 0]": "the rate has no bound, or no smooth course, near t = 1.000 s",
    "[sp.log(t + 1), 0, 1 / 0]": "ZeroDivisionError",
}


@pytest.mark.parametrize(
    "rate", [pytest.param(r, marks=pytest.mark.long) if r.startswith("[sp.sqrt") else r for r in BAD]
)
def test_a_bad_rate_is_refused_in_one_line(rate, tmp_path):
    with pytest.raises(InputError) as refusal:
        read_motion(written(tmp_path, rate), 2)
    assert BAD[rate] in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_one_way_of_stating_a_motion_is_enough(tmp_path):
    path = written(tmp_path, "[t, 0, 0]", "def attitude(t):\n    return None")
    with pytest.raises(InputError, match="defines rate_expression and attitude; one of both ways is needed"):
        read_motion(path, 1)


def test_a_motion_of_numbers_has_no_series():
    own = EXAMPLE.with_name("own_motion.py")
    with pytest.raises(InputError, match="has no function rate_expression, from which series are derived"):
        series(strapgen.choose("euler", "rk2", 1), str(own))
