"""Mean rates under vibration as text, data and curves: what is missing left out, points those of one frequency."""

from __future__ import annotations

import re

import numpy as np
import pytest

from strapgen import catalogue
from strapgen.analysis import vibration
from strapgen.analysis.vibration import Rates, assessment, mean_rates
from strapgen.analysis.vibration.vibration_report import (
    AssessedCase,
    CaseRates,
    vibration_rates,
    vibration_text,
)
from strapgen.ir.exceptions import InputError
from strapgen.results.records import plain


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


RATES = Rates(1e-5, 2e-5, 1e-5)


def case(name: str, *rest: object, cycles: int | None = None, quantity: str = "drift") -> AssessedCase:
    return AssessedCase(assessment.of(catalogue.choose(name, *rest), quantity), cycles, 2)


@pytest.mark.parametrize("cycles", [None, 100])
@pytest.mark.parametrize("quadrature", [None, Rates(1e-9, 1e-9, 1e-9)])
def test_rates_stand_under_their_heads(cycles, quadrature):
    """The row of quadrature errors is labelled longer than a short kernel is called."""
    outcome = CaseRates(case("dcm", "rk1", 1, cycles=cycles), RATES, quadrature)
    blocks = vibration_text([outcome], "a title").split("\n\n")
    head, *rows = blocks[1].splitlines()
    ends = [match.end() for match in re.finditer(r"\S+, \S+", head)]
    assert len(ends) == 4
    assert len(rows) == (1 if quadrature is None else 2)
    for row, count in zip(rows, (4, 3), strict=False):
        assert [match.end() for match in re.finditer(r"\S+", row)][-count:] == ends[:count]


def test_data_has_both_quantities_of_an_algorithm_in_one_object():
    cases = [case("dcm", "rk1", 1, quantity=quantity) for quantity in ("drift", "sculling")]
    (data,) = map(plain, vibration_rates([CaseRates(one, RATES) for one in cases]))
    assert {"error_rad_s", "error_m_s2", "drift_closed_form", "sculling_closed_form"} <= set(data)
    (random,) = map(plain, vibration_rates([CaseRates(cases[0], RATES, RATES)]))
    assert "error_quadrature_rad_s" in random
    assert not any(name.endswith("closed_form") for name in random)


def test_report_for_readers_is_in_range():
    outcome = CaseRates(case("dcm", "rk1", 1), Rates(1e306, 2e306, 1e306))
    with pytest.raises(InputError, match=r"^dcm-rk1-1: the error in deg/h is beyond the range of double"):
        vibration_text([outcome], "a title")
