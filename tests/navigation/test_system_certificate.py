"""The certificate of a system holds what arithmetic of 40 digits gives, and names the stage that rounds."""

from __future__ import annotations

import json
import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from commands import says

from strapgen import certify_system, read_system, system_runner
from strapgen.ir.exceptions import InputError
from strapgen.navigation.systems import system_certificate
from strapgen.navigation.systems.system_runner import SystemRunner

flint = pytest.importorskip("flint")

#: Gyro and accelerometer at 100 Hz, in two loops at 50 and 10 Hz.
RATE = Fraction(100)


def noise(cycles, seed=1, turn=0.0):
    """Return samples of a system in two speeds that are as rough as a float allows."""
    draws = np.random.default_rng(seed)
    return {
        "gyro": draws.normal(0, 3e-3, (cycles, 3)),
        "accelerometer": draws.normal(0, 0.1, (cycles, 3)),
        "turn": np.full((cycles, 3), turn),
    }


def in_digits(description, runner, inputs):
    """Return the attitude and the sum of the velocity changes of exact arithmetic, in 40 digits."""
    exact = system_runner(description, "exact")
    taken = {name: runner.in_si(name, words) for name, words in runner.samples(inputs).items()}
    memory, total = exact.begin(), np.zeros(3, object)
    cycle = description.system.cycle
    for first in range(0, len(taken["gyro"]), cycle):
        memory = exact.run({name: rows[first : first + cycle] for name, rows in taken.items()}, memory).memory
        total = total + memory.cells["nav_velocity_change"][0]
    return memory.cells["slow_state"][0], total


def matrix(x, y, z, s):
    """Return the direction cosines of Euler parameters, times the square of their length."""
    return mpmath.matrix(
        [
            [s * s + x * x - y * y - z * z, 2 * (x * y - s * z), 2 * (x * z + s * y)],
            [2 * (x * y + s * z), s * s - x * x + y * y - z * z, 2 * (y * z - s * x)],
            [2 * (x * z - s * y), 2 * (y * z + s * x), s * s - x * x - y * y + z * z],
        ]
    )


def assert_certified(found, values, expected):
    """Check the rotation of the attitude, and the difference of the sum, beside those in digits."""
    with mpmath.workdps(40):
        state, change = ([mpmath.mpf(float(x)) for x in row] for row in values)
        error = matrix(*state) * matrix(*expected[0]) ** -1
        error /= mpmath.cbrt(mpmath.det(error))
        sines = [(error[j, i] - error[i, j]) / 2 for i, j in ((1, 2), (2, 0), (0, 1))]
        size = mpmath.sqrt(sum(x * x for x in sines))
        axes = [x * mpmath.asin(size) / size for x in sines]
        apart = [x - y for x, y in zip(change, expected[1], strict=True)]
        for one, wanted in zip(found.outputs, (axes, apart), strict=True):
            for element, other in zip(one.rounding_elements, wanted, strict=True):
                assert abs(element - other) <= one.rounding_radius + 1e-30
            assert one.rounding_radius < 1e-9 * one.rounding


@pytest.mark.parametrize("name", ["c-fixed32", "c-fixed16", "c", "numpy", "fixed-model"])
@pytest.mark.parametrize("cycles", [200, pytest.param(10_000, marks=pytest.mark.long)])
def test_rounding_is_that_of_40_digits(name, cycles):
    description = read_system("two-speed-euler", RATE)
    runner, inputs = system_runner(description, name), noise(cycles, turn=1e-5)
    found = certify_system(runner, inputs)
    run = runner.run(inputs)
    sums = [math.fsum(column) for column in run.values["nav_velocity_change"].astype(np.float64).T]
    changes = [sum(map(Fraction, column)) for column in run.values["nav_velocity_change"].T.tolist()]
    assert np.allclose([float(x) for x in changes], sums)
    with mpmath.workdps(40):
        exact_sums = [mpmath.mpf(x.numerator) / x.denominator for x in changes]
        expected = in_digits(description, runner, inputs)
        expected = (
            expected[0],
            [x + float(s) - t for x, s, t in zip(expected[1], sums, exact_sums, strict=True)],
        )
    assert_certified(found, (run.values["slow_state"][-1], sums), expected)
    assert [one.is_sum for one in found.outputs] == [False, True]


def test_a_matrix_of_direction_cosines_turns_as_its_parameters():
    """In double both round by units of the last place; what they certify is of that size."""
    found = certify_system(system_runner(read_system("two-speed-dcm", RATE), "c"), noise(400))
    assert 1e-17 < found.outputs[0].rounding < 1e-13


def test_a_unit_in_the_last_place_in_one_call_moves_the_certificate_by_that_unit(monkeypatch):
    runner = system_runner(read_system("two-speed-euler", RATE), "fixed-model")
    inputs = noise(100)
    honest = certify_system(runner, inputs)
    seen, right = [], runner.evaluators["nav"].run

    def count(rows, feedback):
        seen.append(rows[0][0].tolist())
        return right(rows, feedback)

    monkeypatch.setattr(runner.evaluators["nav"], "run", count)
    runner.run(inputs)
    last = seen[-1]  # the state that the last call takes

    def wrong(rows, feedback):
        outputs, after = right(rows, feedback)
        state = np.array(outputs[0])
        state[[row.tolist() == last for row in rows[0]], 1] += 1
        return [state, *outputs[1:]], after

    monkeypatch.setattr(runner.evaluators["nav"], "run", wrong)
    moved = certify_system(runner, inputs)
    unit = float(runner.fit.arguments["slow_state"].unit)
    turned = np.subtract(moved.outputs[0].rounding_elements, honest.outputs[0].rounding_elements)
    q = np.array(last) * unit / np.linalg.norm(np.array(last) * unit)
    assert np.linalg.norm(turned) == pytest.approx(2 * unit * math.sqrt(1 - q[1] ** 2), rel=1e-5)
    parts = [one.outputs[0].stages for one in (honest, moved)]
    assert parts[0]["nav"] == 0
    assert parts[1]["nav"] == pytest.approx(np.linalg.norm(turned), rel=1e-5)
    assert parts[0]["fast"] == pytest.approx(parts[1]["fast"], rel=1e-5)


def test_a_stage_alone_rounds_where_the_others_are_exact():
    """Where nothing is rounded but in one stage, all is of that stage."""
    found = certify_system(system_runner(read_system("two-speed-euler", RATE), "c-fixed32"), noise(200))
    for one in found.outputs:
        largest = max(one.stages, key=lambda stage: one.stages[stage])
        assert one.largest_stage == largest
        assert sum(one.stages.values()) >= one.rounding * (1 - 1e-9)  # lengths of parts of a sum of vectors
        assert one.stages["nav"] == 0  # its frame rests, so that it passes on what it takes


def test_a_velocity_and_a_position_are_examined_too():
    """The program of 1984 keeps its position as a latitude and a longitude, and its level velocity in m/s."""
    description = read_system("examples/strapdown.toml", RATE)
    runner = system_runner(description, "c-fixed32")
    from strapgen.navigation.systems.system_runs import samples

    angle, velocity = np.full((100, 3), 1e-3), np.tile([0.0, 0.0, -0.0981], (100, 1))
    found = {one.output: one for one in certify_system(runner, samples(description, angle, velocity)).outputs}
    assert found["velocity_velocity"].unit == "m/s"
    assert 0 < found["velocity_velocity"].rounding < 1e-5
    assert 0 < found["position_position"].rounding < 1e-7
    assert found["position_position"].largest_stage == "position"


def test_parts_and_bits_change_nothing(monkeypatch):
    runner, inputs = system_runner(read_system("two-speed-euler", RATE), "c-fixed32"), noise(400)
    whole = certify_system(runner, inputs)
    monkeypatch.setattr(system_certificate, "_TOGETHER", 30)
    parts = certify_system(runner, inputs)
    monkeypatch.setattr(system_certificate, "_BITS", 100)  # too few: the run is repeated with more
    for one in (parts, certify_system(runner, inputs)):
        for first, second in zip(whole.outputs, one.outputs, strict=True):
            assert first.rounding_elements == second.rounding_elements
            assert first.stages == pytest.approx(second.stages, rel=1e-12)


def test_a_run_goes_on_from_a_memory():
    runner, inputs = system_runner(read_system("two-speed-euler", RATE), "c-fixed32"), noise(400)
    half = {name: rows[:200] for name, rows in inputs.items()}
    rest = {name: rows[200:] for name, rows in inputs.items()}
    found = certify_system(runner, rest, memory=runner.run(half).memory)
    whole = certify_system(runner, inputs)
    first = certify_system(runner, half)
    together = first.outputs[0].rounding + found.outputs[0].rounding
    assert whole.outputs[0].rounding <= together * (1 + 1e-6)
    assert found.cycles == 200


def test_code_that_does_not_do_as_its_stages_is_refused(monkeypatch):
    """The unit of all stages is compared with each of them, cell by cell."""
    runner, inputs = system_runner(read_system("two-speed-euler", RATE), "c-fixed32"), noise(20)
    trace = type(runner).trace

    def flipped(self, *arguments):
        memory = trace(self, *arguments)
        memory.cells["slow_state"][7, 0] ^= 1 << 9
        return memory

    monkeypatch.setattr(type(runner), "trace", flipped)
    with pytest.raises(InputError, match="leaves another slow_state than its stages one by one"):
        certify_system(runner, inputs)


@pytest.mark.parametrize(
    ("backend", "cycles", "message"),
    [
        ("exact", 20, "computes in many digits"),
        ("numpy", 7, "7 samples are given; a cycle of the slowest rate needs 10"),
    ],
)
def test_what_cannot_be_certified_is_refused_in_one_line(backend, cycles, message):
    with pytest.raises(InputError, match=message):
        certify_system(system_runner(read_system("two-speed-euler", RATE), backend), noise(cycles))


def test_traces_of_python_and_c_agree():
    description, inputs = read_system("two-speed-euler", RATE), noise(20)
    runner = system_runner(description, "c-fixed32")
    samples = runner.samples(inputs)
    by_stages = SystemRunner(runner.fit, "c-fixed32").trace(samples)
    whole = runner.trace(samples)
    assert by_stages.cycle == whole.cycle
    for part in ("cells", "feedback"):
        one, other = getattr(by_stages, part), getattr(whole, part)
        assert all(np.array_equal(one[name], other[name]) for name in other)


def test_the_command_certifies_two_speeds(tmp_path, capsys):
    words = ["certify", "two-speed-euler", "--recording", "examples/inertial_log.csv"]
    status, out, _ = says([*words, "--carry", "full", "--format", "json"], capsys)
    said = json.loads(out)
    assert (status, said["cycles"], said["schema"]) == (0, 1000, "strapgen/system-certificate/1")
    attitude, velocity = said["outputs"]
    assert (attitude["unit"], velocity["unit"], velocity["is_sum"]) == ("rad", "m/s", True)
    assert attitude["largest_rounding"] >= attitude["rounding"] > 0
    assert said["departures"][-1]["roundings"]["slow_state"] == pytest.approx(attitude["rounding"])
    plot = tmp_path / "roundings.svg"
    status, out, _ = says([*words, "--target", "c", "--initial-deg", "1,2,3", "--plot", str(plot)], capsys)
    assert status == 0
    assert "most by" in out
    assert "<svg" in plot.read_text()


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("--states states.csv", "--states does not go with a described system"),
        ("--jobs 2", "--jobs does not go with a described system"),
        ("--method rk4", "--method does not go with a described system"),
        ("--recording missing.csv", "missing.csv cannot be read"),
    ],
)
def test_an_option_that_does_not_fit_is_one_line(capsys, option, message):
    base = "certify two-speed-euler --recording examples/inertial_log.csv"
    command = option if option.startswith("--rec") else f"--recording examples/inertial_log.csv {option}"
    status, out, error = says(f"{base.split(' --')[0]} {command}", capsys)
    assert (status, out) == (2, "")
    assert message in error
    assert len(error.strip().splitlines()) == 1
