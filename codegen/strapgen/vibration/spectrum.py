"""Random vibration: spectra from functions or a file, and the mean rates under them, equations (68) to (83)."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from strapgen.exceptions import InputError
from strapgen.vibration.assessment import Assessment, Rates
from strapgen.vibration.quadrature import integrate

Array = NDArray[Any]

#: What a transfer function leads to, and its unit for an input of unit 1.
TRANSFERS = {"angle_x": "rad", "angle_y": "rad", "acceleration_x": "m_s2", "acceleration_y": "m_s2"}


@dataclass(frozen=True)
class Spectrum:
    """A stationary random input and what it shakes.

    The input n has the one-sided power spectral density P, E[n^2] being the integral of P over frequencies in Hz.
    An angle or acceleration follows it by its transfer function H: for n = Re(c exp(j omega t)) it is
    Re(H c exp(j omega t)). All functions take an array of frequencies in Hz, (N,), and return one of that shape.

    Parameters
    ----------
    density : callable
        P in the unit of n squared, per Hz.
    transfers : dict of str to callable
        Complex transfer functions: "angle_x" and "angle_y" in rad, "acceleration_x" and "acceleration_y" in m/s^2, each
        per unit of n. What is left out does not move.
    edges : tuple of float
        Rising frequencies in Hz: the lowest and the highest, and between them all where a function or its slope jumps.

    Raises
    ------
    InputError
        If a transfer function has another name, or the edges do not rise from 0 or above.

    Examples
    --------
    >>> turning = {"angle_x": np.ones_like, "angle_y": lambda f: -1j + 0 * f}
    >>> flat = Spectrum(lambda f: 1e-6 + 0 * f, turning, (5.0, 50.0))
    >>> sorted(flat.amplitudes(np.array([10.0])))
    ['angle_x', 'angle_y']
    """

    density: Callable[[Array], Array]
    transfers: Mapping[str, Callable[[Array], Array]]
    edges: tuple[float, ...]

    def __post_init__(self) -> None:
        for name in self.transfers:
            if name not in TRANSFERS:
                raise InputError(f"transfer function {name!r} is not known; allowed: {', '.join(TRANSFERS)}")
        rising = all(low < high for low, high in pairwise(self.edges))
        if len(self.edges) < 2 or self.edges[0] < 0 or not rising or not math.isfinite(self.edges[-1]):
            raise InputError(
                "the edges of a spectrum must be two rising frequencies in Hz or more, from 0 or above"
            )

    def amplitudes(self, hertz: Array) -> dict[str, Array]:
        """Return the transfer functions of the channels: angles, and velocities in place of accelerations."""
        found = {}
        for name, function in self.transfers.items():
            values = np.asarray(function(hertz), complex)
            if name.startswith("acceleration"):
                values = values / (2j * np.pi * hertz)
            found[name.replace("acceleration", "velocity")] = values
        return found


class RandomRates(NamedTuple):
    """Mean rates under a spectrum, with the error that their integrals may have.

    Parameters
    ----------
    rates : Rates
    quadrature : Rates
        Estimated error of the integral of each; for that of computed the sum of both others.
    """

    rates: Rates
    quadrature: Rates


def random_rates(
    assessment: Assessment,
    spectrum: Spectrum,
    step: float | str | Fraction,
    *,
    cycles: int | None = None,
    tolerance: float = 1e-10,
) -> RandomRates:
    """Return the mean rates about z under a random vibration.

    An oscillation of amplitude c in a band df is as strong as P df = |c|^2/2: the integrand is twice the real part of
    the factor of each pair of channels times one transfer function and the conjugate of the other, times P.

    Parameters
    ----------
    assessment : Assessment
    spectrum : Spectrum
    step, cycles
        As for `Assessment.rates`.
    tolerance : float, optional
        Error that is allowed to the integrals, relative to those of the magnitudes.

    Returns
    -------
    RandomRates

    Raises
    ------
    InputError
        If a function is not finite, or the integral does not settle.
    """
    parts = ("continuous", "error")
    longest = float(max(assessment.lengths(step, cycles).values()))
    if assessment.resonant and spectrum.edges[-1] * longest >= 1:
        raise InputError(
            f"{assessment.kernel} takes {1 / longest:g} Hz, whole periods in a step, for a turn and has no mean rate "
            f"there; the spectrum reaches to {spectrum.edges[-1]:g} Hz"
        )

    def integrand(hertz: Array) -> Array:
        moved = spectrum.amplitudes(hertz)
        density = np.asarray(spectrum.density(hertz), float)
        rows = []
        for part in parts:
            total = np.zeros(len(hertz))
            for (first, second), factor in assessment.factors(part, hertz, step, cycles).items():
                if first in moved and second in moved:
                    total = total + 2 * (factor * moved[first] * moved[second].conj()).real
            rows.append(total * density)
        return np.array(rows)

    found = integrate(integrand, spectrum.edges, 1 / longest, tolerance)
    continuous, error = map(float, found.values)
    spread = list(map(float, found.errors))
    return RandomRates(Rates(continuous, continuous + error, error), Rates(spread[0], sum(spread), spread[1]))


def read_spectrum(path: str | Path) -> Spectrum:
    """Read a spectrum from a file of comma-separated values.

    The first line names the columns: ``frequency_hz``; ``density``, in the unit of the input squared per Hz; and any
    of ``angle_x_rad``, ``angle_y_rad``, ``acceleration_x_m_s2``, ``acceleration_y_m_s2``, the magnitudes of the
    transfer functions per unit of the input, each with its phase in rad beside it, for instance ``angle_y_phase_rad``;
    a phase that is left out is zero. Between the rows, whose frequencies rise, the logarithm of the density is a
    straight line against that of frequency, as vibration is specified, or the density where it is zero at an end;
    magnitudes and phases are straight lines against frequency. Outside the rows nothing vibrates.

    Parameters
    ----------
    path : path

    Returns
    -------
    Spectrum

    Raises
    ------
    InputError
        If the file cannot be read, or a column, a number or the order of the rows is not as it must be.
    """
    columns = _columns(Path(path))
    hertz, density = columns["frequency_hz"], columns["density"]
    transfers = {}
    for name, unit in TRANSFERS.items():
        if f"{name}_{unit}" in columns:
            size = columns[f"{name}_{unit}"]
            phase = columns.get(f"{name}_phase_rad", np.zeros(len(hertz)))
            transfers[name] = _transfer(hertz, size, phase)
    return Spectrum(_density(hertz, density), transfers, tuple(map(float, hertz)))


def _transfer(hertz: Array, size: Array, phase: Array) -> Callable[[Array], Array]:
    def transfer(at: Array) -> Array:
        values: Array = np.interp(at, hertz, size) * np.exp(1j * np.interp(at, hertz, phase))
        return values

    return transfer


def _density(hertz: Array, density: Array) -> Callable[[Array], Array]:
    def straight(at: Array) -> Array:
        values: Array = np.interp(at, hertz, density)
        place = np.clip(np.searchsorted(hertz, at, side="right") - 1, 0, len(hertz) - 2)
        low, high = hertz[place], hertz[place + 1]
        ends = density[place], density[place + 1]
        curved = (low > 0) & (ends[0] > 0) & (ends[1] > 0) & (at > 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = np.log(ends[1] / ends[0]) / np.log(high / low)
            power = ends[0] * (at / low) ** slope
        return np.where(curved, power, values)

    return straight


def _columns(path: Path) -> dict[str, Array]:
    allowed = ["frequency_hz", "density"]
    for name, unit in TRANSFERS.items():
        allowed += [f"{name}_{unit}", f"{name}_phase_rad"]
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [
                (number, row) for number, row in enumerate(csv.reader(file), 1) if any(map(str.strip, row))
            ]
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path} is no text file of comma-separated values ({error})") from None
    if len(rows) < 3:
        raise InputError(f"{path} holds {max(0, len(rows) - 1)} rows below its header; at least 2 are needed")
    header = [cell.strip().lower() for cell in rows[0][1]]
    for name in header:
        if name not in allowed:
            raise InputError(f"{path}: column {name!r} is not known; allowed: {', '.join(allowed)}")
        if header.count(name) > 1:
            raise InputError(f"{path}: column {name!r} is there twice")
        if name.endswith("_phase_rad"):
            of = name.removesuffix("_phase_rad")
            if f"{of}_{TRANSFERS[of]}" not in header:
                raise InputError(f"{path}: column {name!r} has no column {of}_{TRANSFERS[of]} beside it")
    for name in allowed[:2]:
        if name not in header:
            raise InputError(f"{path}: no column {name!r}")
    if not any(f"{name}_{unit}" in header for name, unit in TRANSFERS.items()):
        raise InputError(f"{path}: nothing moves; a column {', '.join(allowed[2::2])} is needed")
    values = [_numbers(path, line, row, header) for line, row in rows[1:]]
    columns = dict(zip(header, np.array(values).T, strict=True))
    for (line, _), low, high in zip(rows[2:], *_neighbours(columns["frequency_hz"]), strict=True):
        if not low < high:
            raise InputError(f"{path}, line {line}: frequency_hz {high:g} does not rise above {low:g}")
    for name in header:
        lowest = columns[name].min()
        if lowest < 0 and not name.endswith("_phase_rad"):
            raise InputError(f"{path}: {name} is {lowest:g} in a row; no number below 0 is allowed")
    return columns


def _neighbours(values: Array) -> tuple[Array, Array]:
    return values[:-1], values[1:]


def _numbers(path: Path, line: int, row: list[str], header: list[str]) -> list[float]:
    if len(row) != len(header):
        raise InputError(f"{path}, line {line}: {len(row)} cells; {len(header)} are needed")
    found = []
    for cell, name in zip(row, header, strict=True):
        try:
            number = float(cell)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise InputError(f"{path}, line {line}: {name} is {cell.strip()!r}; a finite number is needed")
        found.append(number)
    return found
