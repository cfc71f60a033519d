"""The filters of examples/kalman: beside dense ones that share no code with them, and flown over the earth."""

from __future__ import annotations

import re
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from dense_kalman import DEG_H, FILTERS, OMEGA, Dense
from scipy.stats import chi2

import strapgen
from strapgen.lab.sensor_errors.instruments import InstrumentErrors, TriadErrors

DOCS = Path(__file__).resolve().parents[2] / "docs"
FOLDER = DOCS.parent / "examples" / "kalman"
sys.path.insert(0, str(FOLDER))

import flights  # noqa: E402
from flights import Case, Flight, Limits, fly  # noqa: E402

#: Steps of the comparison with a dense filter; a drop-out of every measurement lies in them.
STEPS = 24


@cache
def model(name: str, form: str | None = None) -> strapgen.KalmanFilter:
    return strapgen.kalman(FOLDER / f"{name}.toml", form)


def silent(shape):
    """Return no noise at all."""
    return np.zeros(shape)


def signals(dense: Dense) -> tuple[dict, dict, np.ndarray]:
    """Return measurements, inputs and a start of a filter: of the sizes of a flight, and else arbitrary."""
    rng = np.random.default_rng(7)
    inputs = {name: rng.uniform(-1, 1, STEPS) for name in dense.inputs}
    for name in inputs:
        if name.startswith(("force", "acceleration")):
            inputs[name] *= 10
        elif name == "per_distance":
            inputs[name] = 2e-5 * (2 + inputs[name])
    first = np.sqrt(np.diag(dense.P0)) * rng.standard_normal(len(dense.states))
    measurements = {name: 3 * deviation * rng.standard_normal(STEPS) for name, deviation in dense.R.items()}
    return measurements, inputs, first


def differences(name: str, dense: Dense, form: str | None = None, backend: str = "numpy") -> float:
    """Return the largest difference of estimates and covariances, in standard deviations."""
    measurements, inputs, first = signals(dense)
    if model(name).text.kind == "online":
        for values in measurements.values():
            values[9:13] = np.nan
    run = model(name, form).run(measurements, inputs, backend=backend, initial=first)
    states, covariances = dense.run(measurements, inputs, first)
    deviations = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    largest = np.abs((run.states - states) / deviations).max()
    if run.covariances is not None:
        scaled = (run.covariances - covariances) / (deviations[:, :, None] * deviations[:, None, :])
        largest = max(largest, np.abs(scaled).max())
    return float(largest)


@pytest.mark.parametrize(
    ("name", "form"),
    [
        ("fine-alignment", None),
        ("wind", "joseph"),
        ("wind", "ud"),
        pytest.param("zero-velocity", "joseph", marks=pytest.mark.long),
        pytest.param("zero-velocity", "ud", marks=pytest.mark.long),
        pytest.param("gnss", "joseph", marks=pytest.mark.long),
        pytest.param("gnss", "ud", marks=pytest.mark.long),
    ],
)
def test_a_dense_filter_agrees(name, form):
    dense = FILTERS[name]()
    assert [*model(name).states] == dense.states
    assert differences(name, dense, form) < 1e-10
    assert differences(name, dense, form, "c") < 1e-10


@pytest.mark.parametrize("fault", ["F", "S", "R"])
def test_another_filter_is_seen(fault):
    dense = FILTERS["wind"]()
    if fault == "F":
        dense.F = lambda inputs: 1e-8 * np.eye(4)
    elif fault == "S":
        dense.S = dense.S * (1 + 1e-8)
    else:
        dense.R = {**dense.R, "air_east": 1.5 * (1 + 1e-8)}
    assert differences("wind", dense, "ud") > 1e-10


def test_a_run_that_loses_measurements_does_not_touch_another():
    dense = FILTERS["wind"]()
    measurements, inputs, first = signals(dense)
    several = {name: np.stack([value, value]) for name, value in measurements.items()}
    for values in several.values():
        values[1, 9:13] = np.nan
    both = model("wind").run(several, inputs, initial=first)
    for row in range(2):
        alone = model("wind").run(
            {name: value[row] for name, value in several.items()}, inputs, initial=first
        )
        np.testing.assert_array_equal(both.states[row], alone.states)
        np.testing.assert_array_equal(both.covariances[row], alone.covariances)
    assert np.abs(both.states[0] - both.states[1]).max() > 0.1


def test_the_gains_of_the_vertical_channel_solve_the_riccati_equation():
    dense = FILTERS["baro-inertial"]()
    gain, _ = dense.steady()
    np.testing.assert_allclose(model("baro-inertial").gains["barometer"], gain, rtol=1e-10)
    # So much of a loop of third order: three poles inside the circle, none of them real and slow.
    transition, _, _ = dense.discrete({"acceleration": 0.0})
    poles = np.linalg.eigvals((np.eye(3) - np.outer(gain, [1, 0, 0])) @ transition)
    assert np.abs(poles).max() < 1 - 0.25 / 60


def nees_band(states: int, runs: int, outside: float = 0.05) -> tuple[float, float]:
    """Return between what the means of normalised squared errors lie, but for a share outside."""
    low, high = chi2.ppf([outside / 2, 1 - outside / 2], states * runs) / runs
    return low, high


def assert_consistent(flight: Flight, times: slice = slice(None)) -> None:
    """Check the mean over runs at each time, that over all times, and the share of each state in its band of 95 %."""
    means, shape = flight.nees[:, times].mean(axis=0), (len(flight.states), len(flight.errors))
    low, high = nees_band(*shape)
    assert low < means.mean() < high
    low, high = nees_band(*shape, outside=1e-4)
    assert low < means.min() <= means.max() < high
    inside = np.abs(flight.errors[:, times]) < flights.QUANTILE * flight.deviations[:, times]
    assert (np.abs(inside.mean(axis=(0, 1)) - 0.95) < 0.04).all()


@pytest.mark.long
def test_two_hundred_flights_with_satellites_are_as_wrong_as_the_filter_says():
    flight = fly("gnss", Case(200))
    assert_consistent(flight)
    (low, high), mean = nees_band(15, 200), flight.nees[:, -1].mean()
    assert low < mean < high
    said = f"squared error is {mean:.1f} at the end; 95 % of such means lie between {low:.1f} and {high:.1f}."
    assert said in " ".join((DOCS / "kalman.md").read_text().split())
    assert (flight.deviations[0, -1, :3] < np.degrees(2e-3)).all()


@pytest.mark.long
def test_an_optimistic_filter_is_seen(tmp_path):
    """With a tenth of the noise of the gyros in the filter the errors are larger than it says."""
    text = (FOLDER / "gnss.toml").read_text()
    assert text.count('density = "0.05*degree/60"') == 3
    file = tmp_path / "gnss.toml"
    file.write_text(text.replace('density = "0.05*degree/60"', 'density = "0.005*degree/60"'))
    flight = flights.gnss(strapgen.kalman(file), Case(20))
    assert flight.nees[:, -1].mean() > 2 * nees_band(15, 20)[1]


def test_the_wind_lies_in_its_band():
    flight = fly("wind", Case(100))
    assert_consistent(flight, slice(100, None))
    start, end = flight.deviations[0, [0, -1]]
    assert (end[2:] < 0.1 * start[2:]).all()


@pytest.mark.long
def test_stops_hold_the_position():
    flight = fly("zero-velocity", Case(40))
    assert_consistent(flight)
    first = flight.states.index("position_x")
    # Between stops of two and a half minutes it drifts, and a stop takes most of it back.
    before, after = (np.linalg.norm(flight.errors[:, k, first:], axis=-1).mean() for k in (341, 350))
    assert after < before / 2


@pytest.mark.parametrize(
    ("latitude_deg", "text"), [(45, "pi/4"), pytest.param(60, "pi/3", marks=pytest.mark.long)]
)
def test_azimuth_of_gyrocompassing_is_off_by_the_east_gyro(latitude_deg, text, tmp_path):
    """By -B/(Omega cos L), times the share that the variances give to the azimuth of what both do alike."""
    file = tmp_path / "fine-alignment.toml"
    file.write_text((FOLDER / "fine-alignment.toml").read_text().replace('"pi/4"', f'"{text}"'))
    bias, heading = 0.01 * DEG_H, np.radians(30)
    errors = InstrumentErrors(gyro=TriadErrors(bias=bias * np.array([np.sin(heading), np.cos(heading), 0])))
    flight = flights.fine_alignment(strapgen.kalman(file), Case(1, "numpy", silent, errors), latitude_deg)
    rate = OMEGA * np.cos(np.radians(latitude_deg))
    share = (rate * 0.0175) ** 2 / ((rate * 0.0175) ** 2 + bias**2)
    azimuth = flight.states.index("azimuth")
    np.testing.assert_allclose(flight.errors[0, -1, azimuth], -share * bias / rate, rtol=0.02)
    # And no filter is surer of it than that.
    deviations = flight.deviations[0, :, azimuth]
    assert (deviations > np.sqrt(share) * bias / rate).all()
    assert deviations[-1] < 1.4 * bias / rate


def test_azimuth_and_east_gyro_cannot_be_told_apart():
    observability = model("fine-alignment").observability
    assert observability.rank == 6
    (combination,) = observability.unobservable
    assert "azimuth" in combination
    assert "gyro_east" in combination


@pytest.mark.long
def test_alignments_are_as_wrong_as_the_schedule_says():
    assert_consistent(fly("fine-alignment", Case(60)), slice(60, None))


@cache
def vertical(above: float = 30.0) -> Flight:
    """Return a flight without a barometer from 200 s to 260 s, and with another one from 400 s on."""
    return flights.baro_inertial(model("baro-inertial"), Case(100), Limits(above, 5.0))


def test_without_a_barometer_the_loop_coasts():
    flight = vertical()
    before, lost, again = (np.searchsorted(flight.time, time) for time in (199, 259.75, 320))
    height, climb, _ = flight.deviations[0].T
    assert height[lost] > 5 * height[before]
    assert climb[lost] > 2 * climb[before]
    for place in (before, lost, again):
        low, high = nees_band(3, 100)
        assert low < flight.nees[:, place].mean() < high
    assert np.isfinite(flight.errors).all()


def test_after_a_step_hysteresis_keeps_the_climb():
    climbs = {}
    for above in (30.0, 1e4):
        flight = vertical(above)
        step = flight.time > 400
        climbs[above] = np.abs(flight.errors[:, step, 1]).max()
        assert (np.abs(flight.errors[:, -1, 0]) < 5 * flight.deviations[0, -1, 0]).all()
    assert climbs[30.0] < 0.2 * climbs[1e4]


@pytest.mark.parametrize("backend", ["numpy", "c", "c-fixed32"])
def test_hysteresis_switches_at_its_two_limits(backend):
    switch, limited = strapgen.evaluator("height-hysteresis", backend), np.zeros(2)
    found = []
    for error in ([0, -31], [29, 20], [30, -5.5], [31, 5], [-6, 29], [4.9, -30.5]):
        limited = np.reshape(switch(limited, np.array(error, float), 30, 5), 2)
        found.append(limited.tolist())
    assert found == [[0, 1], [0, 1], [0, 1], [1, 0], [1, 0], [0, 1]]


@pytest.mark.parametrize("name", ["wind", "baro-inertial"])
def test_numpy_and_c_fly_the_same(name):
    one, other = (fly(name, Case(3, backend)) for backend in ("numpy", "c"))
    np.testing.assert_allclose(one.errors, other.errors, atol=1e-9)


@pytest.mark.long
def test_in_single_precision_factors_keep_more_digits_than_a_covariance():
    largest = {}
    for form in ("ud", "joseph"):
        one, other = (flights.gnss(model("gnss", form), Case(2, backend)) for backend in ("c", "c-float"))
        largest[form] = (np.abs(one.errors - other.errors) / one.deviations).max()
    assert largest["ud"] < 1e-4
    assert 2 * largest["ud"] < largest["joseph"] < 1e-3


@pytest.mark.parametrize("name", ["baro-inertial", pytest.param("fine-alignment", marks=pytest.mark.long)])
def test_in_words_of_32_bits_it_flies_as_in_double(name):
    one, other = (fly(name, Case(2, backend)) for backend in ("c", "c-fixed32"))
    difference = np.abs(one.errors - other.errors) / one.deviations
    assert 0 < difference.max() < 0.02


@pytest.mark.long
@pytest.mark.parametrize("name", flights.FLIGHTS)
def test_pictures_of_the_page_are_those_of_the_script(name, tmp_path, monkeypatch):
    """If this fails, run python examples/kalman/flights.py NAME --plot docs/kalman-NAME.svg."""
    drawn = tmp_path / f"kalman-{name}.svg"
    monkeypatch.setattr("sys.argv", ["flights.py", name, "--plot", str(drawn)])
    flights.main()
    number = r"-?\d+(?:\.\d+)?(?:e-?\d+)?"
    texts = [
        re.sub(r'(?:url\(#|id=")p[0-9a-f]{10}', "", path.read_text()) for path in (drawn, DOCS / drawn.name)
    ]
    ours, theirs = (np.array(re.findall(number, text), float) for text in texts)
    assert re.sub(number, "#", texts[0]) == re.sub(number, "#", texts[1])
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=0.5)


def test_the_script_flies_and_draws(tmp_path, monkeypatch, capsys):
    picture = tmp_path / "baro.svg"
    monkeypatch.setattr("sys.argv", ["flights.py", "baro-inertial", "--runs", "2", "--plot", str(picture)])
    flights.main()
    printed = capsys.readouterr().out.splitlines()
    assert printed[0].startswith("Baro-inertial filter of third order, 2 runs")
    assert [line.split()[0] for line in printed[1:]] == ["height", "climb", "bias"]
    assert picture.read_text().startswith("<?xml")
