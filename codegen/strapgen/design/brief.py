"""Reads a brief: the environment, the gyro, the budget and the processor for which an algorithm is selected."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from strapgen.analysis.vibration.spectrum import read_spectrum
from strapgen.catalogue import toml_files
from strapgen.design.environment import (
    Environment,
    Line,
    LineEnvironment,
    RecordedEnvironment,
    SpectralEnvironment,
)
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.lab.cost.processors import PROCESSORS
from strapgen.targets.registry import TARGETS

#: A longer file is refused.
_MOST_BYTES = 100_000
#: The tables of a brief, with the keys of each.
_KEYS: dict[str, tuple[str, ...]] = {
    "vibration": ("lines", "psd", "recording"),
    "gyro": ("sample_hz", "noise_deg_sqrt_h", "pulse_arcsec", "bandwidth_hz", "damping"),
    "budget": ("drift_deg_h", "velocity_m_s", "position_m", "over_s", "software_share"),
    "processor": ("word", "operations_per_s", "instructions_per_s", "bytes", "cpu"),
}
_TOP = ("max_rate_deg_s", *_KEYS)
_LINE_KEYS = ("frequency_hz", "theta_x_rad", "theta_y_rad", "phase_rad", "acceleration_y_m_s2")
#: Part of the budget that the software may use where the brief does not say. The share is this project's own:
#: Savage's section 3.6 says that the algorithm cannot tolerate any errors whatsoever.
DEFAULT_SHARE = Fraction(1, 10)
_DEFAULT_OVER = Fraction(3600)
_DEFAULT_WORD, _DEFAULT_CPU = 32, "cortex-m3"
#: Largest sampling rate in Hz and largest number of steps of a budget's time.
_MOST_HZ, _MOST_SECONDS = 1_000_000, 1_000_000


@dataclass(frozen=True)
class GyroBrief:
    """The gyro of a brief."""

    #: Sampling rate in Hz
    sample_hz: Fraction
    #: Random walk of the angle on each axis in deg per root of an hour
    noise_deg_sqrt_h: float = 0.0
    #: Angle of a pulse; 0 for increments that are not quantized
    pulse_arcsec: Fraction = Fraction(0)
    #: Natural frequency and damping of a gyro of second order; None for one that passes on everything
    bandwidth_hz: Fraction | None = None
    damping: Fraction | None = None

    def gain(self, frequency_hz: Any) -> Any:
        """Return the complex factor by which it passes on an oscillation at a frequency, or at many, in Hz."""
        if self.bandwidth_hz is None or self.damping is None:
            return 1.0 + 0.0 * frequency_hz
        ratio = frequency_hz / float(self.bandwidth_hz)
        return 1 / (1 - ratio**2 + 2j * float(self.damping) * ratio)


@dataclass(frozen=True)
class BudgetBrief:
    """What an algorithm may lose."""

    #: Angle from the true attitude, divided by the time, of all causes together
    drift_deg_h: float
    #: The time in s over which errors add up
    over_s: Fraction = _DEFAULT_OVER
    #: Part of it that truncation, coning and rounding may use together
    software_share: float = float(DEFAULT_SHARE)
    #: Errors of velocity and position after that time, in which the same share belongs to sculling
    velocity_m_s: float | None = None
    position_m: float | None = None

    @property
    def limits_velocity(self) -> bool:
        """Whether velocity or position has a limit."""
        return self.velocity_m_s is not None or self.position_m is not None


@dataclass(frozen=True)
class ProcessorBrief:
    """What an algorithm may cost."""

    #: Bits of a word
    word: int = _DEFAULT_WORD
    #: Largest number of operations and of instructions a second, and bytes of code and constants
    operations_per_s: float | None = None
    instructions_per_s: float | None = None
    bytes: float | None = None
    #: The processor on which instructions and bytes are counted
    cpu: str = _DEFAULT_CPU

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


def read_brief(path: str | Path) -> DesignBrief:
    """Read a brief."""
    data = toml_files.content(path, "a brief", _MOST_BYTES, parse_float=str)
    try:
        return _brief(data, Path(path).parent)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def files_of(path: str | Path) -> list[Path]:
    """Return the files that a brief is read from: its own, and that of its vibration."""
    vibration = toml_files.content(path, "a brief", _MOST_BYTES, parse_float=str).get("vibration", {})
    named = [vibration[key] for key in ("psd", "recording") if key in vibration]
    return [Path(path), *(Path(path).parent / name for name in named)]


def _brief(data: Mapping[str, Any], folder: Path) -> DesignBrief:
    _check_keys("", data, _TOP)
    tables = {}
    for name, keys in _KEYS.items():
        table = data.get(name, {})
        if not isinstance(table, dict):
            raise InputError(f"{name} is no table; [{name}] with {', '.join(keys)} is needed")
        _check_keys(f"{name}.", table, keys)
        tables[name] = table
    gyro = _gyro(tables["gyro"])
    return DesignBrief(
        _needed(data, "", "max_rate_deg_s"),
        _environment(tables["vibration"], folder) if tables["vibration"] else None,
        gyro,
        _budget(tables["budget"]),
        _processor(tables["processor"]),
    )


def _check_keys(where: str, table: Mapping[str, Any], keys: tuple[str, ...]) -> None:
    """Refuse keys that are not known."""
    for key in table:
        checks.choice("key", f"{where}{key}", [f"{where}{name}" for name in keys])


def _needed(table: Mapping[str, Any], where: str, key: str) -> Fraction:
    """Return a number above 0 that a brief must have."""
    if key not in table:
        raise InputError(f"{where}{key} is missing; a number above 0 is needed")
    return _number(table, where, key, positive=True)


def _number(table: Mapping[str, Any], where: str, key: str, *, positive: bool = False) -> Fraction:
    """Return a number that is not below 0, or above it."""
    value = table[key]
    if isinstance(value, bool) or not isinstance(value, str | int):
        raise InputError(f"{where}{key} is {value!r}; a number is needed")
    number = checks.number(f"{where}{key}", value, positive=positive)
    if number < 0:
        raise InputError(f"{where}{key} is {float(number):g}; no number below 0 is allowed")
    return number


def _gyro(table: Mapping[str, Any]) -> GyroBrief:
    """Return the gyro of a table."""
    sample_hz = _needed(table, "gyro.", "sample_hz")
    if sample_hz > _MOST_HZ:
        raise InputError(f"gyro.sample_hz is {float(sample_hz):g}; at most {_MOST_HZ} is allowed")
    if ("bandwidth_hz" in table) != ("damping" in table):
        missing = "damping" if "bandwidth_hz" in table else "bandwidth_hz"
        raise InputError(f"gyro.{missing} is missing; bandwidth_hz and damping go together")
    both = [
        _number(table, "gyro.", key, positive=True) if key in table else None
        for key in ("bandwidth_hz", "damping")
    ]
    noise, pulse = (
        _number(table, "gyro.", key) if key in table else Fraction(0)
        for key in ("noise_deg_sqrt_h", "pulse_arcsec")
    )
    return GyroBrief(sample_hz, float(noise), pulse, *both)


def _budget(table: Mapping[str, Any]) -> BudgetBrief:
    """Return the budget of a table."""
    over = _number(table, "budget.", "over_s", positive=True) if "over_s" in table else _DEFAULT_OVER
    share = DEFAULT_SHARE
    if "software_share" in table:
        share = _number(table, "budget.", "software_share", positive=True)
    if share > 1:
        raise InputError(f"budget.software_share is {float(share):g}; at most 1 is allowed")
    if over > _MOST_SECONDS:
        raise InputError(f"budget.over_s is {float(over):g}; at most {_MOST_SECONDS} is allowed")
    velocity, position = (
        float(_number(table, "budget.", key, positive=True)) if key in table else None
        for key in ("velocity_m_s", "position_m")
    )
    drift = float(_needed(table, "budget.", "drift_deg_h"))
    return BudgetBrief(drift, over, float(share), velocity, position)


def _processor(table: Mapping[str, Any]) -> ProcessorBrief:
    """Return the processor of a table."""
    word = table.get("word", _DEFAULT_WORD)
    words = TARGETS["c-fixed"].words or ()
    if isinstance(word, bool) or word not in words:
        raise InputError(f"processor.word is {word!r}; {', '.join(map(str, words))} are allowed")
    operations, instructions, memory = (
        float(_number(table, "processor.", key, positive=True)) if key in table else None
        for key in ("operations_per_s", "instructions_per_s", "bytes")
    )
    cpu = checks.choice("processor.cpu", table.get("cpu", _DEFAULT_CPU), PROCESSORS)
    return ProcessorBrief(word, operations, instructions, memory, cpu)


def _environment(table: Mapping[str, Any], folder: Path) -> Environment:
    """Return the vibration of a table."""
    stated = [key for key in _KEYS["vibration"] if key in table]
    if len(stated) > 1:
        raise InputError(f"vibration has {' and '.join(stated)}; one of them is needed")
    (key,) = stated
    if key == "lines":
        return LineEnvironment(_lines(table[key]))
    if not isinstance(table[key], str):
        raise InputError(f"vibration.{key} is {table[key]!r}; the path of a file is needed")
    path = folder / table[key]
    return SpectralEnvironment(read_spectrum(path)) if key == "psd" else RecordedEnvironment.read(path)


def _lines(value: Any) -> tuple[Line, ...]:
    """Return the lines of a vibration."""
    if not isinstance(value, list) or not value or not all(isinstance(one, dict) for one in value):
        raise InputError(f"vibration.lines needs a list of tables with {', '.join(_LINE_KEYS)}")
    lines = []
    for number, one in enumerate(value, 1):
        where = f"vibration.lines {number}: "
        _check_keys(where, one, _LINE_KEYS)
        frequency = _needed(one, where, "frequency_hz")
        sizes = [
            float(_number(one, where, key)) if key in one else 0.0
            for key in ("theta_x_rad", "theta_y_rad", "acceleration_y_m_s2")
        ]
        phase = float(checks.number(f"{where}phase_rad", one.get("phase_rad", 0)))
        lines.append(Line(float(frequency), sizes[0], sizes[1], phase, sizes[2]))
    return tuple(lines)
