"""Responses of filters inside and outside the band, and the density of the rate from a vibration spectrum."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.analysis.vibration.spectrum import Spectrum
from strapgen.catalogue.methods.window import Window
from strapgen.design.filters.band_grid import (
    BITS,
    ONE,
    REAL,
    BandGrid,
    integer,
    magnitude,
    mean_points,
    search_grid,
)
from strapgen.design.filters.filter_taps import Shape, Unknowns
from strapgen.ir.exceptions import InputError

#: Frequencies up to half the sampling rate at which the gain of the filter of c_0 is searched.
_GAIN_POINTS = 2000


def level(window: Window, m: int) -> float:
    """Return the largest error of a filter over its band, for each unit of rate times the sampling interval.

    That of u of a pair is of its product with v, for each unit squared.

    >>> from strapgen.catalogue.methods.windows import WINDOWS
    >>> f"{level(WINDOWS['window-3-3'], 1):.6e}"
    '2.160751e-03'
    """
    grid = search_grid(window.band, window.total_increments - 1, window.gyro, increments=window.increments)
    errors = [magnitude(*e) for e in grid.errors(*_filter(window, m))]
    place = max(range(len(errors)), key=lambda k: errors[k])
    largest = errors[place]
    if not largest or place in (0, len(errors) - 1):
        return largest / ONE
    # A parabola through the point and its neighbours has the rest of the height.
    (x0, x1), (y0, y1) = (
        [float(grid.points[k] - grid.points[place]) for k in (place - 1, place + 1)],
        [errors[k] / largest - 1.0 for k in (place - 1, place + 1)],
    )
    curvature = (y1 / x1 - y0 / x0) / (x1 - x0)
    slope = y0 / x0 - curvature * x0
    return largest / ONE * (1.0 - (slope * slope / (4 * curvature) if curvature < 0 else 0.0))


def noise_gain(window: Window, m: int) -> float:
    """Return the root of the sum of squares of the taps: standard deviation of c_m by that of white increment noise.

    >>> from strapgen.catalogue.methods.windows import WINDOWS
    >>> round(noise_gain(WINDOWS["window-7-7"], 1), 3)
    0.731
    """
    return math.sqrt(sum(tap * tap for tap in window.filters[m]))


def largest_gain(window: Window) -> float:
    """Return the largest response of the filter of c_0 to a rate, up to half the sampling rate.

    The response is |sum_j F_0j A_j(b)|/N, with the gyro: 1 is a rate that is passed on unchanged.

    >>> from strapgen.catalogue.methods.windows import WINDOWS
    >>> largest_gain(WINDOWS["window-3-3"])
    1.0
    """
    b = np.linspace(0.0, np.pi, _GAIN_POINTS + 1)
    places = np.arange(window.total_increments) - window.previous
    response = np.exp(1j * np.outer(b, places)) @ np.array([float(tap) for tap in window.filters[0]])
    response = response * np.sinc(b / (2 * np.pi))
    if window.gyro is not None:
        response = response * window.gyro.gain(b * float(window.gyro.sample_hz or 0) / (2 * np.pi))
    return float(np.abs(response).max()) / window.increments


def errors(window: Window, m: int, points: Sequence[float]) -> NDArray[Any]:
    """Return the error of a filter in magnitude at frequencies.

    `points` (n,): angular frequencies in rad a sample, up to pi. Returns (n,): |sum_j F_j A_j - C_m|, for each
    unit of rate times the sampling interval.
    """
    grid = BandGrid(
        [REAL.mpf(b) for b in points], window.total_increments - 1, window.gyro, window.increments
    )
    return np.array([magnitude(*e) / ONE for e in grid.errors(*_filter(window, m))])


def polynomial_fit(window: Window) -> tuple[tuple[Fraction, ...], ...]:
    """Return the filters of the polynomial through all samples of a window, which other methods take.

    >>> from strapgen.catalogue.methods.windows import WINDOWS
    >>> [str(tap) for tap in polynomial_fit(WINDOWS["window-3-3"])[1][4:]]
    ['7843/20160', '-211/2520', '191/20160']
    """
    shape = Shape(window.previous, window.ahead, window.total_increments, window.gyro, window.increments)
    filters = []
    for m in range(len(window.filters)):
        unknowns = Unknowns(shape, m)
        filters.append(unknowns.taps(unknowns.complete([])))
    return tuple(filters)


def _filter(window: Window, m: int) -> tuple[int, list[int], int, list[int] | None]:
    """Return the arguments of `BandGrid.errors` for a filter."""
    lever = window.partner(m)
    taps, other = ([integer(tap) for tap in row or ()] for row in (window.filters[m], lever))
    return m, taps, window.previous, other if lever else None


#: Binary digits of a density by its mean. Its last digits in double precision depend on the machine; these do not.
_DIGITS = 30


def weights(spectrum: Spectrum, band: Fraction, sample_hz: Fraction) -> tuple[int, ...]:
    """Return the density of the rate at the frequencies of `band_grid.mean_points`, by its mean over these.

    The rate about x and y together has the density (2 pi f)^2 P (|H_x|^2 + |H_y|^2), P the density of the input and H
    its transfer functions to the angles.

    `band`: highest angular frequency in rad a sample. `sample_hz`: sampling frequency in Hz.

    >>> flat = Spectrum(lambda f: f**-2.0, {"angle_x": np.ones_like}, (1e-3, 100.0))
    >>> {weight >> BITS for weight in weights(flat, Fraction(1), Fraction(100))}
    {1}
    """
    hertz = np.array([float(b) for b in mean_points(band)]) * float(sample_hz) / (2 * np.pi)
    channels = spectrum.amplitudes(hertz)
    angles = [value for name, value in channels.items() if name.startswith("angle")]
    if not angles:
        raise InputError("the spectrum turns nothing; a column angle_x_rad or angle_y_rad is needed")
    inside = (hertz >= spectrum.edges[0]) & (hertz <= spectrum.edges[-1])
    power = sum(np.abs(value) ** 2 for value in angles)
    density = np.where(inside, spectrum.densities(hertz) * hertz**2 * power, 0.0)
    mean = density.mean()
    if not 0 < mean < np.inf:
        raise InputError(
            f"the spectrum has no motion below {float(band):g} rad a sample; a wider band is needed"
        )
    return tuple(round(value * 2**_DIGITS) << (BITS - _DIGITS) for value in map(float, density / mean))
