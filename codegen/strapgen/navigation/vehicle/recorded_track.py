"""A motion over the earth along a recorded track: splines of fifth degree through its places and attitudes."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.ir.exceptions import InputError, MissingExtraError
from strapgen.navigation.frame.frame_rates import Earth
from strapgen.navigation.vehicle.controls import Controls
from strapgen.navigation.vehicle.vehicle_motion import VehicleMotion

Array = NDArray[np.float64]

#: The columns of a track.
COLUMNS = (
    *("time_s", "latitude_deg", "longitude_deg", "height_m"),
    *("roll_deg", "pitch_deg", "heading_deg"),
)
#: Degree of the splines, fewest rows for them, and instants in an interval of the track at which its velocity is taken.
_DEGREE, _FEWEST, _DENSE = 5, 6, 4
#: Beyond this latitude in deg heading and longitude of a track say too little.
_POLAR = 89.9


@dataclass(frozen=True)
class TrackControls(Controls):
    """Splines of a track against time: east and north velocity in axes n, height, and attitude."""

    #: Horizontal velocity in m/s, height over the start in m, and roll, pitch, heading in rad
    horizontal: Any = None
    vertical: Any = None
    attitude: Any = None
    #: In s from its start
    duration: float = math.inf

    def _within(self, time: Array) -> Array:
        if time.size and (time.min() < 0 or time.max() > self.duration):
            raise InputError(
                f"the track lasts {self.duration:g} s; a run of it goes from its start to its end"
            )
        return time

    def height_gain(self, time: Array) -> Array:
        """Return the height over that of the start in m."""
        return np.asarray(self.vertical(self._within(time)))

    def velocity(self, time: Array) -> tuple[Array, Array]:
        """Return velocity and its derivative, see `Controls.velocity`."""
        self._within(time)
        parts = [
            np.concatenate([self.horizontal(time, nu), self.vertical(time, nu + 1)[..., None]], axis=-1)
            for nu in (0, 1)
        ]
        return parts[0], parts[1]

    def angles(self, time: Array) -> tuple[tuple[Array, Array, Array], tuple[Array, Array, Array]]:
        """Return roll, pitch and heading, and their rates, see `Controls.angles`."""
        self._within(time)
        values, rates = (np.moveaxis(self.attitude(time, nu), -1, 0) for nu in (0, 1))
        return (values[0], values[1], values[2]), (rates[0], rates[1], rates[2])

    @property
    def stands(self) -> bool:
        """Whether the vehicle stays where it is: not known of a track."""
        return False

    @property
    def end(self) -> float:
        """Time in s beyond which nothing is known."""
        return self.duration


def read_track(path: Path) -> VehicleMotion:
    """Return the motion of a CSV file with the columns `COLUMNS`."""
    try:
        text = path.read_text("utf-8-sig")
    except OSError as error:
        raise InputError(f"motion {path} cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise InputError(f"motion {path} is not UTF-8") from None
    try:
        return _motion(str(path), text)
    except InputError as error:
        error.in_file = True  # its names are columns, not options
        raise


@lru_cache(maxsize=4)
def _motion(name: str, text: str) -> VehicleMotion:
    rows = _rows(name, text)
    time = rows["time_s"] - rows["time_s"][0]
    spline = _splines()
    latitude, longitude, heading, roll = (
        np.unwrap(np.radians(rows[f"{key}_deg"])) for key in ("latitude", "longitude", "heading", "roll")
    )
    place, vertical = (
        spline(time, np.column_stack([latitude, longitude]), k=_DEGREE),
        spline(time, rows["height_m"] - rows["height_m"][0], k=_DEGREE),
    )
    dense = np.interp(np.arange(_DENSE * (len(time) - 1) + 1) / _DENSE, np.arange(len(time)), time)
    horizontal, wander = _velocity(place, vertical(dense) + rows["height_m"][0], dense)
    angles = np.column_stack([roll, np.radians(rows["pitch_deg"]), heading + wander[::_DENSE]])
    controls = TrackControls(
        horizontal=spline(dense, horizontal, k=_DEGREE),
        vertical=vertical,
        attitude=spline(time, angles, k=_DEGREE),
        duration=float(time[-1]),
    )
    return VehicleMotion(
        name,
        {},
        controls=controls,
        start=(float(latitude[0]), float(longitude[0]), float(rows["height_m"][0])),
    )


def _velocity(place: Any, height: Array, time: Array) -> tuple[Array, Array]:
    """Return the velocity along x and y of wander-azimuth axes in m/s, (N, 2), and the wander angle in rad."""
    earth = Earth.wgs84()
    sine, cosine = np.sin(place(time)[:, 0]), np.cos(place(time)[:, 0])
    north_rate, east_rate = place(time, 1).T
    east = (earth.transverse_radius(sine) + height) * cosine * east_rate
    north = (earth.meridian_radius(sine) + height) * north_rate
    wander = -_splines()(time, east_rate * sine, k=_DEGREE).antiderivative()(time)
    c, s = np.cos(wander), np.sin(wander)
    return np.column_stack([c * east + s * north, c * north - s * east]), np.asarray(wander)


def _splines() -> Any:
    try:
        from scipy.interpolate import make_interp_spline
    except ImportError:
        raise MissingExtraError("recorded tracks need SciPy: pip install 'strapgen[design]'") from None
    return make_interp_spline


def _rows(name: str, text: str) -> Mapping[str, Array]:
    """Return the columns of a track, checked."""
    lines = csv.reader(line for line in text.splitlines() if line.strip() and not line.startswith("#"))
    header = [cell.strip() for cell in next(lines, [])]
    for column in COLUMNS:
        if column not in header:
            raise InputError(f"motion {name} has no column {column}; a track has {', '.join(COLUMNS)}")
    table = []
    for number, row in enumerate(lines, 1):
        try:
            table.append([float(row[header.index(column)]) for column in COLUMNS])
        except (ValueError, IndexError):
            raise InputError(f"motion {name}: row {number} is no row of numbers") from None
        if not all(map(math.isfinite, table[-1])):
            raise InputError(f"motion {name}: row {number} has a number that is not finite")
    if len(table) < _FEWEST:
        raise InputError(f"motion {name} has {len(table)} rows; a track needs {_FEWEST} or more")
    values = np.array(table)
    late = np.flatnonzero(np.diff(values[:, 0]) <= 0)
    if len(late):
        raise InputError(f"motion {name}: time_s of row {late[0] + 2} is not after that of the row before")
    if np.abs(values[:, 1]).max() > _POLAR:
        raise InputError(
            f"motion {name} comes within {90 - _POLAR:.1f} deg of a pole, where a track is not used"
        )
    return dict(zip(COLUMNS, values.T, strict=True))
