"""What a described system stores between cycles, and what a run of it returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from strapgen.ir.formats import Format
from strapgen.run.evaluators import Array


@dataclass
class SystemMemory:
    """What a system stores, in the numbers of its back end."""

    cells: dict[str, Array]  # (runs, elements)
    feedback: dict[str, Array]  # error feedback of each stage, (runs, number of words)
    cycle: int = 0  # cycles since all rates last fell together

    def copy(self) -> SystemMemory:
        """Return a memory that changes by itself."""
        return SystemMemory(dict(self.cells), dict(self.feedback), self.cycle)


@dataclass(frozen=True)
class SystemRun:
    """The result of a run."""

    values: Mapping[str, Array]  # by the name of the cell, in SI units, (times, shape)
    memory: SystemMemory = field(repr=False)  # at the end, from which a next run goes on


def rescaled(values: Array, there: Format, here: Format) -> Array:
    """Return integers of one format as those of another: to the nearest, halves up, and at most what the word holds.

    >>> rescaled(np.array([[3, -3, 40000]]), Format(32, 20), Format(16, 19)).tolist()
    [[2, -1, 20000]]
    """
    places = here.fraction - there.fraction
    top = here.largest
    whole = np.asarray(values, object)
    moved = whole << places if places >= 0 else (whole + (1 << (-places - 1))) >> -places
    return np.asarray(np.clip(moved, -top - 1, top), object if here.word > 32 else np.int64)
