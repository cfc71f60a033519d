"""Reads a brief: the environment, the gyro, the budget and the processor for which an algorithm is selected.

The environment is a vibration: lines, a spectrum or a recording, with the mean rates that algorithms compute under it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from strapgen.analysis.vibration.mean_rates import Assessment
from strapgen.analysis.vibration.spectrum import Spectrum, random_rates, read_spectrum
from strapgen.catalogue.methods.sensor_response import INPUTS, Response, files_in, parse
from strapgen.catalogue.toml_models import Key, UserFile
from strapgen.ir.exceptions import InputError
from strapgen.ir.renamed import warn
from strapgen.lab.processors import PROCESSORS
from strapgen.lab.recordings.recording import read_increments
from strapgen.targets.registry import TARGETS

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
        count = len(recording.samples)
        if count < _FEWEST * _SEGMENT:
            raise InputError(
                f"{path} has {count} samples; a spectrum needs {_FEWEST * _SEGMENT} of them or more"
            )
        window = np.hanning(_SEGMENT + 1)[:-1]
        starts = range(0, count - _SEGMENT + 1, _SEGMENT // 2)
        parts = np.stack([recording.samples[k : k + _SEGMENT] for k in starts])
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


#: Part of the budget that the software may use where the brief does not say. The share is this project's own:
#: Savage's section 3.6 says that the algorithm cannot tolerate any errors whatsoever.
DEFAULT_SHARE = Fraction(1, 10)


@dataclass(frozen=True)
class GyroBrief:
    """The gyro of a brief."""

    sample_hz: Annotated[Fraction, Key("Sampling rate", "Hz", above=0, most=1_000_000)]
    noise_deg_sqrt_h: Annotated[
        float, Key("Random walk of the angle on each axis", "deg/sqrt(h)", least=0)
    ] = 0.0
    pulse_arcsec: Annotated[
        Fraction, Key("Angle of a pulse; 0 for increments that are not quantized", "arcsec", least=0)
    ] = Fraction(0)
    #: Both are old names of a response of second order
    bandwidth_hz: Annotated[
        Fraction | None, Key("Old: natural frequency of a response of second order", "Hz", above=0)
    ] = None
    damping: Annotated[Fraction | None, Key("Old: its damping ratio", "1", above=0)] = None
    #: A text has become a response once the brief is read
    response: Annotated[
        str | Response | None,
        Key("Response: a table, or as --response, a CSV file by its path from the brief's folder"),
    ] = None
    delay_s: Annotated[Fraction | None, Key("Delay", "s", least=0, most=10)] = None
    input: Annotated[
        str | None,
        Key("A sample is the integral over its interval, or the rate as that begins", choices=INPUTS),
    ] = None

    def __post_init__(self) -> None:
        if (self.bandwidth_hz is None) != (self.damping is None):
            missing = "damping" if self.damping is None else "bandwidth_hz"
            raise InputError(f"{missing} is missing; bandwidth_hz and damping go together")

        if self.bandwidth_hz is not None and self.response is not None:
            raise InputError("bandwidth_hz and response are both there; response is needed")

    def read(self, folder: Path) -> GyroBrief:
        """Return the gyro with the response that it states, whose file is in a folder."""
        own: Any = self.response or Response()
        if self.bandwidth_hz is not None:
            warn("gyro.bandwidth_hz", "gyro.response")
            own = Response(frequency_hz=self.bandwidth_hz, damping=self.damping)
        if isinstance(own, str):
            own = parse("gyro.response", own, folder)
        beside = {"delay_s": self.delay_s, "input": self.input}
        own = replace(own, **{key: value for key, value in beside.items() if value is not None})
        return replace(self, bandwidth_hz=None, damping=None, response=own.at(self.sample_hz))

    @property
    def seen(self) -> Response | None:
        """The response once the brief is read; None for a gyro whose samples are integrals of the rate."""
        return self.response if isinstance(self.response, Response) and self.response.changes else None

    def noise_ratio(self, rate_deg_s: Fraction) -> Fraction:
        """Return the standard deviation of an increment's noise and pulses by that of a rate."""
        # A random walk of N deg in a root of an hour is N / 60 in a root of a second.
        walk = self.noise_deg_sqrt_h / 60 / math.sqrt(self.sample_hz)
        size = math.hypot(walk, float(self.pulse_arcsec) / 3600 / math.sqrt(12))
        return Fraction(f"{size * self.sample_hz / rate_deg_s:.3e}")

    def gain(self, frequency_hz: Any) -> Any:
        """Return the complex factor by which it passes on an oscillation at a frequency, or at many, in Hz."""
        return (self.seen or Response()).gain(frequency_hz)


@dataclass(frozen=True)
class BudgetBrief:
    """Limits of the errors."""

    drift_deg_h: Annotated[
        float,
        Key("Angle from the true attitude by all causes together, divided by the time", "deg/h", above=0),
    ]
    over_s: Annotated[Fraction, Key("Time over which errors add up", "s", above=0, most=1_000_000)] = (
        Fraction(3600)
    )
    software_share: Annotated[
        float, Key("Part that truncation, coning and rounding may use together", "1", above=0, most=1)
    ] = float(DEFAULT_SHARE)
    #: The same share of both belongs to sculling
    velocity_m_s: Annotated[float | None, Key("Error of velocity after that time", "m/s", above=0)] = None
    position_m: Annotated[float | None, Key("Error of position after that time", "m", above=0)] = None

    @property
    def limits_velocity(self) -> bool:
        """Whether velocity or position has a limit."""
        return self.velocity_m_s is not None or self.position_m is not None


@dataclass(frozen=True)
class ProcessorBrief:
    """Limits of the cost."""

    word: Annotated[int, Key("Length of a word", "bit", choices=TARGETS["c-fixed"].words or ())] = 32
    operations_per_s: Annotated[float | None, Key("Most operations", "1/s", above=0)] = None
    instructions_per_s: Annotated[float | None, Key("Most instructions", "1/s", above=0)] = None
    bytes: Annotated[float | None, Key("Most bytes of code and constants", "byte", above=0)] = None
    cpu: Annotated[str, Key("Processor on which instructions and bytes are counted", choices=PROCESSORS)] = (
        "cortex-m3"
    )

    @property
    def is_measured(self) -> bool:
        """Whether candidates must be compiled for the processor."""
        return self.instructions_per_s is not None or self.bytes is not None


@dataclass(frozen=True)
class DesignBrief:
    """An environment, a gyro, a budget and a processor."""

    #: Largest rate about an axis, vibration included
    max_rate_deg_s: Fraction
    #: The vibration; None without one
    environment: Environment | None
    gyro: GyroBrief
    budget: BudgetBrief
    processor: ProcessorBrief


@dataclass(frozen=True)
class VibrationFile:
    """The vibration of a brief: lines, a spectrum or a recording."""

    lines: Annotated[tuple[Line, ...] | None, Key("Vibrations at one frequency each", least=1)] = None
    psd: Annotated[
        str | None, Key("CSV file of a power spectral density, its path from the brief's folder")
    ] = None
    recording: Annotated[
        str | None, Key("CSV file of recorded increments, its path from the brief's folder")
    ] = None

    def __post_init__(self) -> None:
        stated = [field.name for field in fields(self) if getattr(self, field.name) is not None]
        if len(stated) > 1:
            raise InputError(f"the keys {' and '.join(stated)} are there; one of them is needed")

    def environment(self, folder: Path) -> Environment | None:
        """Return the vibration; paths begin at a folder."""
        if self.lines is not None:
            return LineEnvironment(self.lines)
        if self.psd is not None:
            return SpectralEnvironment(read_spectrum(folder / self.psd))
        return None if self.recording is None else RecordedEnvironment.read(folder / self.recording)


@dataclass(frozen=True)
class BriefFile:
    """The environment, the gyro, the budget and the processor for which an algorithm is selected."""

    max_rate_deg_s: Annotated[
        Fraction, Key("Largest rate about an axis, vibration included", "deg/s", above=0)
    ]
    gyro: Annotated[GyroBrief, Key("The gyro")]
    budget: Annotated[BudgetBrief, Key("Limits of the errors")]
    vibration: Annotated[VibrationFile, Key("The vibration; none without it")] = VibrationFile()
    processor: Annotated[ProcessorBrief, Key("Limits of the cost")] = ProcessorBrief()


BRIEF = UserFile("a brief", BriefFile, 100_000)


def read_brief(path: str | Path) -> DesignBrief:
    """Read a brief."""

    def brief(file: BriefFile) -> DesignBrief:
        environment = file.vibration.environment(Path(path).parent)
        gyro = file.gyro.read(Path(path).parent)
        return DesignBrief(file.max_rate_deg_s, environment, gyro, file.budget, file.processor)

    return BRIEF.convert(path, brief)


def files_of(path: str | Path) -> list[Path]:
    """Return the files of a brief: its own, that of its vibration, and that of its gyro's response."""
    file = BRIEF.read(path)
    named = [name for name in (file.vibration.psd, file.vibration.recording) if name is not None]
    named += files_in(file.gyro.response) if isinstance(file.gyro.response, str) else []
    return [Path(path), *(Path(path).parent / name for name in named)]
