"""Reads a brief: the environment, the gyro, the budget and the processor for which an algorithm is selected."""

from __future__ import annotations

from dataclasses import dataclass, fields
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any

from strapgen.analysis.vibration.spectrum import read_spectrum
from strapgen.catalogue.toml_files import UserFile
from strapgen.catalogue.toml_models import Key
from strapgen.design.environment import (
    Environment,
    Line,
    LineEnvironment,
    RecordedEnvironment,
    SpectralEnvironment,
)
from strapgen.ir.exceptions import InputError
from strapgen.lab.processors import PROCESSORS
from strapgen.targets.registry import TARGETS

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
    #: Both are None for a gyro that passes on everything
    bandwidth_hz: Annotated[
        Fraction | None, Key("Natural frequency of a gyro of second order", "Hz", above=0)
    ] = None
    damping: Annotated[Fraction | None, Key("Its damping ratio", "1", above=0)] = None

    def __post_init__(self) -> None:
        if (self.bandwidth_hz is None) != (self.damping is None):
            missing = "damping" if self.damping is None else "bandwidth_hz"
            raise InputError(f"{missing} is missing; bandwidth_hz and damping go together")

    def gain(self, frequency_hz: Any) -> Any:
        """Return the complex factor by which it passes on an oscillation at a frequency, or at many, in Hz."""
        if self.bandwidth_hz is None or self.damping is None:
            return 1.0 + 0.0 * frequency_hz
        ratio = frequency_hz / float(self.bandwidth_hz)
        return 1 / (1 - ratio**2 + 2j * float(self.damping) * ratio)


@dataclass(frozen=True)
class BudgetBrief:
    """What an algorithm may lose."""

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
    """What an algorithm may cost."""

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
    budget: Annotated[BudgetBrief, Key("What an algorithm may lose")]
    vibration: Annotated[VibrationFile, Key("The vibration; none without it")] = VibrationFile()
    processor: Annotated[ProcessorBrief, Key("What an algorithm may cost")] = ProcessorBrief()


BRIEF = UserFile("a brief", BriefFile, 100_000)


def read_brief(path: str | Path) -> DesignBrief:
    """Read a brief."""

    def brief(file: BriefFile) -> DesignBrief:
        environment = file.vibration.environment(Path(path).parent)
        return DesignBrief(file.max_rate_deg_s, environment, file.gyro, file.budget, file.processor)

    return BRIEF.convert(path, brief)


def files_of(path: str | Path) -> list[Path]:
    """Return the files that a brief is read from: its own, and that of its vibration."""
    vibration = BRIEF.read(path).vibration
    named = [name for name in (vibration.psd, vibration.recording) if name is not None]
    return [Path(path), *(Path(path).parent / name for name in named)]
