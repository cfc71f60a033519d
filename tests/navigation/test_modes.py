"""The modes of a reference: sequences that the source prints in words, and a state machine beside the kernel."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from derived import quantized

import strapgen
from strapgen.catalogue import choose
from strapgen.ir.fixed_settings import Settings
from strapgen.navigation.modes import MODES
from strapgen.run.evaluators import Evaluator

OFF, ALIGN, NAVIGATE, ATTITUDE = range(4)
#: Cycles in a second; 10 s of initialization and 10 minutes, 30 s and 20 s are printed.
RATE = 1
TIMES = (610 * RATE, 30 * RATE, 20 * RATE)
#: 20 knots in m/s.
SLOW = 20 * 1852 / 3600


def run(selections: list[tuple[int, float, float]], evaluator: Evaluator) -> dict[str, np.ndarray]:
    """Return the outputs of all cycles for (selected, ground speed, seconds) one after the other, from off."""
    rows, state = [], (0.0, 0.0)
    for selected, speed, seconds in selections:
        for _ in range(round(seconds * RATE)):
            outputs = evaluator(*state, selected, speed, SLOW, *TIMES)
            state = tuple(float(value) for value in outputs[:2])
            rows.append([float(value) for value in outputs])
    return dict(zip(("mode", "left", "ready", "reset"), np.array(rows).T, strict=True))


def changes(result: dict[str, np.ndarray]) -> list[tuple[str, float]]:
    """Return the modes with the seconds at which each begins."""
    modes = result["mode"].astype(int)
    first = np.flatnonzero(np.diff(modes, prepend=-1))
    return [(MODES[modes[k]], k / RATE) for k in first]


@pytest.fixture(scope="module")
def sequence() -> Evaluator:
    return strapgen.evaluator("mode-sequence")


def test_navigation_selected_at_once_begins_after_the_alignment(sequence):
    result = run([(OFF, 0, 1), (NAVIGATE, 0, 620)], sequence)
    assert changes(result) == [("off", 0), ("align", 1), ("navigate", 611)]
    assert not result["reset"].any()
    assert (result["ready"] == (result["mode"] == NAVIGATE)).all()


def test_an_alignment_goes_on_as_long_as_it_is_selected(sequence):
    result = run([(ALIGN, 0, 900), (NAVIGATE, 0, 1)], sequence)
    assert changes(result) == [("align", 0), ("navigate", 900)]
    assert result["ready"][609 * RATE] == 0 and result["ready"][611 * RATE] == 1


def test_an_alignment_begins_again_below_20_knots_alone_and_lasts_30_s(sequence):
    result = run([(NAVIGATE, 0, 620), (ALIGN, 11, 5), (ALIGN, 10, 1), (NAVIGATE, 0, 60)], sequence)
    assert changes(result) == [("align", 0), ("navigate", 610), ("align", 625), ("navigate", 655)]
    assert np.flatnonzero(result["reset"]).tolist() == [625 * RATE]


def test_attitude_has_priority_and_only_off_ends_it(sequence):
    for before in (OFF, ALIGN, NAVIGATE):
        wait = 620 if before == NAVIGATE else 2
        result = run(
            [(before, 0, wait), (ATTITUDE, 0, 25), (NAVIGATE, 0, 5), (ALIGN, 0, 5), (OFF, 0, 1)], sequence
        )
        assert changes(result)[-2:] == [("attitude", wait), ("off", wait + 35)]
        ready = result["ready"][wait * RATE : (wait + 35) * RATE]
        assert ready[: 20 * RATE].sum() == 0 and ready[20 * RATE :].all()


def machine(mode: int, left: int, selected: int, slow: bool, times: tuple[int, ...]) -> tuple[int, int]:
    """Return the next mode and the cycles left, case by case."""
    full, short, start = times
    if selected == OFF:
        return OFF, 0
    if mode == ATTITUDE:
        return ATTITUDE, max(left - 1, 0)
    if selected == ATTITUDE:
        return ATTITUDE, start
    if mode == OFF:
        return ALIGN, full
    if mode == NAVIGATE:
        return (ALIGN, short) if selected == ALIGN and slow else (NAVIGATE, 0)
    if selected == NAVIGATE and left <= 1:
        return NAVIGATE, 0
    return ALIGN, max(left - 1, 0)


@pytest.mark.parametrize("backend", ["numpy", "c", pytest.param("rust", marks=pytest.mark.long)])
def test_every_case_is_that_of_a_state_machine(backend):
    times = (7, 3, 4)
    cases = list(itertools.product(range(4), range(6), range(4), (False, True)))
    columns = np.array([(m, left, s, 10.0 if slow else 10.5) for m, left, s, slow in cases]).T
    rest = np.array([[SLOW, *times]] * len(cases)).T
    mode, left, ready, reset = strapgen.evaluator("mode-sequence", backend)(*columns, *rest)
    expected = np.array([machine(m, n, s, slow, times) for m, n, s, slow in cases])
    np.testing.assert_array_equal(np.stack([mode, left], axis=1), expected)
    np.testing.assert_array_equal(ready, (expected[:, 0] > OFF) & (expected[:, 1] == 0))
    np.testing.assert_array_equal(reset, (columns[0] >= NAVIGATE) & (expected[:, 0] == ALIGN))


@pytest.mark.parametrize("word", [16, 32])
def test_modes_and_times_are_exact_in_fixed_point(word):
    assert not any(quantized(choose("mode-sequence"), Settings(word=word)).error_bounds.values())


@pytest.mark.parametrize(
    "backend", ["numpy", *(pytest.param(b, marks=pytest.mark.long) for b in ("c", "rust"))]
)
def test_a_switch_changes_at_its_thresholds_and_rests_between_them(backend):
    switch = strapgen.evaluator("hysteresis", backend)
    state, states = 0.0, []
    for value in (0, 3, 4.9, 5, 4, 3, 2.9, 4.9, 9, 3):
        state = float(switch(state, value, 3, 5))
        states.append(int(state))
    assert states == [0, 0, 0, 1, 1, 1, 0, 0, 1, 1]
