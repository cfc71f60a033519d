"""A spectrum of vibration as lines, for the design of coning coefficients."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from strapgen.analysis.vibration.spectrum import Spectrum
from strapgen.catalogue.methods.window import GyroResponse
from strapgen.design.filters.band_grid import REAL
from strapgen.ir.exceptions import InputError

#: Number of lines.
LINES = 400
#: Weight of every line beside that of the spectrum, by the largest one: it decides where there is no vibration.
_LEAST = 1e-6
#: Binary digits of a weight by the largest one: the last digits in double precision depend on the machine.
_DIGITS = 30


@dataclass(frozen=True)
class Lines:
    """Lines of a vibration about x and y, at equal distances in frequency.

    >>> lines = Lines((10.0, 20.0), (1e-6, 4e-6), (2e-6, 8e-6), Fraction(100))
    >>> [float(b) for b in lines.radians]
    [0.6283185307179586, 1.2566370614359172]
    >>> [round(float(weight), 7) for weight in lines.worst_weights]
    [0.250001, 1.000001]
    """

    #: Frequencies in Hz
    hertz: tuple[float, ...]
    #: Amplitude about x times amplitude about y of each line, in rad^2
    products: tuple[float, ...]
    #: Sum of the squares of both, in rad^2
    squares: tuple[float, ...]
    #: Sampling frequency in Hz
    sample_hz: Fraction

    @cached_property
    def radians(self) -> list[Any]:
        """Angular frequencies in rad a sample."""
        rate = REAL.mpf(self.sample_hz.numerator) / self.sample_hz.denominator
        return [2 * REAL.pi * REAL.mpf(f) / rate for f in self.hertz]

    @cached_property
    def worst_weights(self) -> list[Any]:
        """Products by the largest one, and a little for every line."""
        return [REAL.mpf(w) + REAL.mpf(_LEAST) for w in _parts(self.products)]

    @cached_property
    def square_weights(self) -> list[Any]:
        """Half the square of each product by the distance of the lines, in units of the largest one, with the same."""
        return [w**2 / 2 for w in self.worst_weights]

    @property
    def square_unit(self) -> float:
        """The unit of `square_weights`, in rad^4/Hz."""
        return max(self.products) ** 2 / (self.hertz[1] - self.hertz[0])

    def increment_square(self, gyro: GyroResponse | None) -> float:
        """Return the mean square of an increment, both axes together, in rad^2."""
        b = 2 * np.pi * np.array(self.hertz) / float(self.sample_hz)
        power = np.ones(len(b))
        if gyro is not None:
            x = np.array(self.hertz) / float(gyro.bandwidth_hz)
            power = 1 / ((1 - x * x) ** 2 + (2 * float(gyro.damping) * x) ** 2)
        return float((np.array(self.squares) * power * 2 * np.sin(b / 2) ** 2).sum())


def _parts(values: tuple[float, ...]) -> list[float]:
    largest = max(values)
    return [round(value / largest * 2**_DIGITS) / 2**_DIGITS for value in values]


def of_spectrum(spectrum: Spectrum, sample_hz: Fraction) -> Lines:
    """Return a spectrum as lines.

    A line in a band df has the amplitudes a with a^2/2 = P |H|^2 df about each axis, P the density of the input and H
    the transfer function to the angle.

    `sample_hz`: sampling frequency in Hz.

    >>> flat = Spectrum(lambda f: 5e-7 + 0 * f, {"angle_x": np.ones_like, "angle_y": np.ones_like}, (2.0, 40.0))
    >>> lines = of_spectrum(flat, Fraction(100))
    >>> len(lines.hertz), lines.hertz[0], lines.hertz[-1], round(sum(lines.products) * 1e6, 2)
    (400, 2.0, 40.0, 38.1)
    """
    low, high = spectrum.edges[0], spectrum.edges[-1]
    hertz = np.linspace(low or high / LINES, high, LINES)
    channels = spectrum.amplitudes(hertz)
    for axis in "xy":
        if f"angle_{axis}" not in channels:
            raise InputError(
                f"the spectrum does not turn about {axis}; angle_{axis}_rad is needed for coning"
            )
    sizes = [np.abs(channels[f"angle_{axis}"]) for axis in "xy"]
    power = 2 * spectrum.densities(hertz) * (hertz[1] - hertz[0])
    products = power * sizes[0] * sizes[1]
    if not 0 < products.max() < np.inf:
        raise InputError("the spectrum does not turn about x and y at one frequency; there is no coning")
    squares = power * (sizes[0] ** 2 + sizes[1] ** 2)
    return Lines(tuple(hertz.tolist()), tuple(products.tolist()), tuple(squares.tolist()), sample_hz)
