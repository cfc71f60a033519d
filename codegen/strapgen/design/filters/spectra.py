"""The density of the rate over a band, from a spectrum of vibration."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from strapgen.analysis.vibration.spectrum import Spectrum
from strapgen.design.filters.band_grid import BITS, mean_points
from strapgen.ir.exceptions import InputError

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
