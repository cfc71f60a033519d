"""The loops of an attitude and heading reference: gains, kernels, schedule, and a system at rest."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

import strapgen
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.navigation.loops import loop_gains
from strapgen.navigation.loops.loop_gains import (
    ORDERS,
    R,
    T,
    check_stable,
    closed_loop,
    g,
    gains,
    poles_of_a_cycle,
    s,
    symbolic_gains,
    tau,
    z,
)
from strapgen.navigation.loops.loop_kernels import level_loop
from strapgen.navigation.loops.loop_schedule import BUILT_IN, read
from strapgen.navigation.loops.loops_study import RestingSensors, run_modes, tilt

LOOPS = [(name, order) for name, orders in ORDERS.items() for order in orders]


def steady(name, order=None):
    """Return the states that a step of each input leads to, in which nothing changes, as {state: {input: value}}."""
    loop = closed_loop(name, order)
    known = dict(zip(loop.gains, symbolic_gains(name, order), strict=True))
    states = (-loop.continuous.subs(known)).LUsolve(loop.disturbance.subs(known))
    return {
        state: {driver: sp.simplify(states[row, column]) for column, driver in enumerate(loop.inputs)}
        for row, state in enumerate(loop.states)
    }


@pytest.mark.parametrize(("name", "order"), LOOPS)
def test_all_poles_lie_at_the_time_constant(name, order):
    loop = closed_loop(name, order)
    matrix = loop.continuous.subs(dict(zip(loop.gains, symbolic_gains(name, order), strict=True)))
    assert sp.simplify(matrix.charpoly(s).as_expr() - (s + 1 / tau) ** order) == 0


def test_steady_states_are_those_of_the_source():
    level, heading, vertical, erection = map(steady, ("level", "heading", "vertical", "erection"))
    assert level["V"] == {"drift": 0, "force": 0, "Vr": 1}  # (1)
    assert level["phi"] == {"drift": 0, "force": -1 / g, "Vr": 0}  # (2)
    assert level["B"] == {"drift": 1, "force": 0, "Vr": -1 / R}  # (3)
    assert heading["psi"] == {"drift": 0, "psi_m": 1}  # (4)
    assert heading["B"] == {"drift": 1, "psi_m": 0}  # (5)
    assert vertical["V"] == {"force": 0, "hr": 0}  # (6)
    assert vertical["h"] == {"force": 0, "hr": 1}  # (7)
    assert vertical["B"] == {"force": 1, "hr": 2 * g / R}  # (8)
    assert erection["phi"] == {"drift": 2 * tau, "force": -1 / g}
    assert erection["V"] == {"drift": g * tau**2, "force": 0}


def test_gains_are_those_of_the_source():
    printed = {
        ("level", 5): (0.6, 0.0122322590, 8.15494394e-4),
        ("level", 30): (0.1, 3.39632428e-4, 3.77543701e-6),
        ("level", 240): (0.0125, 5.15230587e-6, 7.37390040e-9),
        ("heading", 40): (0.05, 6.25e-4),
        ("vertical", 50): (0.06, 1.20307843e-3, 8e-6),
    }
    for (name, seconds), numbers in printed.items():
        exact = gains(name, Fraction(seconds))
        assert all(isinstance(value, Fraction) for value in exact)
        for value, number in zip(exact, numbers, strict=True):
            # A unit in the last of nine digits.
            assert abs(value - number) <= 10.0 ** (math.floor(math.log10(number)) - 8), (name, seconds)
    assert gains("level", Fraction(15), 2)[2] == 0


@pytest.mark.parametrize(("name", "order"), LOOPS)
def test_a_cycle_leaves_the_steady_state_as_it_is(name, order):
    loop = closed_loop(name, order)
    held = loop.continuous.LUsolve(loop.disturbance)
    moved = (loop.cycle - sp.eye(order)) * held - loop.cycle_disturbance
    assert moved.applyfunc(sp.simplify) == sp.zeros(*moved.shape)


@pytest.mark.parametrize("name", ["heading", "vertical"])
def test_forward_euler_moves_every_pole_to_the_same_place(name):
    loop = closed_loop(name)
    euler = sp.eye(len(loop.states)) + T * loop.continuous
    assert (loop.cycle - euler).expand() == sp.zeros(*euler.shape)
    poles = poles_of_a_cycle(name, gains(name, Fraction(40)), Fraction(1, 100))
    assert {round(abs(pole), 14) for pole in poles} == {1 - 0.01 / 40}


def test_between_the_calls_the_tilt_splits_the_poles_of_levelling():
    # What the tilt adds is of first order in T/tau, which moves three poles that coincide by its cube root.
    for seconds in (5, 30, 240):
        ratio = 0.01 / seconds
        poles = poles_of_a_cycle("level", gains("level", Fraction(seconds)), Fraction(1, 100))
        moved = [abs((pole - 1) / ratio + 1) for pole in poles]
        assert 0.5 * ratio ** (1 / 3) < max(moved) < 1.5 * ratio ** (1 / 3)
        assert abs(poles[0]) < 1


@pytest.mark.parametrize(
    ("name", "order", "limit"),
    [("level", 3, "2/3"), ("erection", 2, "1"), ("heading", 2, "2"), ("vertical", 3, "2")],
)
def test_the_longest_stable_cycle_is_a_part_of_the_time_constant(name, order, limit):
    loop = closed_loop(name, order)
    known = dict(zip(loop.gains, symbolic_gains(name, order), strict=True))
    matrix = loop.cycle.subs(known).subs(T, sp.Rational(limit) * tau)
    assert sp.simplify(matrix.charpoly(z).as_expr().subs(z, -1)) == 0
    for part, stable in ((0.999, True), (1.001, False)):
        values = gains(name, Fraction(10), order)
        poles = poles_of_a_cycle(name, values, Fraction(part) * 10 * Fraction(limit))
        assert (abs(poles[0]) < 1) == stable


@pytest.mark.parametrize(("seconds", "cycle"), [(Fraction(10**6), "1e-5"), (Fraction(1, 1000), "1e3")])
def test_poles_of_the_shortest_and_of_the_longest_cycle(seconds, cycle):
    for name, order in LOOPS:
        poles = poles_of_a_cycle(name, gains(name, seconds, order), Fraction(cycle))
        assert len(poles) == order
        assert (abs(poles[0]) < 1) == (seconds > 1), name


def test_both_channels_of_levelling_have_the_same_poles_and_one_with_signs_of_the_other_is_unstable():
    kernel = level_loop()
    states = V, phi, B = sp.symbols("V phi B")
    names = [name for signal in kernel.inputs for name in signal.elements]

    def polynomial(velocity, turned):
        zero = dict.fromkeys(names, sp.S.Zero) | {k: sp.Symbol(k) for k in ("k1", "k2", "k3")}
        place, other = "xy".index(velocity), "yx"["xy".index(velocity)]
        known = zero | {"curvature": 1 / R, f"V_{velocity}": V, f"B_{other}": B}
        later = kernel.expand(known | {"cycle": T, f"change_{velocity}": turned * T * g * phi})
        rate = kernel.expand(known)["level_rate"][1 - place]
        changes = sp.Matrix(
            [later["next_level_velocity"][place], phi - T * rate, later["next_level_bias"][1 - place]]
        )
        return sp.expand(changes.diff(T).subs(T, 0).jacobian(states).charpoly(s).as_expr())

    # The specific force is g phi_x along y, and -g phi_y along x.
    assert polynomial("y", 1) == polynomial("x", -1)
    wrong = sp.Poly(polynomial("x", 1), s).all_coeffs()
    assert any(sp.simplify(c.subs({sp.Symbol(k): 1 for k in ("k1", "k2", "k3")})).is_negative for c in wrong)


def test_a_cycle_that_is_too_long_is_refused_in_one_line():
    values = gains("level", Fraction(5))
    check_stable("level", values, Fraction(3))
    with pytest.raises(
        InputError, match=r"^the level loop with gains 0.6, .* and a cycle of 4 s is unstable"
    ):
        check_stable("level", values, Fraction(4))
    k1, k2, k3 = values
    with pytest.raises(InputError, match=r"is unstable: a pole has magnitude 1\.0"):
        check_stable("level", (k1, k2, -k3), Fraction(1, 100))
    with pytest.raises(InputError, match="the erection loop has order 3; 2 is possible"):
        loop_gains.closed_loop("erection", 3)


def test_a_frame_that_is_commanded_turns_the_other_way_in_body_axes():
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])  # x of the body along y of the frame
    rate, corrected = strapgen.evaluator("body-feedback")([0.1, 0, 0], turn, [0.02, 0], 0.01, 0.5)
    np.testing.assert_allclose(rate, [0, 0.02, -0.01])
    np.testing.assert_allclose(corrected, [0.1, 0.01, -0.005])
    assert strapgen.evaluator("heading-from-dcm")(turn) == np.pi / 2


def test_a_heading_error_over_the_half_turn_is_the_short_way():
    bias, rate = strapgen.evaluator("heading-loop")(3.0, -3.0, 0.0, 0.5, 0.125, 0.01)
    short = 6 - 2 * np.pi
    np.testing.assert_allclose([bias, rate], [0.01 * 0.125 * short, 0.5 * short], rtol=1e-12)


def test_attitude_mode_is_levelling_without_bias_and_curvature():
    level, erect = strapgen.evaluator("level-loop"), strapgen.evaluator("erection")
    V, change = np.array([0.3, -0.7]), np.array([0.01, 0.02, -0.1])
    velocity, bias, rate = level(V, np.zeros(2), change, np.zeros(2), 0.0, 0.6, 0.01, 0.0, 0.01)
    np.testing.assert_array_equal(bias, 0)
    for one, other in zip((velocity, rate), erect(V, change, 0.6, 0.01, 0.01), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-15)


SCHEDULE = read()


def test_the_schedule_of_1984():
    taus = [[float(loop.time_constant_s) for loop in mode.loops] for mode in SCHEDULE.sequence]
    assert taus == [[5, 40, 30], [30, 40, 30], [240, 200, 50]]
    assert [mode.duration_s for mode in SCHEDULE.sequence] == [30, 150, None]
    assert sum(mode.duration_s for mode in SCHEDULE.timed(Fraction(0))) == 180
    assert [float(mode.duration_s) for mode in SCHEDULE.timed(Fraction(7))][-1] == 7


def test_modes_follow_time_air_data_and_the_crew():
    def name(*arguments, **options):
        return SCHEDULE.mode(*map(Fraction, arguments), **options).name

    assert [name(t) for t in (0, 29, 30, 179, 180, 9999)] == [
        "fast",
        "fast",
        "fine",
        "fine",
        "normal",
        "normal",
    ]
    assert [name(1000, lost) for lost in (300, 301)] == ["normal", "basic"]
    assert name(10, 301) == "fast"
    assert name(1000, selected="attitude") == "attitude"
    with pytest.raises(InputError, match="selected mode 'basic'"):
        name(0, selected="basic")


def test_cut_out_and_hysteresis_are_arguments():
    normal, gyro = SCHEDULE.sequence[-1], SCHEDULE.mode(Fraction(0), selected="directional-gyro")
    assert [SCHEDULE.heading_is_open(normal, rate) for rate in (0.4, -0.6)] == [False, True]
    assert SCHEDULE.heading_is_open(gyro, 0.0)
    engaged, course = False, []
    for knots in (90, 105, 111, 105, 101, 99, 105):
        engaged = SCHEDULE.air_data_engaged(engaged, knots * 1852 / 3600)
        course.append(engaged)
    assert course == [False, False, True, True, True, False, False]


CHANGES = {
    "missing cycle": (
        "cycle_s = 0.01\n",
        "",
        "cycle_s is missing; a number from 1e-05 to 1000 in s is needed",
    ),
    "unknown key": ("cycle_s", "cycle_ms", "key 'cycle_ms'"),
    "zero": ("cycle_s = 0.01", "cycle_s = 0", "cycle_s is 0"),
    "reference": ('reference = "zero"', 'reference = "gps"', "mode[fast].level.reference 'gps'"),
    "open": (
        "heading = { tau_s = 40 }",
        'heading = { tau_s = 40, reference = "open" }',
        "the heading loop is open",
    ),
    "no loop": ("heading = { tau_s = 40 }\n", "", "mode[fast].heading is missing; a table with tau_s"),
    "two levels": (
        "duration_s = 30\n",
        "duration_s = 30\nerection = { tau_s = 3 }\n",
        "either level or erection",
    ),
    "endless": ("duration_s = 30\n", "", "mode fast has no duration_s; only the last"),
    "twice": ('"fine"', '"fast"', "two modes of the schedule have the same name"),
    "order": ("tau_s = 5,", "tau_s = 5, order = 4,", "mode[fast].level.order is 4; 2 or 3 is needed"),
    "hysteresis": ('off_m_s = "463/9"', "off_m_s = 60", "air_data_off_m_s is 60; at most"),
    "slow": (
        "tau_s = 5,",
        "tau_s = 1e7,",
        "level.tau_s is 1e+7; a number from 0.001 to 1000000 in s is needed",
    ),
    "text": (
        "duration_s = 30",
        "duration_s = true",
        "mode[fast].duration_s is true; a number above 0 in s is needed",
    ),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_file_is_refused_in_one_line(name, tmp_path):
    old, new, reason = CHANGES[name]
    text = BUILT_IN.read_text("utf-8")
    assert old in text
    (tmp_path / "s.toml").write_text(text.replace(old, new, 1), "utf-8")
    with pytest.raises(InputError) as error:
        read(tmp_path / "s.toml")
    assert reason in str(error.value)
    assert "\n" not in str(error.value)


EXAMPLE = Path(__file__).parents[2] / "examples" / "ahrs.toml"
RESTING = read()
FAST, FINE, NORMAL = RESTING.sequence
DEG_H = math.radians(1 / 3600)
#: Gyro biases of 8 and -5 deg/h, accelerometer biases of 200 and 300 micro-g.
SENSORS = RestingSensors(
    gyro_bias=(8 * DEG_H, -5 * DEG_H, 0.0), accelerometer_bias=(200e-6 * 9.81, 300e-6 * 9.81, 0.0)
)
TILT = (-3e-4, 2e-4)
RATE = (7.292115e-5 + 8 * DEG_H, -5 * DEG_H)


def runner(backend: str, carry: str = ""):
    system = strapgen.read_system(EXAMPLE)
    return strapgen.system_runner(system, backend, Settings(word=32, carry=carry) if carry else None)


@pytest.fixture(scope="module")
def in_c():
    return runner("c")


def apart(run) -> np.ndarray:
    """Return the largest errors of tilt in rad and of the bias in rad/s at the end of a run."""
    bias = run.values["level_level_bias"][-1] - RATE
    return np.array([np.abs(tilt(run.values["attitude_state"][-1])[:2] - TILT).max(), np.abs(bias).max()])


def test_the_level_frame_settles_on_the_accelerometers_and_the_bias_on_all_rates(in_c):
    (run,) = run_modes(in_c, RESTING, [(FAST, Fraction(150))], SENSORS)
    # After thirty time constants: 30**2/2 exp(-30) of the start, and tilts of second order.
    assert np.all(apart(run) <= (1e-9, 1e-8))
    assert abs(run.values["course_heading"][-1]) < 1e-6
    C = run.values["attitude_state"][-1].reshape(3, 3)
    # Drift of the rows since the last normalization, of third order in a cycle's increment.
    assert np.abs(C @ C.T - np.eye(3)).max() < 1e-12


def test_numpy_is_c_and_fixed_point_comes_close(in_c):
    parts = [(FAST, Fraction(1, 2)), (FINE, Fraction(1, 2))]
    double, c, fixed, model = (
        run_modes(one, RESTING, parts, SENSORS)[-1]
        for one in (runner("numpy"), in_c, runner("c-fixed32", "all"), runner("fixed-model", "all"))
    )
    for name, values in double.values.items():
        # Thousands of roundings of numbers up to 10.
        assert np.abs(c.values[name] - values).max() < 1e-12, name
        np.testing.assert_array_equal(fixed.values[name], model.values[name])
        limit = 1e-7 if name == "attitude_state" else 1e-4
        assert np.abs(fixed.values[name] - values).max() < limit, name


def test_a_change_of_mode_makes_no_jump(in_c):
    sensors = RestingSensors(
        gyro_bias=(8 * DEG_H, -5 * DEG_H, 3 * DEG_H),
        accelerometer_bias=(2e-3, 3e-3, 0.01),
        heading=0.01,
        height=20.0,
    )
    sequence = [(FAST, Fraction(30)), (FINE, Fraction(30)), (NORMAL, Fraction(5))]
    others = [(mode, Fraction(5)) for mode in RESTING.modes if mode.name in ("directional-gyro", "basic")]
    runs = run_modes(in_c, RESTING, [*sequence, *others], sensors)
    for before, behind in pairwise(runs):
        for name in ("attitude_state", "level_level_velocity", "vertical_height", "vertical_climb"):
            one, other = (np.asarray(run.values[name]) for run in (before, behind))
            # The step of a cycle in the second before or behind, which itself changes by a part of T/tau.
            ordinary = max(np.abs(np.diff(part, axis=0)).max() for part in (one[-100:], other[:100]))
            assert np.abs(other[0] - one[-1]).max() <= 1.01 * ordinary, name


@pytest.mark.long
def test_error_feedback_lets_slow_loops_settle(in_c):
    parts = [(FAST, Fraction(30)), (FINE, Fraction(150)), (NORMAL, Fraction(3600))]
    double, without, fed = (
        apart(run_modes(one, RESTING, parts, SENSORS)[-1])
        for one in (in_c, runner("c-fixed32", "none"), runner("c-fixed32", "all"))
    )
    # 3600 s are fifteen time constants.
    assert double[0] < 1e-8
    assert without[0] > 1e-5
    assert fed[0] < 2e-7
    assert fed[1] < without[1] / 10
