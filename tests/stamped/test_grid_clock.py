"""The grid that follows a sensor's clock: offsets, drift, wrapping stamps, and what it refuses."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest
from numpy.random import default_rng

from strapgen.ir.exceptions import InputError
from strapgen.stamped.grid_clock import BLOCK, GridClock, StampError, StampScale, StampStatus

#: 200 Hz with ticks of 1 us.
SCALE = StampScale.of(200, 1e6)
UNIT = 2.0**-SCALE.shift


def taken(stamps: np.ndarray, scale: StampScale = SCALE) -> tuple[GridClock, np.ndarray, np.ndarray]:
    """Return the clock after stamps, the instants of its boundaries in ticks, and the offsets in intervals."""
    clock = GridClock(scale)
    instants, offsets = [], []
    for stamp in stamps.tolist():
        known = clock.take(stamp)
        if len(known) > 1:
            instants += [stamps[k] - o * 2.0**-30 * clock.period * UNIT for k, o in enumerate(known)]
        elif known:
            instants.append(stamp - clock.ahead * UNIT)
        offsets += known
    return clock, np.array(instants), np.array(offsets) * 2.0**-30


def stamps(count: int, interval: float = 5000.0, jitter: float = 0.0, seed: int = 1) -> np.ndarray:
    """Return stamps whose intervals have a mean, and jitter in intervals."""
    random = default_rng(seed).normal(0, jitter, count).clip(-0.045, 0.045)
    return np.round(interval * (np.arange(count) + random)).astype(np.int64) + 1_000_000


def test_even_stamps_have_no_offset():
    clock, instants, offsets = taken(stamps(500))
    assert clock.period == 5000 << SCALE.shift
    assert not offsets.any()
    assert np.array_equal(instants, stamps(500))


@pytest.mark.parametrize("off", [-0.03, -0.0085, 0.03])
def test_the_grid_follows_the_mean_rate_of_the_sensor(off):
    interval = 5000 / (1 + off)
    clock, instants, offsets = taken(stamps(5000, interval, 0.01))
    assert clock.period * UNIT == pytest.approx(interval, rel=2e-4)
    assert instants[-1] == pytest.approx(stamps(5000, interval)[-1], abs=0.01 * interval)
    assert offsets.std() == pytest.approx(0.01, rel=0.1)


def test_the_grid_is_even_where_the_stamps_jitter():
    _, instants, _ = taken(stamps(20_000, jitter=0.01))
    # From block to block the interval changes by some 1e-5 of itself, within a block hardly.
    change = np.diff(instants[BLOCK:], 2) / 5000
    assert 1e-5 < np.sqrt(BLOCK) * change.std() < 6e-5
    largest = sorted(np.abs(change[place::BLOCK]).max() for place in range(BLOCK))
    assert largest[-2] < 2e-6 < largest[-1] < 3e-4


def test_a_clock_that_drifts_is_followed():
    # 2 % up and down within 40,000 samples.
    k = np.arange(120_000)
    times = np.round(5000 * (k + 0.02 * 40_000 / (2 * np.pi) * np.sin(2 * np.pi * k / 40_000))).astype(
        np.int64
    )
    _, instants, offsets = taken(times)
    assert np.abs(offsets).max() < 0.01
    assert np.abs(np.diff(instants, 2)).max() / 5000 < 1e-4


@pytest.mark.parametrize("bits", [16, 24, 32, 64])
def test_stamps_may_wrap(bits):
    plain = stamps(3000, 5043, 0.01)
    wrapped = [(stamp + (1 << bits) - 3_000_000) % (1 << bits) for stamp in plain.tolist()]
    assert wrapped != sorted(wrapped)
    clock = GridClock(StampScale.of(200, 1e6, bits))
    found = [offset for stamp in wrapped for offset in clock.take(stamp)]
    assert np.array_equal(np.array(found) * 2.0**-30, taken(plain)[2])


def test_a_recording_that_ends_before_the_grid_begins_has_one():
    clock = GridClock(SCALE)
    for stamp in (0, 5010, 10_020):
        assert clock.take(stamp) == []
    assert clock.finish() == [0, 0, 0]
    assert clock.period == 5010 << SCALE.shift
    assert GridClock(SCALE).finish() == []


@pytest.mark.parametrize(
    ("stamp", "status"),
    [
        (0, StampStatus.GAP),
        (10_001, StampStatus.GAP),
        (-1, StampStatus.GAP),
        (5000 + 260, StampStatus.OFFSET),
        (5000 - 260, StampStatus.OFFSET),
    ],
)
def test_a_stamp_that_is_refused_changes_nothing(stamp, status):
    clock, _, _ = taken(stamps(BLOCK + 5))
    before = deepcopy(clock)
    with pytest.raises(StampError) as refusal:
        clock.take(clock.last + stamp)
    assert refusal.value.status == status
    assert clock == before
    assert clock.take(clock.last + 5000) == [0]


@pytest.mark.parametrize(("off", "status"), [(0.04, StampStatus.RATE), (-0.04, StampStatus.RATE)])
def test_a_rate_that_is_far_from_the_nominal_one_is_refused(off, status):
    with pytest.raises(StampError, match="of the nominal one") as refusal:
        taken(stamps(BLOCK, 5000 * (1 + off)))
    assert refusal.value.status == status


def test_a_first_instant_that_is_far_from_the_line_is_refused():
    times = stamps(BLOCK)
    times[7] += 300
    with pytest.raises(StampError, match="5 % is allowed"):
        taken(times)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ((200, 1e3), "5 ticks; from 20 to"),
        ((1, 1e10), "1e\\+10 ticks"),
        ((200, 1e6, 14), "wraps within four sampling intervals"),
        ((200, 1e6, 65), "stamp_bits is 65"),
        ((0, 1e6), "sample_hz"),
        ((200, -1), "tick_hz"),
    ],
)
def test_numbers_that_do_not_go_together_are_refused_in_one_line(arguments, reason):
    with pytest.raises(InputError, match=reason) as refusal:
        StampScale.of(*arguments)
    assert "\n" not in str(refusal.value)
