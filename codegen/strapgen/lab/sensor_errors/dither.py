"""The random noise of a dithered laser gyro, and the motion of its dither: Savage's sensor paper of 1984."""

from __future__ import annotations

import math


def dithered_laser_noise(lock_in_deg_s: float, dither_deg_s: float, fringes: float) -> float:
    """Return the white noise that a gyro of dithered laser beams has from passing through lock-in, equation (2).

    The equation is ``sigma = L / sqrt(D K)`` with the lock-in rate L in deg/h, D in rad/h and K fringes a revolution.

    Parameters
    ----------
    lock_in_deg_s : float
        Lock-in rate.
    dither_deg_s : float
        Largest rate of the dither.
    fringes : float
        Fringes of the interference pattern in a revolution.

    Returns
    -------
    float
        In rad/sqrt(s).

    Examples
    --------
    >>> round(math.degrees(dithered_laser_noise(0.03, 72, 648_000)) * 60, 8)
    0.00199471
    """
    lock_in, dither = lock_in_deg_s * 3600, math.radians(dither_deg_s) * 3600
    return math.radians(lock_in / math.sqrt(dither * fringes)) / 60


def dither_amplitude(dither_deg_s: float, frequency_hz: float, residue: float = 1.0) -> float:
    """Return the amplitude of an oscillation by its largest rate.

    Parameters
    ----------
    dither_deg_s : float
        Largest rate.
    frequency_hz : float
    residue : float, optional
        Share of the motion of the gyro's block that reaches the assembly of the sensors.

    Returns
    -------
    float
        In rad.

    Examples
    --------
    >>> round(math.degrees(dither_amplitude(72, 400)) * 3600, 4)
    103.1324
    """
    return residue * math.radians(dither_deg_s) / (2 * math.pi * frequency_hz)
