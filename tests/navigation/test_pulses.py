"""Pulses with polarity and temperature: the numbers of the source's equations, and counts summed over many cycles."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from derived import quantized

import strapgen
from strapgen import derive
from strapgen.catalogue import Choice
from strapgen.ir.fixed_settings import Settings

T, K0A, VOS, DK1A, PLUS, MINUS = 0.01, 0.01962, 0.00981, 1e-3, -4e-4, 3e-4
COEFFICIENTS = (T, K0A, VOS, DK1A, PLUS, MINUS)
#: Acceleration, raw count, dK1, compensated increment, and what it misses.
RUNS = [
    (15.0, 0.150384318402, 5.996e-4, 0.149999941238, -5.8762e-8),
    (-15.0, -0.149900460451, 1.3003e-3, -0.150000127432, -1.27432e-7),
]
SYMBOLS = sp.symbols("count cycle bias offset scale_error scale_error_plus scale_error_minus", real=True)


@pytest.mark.parametrize(("acceleration", "raw", "dk1", "out", "miss"), RUNS)
def test_the_numbers(acceleration, raw, dk1, out, miss):
    count = float(strapgen.evaluator("pulse-errors")(acceleration * T, *COEFFICIENTS))
    compensated = float(strapgen.evaluator("pulse-compensate")(count, *COEFFICIENTS))
    assert abs(count - raw) <= 0.5e-12
    polar = PLUS if acceleration > 0 else MINUS
    assert abs((1 + DK1A) * (1 + polar) - 1 - dk1) < 1e-15
    assert abs(compensated - out) <= 0.5e-12
    assert abs(compensated - acceleration * T - miss) <= 0.5e-12
    # The property: K0VF is not divided by the scale factor.
    assert abs(miss + (1 + polar) * VOS * dk1 / (1 + dk1) * T) < 1e-12
    exact = float(strapgen.evaluator("pulse-compensate-exact")(count, *COEFFICIENTS))
    assert abs(exact - acceleration * T) <= 1e-15


@pytest.mark.long
@pytest.mark.parametrize("positive", [True, False])
def test_compensation_error_has_the_stated_size(positive):
    count, cycle, bias, offset, scale, plus, minus = SYMBOLS
    polar = plus if positive else minus
    increment = sp.Symbol("increment", real=True)
    measured = (1 + polar) * ((1 + scale) * (bias * cycle + increment) + offset * cycle)  # (4), (5)
    dk1 = (1 + scale) * (1 + polar) - 1  # (9)
    for name, expected in (
        ("pulse-compensate", -(1 + polar) * offset * dk1 / (1 + dk1) * cycle),
        ("pulse-compensate-exact", 0),
    ):
        (output,) = derive(name).expand()["compensated"]
        branch = output.replace(sp.Piecewise, lambda *pairs: pairs[0 if positive else 1][0])
        assert sp.simplify(branch.subs(count, measured) - increment - expected) == 0


@pytest.mark.parametrize("positive", [True, False])
def test_the_errors_are_those_of_the_sensor(positive):
    _, cycle, bias, offset, scale, plus, minus = SYMBOLS
    increment = sp.Symbol("increment", real=True)
    voltage = (1 + scale) * (bias * cycle + increment) + offset * cycle
    (count,) = derive("pulse-errors").expand()["count"]
    branch = count.replace(sp.Max, lambda *arguments: voltage if positive else sp.S.Zero)
    assert sp.expand(branch - (1 + (plus if positive else minus)) * voltage) == 0


def test_a_gyro_has_no_offset_and_its_compensation_is_exact(rng):
    errors, compensate = (strapgen.evaluator(f"gyro-pulse-{what}") for what in ("errors", "compensate"))
    assert "offset" not in [signal.name for signal in derive("gyro-pulse-compensate").inputs]
    for increment in rng.uniform(-0.3, 0.3, size=50):
        count = errors(increment, T, 1e-3, DK1A, PLUS, MINUS)
        assert abs(compensate(float(count), T, 1e-3, DK1A, PLUS, MINUS) - increment) < 1e-15


@pytest.mark.parametrize(("difference", "slope"), [(10.0, 2e-5), (-10.0, -3e-5), (0.0, 2e-5)])
def test_the_slope_follows_the_sign_of_the_difference(difference, slope, backend_name):
    coefficient = strapgen.evaluator("temperature-coefficient", backend_name)
    result = float(coefficient(0.1, 2e-5, -3e-5, difference))
    tolerance = 1e-15 if coefficient.dtype == np.float64 else 1e-8
    if hasattr(coefficient, "interface"):
        units = [float(argument.unit) / 2 for argument in coefficient.interface.inputs]
        errors = coefficient.interface.outputs[0].errors
        tolerance = float(max(errors)) + units[0] + 10 * units[1] + 10 * units[2] + 3e-5 * units[3]
    assert abs(result - (0.1 + slope * difference)) <= tolerance


@pytest.mark.long
def test_counts_of_a_sensor_integrated_in_numpy_are_compensated_over_many_cycles():
    # Whole counts of 1 cm/s; the count is the change of a register, so that what is left of a quantum stays in it.
    quantum, cycles = 0.01, 2000
    times = T * np.arange(cycles + 1)
    velocity = 8 * np.sin(2 * times)  # m/s; its derivative is the acceleration, of both signs
    acceleration = np.diff(velocity) / T
    voltage = (1 + DK1A) * (K0A + acceleration) + VOS
    frequency = np.where(voltage >= 0, 1 + PLUS, 1 + MINUS) * voltage
    register = np.floor(np.cumsum(frequency * T) / quantum) * quantum
    raw = np.diff(register, prepend=0)
    compensate = strapgen.evaluator("pulse-compensate-exact")
    summed = sum(float(compensate(float(count), *COEFFICIENTS)) for count in raw)
    assert abs(register[-1] - velocity[-1]) > 0.2, "without compensation the bias is seen"
    # A quantum; a quantum at each of the 13 changes of sign, with the difference of the scale factors; and cycles
    # without a count, whose offset is scaled by that of +: less than 1e-3 of the offset over all cycles.
    assert abs(summed - velocity[-1]) <= quantum * (1 + 2 * 13 * 7e-4) + 1e-3 * VOS * T * cycles


GAIN, TAU = -2.6e-4, 150.0
GAINS = np.full(3, GAIN)
RATE = np.radians(100) / np.sqrt(2)  # rad/s about each torquer axis, 100 deg/s in all
#: Seconds of rate and of rest, and the deviation of the scale factor.
PROTOCOL = [(150, 0, -5.00643e-4), (360, 0, -7.20156e-4), (360, 540, -1.96773e-5)]


def deviation_after(moving, resting, step=1.0):
    """Return the deviation after seconds of rate and of rest, by the kernel in double."""
    kernel = strapgen.evaluator("scale-factor-heating")
    u, decay = np.zeros(3), -np.expm1(-step / TAU)
    for rate, seconds in ((RATE, moving), (0.0, resting)):
        for _ in range(round(seconds / step)):
            u, _ = kernel(u, np.full(6, rate * step), decay, GAINS, 1 / step)
    assert u[0] == u[1] == u[2]
    return float(u[0])


@pytest.mark.long
@pytest.mark.parametrize(("moving", "resting", "printed"), PROTOCOL)
def test_the_deviation_is_that_of_the_protocol(moving, resting, printed):
    half_a_digit = 0.5 * 10.0 ** (np.floor(np.log10(-printed)) - 5)
    assert abs(deviation_after(moving, resting) - printed) <= half_a_digit


@pytest.mark.long
def test_the_steady_deviation_and_its_share_after_a_time_constant():
    steady = GAIN * np.radians(100) ** 2
    assert abs(steady - -7.92005e-4) <= 0.5e-9
    assert abs(deviation_after(150, 0) / steady - 0.632) <= 0.0005
    assert abs(deviation_after(360, 540) / deviation_after(360, 0) - 0.0273) <= 0.00005


def test_a_cycle_at_93_hz_decays_by_the_stated_share():
    assert abs(-np.expm1(-1 / 93 / TAU) - 7.2e-5) <= 0.05e-5


@pytest.mark.long
def test_the_recursion_is_the_differential_equation_for_a_rate_held_over_a_cycle():
    u, w, k, tau, T = sp.symbols("u w k tau T", positive=True)
    time = sp.Symbol("t", positive=True)
    function = sp.Function("u")
    solution = sp.dsolve(function(time) + tau * function(time).diff(time) - k * w**2, ics={function(0): u})
    torques = dict.fromkeys(("M_x1", "M_y2", "M_y3", "M_x3"), sp.S.Zero) | {"M_y1": w * T, "M_x2": w * T}
    values = {"u_1": u, "u_2": u, "u_3": u, "k_1": k, "k_2": k, "k_3": k, "cycle_rate": 1 / T} | torques
    outputs = derive("scale-factor-heating").expand(values | {"decay": 1 - sp.exp(-T / tau)})
    assert sp.simplify(outputs["next_deviation"][0] - solution.rhs.subs(time, T)) == 0
    assert sp.simplify(outputs["next_deviation"][1] - outputs["next_deviation"][0]) == 0
    assert sp.simplify(outputs["next_deviation"][2] - u * sp.exp(-T / tau)) == 0
    assert outputs["compensated_torque_increment"] == [0, (1 + u) * w * T, (1 + u) * w * T, 0, 0, 0]


def test_the_errors_are_undone(rng):
    names = "torquer-heating-errors", "scale-factor-heating"
    first, second = map(strapgen.evaluator, names)
    u = v = np.zeros(3)
    for increment in rng.uniform(-0.03, 0.03, size=(200, 6)):
        u, indicated = first(u, increment, 0.01, GAINS, 100.0)
        v, compensated = second(v, indicated, 0.01, GAINS, 100.0)
        np.testing.assert_allclose(compensated, increment, rtol=0, atol=1e-16)
    assert np.all(u != 0) and np.abs(u - v).max() < 1e-18


# In fixed point, at the printed 93 Hz


def run_in_fixed_point(name, carry, moving, resting):
    """Return the deviations after cycles of rate and of rest at 93 Hz, the exact one beside, and the evaluator."""
    step = 1 / 93
    settings = Settings(word=int(name.removeprefix("c-fixed")), carry=carry)
    evaluator = strapgen.evaluator("scale-factor-heating", name, settings)
    values = (np.zeros(3), np.full(6, RATE * step), -np.expm1(-step / TAU), GAINS, 93.0)
    inputs = [
        evaluator.integers(argument, np.asarray(value, float)).reshape(1, -1)
        for argument, value in zip(evaluator.interface.inputs, values, strict=True)
    ]
    d, decay, gain, rate = (
        float(evaluator.numbers(a, array).ravel()[0])
        for a, array in zip(evaluator.interface.inputs[1:], inputs[1:], strict=True)
    )
    cycle, (deviation, torques), after = looped(evaluator, inputs)
    exact = 0.0
    for turning, cycles in ((1, moving), (0, resting)):
        torques *= turning
        for _ in range(cycles):
            cycle()
            deviation[:] = after
            exact += decay * (turning * gain * 2 * (d * rate) ** 2 - exact)
    result = float(evaluator.numbers(evaluator.interface.outputs[0], after).ravel()[0])
    return result, exact, evaluator


def looped(evaluator, inputs):
    """Return a call of the C function on arrays that stay where they are, its first two inputs, and its first output.

    `Evaluator.run` takes ten times as long as the function itself, which counts in a run of 84,000 cycles.
    """
    words = [array.astype(kind) for array, kind in zip(inputs, evaluator.input_types, strict=True)]
    feedback = np.array(evaluator.fresh(1), evaluator.feedback_type)
    outputs = [np.empty((1, a.signal.size), evaluator.word_type) for a in evaluator.interface.outputs]
    arrays = [*words, *([feedback] if evaluator.interface.residuals else []), *outputs]
    status, pointers = evaluator.module.ffi.new("int *"), [*map(evaluator.pointer, arrays)]
    function = getattr(evaluator.module.lib, f"{evaluator.function.name}_array")

    def cycle():
        function(1, status, *pointers)
        assert not status[0]

    return cycle, words[:2], outputs[0]


def allowed(evaluator, carry):
    """Return by how much a run may be off: what a call adds, over what decays in a cycle.

    With error feedback the rounding of the state enters with its change, two units in all, and what the deviation tends
    to with its certified error.
    """
    interface = evaluator.interface
    if carry == "none":
        return float(max(interface.outputs[0].errors)) / -np.expm1(-1 / 93 / TAU)
    body = quantized(Choice("scale-factor-heating"), interface.settings).body
    (factor,) = [value for value in body if value.name == "next_u_1_factor"]
    return float(factor.error + 2 * interface.outputs[0].unit)


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "carry"), [("c-fixed32", "none"), ("c-fixed32", "state"), ("c-fixed16", "state")]
)
def test_a_run_at_93_hz_follows_the_recursion(name, carry):
    result, exact, evaluator = run_in_fixed_point(name, carry, 1500, 500)
    assert exact < -7e-5
    assert abs(result - exact) <= allowed(evaluator, carry)


def test_16_bits_never_move_without_error_feedback():
    # A cycle adds 5.7e-8; half a unit of the deviation is 1.2e-7.
    result, exact, evaluator = run_in_fixed_point("c-fixed16", "none", 1500, 0)
    assert result == 0 and exact < -8e-5
    unit = float(evaluator.interface.outputs[0].format.unit)
    assert -np.expm1(-1 / 93 / TAU) * 7.92005e-4 < unit / 2
    assert abs(exact) <= allowed(evaluator, "none"), "its bound says so"


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "carry", "digits"),
    [("c-fixed32", "none", 2e-10), ("c-fixed32", "state", 1e-10), ("c-fixed16", "state", 1e-5)],
)
@pytest.mark.parametrize(("moving", "resting", "printed"), PROTOCOL)
def test_the_protocol_at_93_hz(name, carry, digits, moving, resting, printed):
    result, exact, evaluator = run_in_fixed_point(name, carry, 93 * moving, 93 * resting)
    assert abs(result - exact) <= allowed(evaluator, carry)
    # Beside the rounding of the run: half a digit of the printed value and what the inputs' formats leave.
    assert abs(result - printed) <= digits + 0.5e-9
