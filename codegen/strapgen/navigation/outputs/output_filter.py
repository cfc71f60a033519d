"""The Butterworth filter of second order before an output: coefficients of its kernel, and its responses."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from strapgen.ir.exceptions import InputError

#: Damping coefficient of the filter.
_ROOT = math.sqrt(2)
#: Part of a response at which its sum is cut off.
_NEGLIGIBLE = 1e-16
#: Edges for which the filter is run, as part of the sampling rate; a lower one takes too long to settle.
LOWEST_EDGE = 1e-5


@dataclass(frozen=True)
class OutputFilter:
    """A Butterworth filter of second order, sampled by the bilinear transformation with its edge kept.

    >>> edge = OutputFilter(3.2, 50)
    >>> [round(b, 10) for b in edge.numerator], [round(a, 10) for a in edge.denominator]
    ([0.0312389237, 0.0624778474, 0.0312389237], [1.0, -1.4415303099, 0.5664860047])
    """

    #: Edge: the frequency that is damped by 3 dB
    cutoff_hz: float
    #: Samples in a second
    sample_hz: float

    def __post_init__(self) -> None:
        if not 0 < self.sample_hz < math.inf:
            raise InputError(f"sample-hz is {self.sample_hz:g}; a number above 0 is needed")
        low, high = LOWEST_EDGE * self.sample_hz, self.sample_hz / 2
        if not low <= self.cutoff_hz < high:
            raise InputError(
                f"cutoff-hz is {self.cutoff_hz:g}; at {self.sample_hz:g} samples in a second a filter has an edge "
                f"from {low:g} to below {high:g}"
            )

    @property
    def warped(self) -> float:
        """K = tan(pi fc/fs), half the angle of the edge in a cycle, prewarped."""
        return math.tan(math.pi * self.cutoff_hz / self.sample_hz)

    @property
    def coefficients(self) -> dict[str, float]:
        """The coefficients of the kernel ``butterworth-2``, by the names of its inputs."""
        K = self.warped
        n = 1 + _ROOT * K + K**2
        return {"loss": (_ROOT * K + K**2) / n, "coupling": K / n, "square": K**2 / n}

    @property
    def numerator(self) -> tuple[float, float, float]:
        """Coefficients b of the transfer function in 1/z."""
        b = self.coefficients["square"]
        return b, 2 * b, b

    @property
    def denominator(self) -> tuple[float, float, float]:
        """Coefficients 1, a1, a2 of the transfer function in 1/z."""
        K = self.warped
        n = 1 + _ROOT * K + K**2
        return 1.0, 2 * (K**2 - 1) / n, (1 - _ROOT * K + K**2) / n

    @property
    def transition(self) -> NDArray[np.float64]:
        """How a cycle changes the states, (2, 2)."""
        loss, coupling, square = self.coefficients.values()
        return np.array([[1 - 2 * loss, -2 * coupling], [2 * coupling, 1 - 2 * square]])

    @property
    def settling(self) -> int:
        """Cycles after which what was before no longer counts in double precision."""
        return math.ceil(2 * math.log(_NEGLIGIBLE) / math.log(self.denominator[2]))

    @property
    def state_ranges(self) -> tuple[float, float]:
        """Largest magnitude of the first and of the second state for samples up to 1: the sums of their responses."""
        _, coupling, square = self.coefficients.values()
        response, total = np.array([2 * coupling, 2 * square]), np.zeros(2)
        for _ in range(self.settling):
            total += np.abs(response)
            response = self.transition @ response
        return float(total[0]), float(total[1])

    def accumulated(self, errors: tuple[float, float]) -> NDArray[np.float64]:
        """Return the largest errors of both states in a run of any length whose cycles each add up to `errors`."""
        power, total = np.eye(2), np.zeros((2, 2))
        for _ in range(self.settling):
            total += np.abs(power)
            power = self.transition @ power
        return np.asarray(total @ np.array(errors))

    def analog(self, frequency_hz: float) -> complex:
        """Return the response of the analog filter at a frequency."""
        s = 1j * frequency_hz / self.cutoff_hz
        return 1 / (s**2 + _ROOT * s + 1)

    def digital(self, frequency_hz: float) -> complex:
        """Return the response of the sampled filter at a frequency."""
        late = cmath.exp(-2j * math.pi * frequency_hz / self.sample_hz)
        top = sum(b * late**k for k, b in enumerate(self.numerator))
        return top / sum(a * late**k for k, a in enumerate(self.denominator))

    @property
    def analog_delay_s(self) -> float:
        """Delay of slow changes by the analog filter in s."""
        return _ROOT / (2 * math.pi * self.cutoff_hz)

    @property
    def digital_delay_s(self) -> float:
        """Delay of slow changes by the sampled filter in s."""
        return _ROOT / (2 * self.warped * self.sample_hz)


def decibels(response: complex) -> float:
    """Return the magnitude of a response in dB; -inf for none.

    >>> decibels(0.1)
    -20.0
    """
    return 20 * math.log10(abs(response)) if response else -math.inf
