"""Reads the errors of sensors from a TOML file, or those of a class of 1984 by name."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from strapgen.catalogue import toml_models
from strapgen.catalogue.methods.sensor_response import Response, parse
from strapgen.catalogue.toml_models import Key, UserFile
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.renamed import warn
from strapgen.ir.units import STANDARD_GRAVITY
from strapgen.lab.sensor_errors.instruments import (
    Heating,
    InstrumentErrors,
    OutputNoise,
    Sampling,
    TriadErrors,
    WarmUp,
    dithered_laser_noise,
    second_order,
)

Array = NDArray[np.float64]

#: Folder of the built-in classes, and their names: Savage's sensor paper, Table 1.
_FOLDER = Path(__file__).parent
CLASSES = ("ins-0.1", "ins-1", "ahrs", "midcourse")

_DEG_H, _ARCSEC = math.radians(1 / 3600), math.radians(1 / 3600)
#: m/s^2 of a g.
_G = STANDARD_GRAVITY
#: Factors of units of triads to SI units, where they are not 1.
_SI = {
    "deg/s": math.radians(1),
    "deg/h": _DEG_H,
    "deg/sqrt(h)": math.radians(1) / 60,
    "deg/h/sqrt(h)": _DEG_H / 60,
    "arcsec": _ARCSEC,
    "deg/h/g": _DEG_H / _G,
    "deg/h/g^2": _DEG_H / _G**2,
    "micro-g": _G * 1e-6,
    "micro-g/sqrt(Hz)": _G * 1e-6,
    "micro-g/sqrt(h)": _G * 1e-6 / 60,
    "micro-g/g^2": 1e-6 / _G,
    "mm/s": 1e-3,
    "ppm": 1e-6,
}
_LARGEST = 1e9

#: Numbers about x, y and z, or one for all; angles xy, xz, yx, yz, zx, zy; elements of a term, or one for all.
Vector = float | tuple[float, float, float]
Angles = float | tuple[float, float, float, float, float, float]
Term = float | Mapping[str, float]


def _of(text: str, unit: str, name: str, least: float = -_LARGEST, most: float = _LARGEST) -> Key:
    return Key(text, unit, name=name, least=least, most=most)


def _term(text: str, unit: str, name: str, *elements: str) -> Key:
    return Key(text, unit, name=name, names=elements, least=-_LARGEST, most=_LARGEST)


@dataclass(frozen=True)
class TriadFile:
    """Errors of three sensors: fields of `TriadErrors`; a capital letter is a term of the kernel ``imu-errors``."""

    bandwidth_hz: Annotated[
        Vector | None,
        _of("Old: natural frequency of a response of second order", "Hz", "bandwidth_hz", 1e-3, 1e6),
    ] = None
    damping: Annotated[Vector | None, _of("Old: its damping ratio", "1", "damping", 1e-2, 1e2)] = None
    response: Annotated[
        str | Response | tuple[str, str, str] | None,
        Key(
            "Response, or that of each axis: a table, or as --response, a CSV file by its path from the folder"
        ),
    ] = None
    delay: Annotated[Vector | None, _of("Delay", "s", "delay_s", 0, 10)] = None
    scale: Annotated[Vector | None, _of("Error of the scale factor", "ppm", "scale_ppm", -5e5, 5e5)] = None
    scale_plus: Annotated[
        Vector | None, _of("The same, for increments above zero", "ppm", "scale_plus_ppm", -5e5, 5e5)
    ] = None
    scale_minus: Annotated[
        Vector | None, _of("The same, for increments below zero", "ppm", "scale_minus_ppm", -5e5, 5e5)
    ] = None
    misalignment: Annotated[
        Angles | None,
        _of(
            "Angles xy, xz, yx, yz, zx, zy: sensor, axis that it senses",
            "arcsec",
            "misalignment_arcsec",
            -2e5,
            2e5,
        ),
    ] = None

    def __post_init__(self) -> None:
        if self.response is not None and self.bandwidth_hz is not None:
            raise InputError("bandwidth_hz and response are both there; response is needed")
        for name in ("scale_plus", "scale_minus"):
            if self.scale is not None and getattr(self, name) is not None:
                raise InputError(f"scale_ppm and {name}_ppm are both there; one of them is needed")

    def changed(self, triad: TriadErrors, folder: Path) -> TriadErrors:
        """Return errors with those that are stated in their place; the file of a response is in a folder."""
        changes: dict[str, Any] = {}
        if self.bandwidth_hz is not None:
            warn("bandwidth_hz", "response")
            changes["response"] = second_order(self.bandwidth_hz, self.damping)
        elif self.response is not None:
            several = self.response if isinstance(self.response, tuple) else (self.response,) * 3
            changes["response"] = tuple(
                parse("response", one, folder) if isinstance(one, str) else one for one in several
            )
        terms = dict(triad.terms)
        for name, key in toml_models.keys(type(self)).items():
            value, factor = getattr(self, name), _SI.get(key.unit, 1.0)
            if value is None or name in ("dither", "response", "bandwidth_hz", "damping"):
                continue
            if key.names:
                elements = value if isinstance(value, Mapping) else dict.fromkeys(key.names, value)
                terms |= {f"{name}_{element}": number * factor for element, number in elements.items()}
            elif name == "misalignment":
                changes[name] = np.zeros((3, 3))
                changes[name][~np.eye(3, dtype=bool)] = np.array(value) * factor
            else:
                for field in ("scale_plus", "scale_minus") if name == "scale" else (name,):
                    changes[field] = _vector(value) * factor
        return replace(triad, terms=terms, **changes)


@dataclass(frozen=True)
class DitherFile:
    """A dithered laser gyro, whose noise comes from its lock-in."""

    lock_in_deg_s: Annotated[float, Key("Lock-in rate", "deg/s", above=0, most=_LARGEST)]
    dither_deg_s: Annotated[
        float, Key("Amplitude of the rate of the dither", "deg/s", above=0, most=_LARGEST)
    ]
    fringes: Annotated[float, Key("Fringes in a turn", "1", above=0, most=_LARGEST)]


@dataclass(frozen=True)
class GyroFile(TriadFile):
    """Errors of the gyros."""

    bias: Annotated[Vector | None, _of("Bias", "deg/h", "bias_deg_h")] = None
    noise: Annotated[Vector | None, _of("White noise of the rate", "deg/sqrt(h)", "noise_deg_sqrt_h", 0)] = (
        None
    )
    random_walk: Annotated[
        Vector | None, _of("Random walk of the bias", "deg/h/sqrt(h)", "random_walk_deg_h_sqrt_h", 0)
    ] = None
    pulse: Annotated[Vector | None, _of("Angle of a pulse; 0 for none", "arcsec", "pulse_arcsec", 0)] = None
    lock_in: Annotated[
        Vector | None,
        _of(
            "Rate below which a ring laser without a dither is locked", "deg/s", "lock_in_deg_s", 0, _LARGEST
        ),
    ] = None
    B: Annotated[
        Term | None,
        _term("Drift by acceleration", "deg/h/g", "g_deg_h_g", "xx", "xy", "xz", "yx", "yy", "yz", "zx"),
    ] = None
    E: Annotated[
        Term | None,
        _term("Drift by products of accelerations", "deg/h/g^2", "g2_deg_h_g2", "xx", "xy", "xz", "yy", "yz"),
    ] = None
    J: Annotated[
        Term | None, _term("Drift by products of rates", "s", "anisoinertia_s", "xy", "xz", "yz")
    ] = None
    dither: Annotated[DitherFile | None, Key("A dithered laser gyro, in place of a noise")] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.noise is not None and self.dither is not None:
            raise InputError("noise_deg_sqrt_h and dither are both there; one of them is needed")
        if self.lock_in is not None and self.dither is not None:
            raise InputError(
                "lock_in_deg_s and dither are both there; a dithered gyro has the noise of its lock-in"
            )

    def changed(self, triad: TriadErrors, folder: Path) -> TriadErrors:
        """Return errors with those that are stated in their place."""
        triad = super().changed(triad, folder)
        if self.dither is None:
            return triad
        numbers = self.dither.lock_in_deg_s, self.dither.dither_deg_s, self.dither.fringes
        return replace(triad, noise=np.full(3, dithered_laser_noise(*numbers)))


@dataclass(frozen=True)
class AccelerometerFile(TriadFile):
    """Errors of the accelerometers."""

    bias: Annotated[Vector | None, _of("Bias", "micro-g", "bias_ug")] = None
    noise: Annotated[
        Vector | None, _of("White noise of the acceleration", "micro-g/sqrt(Hz)", "noise_ug_sqrt_hz", 0)
    ] = None
    random_walk: Annotated[
        Vector | None, _of("Random walk of the bias", "micro-g/sqrt(h)", "random_walk_ug_sqrt_h", 0)
    ] = None
    pulse: Annotated[Vector | None, _of("Velocity of a pulse; 0 for none", "mm/s", "pulse_mm_s", 0)] = None
    G: Annotated[
        Term | None,
        _term(
            "Error by rate",
            "m/s/rad",
            "rate_m_s_rad",
            *(f"{row}{column}" for row in "xyz" for column in "xyz"),
        ),
    ] = None
    H: Annotated[
        Term | None, _term("Error by products of rates", "m", "rate_products_m", "xy", "xz", "yz")
    ] = None
    N: Annotated[
        Term | None,
        _term(
            "Error by products of accelerations",
            "micro-g/g^2",
            "g2_ug_g2",
            "xx",
            "xy",
            "xz",
            "yy",
            "yz",
            "zz",
        ),
    ] = None


@dataclass(frozen=True)
class WarmUpFile:
    """A rate that begins at switch-on, rate (1 - exp(-t/tau))."""

    rate_deg_h: Annotated[Vector, Key("Steady rate", "deg/h", least=-_LARGEST, most=_LARGEST)]
    tau_s: Annotated[Vector, Key("Time constant", "s", least=1e-3, most=1e9)]


@dataclass(frozen=True)
class HeatingFile:
    """Scale factors of torqued gyros that change with the heat of their torquers."""

    gain_s2_rad2: Annotated[
        Vector, Key("Steady deviation of the scale factor", "s^2/rad^2", least=-1, most=1)
    ] = -2.6e-4
    tau_s: Annotated[float, Key("Time constant", "s", least=1e-3, most=1e9)] = 150.0
    unbalance_deg_s_g: Annotated[
        float, Key("Mass unbalance of the gyros", "deg/s/g", least=0, most=_LARGEST)
    ] = 0.0


@dataclass(frozen=True)
class OutputNoiseFile:
    """Noise of an output whose sum stays bounded, b[n] = A b[n-1] + (1 - A)(w[n] - w[n-1])."""

    decay: Annotated[float, Key("A", "1", least=0, most=0.999999)]
    rms_arcsec: Annotated[Vector, Key("Standard deviation of w", "arcsec", least=0, most=_LARGEST)]


@dataclass(frozen=True)
class ErrorFile:
    """The errors of three gyros and three accelerometers; the default is that of the class, or zero."""

    title: Annotated[str | None, Key("Title in reports")] = None
    base: Annotated[
        str | None, Key("Class of 1984 whose errors the file changes", choices=CLASSES, name="class")
    ] = None
    constants: Annotated[
        str | None,
        Key(
            "Whether biases, scale factors, misalignments and terms are the values, or standard deviations of them",
            choices=("stated", "drawn"),
        ),
    ] = None
    seed: Annotated[int | None, Key("Seed of the random numbers", "1", least=0, most=2**63)] = None
    gyro: Annotated[GyroFile, Key("Errors of the gyros")] = GyroFile()
    accelerometer: Annotated[AccelerometerFile, Key("Errors of the accelerometers")] = AccelerometerFile()
    sampling: Annotated[Sampling | None, Key("Errors of the samples")] = None
    warm_up: Annotated[WarmUpFile | None, Key("A rate that begins at switch-on")] = None
    heating: Annotated[HeatingFile | None, Key("Heating of the torquers")] = None
    output_noise: Annotated[OutputNoiseFile | None, Key("Noise of an output whose sum stays bounded")] = None

    def errors(self, folder: Path = Path()) -> InstrumentErrors:
        """Return the errors in SI units; the file of a response is in a folder."""
        errors = InstrumentErrors() if self.base is None else read(self.base)
        warm, heat, noise = self.warm_up, self.heating, self.output_noise
        parts = {
            "title": self.title,
            "seed": self.seed,
            "drawn": None if self.constants is None else self.constants == "drawn",
            "gyro": self.gyro.changed(errors.gyro, folder),
            "accelerometer": self.accelerometer.changed(errors.accelerometer, folder),
            "sampling": self.sampling,
            "warm_up": warm and WarmUp(_vector(warm.rate_deg_h) * _DEG_H, _vector(warm.tau_s)),
            "heating": heat
            and Heating(_vector(heat.gain_s2_rad2), heat.tau_s, math.radians(heat.unbalance_deg_s_g) / _G),
            "output_noise": noise and OutputNoise(noise.decay, _vector(noise.rms_arcsec) * _ARCSEC),
        }
        return replace(errors, **{name: part for name, part in parts.items() if part is not None})  # type: ignore[arg-type]


def _vector(value: Vector) -> Array:
    """Return numbers about x, y and z."""
    return np.full(3, value, float)


ERRORS = UserFile("a file of sensor errors", ErrorFile, 1 << 16)


def path_of(source: str | Path) -> Path:
    """Return the file of sensor errors, or of a class."""
    return _FOLDER / f"{source}.toml" if str(source) in CLASSES else checks.path("errors", source)


def read(source: str | Path) -> InstrumentErrors:
    """Read the errors of sensors.

    Parameters
    ----------
    source : path
        A TOML file, or the name of a class: "ins-0.1", "ins-1", "ahrs" or "midcourse".

    Returns
    -------
    InstrumentErrors

    Raises
    ------
    InputError
        If it cannot be read, or a key or a number is not allowed; one line names it.

    Examples
    --------
    >>> errors = read("ins-1")
    >>> errors.drawn, (errors.gyro.bias / np.radians(1 / 3600)).round(6).tolist()
    (True, [0.01, 0.01, 0.01])
    """
    path = path_of(source)
    return ERRORS.convert(path, lambda file: file.errors(Path(path).parent))
