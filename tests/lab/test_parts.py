"""A run whose increments come part by part has the bits of one in memory, on every back end."""

from __future__ import annotations

import numpy as np
import pytest

import strapgen
from strapgen.ir.exceptions import InputError
from strapgen.lab import runs
from strapgen.lab.recordings.recording import Recording, propagate
from strapgen.run import backends, numpy_evaluator
from strapgen.run import increments as gyro
from strapgen.run.increments import StepWindows, pulses, run_parts, windows

STEPS = 50


@pytest.fixture
def short_parts(monkeypatch):
    """Propagate some steps together; the spans of the numpy back end are as long as the parts."""
    for module in (gyro, backends, runs):
        monkeypatch.setattr(module, "PART", 8)
    monkeypatch.setattr(numpy_evaluator, "_SPAN", 8)


@pytest.mark.parametrize(
    ("every", "record"), [(None, 1), (3, 1), (3, 7), (8, 50), (20, 3), (None, 11), (49, 49)]
)
def test_a_run_in_parts_has_the_bits_of_the_whole(make, every, record, rng, short_parts):
    backend = make("euler", largest=0.011, carry="full")
    increments = backend.representable(rng.uniform(-0.011, 0.011, (STEPS, 2, 3)))
    calls = []

    def part(first: int, count: int):
        calls.append((first, count))
        return increments[first : first + count]

    whole = backend.propagate(increments, record, every)
    np.testing.assert_array_equal(backend.propagate_parts(part, STEPS, record, every), whole)
    assert len(calls) > 5
    assert [first for first, _ in calls] == np.cumsum([0, *(count for _, count in calls)])[:-1].tolist()


@pytest.mark.parametrize("segment", [0, 1, 3, 8, 9, 17, 60])
def test_parts_end_where_a_state_is_restored(segment, short_parts):
    restored, place = [], 0
    for first, count, every in run_parts(STEPS, segment):
        assert (first, count <= 8) == (place, True)
        place += count
        restored += [first + k for k in range(1, count + 1) if every and k % every == 0]
    assert place == STEPS
    assert restored == [k for k in range(1, STEPS + 1) if segment and k % segment == 0]


def test_a_division_by_zero_ends_a_run_in_parts_as_one_in_memory(short_parts):
    backend = strapgen.backend("dcm", backend="exact", method="rk1", increments=1)
    increments = np.full((STEPS, 1, 3), 1e300)
    whole = backend.propagate(increments, 1, 4)
    parts = backend.propagate_parts(lambda first, count: increments[first : first + count], STEPS, 1, 4)
    np.testing.assert_array_equal(parts, whole)


def test_a_refusal_names_the_step_of_the_run(short_parts):
    settings = strapgen.Settings().fitted(0.01)
    backend = strapgen.backend("euler", backend="c-fixed32", settings=settings)
    increments = np.zeros((STEPS, 2, 3))
    increments[30:] = np.array([0.0099, 0, 0])
    with pytest.raises(InputError) as whole:
        backend.propagate(np.where(np.arange(STEPS)[:, None, None] == 30, 1.0, increments))
    with pytest.raises(InputError) as parts:
        backend.propagate_parts(
            lambda first, count: np.where(
                np.arange(first, first + count)[:, None, None] == 30, 1.0, increments[first : first + count]
            ),
            STEPS,
        )
    assert str(parts.value) == str(whole.value)


@pytest.mark.parametrize("previous", [0, 1, 3])
@pytest.mark.parametrize("pulse", [None, 0.01])
def test_windows_in_parts_are_those_of_the_whole_row(previous, pulse, rng):
    row = rng.normal(size=(previous + 2 * 20, 3))
    whole = windows(row, 2, previous)
    whole = whole if pulse is None else pulses(whole, pulse, previous)
    part = StepWindows(lambda first, stop: row[first:stop], 2, previous, pulse)
    counts = (3, 1, 9, 7)
    got = [part(first, count) for first, count in zip(np.cumsum([0, *counts]), counts, strict=False)]
    np.testing.assert_array_equal(np.concatenate(got), whole)


def test_pulses_that_cannot_be_counted_are_refused_in_a_later_part():
    part = StepWindows(lambda first, stop: np.full((stop - first, 3), 1e14 * first), 1, 0, 0.1)
    part(0, 5)
    with pytest.raises(InputError, match="more pulses than can be counted"):
        part(5, 50)


@pytest.mark.parametrize(("previous", "ahead"), [(0, 0), pytest.param(2, 1, marks=pytest.mark.long)])
@pytest.mark.parametrize("pulse", [None, "1e-4"])
def test_simulations_and_recordings_run_in_parts(previous, ahead, pulse, request):
    backend = strapgen.backend("euler", "rk4", 1, previous=previous, ahead=ahead)
    motion = strapgen.motion("coning", a_deg_s=10, b_deg_s=10, g_deg_s=10)
    data = Recording(0.0, 0.125, motion.increments(runs.Fraction("0.125"), STEPS, 1)[:, 0])

    def results():
        return (
            runs.simulate(backend, motion, "0.125", 6.25, "0.5", "0.25", pulse).computed,
            propagate(backend, data, 0.5, 0.25, pulse).states,
            runs.largest_increment(motion, "0.125", 6.25, 1, pulse, (previous, ahead)),
        )

    whole = results()
    request.getfixturevalue("short_parts")
    for one, other in zip(results(), whole, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-14)
