"""The certificate of a unit that commits late holds what the same unit gives in arithmetic of 40 digits."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from commands import says

from strapgen import CommitLate, Recording, Settings, choose
from strapgen.design.commit_late import commit_late_sources
from strapgen.design.commit_late.commit_late_sources import LateSources
from strapgen.design.commit_late.late_certificate import certify_late
from strapgen.design.commit_late.late_filters import NEXT
from strapgen.design.commit_late.late_unit import LateUnit
from strapgen.ir.exceptions import InputError
from strapgen.run.backend_names import BACKENDS
from strapgen.run.kernel_sources import sources_of_choice

pytest.importorskip("flint")


def turns(count, seed=1):
    return np.random.default_rng(seed).normal(0, 0.01, (count, 3))


class UnitInDigits(LateUnit):
    """A unit whose functions and taps have 40 digits."""

    def __init__(self, filters, state):
        step, rotation, normalization = (
            sources_of_choice(one, BACKENDS["exact"].target)
            for one in commit_late_sources.kernels(filters, state)
        )
        super().__init__(LateSources(filters, step, rotation, normalization))
        first = filters.sums.start
        self._sets = [self._exact(rows[first:]) for rows in filters.sets]
        self._short = [self._exact(rows[first:]) for rows in filters.short]
        self._next = self._exact([NEXT])[0], 0

    @staticmethod
    def _exact(rows):
        return [[mpmath.mpf(tap.numerator) / tap.denominator for tap in row] for row in rows]


def in_digits(state, backend, settings, samples):
    """Return the attitude of now before the last intervals are committed, and that at the end, in 40 digits."""
    filters = commit_late_sources.family("window-3-3")
    if settings is not None:
        made = commit_late_sources.parts(filters, state, BACKENDS[backend].target, settings)
        filters = replace(made.filters, scale=Fraction(1))
    with mpmath.workdps(40):
        unit = UnitInDigits(filters, state)
        for sample in samples:
            unit.push(np.array([mpmath.mpf(x) for x in sample.tolist()], object), 0)
        now = unit.now()
        unit.flush()
        return now, unit.attitude


def matrix(state):
    values = [mpmath.mpf(x) if not isinstance(x, mpmath.mpf) else x for x in np.ravel(state)]
    if len(values) == 9:
        return mpmath.matrix([values[:3], values[3:6], values[6:]])
    x, y, z, s = values
    return mpmath.matrix(
        [
            [s * s + x * x - y * y - z * z, 2 * (x * y - s * z), 2 * (x * z + s * y)],
            [2 * (x * y + s * z), s * s - x * x + y * y - z * z, 2 * (y * z - s * x)],
            [2 * (x * z - s * y), 2 * (y * z + s * x), s * s - x * x - y * y + z * z],
        ]
    )


def turn_between(first, second):
    """Return the rotation vector from the second attitude to the first one, of the nearest rotation."""
    error = matrix(first) * matrix(second) ** -1
    for _ in range(9):
        error = (error + (error**-1).T) / 2
    sines = [(error[j, i] - error[i, j]) / 2 for i, j in ((1, 2), (2, 0), (0, 1))]
    size = mpmath.sqrt(sum(x * x for x in sines))
    return [x * mpmath.asin(size) / size for x in sines], mpmath.asin(size)


@pytest.mark.parametrize("count", [60, pytest.param(10_000, marks=pytest.mark.long)])
@pytest.mark.parametrize("backend", ["c-fixed32", "fixed-model", "c", "numpy", "c-float"])
@pytest.mark.parametrize("state", ["euler", "dcm"])
def test_committed_and_present_attitudes_are_those_of_40_digits(state, backend, count):
    samples = turns(count)
    settings = Settings().fitted(np.abs(samples).max()) if "fixed" in backend else None
    found = certify_late(
        choose(state, "window-3-3"), backend, Recording(0.0, 0.01, samples), settings=settings
    )
    unit = CommitLate("window-3-3", state, backend, settings=settings)
    taken = unit.taken(samples)
    for sample in taken:
        unit.push(sample)
    now = unit.now()
    unit.flush()
    expected = in_digits(state, backend, settings, taken)
    with mpmath.workdps(40):
        axes, _ = turn_between(unit.attitude.astype(np.float64), expected[1])
        for one, other in zip(found.rounding_axes_rad, axes, strict=True):
            assert abs(one - other) <= found.rounding_radius_rad + 1e-30
        _, size = turn_between(now.astype(np.float64), expected[0])
        assert abs(found.now_rounding_rad - size) <= found.now_rounding_radius_rad + 1e-30
    assert found.rounding_radius_rad < 1e-9 * found.rounding_rad
    assert found.steps == count
    assert found.largest_now_rounding_rad >= found.now_rounding_rad


def test_a_unit_in_the_last_place_in_one_commit_is_in_the_certificate(monkeypatch):
    """Whatever computed them: the attitudes are those of the unit."""
    samples = turns(40)
    settings = Settings().fitted(np.abs(samples).max())
    choice, data = choose("euler", "window-3-3"), Recording(0.0, 0.01, samples)
    honest = certify_late(choice, "c-fixed32", data, settings=settings)
    flush = CommitLate.flush

    def wrong(self):
        count = flush(self)
        state = np.array(self.attitude)
        state[0] += self._state.unit.__float__()
        self.reset(state)
        return count

    monkeypatch.setattr(CommitLate, "flush", wrong)
    moved = certify_late(choice, "c-fixed32", data, settings=settings)
    unit = CommitLate("window-3-3", "euler", "c-fixed32", settings=settings)
    for sample in unit.taken(samples):
        unit.push(sample)
    flush(unit)
    q = unit.attitude / np.linalg.norm(unit.attitude)
    turned = np.linalg.norm(np.subtract(moved.rounding_axes_rad, honest.rounding_axes_rad))
    assert turned == pytest.approx(2 * float(unit._state.unit) * np.sqrt(1 - q[0] ** 2), rel=1e-6)
    assert moved.now_rounding_rad == honest.now_rounding_rad


def test_a_recording_shorter_than_the_window_is_refused():
    with pytest.raises(InputError, match="holds 6 increments; the window takes 7"):
        certify_late(choose("euler", "window-3-3"), "numpy", Recording(0.0, 0.01, turns(6)))


def test_the_command_certifies_a_unit_that_commits_late(capsys):
    words = "certify euler --window window-3-3 --commit-late --recording examples/inertial_log.csv --input increments"
    status, out, _ = says(
        f"{words} --columns t,dx,dy,dz --target c --initial-deg 1,2,3 --format json", capsys
    )
    said = json.loads(out)
    assert (status, said["steps"]) == (0, 1000)
    assert 0 < said["start_rounding_rad"] < said["rounding_rad"] < 1e-13
    assert said["departures"][-1]["now_rounding_rad"] == said["now_rounding_rad"]


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("certify euler --commit-late", "euler-rk4-2 is no window"),
        ("certify euler --window window-3-3 --commit-late --jobs 2", "--jobs does not go with --commit-late"),
        ("certify euler --window window-3-3 --commit-late --target rust", "these commit late"),
        ("certify cayley-klein --window window-3-3 --commit-late", "euler"),
    ],
)
def test_what_cannot_be_committed_late_is_one_line(capsys, command, message):
    status, out, error = says(f"{command} --recording tests/data/increments.csv", capsys)
    assert (status, out) == (2, "")
    assert message in error.strip().splitlines()[-1]
