"""Random numbers of sensor errors: every run, cause and axis has a stream of its own."""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Streams:
    """The random numbers of one run.

    A stream depends on the seed, the number of the run and its name alone: a cause that is switched off takes nothing
    from the others, and a run that is read in parts has the numbers of a whole one.

    >>> one, other = Streams(1, 0), Streams(1, 0)
    >>> _ = one.normal("noise", 5)
    >>> bool((one.normal("walk", 4) == other.normal("walk", 4)).all())
    True
    """

    def __init__(self, seed: int, run: int) -> None:
        self._key = (seed, run)
        self._generators: dict[str, list[np.random.Generator]] = {}

    def normal(self, name: str, count: int, width: int = 3) -> Array:
        """Return the next standard normal numbers of a cause, (count, width), each axis from its stream."""
        return np.stack([stream.standard_normal(count) for stream in self._of(name, width)], axis=-1)

    def uniform(self, name: str, count: int, width: int = 3) -> Array:
        """Return the next numbers of a cause from 0 to below 1, (count, width)."""
        return np.stack([stream.random(count) for stream in self._of(name, width)], axis=-1)

    def _of(self, name: str, width: int) -> list[np.random.Generator]:
        if name not in self._generators:
            seed, run = self._key
            label = zlib.crc32(name.encode())
            self._generators[name] = [
                np.random.Generator(
                    np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(run, label, axis)))
                )
                for axis in range(width)
            ]
        return self._generators[name]
