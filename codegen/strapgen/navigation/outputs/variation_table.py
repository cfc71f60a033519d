"""A stored grid of magnetic variations, which finds the four points around a position for the kernel ``variation``."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

#: A whole turn in deg.
_TURN = 360.0


class VariationTable:
    """Magnetic variations on a grid of latitude and longitude.

    `latitudes, longitudes`: lines of the grid in deg, increasing; longitudes that span a whole turn have their
    first line again at its end. `variations` (latitudes, longitudes): what is to be added to a true heading, in
    deg.

    >>> table = VariationTable([40, 50], [0, 10], [[10, 12], [13, 18]])
    >>> corners, fractions = table.around(46, 2.5)
    >>> [round(math.degrees(corner), 6) for corner in corners], fractions
    ([10.0, 12.0, 13.0, 18.0], (0.25, 0.6))
    """

    def __init__(self, latitudes: Sequence[float], longitudes: Sequence[float], variations: object) -> None:
        self.lines = tuple(
            checks.numbers(name, values, (None,))
            for name, values in (("latitudes", latitudes), ("longitudes", longitudes))
        )
        for name, lines in zip(("latitudes", "longitudes"), self.lines, strict=True):
            if lines.ndim != 1 or lines.size < 2 or not (np.diff(lines) > 0).all():
                raise InputError(f"{name} of the grid have to increase, and to be at least two")
        self.variations = checks.numbers("variations", variations)
        shape = tuple(lines.size for lines in self.lines)
        if self.variations.shape != shape:
            raise InputError(f"variations have the shape {self.variations.shape}; the grid has {shape}")

    def around(
        self, latitude_deg: float, longitude_deg: float
    ) -> tuple[tuple[float, float, float, float], tuple[float, float]]:
        """Return the variations at the points around a position in rad, and the way to it from the first one.

        Corners stand in the order of the kernel: the first fraction goes to the east, the second to the north. Of
        corners on both sides of a half turn, those beyond it from the first have a whole turn added.
        """
        first = float(self.lines[1][0])
        position = (latitude_deg, first + (longitude_deg - first) % _TURN)
        places = []
        for name, value, lines in zip(("latitude", "longitude"), position, self.lines, strict=True):
            if not lines[0] <= value <= lines[-1]:
                raise InputError(
                    f"{name} {value:g} deg is outside of the grid, {lines[0]:g} to {lines[-1]:g} deg"
                )
            place = min(int(np.searchsorted(lines, value, "right")) - 1, lines.size - 2)
            places.append((place, float((value - lines[place]) / (lines[place + 1] - lines[place]))))
        (row, north), (column, east) = places
        corners = self.variations[row : row + 2, column : column + 2].ravel()
        near = [corners[0] + math.remainder(corner - corners[0], _TURN) for corner in corners]
        v1, v2, v3, v4 = map(math.radians, near)
        return (v1, v2, v3, v4), (east, north)
