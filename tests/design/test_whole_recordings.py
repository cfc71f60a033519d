"""A window covers a recording from its first sample to its last."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import strapgen
from strapgen.design.commit_late.late_recording import covers, propagate_whole, recording_attitudes
from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings.recording import Recording, propagate
from strapgen.run.increments import pulses

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
