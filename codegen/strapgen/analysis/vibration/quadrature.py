"""Integrates over frequency with adaptive steps, and estimates the error."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from strapgen.ir.exceptions import InputError

Array = NDArray[np.float64]

#: Points of the two Gauss rules on every panel; the second one gives the value, their difference the error.
_POINTS = (8, 15)
#: Most halvings of a panel, and most panels in all.
_MOST_HALVINGS = 60
_MOST_PANELS = 100_000


class Integral(NamedTuple):
    """Integrals of several functions."""

    #: (n,)
    values: Array
    #: (n,): sum over the panels of the difference between a rule and one with about half as many points. The
    #: values are those of the better rule, so their error is far smaller
    errors: Array


@cache
def _rules() -> tuple[tuple[Array, Array], ...]:
    return tuple(np.polynomial.legendre.leggauss(points) for points in _POINTS)


def integrate(
    function: Callable[[Array], Array], edges: Sequence[float], width: float, tolerance: float = 1e-10
) -> Integral:
    """Integrate functions over a range.

    `function`: ``function(x)`` takes x of shape (N,) and returns the values of n functions, (n, N).

    >>> integral = integrate(lambda x: np.array([np.sin(x), x**2]), [0, np.pi], 1.0)
    >>> integral.values.round(9), bool(np.all(integral.errors < 1e-10))
    (array([ 2.        , 10.33542556]), True)
    """
    with np.errstate(all="ignore"):  # values that are not finite are refused later
        return _integrate(function, edges, width, tolerance)


def _integrate(
    function: Callable[[Array], Array], edges: Sequence[float], width: float, tolerance: float
) -> Integral:
    starts: list[float] = []
    ends: list[float] = []
    for low, high in pairwise(edges):
        least = (high - low) / width
        if len(starts) + least > _MOST_PANELS:
            raise _too_many()
        count = max(1, int(np.ceil(least)))
        grid = np.linspace(low, high, count + 1)
        starts += grid[:-1].tolist()
        ends += grid[1:].tolist()
    panels = np.array([starts, ends])
    done: list[tuple[Array, Array]] = []
    total_size: Array | None = None
    used = 0
    for _ in range(_MOST_HALVINGS):
        used += panels.shape[1]
        if used > _MOST_PANELS:
            break
        (rough, _), (fine, size) = (_on_panels(function, panels, *rule) for rule in _rules())
        errors = np.abs(fine - rough)
        if total_size is None:
            total_size = size.sum(axis=1)
            span = panels[1, -1] - panels[0, 0]
            if not np.isfinite(total_size).all():
                raise InputError("the integral of the spectrum is beyond the range of double")
        share = (panels[1] - panels[0]) / span
        small = np.all(
            errors <= np.maximum(tolerance * total_size[:, None] * share, 64 * np.finfo(float).eps * size),
            axis=0,
        )
        done.append((fine[:, small].sum(axis=1), errors[:, small].sum(axis=1)))
        panels = panels[:, ~small]
        if not panels.size:
            values, spread = (np.sum(parts, axis=0) for parts in zip(*done, strict=True))
            return Integral(values, spread)
        middle = panels.mean(axis=0)
        panels = np.hstack([np.array([panels[0], middle]), np.array([middle, panels[1]])])
    raise _too_many()


def _too_many() -> InputError:
    return InputError(
        f"the spectrum takes over {_MOST_PANELS} panels to integrate: it jumps where no edge is given, or reaches to "
        "frequencies far above those of the samples"
    )


def _on_panels(
    function: Callable[[Array], Array], panels: Array, nodes: Array, weights: Array
) -> tuple[Array, Array]:
    """Return the integrals of the functions and of their magnitudes by a rule, (n, panels) each."""
    half, middle = (panels[1] - panels[0]) / 2, panels.mean(axis=0)
    points = middle[:, None] + half[:, None] * nodes
    values = function(points.ravel())
    if not np.isfinite(values).all():
        worst = points.ravel()[~np.isfinite(values).all(axis=0)][0]
        raise InputError(f"the spectrum is not finite at {worst:.9g} Hz")
    values = values.reshape(len(values), *points.shape)
    weighted = weights * half[:, None]
    return (values * weighted).sum(axis=2), (np.abs(values) * weighted).sum(axis=2)
