"""The loop of a tuned-rotor gyro: a rotor by its equations of motion in the plant, and what the observer tells."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

import strapgen
from strapgen.ir.exceptions import InputError
from strapgen.navigation.instruments.tuned_rotor import tuned_rotor_gains

NUTATION_HZ, CYCLE = 300.0, 1e-3


def rotor() -> tuple[np.ndarray, np.ndarray]:
    """Return the transition of angles and rates of a rotor over a cycle, and what torques over H do.

    I x'' + H y' = M_x and I y'' - H x' = M_y, with H/I the nutation frequency: real, and by a matrix exponential.
    """
    nutation = 2 * np.pi * NUTATION_HZ
    system = np.zeros((6, 6))
    system[0, 2] = system[1, 3] = 1
    system[2, 3], system[3, 2] = -nutation, nutation
    system[2, 4] = system[3, 5] = nutation
    step = expm(system * CYCLE)
    return step[:4, :4], step[:4, 4:]


def run(case, poles, cycles: int, backend: str = "numpy", noise=None) -> tuple[np.ndarray, np.ndarray]:
    """Return the estimated increments and the angles of the case against the rotor, (cycles, 2).

    `case`: angles of the case at times in s, (2,).
    """
    evaluate = strapgen.evaluator("tuned-rotor-loop", backend)
    gains = [np.array(pair) for pair in tuned_rotor_gains(NUTATION_HZ, CYCLE, *poles).values()]
    free, forced = rotor()
    state = np.array([1e-4, -2e-4, 0.02, 0.03])  # with a nutation
    estimates, angles, states = [], [], [np.zeros(2)] * 4
    torque = np.zeros(2)
    for k in range(cycles):
        angle = np.asarray(case(k * CYCLE)) - state[:2]
        read = angle if noise is None else angle + noise[k]
        states = [np.asarray(x, float) for x in evaluate(*states, read, *gains)]
        estimates.append(states[2])
        angles.append(angle)
        state = free @ state + forced @ torque / CYCLE
        torque = np.array([states[3][1], -states[3][0]])
    return np.array(estimates), np.array(angles)


@pytest.mark.parametrize("poles", [(0.5, 0.7), (0.0, 0.6), (0.8, 0.8)])
def test_a_constant_rate_is_told_and_the_rotor_follows_whatever_its_nutation(poles):
    rate = np.array([0.4, -0.9])
    estimates, angles = run(lambda t: rate * t, poles, 300)
    np.testing.assert_allclose(estimates[-50:], np.tile(rate * CYCLE, (50, 1)), atol=1e-11)
    assert np.abs(angles[-50:]).max() < 1e-10 < 1e-3 < np.abs(angles[:50]).max()


def test_the_output_does_not_depend_on_the_loop():
    def case(t: float) -> np.ndarray:
        return np.array([1e-3 * np.sin(2 * np.pi * 12 * t), 2e-3 * np.sin(2 * np.pi * 30 * t)])

    (one, hangs), (other, hangs_less) = (run(case, (0.6, pole), 400) for pole in (0.95, 0.5))
    np.testing.assert_allclose(one, other, atol=1e-12)
    assert np.abs(hangs[200:]).max() > 2 * np.abs(hangs_less[200:]).max()


def test_the_output_is_close_to_the_rate_after_a_delay():
    """A sine of 10 Hz at 1000 Hz: the gain is near 1, and the phase that of a few cycles."""
    estimates, _ = run(lambda t: np.array([1e-3 * np.sin(2 * np.pi * 10 * t), 0]), (0.3, 0.7), 1000)
    times = np.arange(1000) * CYCLE
    wave = np.exp(-2j * np.pi * 10 * times)[500:]
    gain = 2 * (estimates[500:, 0] * wave).mean() / (1e-3 * 2 * np.pi * 10 * CYCLE)
    assert abs(gain) == pytest.approx(1, abs=0.02)
    delay = -np.angle(gain) / (2 * np.pi * 10 * CYCLE)
    assert 0 < delay < 4


def test_a_smaller_pole_of_the_observer_costs_noise(rng):
    noise = 1e-6 * rng.normal(size=(2000, 2))
    fast, slow = (
        run(lambda t: np.zeros(2), (pole, 0.7), 2000, noise=noise)[0][500:].std() for pole in (0.2, 0.8)
    )
    assert fast > 5 * slow


def test_numpy_and_c_are_one():
    rate = np.array([0.1, 0.2])
    one, other = (run(lambda t: rate * t, (0.5, 0.7), 40, backend)[0] for backend in ("numpy", "c"))
    np.testing.assert_allclose(one, other, atol=1e-15)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ((0, 1e-3, 0.5, 0.5), "nutation_hz is 0; a number above 0 is needed"),
        ((300, float("inf"), 0.5, 0.5), "cycle_s is inf; a number above 0 is needed"),
        ((300, 1e-3, 1, 0.5), "observer_pole is 1; a number from 0 to below 1 is needed"),
        ((300, 1e-3, 0.5, -0.1), "loop_pole is -0.1; a number from 0 to below 1"),
        (
            (400, 1 / 400, 0.5, 0.5),
            "the nutation turns by .* deg from sample to sample; an observer needs it away",
        ),
    ],
)
def test_gains_that_cannot_be_are_refused(values, words):
    with pytest.raises(InputError, match=words):
        tuned_rotor_gains(*values)
