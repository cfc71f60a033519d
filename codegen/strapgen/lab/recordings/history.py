"""`History` holds the attitude along a recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.ir.notebook_display import Records, short_repr

Array = NDArray[np.float64]


@dataclass(frozen=True)
class History(Records):
    """The attitude along a recording.

    Parameters
    ----------
    time : array, (N,)
        Times in s, on the clock of the recording.
    states : array, (N, state shape)
        States of the back end.
    step : float
        Step length in s.
    unused : int
        Number of increments at the end that do not fill a step.
    elements : tuple of str
        Names of the elements of a state, row-major; empty where they are not known.
    """

    time: Array
    states: NDArray[Any]
    step: float
    unused: int
    elements: tuple[str, ...] = ()

    __repr__ = short_repr

    def _in_words(self) -> str:
        times = f"{self.time[0]:g} s to {self.time[-1]:g} s, steps of {self.step:g} s"
        return f"of {len(self.time)} states, {times}; {self.unused} increments unused"
