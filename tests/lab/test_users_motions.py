"""Motions in files of users: they agree with those of the catalogue, and cannot contradict themselves."""

from __future__ import annotations

import math
import re
import shlex
import sys
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
from strapgen.lab.motions.rate_motion import DIGITS, RATE_DEGREE, IntegratedRate
from strapgen.lab.motions.users_motions import any_motion, read_motion, require_consistent
from strapgen.run.exact import interpreter

BEGIN = """
import numpy as np

def skew(x, y, z):
    o = np.zeros(np.broadcast(x, y, z).shape)
    return np.moveaxis(np.array([[o, -z + o, y + o], [z + o, o, -x + o], [-y + o, x + o, o]]), (0, 1), (-2, -1))

def turn(axis, angle):
    # Rodrigues's rotation about a unit vector.
    K, s, c = skew(*axis), np.sin(angle)[..., None, None], np.cos(angle)[..., None, None]
    return np.eye(3) + s * K + (1 - c) * (K @ K)

def increments(step, steps, samples, previous=0, ahead=0):
    k = np.arange(steps)[:, None] * samples + np.arange(-previous, samples + ahead)
    return increment(k * step / samples, step / samples)

def rate(t):
    return vector(*rates(np.asarray(t, float)))

def vector(*parts):
    return np.stack(np.broadcast_arrays(*parts), axis=-1) * 1.0
"""
#: The four motions of the thesis as a user writes their functions, their settings in the catalogue, and their rate.
THESIS = {
    "constant": (
        """
w = np.array([0.1, -0.2, 0.3])
def rates(t): return tuple(x + 0 * t for x in w)
def increment(t, h): return vector(*(x * h + 0 * t for x in w))
def attitude(t):
    n = np.linalg.norm(w)
    return turn(w / n, n * np.asarray(t, float))
""",
        {"x_rad_s": 0.1, "y_rad_s": -0.2, "z_rad_s": 0.3},
        "[sp.Rational(1, 10), -sp.Rational(1, 5), sp.Rational(3, 10)]",
    ),
    "sinusoidal": (
        """
a, b = 0.4, 1.3
def rates(t): return 0, a * np.cos(b * t), 0
def increment(t, h): return vector(0, 2 * a / b * np.cos(b * (t + h / 2)) * np.sin(b * h / 2), 0)
def attitude(t): return turn((0, 1, 0), a / b * np.sin(b * np.asarray(t, float)))
""",
        {"a_rad_s": 0.4, "b_rad_s": 1.3},
        "[0, sp.Rational(2, 5) * sp.cos(13 * t / 10), 0]",
    ),
    "coning": (
        """
a, b, g = 0.4, 1.3, -0.2
def rates(t): return a * np.sin(b * t), g, a * np.cos(b * t)
def increment(t, h):
    size = 2 * a / b * np.sin(b * h / 2)
    return vector(size * np.sin(b * (t + h / 2)), g * h, size * np.cos(b * (t + h / 2)))
def attitude(t):
    t = np.asarray(t, float)
    s = np.hypot(a, b + g)
    return turn((0, (b + g) / s, a / s), s * t) @ turn((0, 1, 0), -b * t)
""",
        {"a_rad_s": 0.4, "b_rad_s": 1.3, "g_rad_s": -0.2},
        "[2 * sp.sin(13 * t / 10) / 5, -sp.Rational(1, 5), 2 * sp.cos(13 * t / 10) / 5]",
    ),
    "polynomial": (
        """
c = np.radians([3.0, -0.5, 0.1, -0.02, 1e-3])
def angle(t): return sum(x * t ** (k + 1) / (k + 1) for k, x in enumerate(c))
def rates(t): return 0, sum(x * t**k for k, x in enumerate(c)), 0
def increment(t, h): return vector(0, angle(t + h) - angle(t), 0)
def attitude(t): return turn((0, 1, 0), angle(np.asarray(t, float)))
""",
        {"a0": 3, "a1": "-0.5", "a2": "0.1", "a3": "-0.02", "a4": "1e-3"},
        "[0, sp.pi / 180 * (3 - t / 2 + t**2 / 10 - t**3 / 50 + t**4 / 1000), 0]",
    ),
}

CONING = THESIS["coning"][0]
#: What a user may get wrong, what is said of it, and the time at which it begins.
FAULTS = {
    "another sign in the attitude": (
        CONING.replace("-b * t)", "b * t)"),
        "the attitude is not what the increments lead to",
        0.0,
    ),
    "the attitude slips later": (
        CONING.replace(
            "t = np.asarray(t, float)", "t = np.asarray(t, float); t = t + 1e-5 * np.maximum(t - 7.3, 0)"
        ),
        "the attitude is not what the increments lead to",
        7.3,
    ),
    "another rate": (
        CONING.replace("return a * np.sin(b * t), g", "return a * np.sin(b * t), g + 1e-6 * (t > 4)"),
        "the increments are not the integral of the rate",
        4.0,
    ),
    "increments by the middle rate": (
        CONING.replace("size = 2 * a / b * np.sin(b * h / 2)", "size = a * h"),
        "the increments of parts do not add up to those of the whole",
        0.0,
    ),
    "increments of another motion from 4 s on": (
        CONING.replace("g * h,", "g * h + 1e-5 * (np.maximum(t + h - 4, 0) - np.maximum(t - 4, 0)),")
        + "del rate",
        "the attitude is not what the increments lead to",
        4.0,
    ),
}

BAD = {
    "def increments(*a): return 0": "a motion needs increments and attitude, or rate_expression",
    "x = 1 / 0": ", line 22: ZeroDivisionError: division by zero",
    "import sys; sys.exit()": "ends the program with sys.exit; it must define a motion",
    "def attitude(t): return 'no'": "attitude returns no array of numbers",
    "def attitude(t): return np.eye(3)": r"attitude returns shape (3, 3); (65, 3, 3) is needed",
    "def attitude(t): return np.full((*np.shape(t), 3, 3), np.nan)": "attitude returns numbers that are not finite",
    "def attitude(t): return np.ones((*np.shape(t), 3, 3))": "attitude(0) is no rotation matrix",
    "def attitude(t): return np.diag([1, 1, -1]) + np.zeros((*np.shape(t), 3, 3))": "attitude(0) is no rotation matrix",
    "def attitude(t): return np.diag([1, -1, -1]) + np.zeros((*np.shape(t), 3, 3))": "attitude(0) is not the identity",
}

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "own_rate.py"
T = time_symbol()

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

BAD_RATES = {
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


def written(folder: Path, text: str, name: str = "mine.py") -> str:
    file = folder / name
    file.write_text(BEGIN + text)
    return str(file)


def written_rate(folder: Path, rate: str, before: str = "") -> str:
    path = folder / "rate.py"
    path.write_text(f"import sympy as sp\n{before}\ndef rate_expression(t):\n    return {rate}\n")
    return str(path)


@pytest.mark.parametrize(
    ("name", "way"),
    [
        pytest.param(
            n, w, marks=() if (n, w) in (("coning", "rate"), ("constant", "rate")) else pytest.mark.long
        )
        for n in THESIS
        for w in ("functions", "rate")
    ],
)
def test_the_motions_of_the_thesis_as_a_user_writes_them(name, way, tmp_path):
    text, settings, rate = THESIS[name]
    path = written(tmp_path, text) if way == "functions" else written_rate(tmp_path, rate)
    users = read_motion(path, 10)
    ours = strapgen.motion(name, **settings)
    for arguments in ((Fraction(1, 8), 80, 2), (Fraction(1, 8), 78, 3, 2, 1)):
        np.testing.assert_allclose(
            users.increments(*arguments), ours.increments(*arguments), rtol=0, atol=1e-12
        )
    np.testing.assert_allclose(
        users.samples(Fraction(1, 7), -3, 70), ours.samples(Fraction(1, 7), -3, 70), atol=1e-12
    )
    np.testing.assert_allclose(
        users.samples(Fraction(1, 7), 3, 9), ours.samples(Fraction(1, 7), 3, 9), atol=1e-12
    )
    times = np.linspace(0, 10, 41)
    np.testing.assert_allclose(users.attitude(times), ours.attitude(times), rtol=0, atol=1e-12)
    np.testing.assert_allclose(users.rate(times), ours.rate(times), rtol=0, atol=1e-12)
    backend = strapgen.backend("euler", "rk4", 2)
    runs = [strapgen.simulate(backend, motion, "1/8", 10, 5) for motion in (users, ours)]
    np.testing.assert_allclose(runs[0].error, runs[1].error, rtol=0, atol=1e-12)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_motion_that_contradicts_itself_is_refused_with_the_time(fault, tmp_path):
    text, said, time = FAULTS[fault]
    with pytest.raises(InputError) as refused:
        read_motion(written(tmp_path, text), 10)
    words = str(refused.value)
    assert said in words and "\n" not in words
    begin, end = map(float, re.findall(r"([0-9.e-]+) s\b", words))
    assert begin <= time <= end + 1e-9 and end - begin < 0.2


def test_increments_beside_a_step_must_be_consistent(tmp_path):
    swapped = (
        BEGIN.replace("np.arange(-previous, samples + ahead)", "np.arange(previous + samples + ahead)")
        + CONING
    )
    file = tmp_path / "mine.py"
    file.write_text(swapped)
    with pytest.raises(InputError, match="are not those of one long step"):
        read_motion(file, 10)


def test_invalid_motion_files_are_refused(tmp_path):
    for text, said in BAD.items():
        with pytest.raises(InputError) as refused:
            read_motion(written(tmp_path, text), 10)
        assert said in str(refused.value), text
    with pytest.raises(
        InputError,
        match="is no file; a Python file with functions increments and attitude, or with rate_expression, is needed",
    ):
        read_motion(tmp_path / "missing.py", 10)
    no_rate = written(tmp_path, CONING + "del rate")
    with pytest.raises(InputError, match="defines no function rate; rates of the motion need one"):
        read_motion(no_rate, 10).rate(0.0)
    with pytest.raises(InputError, match="--set goes with a motion"):
        any_motion(no_rate, 10, {"a_deg_s": 1})


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("random", {"rate_deg_s": 60}),
        ("ramps", {"onset_s": 0.05}),
        ("cone", {"half_angle_deg": 1, "frequency_hz": 10}),
    ],
)
def test_the_motions_of_the_catalogue_pass_the_check(name, settings):
    require_consistent(strapgen.motion(name, **settings), 60)


def test_increments_have_forty_digits_and_the_attitude_is_within_its_bound():
    a, b, g = sp.pi / 10, sp.Integer(3), sp.Rational(1, 7)
    rate = [a * sp.sin(b * T), g, a * sp.cos(b * T)]
    integrated = IntegratedRate("coning", *operations_of("coning", rate))
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


def test_the_truncated_term_of_a_rate_is_within_its_bound():
    """A power of the time leaves out one term, which is known: of a longer piece it would be above the tolerance."""
    power = RATE_DEGREE + 1
    integrated = IntegratedRate(
        "power", *operations_of("power", [2**60 * T**power, sp.Integer(0), sp.Integer(0)])
    )
    with mp.workdps(DIGITS):
        piece = integrated.piece(mp.mpf(0))
        true = mp.mpf(2) ** 60 * piece.middle ** (power + 1) / (power + 1)
        assert abs(piece.angle_at(piece.middle)[0] - true) <= piece.angle_error < 1e-39
        longer = mp.mpf(2) ** 60 * (2 * piece.half) ** (power + 1) / (power + 1)
        assert longer > piece.angle_error


def test_negative_times_are_integrated():
    integrated = IntegratedRate("odd", *operations_of("odd", [sp.exp(T), T**3, sp.sqrt(4 + T)]))
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


def test_a_possibly_zero_divisor_has_no_bound():
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
    path = written_rate(tmp_path, "[sp.sin(2 * t) / 3, sp.Rational(1, 5), sp.cos(2 * t) / 3]")
    choice = strapgen.choose("euler", "rk2", 1)
    users, built_in = series(choice, path, 1), series(choice, "coning", 1)
    values = {sp.Symbol("a"): sp.Rational(1, 3), sp.Symbol("b"): 2, sp.Symbol("g"): sp.Rational(1, 5)}
    assert users.drift.keys() == built_in.drift.keys() == {3}
    for one, other in zip(users.drift[3], built_in.drift[3], strict=True):
        assert sp.simplify(one - other.subs(values)) == 0


@pytest.mark.parametrize("command", [pytest.param(command, marks=pytest.mark.long) for command in COMMANDS])
def test_commands_take_a_rate(command, capsys):
    with pytest.raises(SystemExit) as stop:
        main([*shlex.split(command), "--motion", str(EXAMPLE)])
    assert stop.value.code == 0, capsys.readouterr().err


@pytest.mark.parametrize(
    "rate", [pytest.param(r, marks=pytest.mark.long) if r.startswith("[sp.sqrt") else r for r in BAD_RATES]
)
def test_a_bad_rate_is_refused_in_one_line(rate, tmp_path):
    with pytest.raises(InputError) as refusal:
        read_motion(written_rate(tmp_path, rate), 2)
    assert BAD_RATES[rate] in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_rate_beside_an_attitude_is_refused(tmp_path):
    path = written_rate(tmp_path, "[t, 0, 0]", "def attitude(t):\n    return None")
    with pytest.raises(InputError, match="defines rate_expression and attitude; one of both ways is needed"):
        read_motion(path, 1)


def test_a_motion_of_numbers_has_no_series():
    own = EXAMPLE.with_name("own_motion.py")
    with pytest.raises(InputError, match="has no function rate_expression, from which series are derived"):
        series(strapgen.choose("euler", "rk2", 1), str(own))


@pytest.mark.parametrize("rate", [1, 2])
def test_motion_imports_the_module_beside_it(rate, tmp_path):
    (tmp_path / "turning.py").write_text(f"RATE = {rate}\n")
    path = tmp_path / "own.py"
    path.write_text("from turning import RATE\n\n\ndef rate_expression(t):\n    return (0, 0, RATE)\n")
    increments = any_motion(str(path), "1", {}).samples(Fraction(1, 10), 0, 1)
    assert increments[0].tolist() == pytest.approx([0, 0, 0.1 * rate])
    assert "turning" not in sys.modules and str(tmp_path) not in sys.path
