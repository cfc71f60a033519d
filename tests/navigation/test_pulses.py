"""Pulses with polarity and temperature: the numbers of the source's equations, and counts summed over many cycles."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

import strapgen
from strapgen import derive

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
def test_what_the_compensation_leaves_is_the_stated_property(positive):
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
