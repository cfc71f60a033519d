"""Quaternions x, y, z, s (scalar last) along a time, body to reference: products, conversions, interpolation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Below this sine of half the angle the ratio of angle and sine is taken as that at zero.
_SMALL = 1e-12


def product(p: Array, q: Array) -> Array:
    """Return the products p q: the rotation q, then p.

    >>> product(np.array([1.0, 0, 0, 0]), np.array([0, 1.0, 0, 0]))
    array([0., 0., 1., 0.])
    """
    v, w = p[..., :3], q[..., :3]
    s, t = p[..., 3:], q[..., 3:]
    vector = s * w + t * v + np.cross(v, w)
    return np.concatenate([vector, s * t - (v * w).sum(axis=-1, keepdims=True)], axis=-1)


def inverse(q: Array) -> Array:
    """Return the inverses of rotations."""
    return q * (-1, -1, -1, 1)


def from_rotation_vectors(vectors: Array) -> Array:
    """Return the quaternions of rotation vectors in rad.

    >>> from_rotation_vectors(np.array([0, 0, np.pi])).round(9) + 0.0
    array([0., 0., 1., 0.])
    """
    half = np.linalg.norm(vectors, axis=-1, keepdims=True) / 2
    return np.concatenate([np.sinc(half / np.pi) / 2 * vectors, np.cos(half)], axis=-1)


def rotation_vectors(q: Array) -> Array:
    """Return the rotation vectors in rad, at most pi long.

    >>> rotation_vectors(np.array([0, 0, -0.6, -0.8])).round(6) + 0.0
    array([0.      , 0.      , 1.287002])
    """
    q = np.where(q[..., 3:] < 0, -q, q)
    sine = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    ratio = np.where(sine > _SMALL, 2 * np.arctan2(sine, q[..., 3:]) / np.maximum(sine, _SMALL), 2.0)
    vectors: Array = ratio * q[..., :3]
    return vectors


def matrices(q: Array) -> Array:
    """Return the direction cosine matrices, (..., 3, 3).

    >>> matrices(np.array([0, 0, 1.0, 0]))[0]
    array([-1.,  0.,  0.])
    """
    x, y, z, s = np.moveaxis(q, -1, 0)
    rows = [
        [s * s + x * x - y * y - z * z, 2 * (x * y - s * z), 2 * (x * z + s * y)],
        [2 * (x * y + s * z), s * s - x * x + y * y - z * z, 2 * (y * z - s * x)],
        [2 * (x * z - s * y), 2 * (y * z + s * x), s * s - x * x - y * y + z * z],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def from_matrices(C: Array) -> Array:
    """Return the rotations nearest to direction cosine matrices (N, 3, 3), without jumps of sign; the first has s >= 0.

    Each is the main eigenvector of a matrix of order four, by two iterations from its largest column. I. Y.
    Bar-Itzhack, "New method for extracting the quaternion from a rotation matrix", J. Guidance 23 (2000), page 1085.

    >>> from_matrices(np.array([np.diag([-1.0, -1, 1])]))
    array([[0., 0., 1., 0.]])
    """
    trace = np.trace(C, axis1=-2, axis2=-1)
    skew = np.stack([C[:, 2, 1] - C[:, 1, 2], C[:, 0, 2] - C[:, 2, 0], C[:, 1, 0] - C[:, 0, 1]], axis=-1)
    square = np.empty((len(C), 4, 4))
    square[:, :3, :3] = C + np.swapaxes(C, -2, -1)
    unit = np.cbrt(np.abs(np.linalg.det(C)))
    square[:, range(3), range(3)] += (unit - trace)[:, None]
    square[:, :3, 3] = square[:, 3, :3] = skew
    square[:, 3, 3] = unit + trace
    largest = np.argmax(np.diagonal(square, axis1=-2, axis2=-1), axis=-1)
    q = square[np.arange(len(C)), largest]
    for _ in range(2):  # others than the main eigenvalue are as small as C departs from a rotation
        q = np.einsum("nij,nj->ni", square, q / np.linalg.norm(q, axis=-1, keepdims=True))
    return continuous(q / np.linalg.norm(q, axis=-1, keepdims=True))


def continuous(q: Array) -> Array:
    """Return the quaternions (N, 4) with the sign that is nearer to the one before; the first has s >= 0."""
    signs = np.where((q[1:] * q[:-1]).sum(axis=-1) < 0, -1.0, 1.0)
    first = -1.0 if len(q) and q[0, 3] < 0 else 1.0
    return q * (first * np.cumprod(np.concatenate([[1.0], signs])))[: len(q), None]


def interpolated(time: Array, q: Array, at: Array) -> Array:
    """Return the attitudes at some times, at a constant rate from one record to the next.

    `time` (N,): in s, rising, N at least 2. `q` (N, 4). `at` (M,): in s; the rate goes on beyond the ends.

    >>> half = interpolated(np.array([0.0, 1]), np.array([[0, 0, 0, 1.0], [0, 0, 1, 0]]), np.array([0.5]))
    >>> np.degrees(rotation_vectors(half))[0].round(9) + 0.0
    array([ 0.,  0., 90.])
    """
    place = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    part = (at - time[place]) / (time[place + 1] - time[place])
    turn = rotation_vectors(product(inverse(q[place]), q[place + 1]))
    return product(q[place], from_rotation_vectors(part[:, None] * turn))


def nearest(matrix: Array) -> Array:
    """Return the rotation, (3, 3), nearest to a sum of products of vectors (G. Wahba, SIAM Review 7, 1965)."""
    left, _, right = np.linalg.svd(matrix)
    rotation: Array = left @ np.diag([1, 1, np.linalg.det(left) * np.linalg.det(right)]) @ right
    return rotation
