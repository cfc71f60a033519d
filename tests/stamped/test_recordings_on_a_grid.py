"""Recordings whose times are the instants of the samples, read onto an even grid."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.random import default_rng

import strapgen
from strapgen import Recording, StampedGrid
from strapgen.cli import main
from strapgen.ir.exceptions import InputError

HZ = 198.3


def stamped(count: int = 300) -> tuple[np.ndarray, np.ndarray]:
    """Return times that jitter by 1 % of an interval, and the increments between them of two sines and a constant."""
    time = 5 + (np.arange(count + 1) + default_rng(2).normal(0, 0.01, count + 1).clip(-0.04, 0.04)) / HZ
    return time, np.diff(angles(time), axis=0)


def angles(time: np.ndarray) -> np.ndarray:
    return np.stack([np.sin(90 * time) / 50, np.cos(70 * time) / 40, time / 3], axis=-1)


def test_rates_and_increments_go_to_the_grid_of_their_instants():
    time, samples = stamped()
    rates = np.concatenate([[[7.0] * 3], samples / np.diff(time)[:, None]])
    increments = np.concatenate([[[7.0] * 3], samples])
    # 2^26 ticks an interval or so.
    ticks_hz = 2.0 ** round(26 + np.log2(HZ))
    stamps = np.rint((time - time[0]) * ticks_hz).astype(int)
    whole = StampedGrid(HZ, ticks_hz, (7, 7)).whole(samples, stamps)
    for one in (
        Recording.from_rates(time, rates, grid=True),
        Recording.from_increments(time, increments, grid=True),
    ):
        assert one.start == time[0]
        assert one.interval == pytest.approx(1 / HZ, rel=1e-4)
        assert one.samples.shape == (300, 3)
        assert np.abs(one.samples - whole.samples).max() < 1e-9
        assert any(
            "300 increments are taken from their instants to an even grid, 198." in text
            for text in one.remarks
        )
        assert not any("count as even" in text for text in one.remarks)


def test_the_grid_has_what_even_samples_would_have():
    time, samples = stamped(2000)
    even = np.diff(angles(time[0] + np.linspace(0, time[-1] - time[0], 2001)), axis=0)
    increments = np.concatenate([samples[:1], samples])
    counted, on_grid = (
        Recording.from_increments(time, increments, grid=grid).samples for grid in (False, True)
    )
    # The grid is off the line through its ends by a small part of an interval, which varies slowly.
    on_grid, counted = (np.diff(one - even, 4, axis=0)[20:-20] for one in (on_grid, counted[1:]))
    assert np.abs(on_grid).max() < 0.005 * np.abs(counted).max()


def test_rates_at_instants_have_the_trapezoid_before_they_go_to_the_grid():
    time, _ = stamped()
    rates = np.outer(np.sin(3 * time), [0.1, 0.2, 0.3])
    recording = Recording.from_rates(time, rates, input="instants", grid=True)
    assert recording.samples.shape == (300, 3)
    total = ((rates[1:] + rates[:-1]) / 2 * np.diff(time)[:, None]).sum(axis=0)
    assert recording.samples.sum(axis=0) == pytest.approx(total, abs=1e-14)


def test_forces_lie_on_the_same_grid():
    time, samples = stamped()
    increments = np.concatenate([samples[:1], samples])
    both = Recording.from_increments(time, increments, 100 * increments, grid=True)
    assert both.velocity_increments == pytest.approx(100 * both.samples, rel=1e-12)


def test_each_piece_has_a_grid_of_its_own_and_sums_begin_in_it():
    time, samples = stamped()
    time = time + np.where(np.arange(301) > 150, 1.0, 0.0)
    increments = np.concatenate([samples[:1], samples])
    split = Recording.from_increments(time, increments, grid=True, gaps="split", every=2)
    assert [len(piece.samples) for piece in split.pieces] == [75, 74]
    assert [piece.start for piece in split.pieces] == pytest.approx([time[0], time[151]])
    assert split.pieces[0].samples.sum(axis=0) == pytest.approx(samples[:150].sum(axis=0), abs=1e-14)


def test_an_instant_that_is_too_far_off_is_refused_with_its_time(tmp_path, capsys):
    time, samples = stamped()
    time[200] += 0.09 / HZ
    rows = np.column_stack([time, np.concatenate([samples[:1], samples])])
    file = tmp_path / "log.csv"
    np.savetxt(file, rows, delimiter=",", header="t,dx,dy,dz", comments="")
    with pytest.raises(
        InputError, match=f"at {time[200]:.6g}.* s: an instant lies .* up to 5 % is allowed; without"
    ):
        strapgen.read(file, grid=True)
    with pytest.raises(SystemExit) as stop:
        main(["simulate", "euler", "--recording", str(file), "--grid", "--out", "-"])
    said, warned = capsys.readouterr()
    assert (stop.value.code, said) == (2, "")
    assert warned.count("\n") == 1
    assert "without --grid the times are taken as even" in warned


def test_the_command_says_the_rate_of_the_grid(tmp_path, capsys):
    time, samples = stamped()
    rows = np.column_stack([time, np.concatenate([samples[:1], samples])])
    file = tmp_path / "log.csv"
    np.savetxt(file, rows, delimiter=",", header="t,dx,dy,dz", comments="")
    for options in ([], ["--grid"]):
        with pytest.raises(SystemExit) as stop:
            main(["simulate", "euler", "--recording", str(file), *options])
        assert stop.value.code == 0
        assert ("taken from their instants to an even grid, 198." in capsys.readouterr().err) == bool(options)
