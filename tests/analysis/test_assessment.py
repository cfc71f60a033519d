"""Mean rates under vibration: Savage's closed forms, other derivations, and the kernels as they run."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import pairwise

import derived
import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import strapgen
from strapgen import catalogue, derive
from strapgen.analysis import vibration
from strapgen.analysis.vibration.mean_rates import D_Y, PARTS, PHI, THETA_X, THETA_Y
from strapgen.analysis.vibration.systems import T_L, T_M, F, T
from strapgen.catalogue.methods import coning_coefficients
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import Signal, after
from strapgen.kernel.kernel import KernelBuilder
from strapgen.lab.runs import attitude
from strapgen.navigation.two_speed.two_speed_runner import TwoSpeed
from strapgen.run import backends, exact
from strapgen.run.increments import windows

choose = catalogue.choose
#: Speeds of test: angles of the oscillation over the fast and the slow cycle.
A_L, A_M = 2 * sp.pi * F * T_L, 2 * sp.pi * F * T_M
CONING, SCULLING = -sp.pi * THETA_X * THETA_Y * sp.sin(PHI) * F, THETA_X * D_Y * sp.cos(PHI) / 2


def same(left, right):
    return sp.expand((left - right).rewrite(sp.exp)) == 0


# Savage's equations


def test_equations_66_67_75_and_76_follow_from_the_recursion_26():
    found = vibration.of(choose("coning-fast"))
    slow = sp.sin(A_M) / A_M
    fast = (1 + (1 - sp.cos(A_L)) / 3) * sp.sin(A_L) / A_L
    assert same(found.expression("continuous"), CONING * (1 - slow))
    assert same(found.expression("computed"), CONING * (fast - slow))
    assert same(found.expression("error"), CONING * (fast - 1))


@pytest.mark.parametrize("name", ["sculling-fast-2", "two-speed-fast-2"])
def test_equations_73_79_and_81_follow_from_the_recursion_56(name):
    found = vibration.of(choose(name), "sculling")
    fast, slow = sp.sin(A_L) / A_L, sp.sin(A_M) / A_M
    assert same(found.expression("continuous"), SCULLING * (1 - slow))
    assert same(found.expression("computed"), SCULLING * (fast - slow))
    assert same(found.expression("error"), SCULLING * (fast - 1))


@pytest.mark.long
def test_equation_80_follows_from_the_recursion_55():
    """S1 has half the mean of beta x u at the end of a slow cycle beside S2, in the algorithm as in truth."""
    first, second = (vibration.of(choose(f"sculling-fast-{form}"), "sculling") for form in (1, 2))
    beta = THETA_X * (sp.sin(2 * sp.pi * F * (T + T_M)) - sp.sin(2 * sp.pi * F * T))
    u = -D_Y / (2 * sp.pi * F) * (sp.cos(2 * sp.pi * F * (T + T_M) + PHI) - sp.cos(2 * sp.pi * F * T + PHI))
    waves = sp.Add.make_args(sp.expand((beta * u).rewrite(sp.exp)))
    assert all((wave / wave.subs(T, 0)).subs(T, T + 1 / F).equals(wave / wave.subs(T, 0)) for wave in waves)
    mean = sp.Add(*(wave for wave in waves if not wave.has(T))) / 2 / T_M  # a wave has no mean over a period
    for part in ("continuous", "computed"):
        added = first.expression(part) - second.expression(part)
        assert same(added, mean)
    assert first.error == second.error


def test_the_numbers_of_the_recursions():
    """Mean rates of f = 7 Hz, T_l = 0.01 s, T_m = 0.1 s, as running the recursions gave them to ten digits."""
    given = {"theta_x": "0.01", "phase": "0.9", "cycles": 10}
    drift = vibration.of(choose("coning-fast")).rates(7, "0.1", theta_y="0.013", **given)
    assert drift.computed == pytest.approx(-2.720926166e-3, abs=1e-12)
    sculling = vibration.of(choose("sculling-fast-2"), "sculling").rates(7, "0.1", acceleration_y=3, **given)
    assert sculling.computed == pytest.approx(1.1042645359e-2, abs=1e-12)


def test_both_loops_have_equations_75_and_79_and_the_term_in_the_slow_cycle():
    fast, slow = sp.sin(A_L) / A_L, sp.sin(A_M) / A_M
    coned, sculled = (vibration.two_speed(quantity) for quantity in ("drift", "sculling"))
    assert same(coned.expression("continuous"), CONING)
    assert same(sculled.expression("continuous"), SCULLING)
    of_75 = CONING * ((1 + (1 - sp.cos(A_L)) / 3) * fast - slow)
    assert same(coned.expression("computed"), of_75 + CONING * slow)
    assert same(sculled.expression("computed"), SCULLING * (fast - slow) + SCULLING * slow)
    assert sculled.forms("computed").keys() == {("angle_x", "velocity_y"), ("angle_y", "velocity_x")}
    with pytest.raises(InputError, match="quantity 'bias' is not known; allowed: drift, sculling"):
        vibration.two_speed("bias")


def test_a_step_of_first_order_from_rates_has_a_cotangent():
    """Steps turn by the rate at their start times T; half the cross product of all before with each of them adds up.

    The sum of z^k over k < l, with z = exp(j A), swings as z^l/(z - 1), and 1/(z - 1) is -(1 + j cot(A/2))/2.
    """
    angle = 2 * sp.pi * F * T
    computed = vibration.of(choose("euler", "rk1", rates=True)).expression("computed")
    assert same(computed * sp.sin(angle / 2), CONING * angle / 2 * sp.cos(angle / 2))


# Other derivations of the same


@pytest.mark.long
@pytest.mark.parametrize("form", coning_coefficients.FORMS)
@pytest.mark.parametrize(("samples", "previous"), [(1, 0), (1, 2), (2, 0), (3, 1), (5, 0)])
def test_coning_coefficients_leave_their_residual(form, samples, previous):
    """On a cone, both amplitudes alike and a quarter turn apart, the error is the closed form of the design."""
    found = vibration.of(choose("euler", f"coning-{form}", samples, previous=previous))
    alpha, omega, interval = sp.symbols("alpha omega T", positive=True)
    cone = {THETA_X: alpha, THETA_Y: alpha, PHI: -sp.pi / 2, F: omega / 2 / sp.pi, T: samples * interval}
    residual = sp.sympify(coning_coefficients.design(samples, previous, form).residual().expression)
    residual = residual.subs(dict(zip(sp.symbols("alpha omega T"), (alpha, omega, interval), strict=True)))
    assert sp.expand(found.expression("error").subs(cone, simultaneous=True) - residual) == 0


@pytest.mark.long
@pytest.mark.parametrize(
    "options",
    [("coning-compressed", 3), pytest.param(("coning-combined", 3, False, 1), marks=pytest.mark.long)],
)
def test_a_sculling_kernel_has_the_rate_of_its_dual(options):
    direct = vibration.of(choose("sculling", *options), "sculling")
    dual = vibration.of(choose("rotation-vector", *options), "sculling")
    step = vibration.of(choose("dcm", *options), "sculling")
    assert direct.computed == dual.computed == step.computed
    assert direct.continuous == dual.continuous
    assert direct.expression("continuous") == SCULLING
    # The whole change of velocity, by dual numbers, has the rate of the sum and its sculling term.
    whole = vibration.of(choose("velocity-position", *options), "sculling")
    assert same(whole.expression("computed"), direct.expression("computed"))
    assert same(whole.expression("error"), direct.expression("error"))


@pytest.mark.parametrize(
    "options",
    [
        ("rk4", 2),
        ("magnus6", None, True),
        *(pytest.param(more, marks=pytest.mark.long) for more in (("butcher6", 4), ("rk2", None, True))),
    ],
)
def test_the_representation_does_not_matter(options):
    first, *others = (vibration.of(choose(name, *options)) for name in ("euler", "dcm", "cayley-klein"))
    for other in others:
        assert sp.simplify(first.expression("computed") - other.expression("computed")) == 0


# As the kernels run


def oscillation(choice, frequency, step, steps, theta, phase, number=float, sine=math.sin, pi=math.pi):
    """Return what steps take of (65): samples of the angle, differentiated or subtracted."""
    count, previous = choice.increments, choice.previous
    width = step / count
    turn = 2 * pi * frequency
    rows = []
    for k in range(-previous, steps * count + 1):
        time = k * width
        rows.append(
            [number(theta[0]) * sine(turn * time), number(theta[1]) * sine(turn * time + phase), 0 * time]
        )
    increments = [[b - a for a, b in zip(x, y, strict=True)] for x, y in pairwise(rows)]
    return increments, count, previous


def simulated(choice, periods, steps, step, theta, phase):
    """Return the drift rate about z over steps that whole periods fit into."""
    frequency = periods / (steps * step)
    nodes = catalogue.nodes(choice)
    if nodes:
        at = (np.arange(steps)[:, None] + [float(node) for node in nodes]) * step
        turn = 2 * np.pi * frequency
        rates = [theta[0] * np.cos(turn * at), theta[1] * np.cos(turn * at + phase), 0 * at]
        samples = np.stack(rates, axis=-1) * turn * step
    else:
        rows, count, previous = oscillation(choice, frequency, step, steps, theta, phase)
        samples = windows(np.array(rows), count, previous)
    ready = backends.backend(choice)
    end = attitude(ready, ready.propagate(samples)[-1:])[0]
    return math.atan2(end[1, 0] - end[0, 1], end[0, 0] + end[1, 1]) / (steps * step)


ALGORITHMS = [
    ("euler", "rk1", 1),
    ("dcm", "rk2", 2),
    ("dcm", "rk4", 2),
    ("cayley-klein", "butcher6", 4),
    ("euler", "dormand-prince5", 3, False, 1),
    ("dcm", "taylor5", 3),
    ("euler", "magnus4", 2),
    ("euler", "munthe-kaas4", 3),
    ("dcm", "coning-compressed", 1, False, 2),
    ("euler", "coning-combined", 4),
    ("euler", "rk3", None, True),
    ("dcm", "magnus6", None, True),
    ("examples/modified_rodrigues.py", None, 2),
]


def named(options):
    if options[0].endswith(".py"):
        from test_documents import ROOT

        options = (str(ROOT / options[0]), *options[1:])
    return choose(*options)


@pytest.mark.long
@pytest.mark.parametrize(
    ("options", "periods", "phase"),
    [
        *(
            pytest.param(options, 2, 1.1, id=str(options), marks=[pytest.mark.long] if k % 2 else [])
            for k, options in enumerate(ALGORITHMS)
        ),
        *(
            pytest.param(options, 9, -2.4, id=f"fast {options}", marks=pytest.mark.long)
            for options in ALGORITHMS
        ),
    ],
)
def test_steps_drift_as_the_closed_form_says(options, periods, phase):
    """23 steps, 2 or 9 periods: what is left beside the second order falls by the square as the amplitude is halved."""
    choice = named(options)
    found = vibration.of(choice)
    step, steps = 0.02, 23
    off = []
    for theta in (4e-3, 2e-3):
        amplitudes = theta, 1.4 * theta
        rate = found.rates(
            Fraction(periods, steps) / Fraction("0.02"),
            "0.02",
            theta_x=amplitudes[0],
            theta_y=amplitudes[1],
            phase=phase,
        ).computed
        measured = simulated(choice, periods, steps, step, amplitudes, phase)
        off.append((abs(measured - rate) / theta**2, 1e-13 / theta**2))  # and what rounding may make
    assert off[0][0] < 0.03 * 2 * math.pi * periods / (steps * step)
    assert off[1][0] < off[0][0] / 3.5 + off[1][1]


@pytest.mark.long
@settings(max_examples=10, deadline=None)
@given(
    st.sampled_from(
        [("euler", "rk4", 2), ("dcm", "coning-uncompressed", 3), ("euler", "butcher5", 2, False, 1)]
    ),
    st.integers(1, 40).filter(lambda k: k % 29),
    st.floats(-math.pi, math.pi),
    st.floats(0.3, 3),
)
def test_any_frequency_and_phase(options, periods, phase, ratio):
    """29 steps and up to 40 periods, beyond half the sampling frequency too."""
    choice = choose(*options)
    theta = 1e-3
    rate = (
        vibration.of(choice)
        .rates(Fraction(50 * periods, 29), "0.02", theta_x=theta, theta_y=ratio * theta, phase=phase)
        .computed
    )
    measured = simulated(choice, periods, 29, 0.02, (theta, ratio * theta), phase)
    scale = theta**2 * (1 + ratio) ** 2 * 50  # rad/s of the second order
    assert abs(measured - rate) < scale * (100 * theta**2 * (1 + ratio) ** 2 + 1e-9)


@pytest.mark.parametrize(
    "options",
    [("euler", "coning-combined", 4), pytest.param(("dcm", "coning-combined", 4), marks=pytest.mark.long)],
)
def test_errors_far_below_double_are_those_of_many_digits(options):
    """In forty digits, amplitudes so small that nothing but the second order is left."""
    choice = choose(*options)
    theta, steps, periods = mpmath.mpf("1e-9"), 11, 2
    step = mpmath.mpf("0.02")
    rates = vibration.of(choice).rates(
        Fraction(periods, steps) / Fraction("0.02"), "0.02", theta_x="1e-9", theta_y="1e-9", phase="1.3"
    )
    with mpmath.workdps(exact.DIGITS):
        frequency = periods / (steps * step)
        rows, count, _ = oscillation(
            choice,
            frequency,
            step,
            steps,
            (theta, theta),
            mpmath.mpf("1.3"),
            mpmath.mpf,
            mpmath.sin,
            mpmath.pi,
        )
        samples = [[x for row in rows[k : k + count] for x in row] for k in range(0, len(rows), count)]
        program = derived.program(choice)
        begun = [exact.number(value) for value in program.attitude_step.identity]
        end = exact.states(program, samples, begun)[-1]
        angle = end[3] - end[1] if len(end) == 9 else 4 * end[2]
        measured = angle / 2 / (steps * step)
        true = -mpmath.pi * frequency * theta**2 * mpmath.sin(mpmath.mpf("1.3"))
        assert abs(measured - true - mpmath.mpf(rates.error)) < 1e-6 * abs(rates.error)
    assert abs(rates.error) < 1e-6 * abs(rates.continuous)


def test_the_recursions_sum_as_the_closed_form_says():
    """Running both fast loops in one: every slow cycle gives the same, here beyond half the sampling frequency."""
    loop = strapgen.evaluator("two-speed-fast-2")
    recursion = derive("two-speed-fast-2").recursion
    names = [signal.name for signal in loop.function.inputs]
    outputs = [signal.name for signal in loop.function.outputs]
    frequency, fast, cycles, phase = 61.0, 0.01, 7, 0.7
    grid = 2 * np.pi * frequency * fast * np.arange(-1, 4 * cycles + 1)
    x, y = np.diff(2e-3 * np.sin(grid)), np.diff(3e-3 * np.sin(grid + phase))
    v = np.diff(-5.0 / (2 * np.pi * frequency) * np.cos(grid + phase))
    state = {name: np.zeros(3) for name, _ in recursion.states}
    state["previous_increment"] = np.array([x[0], y[0], 0])
    ends = []
    for k in range(4 * cycles):
        if k % cycles == 0:
            state |= {name: np.zeros(3) for name in recursion.reset}
        now = state | {
            "increment": np.array([x[k + 1], y[k + 1], 0]),
            "velocity_increment": np.array([0, v[k + 1], 0]),
        }
        made = dict(zip(outputs, loop(*(now[name] for name in names)), strict=True))
        state |= {recursion.inputs[name]: value for name, value in made.items()}
        if k % cycles == cycles - 1:
            ends.append([state["coning"][2], state["sculling"][2]])
    given = {"theta_x": "0.002", "phase": "0.7", "cycles": cycles}
    choice = choose("two-speed-fast-2")
    drift = vibration.of(choice).rates(61, "0.07", theta_y="0.003", **given)
    sculling = vibration.of(choice, "sculling").rates(61, "0.07", acceleration_y=5, **given)
    wanted = np.array([drift.computed, sculling.computed]) * fast * cycles
    assert np.all(np.abs(np.array(ends) - wanted) < 1e-12 * np.abs(wanted).max() + 1e-17)


def test_all_loops_together_have_the_errors_of_the_recursions():
    """Attitude and velocity of an algorithm in two speeds: rates without T_m, and the errors of the fast loops."""
    frequency, fast, cycles, total, phase = 12.0, 0.01, 5, 15, 0.8
    amplitudes = 1e-3, 2e-3, 4.0
    grid = 2 * np.pi * frequency * fast * np.arange(-1, cycles * total + 1)
    zero = np.zeros(len(grid) - 1)
    x, y = np.diff(amplitudes[0] * np.sin(grid)), np.diff(amplitudes[1] * np.sin(grid + phase))
    v = np.diff(-amplitudes[2] / (2 * np.pi * frequency) * np.cos(grid + phase))
    increments, velocities = np.stack([x, y, zero], axis=-1), np.stack([zero, v, zero], axis=-1)
    run = TwoSpeed("dcm", sculling=2).run(
        increments[1:], velocities[1:], fast_cycles=cycles, slow_cycles=1, previous=increments[0]
    )
    duration = total * cycles * fast  # whole periods
    drift = (run.attitudes[-1][1, 0] - run.attitudes[-1][0, 1]) / 2 / duration
    growth = run.velocity_changes[:, 2].sum() / duration
    given = {"theta_x": amplitudes[0], "phase": phase, "cycles": cycles}
    coned = vibration.two_speed().rates(12, "0.05", theta_y=amplitudes[1], **given)
    sculled = vibration.two_speed("sculling").rates(12, "0.05", acceleration_y=amplitudes[2], **given)
    for measured, rates, alone in (
        (drift, coned, vibration.of(choose("coning-fast"))),
        (growth, sculled, vibration.of(choose("sculling-fast-2"), "sculling")),
    ):
        assert measured == pytest.approx(rates.computed, rel=1e-5)
        assert abs(rates.error) > 1e-3 * abs(rates.continuous)  # which is told from the true rate
        in_part = alone.rates(12, "0.05", theta_y=amplitudes[1], acceleration_y=amplitudes[2], **given)
        assert rates.error == pytest.approx(in_part.error, rel=1e-12)


@pytest.mark.long
def test_steps_gain_velocity_as_the_closed_form_says():
    """The sculling term of a step with its rotation compensation, turned by the attitude at its beginning."""
    options = ("coning-uncompressed", 3)
    frequency, step, steps, count, phase = 100 / 9, 0.03, 9, 3, 0.6
    grid = 2 * np.pi * frequency * step / count * np.arange(steps * count + 1)
    zero = np.zeros(steps * count)
    d = np.stack([np.diff(1e-3 * np.sin(grid)), zero, zero], axis=-1).reshape(steps, count, 3)
    v = np.diff(-4.0 / (2 * np.pi * frequency) * np.cos(grid + phase))
    v = np.stack([zero, v, zero], axis=-1).reshape(steps, count, 3)
    attitudes = strapgen.backend("dcm", *options).propagate(d)[:-1]
    terms = strapgen.evaluator(choose("sculling", *options))(d, v)
    gained = strapgen.evaluator("dcm-velocity-2")(attitudes, v.sum(axis=1), terms, d.sum(axis=1))
    measured = gained[:, 2].sum() / (step * steps)
    rates = vibration.of(choose("sculling", *options), "sculling").rates(
        Fraction(100, 9), "0.03", theta_x="0.001", acceleration_y=4, phase="0.6"
    )
    assert measured == pytest.approx(rates.computed, rel=1e-6)
    assert abs(rates.error) > 1e-4 * abs(rates.continuous)


# Kernels of a user


def own_loop(kept=True, weight=1, extra=None):
    """Return a fast loop: past x d and sums of increments, of a user."""
    build = KernelBuilder()
    beta, sums, past = (
        build.input(Signal.vector(name, name, unit="rad")) for name in ("angle", "correction", "before")
    )
    d = build.input(Signal.vector("increment", "d", unit="rad"))
    values = (beta + d, sums + (beta.cross(d)) / 2 + weight * past.cross(d) / 12, d)
    states = []
    for name, value in zip(("angle", "correction", "before"), values, strict=True):
        signal = after(Signal.vector(name, name, unit="rad"))
        build.output(signal, value if extra is None or name != "correction" else value + extra * beta)
        states.append((name, signal.name))
    return build.kernel(
        "own-loop", "Own", "none", recursion=Recursion(tuple(states), ("before",) if kept else ())
    )


def test_a_loop_of_a_user_is_the_recursion_26_again():
    assert vibration.drift(own_loop()).computed == vibration.of(choose("coning-fast")).computed
    plain = vibration.drift(own_loop(weight=0))
    assert same(plain.expression("error"), CONING * (sp.sin(A_L) / A_L - 1))


@pytest.mark.parametrize(
    ("kernel", "said"),
    [
        (own_loop(kept=False), "forgets what begins anew"),
        (own_loop(extra=1), "does not hand on what it sums|grows to first order|neither stay"),
        (derive("error-matrix"), "takes no samples of a vibration; allowed: dcm, euler"),
        (derive("coning-slow"), "takes no samples of a vibration; allowed: dcm, euler"),
        (derive("dcm-update"), "takes no samples of a vibration; allowed: dcm, euler"),
    ],
)
def test_kernels_without_assessment_are_refused(kernel, said):
    with pytest.raises(InputError, match=said):
        vibration.drift(kernel)


@pytest.mark.parametrize("thing", [None, 3, ("euler", "rk4", 2, 0)])
def test_other_objects_than_choices_and_kernels_are_refused(thing):
    with pytest.raises(InputTypeError, match="choose takes a name or a path or a Choice, not "):
        vibration.of(thing)
    for assess in (vibration.drift, vibration.sculling):
        with pytest.raises(InputTypeError, match=r"kernel is .*; a Kernel is"):
            assess(thing)


def test_quantities_that_a_kernel_does_not_have():
    with pytest.raises(InputError, match="kernel coning-fast takes no velocity increments"):
        vibration.of(choose("coning-fast"), "sculling")
    with pytest.raises(InputError, match="it has a sculling rate, not a drift"):
        vibration.of(choose("sculling"))
    with pytest.raises(InputError, match="has no states in rad that sum products"):
        vibration.of(choose("sculling-fast-1"))
    with pytest.raises(InputError, match="quantity 'bias' is not known"):
        vibration.of(choose("euler"), "bias")
    with pytest.raises(InputError, match="nodes; they must be given"):
        vibration.drift(derive("euler", rates=True))
    with pytest.raises(InputError, match="previous is 2; a whole number from 0 to 1"):
        vibration.drift(derive("rotation-vector", "magnus4", 2), previous=2)


# Numbers


def test_frequencies_of_which_every_step_sees_the_same():
    ordinary, adding = vibration.of(choose("euler", "rk1", 2)), vibration.of(choose("euler", "rk4", 2))
    assert ordinary.resonant and not adding.resonant
    with pytest.raises(InputError, match="no mean rate at 50 Hz"):
        ordinary.rates(50, "0.02", theta_x=1, theta_y=1, phase=1)
    rates = adding.rates(50, "0.02", theta_x=1, theta_y=1, phase=1)
    assert rates.computed == 0 and rates.error == -rates.continuous


@pytest.mark.long
def test_rates_and_factors_agree():
    """The factors, in double or where terms cancel in more digits, are those of the closed form."""
    for options in (("euler", "rk4", 2), ("dcm", "coning-combined", 5)):
        found = vibration.of(choose(*options))
        hertz = np.array([1e-3, 0.1, 3.0, 44.0])
        for part in PARTS:
            factors = found.factors(part, hertz, "0.02")["angle_x", "angle_y"]
            for f, factor in zip(hertz, factors, strict=True):
                one = getattr(found.rates(f, "0.02", theta_x="1", theta_y="2", phase="0.7"), part)
                amplitudes = 2 * np.exp(-0.7j)
                assert (factor * amplitudes).real == pytest.approx(one, rel=1e-10)


@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        ({"frequency_hz": 0}, "frequency-hz is 0; a number above 0"),
        ({"step": -1}, "step is -1"),
        ({"theta_x": "wide"}, "theta-x-rad is 'wide'"),
        ({"cycles": 3}, "takes no cycles"),
        ({"theta_x": 1e200, "theta_y": 1e200, "phase": 1}, "at 1 Hz are beyond the range of double"),
    ],
)
def test_numbers_that_are_refused(numbers, said):
    given = {"frequency_hz": 1, "step": 1, "theta_x": 1, **numbers}
    with pytest.raises(InputError, match=said):
        vibration.of(choose("euler")).rates(given.pop("frequency_hz"), given.pop("step"), **given)


def test_a_recursion_needs_its_cycles():
    with pytest.raises(InputError, match="the number of its fast cycles in a step is needed"):
        vibration.of(choose("coning-fast")).rates(1, 1, theta_x=1)
