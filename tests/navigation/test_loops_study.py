"""The study of the loops: known numbers of the matrix exponential, the kernel beside it, and what it refuses."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest

from strapgen.cli import main
from strapgen.navigation.loops import loops_study
from strapgen.navigation.loops.loop_errors import LoopErrors
from strapgen.navigation.loops.loop_gains import closed_loop
from strapgen.navigation.loops.loop_schedule import BUILT_IN, read
from strapgen.navigation.loops.loops_study import factors, run_loops

SCHEDULE = replace(read(), cycle_s=Fraction(1, 10))
MODES = SCHEDULE.timed(Fraction(0))
#: States at 30 and 180 s by loop, case and state, with the digits that are known.
KNOWN = {
    ("level", 0, 2): ("9.380312", "9.936742"),
    ("level", 0, 1): ("1.4459388e-3", "8.6570482e-4"),
    ("level", 1, 2): ("16.062314", "1.6539694"),
    ("vertical", 0, 0): (None, "0.3939283"),
    ("vertical", 0, 1): (None, "0.0306389"),
    ("vertical", 0, 2): (None, "9.202086e-3"),
    ("heading", 0, 1): (None, "9.389005"),
    ("heading", 1, 0): (None, "-0.03888149"),
}


def run(line: str, capsys) -> str:
    with pytest.raises(SystemExit) as stop:
        main(line.split())
    streams = capsys.readouterr()
    assert stop.value.code == 0, streams.err
    return streams.out


@pytest.fixture(scope="module")
def courses():
    return {course.loop: course for course in run_loops(SCHEDULE, MODES, LoopErrors())}


def test_states_at_the_end_of_both_modes_of_alignment(courses):
    for (loop, case, state), numbers in KNOWN.items():
        course = courses[loop]
        for end, number in zip(course.ends, numbers, strict=True):
            if number is not None:
                value = course.exact[end, case, state] * factors(loop)[state]
                unit = 10.0 ** mpmath.mpf(number.split("e")[1] if "e" in number else 0)
                last = float(unit) * 10.0 ** -len(number.split("e")[0].split(".")[1])
                assert abs(value - float(number)) <= last, (loop, case, state)


def test_poles_that_coincide_have_closed_forms(courses):
    exact = courses["vertical"].exact[-1, 0]  # a bias of 1 mg for six time constants of 30 s
    assert math.isclose(exact[2], 9.81e-3 * (1 - 25 * math.exp(-6)), rel_tol=1e-10)
    assert math.isclose(
        courses["heading"].exact[-1, 1, 0], math.radians(1 - 4.5) * math.exp(-4.5), rel_tol=1e-10
    )


def test_a_wrong_reference_velocity_looks_like_a_rate():
    steady = 5 / float(SCHEDULE.radius) * math.degrees(3600)
    assert round(steady, 7) == 0.1618172
    # (3): B = W + eps - Vr/R, from a mode of 5 s that lasts for sixty time constants.
    (matrices, known) = closed_loop("level"), loops_study.mode_gains(SCHEDULE, MODES[0].loop("level"))
    values = dict(zip(matrices.gains, known, strict=True))
    values |= {loops_study.loop_gains.g: SCHEDULE.gravity, loops_study.loop_gains.R: SCHEDULE.radius}
    A, D = (np.array(m.subs(values).tolist(), float) for m in (matrices.continuous, matrices.disturbance))
    bias = np.linalg.solve(A, -D @ [0, 0, 5])[2] * math.degrees(3600)
    assert math.isclose(bias, -steady, rel_tol=1e-9)


def test_the_exponential_is_that_of_many_digits(rng):
    matrix = rng.normal(size=(4, 4)) * [1, 10, 0.1, 3]
    known = np.array(mpmath.expm(mpmath.matrix(matrix.tolist())).tolist(), float)
    np.testing.assert_allclose(loops_study.exponential(matrix), known, rtol=1e-11)


def test_the_kernels_differ_by_the_cycle(courses):
    # Forward Euler is of first order: a tenth of the cycle, a tenth of the difference, but for what is of second.
    finer = replace(SCHEDULE, cycle_s=Fraction(1, 20))
    for course in run_loops(finer, MODES[:1], LoopErrors()):
        coarse = courses[course.loop]
        one = coarse.run[coarse.ends[0]] - coarse.exact[coarse.ends[0]]
        other = course.run[-1] - course.exact[-1]
        size = np.abs(coarse.exact[1 : coarse.ends[0]]).max(axis=0)
        # T/tau is 0.02 at most.
        assert np.all(np.abs(one) <= 0.1 * size + 1e-15), course.loop
        assert np.all(np.abs(other - one / 2) <= 0.15 * np.abs(one) + 1e-3 * size + 1e-15), course.loop


def test_attitude_mode_levels_in_twenty_seconds():
    attitude = replace(SCHEDULE.modes[-1], duration_s=Fraction(20), when="sequence")
    errors = LoopErrors(tilt_deg=1.0)
    course = next(iter(run_loops(replace(SCHEDULE, cycle_s=Fraction(1, 100)), (attitude,), errors)))
    share = (1 + 20 / 3) * math.exp(-20 / 3)
    assert round(100 * share, 6) == 0.975686
    assert math.isclose(math.degrees(course.exact[-1, 1, 1]), share, rel_tol=1e-9)
    assert math.isclose(math.degrees(course.run[-1, 1, 1]), share, rel_tol=0.05)


@pytest.fixture
def coarse(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(BUILT_IN.read_text("utf-8").replace("cycle_s = 0.01", "cycle_s = 0.5"), "utf-8")
    return path


def test_the_study_as_data(coarse, capsys):
    data = json.loads(run(f"study loops {coarse} --last 0 --format json", capsys))
    assert data["gains"][0]["exact"][0] == "3/5"
    assert len(data["rows"]) == 2 * (3 * 3 + 2 * 2 + 2 * 3)
    tilts = [row for row in data["rows"] if row["case"] == "tilt 0.5 deg" and row["mode"] == "fine"]
    assert [row["quantity"] for row in tilts] == ["velocity", "tilt", "bias"]
    assert round(tilts[-1]["matrix_exponential"], 7) == 1.6539694


@pytest.mark.long
def test_the_study_as_text_table_and_picture(coarse, tmp_path, capsys):
    image = tmp_path / "loops.png"
    text = run(f"study loops {coarse} --last 0 --format csv --plot {image}", capsys)
    assert len(list(csv.DictReader(text.splitlines()))) == 2 * (3 * 3 + 2 * 2 + 2 * 3)
    assert image.stat().st_size > 10_000
    assert "slowest pole" in run(f"study loops {coarse} --last 0", capsys)


def test_invalid_input_is_refused(tmp_path, capsys):
    text = BUILT_IN.read_text("utf-8")
    (tmp_path / "long.toml").write_text(text.replace("cycle_s = 0.01", "cycle_s = 5"), "utf-8")
    (tmp_path / "third.toml").write_text(
        text.replace("heading = { tau_s = 40 }", "heading = { tau_s = 40, order = 3 }", 1), "utf-8"
    )
    for words, reason in (
        (
            f"{tmp_path}/long.toml",
            "mode fast: the level loop with gains 0.6, 0.0122323, 0.000815494, and a cycle of 5 s",
        ),
        (f"{tmp_path}/third.toml", "the heading loop has order 3; 2 is possible"),
        ("--set tilt=3", "tilt"),
        ("--set heading_deg=180", "heading_deg is 180; a magnitude below 180 is needed"),
        ("--last 0.005", "mode normal: duration_s is no whole number of cycles of 0.01 s"),
        ("--last 1e6", "cycles; 1 to 1000000 are possible"),
        ("--backend c-fixed32", "backend"),
        ("missing.toml", "cannot be read"),
    ):
        with pytest.raises(SystemExit) as stop:
            main(["study", "loops", *words.split()])
        said = capsys.readouterr().err
        assert stop.value.code == 2
        assert said.count("\n") == 1
        assert reason.replace("0.000815494, ", "0.000815494 ") in said, said
