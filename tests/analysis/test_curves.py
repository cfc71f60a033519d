"""Curves against frequency: point by point the rates of one frequency."""

from __future__ import annotations

import numpy as np
import pytest

from strapgen import catalogue
from strapgen.analysis import vibration
from strapgen.analysis.vibration import mean_rates
from strapgen.ir.exceptions import InputError


@pytest.mark.parametrize(("name", "cycles"), [("euler", None), ("two-speed-fast-1", 5)])
@pytest.mark.parametrize("quantity", ["drift", "sculling"])
def test_curves_hold_rates(name, cycles, quantity):
    assessed = vibration.of(catalogue.choose(name), quantity)
    hertz = mean_rates.frequencies(0.01, 45, 5)
    given = {"theta_x": 0.01, "theta_y": 0.02, "phase": 0.4, "acceleration_y": 3, "cycles": cycles}
    found = mean_rates.curve(assessed, hertz, "0.02", **given)
    assert (found.label, found.unit) == (assessed.kernel, assessed.unit)
    for f, continuous, error in zip(hertz, found.continuous, found.error, strict=True):
        rates = assessed.rates(float(f), "0.02", **given)
        assert (continuous, error) == pytest.approx((rates.continuous, rates.error), rel=1e-9)


def test_frequencies_rise():
    assert np.allclose(mean_rates.frequencies(1, 8, 4), [1, 2, 4, 8])
    with pytest.raises(InputError, match="frequencies 2 to 1 Hz do not rise"):
        mean_rates.frequencies(2, 1)
    with pytest.raises(InputError, match="a number above 0 is needed"):
        mean_rates.frequencies(0, 1)


@pytest.mark.filterwarnings("error")
def test_a_curve_beyond_the_range_is_refused():
    hertz = mean_rates.frequencies(1, 50, 3)
    with pytest.raises(InputError, match="the rates of the curve are beyond the range of double"):
        mean_rates.curve(
            vibration.of(catalogue.choose("euler")), hertz, 1, theta_x=1e200, theta_y=1e200, phase=1
        )
