"""The attitudes of a whole recording are those that samples commit one by one, from the first to the last."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import strapgen
from strapgen.design.commit_late.commit_late import CommitLate
from strapgen.design.commit_late.late_recording import covers, propagate_whole, recording_attitudes
from strapgen.design.commit_late.late_unit import GapError
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.lab.recordings.recording import Recording, propagate
from strapgen.run.increments import pulses

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


@pytest.mark.parametrize(
    ("count", "backend"), [*((count, "numpy") for count in (0, 1, 3, 6, 7, 8, 12, 30)), (3, "c"), (12, "c")]
)
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


def test_run_begins_at_the_initial_state():
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
        ({"samples": np.zeros(3)}, "samples has shape"),
    ],
)
def test_incompatible_arguments_are_refused(options, reason):
    arguments = {"window": "window-3-3", "samples": samples(10)} | options
    with pytest.raises((InputError, InputTypeError), match=reason):
        recording_attitudes(**arguments)


ROW = strapgen.motion("random", rate_deg_s=200).samples(Fraction(1, 100), 0, 40)
CHOICE = strapgen.choose("euler", "window-3-3")


def test_the_history_begins_and_ends_with_the_recording_and_has_the_inside_of_the_steps():
    recording = Recording(5.0, 0.01, ROW)
    whole = propagate_whole(CHOICE, "c", recording)
    np.testing.assert_allclose(whole.time, 5 + 0.01 * np.arange(41), rtol=0, atol=1e-12)
    assert whole.unused == 0
    inside = propagate(strapgen.backend(CHOICE, backend="c"), recording)
    np.testing.assert_allclose(whole.time[3:-3], inside.time, rtol=0, atol=1e-12)
    # The steps inside begin at zero rotation; both turn alike.
    multiply = strapgen.evaluator("euler-product")
    turned = multiply(whole.states[3], inside.states)
    np.testing.assert_allclose(whole.states[3:-3], turned, rtol=0, atol=1e-14)


def test_records_are_thinned_and_pulses_counted():
    recording = Recording(0.0, 0.01, ROW)
    thinned = propagate_whole(CHOICE, "numpy", recording, record=0.1)
    assert thinned.time.tolist() == pytest.approx([0, 0.1, 0.2, 0.3, 0.4])
    np.testing.assert_array_equal(thinned.states, propagate_whole(CHOICE, "numpy", recording).states[::10])
    for interval in (0.01, 0.1):
        again = propagate_whole(CHOICE, "numpy", recording, orthonormalize=interval, record=0.1)
        np.testing.assert_array_equal(again.states, thinned.states)
    with pytest.raises(InputError, match="orthonormalize"):
        propagate_whole(CHOICE, "numpy", recording, orthonormalize=0.015)
    counted = propagate_whole(CHOICE, "numpy", recording, pulse=1e-4)
    np.testing.assert_array_equal(
        counted.states, recording_attitudes("window-3-3", pulses(ROW[:, None], 1e-4)[:, 0])
    )


@pytest.mark.parametrize(
    ("choice", "backend"),
    [
        (strapgen.choose("euler", "window-4-2"), "c"),
        (strapgen.choose("cayley-klein", "window-3-3"), "c"),
        (CHOICE, "exact"),
        (CHOICE, "c-fixed32"),
        (strapgen.choose("euler", "rk4"), "c"),
    ],
    ids=["one-sided", "cayley-klein", "exact", "fixed", "no window"],
)
def test_other_steps_are_refused(choice, backend):
    assert not covers(choice, backend)
    with pytest.raises(InputError, match="does not cover the ends"):
        propagate_whole(choice, backend, Recording(0.0, 0.01, ROW))


@pytest.mark.parametrize(
    ("row", "record", "reason"),
    [
        (ROW[:0], None, "holds 0 increments"),
        (ROW, 0.5, "longer than the recording"),
        (ROW, 0.015, "multiple"),
    ],
    ids=["empty", "long", "uneven"],
)
def test_times_that_do_not_fit_are_refused(row, record, reason):
    with pytest.raises(InputError, match=reason):
        propagate_whole(CHOICE, "numpy", Recording(0.0, 0.01, row), record=record)
