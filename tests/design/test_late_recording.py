"""The attitudes of a whole recording are those that samples commit one by one."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import strapgen
from strapgen.design.commit_late.commit_late import CommitLate
from strapgen.design.commit_late.late_recording import recording_attitudes
from strapgen.design.commit_late.late_unit import GapError
from strapgen.ir.exceptions import InputError, InputTypeError

#: Rounding of a few dozen steps, each of some hundred operations on numbers up to 1.
ROUNDING = 2e-14


def samples(count: int) -> np.ndarray:
    return strapgen.motion("random", rate_deg_s=200).samples(Fraction(1, 100), 0, count)


def one_by_one(row: np.ndarray, kinds: dict[int, int], algorithm: str = "euler") -> np.ndarray:
    unit = CommitLate("window-3-3", algorithm)
    attitudes = [unit.identity]
    for number, sample in enumerate(row):
        unit.push(sample, kinds.get(number, 0))
        attitudes += unit.committed
    unit.flush()
    return np.stack(attitudes + unit.committed)


@pytest.mark.parametrize("count", [0, 1, 3, 6, 7, 8, 12, 30])
@pytest.mark.parametrize("backend", ["numpy", "c"])
def test_recordings_of_any_length_are_covered_from_end_to_end(count, backend):
    row = samples(count)
    result = recording_attitudes("window-3-3", row, backend=backend)
    assert result.shape == (count + 1, 4)
    np.testing.assert_allclose(result, one_by_one(row, {}), rtol=0, atol=ROUNDING)


@pytest.mark.parametrize(
    "kinds", [{10: 1}, {8: 1, 17: 1, 26: 1}, {12: 1, 13: 2}, {38: 1}, {38: 1, 39: 2}, {39: 1}], ids=str
)
def test_lost_samples_are_restored_as_one_by_one(kinds):
    row = samples(40)
    for number, kind in kinds.items():
        row[number] = row[number] + row[number - 1] if kind == 2 else 1.0
    numbers = [kinds.get(number, 0) for number in range(40)]
    result = recording_attitudes("window-3-3", row, numbers, algorithm="dcm")
    np.testing.assert_allclose(result, one_by_one(row, kinds, "dcm"), rtol=0, atol=ROUNDING)


def test_it_begins_where_it_is_told():
    start = np.array([0.5, 0.5, -0.5, 0.5])
    result = recording_attitudes("window-3-3", samples(20), initial=start)
    turned = strapgen.evaluator("euler-product")(start, recording_attitudes("window-3-3", samples(20)))
    np.testing.assert_allclose(result, turned, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize(
    ("kinds", "reason"),
    [
        ({4: 1}, "sample 4: a sample is lost after 4"),
        ({10: 1, 18: 1}, "sample 18: a sample is lost 8 after"),
        ({10: 1, 12: 2}, "sample 12: the sum of two intervals"),
        ({9: 2}, "sample 9: the sum of two intervals"),
    ],
    ids=str,
)
def test_gaps_that_no_filter_restores_are_refused(kinds, reason):
    with pytest.raises(GapError, match=reason):
        recording_attitudes("window-3-3", samples(30), [kinds.get(number, 0) for number in range(30)])
    # The numbers are those that samples one by one refuse.
    with pytest.raises(GapError):
        one_by_one(samples(30), kinds)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"kinds": [0]}, "kinds has shape"),
        ({"kinds": [0.0] * 10}, "kinds has shape"),
        ({"kinds": [0] * 9 + [3]}, "kinds holds 3"),
        ({"backend": "exact"}, "backend 'exact'"),
        ({"algorithm": "cayley-klein"}, "algorithm 'cayley-klein'"),
        ({"initial": [1.0, 0.0]}, "initial"),
        ({"increments": np.zeros(3)}, "increments has shape"),
    ],
)
def test_what_does_not_fit_is_refused(options, reason):
    arguments = {"window": "window-3-3", "increments": samples(10)} | options
    with pytest.raises((InputError, InputTypeError), match=reason):
        recording_attitudes(**arguments)
