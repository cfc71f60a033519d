"""A certificate as a result: what rounding and the method did along a run, in numbers with a radius."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from strapgen.lab.certificate.balls import rotation_vector
from strapgen.results import figures
from strapgen.results.records import INTERNAL, Record, entry
from strapgen.results.result import Result
from strapgen.results.table import ANGLE

#: Instants of a certificate's table for a reader.
_SHOWN = 12


class Angle(NamedTuple):
    """A rotation vector in doubles that hold its ball."""

    axes: tuple[float, float, float]  # rad, reference axes
    axes_radius: float
    size: float  # rad
    radius: float

    @classmethod
    def of(cls, matrix: Any) -> Angle:
        """Return the rotation of a matrix near 1."""
        vector = rotation_vector(matrix)
        if not all(x.is_finite() for x in vector):
            return cls((math.nan, math.nan, math.nan), math.inf, math.nan, math.inf)
        (x, y, z), radii = zip(*map(near, vector), strict=True)
        return cls((x, y, z), max(radii), *near(sum(x * x for x in vector).nonnegative_part().sqrt()))

    @property
    def above(self) -> float:
        """An upper end of its size in rad."""
        return math.nextafter(self.size + self.radius, math.inf)


def near(x: Any) -> tuple[float, float]:
    """Return a double near a ball, and an upper end of its distance from the ball's numbers."""
    number = float(x.mid())
    return number, math.nextafter(float(abs(x - number).upper()), math.inf)


@dataclass(frozen=True)
class Departure(Record):
    """The angle of the computed attitude from exact ones, after a number of steps."""

    time_s: float = field(metadata=entry("time, s", ".6g"))
    steps: int = field(metadata=entry("steps"))
    #: Angle that rounding has made, from exact arithmetic on the same increments
    rounding_rad: float = field(metadata=entry("rounding, rad", ANGLE))
    #: Radius of that angle's ball
    rounding_radius_rad: float = field(metadata=entry("+-", ".1e"))
    #: Bound of that angle for every run, which the header of the code states
    header_bound_rad: float | None = field(metadata=entry("header, rad", ANGLE))
    #: Angle between the step in exact arithmetic and the exact rotation of the rate that it fits
    truncation_rad: float | None = field(metadata=entry("truncation, rad", ANGLE))
    #: Angle that rounding has made in the attitude of now of a unit that commits late
    now_rounding_rad: float | None = field(default=None, metadata=entry("now, rad", ANGLE))


@dataclass(frozen=True)
class Fault(Record):
    """An interval in which the state departs by more than rounding makes."""

    from_s: float
    to_s: float
    #: The angle, and the most that rounding makes in this interval
    angle_rad: float
    bound_rad: float


@dataclass(frozen=True)
class CertificateResult(Result):
    """What rounding and the method did to the attitude along a run."""

    rows_in = "departures"
    drawn_by = f"{__name__}:certificate_image"

    kernel: str
    backend: str
    steps: int
    duration_s: float
    #: Angle at the end from exact arithmetic on the same increments
    rounding_rad: float
    #: Radius of the ball of that angle, and of each axis
    rounding_radius_rad: float
    #: The same as a rotation vector in reference axes
    rounding_axes_rad: tuple[float, ...]
    #: The largest angle at any of the instants
    largest_rounding_rad: float
    #: Bound of the angle for every run of as many steps, which the header of the code states; null where none is known
    header_bound_rad: float | None
    #: Angle at the end between the step in exact arithmetic and the exact rotation of the rate that it fits to its
    #: samples; null where it fits none
    truncation_rad: float | None
    #: Radius of the ball of that angle
    truncation_radius_rad: float | None
    truncation_axes_rad: tuple[float, ...] | None
    #: Change of the attitude's length by rounding; null for a matrix
    length_error: float | None
    #: Change of the angles between the axes of a matrix by rounding, and of their lengths; null for parameters
    skew_rad: tuple[float, ...] | None
    scale: tuple[float, ...] | None
    #: Bound of the angle at the end from the true attitude, if the rate lies in the band with the stated amplitude
    band_bound_rad: float | None
    #: "proved" for a bound; null where no band is stated
    band_bound_status: str | None
    band_hz: float | None
    amplitude_deg_s: float | None
    #: Intervals in which the state departs by more than rounding makes
    faults: Sequence[Fault]
    departures: Sequence[Departure]
    #: Of a unit that commits late: the angle after the intervals of its start, and that in the attitude of now before
    #: the last intervals are committed, with the radius of its ball, and the largest at any of the instants
    start_rounding_rad: float | None = None
    now_rounding_rad: float | None = None
    now_rounding_radius_rad: float | None = None
    largest_now_rounding_rad: float | None = None
    #: Angle by which exact orthonormalizations of the computed matrices turn them, which is no part of the rounding;
    #: null for parameters, and without any
    orthonormalization_rad: float | None = None
    #: Where the increments come from
    source: str = field(default="", metadata=INTERNAL)

    def text(self) -> str:
        """Return what the certificate says, in sentences."""
        title = f"{self.kernel}, {self.backend}: {self.steps} steps, {self.duration_s:.6g} s"
        header = "" if self.header_bound_rad is None else f" (header: {self.header_bound_rad:.2g})"
        lines = [
            f"{title} of {self.source}" if self.source else title,
            f"rounding on this run: {self.rounding_rad:.3g} rad +- {rounded_up(self.rounding_radius_rad)}{header}, "
            f"about {_axes(self.rounding_axes_rad)}",
        ]
        if self.now_rounding_rad is not None:
            lines.append(
                f"at its start: {self.start_rounding_rad:.3g} rad; in the attitude of now at the end: "
                f"{self.now_rounding_rad:.3g} rad +- {rounded_up(self.now_rounding_radius_rad or 0.0)}, at most "
                f"{self.largest_now_rounding_rad:.3g} rad"
            )
        if self.orthonormalization_rad is not None:
            lines.append(f"orthonormalization, beside it: {self.orthonormalization_rad:.3g} rad")
        truncation = "not examined"
        if self.truncation_rad is not None:
            truncation = f"{self.truncation_rad:.3g} rad +- {rounded_up(self.truncation_radius_rad or 0.0)}"
        lines.append(f"truncation of the step, beside the rate that it fits to its samples: {truncation}")
        if self.band_bound_rad is not None:
            lines.append(
                f"if the rate lies below {self.band_hz:g} Hz with amplitudes of {self.amplitude_deg_s:g} deg/s in all: "
                f"within {rounded_up(self.band_bound_rad)} rad of the true attitude ({self.band_bound_status}), of "
                "sensors without errors"
            )
        lines += [
            f"a fault from {fault.from_s:.6g} s to {fault.to_s:.6g} s: the state departs by {fault.angle_rad:.3g} rad, "
            f"where rounding makes at most {fault.bound_rad:.2g} rad"
            for fault in self.faults
        ]
        return "\n".join(lines)


def rounded_up(x: float) -> str:
    """Return a bound in two digits, rounded up."""
    if not (x and math.isfinite(x)):
        return f"{x:g}"
    unit = 10.0 ** (math.floor(math.log10(x)) - 1)
    text = f"{math.ceil(x / unit) * unit:.1e}"
    return text if float(text) >= x else f"{(math.ceil(x / unit) + 1) * unit:.1e}"


def _axes(values: Sequence[float]) -> str:
    return ", ".join(f"{axis} {value:.3g}" for axis, value in zip("xyz", values, strict=True))


def certificate_image(result: CertificateResult, path: str | Path) -> bytes:
    """Return the angles over time, with the bound of the header."""
    figure, grid = figures.grid_of_axes(1, 1, (8.5, 4.4))
    axes, rows = grid[0, 0], result.departures
    time = [row.time_s for row in rows]
    columns: dict[str, list[float | None]] = {
        "rounding": [row.rounding_rad for row in rows],
        "truncation of the step": [row.truncation_rad for row in rows],
        "header's bound of rounding": [row.header_bound_rad for row in rows],
    }
    known = {name: column for name, column in columns.items() if any(column)}
    for (name, column), colour in zip(known.items(), figures.several_colours(len(known)), strict=True):
        values = np.array([value or math.nan for value in column])
        axes.plot(time, values, color=colour, linewidth=1.4, label=name)
    if known:
        axes.set_yscale("log")
        axes.legend(frameon=False, fontsize=9)
    for fault in result.faults:
        axes.axvspan(fault.from_s, fault.to_s, color="0.8")
    axes.set_xlabel("time, s")
    axes.set_ylabel("angle, rad")
    figures.style(axes)
    figures.title(figure, f"Certificate of {result.kernel}, {result.backend}")
    return figures.image(figure, path)
