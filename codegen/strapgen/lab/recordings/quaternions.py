"""Quaternions x, y, z, s (scalar last) along a time, body to reference: products, conversions, interpolation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from strapgen.run.backends import evaluator

Array = NDArray[np.float64]

#: Below this sine of half the angle the ratio of angle and sine is taken as that at zero.
_SMALL = 1e-12


def kernel(name: str, *values: Array) -> Array:
    """Return what a kernel of the catalogue makes of arrays."""
    return np.asarray(evaluator(name)(*values))


def product(p: Array, q: Array) -> Array:
    """Return the products p q: the rotation q, then p.

    >>> product(np.array([[1.0, 0, 0, 0]]), np.array([[0, 1.0, 0, 0]]))
    array([[0., 0., 1., 0.]])
    """
    return kernel("euler-product", *np.broadcast_arrays(p, q))


def inverse(q: Array) -> Array:
    """Return the inverses of rotations."""
    return q * (-1, -1, -1, 1)


def from_rotation_vectors(vectors: Array) -> Array:
    """Return the quaternions of rotation vectors in rad.

    >>> from_rotation_vectors(np.array([[0, 0, np.pi]])).round(9) + 0.0
    array([[0., 0., 1., 0.]])
    """
    return kernel("euler-update", np.broadcast_to((0.0, 0, 0, 1), (*vectors.shape[:-1], 4)), vectors)


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
    return kernel("dcm-from-euler", q)


def from_matrices(C: Array) -> Array:
    """Return the rotations nearest to direction cosine matrices (N, 3, 3), without jumps of sign; the first has s >= 0.

    >>> from_matrices(np.array([np.diag([-1.0, -1, 1])]))
    array([[0., 0., 1., 0.]])
    """
    q = kernel("euler-from-dcm-sheppard", kernel("dcm-orthonormalize-optimal", C), np.zeros((len(C), 4)))
    return continuous(kernel("euler-normalize", q))


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
    return kernel("euler-update", q[place], part[:, None] * turn)


def nearest(matrix: Array) -> Array:
    """Return the rotation, (3, 3), nearest to a sum of products of vectors (G. Wahba, SIAM Review 7, 1965)."""
    left, _, right = np.linalg.svd(matrix)
    rotation: Array = left @ np.diag([1, 1, np.linalg.det(left) * np.linalg.det(right)]) @ right
    return rotation
