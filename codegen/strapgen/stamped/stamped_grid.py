"""Takes samples that carry their instants to an even grid, one by one or a whole recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.notebook_display import Records, short_repr
from strapgen.run.backend_names import BACKENDS, of_sources
from strapgen.run.backends import fit_settings
from strapgen.run.evaluators import Array, in_units, numbers
from strapgen.stamped import stamped_sources
from strapgen.stamped.grid_clock import Number, StampError, StampScale, StampStatus
from strapgen.stamped.kernel_names import ROUNDS
from strapgen.stamped.rounds import Rounds
from strapgen.stamped.stamped_unit import StampedUnit, StampedUnitInC

#: Targets whose functions Python calls.
_INTERPRETED = ("numpy", "fixed-model")


@dataclass(frozen=True)
class GridSamples(Records):
    """Samples of an even grid.

    Parameters
    ----------
    samples : array, (N, 3)
        In the unit of the samples that they were made of.
    interval : float
        Mean interval of the grid in s, by which velocity and position go on.
    halves : tuple of float
        Sampling rate in Hz over the first and over the second half: the drift of the sensor's clock.

    Examples
    --------
    >>> GridSamples(np.zeros((4, 3)), 0.005, (200.0, 200.0)).interval
    0.005
    """

    samples: Array
    interval: float
    halves: tuple[float, float]

    __repr__ = short_repr

    def _in_words(self) -> str:
        halves = " and ".join(f"{rate:.6g}" for rate in self.halves)
        return f"of {len(self.samples)} samples at {1 / self.interval:.6g} Hz, by halves {halves} Hz"


class StampedGrid:
    """Takes samples with instants of their own to an even grid, for which all algorithms are made.

    A sample is the integral of a rate from the stamp before to its own. The rate around the grid follows from designed
    filters, up to 1.3 rad a sample, in two rounds. The grid follows the sensor's own clock, which may be 3 % off the
    nominal rate and drift; from the first instant to the last the samples of the grid sum up to those that came.

    Parameters
    ----------
    sample_hz : number
        Nominal sampling rate in Hz.
    tick_hz : number
        Ticks of the stamps in a second; from 20 to 2^31 in a sampling interval.
    pairs : pair of int, optional
        Pairs of samples of the first and of the second round: (3, 5), or (7, 7) for a little more accuracy.
    stamp_bits : int, optional
        Bits of a stamp, after which it wraps.
    backend : str, optional
        "numpy" or "fixed-model", generated functions called from Python, or "c", "c-float" or "c-fixed32", generated C.
    settings : Settings, optional
        Settings of fixed point, with words of 32 bits. What rounding a sample leaves goes on to the next one.

    Attributes
    ----------
    latency : int
        Samples after the end of one on the grid that it is known.

    Raises
    ------
    InputError
        If a number is not allowed.
    CompilerError
        If the back end needs a C compiler and there is none.

    Examples
    --------
    >>> grid = StampedGrid(sample_hz=200, tick_hz=1_000_000)
    >>> stamps = 5_000 * np.arange(41) + 20 * (np.arange(41) % 3)
    >>> samples = np.diff(stamps, prepend=-5_000)[:, None] * [0.0, 0.0, 1e-6]  # a rate of 1 rad/s
    >>> [len(grid.push(*pair)) for pair in zip(samples, stamps)][30:35], grid.latency
    ([0, 23, 1, 1, 1], 8)
    >>> round(grid.rate_hz, 2)
    200.0
    >>> grid.whole(samples, stamps).samples[8:11, 2].round(6)
    array([0.005, 0.005, 0.005])
    """

    __repr__ = short_repr

    def _in_words(self) -> str:
        return f"at {self.rate_hz:.6g} Hz"

    def __init__(
        self,
        sample_hz: Number,
        tick_hz: Number,
        pairs: Sequence[int] = ROUNDS[0],
        stamp_bits: int = 64,
        backend: str = "numpy",
        settings: Settings | None = None,
    ) -> None:
        self._scale = StampScale.of(sample_hz, tick_hz, stamp_bits)
        self._tick_hz = checks.number("tick_hz", tick_hz)
        self._pairs = stamped_sources.checked_pairs(pairs)
        self.latency: int = sum(self._pairs)
        checks.choice("backend", backend, BACKENDS)
        target, settings = BACKENDS[backend].target, fit_settings(backend, settings)
        self._unit: StampedUnit | StampedUnitInC
        if target in stamped_sources.TARGETS:
            whole = stamped_sources.sources(
                sample_hz, tick_hz, self._pairs, target, stamp_bits, settings=settings
            )
            self._unit, fixed = StampedUnitInC(whole, self._scale), whole.fixed
        elif target in _INTERPRETED:
            parts = stamped_sources.parts(self._pairs, target, settings)
            rounds = Rounds(self._pairs, {pairs: of_sources(one) for pairs, one in parts.items()})
            self._unit, fixed = StampedUnit(rounds, self._scale), parts[self._pairs[0]].fixed
        else:
            able = (*_INTERPRETED, *stamped_sources.TARGETS)
            names = [name for name, entry in BACKENDS.items() if entry.target in able]
            raise InputError(f"backend is {backend!r}; these take stamped samples: {', '.join(names)}")
        self._sample = None if fixed is None else fixed.inputs[0]
        self.reset()

    def reset(self) -> None:
        """Forget all samples: the next one is the first one of a recording."""
        self._unit.start()
        #: Sum of the samples so far, and whether none has come: the first one is of no meaning.
        self._sum, self._is_first = np.zeros(3), True

    @property
    def interval(self) -> float:
        """The interval of the grid now, in s: the nominal one until the grid begins."""
        period = self._unit.period or self._scale.nominal
        return float(Fraction(period, 1 << self._scale.shift) / self._tick_hz)

    @property
    def rate_hz(self) -> float:
        """The sampling rate now, in Hz."""
        return 1 / self.interval

    def push(self, sample: Any, stamp: int) -> Array:
        """Take a sample, and return those of the grid that are known now.

        Parameters
        ----------
        sample : array_like, (3,)
            Integral of the rate in rad, or of the specific force in m/s, from the stamp before to this one, body axes;
            of the first call, which has no stamp before it, it is of no meaning.
        stamp : int
            Ticks at its end.

        Returns
        -------
        array, (k, 3)
            The next samples of the grid: none at first, then 23 at once, then one with every call.

        Raises
        ------
        StampError
            If the grid cannot take the stamp, or the sample is outside its range; nothing has changed then.
        """
        values = checks.real_array("sample", sample, (3,))
        if values.shape != (3,):
            raise InputError(f"sample has shape {values.shape}; (3,) is needed")
        (stored,), total = self._stored(values[None] * (not self._is_first))
        grid = self._unit.push(stored, int(_ticks(np.asarray(stamp))))
        self._sum, self._is_first = total, False
        return self._numbers(grid)

    def flush(self) -> Array:
        """End the recording: return the samples of the grid that are left, (k, 3), and forget all of them."""
        grid = self._numbers(self._unit.flush())
        self.reset()
        return grid

    def whole(self, samples: Any, stamps: Any) -> GridSamples:
        """Take a whole recording to the grid: the numbers of `push` for every sample, then of `flush`.

        What was pushed before is forgotten.

        Parameters
        ----------
        samples : array_like, (N, 3)
            As `push` takes them.
        stamps : array_like of int, (N + 1,) or (N,)
            Ticks at the beginning of the first sample and at the end of each. Without the first of them the first
            sample, whose beginning is not known, is left out.

        Returns
        -------
        GridSamples

        Raises
        ------
        StampError
            If the grid cannot take a stamp or a sample; the message has its place.
        """
        ticks, rows = _ticks(np.asarray(stamps)), checks.real_array("samples", samples, (3,))
        if rows.ndim != 2 or ticks.ndim != 1 or len(ticks) - len(rows) not in (0, 1) or len(ticks) < 3:
            raise InputError(
                f"samples has shape {rows.shape} and stamps {ticks.shape}; (N, 3) with N + 1 or N stamps, at least "
                "3 of them, is needed"
            )
        self.reset()
        stored, _ = self._stored(rows[len(rows) - len(ticks) + 1 :])
        grid = self._numbers(self._unit.whole(stored, ticks))
        self.reset()
        steps = np.diff(ticks) % (1 << self._scale.bits) if self._scale.bits < 64 else np.diff(ticks)
        half = len(steps) // 2
        rates = [
            len(part) / float(int(part.sum()) / self._tick_hz) for part in (steps, steps[:half], steps[half:])
        ]
        return GridSamples(grid, 1 / rates[0], (rates[1], rates[2]))

    def _stored(self, values: Array) -> tuple[Array, Array]:
        """Return samples in the numbers of the code, and the sum of all: its rounding goes on to the next one."""
        sums = np.cumsum(np.concatenate([self._sum[None], values]), axis=0)
        if self._sample is None:
            return values, sums[-1]
        counts = np.diff(np.rint(in_units(self._sample, sums)), axis=0)
        outside = (np.abs(counts) > stamped_sources.sample_limit(self._sample)).any(axis=1)
        if outside.any():
            place = int(outside.argmax())
            largest = float(stamped_sources.sample_limit(self._sample) * self._sample.unit)
            raise StampError(
                StampStatus.RANGE,
                f"sample {place + 1} holds {float(np.abs(values[place]).max()):.9g}; the format was chosen for at most "
                f"{largest:.9g} in magnitude",
            )
        return counts.astype(np.int64), sums[-1]

    def _numbers(self, grid: Array) -> Array:
        return grid if self._sample is None else numbers(self._sample, grid)


def _ticks(stamps: Array) -> Array:
    """Return stamps as whole numbers of 64 bits; the differences of larger ones are the same."""
    if stamps.dtype.kind not in "iu":
        raise InputError(f"stamps are of type {stamps.dtype}; whole numbers of ticks are needed")
    return stamps.astype(np.int64)
