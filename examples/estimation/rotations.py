"""Rotations of small arrays, and the exact rotation, velocity and position of a motion between two instants."""

from __future__ import annotations

import numpy as np
from simulated_imu import Lines

Array = np.ndarray


def cross(v: Array) -> Array:
    """Return the matrices of cross products, (..., 3, 3)."""
    x, y, z = np.moveaxis(np.asarray(v, float), -1, 0)
    zero = np.zeros_like(x)
    return np.moveaxis(np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]), (0, 1), (-2, -1))


def exponential(v: Array) -> Array:
    """Return the rotations of rotation vectors, (..., 3, 3)."""
    angle = np.maximum(np.linalg.norm(v, axis=-1), 1e-12)[..., None, None]
    x = cross(v)
    return np.eye(3) + np.sin(angle) / angle * x + 2 * np.sin(angle / 2) ** 2 / angle**2 * x @ x


def logarithm(r: Array) -> Array:
    """Return the rotation vectors of rotations by less than a half turn, (..., 3)."""
    sines = np.stack([r[..., j, k] - r[..., k, j] for j, k in ((2, 1), (0, 2), (1, 0))], -1) / 2
    size = np.linalg.norm(sines, axis=-1, keepdims=True)
    angle = np.arctan2(size, (np.trace(r, axis1=-2, axis2=-1)[..., None] - 1) / 2)
    return sines * np.where(size > 1e-9, angle / np.maximum(size, 1e-9), 1.0)


def right_jacobian(v: Array) -> Array:
    """Return J of exp(v + d) = exp(v) exp(J d), (3, 3)."""
    angle, x = np.linalg.norm(v), cross(v)
    if angle < 1e-4:
        return np.eye(3) - x / 2 + x @ x / 6
    return np.eye(3) - (1 - np.cos(angle)) / angle**2 * x + (angle - np.sin(angle)) / angle**3 * x @ x


def truth(rate: Lines, force: Lines, begin: Array, end: Array, parts: int) -> tuple[Array, Array, Array]:
    """Integrate by Magnus steps of sixth order, and velocity and position on the nodes of Gauss."""
    h = ((end - begin) / parts)[:, None]
    r = np.broadcast_to(np.eye(3), (len(begin), 3, 3))
    v = p = np.zeros((len(begin), 3))
    nodes, weights = np.polynomial.legendre.leggauss(4)
    apart = np.sqrt(15) / 10

    def turn(t: Array, length: Array) -> Array:
        first, middle, last = (rate.at(t + length[:, 0] * node) for node in (0.5 - apart, 0.5, 0.5 + apart))
        a, b = length * middle, np.sqrt(15) / 3 * length * (last - first)
        c = 10 / 3 * length * (last - 2 * middle + first)
        ab = np.cross(b, a)  # body rates: products the other way round
        inner = -20 * a - c - ab
        return a + c / 12 + np.cross(b + np.cross(a, 2 * c - ab) / 60, inner) / 240

    for k in range(parts):
        t = begin + k * h[:, 0]
        pushed, moved = np.zeros((2, len(begin), 3))
        for node, weight in zip(0.5 + nodes / 2, weights / 2, strict=True):
            part = exponential(turn(t, node * h)) @ force.at(t + node * h[:, 0])[..., None]
            pushed, moved = pushed + weight * part[..., 0], moved + weight * (1 - node) * part[..., 0]
        p = p + v * h + h**2 * (r @ moved[..., None])[..., 0]
        v = v + h * (r @ pushed[..., None])[..., 0]
        r = r @ exponential(turn(t, h))
    return r, v, p
