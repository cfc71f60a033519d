"""A motion: the body swings about x."""

import numpy as np

from strapgen.lab.motions.rate_profiles import CosineSum


def swing(angle: float, frequency: float) -> CosineSum:
    """Return the rate of a swing of an amplitude in rad at a frequency in Hz."""
    turning = 2 * np.pi * frequency
    return CosineSum(np.array([[angle * turning], [0], [0]]), np.full((3, 1), turning), np.zeros((3, 1)))
