"""How far the attitude of now of a commit-late unit on integers is from exact arithmetic on the same integers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import cache

import mpmath
import numpy as np

from strapgen import pipeline
from strapgen.design.commit_late import commit_late_sources
from strapgen.design.commit_late.commit_late_sources import LateSources
from strapgen.design.commit_late.late_filters import polynomial
from strapgen.design.commit_late.late_unit import LateUnitOnIntegers, state_argument
from strapgen.ir.fixed_settings import Settings
from strapgen.run.exact import DIGITS, Interpreter, number

#: Samples as integers, three axes each.
Samples = Sequence[Sequence[int]]


@cache
def parts(window: str, algorithm: str = "euler", **settings: object) -> LateSources:
    """Return the integer model of a unit at 400 deg/s and 100 Hz."""
    chosen = Settings.of(max_rate_deg_s=400, sample_hz=100, increments=1, **settings)
    return commit_late_sources.parts(commit_late_sources.family(window), algorithm, "fixed-model", chosen)


def unit_after(
    sources: LateSources, samples: Samples, state: Sequence[int] | None = None, lost: Iterable[int] = ()
) -> LateUnitOnIntegers:
    """Return a unit that has taken samples, of which some were lost."""
    unit = LateUnitOnIntegers(sources)
    if state is not None:
        unit.reset(np.array(state, np.int64).reshape(unit.attitude.shape))
    for place, sample in enumerate(samples):
        unit.push(np.array(sample), int(place in set(lost)))
    return unit


class Exact:
    """The attitude of now by the exact filters and steps, from the integers that a unit holds."""

    def __init__(self, sources: LateSources, algorithm: str = "euler") -> None:
        self.sources = sources
        choices = commit_late_sources.kernels(sources.filters, algorithm)
        self.step, self.rotation = (Interpreter(pipeline.program(choice)) for choice in choices[:2])
        self.unit = state_argument(sources.step).format.unit
        assert sources.step.fixed is not None and sources.fixed is not None
        self.sample = Fraction(2) ** -sources.fixed.fraction

    def now(self, unit: LateUnitOnIntegers) -> list[mpmath.mpf]:
        """Return the elements of the attitude."""
        filters, window = self.sources.filters, self.sources.filters.window
        held = [[int(x) * self.sample for x in row] for row in unit._samples]
        state = [number(int(x) * self.unit) for x in unit.attitude.ravel()]
        for place in range(len(held) - unit.pending, len(held)):
            after = len(held) - 1 - place
            if len(held) >= filters.samples and place >= window.previous and after >= window.ahead:
                taken = held[place - window.previous : place + window.ahead + 1]
                inputs = [state, [number(x * filters.scale) for row in taken for x in row]]
                state = self.step.outputs(*inputs)["next"]
                continue
            if len(held) < filters.samples:
                first, count = min(max(place - 1, 0), max(len(held) - 4, 0)), min(len(held), 4)
                rows = polynomial(count, place - first, filters.degree)
                rows = tuple(tuple(tap * filters.scale for tap in row) for row in rows)
            else:
                before = place if after > window.ahead else filters.samples - 1 - after
                first, count, rows = place - before, filters.samples, filters.sets[before]
            sums = [
                [
                    number(sum((tap * held[first + k][axis] for k, tap in enumerate(row)), Fraction(0)))
                    for axis in range(3)
                ]
                for row in rows
            ]
            if filters.sums.start:
                sums[0] = [number(x) for x in held[place]]
            state = self.rotation.outputs(state, *sums)["next"]
        return list(state)

    def error(self, unit: LateUnitOnIntegers) -> float:
        """Return the distance of the attitude of now from it: of the state, or of the row that is furthest."""
        with mpmath.workdps(DIGITS):
            exact = self.now(unit)
            computed = unit.now().ravel()
            off = [int(x) * number(self.unit) - value for x, value in zip(computed, exact, strict=True)]
            width = 3 if len(off) == 9 else len(off)
            return max(
                float(mpmath.sqrt(sum(x * x for x in off[k : k + width]))) for k in range(0, len(off), width)
            )


def search(
    sources: LateSources, exact: Exact, count: int, lost: Iterable[int], tries: int, seed: int
) -> tuple[float, list[list[int]], list[int]]:
    """Return the largest error that a climb from random inputs finds, with its samples and its committed attitude.

    Samples begin near the ends of their range, with few or many changes of sign; a try moves the last bits of a few
    numbers, or the sign of one, and stays where the error grows.
    """
    random = np.random.default_rng(seed)
    assert sources.fixed is not None
    limit = sources.fixed.limit
    one = 1 << state_argument(sources.step).format.fraction
    size = state_argument(sources.step).signal.size

    def begin() -> tuple[np.ndarray, np.ndarray]:
        signs = random.choice([-1, 1], (1, 3)) * random.choice([-1, 1], (count, 1)) ** random.integers(2)
        samples = signs * (limit - random.integers(0, 1 + limit // 1_000_000, (count, 3)))
        if size == 9:
            state, _ = np.linalg.qr(random.normal(size=(3, 3)))
        else:
            state = random.normal(size=4)
            state /= np.linalg.norm(state)
        return samples, np.rint(state.ravel() * one).astype(np.int64)

    def error(samples: np.ndarray, state: np.ndarray) -> float:
        return exact.error(unit_after(sources, samples.tolist(), state.tolist(), lost))

    best, found = -1.0, begin()
    for attempt in range(tries):
        if attempt < tries // 4:
            samples, state = begin()
        else:
            samples, state = found[0].copy(), found[1].copy()
            for _ in range(random.integers(1, 4)):
                place = tuple(random.integers(0, samples.shape))
                if random.integers(8) == 0:
                    samples[place] *= -1
                else:
                    samples[place] = np.clip(samples[place] + random.integers(-400, 401), -limit, limit)
            if random.integers(3) == 0:
                state = state + random.integers(-3, 4, state.shape)
        off = error(samples, state)
        if off > best:
            best, found = off, (samples, state)
    return best, found[0].tolist(), found[1].tolist()
