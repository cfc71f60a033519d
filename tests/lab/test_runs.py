"""The simulator: what it records, and the input that it refuses."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from tolerances import certified

import strapgen
from strapgen.ir.exceptions import InputError
from strapgen.lab import runs
from strapgen.lab.recordings.recording import Recording, propagate
from strapgen.lab.runs import Run, angles, drift, simulate, steady_drift
from strapgen.run import backends, numpy_evaluator
from strapgen.run import increments as gyro
from strapgen.run.increments import StepWindows, pulses, run_parts, windows

CONING = {"a_deg_s": 10, "b_deg_s": 10, "g_deg_s": 10}

#: Algorithms with their samples, and their drifts in deg/h at 100 Hz over 60 s on the motions below.
ALGORITHMS = {
    "window-3-3": (1, 3, 3),
    "window-5-5": (1, 5, 5),
    "window-7-7": (1, 7, 7),
    "coning-shaped-8": (1, 8, 0),
    "coning-combined": (3, 3, 0),
    "coning-compressed": (1, 1, 0),
}
DRIFTS = {
    ("cone", "half_angle_deg=1 frequency_hz=10"): (0.213, 5.06e-3, 6.46e-6, 1.3e-4, 5.6e-4, 9.8),
    ("cone", "half_angle_deg=1 frequency_hz=20"): (1.01, 1.51e-2, 1.45e-4, 1.2e-3, 2.6, 271),
    ("cone", "half_angle_deg=5 frequency_hz=5"): (5.67e-2, 3.41e-3, 1.07e-4, 2.6e-3, 8.1e-5, 7.9),
    ("cone", "half_angle_deg=15 frequency_hz=20"): (222, 2.75, 0.539, 49, 71, 1.1e4),
    ("random", "rate_deg_s=200"): (0.262, 2.11e-3, 7.53e-4, 2.9, 0.32, 11),
    ("slew", "onset_s=0.05"): (3.9e-6, 1.5e-7, 9e-9, 2.4e-3, 1.1e-5, 5.8e-3),
    ("slew", "onset_s=0.01"): (1.96e-3, 1.50e-3, 1.35e-3, 1.1e-2, 3.5e-2, 2.4e-2),
    ("ramps", "onset_s=0.05"): (3.1e-3, 3.2e-3, 3.2e-3, 9.5e-3, 2.5e-2, 1.3e-2),
}
#: Below this drift in deg/h, 3e-12 rad after 60 s, rounding counts.
FLOOR = 1e-8

#: Steps of a run that is propagated in parts.
PART_STEPS = 50

H, STEPS, EVERY = 0.125, 1440, 40
A = B = G = math.radians(10)


def test_records_and_errors_fit_together(make, algorithm):
    run = simulate(make(algorithm), strapgen.motion("coning", **CONING), "0.125", 10, 5, "2.5")
    np.testing.assert_array_equal(run.time, [0, 2.5, 5, 7.5, 10])
    assert run.computed.shape == run.true.shape == run.error.shape == (5, 3, 3)
    E = run.computed @ np.swapaxes(run.true, -1, -2) - np.eye(3)
    ulp = 8 * np.finfo(float).eps  # sums of three products of numbers up to 1
    np.testing.assert_allclose(run.error, E, atol=ulp)
    np.testing.assert_allclose(run.scale, np.einsum("tii->ti", E), atol=ulp)
    np.testing.assert_allclose(run.skew[:, 0], (E[:, 1, 2] + E[:, 2, 1]) / 2, atol=ulp)
    np.testing.assert_allclose(run.drift[:, 1], (E[:, 2, 0] - E[:, 0, 2]) / 2, atol=ulp)
    assert run.mean_drift == pytest.approx(np.linalg.norm(np.abs(run.drift).max(axis=0)))


def test_the_computed_frame_lags_with_a_positive_drift(make):
    # First order turns by arctan(x) instead of x: the computed frame stays behind.
    backend = make("dcm", "rk1", largest=0.011, carry="full")
    run = simulate(backend, strapgen.motion("constant", y_deg_s=10), "0.125", 10, 5)
    assert run.drift[-1, 1] > 0
    x = np.radians(10) / 8
    wanted = 80 * (x - np.arctan(x))
    assert run.drift[-1, 1] == pytest.approx(wanted, abs=1e-3 * wanted + certified(backend, 80, 2))


def test_decimals_are_exact(make):
    # 0.1 divides 0.3, though not in binary.
    run = simulate(make("euler"), strapgen.motion("constant", y_deg_s=10), 0.1, 0.3)
    np.testing.assert_allclose(run.time, [0, 0.1, 0.2, 0.3], rtol=1e-15)


@pytest.mark.parametrize(
    ("times", "words"),
    [
        ({"step": "0.7", "duration": 1}, "duration 1 s is not a whole multiple of the step 0.7 s"),
        ({"step": 2, "duration": 1}, "not a whole multiple"),
        ({"step": "1e-9", "duration": "1e9"}, "duration 1e.09 s is over 2e.07 times the step 1e-09 s"),
        ({"step": 0, "duration": 1}, "step is 0; a number above 0"),
        ({"step": -0.1, "duration": 1}, "step is -0.1"),
        ({"step": "nan", "duration": 1}, "step is 'nan'; a finite number"),
        ({"step": 0.1, "duration": float("inf")}, "duration is 'inf'"),
        ({"step": "1/0", "duration": 1}, "step is '1/0'"),
        ({"step": "fast", "duration": 1}, "step is 'fast'"),
        ({"step": 0.1, "duration": 1, "record": 0.15}, "record 0.15 s is not a whole multiple"),
        ({"step": 0.1, "duration": 1, "record": 2}, "record 2 s is longer than the duration"),
        ({"step": 0.1, "duration": 1, "orthonormalize": 0.25}, "orthonormalize 0.25 s is not"),
        ({"step": 0.1, "duration": 1, "orthonormalize": -1}, "orthonormalize is -1"),
    ],
)
def test_invalid_times_are_refused(times, words):
    with pytest.raises(InputError, match=words.replace("(", r"\(")):
        simulate(strapgen.backend("euler"), strapgen.motion("constant", y_deg_s=1), **times)


def test_an_overflowing_run_names_the_rate_extraction():
    # A cone of 5 degrees at 20 Hz, sampled at 100 Hz: the polynomial through eight samples swings far beyond the rate.
    omega, half_angle = 2 * math.pi * 20, math.radians(5)
    cone = strapgen.motion(
        "coning",
        a_rad_s=omega * math.sin(half_angle),
        b_rad_s=omega,
        g_rad_s=-omega * (1 - math.cos(half_angle)),
    )
    said = (
        r"^the attitude is not finite from 240 s on; steps of euler-rk2-8 lengthen it: "
        r"the increments, or the rates of the polynomial through 8 of them, are too large for the method$"
    )
    with pytest.raises(InputError, match=said):
        strapgen.simulate(strapgen.backend("euler", "rk2", 8), cone, "0.08", 240, record=240)


def rates(algorithm: str, method: str = "rk4") -> strapgen.Backend:
    return strapgen.backend(strapgen.choose_step(algorithm, method, rates=True))


@pytest.mark.parametrize("algorithm", ["euler", pytest.param("dcm", marks=pytest.mark.long)])
def test_rates_are_as_good_as_increments_where_the_rate_is_constant(algorithm):
    steady = strapgen.motion("constant", x_deg_s=10, y_deg_s=-70, z_deg_s=30)
    runs = [
        simulate(backend, steady, "1/8", 20) for backend in (rates(algorithm), strapgen.backend(algorithm))
    ]
    np.testing.assert_allclose(runs[0].computed, runs[1].computed, rtol=0, atol=1e-12)
    assert rates(algorithm).nodes == (0, 0.5, 1)


@pytest.mark.parametrize(
    ("method", "increments"), [("rk4", 1), pytest.param("butcher6", 2, marks=pytest.mark.long)]
)
def test_the_orders_on_rates_and_on_increments_differ_as_the_series_predict(method, increments):
    coning = strapgen.motion("coning", a_rad_s=1, b_rad_s=1.5, g_rad_s=0.6)
    choices = [
        strapgen.choose_step("euler", method, rates=True),
        strapgen.choose_step("euler", method, increments),
    ]
    orders = []
    for choice in choices:
        drifts = [simulate(strapgen.backend(choice), coning, step, 2).mean_drift for step in ("1/16", "1/32")]
        orders.append(math.log2(drifts[0] / drifts[1]))
        assert orders[-1] == pytest.approx(strapgen.derive(choice).order.step, abs=0.1)
    assert orders[0] > orders[1] + 1, "the extraction of the rate loses orders"


@pytest.mark.long
@pytest.mark.parametrize("part", [None, 7])
def test_an_initial_attitude_turns_the_error(make, algorithm, part, monkeypatch):
    if part is not None:
        monkeypatch.setattr(strapgen.run.backends, "PART", part)
        monkeypatch.setattr(strapgen.run.increments, "PART", part)
    start = strapgen.evaluator("dcm-from-euler-angles")(np.radians([25.0, -40.0, 130.0]))
    coning = strapgen.motion("coning", **CONING)
    backend = make(algorithm, "rk2")
    turned, plain = (simulate(backend, coning, "1/8", 4, initial=initial) for initial in (start, None))
    rounding = 4 * certified(backend, 32, 0) + 1e-12 if backend.unit < 1e-12 else 100 * backend.unit * 32
    np.testing.assert_allclose(turned.error, start @ plain.error @ start.T, rtol=0, atol=rounding)
    np.testing.assert_allclose(
        np.linalg.norm(turned.drift, axis=1), np.linalg.norm(plain.drift, axis=1), rtol=0, atol=rounding
    )
    differ = np.abs(turned.drift_by_axis - plain.drift_by_axis).max()
    assert differ > 1e-5 or rounding > 1e-6, "the largest on each axis do not stay"


def test_orthonormalization_keeps_the_turned_error_to_second_order():
    start = strapgen.evaluator("dcm-from-euler-angles")(np.radians([25.0, -40.0, 130.0]))
    backend, apart, sizes = strapgen.backend("dcm", "rk1", 2), [], []
    for rate in (8, 4):
        steady = strapgen.motion("constant", x_deg_s=rate, y_deg_s=-2 * rate, z_deg_s=rate / 2)
        turned, plain = (
            simulate(backend, steady, "1/8", 5, 5, 5, initial=initial) for initial in (start, None)
        )
        apart.append(np.abs(turned.error - start @ plain.error @ start.T).max())
        sizes.append(np.abs(simulate(backend, steady, "1/8", 5, record=5).error).max())
    assert apart[0] > 1e-6
    assert math.log(apart[0] / apart[1]) / math.log(sizes[0] / sizes[1]) > 1.8


def test_an_initial_attitude_without_conversion_kernel_is_refused(monkeypatch):
    backend = strapgen.backend("euler")
    monkeypatch.setattr(backend, "attitude", "dcm-from-thirds")
    with pytest.raises(InputError, match="no kernel converts a matrix to the state of euler-rk4-2"):
        simulate(backend, strapgen.motion("constant", y_deg_s=1), 1, 1, initial=np.eye(3))


@pytest.mark.long
@pytest.mark.parametrize(("name", "settings"), DRIFTS, ids=[f"{n} {s}" for n, s in DRIFTS])
@pytest.mark.parametrize("method", ALGORITHMS)
def test_known_algorithms_drift_as_tabulated(method, name, settings):
    increments, previous, ahead = ALGORITHMS[method]
    expected = DRIFTS[name, settings][list(ALGORITHMS).index(method)]
    motion = strapgen.motion(name, **dict(setting.split("=") for setting in settings.split()))
    backend = strapgen.backend("euler", method, increments, "c", previous=previous, ahead=ahead)
    found = drift(strapgen.simulate(backend, motion, Fraction(increments, 100), 60))
    assert found <= FLOOR if expected < FLOOR else found == pytest.approx(expected, rel=0.1)


def runs_of(vectors: np.ndarray) -> Run:
    """Return a run whose errors are rotations by these vectors in rad, with a record a second."""
    from scipy.spatial.transform import Rotation

    error = Rotation.from_rotvec(vectors).as_matrix() - np.eye(3)
    still = np.broadcast_to(np.eye(3), error.shape)
    return Run(
        np.arange(len(vectors), dtype=float),
        still,
        still,
        error,
        *strapgen.evaluator("error-matrix")(error + still, still)[1:],
    )


def test_angles_are_those_of_the_error_small_or_large():
    vectors = np.zeros((4, 3))
    vectors[:, 1] = [0.0, 1e-12, 1.0, 3.0]
    np.testing.assert_allclose(angles(runs_of(vectors)), vectors[:, 1], rtol=1e-4, atol=1e-17)


def test_the_drift_is_the_largest_angle_over_the_duration():
    vectors = np.zeros((11, 3))
    vectors[4, 2] = math.radians(1)
    assert drift(runs_of(vectors)) == pytest.approx(360)


def test_the_steady_drift_excludes_oscillation():
    time = np.arange(101)
    vectors = np.zeros((101, 3))
    vectors[:, 0] = 1e-6 * time + 1e-3 * (-1.0) ** time
    assert steady_drift(runs_of(vectors)) == pytest.approx(math.degrees(1e-6) * 3600, rel=1e-3)
    assert drift(runs_of(vectors)) > 10 * steady_drift(runs_of(vectors))


@pytest.fixture
def short_parts(monkeypatch):
    """Propagate some steps together; the spans of the numpy back end are as long as the parts."""
    for module in (gyro, backends, runs):
        monkeypatch.setattr(module, "PART", 8)
    monkeypatch.setattr(numpy_evaluator, "_SPAN", 8)


@pytest.mark.parametrize(
    ("every", "record"), [(None, 1), (3, 1), (3, 7), (8, 50), (20, 3), (None, 11), (49, 49)]
)
def test_runs_in_parts_are_bit_identical(make, every, record, rng, short_parts):
    backend = make("euler", largest=0.011, carry="full")
    increments = backend.representable(rng.uniform(-0.011, 0.011, (PART_STEPS, 2, 3)))
    calls = []

    def part(first: int, count: int):
        calls.append((first, count))
        return increments[first : first + count]

    whole = backend.propagate(increments, record, every)
    np.testing.assert_array_equal(backend.propagate_parts(part, PART_STEPS, record, every), whole)
    assert len(calls) > 5
    assert [first for first, _ in calls] == np.cumsum([0, *(count for _, count in calls)])[:-1].tolist()


@pytest.mark.parametrize("segment", [0, 1, 3, 8, 9, 17, 60])
def test_parts_end_where_a_state_is_restored(segment, short_parts):
    restored, place = [], 0
    for first, count, every in run_parts(PART_STEPS, segment):
        assert (first, count <= 8) == (place, True)
        place += count
        restored += [first + k for k in range(1, count + 1) if every and k % every == 0]
    assert place == PART_STEPS
    assert restored == [k for k in range(1, PART_STEPS + 1) if segment and k % segment == 0]


def test_a_division_by_zero_ends_a_run_in_parts_as_one_in_memory(short_parts):
    backend = strapgen.backend("dcm", backend="exact", method="rk1", increments=1)
    increments = np.full((PART_STEPS, 1, 3), 1e300)
    whole = backend.propagate(increments, 1, 4)
    parts = backend.propagate_parts(lambda first, count: increments[first : first + count], PART_STEPS, 1, 4)
    np.testing.assert_array_equal(parts, whole)


def test_a_refusal_names_the_step_of_the_run(short_parts):
    settings = strapgen.Settings().fitted(0.01)
    backend = strapgen.backend("euler", backend="c-fixed32", settings=settings)
    increments = np.zeros((PART_STEPS, 2, 3))
    increments[30:] = np.array([0.0099, 0, 0])
    with pytest.raises(InputError) as whole:
        backend.propagate(np.where(np.arange(PART_STEPS)[:, None, None] == 30, 1.0, increments))
    with pytest.raises(InputError) as parts:
        backend.propagate_parts(
            lambda first, count: np.where(
                np.arange(first, first + count)[:, None, None] == 30, 1.0, increments[first : first + count]
            ),
            PART_STEPS,
        )
    assert str(parts.value) == str(whole.value)


@pytest.mark.parametrize("previous", [0, 1, 3])
@pytest.mark.parametrize("pulse", [None, 0.01])
def test_windows_in_parts_equal_those_of_the_whole_row(previous, pulse, rng):
    row = rng.normal(size=(previous + 2 * 20, 3))
    whole = windows(row, 2, previous)
    whole = whole if pulse is None else pulses(whole, pulse, previous)
    part = StepWindows(lambda first, stop: row[first:stop], 2, previous, pulse)
    counts = (3, 1, 9, 7)
    got = [part(first, count) for first, count in zip(np.cumsum([0, *counts]), counts, strict=False)]
    np.testing.assert_array_equal(np.concatenate(got), whole)


def test_uncountable_pulses_are_refused_in_later_parts():
    part = StepWindows(lambda first, stop: np.full((stop - first, 3), 1e14 * first), 1, 0, 0.1)
    part(0, 5)
    with pytest.raises(InputError, match="more pulses than can be counted"):
        part(5, 50)


@pytest.mark.parametrize(("previous", "ahead"), [(0, 0), pytest.param(2, 1, marks=pytest.mark.long)])
@pytest.mark.parametrize("pulse", [None, "1e-4"])
def test_simulations_and_recordings_run_in_parts(previous, ahead, pulse, request):
    backend = strapgen.backend("euler", "rk4", 1, previous=previous, ahead=ahead)
    motion = strapgen.motion("coning", a_deg_s=10, b_deg_s=10, g_deg_s=10)
    data = Recording(0.0, 0.125, motion.increments(runs.Fraction("0.125"), PART_STEPS, 1)[:, 0])

    def results():
        return (
            runs.simulate(backend, motion, "0.125", 6.25, "0.5", "0.25", pulse).computed,
            propagate(backend, data, 0.5, 0.25, pulse).states,
            runs.largest_increment(motion, "0.125", 6.25, 1, pulse, (previous, ahead)),
        )

    whole = results()
    request.getfixturevalue("short_parts")
    for one, other in zip(results(), whole, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-14)


def pulse(t: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the two increments of the step at t: PULSE, the coning motion on a constant pitch rate."""

    def increment(begin: float, end: float) -> np.ndarray:
        x = A / B * (math.cos(B * begin) - math.cos(B * end))
        z = A / B * (math.sin(B * end) - math.sin(B * begin))
        return np.array([x, G * H / 2, z])

    return increment(t, t + H / 2), increment(t + H / 2, t + H)


def truth(t: float) -> np.ndarray:
    W = np.array([[0, -A, B + G], [A, 0, 0], [-(B + G), 0, 0]])
    s, c, d = math.hypot(A, B + G), math.cos(B * t), math.sin(B * t)
    R = np.array([[c, 0, -d], [0, 1, 0], [d, 0, c]])
    return (np.eye(3) + W * math.sin(s * t) / s + W @ W / s**2 * (1 - math.cos(s * t))) @ R


def rate_of_change(algorithm: str, x: np.ndarray, w: np.ndarray) -> np.ndarray:
    p, q, r = w
    if algorithm == "dcm":
        return x @ np.array([[0, -r, q], [r, 0, -p], [-q, p, 0]])
    return 0.5 * np.array([[0, r, -q, p], [-r, 0, p, q], [q, -p, 0, r], [-p, -q, -r, 0]]) @ x


def algor(algorithm: str, order: int, x: np.ndarray, d1: np.ndarray, d2: np.ndarray) -> np.ndarray:
    begin, middle, end = (3 * d1 - d2) / H, (d1 + d2) / H, (3 * d2 - d1) / H

    def f(state: np.ndarray, w: np.ndarray) -> np.ndarray:
        return H * rate_of_change(algorithm, state, w)

    first = f(x, begin)
    if order == 1:
        return x + first
    if order == 2:
        return x + (f(x + first, end) + first) / 2
    second = f(x + first / 2, middle)
    third = f(x + second / 2, middle)
    fourth = f(x + third, end)
    return x + first / 6 + second / 3 + third / 3 + fourth / 6


def ortho(algorithm: str, x: np.ndarray) -> np.ndarray:
    if algorithm == "euler":
        return x / math.sqrt(x @ x)
    rows = x + np.array([np.cross(x[1], x[2]), np.cross(x[2], x[0]), np.cross(x[0], x[1])])
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def matrix(algorithm: str, x: np.ndarray) -> np.ndarray:
    if algorithm == "dcm":
        return x
    a, b, c, s = x
    return np.array(
        [
            [a * a - b * b - c * c + s * s, 2 * (a * b - c * s), 2 * (a * c + b * s)],
            [2 * (a * b + c * s), -a * a + b * b - c * c + s * s, 2 * (b * c - a * s)],
            [2 * (a * c - b * s), 2 * (b * c + a * s), -a * a - b * b + c * c + s * s],
        ]
    )


def error(computed: np.ndarray, true: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    E = computed @ true.T - np.eye(3)
    skew = np.array([E[1, 2] + E[2, 1], E[0, 2] + E[2, 0], E[0, 1] + E[1, 0]]) / 2
    drift = np.array([E[1, 2] - E[2, 1], E[2, 0] - E[0, 2], E[0, 1] - E[1, 0]]) / 2
    return np.diag(E), skew, drift


@pytest.mark.long
@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("algorithm", ["dcm", "euler"])
def test_a_run_of_gssa2_is_a_run_of_strapgen(algorithm, order):
    motion = strapgen.motion("coning", a_rad_s=A, b_rad_s=B, g_rad_s=G)
    run = strapgen.simulate(
        strapgen.backend(algorithm, f"rk{order}", 2), motion, H, STEPS * H, EVERY * H, EVERY * H
    )
    state = np.eye(3) if algorithm == "dcm" else np.array([0.0, 0, 0, 1])
    for step in range(STEPS):
        state = algor(algorithm, order, state, *pulse(step * H))
        if step == 0:  # a few roundings of numbers up to 1
            first = strapgen.simulate(strapgen.backend(algorithm, f"rk{order}", 2), motion, H, H).computed[-1]
            np.testing.assert_allclose(matrix(algorithm, state), first, rtol=0, atol=5e-16)
        if (step + 1) % EVERY == 0:
            state = ortho(algorithm, state)
            record, time = (step + 1) // EVERY, (step + 1) * H
            parts = error(matrix(algorithm, state), truth(time))
            # Roundings add up at random over 1440 steps of a few each.
            for ported, ours in zip(parts, (run.scale, run.skew, run.drift), strict=True):
                np.testing.assert_allclose(ported, ours[record], rtol=0, atol=3e-14)
