"""Motions over the earth: what is sensed on them is Newton's law, and a navigator finds its way on all of them."""

from __future__ import annotations

import json
import math
from fractions import Fraction

import numpy as np
import pytest
from commands import run

from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motions import motion
from strapgen.lab.motions.users_motions import any_motion, require_consistent
from strapgen.lab.run_options import read_errors
from strapgen.navigation.systems.system_flight import begun, fly
from strapgen.navigation.systems.system_runner import system_runner
from strapgen.navigation.systems.system_study import study
from strapgen.navigation.systems.wiring import described
from strapgen.navigation.vehicle.recorded_track import COLUMNS
from strapgen.navigation.vehicle.vehicle_motion_names import TABLE
from strapgen.navigation.vehicle.vehicle_motions import named
from strapgen.run.backends import evaluator

EXAMPLE, NAVIGATOR = "examples/strapdown.toml", "examples/navigator.toml"
#: The ellipsoid and its gravity, typed from NIMA TR8350.2 for these tests alone.
A, F, RATE, MU = 6378137.0, 1 / 298.257223563, 7.292115e-5, 3.986004418e14
#: Coefficients of the first and second derivative at the middle of nine points, of eighth order.
FIRST = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
SECOND = np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560])
#: Times in s, one of them within an edge of a turn, a climb or an acceleration.
TIMES = np.array([3.3, 10.7, 31.7, 77.0])


@pytest.fixture(params=TABLE)
def flown(request):
    return motion(request.param)


def in_inertial_axes(vehicle, times):
    """Places and attitudes in axes that do not turn."""
    up = vehicle.position(times)[..., :, 2]
    square = F * (2 - F)
    radius = A / np.sqrt(1 - square * up[..., 2] ** 2)
    height = vehicle.height(times)
    places = np.stack(
        [
            (radius + height) * up[..., 0],
            (radius + height) * up[..., 1],
            (radius * (1 - square) + height) * up[..., 2],
        ],
        axis=-1,
    )
    c, s, o = np.cos(RATE * times), np.sin(RATE * times), np.zeros_like(times)
    turned = np.stack([c, -s, o, s, c, o, o, o, o + 1], axis=-1).reshape(*times.shape, 3, 3)
    attitude = turned @ vehicle.position(times) @ vehicle.navigation_attitude(times)
    return np.einsum("...ij,...j->...i", turned, places), attitude, turned


def test_the_sensed_rate_is_the_derivative_of_the_attitude(flown):
    times, h = TIMES, 0.02
    around = in_inertial_axes(flown, times[:, None] + h * np.arange(-4, 5))[1]
    slope = np.einsum("kmij,m->kij", around, FIRST) / h
    skew = np.swapaxes(around[:, 4], -1, -2) @ slope
    rate = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=-1)
    # Rounding of 1e-16 over the step, and the eighth order of motions of up to 1 rad/s and edges of 3 s.
    assert np.allclose(rate, flown.rate(times), rtol=0, atol=1e-8)


def test_the_sensed_force_is_acceleration_less_gravitation(flown):
    times, h = TIMES, 0.1
    around, attitude, turned = in_inertial_axes(flown, times[:, None] + h * np.arange(-4, 5))
    acceleration = np.einsum("kmi,m->ki", around, SECOND) / h**2
    gravity = flown._call("gravity-ellipsoid", flown.position(times), flown.height(times))
    gravity = np.einsum("kij,kj->ki", turned[:, 4] @ flown.position(times), gravity)
    outward = around[:, 4] * np.array([1.0, 1.0, 0.0]) * RATE**2
    force = np.einsum("kji,kj->ki", attitude[:, 4], acceleration - (gravity - outward))
    # 1e-9 m of rounding over h^2, ten times.
    assert np.allclose(force, flown.sensed(times).force, rtol=0, atol=2e-6)


def test_the_velocity_is_the_derivative_of_the_place(flown):
    times, h = TIMES, 0.1
    points = times[:, None] + h * np.arange(-4, 5)
    places, _, turned = in_inertial_axes(flown, points)
    fixed = np.einsum("...ji,...j->...i", turned, places)
    velocity = np.einsum("kij,kj->ki", flown.position(times), flown.velocity(times))
    assert np.allclose(np.einsum("kmi,m->ki", fixed, FIRST) / h, velocity, rtol=0, atol=1e-6)


def test_increments_lead_to_the_attitude(flown):
    require_consistent(flown, 20)


def test_increments_are_those_of_half_the_cycle_added(flown):
    whole, halves = (flown.both_samples(Fraction(1, rate), 0, 40 * rate // 50) for rate in (50, 100))
    for one, other in zip(whole, halves, strict=True):
        assert np.allclose(one, other.reshape(-1, 2, 3).sum(axis=1), rtol=0, atol=1e-12)


def test_the_position_does_not_depend_on_the_pieces(monkeypatch):
    course = motion("s-turns", latitude_deg=80, speed_m_s=300)
    times = np.linspace(0, 900, 301)
    before = course.position(times)
    monkeypatch.setattr("strapgen.navigation.vehicle.vehicle_motion._PIECE", 3.0)
    assert np.abs(motion("s-turns", latitude_deg=80, speed_m_s=300).position(times) - before).max() < 1e-13


def test_a_flight_north_passes_the_pole_on_its_meridian():
    course = motion("polar", longitude_deg=20)
    angles = course.position(np.array([0.0, 500.0]))[:, :, 2]
    longitude = np.degrees(np.arctan2(angles[:, 1], angles[:, 0]))
    assert np.allclose(longitude, [20, -160], atol=1e-9)
    # The arc from 89.5 deg to the pole on the ellipsoid is 55,846.8 m, with the curvature a^2/b of the pole.
    there = np.degrees(np.arccos(course.position(55846.8 / 250)[2, 2]))
    assert there < 1e-5


def test_a_flight_straight_on_is_a_geodesic():
    """Clairaut: the transverse radius times the cosine of latitude times the sine of azimuth stays the same."""
    course = motion("great-circle", latitude_deg=30, heading_deg=60)
    times = np.linspace(0, 14400, 97)
    position, velocity = course.position(times), course.velocity(times)
    up = position[:, :, 2]
    radius = A / np.sqrt(1 - F * (2 - F) * up[:, 2] ** 2)
    fixed = np.einsum("kij,kj->ki", position, velocity)
    momentum = radius * (up[:, 0] * fixed[:, 1] - up[:, 1] * fixed[:, 0])
    assert np.ptp(momentum) < 1e-11 * momentum[0]
    assert np.ptp(np.degrees(np.arcsin(up[:, 2]))) > 5


@pytest.mark.parametrize("name", ["great-circle", "polar", "turn", "climb", "taxi", "s-turns", "swinging"])
def test_a_navigator_finds_its_way(name):
    runner = system_runner(described(EXAMPLE, Fraction(100)), "numpy")
    settings = {"top_m": 1} if name == "climb" else {}
    flight = fly(runner, motion(name, **settings), Fraction(20))
    attitude, velocity, position = flight.sizes
    # Counts of 3 arcsec and 1 cm/s, half of one open in each sum, and once more of the errors' second order.
    assert attitude.max() < math.radians(2e-3)
    assert velocity[-1] < 0.03 if name != "climb" else True
    assert position.max() < 0.1 or name == "climb"


def test_all_that_follows_from_the_truth_is_there_at_the_start():
    course = motion("polar", longitude_deg=20, heading_deg=30)
    runner = system_runner(described(EXAMPLE, Fraction(100)), "numpy")
    memory = begun(runner, course)
    cells = {name: runner.in_si(name, rows)[0] for name, rows in memory.cells.items()}
    assert np.allclose(cells["position_position"], course.position(0.0).ravel(), rtol=0, atol=1e-15)
    assert np.allclose(cells["velocity_previous_acceleration"], cells["coriolis_acceleration"])
    assert np.allclose(cells["position_previous_transport_rate"], cells["transport_transport_rate"])
    assert np.allclose(
        cells["turn_previous_rate"], cells["earth_earth_rate"] + cells["transport_transport_rate"]
    )
    assert np.allclose(cells["attitude_previous_turn"], cells["turn_turn"])
    assert np.allclose(np.degrees(cells["geographic_previous"]), [89.5, 20, 0])
    assert np.abs(cells["transport_transport_rate"]).max() > 1e-5


def test_the_command_prints_errors_and_track(capsys):
    words = [
        "simulate",
        EXAMPLE,
        "--motion",
        "turn",
        "--step",
        "0.01",
        "--duration",
        "10",
        "--format",
        "json",
    ]
    run(words)
    data = json.loads(capsys.readouterr().out)
    assert {"attitude_error_deg", "velocity_error_m_s", "position_error_m", "track"} <= {*data}
    assert np.shape(data["track"]) == (100, 3)
    words = ["--backend", "c-fixed32", "--errors", "ins-1", "--format", "json"]
    run(["study", "system", EXAMPLE, "--sample-hz", "100", "--motion", "polar", "--duration", "2", *words])
    causes = json.loads(capsys.readouterr().out)["by_cause"]
    assert [row["cause"] for row in causes] == [
        "algorithm, in double",
        "word length, c-fixed32",
        "sensor errors, in double",
    ]


COURSE = """
[start]
latitude_deg = 60
speed_m_s = 100

[[leg]]
kind = "hold"
duration_s = 5

[[leg]]
kind = "turn"
angle_deg = 90

[[leg]]
kind = "climb"
height_m = 300

[[leg]]
kind = "accelerate"
speed_m_s = 150

[[leg]]
kind = "stop"
acceleration_m_s2 = 5
"""


def test_a_course_of_a_file_does_what_its_legs_say(tmp_path):
    file = tmp_path / "course.toml"
    file.write_text(COURSE)
    course = any_motion(str(file), 1, {})
    end = np.array([400.0])
    assert np.allclose(course.velocity(end), 0, atol=1e-12)
    assert np.allclose(course.height(end), 300)
    roll, pitch, heading = course.controls.angles(np.linspace(0, 400, 4001))[0]
    assert math.isclose(heading[-1], math.pi / 2)
    assert 24.5 < np.degrees(roll.max()) <= 25.001
    assert pitch.max() > 0.09
    require_consistent(course, 60)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("angle_deg = 90", "angle_deg = 0", "leg 2: this turn changes nothing; leave it out"),
        ("height_m = 300", "height_m = 0", "leg 3: this climb changes nothing; leave it out"),
        ("speed_m_s = 150", "speed_m_s = 100", "leg 4: this accelerate changes nothing; leave it out"),
        ("speed_m_s = 150", "speed_m_s = 0", "leg 5: this stop changes nothing; leave it out"),
    ],
)
def test_a_leg_of_nothing_is_refused(tmp_path, old, new, message):
    file = tmp_path / "course.toml"
    assert COURSE.count(old) == 1
    file.write_text(COURSE.replace(old, new))
    with pytest.raises(InputError, match=message):
        any_motion(str(file), 1, {})


@pytest.fixture
def track(tmp_path):
    """The file of a track, and the motion that it is of."""
    # Over 180 degrees of longitude, and with headings on both sides of north.
    settings = {"longitude_deg": 179.999, "heading_deg": 330, "speed_m_s": 120, "height_m": 500}
    course, times = motion("s-turns", **settings), np.arange(0, 60.01, 0.2)
    place = np.asarray(evaluator("geographic-angles")(course.position(times), np.zeros((len(times), 3))))
    roll, pitch, heading = course.controls.angles(times)[0]
    heading = np.mod(heading - place[:, 2], math.tau)
    angles = np.degrees([*place[:, :2].T, roll, pitch, heading])
    rows = np.column_stack([times + 17.5, *angles[:2], course.height(times), *angles[2:]])
    file = tmp_path / "track.csv"
    lines = [",".join(COLUMNS), *(",".join(map(repr, row)) for row in rows.tolist())]
    file.write_text("\n".join(lines))
    return file, course


def test_a_recorded_track_is_the_motion_that_it_was_recorded_on(track):
    file, course = track
    again, times = any_motion(str(file), 1, {}), np.linspace(0, 60, 61)
    # Splines of fifth degree on a period of 28 s, at 5 Hz; the ends are worst.
    assert np.abs(again.velocity(times) - course.velocity(times)).max() < 1e-6
    assert np.abs(again.position(times) - course.position(times)).max() * A < 1e-5
    for one, other in zip(
        *(one.both_samples(Fraction(1, 100), 0, 6000) for one in (again, course)), strict=True
    ):
        assert np.abs(one - other).max() < 1e-7


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("latitude_deg", "lat", "has no column latitude_deg; a track has time_s"),
        ("18.1,", "17.1,", "time_s of row 4 is not after that of the row before"),
        ("18.1,", "soon,", "row 4 is no row of numbers"),
        ("18.1,", "nan,", "row 4 has a number that is not finite"),
        ("17.5,45.0", "17.5,89.95", "comes within 0.1 deg of a pole"),
        ("17.5,45.0", "17.5,-89.95", "comes within 0.1 deg of a pole"),
    ],
)
def test_a_bad_track_gets_one_line(track, old, new, message, capsys):
    file, _ = track
    text = file.read_text()
    assert text.count(old) == 1
    file.write_text(text.replace(old, new))
    run(["simulate", NAVIGATOR, "--motion", str(file), "--step", "0.01", "--duration", "1"], 2)
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_a_run_goes_to_the_end_of_the_track_at_most(track, capsys):
    run(["simulate", NAVIGATOR, "--motion", str(track[0]), "--step", "0.01", "--duration", "61"], 2)
    assert "the track lasts 60 s" in capsys.readouterr().err


@pytest.mark.long
def test_schuler_pumping_follows_its_closed_form():
    """The printed example: v = 2b/ws [sin ws(t - t1) - sin ws(t - t2)], on an earth that turns beneath it."""
    course = any_motion("examples/courses/schuler-pumping.toml", 1, {})
    errors = read_errors("examples/sensors/accelerometer-bias.toml")
    result = study(described(NAVIGATOR), course, Fraction(4800), [], errors=errors, align=True)
    minutes = np.array([20, 30, 40, 50, 61, 80]) * 60
    speed = result.sensors.sizes[1][minutes * 10 - 1]
    closed = np.array([1.071455, 1.576113, 1.247011, -0.813211, -2.544471, -1.647334])
    # The turns take 30 s, and gravity and radius are those of the ellipsoid: 1 % each.
    assert np.allclose(speed, np.abs(closed), rtol=0.03)
    assert math.isclose(result.sensors.sizes[1].max(), 2 * 1.581428927 * 0.8986, rel_tol=0.02)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--motion", "turn", "--set", "bank_deg=85"], "the bank is 85 deg"),
        (["--motion", "turn", "--set", "speed_m_s=0"], "a vehicle that stands does not bank"),
        (["--motion", "great-circle", "--set", "latitude_deg=100"], "the latitude is 100 deg"),
        (["--motion", "great-circle", "--set", "altitude_m=100"], "allowed: latitude_deg, latitude_rad"),
        (["--motion", "climb", "--set", "climb_m_s=-1"], "the climb rate is -1 m/s"),
        (["--motion", "great-circle", "--set", "height_m=1e6"], "the height is 1e+06 m"),
        (
            ["--motion", "great-circle", "--initial-deg", "1,2,3"],
            "--initial-deg does not go with a motion over the earth",
        ),
        (["--motion", "nowhere.toml"], "nowhere.toml"),
    ],
)
def test_a_bad_motion_gets_one_line(words, message, capsys):
    run(["simulate", EXAMPLE, "--step", "0.01", "--duration", "1", *words], 2)
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_strapdown_runs_on_a_motion_over_the_earth(capsys):
    words = [
        "--motion",
        "great-circle",
        "--step",
        "0.01",
        "--duration",
        "10",
        "--backend",
        "c",
        "--format",
        "json",
    ]
    run(["strapdown", "dcm", "--fast-cycles", "2", "--slow-cycles", "50", *words])
    data = json.loads(capsys.readouterr().out)
    assert np.allclose(data["heading_deg"], 45, atol=0.01) and np.allclose(data["pitch_deg"], 0, atol=1e-4)
    run(["strapdown", NAVIGATOR, *words])
    outputs = json.loads(capsys.readouterr().out)["outputs"]
    course = motion("great-circle")
    assert np.allclose(outputs["velocity_velocity"][-1], course.velocity(10.0), rtol=0, atol=1e-6)
    assert np.allclose(outputs["position_position"][-1], course.position(10.0), rtol=0, atol=1e-12)
    run(["strapdown", "dcm", "--fast-cycles", "2", "--motion", "polar", "--duration", "2"], 2)
    assert "--motion needs --step in s" in capsys.readouterr().err


def test_a_system_that_does_not_navigate_is_refused(capsys):
    run(["simulate", "examples/attitude.toml", "--motion", "polar", "--step", "0.01", "--duration", "2"], 2)
    assert "has no velocity (m/s, frame n) among its outputs" in capsys.readouterr().err
    with pytest.raises(InputError, match="motion coning is none over the earth"):
        named("coning", {"a_deg_s": "1", "b_deg_s": "1", "g_deg_s": "1"})
