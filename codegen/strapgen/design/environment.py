"""The vibration of a brief: lines, a spectrum, or a recording, and the mean rates that algorithms compute under it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from strapgen.analysis.vibration.mean_rates import Assessment
from strapgen.analysis.vibration.spectrum import Spectrum, random_rates
from strapgen.catalogue.toml_models import Key
from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings.recording import read_increments

#: Relative error of an integral over a spectrum: far below the part of a prediction that matters.
_TOLERANCE = 1e-4
#: Samples of a part of a recording whose spectrum is averaged with those of the others, and fewest parts.
_SEGMENT, _FEWEST = 1024, 4
#: Frequencies of a picture or a time simulation of a spectrum.
_LINES = 200


class Environment(Protocol):
    """A vibration about the body axes."""

    @property
    def accelerates(self) -> bool:
        """Whether it has accelerations, so that there is sculling."""

    @property
    def highest_hz(self) -> float:
        """The highest frequency in Hz."""

    def error(self, assessment: Assessment, step: Fraction, cycles: int | None = None) -> float:
        """Return the length of the error of the mean rate that an algorithm computes, in its unit.

        `step`: step in s; for a recursion its slow cycle.
        """

    def lines(self) -> tuple[Line, ...]:
        """Return lines with the same effect, about x and y."""


@dataclass(frozen=True)
class Line:
    """A vibration at one frequency: angles X sin(2 pi f t) about x and Y sin(2 pi f t + P) about y."""

    frequency_hz: Annotated[float, Key("Frequency f", "Hz", above=0)]
    theta_x: Annotated[float, Key("Amplitude X", "rad", least=0, name="theta_x_rad")] = 0.0
    theta_y: Annotated[float, Key("Amplitude Y", "rad", least=0, name="theta_y_rad")] = 0.0
    phase: Annotated[float, Key("Phase P", "rad", name="phase_rad")] = 0.0
    acceleration_y: Annotated[
        float,
        Key(
            "Amplitude of the acceleration along y, of the phase P",
            "m/s^2",
            least=0,
            name="acceleration_y_m_s2",
        ),
    ] = 0.0


@dataclass(frozen=True)
class LineEnvironment:
    """A vibration of some lines, whose effects add up."""

    stated: tuple[Line, ...]

    @property
    def accelerates(self) -> bool:
        """Whether it has accelerations, see `Environment`."""
        return any(line.acceleration_y for line in self.stated)

    @property
    def highest_hz(self) -> float:
        """The highest frequency in Hz."""
        return max(line.frequency_hz for line in self.stated)

    def error(self, assessment: Assessment, step: Fraction, cycles: int | None = None) -> float:
        """Return the error of the mean rate, see `Environment.error`."""
        return abs(sum(self.errors(assessment, step, cycles)))

    def errors(self, assessment: Assessment, step: Fraction, cycles: int | None = None) -> list[float]:
        """Return the signed error of the mean rate of each line; parameters and errors are those of `error`."""
        return [
            assessment.rates(
                line.frequency_hz,
                step,
                theta_x=line.theta_x,
                theta_y=line.theta_y,
                phase=line.phase,
                acceleration_y=line.acceleration_y,
                cycles=cycles,
            ).error
            for line in self.stated
        ]

    def lines(self) -> tuple[Line, ...]:
        """Return the lines."""
        return self.stated


@dataclass(frozen=True)
class SpectralEnvironment:
    """A random vibration with a power spectral density."""

    spectrum: Spectrum

    @property
    def accelerates(self) -> bool:
        """Whether it has accelerations, see `Environment`."""
        return any(name.startswith("acceleration") for name in self.spectrum.transfers)

    @property
    def highest_hz(self) -> float:
        """The highest frequency in Hz."""
        return self.spectrum.edges[-1]

    def error(self, assessment: Assessment, step: Fraction, cycles: int | None = None) -> float:
        """Return the error of the mean rate, see `Environment.error`."""
        return abs(
            random_rates(assessment, self.spectrum, step, cycles=cycles, tolerance=_TOLERANCE).rates.error
        )

    def lines(self) -> tuple[Line, ...]:
        """Return lines at even distances df, of amplitudes c with c^2/2 = P |H|^2 df about each axis."""
        low, high = self.spectrum.edges[0], self.spectrum.edges[-1]
        width = (high - low) / _LINES
        hertz = low + (np.arange(_LINES) + 0.5) * width
        channels = self.spectrum.amplitudes(hertz)
        size = np.sqrt(2 * self.spectrum.densities(hertz) * width)
        still = np.zeros(_LINES, complex)
        x, y = (size * channels.get(f"angle_{axis}", still) for axis in "xy")
        return _lines(hertz, x, y)


@dataclass(frozen=True)
class RecordedEnvironment:
    """The vibration of a recording, as cross spectra of the angles about its axes."""

    #: (K,): frequencies in Hz at even distances
    hertz: NDArray[np.float64]
    #: (3, 3, K): one-sided densities S_ab of the angles in rad^2/Hz, with the complex conjugate of b
    densities: NDArray[np.complex128]

    @classmethod
    def read(cls, path: str | Path) -> RecordedEnvironment:
        """Return the vibration of a file of increments.

        The spectra are means over halfway overlapping parts of 1,024 samples under a Hann window.
        """
        recording = read_increments(path)
        count = len(recording.increments)
        if count < _FEWEST * _SEGMENT:
            raise InputError(
                f"{path} has {count} samples; a spectrum needs {_FEWEST * _SEGMENT} of them or more"
            )
        window = np.hanning(_SEGMENT + 1)[:-1]
        starts = range(0, count - _SEGMENT + 1, _SEGMENT // 2)
        parts = np.stack([recording.increments[k : k + _SEGMENT] for k in starts])
        parts = (parts - parts.mean(axis=1, keepdims=True)) * window[:, None]
        waves = np.fft.rfft(parts, axis=1)[:, 1:-1]
        interval = recording.interval
        power = 2 * interval / np.square(window).sum() / len(parts)
        densities = np.einsum("nka,nkb->abk", waves, waves.conj()) * power
        hertz = np.arange(1, _SEGMENT // 2) / (_SEGMENT * interval)
        # An increment is the difference of two angles.
        return cls(hertz, densities / np.square(2 * np.sin(np.pi * hertz * interval)))

    @property
    def accelerates(self) -> bool:
        """Whether it has accelerations: increments of angles have none."""
        return False

    @property
    def highest_hz(self) -> float:
        """The highest frequency in Hz."""
        return float(self.hertz[-1])

    def error(self, assessment: Assessment, step: Fraction, cycles: int | None = None) -> float:
        """Return the length of the error of the mean rate about all axes, see `Environment.error`."""
        if assessment.resonant and self.highest_hz * step >= 1:
            raise InputError(
                f"{assessment.kernel} takes {float(1 / step):g} Hz, whole periods in a step, for a turn and has no "
                f"mean rate there; the recording reaches to {self.highest_hz:g} Hz"
            )
        width = self.hertz[1] - self.hertz[0]
        factors = assessment.factors("error", self.hertz, step, cycles)
        axes = {"angle_x": 0, "angle_y": 1}
        errors = []
        for turn in range(3):  # about z, x and y in turn
            total = 0.0
            for (first, second), factor in factors.items():
                a, b = ((axes[name] + turn) % 3 for name in (first, second))
                total += float(2 * (factor * self.densities[a, b]).real.sum() * width)
            errors.append(total)
        return math.hypot(*errors)

    def lines(self) -> tuple[Line, ...]:
        """Return lines whose product of both amplitudes is that of x and y."""
        width = self.hertz[1] - self.hertz[0]
        size = np.sqrt(2 * self.densities[0, 0].real * width)
        y = 2 * self.densities[1, 0] * width / np.where(size > 0, size, 1)
        return _lines(self.hertz, size.astype(complex), y)


def _lines(hertz: Any, x: Any, y: Any) -> tuple[Line, ...]:
    """Return lines of complex amplitudes of the angles about x and y."""
    rows: Sequence[Any] = list(zip(hertz, np.abs(x), np.abs(y), np.angle(y) - np.angle(x), strict=True))
    return tuple(Line(*map(float, row)) for row in rows)
