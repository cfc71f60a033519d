"""Motions in files of users: they agree with those of the catalogue, and cannot contradict themselves."""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import strapgen
from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.users_motions import any_motion, read_motion, require_consistent

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
#: The four motions of the thesis as a user would write them, with their settings in the catalogue.
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
    ),
    "sinusoidal": (
        """
a, b = 0.4, 1.3
def rates(t): return 0, a * np.cos(b * t), 0
def increment(t, h): return vector(0, 2 * a / b * np.cos(b * (t + h / 2)) * np.sin(b * h / 2), 0)
def attitude(t): return turn((0, 1, 0), a / b * np.sin(b * np.asarray(t, float)))
""",
        {"a_rad_s": 0.4, "b_rad_s": 1.3},
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
    ),
}


def written(folder: Path, text: str, name: str = "mine.py") -> str:
    file = folder / name
    file.write_text(BEGIN + text)
    return str(file)


@pytest.mark.long
@pytest.mark.parametrize("name", THESIS)
def test_the_motions_of_the_thesis_as_a_user_writes_them(name, tmp_path):
    text, settings = THESIS[name]
    users = read_motion(written(tmp_path, text), 10)
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


@pytest.mark.parametrize("fault", FAULTS)
def test_a_motion_that_contradicts_itself_is_refused_with_the_time(fault, tmp_path):
    text, said, time = FAULTS[fault]
    with pytest.raises(InputError) as refused:
        read_motion(written(tmp_path, text), 10)
    words = str(refused.value)
    assert said in words and "\n" not in words
    begin, end = map(float, re.findall(r"([0-9.e-]+) s\b", words))
    assert begin <= time <= end + 1e-9 and end - begin < 0.2


def test_previous_and_ahead_must_belong_to_the_row(tmp_path):
    swapped = (
        BEGIN.replace("np.arange(-previous, samples + ahead)", "np.arange(previous + samples + ahead)")
        + CONING
    )
    file = tmp_path / "mine.py"
    file.write_text(swapped)
    with pytest.raises(InputError, match="are not those of one long step"):
        read_motion(file, 10)


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


def test_files_that_are_no_motions(tmp_path):
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
