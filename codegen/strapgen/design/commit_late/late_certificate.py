"""The certificate of a unit that commits an attitude late: at its start, inside, at its end, and of its answer of now.

Every interval turns the attitude by the rotation of its filter, whichever that is: the recursion is that of a step. The
attitude of now is the committed one after the intervals that wait, and so is its error. The compiler's extension point
"lab.late-certificate" is this module.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from strapgen import pipeline
from strapgen.catalogue import Choice
from strapgen.catalogue.methods.window import Window
from strapgen.design.commit_late import commit_late_sources
from strapgen.design.commit_late.commit_late import CommitLate
from strapgen.design.commit_late.late_filters import LateFilters
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.lab.certificate.balls import BITS, ball, column_of, evaluate_single
from strapgen.lab.certificate.certificate_report import Angle, CertificateResult, Departure
from strapgen.lab.certificate.exact_step import ExactStep
from strapgen.lab.recordings.recording import Recording
from strapgen.run.backend_names import BACKENDS
from strapgen.run.backends import evaluator
from strapgen.run.evaluators import Array
from strapgen.run.increments import windows

#: Instants at which the attitudes are compared, at most.
_INSTANTS = 400


def certify_late(
    choice: Choice,
    backend: str,
    recording: Recording,
    *,
    settings: Settings | None = None,
    initial: Any = None,
) -> CertificateResult:
    """Certify the rounding of a unit that commits the attitude of a window late, along a whole recording.

    `initial` (3, 3): direction cosine matrix at the start; by default no rotation.
    """
    from flint import ctx

    window = choice.window
    if window is None:
        raise InputError(f"{choice.kernel} is no window; only a window's attitude is committed late")
    hertz = None if window.gyro is None else round(1 / recording.interval, 6)
    filters = commit_late_sources.family(window, hertz)
    count = len(recording.samples)
    if count < filters.samples:
        raise InputError(f"the recording holds {count} increments; the window takes {filters.samples}")
    run = _Run(window, choice.name, backend, hertz, settings, recording.samples, initial)
    if settings is not None:  # words cannot hold all filters, so that others stand in their place
        target = BACKENDS[backend].target
        rounded = commit_late_sources.parts(filters, choice.name, target, settings).filters
        filters = replace(rounded, scale=Fraction(1))
    with ctx.workprec(BITS):
        exact = _ExactLate(choice, filters, run.samples)
        total = now = None
        rows = [Departure(recording.start, 0, 0.0, 0.0, None, None, 0.0)]
        for (begin, before), (end, after) in zip(run.committed[:-1], run.committed[1:], strict=True):
            block = exact.rounding(before, after, begin, range(begin, end), count)
            total = block if total is None else block * total
            angle = Angle.of(total)
            if end in run.now:
                known = end + filters.window.ahead
                now = Angle.of(exact.rounding(after, run.now[end], end, range(end, known), known) * total)
            time = recording.start + recording.interval * end
            rows.append(
                Departure(time, end, angle.size, angle.radius, None, None, None if now is None else now.size)
            )
        assert total is not None and now is not None
        scale = [float(total[i, i] - 1) for i in range(3)]
        skew = tuple(float(total[i, j] + total[j, i]) / 2 for i, j in ((1, 2), (2, 0), (0, 1)))
    is_matrix = choice.name == "dcm"
    return CertificateResult(
        kernel=f"{choice.kernel} committed late",
        backend=backend,
        steps=count,
        duration_s=float(recording.interval * count),
        rounding_rad=angle.size,
        rounding_radius_rad=max(angle.radius, angle.axes_radius),
        rounding_axes_rad=angle.axes,
        largest_rounding_rad=max(row.rounding_rad for row in rows),
        header_bound_rad=None,
        truncation_rad=None,
        truncation_radius_rad=None,
        truncation_axes_rad=None,
        length_error=None if is_matrix else sum(scale) / 6,
        skew_rad=skew if is_matrix else None,
        scale=tuple(scale) if is_matrix else None,
        band_bound_rad=None,
        band_bound_status=None,
        band_hz=None,
        amplitude_deg_s=None,
        faults=[],
        departures=rows,
        start_rounding_rad=rows[1].rounding_rad,
        now_rounding_rad=now.size,
        now_rounding_radius_rad=max(now.radius, now.axes_radius),
        largest_now_rounding_rad=max(row.now_rounding_rad or 0.0 for row in rows),
    )


class _Run:
    """The attitudes of a unit along samples: committed, and of now."""

    def __init__(
        self,
        window: Window,
        state: str,
        backend: str,
        hertz: float | None,
        settings: Settings | None,
        samples: Array,
        initial: Any,
    ) -> None:
        unit = CommitLate(window, state, backend, hertz, settings)
        if initial is not None:
            matrix = np.asarray(initial, float)
            unit.reset(matrix if state == "dcm" else evaluator(f"{state}-from-dcm")(matrix))
        #: (N, 3): as the unit takes them
        self.samples = unit.taken(samples)
        every = max(1, -(-len(samples) // _INSTANTS))
        #: Attitudes after so many intervals
        self.committed: list[tuple[int, Array]] = [(0, unit.attitude)]
        #: Attitudes of now by the number of intervals that are committed
        self.now: dict[int, Array] = {}
        done = 0
        for number, sample in enumerate(self.samples, 1):
            commits = unit.push(sample)
            done += commits
            is_last = number == len(self.samples)
            if commits and (done % every == 0 or len(self.committed) == 1 or is_last):
                self.committed.append((done, unit.attitude))
                self.now[done] = unit.now()
        unit.flush()
        self.committed.append((len(self.samples), unit.attitude))


class _ExactLate:
    """The exact rotations of all intervals of a recording, in balls."""

    def __init__(self, choice: Choice, filters: LateFilters, samples: Array) -> None:
        self._step, self._filters, self._samples = ExactStep(choice), filters, samples
        _, rotation, _ = commit_late_sources.kernels(filters, choice.name)
        self._rotation = pipeline.program(rotation)
        step = self._rotation.inputs[0]
        self._identity = [int(k in ((0, 4, 8) if step.size == 9 else (3,))) for k in range(step.size)]

    def rounding(self, before: Array, after: Array, begin: int, intervals: range, count: int) -> Any:
        """Return the matrix from the exact attitude after intervals to the computed one.

        `count`: samples that are there.
        """
        state = self._step.state(before)
        window, inside = self._filters.window, []
        for k in intervals:
            if k < window.previous or k >= count - window.ahead:
                state = self._step.after(state, self._at_an_end(k, count))
            else:
                inside.append(k)
                if k + 1 not in intervals or k + 1 >= count - window.ahead:
                    state = self._step.after(state, self._inside(inside[0], k + 1))
        reached = self._step.matrix(state)
        return self._step.matrix(self._step.state(after)) * reached.inv()

    def _inside(self, first: int, last: int) -> Sequence[Any]:
        """Return the rotation of intervals that have whole windows."""
        window = self._filters.window
        row = self._samples[first - window.previous : last + window.ahead]
        steps = windows(row, 1, window.previous + window.ahead)
        return [column[0] for column in self._step.transitions(steps[None])]

    def _at_an_end(self, place: int, count: int) -> Sequence[Any]:
        """Return the rotation of an interval that has fewer samples on one side."""
        size = self._filters.samples
        first = 0 if place < self._filters.window.previous else count - size
        rows, samples = self._filters.sets[place - first], self._samples[first : first + size]
        columns = [column_of(column.tolist()) for column in samples.T]
        values = [
            sum((ball(tap) * x for tap, x in zip(taps, column, strict=True) if tap), 0 * column[0])
            for taps in rows
            for column in columns
        ]
        turn = evaluate_single(self._rotation, [*self._identity, *values])
        return [x if hasattr(x, "mid") else column_of([x])[0] for x in turn]


__all__ = ["certify_late"]
