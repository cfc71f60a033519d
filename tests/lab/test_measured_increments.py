"""Sensor errors: what each cause makes of increments, and that no cause disturbs another."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from tolerances import roundoff

import strapgen
from strapgen import choose
from strapgen.analysis.vibration import of, through_gyro, through_gyros
from strapgen.catalogue.methods.sensor_response import Response, parse
from strapgen.lab.motions.motions import IntegratedMotion
from strapgen.lab.motions.rate_profiles import CosineSum, ReferenceAttitude
from strapgen.lab.recordings.recording import InertialRecording, Recording
from strapgen.lab.runs import drift_between, simulate
from strapgen.lab.sensor_errors.instruments import (
    CAUSES,
    Heating,
    InstrumentErrors,
    OutputNoise,
    Sampling,
    TriadErrors,
    WarmUp,
)
from strapgen.lab.sensor_errors.measured_motions import measured, measured_recording
from strapgen.lab.sensor_errors.sensors import MeasurementUnit, bounded_noise, filtered
from strapgen.run.backends import evaluator

CONING = {"a_deg_s": 10, "b_deg_s": 10, "g_deg_s": 10}
STEP = Fraction(1, 100)
NONE = InstrumentErrors()
THREE = np.array([1.0, -2.0, 3.0])
#: One of each cause, of a size that is seen.
EVERY = InstrumentErrors(
    gyro=TriadErrors(
        bias=1e-4 * THREE,
        scale_plus=np.full(3, 1e-3),
        scale_minus=np.full(3, 2e-3),
        misalignment=1e-3 * (1 - np.eye(3)),
        terms={"B_xx": 1e-5, "J_yz": 1e-4},
        noise=np.full(3, 1e-4),
        random_walk=np.full(3, 1e-4),
        pulse=np.full(3, 1e-5),
        lock_in=np.full(3, 1e-4),
        response=parse("gyro", "butterworth:3:20+decimation:2+fir:1/2:1/4:1/4"),
        delay=np.full(3, 0.013),
    ),
    sampling=Sampling(1e-3, 0.05, "late"),
    warm_up=WarmUp(np.full(3, 1e-3), np.full(3, 2.0)),
    heating=Heating(np.full(3, -1e-2), 1.0),
    output_noise=OutputNoise(0.9, np.full(3, 1e-5)),
)


@pytest.fixture
def row() -> np.ndarray:
    """Increments of a coning motion, 4 s."""
    return strapgen.motion("coning", **CONING).samples(STEP, 0, 400)


def gyros(errors: InstrumentErrors, row: np.ndarray, run: int = 0, force: float = 0.0) -> np.ndarray:
    return MeasurementUnit(errors, float(STEP), run)(row, np.full_like(row, force))[0]


def test_runs_without_errors_are_bit_identical(make, algorithm):
    backend, motion = make(algorithm), strapgen.motion("coning", **CONING)
    for errors in (NONE, EVERY.without(*CAUSES)):
        assert measured(motion, errors) is motion
        plain, beside = (
            simulate(backend, profile, "0.125", 1) for profile in (motion, measured(motion, errors))
        )
        np.testing.assert_array_equal(plain.computed, beside.computed)
    data = Recording(0.0, 0.01, motion.samples(STEP, 0, 5))
    assert measured_recording(data, NONE) is data


def test_errors_act_alike_on_every_back_end(make, algorithm):
    errors = EVERY.without("terms")
    reference = strapgen.backend(algorithm, method="rk4", increments=2)
    profile = measured(strapgen.motion("coning", **CONING), errors)
    expected = simulate(reference, profile, "0.02", 1)
    backend = make(algorithm, largest=0.02)
    run = simulate(backend, profile, "0.02", 1)
    true = simulate(backend, profile.true, "0.02", 1)
    # Both runs round, each element of a state within its bound, and a drift is up to four of them; the drift of the
    # method, which is in the expected one alone, is far below 1e-6 rad.
    assert np.abs(expected.drift).max() > 5e-4
    allowed = 8 * roundoff(backend, 50) + 1e-6
    np.testing.assert_allclose(run.drift - true.drift, expected.drift, atol=allowed)


@pytest.mark.parametrize("cause", CAUSES)
def test_each_cause_acts_alone(cause, row):
    assert cause in [*EVERY.causes]
    alone = EVERY.only(cause)
    assert [*alone.causes] == [cause]
    assert not np.array_equal(gyros(alone, row, force=0.1), row)
    assert np.array_equal(gyros(alone.without(cause), row, force=0.1), row)


@pytest.mark.parametrize("cause", ["noise", "random walk", "output noise", "lost samples"])
def test_causes_have_independent_random_streams(cause, row):
    others = [other for other in ("noise", "random walk", "output noise") if other != cause]
    both = gyros(EVERY.only(*others, cause), row)
    if cause == "lost samples":
        arrived = both.any(axis=1)
        arrived[1:] &= arrived[:-1]  # a sample after a lost one holds both
        assert 300 < arrived.sum() < 400
        np.testing.assert_array_equal(both[arrived], gyros(EVERY.only(*others), row)[arrived])
        return
    change = gyros(EVERY.only(cause), row) - row
    np.testing.assert_allclose(both - gyros(EVERY.only(*others), row), change, atol=1e-16)


@pytest.mark.parametrize("cause", [None, *CAUSES])
def test_measuring_in_parts_equals_measuring_at_once(cause, row):
    errors = EVERY if cause is None else EVERY.only(cause)
    whole = MeasurementUnit(errors, float(STEP))(row, 0.1 + row)
    unit = MeasurementUnit(errors, float(STEP))
    parts = [unit(part, 0.1 + part) for part in np.split(row, [0, 1, 2, 130, 130, 131, 390])]
    for kind in (0, 1):
        # Pulses are whole ones in both, where no angle lies at the edge of a pulse to round-off.
        np.testing.assert_allclose(np.concatenate([part[kind] for part in parts]), whole[kind], atol=1e-15)


def test_measured_motions_are_repeatable():
    profile = measured(strapgen.motion("coning", **CONING), EVERY, force=(0, 0, 9.81))
    whole = profile.samples(STEP, 0, 300)
    np.testing.assert_allclose(profile.samples(STEP, 100, 200), whole[100:200], atol=1e-15)
    np.testing.assert_allclose(profile.samples(STEP, 200, 300), whole[200:], atol=1e-15)
    np.testing.assert_array_equal(profile.samples(STEP, 0, 300), whole)
    # What lies before the run has the steady errors, and moves none of the random numbers.
    before = profile.samples(STEP, -2, 300)
    np.testing.assert_array_equal(before[2:], whole)
    bias = 1e-4 * THREE * 0.01
    alone = measured(profile.true, EVERY.only("bias"))
    np.testing.assert_allclose(alone.samples(STEP, -2, 0) - profile.true.samples(STEP, -2, 0), [bias] * 2)
    with pytest.raises(strapgen.InputError, match="takes rates"):
        profile.rate(0.0)


def test_a_turn_one_way_has_the_scale_error_times_its_angle():
    turn = np.full((100, 3), 0.0157)
    errors = InstrumentErrors(gyro=TriadErrors(scale_plus=np.full(3, 3e-4), scale_minus=np.full(3, 1e-4)))
    np.testing.assert_allclose((gyros(errors, turn) - turn).sum(axis=0), 3e-4 * 1.57, rtol=1e-12)
    np.testing.assert_allclose((gyros(errors, -turn) + turn).sum(axis=0), -1e-4 * 1.57, rtol=1e-12)


def test_scale_factors_by_sign_rectify_an_oscillation():
    amplitude, hertz, cycles, samples = 0.1, 5, 20, 200
    angle = -amplitude * np.cos(2 * np.pi * np.arange(cycles * samples + 1) / samples)
    row = np.repeat(np.diff(angle)[:, None], 3, axis=1)
    errors = InstrumentErrors(gyro=TriadErrors(scale_plus=np.full(3, 3e-4), scale_minus=np.full(3, 1e-4)))
    mean = (gyros(errors, row) - row).sum(axis=0) / (cycles / hertz)
    np.testing.assert_allclose(mean, 2 * amplitude * hertz * 2e-4, rtol=1e-10)
    assert np.degrees(mean[0]) * 3600 == pytest.approx(41.25296, abs=5e-6)


def test_compensation_cancels_errors_to_second_order(row):
    velocity = 0.1 + row

    def left(share: float) -> float:
        gyro = TriadErrors(
            bias=share * 1e-3 * THREE,
            misalignment=share * 1e-3 * (1 - np.eye(3)),
            terms={"B_xy": share * 1e-5, "E_yy": share * 1e-6, "J_xz": share * 1e-4},
        )
        force = TriadErrors(bias=share * 1e-2 * THREE, terms={"N_zz": share * 1e-5})
        errors = InstrumentErrors(gyro=gyro, accelerometer=force)
        unit = MeasurementUnit(errors, float(STEP))
        values = {
            "D0": gyro.bias,
            "K": gyro.misalignment.ravel(),
            "A0": force.bias,
            "J": share * np.array([0, 1e-4, 0]),
            "B": share * np.array([0, 1e-5, 0, 0, 0, 0, 0]),
            "E": share * np.array([0, 0, 0, 1e-6, 0]),
            "N": share * np.array([0, 0, 0, 0, 0, 1e-5]),
        }
        compensate = evaluator("imu-compensate")
        inputs = [
            values.get(signal.elements[0].partition("_")[0], np.zeros(signal.shape))
            for signal in compensate.function.inputs[4:]
        ]
        true = compensate(*unit(row, velocity), float(STEP), 1 / float(STEP), *inputs)
        return float(max(np.abs(true[0] - row).max(), np.abs(true[1] - velocity).max()))

    assert left(0.5) == pytest.approx(left(1.0) / 4, rel=0.01)


def test_the_warm_up_is_the_integral_of_its_rate():
    warm = WarmUp(np.radians(np.array([15.0, 60.0, 0.0]) / 3600), np.array([180.0, 210.0, 1.0]))
    unit = MeasurementUnit(InstrumentErrors(warm_up=warm), 0.5)
    angle = np.concatenate([unit(np.zeros((400, 3)))[0], unit(np.zeros((80, 3)))[0]]).sum(axis=0)
    expected = warm.rate * (240 - warm.tau * (1 - np.exp(-240 / warm.tau)))
    np.testing.assert_allclose(angle, expected, rtol=1e-12)


def test_heating_follows_the_figures_of_its_kernel():
    # 100 deg/s about x turns the torquers at 45 degrees by the same square of the rate on gyros 2 and 3.
    errors = InstrumentErrors(heating=Heating(np.full(3, -2.6e-4), 150.0))
    rate = np.zeros((720, 3))
    rate[:, 0] = np.radians(100) * 0.5
    measured_rate = MeasurementUnit(errors, 0.5)(rate)[0]
    scale = rate[:, 0] / measured_rate[:, 0] - 1
    assert scale[300] == pytest.approx(-5.00643e-4, rel=2e-3)
    assert scale[-1] == pytest.approx(-7.20156e-4, rel=2e-3)


def test_pulses_are_whole_and_lose_nothing(row):
    pulse = np.array([1e-5, 0.0, 3e-5])
    errors = InstrumentErrors(gyro=TriadErrors(pulse=pulse))
    counted = gyros(errors, row)
    np.testing.assert_array_equal(counted[:, 1], row[:, 1])
    counts = counted[:, [0, 2]] / pulse[[0, 2]]
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-9)
    departure = np.abs(np.cumsum(counted - row, axis=0))
    assert (departure.max(axis=0) <= pulse + 1e-15).all()
    assert departure[:, 0].max() > 0.5e-5


def test_a_delay_holds_the_angle_back_by_its_time(row):
    steady = np.tile([0.01, -0.02, 0.0], (50, 1))
    for delay in (0.002, 0.01, 0.037):
        errors = InstrumentErrors(gyro=TriadErrors(delay=np.array([delay, delay, 0.0])))
        np.testing.assert_allclose(gyros(errors, steady), steady, atol=1e-15)
        lag = np.cumsum(row - gyros(errors, row), axis=0)[100:]
        # A rate w that changes by a deg/s^2 is late by w delay, to half of a delay (delay + interval) for ends.
        rate = row[100:] / 0.01
        allowed = np.radians(100) * delay * (delay + 0.01)
        past = delay * (rate - rate[0])[:, :2]
        assert np.abs(lag[:, :2] - lag[0, :2] - past).max() < 2 * allowed
        assert not lag[:, 2].any()


def test_too_long_delays_are_refused(row):
    errors = InstrumentErrors(gyro=TriadErrors(delay=np.full(3, 10.0)))
    with pytest.raises(strapgen.InputError, match="2e\\+06 sampling intervals late"):
        MeasurementUnit(errors, 5e-6)


def test_jitter_moves_the_angle_by_rate_times_time():
    steady = np.tile([0.01, -0.02, 0.0], (20_000, 1))
    errors = InstrumentErrors(sampling=Sampling(jitter=1e-4))
    angle = np.cumsum(gyros(errors, steady) - steady, axis=0)
    # 20,000 numbers tell a standard deviation to 1/sqrt(40000); four of these are allowed.
    assert angle[:, 0].std() == pytest.approx(1e-4 * 1.0, rel=0.02)
    np.testing.assert_allclose(angle[:, 1], -2 * angle[:, 0], atol=1e-12)


def test_a_gyro_of_limited_bandwidth_has_the_gain_and_the_phase_of_second_order():
    hertz, damping, interval = 80.0, 0.7, 1e-4
    recursion = filtered(parse("gyro", f"second-order:{hertz}:{damping}"), interval)
    for frequency in (10.0, 80.0, 200.0):
        turn = 2 * np.pi * frequency
        time = np.arange(20_001) * interval
        put_in = np.diff(np.sin(turn * time))
        angle = np.cumsum(recursion.run(put_in, np.array([put_in[0], 0.0]))[0])[10_000:]
        seen = 2 * np.mean(angle * np.exp(-1j * turn * time[10_001:])) * 1j
        ratio = 1j * frequency / hertz
        expected = 1 / (1 + 2 * damping * ratio + ratio**2)
        # The rate is a staircase: its error is (turn interval)^2/12.
        assert abs(seen - expected) < (turn * interval) ** 2


def test_output_noise_has_the_printed_variances_and_a_bounded_sum():
    impulse = np.zeros(3000)
    impulse[0] = 1.0
    response, _ = bounded_noise(0.9).run(impulse, np.zeros(2))
    # Printed for unit noise: 2(1-A)^2/(1+A), and (1-A)/(1+A) for the running sum.
    assert np.sum(response**2) == pytest.approx(0.02 / 1.9, rel=1e-12)
    assert np.sum(response**2) == pytest.approx(0.0105263, abs=5e-8)
    assert np.sum(np.cumsum(response) ** 2) == pytest.approx(0.0526316, abs=5e-8)
    assert response.sum() == pytest.approx(0.0, abs=1e-12)  # so that the sum does not walk
    row = gyros(InstrumentErrors(output_noise=OutputNoise(0.9, THREE**2)), np.zeros((20_000, 3)))
    # Numbers that are correlated over some ten samples tell a deviation to 1 or 2 %.
    np.testing.assert_allclose(row.std(axis=0), np.sqrt(0.0105263) * THREE**2, rtol=0.05)


def test_accelerometers_have_errors_of_their_own(row):
    force = TriadErrors(
        bias=1e-2 * THREE,
        scale_plus=np.full(3, 1e-3),
        noise=np.full(3, 1e-3),
        pulse=np.array([0.01, 0, 0]),
    )
    errors, up = InstrumentErrors(accelerometer=force), np.full_like(row, 0.0981)

    def sensed(*causes: str) -> np.ndarray:
        angle, velocity = MeasurementUnit(errors.only(*causes), float(STEP))(row, up)
        np.testing.assert_array_equal(angle, row)
        return velocity

    np.testing.assert_allclose(sensed("bias") - up, [1e-4 * THREE] * len(row), rtol=1e-9)
    np.testing.assert_allclose(sensed("scale"), 1.001 * up, rtol=1e-14)
    # 1200 numbers tell a deviation to 2 %.
    assert (sensed("noise") - up).std() == pytest.approx(1e-3 * 0.1, rel=0.08)
    counts = sensed("pulses")[:, 0] / 0.01
    assert {*np.rint(counts)} == {9.0, 10.0} and np.abs(counts - np.rint(counts)).max() < 1e-9


def test_heated_torquers_disturb_both_rate_and_acceleration(row):
    heat = Heating(np.full(3, -2.6e-4), 150.0, np.radians(5) / 9.81)
    unit = MeasurementUnit(InstrumentErrors(heating=heat), float(STEP))
    fast, up = np.tile([0.0, 0.0, np.radians(200) / 100], (500, 1)), np.full((500, 3), 0.0981)
    angle, velocity = unit(fast, up)
    np.testing.assert_allclose(angle[0], fast[0], atol=1e-15)
    np.testing.assert_allclose(velocity[0], up[0], atol=1e-14)
    # The torquers that turn have warmed up; what they then say of the acceleration is off as well.
    assert angle[-1, 2] > fast[-1, 2] * (1 + 1e-5)
    assert np.abs(velocity[-1] - up[-1]).max() > 1e-5


@pytest.mark.parametrize(
    ("lost_as", "expected"),
    [("zero", [1, 0, 0, 4, 5, 0]), ("repeat", [1, 1, 1, 4, 5, 5]), ("late", [1, 0, 0, 9, 5, 0])],
)
def test_lost_samples_are_replaced_as_stated(lost_as, expected, monkeypatch):
    class Dice:
        def uniform(self, name, count, width):
            return np.array([[0.9], [0.0], [0.0], [0.9], [0.9], [0.0]])[:count]

    errors = InstrumentErrors(sampling=Sampling(0.0, 0.5, lost_as))
    unit = MeasurementUnit(errors, 0.01)
    unit._loss._streams = Dice()
    row = np.repeat(np.arange(1.0, 7.0)[:, None], 3, axis=1)
    np.testing.assert_array_equal(unit(row)[0][:, 0], expected)
    rest = {"late": [7.0], "zero": [1.0], "repeat": [1.0]}[lost_as]  # the sixth arrives with the seventh
    np.testing.assert_array_equal(unit(np.ones((1, 3)))[0][:, 0], rest)


def test_drawn_constants_have_the_stated_deviations():
    stated = InstrumentErrors(gyro=TriadErrors(bias=np.full(3, 2.0), scale_plus=np.full(3, 0.1)), drawn=True)
    units = [MeasurementUnit(stated, 0.01, run).errors for run in range(300)]
    bias = np.array([unit.gyro.bias for unit in units])
    # 900 numbers tell a deviation to 1/sqrt(1800); three of these are allowed.
    assert bias.std() == pytest.approx(2.0, rel=0.07)
    assert abs(np.corrcoef(bias[:, 0], [unit.gyro.scale_plus[0] for unit in units])[0, 1]) < 0.2


def test_acceleration_errors_need_a_specific_force():
    errors = InstrumentErrors(gyro=TriadErrors(terms={"B_xz": 1e-5}))
    motion = strapgen.motion("constant", z_deg_s=0)
    with pytest.raises(strapgen.InputError, match="a specific force is needed"):
        measured(motion, errors)
    profile = measured(motion, errors, force=(0, 0, 9.81))
    np.testing.assert_allclose(profile.samples(STEP, 0, 2)[:, 0], 9.81e-5 * 0.01)
    with pytest.raises(strapgen.InputError, match="no velocity increments"):
        measured_recording(Recording(0.0, 0.01, np.zeros((5, 3))), errors)
    data = InertialRecording(0.0, 0.01, np.zeros((5, 3)), np.full((5, 3), 0.1))
    np.testing.assert_allclose(measured_recording(data, errors).increments[:, 0], 1e-6)


def test_the_start_turns_the_specific_force():
    errors = InstrumentErrors(gyro=TriadErrors(terms={"B_xz": 1e-5}))
    motion = strapgen.motion("constant", z_deg_s=0)
    turned = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])  # body z points along reference -y
    profile = measured(motion, errors, force=(0, -9.81, 0), start=turned)
    np.testing.assert_allclose(profile.samples(STEP, 0, 2)[:, 0], 9.81e-5 * 0.01)


class Angles(IntegratedMotion):
    """Angles about x and y at one frequency in Hz, y ahead by a phase; the parameters are its numbers."""

    @property
    def profile(self):
        turn = 2 * math.pi * self.parameters["hertz"]
        size = np.array([[self.parameters["x"]], [self.parameters["y"]], [0.0]])
        # The rate of sin(turn t + phase) is turn cos(turn t + phase).
        phases = np.array([[0.0], [self.parameters["phase"]], [0.0]])
        return CosineSum(turn * size, np.full((3, 1), turn), phases)

    def attitude(self, time):
        return ReferenceAttitude(self.profile.rate, 16)(time)


def angles(x: float, y: float, hertz: float, phase: float) -> Angles:
    return Angles("angles", {"x": x, "y": y, "hertz": hertz, "phase": phase})


def false_rate(motion, errors, step, seconds) -> np.ndarray:
    """Return the mean rate that errors add to the attitude of an algorithm on a motion, in rad/s."""
    backend = strapgen.backend("euler", method="rk4", increments=2)
    true, seen = (
        simulate(backend, profile, step, seconds).computed for profile in (motion, measured(motion, errors))
    )
    # From the end of the first half on: what begins with the run has died out, and whole periods have passed.
    middle = len(true) // 2
    drift = -drift_between(seen[[middle, -1]], true[[middle, -1]])
    return (drift[1] - drift[0]) / (seconds / 2)


def test_jinking_through_scale_factors_has_the_printed_rate():
    # Roll and turn a quarter period apart, .2 and .3 rad at 1 Hz, 200 and 300 ppm.
    plain, quarter = of(choose("euler", "coning-compressed", 4)), math.pi / 2
    true, seen = (
        plain.rates(1, "0.02", theta_x=x, theta_y=y, phase=quarter).continuous
        for x, y in (("0.2", "0.3"), ("0.20004", "0.30009"))
    )
    expected = -math.pi * 0.2 * 0.3 * ((1 + 200e-6) * (1 + 300e-6) - 1)
    assert seen - true == pytest.approx(expected, rel=1e-9)
    assert seen - true == pytest.approx(-9.425908934e-5, rel=1e-9)
    assert math.degrees(seen - true) * 3600 == pytest.approx(-19.4423, abs=5e-5)


@pytest.mark.long
def test_jinking_in_the_simulator_follows_the_formula_for_small_angles():
    # The formula is of second order: a tenth of the printed amplitudes leaves about 0.05 % of fourth order.
    scale = np.array([200e-6, 300e-6, 0.0])
    errors = InstrumentErrors(gyro=TriadErrors(scale_plus=scale, scale_minus=scale))
    rate = false_rate(angles(0.02, 0.03, 1.0, math.pi / 2), errors, Fraction(1, 200), 20)
    expected = -math.pi * 0.02 * 0.03 * ((1 + 200e-6) * (1 + 300e-6) - 1)
    assert rate[2] == pytest.approx(expected, rel=2e-3)


def test_unequal_loops_measure_false_coning():
    hertz, amplitude, damping = 20.0, 2e-3, 0.7
    motion = angles(amplitude, amplitude, hertz, 0.0)
    wave = {"theta_x": amplitude, "theta_y": amplitude, "phase": 0}
    plain = of(choose("euler", "rk4", 2))
    step = Fraction(1, 1000)
    for frequencies in ((80.0, 60.0), (60.0, 80.0), (80.0, 80.0)):
        x, y = (parse("gyro", f"second-order:{frequency}:{damping}") for frequency in frequencies)
        gyro = TriadErrors(response=(x, y, Response()))
        rate = false_rate(motion, InstrumentErrors(gyro=gyro), step, 2)[2]
        rates = through_gyros(plain, x, y).rates(20, step, **wave)
        assert rates.continuous == 0
        # A staircase of the rate with 2000 stairs a second leaves (turn T)^2/12 = 0.03 %.
        assert rate == pytest.approx(rates.computed, rel=2e-3, abs=1e-9)
        gains = [1 / (1 + 2j * damping * 20 / f - (20 / f) ** 2) for f in frequencies]
        # Which gyro is ahead by d shows an angle ahead by d: pi f theta^2 |Gx||Gy| sin d.
        ahead = (gains[1] * np.conj(gains[0])).imag
        formula = -math.pi * hertz * amplitude**2 * ahead
        assert rates.computed == pytest.approx(formula, rel=2e-3, abs=1e-12)
    assert rates.computed == 0  # equal loops


def test_unequal_delays_measure_false_coning():
    hertz, amplitude = 20.0, 2e-3
    motion = angles(amplitude, amplitude, hertz, 0.0)
    step = Fraction(1, 1000)
    for late, ahead in ((np.array([1e-3, 0, 0]), 1), (np.array([0, 1e-3, 0]), -1), (np.full(3, 1e-3), 0)):
        rate = false_rate(motion, InstrumentErrors(gyro=TriadErrors(delay=late)), step, 2)[2]
        phase = ahead * 2 * math.pi * hertz * 1e-3
        formula = -math.pi * hertz * amplitude**2 * math.sin(phase)
        assert rate == pytest.approx(formula, rel=2e-3, abs=1e-9)


def test_equal_gyros_are_those_of_one_number():
    plain = of(choose("euler", "rk4", 2))
    with pytest.warns(DeprecationWarning, match="bandwidth_hz and damping is now a response"):
        one, two = through_gyro(plain, 80, "0.7"), through_gyros(plain, (80, "0.7"), (80, "0.7"))
    assert one.computed == two.computed == through_gyro(plain, "second-order:80:0.7").computed


@pytest.mark.parametrize(
    "words",
    [
        "butterworth:4:80",
        "bessel:5:60+decimation:2",
        "fir:0.5:0.3:0.2",
        "second-order:90:0.6+instants",
        "aa.csv",
    ],
)
def test_a_response_has_its_gain_at_a_high_sampling_rate(tmp_path, words):
    interval = 1e-3
    hertz = np.arange(0.0, 501.0, 5.0)
    size = np.abs(parse("gyro", "butterworth:2:120").gain(hertz))
    lines = [f"{f},{m},{0.008}" for f, m in zip(hertz, size, strict=True)]
    (tmp_path / "aa.csv").write_text("\n".join(["frequency_hz,magnitude,delay_s", *lines]) + "\n")
    response = parse("gyro", words, tmp_path)
    errors = InstrumentErrors(gyro=TriadErrors(response=response))
    for frequency in (4.0, 21.0):
        turn, time = 2 * np.pi * frequency, np.arange(8001) * interval
        put_in = np.diff(np.sin(turn * time))[:, None] * THREE
        unit = MeasurementUnit(errors, interval)
        seen = np.concatenate([unit(part)[0] for part in np.split(put_in, [700, 701, 3000])])[3000:]
        wave = np.exp(-1j * turn * time[3001:])
        gain = (seen[:, 1] @ wave) / (put_in[3000:, 1] @ wave)
        expected = response.at(Fraction(1000)).gain(frequency)
        # The rate is a staircase, whose error is (turn interval)^2/12, and that of a delay or an instant as large.
        assert abs(gain - expected) < (turn * interval) ** 2, frequency
