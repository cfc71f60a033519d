"""Mean rates under vibration as text and data: every rate under its head, what is missing left out."""

from __future__ import annotations

import re

import pytest

from strapgen import catalogue
from strapgen.analysis.vibration import Rates, assessment
from strapgen.analysis.vibration.vibration_report import (
    AssessedCase,
    CaseRates,
    vibration_rates,
    vibration_text,
)
from strapgen.ir.exceptions import InputError
from strapgen.results.records import plain

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


def test_what_a_person_reads_is_in_range():
    outcome = CaseRates(case("dcm", "rk1", 1), Rates(1e306, 2e306, 1e306))
    with pytest.raises(InputError, match=r"^dcm-rk1-1: the error in deg/h is beyond the range of double"):
        vibration_text([outcome], "a title")
