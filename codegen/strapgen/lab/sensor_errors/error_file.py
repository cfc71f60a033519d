"""Reads the errors of sensors from a TOML file, or those of a class of 1984 by name."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.catalogue import toml_files
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.units import STANDARD_GRAVITY
from strapgen.lab.sensor_errors.dither import dithered_laser_noise
from strapgen.lab.sensor_errors.instruments import (
    Heating,
    InstrumentErrors,
    OutputNoise,
    Sampling,
    TriadErrors,
    WarmUp,
)

Array = NDArray[np.float64]

#: Folder of the built-in classes, and their names: Savage's sensor paper, Table 1.
_FOLDER = Path(__file__).parent
CLASSES = ("ins-0.1", "ins-1", "ahrs", "midcourse")
#: A longer file is refused, and so is a number beyond the largest.
_MOST_BYTES, _LARGEST = 1 << 16, 1e9

_DEG_H = math.radians(1 / 3600)
_ARCSEC = math.radians(1 / 3600)
#: m/s^2 of a g.
_G = STANDARD_GRAVITY
_MICRO_G = _G * 1e-6

#: Numbers on three axes by key: the field, the factor to SI units, and whether they may be below zero.
_GYRO: dict[str, tuple[str, float, bool]] = {
    "bias_deg_h": ("bias", _DEG_H, True),
    "noise_deg_sqrt_h": ("noise", math.radians(1) / 60, False),
    "random_walk_deg_h_sqrt_h": ("random_walk", _DEG_H / 60, False),
    "pulse_arcsec": ("pulse", _ARCSEC, False),
}
_ACCELEROMETER: dict[str, tuple[str, float, bool]] = {
    "bias_ug": ("bias", _MICRO_G, True),
    "noise_ug_sqrt_hz": ("noise", _MICRO_G, False),
    "random_walk_ug_sqrt_h": ("random_walk", _MICRO_G / 60, False),
    "pulse_mm_s": ("pulse", 1e-3, False),
}
_BOTH: dict[str, tuple[str, float, bool]] = {
    "scale_plus_ppm": ("scale_plus", 1e-6, True),
    "scale_minus_ppm": ("scale_minus", 1e-6, True),
    "bandwidth_hz": ("bandwidth_hz", 1.0, False),
    "damping": ("damping", 1.0, False),
    "delay_s": ("delay", 1.0, False),
}
#: Tables of coefficients of the kernel ``imu-errors``: the letter, the factor to its units, and the elements.
_FULL = tuple(f"{row}{column}" for row in "xyz" for column in "xyz")
_GYRO_TERMS: dict[str, tuple[str, float, tuple[str, ...]]] = {
    "g_deg_h_g": ("B", _DEG_H / _G, ("xx", "xy", "xz", "yx", "yy", "yz", "zx")),
    "g2_deg_h_g2": ("E", _DEG_H / _G**2, ("xx", "xy", "xz", "yy", "yz")),
    "anisoinertia_s": ("J", 1.0, ("xy", "xz", "yz")),
}
_ACCELEROMETER_TERMS: dict[str, tuple[str, float, tuple[str, ...]]] = {
    "rate_m_s_rad": ("G", 1.0, _FULL),
    "rate_products_m": ("H", 1.0, ("xy", "xz", "yz")),
    "g2_ug_g2": ("N", 1e-6 / _G, ("xx", "xy", "xz", "yy", "yz", "zz")),
}
_LOST_AS = ("late", "repeat", "zero")
#: Least and largest of numbers that a run must be able to follow.
_LIMITS = {
    "bandwidth_hz": (1e-3, 1e6),
    "damping": (1e-2, 1e2),
    "delay_s": (0.0, 10.0),
    "jitter_s": (0.0, 1.0),
    "lost": (0.0, 0.99),
    "decay": (0.0, 0.999999),
    "tau_s": (1e-3, 1e9),
    "scale_ppm": (-5e5, 5e5),
    "scale_plus_ppm": (-5e5, 5e5),
    "scale_minus_ppm": (-5e5, 5e5),
    "misalignment_arcsec": (-2e5, 2e5),
}


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
    name = str(source)
    path = _FOLDER / f"{name}.toml" if name in CLASSES else checks.path("errors", source)
    tables = toml_files.content(path, "a file of sensor errors", _MOST_BYTES)
    try:
        return _parsed(tables)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def _parsed(tables: dict[str, Any]) -> InstrumentErrors:
    parts: dict[str, Callable[[InstrumentErrors, dict[str, Any]], InstrumentErrors]] = {
        "gyro": _with_gyro,
        "accelerometer": _with_accelerometer,
        "sampling": _with_sampling,
        "warm_up": _with_warm_up,
        "heating": _with_heating,
        "output_noise": _with_output_noise,
    }
    for key in tables:
        checks.choice("key", key, ("title", "class", "seed", "constants", *parts))
    errors = InstrumentErrors()
    if "class" in tables:
        errors = read(checks.choice("class", tables["class"], CLASSES))
    if "title" in tables:
        errors = replace(errors, title=checks.text("title", tables["title"]))
    if "constants" in tables:
        drawn = checks.choice("constants", tables["constants"], ("stated", "drawn")) == "drawn"
        errors = replace(errors, drawn=drawn)
    if "seed" in tables:
        errors = replace(errors, seed=checks.count("seed", tables["seed"], smallest=0, largest=2**63))
    for name, part in parts.items():
        if name in tables:
            if not isinstance(tables[name], dict):
                raise InputError(f"{name} is no table; [{name}] is needed")
            try:
                errors = part(errors, tables[name])
            except InputError as error:
                raise InputError(f"[{name}] {error}") from None
    return errors


def _with_gyro(errors: InstrumentErrors, table: dict[str, Any]) -> InstrumentErrors:
    dither = table.get("dither")
    if dither is None:
        return replace(errors, gyro=_triad(errors.gyro, table, _GYRO, _GYRO_TERMS))
    if "noise_deg_sqrt_h" in table:
        raise InputError("noise_deg_sqrt_h and dither are both there; one of them is needed")
    rest = {key: value for key, value in table.items() if key != "dither"}
    if not isinstance(dither, dict):
        raise InputError("dither is no table; lock_in_deg_s, dither_deg_s and fringes are needed")
    numbers = _numbers("dither", dither, ("lock_in_deg_s", "dither_deg_s", "fringes"))
    noise = np.full(3, dithered_laser_noise(*numbers))
    return replace(errors, gyro=replace(_triad(errors.gyro, rest, _GYRO, _GYRO_TERMS), noise=noise))


def _with_accelerometer(errors: InstrumentErrors, table: dict[str, Any]) -> InstrumentErrors:
    triad = _triad(errors.accelerometer, table, _ACCELEROMETER, _ACCELEROMETER_TERMS)
    return replace(errors, accelerometer=triad)


def _triad(
    triad: TriadErrors,
    table: dict[str, Any],
    keys: Mapping[str, tuple[str, float, bool]],
    terms: Mapping[str, tuple[str, float, tuple[str, ...]]],
) -> TriadErrors:
    """Return the errors of three sensors with those of a table in their place."""
    vectors = {**keys, **_BOTH}
    coefficients = dict(triad.terms)
    changes: dict[str, Any] = {}
    for key, value in table.items():
        checks.choice("key", key, (*vectors, "scale_ppm", "misalignment_arcsec", *terms))
        if key in vectors:
            field, factor, signed = vectors[key]
            changes[field] = _vector(key, value, signed) * factor
        elif key == "scale_ppm":
            if both := [name for name in ("scale_plus_ppm", "scale_minus_ppm") if name in table]:
                raise InputError(f"scale_ppm and {both[0]} are both there; one of them is needed")
            changes["scale_plus"] = changes["scale_minus"] = _vector(key, value, True) * 1e-6
        elif key == "misalignment_arcsec":
            changes["misalignment"] = _misalignment(key, value) * _ARCSEC
        else:
            letter, factor, elements = terms[key]
            coefficients |= _coefficients(key, value, letter, elements, factor)
    return replace(triad, terms=coefficients, **changes)


def _with_sampling(errors: InstrumentErrors, table: dict[str, Any]) -> InstrumentErrors:
    for key in table:
        checks.choice("key", key, ("jitter_s", "lost", "lost_as"))
    jitter, lost = (_number(key, table.get(key, 0.0)) for key in ("jitter_s", "lost"))
    lost_as = checks.choice("lost_as", table.get("lost_as", "late"), _LOST_AS)
    return replace(errors, sampling=Sampling(jitter, lost, lost_as))


def _with_warm_up(errors: InstrumentErrors, table: dict[str, Any]) -> InstrumentErrors:
    _need("warm_up", table, ("rate_deg_h", "tau_s"))
    rate, tau = _vector("rate_deg_h", table["rate_deg_h"], True), _vector("tau_s", table["tau_s"])
    return replace(errors, warm_up=WarmUp(rate * _DEG_H, tau))


def _with_heating(errors: InstrumentErrors, table: dict[str, Any]) -> InstrumentErrors:
    for key in table:
        checks.choice("key", key, ("gain_s2_rad2", "tau_s", "unbalance_deg_s_g"))
    gain = _vector("gain_s2_rad2", table.get("gain_s2_rad2", -2.6e-4), True)
    if (np.abs(gain) > 1).any():
        raise InputError("gain_s2_rad2 is beyond -1 to 1, and no gyro heats up so much")
    tau = _number("tau_s", table.get("tau_s", 150.0))
    unbalance = _number("unbalance_deg_s_g", table.get("unbalance_deg_s_g", 0.0))
    if unbalance < 0:
        raise InputError(f"unbalance_deg_s_g is {unbalance:g}; 0 or a number above is needed")
    return replace(errors, heating=Heating(gain, tau, math.radians(unbalance) / _G))


def _with_output_noise(errors: InstrumentErrors, table: dict[str, Any]) -> InstrumentErrors:
    _need("output_noise", table, ("decay", "rms_arcsec"))
    rms = _vector("rms_arcsec", table["rms_arcsec"]) * _ARCSEC
    return replace(errors, output_noise=OutputNoise(_number("decay", table["decay"]), rms))


def _need(what: str, table: dict[str, Any], keys: tuple[str, ...]) -> None:
    """Refuse a table that has other keys than these, or lacks one."""
    for key in table:
        checks.choice("key", key, keys)
    for key in keys:
        if key not in table:
            raise InputError(f"{what} has no {key}")


def _numbers(what: str, table: dict[str, Any], keys: tuple[str, ...]) -> list[float]:
    """Return numbers above zero, all of which a table must have."""
    _need(what, table, keys)
    values = [_number(key, table[key]) for key in keys]
    for key, value in zip(keys, values, strict=True):
        if value <= 0:
            raise InputError(f"{key} is {value:g}; a number above 0 is needed")
    return values


def _number(key: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(f"{key} is no number")
    least, largest = _LIMITS.get(key, (-_LARGEST, _LARGEST))
    if not least <= value <= largest:
        raise InputError(f"{key} is {value:g}; {least:g} to {largest:g} is possible")
    return float(value)


def _vector(key: str, value: Any, signed: bool = False, count: int = 3) -> Array:
    """Return numbers on axes; a single one stands for all of them."""
    values = value if isinstance(value, list) else [value] * count
    if len(values) != count:
        raise InputError(f"{key} has {len(values)} numbers; one or {count} are needed")
    numbers = np.array([_number(key, element) for element in values])
    if not signed and (numbers < 0).any():
        raise InputError(f"{key} is {numbers.min():g}; 0 or a number above is needed")
    return numbers


def _misalignment(key: str, value: Any) -> Array:
    """Return the angles xy, xz, yx, yz, zx, zy as a matrix."""
    matrix = np.zeros((3, 3))
    matrix[~np.eye(3, dtype=bool)] = _vector(key, value, True, 6)
    return matrix


def _coefficients(
    key: str, value: Any, letter: str, elements: tuple[str, ...], factor: float
) -> dict[str, float]:
    """Return coefficients of one term; a single number stands for all of its elements."""
    table = value if isinstance(value, dict) else dict.fromkeys(elements, value)
    for element in table:
        checks.choice(f"element of {key}", element, elements)
    return {f"{letter}_{element}": _number(key, number) * factor for element, number in table.items()}
