"""Several algorithms along one recording: the spread of their attitudes, beside what the gyro's noise makes of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from strapgen.catalogue import Choice
from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings import quaternions
from strapgen.lab.recordings.attitude_output import attitude_of
from strapgen.lab.recordings.recording import Recording, propagate
from strapgen.lab.recordings.rest import rests
from strapgen.results import figures
from strapgen.results.records import INTERNAL, Record, entry, reader_table
from strapgen.results.result import Result
from strapgen.results.table import ANGLE, TextTable
from strapgen.run.backends import backend

Array = NDArray[np.float64]

#: deg/sqrt(h) of a rad/sqrt(s).
_PER_ROOT_HOUR = math.degrees(60)


@dataclass(frozen=True)
class AlgorithmOnLog(Record):
    """The attitude of an algorithm along a recording, beside that of the first one."""

    kernel: str = field(metadata=entry("kernel", align="<"))
    #: Largest angle from the first algorithm's attitude
    largest_deg: float = field(metadata=entry("largest", ANGLE))
    #: Root mean square of that angle
    rms_deg: float = field(metadata=entry("rms", ANGLE))
    #: That angle at the end
    end_deg: float = field(metadata=entry("at the end", ANGLE))
    #: Operations of a step in a second of the recording
    operations_per_s: float = field(metadata=entry("operations/s", ",.0f"))
    #: (N,): the angle at the common times in deg
    angles: Array = field(repr=False, compare=False, metadata=INTERNAL)


@dataclass(frozen=True)
class SpreadResult(Result):
    """The spread of the attitudes of several algorithms along one recording."""

    rows_in = "algorithms"
    drawn_by = f"{__name__}:spread_image"

    #: The recording
    source: str
    backend: str
    duration_s: float
    #: Largest angle between the attitudes of any two algorithms
    spread_deg: float
    #: That angle at the end
    spread_end_deg: float
    #: Angle random walk of the gyro about x, y, z; null where no rest tells it and none is stated
    noise_deg_sqrt_h: tuple[float, ...] | None = field(metadata=entry(unit="deg/sqrt(h)"))
    #: Standard deviation of the attitude at the end from that noise
    noise_deg: float | None
    algorithms: Sequence[AlgorithmOnLog]
    #: (N,): the common times in s
    time: Array = field(metadata=INTERNAL)

    def reader(self) -> TextTable:
        """Return the algorithms as a table."""
        return reader_table(self.algorithms, AlgorithmOnLog, units=True)

    def text(self) -> str:
        """Return the algorithms, their spread, and what a better one would be worth."""
        title = (
            f"{self.source}, {self.duration_s:.6g} s, {self.backend}: angle from {self.algorithms[0].kernel}"
        )
        spread = (
            f"the attitudes spread by up to {self.spread_deg:.3g} deg, by {self.spread_end_deg:.3g} deg at the end: "
            "what the algorithm costs on this log"
        )
        return "\n".join([title, "", *self.reader().lines(), "", spread, self._worth()])

    def _worth(self) -> str:
        """Return the line that compares the spread with the gyro's noise."""
        if self.noise_deg is None or self.noise_deg_sqrt_h is None:
            return "no rest tells the noise of the gyro; --noise-deg-sqrt-h states it"
        walks = ", ".join(f"{walk:.3g}" for walk in self.noise_deg_sqrt_h)
        # Independent errors add up as squares: what is left without the algorithm's part.
        together = math.hypot(self.noise_deg, self.spread_end_deg)
        worth = 1 - self.noise_deg / together if together else 0.0
        return (
            f"the gyro's noise of {walks} deg/sqrt(h) makes {self.noise_deg:.3g} deg in this time: a better algorithm "
            f"takes off at most {100 * worth:.2g} % of both"
        )


def spread(
    choices: Sequence[Choice],
    recording: Recording,
    name: str = "numpy",
    source: str = "",
    noise_deg_sqrt_h: float | None = None,
) -> SpreadResult:
    """Run several algorithms along a recording, and compare their attitudes at the times that they have in common."""
    if recording.breaks:
        raise InputError(
            "the recording is split into pieces; compare runs along one: --gaps bridge, --start and --end"
        )
    runs = []
    for choice in choices:
        made = backend(choice, backend=name)
        history = propagate(made, recording)
        first = made.previous
        samples = first + made.increments * np.arange(len(history.time))
        operations = sum(made.sources.operations.values()) / history.step
        runs.append((choice.kernel, samples, attitude_of(history), operations))
    common = runs[0][1]
    for _, samples, _, _ in runs[1:]:
        common = np.intersect1d(common, samples)
    if len(common) < 2:
        raise InputError(
            "the steps of these algorithms have fewer than two times in common on this recording"
        )
    attitudes = []
    for _, samples, q, _ in runs:
        at = q[np.searchsorted(samples, common)]
        attitudes.append(
            quaternions.product(quaternions.inverse(at[:1]), at)
        )  # equal at the first common time
    rows = []
    for (kernel, _, _, operations), q in zip(runs, attitudes, strict=True):
        angles = np.zeros(len(q)) if q is attitudes[0] else _angles(attitudes[0], q)
        rms = float(np.sqrt(np.mean(angles**2)))
        rows.append(AlgorithmOnLog(kernel, float(angles.max()), rms, float(angles[-1]), operations, angles))
    between = np.max(
        [_angles(p, q) for k, p in enumerate(attitudes) for q in attitudes[k + 1 :]] or [0 * rows[0].angles],
        axis=0,
    )
    time = recording.start + recording.interval * common.astype(np.float64)
    seconds = float(time[-1] - time[0])
    noise = _noise(recording) if noise_deg_sqrt_h is None else np.full(3, float(noise_deg_sqrt_h))
    made_by_noise = None if noise is None else float(np.linalg.norm(noise)) * math.sqrt(seconds / 3600)
    return SpreadResult(
        *(source, name, seconds, float(between.max()), float(between[-1])),
        *(None if noise is None else tuple(noise.tolist()), made_by_noise),
        rows,
        time,
    )


def _angles(p: Array, q: Array) -> Array:
    """Return the angles between attitudes in deg."""
    turns = quaternions.rotation_vectors(quaternions.product(quaternions.inverse(p), q))
    return np.asarray(np.degrees(np.linalg.norm(turns, axis=1)))


def _noise(recording: Recording) -> Array | None:
    """Return the angle random walk in the longest rest in deg/sqrt(h), (3,); None without a rest."""
    found = max(rests(recording), key=lambda rest: rest.end_s - rest.start_s, default=None)
    return None if found is None else found.noise * _PER_ROOT_HOUR


def spread_image(result: SpreadResult, path: str | Path) -> bytes:
    """Return the angle of each algorithm from the first over time."""
    figure, grid = figures.grid_of_axes(1, 1, (8.5, 4.4))
    axes, rows = grid[0, 0], result.algorithms[1:]
    for row, colour in zip(rows, figures.several_colours(len(rows)), strict=True):
        axes.plot(result.time, row.angles, color=colour, linewidth=1.2, label=row.kernel)
    axes.set_xlabel("time, s")
    axes.set_ylabel(f"angle from {result.algorithms[0].kernel}, deg")
    figures.style(axes)
    axes.legend(frameon=False, fontsize=9)
    figures.title(figure, f"Attitudes along {Path(result.source).name}")
    return figures.image(figure, path)
