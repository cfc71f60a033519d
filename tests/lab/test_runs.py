"""The simulator: what it records, and the input that it refuses."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tolerances import certified

import strapgen
from strapgen.ir.exceptions import InputError
from strapgen.lab.runs import simulate

CONING = {"a_deg_s": 10, "b_deg_s": 10, "g_deg_s": 10}


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
def test_times_that_cannot_be_used(times, words):
    with pytest.raises(InputError, match=words.replace("(", r"\(")):
        simulate(strapgen.backend("euler"), strapgen.motion("constant", y_deg_s=1), **times)


def test_a_run_that_overflows_names_the_samples_that_the_rate_is_extracted_from():
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


def test_a_state_without_a_kernel_for_its_start_begins_at_zero_rotation(monkeypatch):
    backend = strapgen.backend("euler")
    monkeypatch.setattr(backend, "attitude", "dcm-from-thirds")
    with pytest.raises(InputError, match="no kernel converts a matrix to the state of euler-rk4-2"):
        simulate(backend, strapgen.motion("constant", y_deg_s=1), 1, 1, initial=np.eye(3))
