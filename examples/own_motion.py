"""A motion of your own: a pendulum swing about one axis while the body spins about another.

`strapgen simulate`, `compare`, `converge` and `study word-length` take this file as --motion. It turns by the angle
S sin(b t) about the reference axis x, and then by the angle g t about its own axis z.
"""

import numpy as np

S, B, G = np.radians(20.0), 1.5, np.radians(30.0)  # rad, rad/s, rad/s


def angles(t):
    """Return the swing and the spin in rad at some times."""
    return S * np.sin(B * t), G * t


def rate(t):
    """Return the body rate in rad/s at some times in s, (..., 3)."""
    t = np.asarray(t, float)
    swing_rate, spin = S * B * np.cos(B * t), G * t
    return np.stack([swing_rate * np.cos(spin), -swing_rate * np.sin(spin), np.full_like(t, G)], axis=-1)


def angle(t):
    """Return the integral of the body rate up to some times, (..., 3): cos(b t) cos(g t) is a sum of two cosines."""
    fast, slow = B + G, B - G
    x = S * B / 2 * (np.sin(fast * t) / fast + np.sin(slow * t) / slow)
    y = S * B / 2 * (np.cos(fast * t) / fast - np.cos(slow * t) / slow)
    return np.stack([x, y, G * t], axis=-1)


def increments(step, steps, increments, previous=0, ahead=0):
    """Return the integrals of the rate, (steps, previous + increments + ahead, 3)."""
    first = np.arange(steps)[:, None] * increments + np.arange(-previous, increments + ahead)
    width = step / increments
    return angle((first + 1) * width) - angle(first * width)


def attitude(t):
    """Return the direction cosine matrices at some times, body to reference, (..., 3, 3)."""
    swing, spin = angles(np.asarray(t, float))
    c, s, cz, sz, zero = np.cos(swing), np.sin(swing), np.cos(spin), np.sin(spin), np.zeros_like(spin)
    rows = [[cz, -sz, zero], [c * sz, c * cz, -s], [s * sz, s * cz, c]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))
