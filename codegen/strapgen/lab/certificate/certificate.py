"""The certificate of a run: what rounding and the method did to the attitude on the way that was recorded.

A step turns the state x by the transition p of its increments, up to rounding: x+ = (1 + u) x p. After N steps the
computed attitude is M_N times the exact one, M <- (1 + u) M; balls hold u, and M. Nothing else enters than increments
and states, whatever computed them: carried errors, truncation and normalizations are in the states.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from strapgen import catalogue
from strapgen.catalogue import Choice
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.version import VERSION
from strapgen.lab.certificate import balls
from strapgen.lab.certificate.balls import BITS
from strapgen.lab.certificate.band_bound import BandBound
from strapgen.lab.certificate.certificate_report import Angle, CertificateResult, Departure, Fault
from strapgen.lab.certificate.exact_step import ExactStep, Restoring
from strapgen.lab.certificate.fitted_rotation import FittedRotation
from strapgen.lab.parallel_cases import resume, side_by_side
from strapgen.lab.recordings.recording import History
from strapgen.run.backends import Backend
from strapgen.run.increments import pulses, windows
from strapgen.storage import cache

Array = NDArray[np.float64]

#: Steps of a part of a run, whose balls are in memory at once.
_TOGETHER = 16_384
#: Part of all intervals up to which those that depart too far are faults of a run; more are another run.
_FEW = 0.1
#: Largest angle in rad that a bound of the state's length gives.
_SMALL = 1e-2
#: Part of a step by which the time of a state may differ from the end of a step.
_OFF = 0.01


class Rate(NamedTuple):
    """What is known of the true rate: it is a sum of lines in a band."""

    band_hz: float
    amplitude_deg_s: float  # sum of the amplitudes
    interval: float  # of samples, s

    @property
    def band(self) -> float:
        """Highest angular frequency in rad a sample."""
        return 2 * math.pi * self.band_hz * self.interval * (1 + 1e-12)

    @property
    def amplitude(self) -> float:
        """Sum of the amplitudes in rad a sample."""
        return math.radians(self.amplitude_deg_s) * self.interval * (1 + 1e-12)


@dataclass(frozen=True)
class Part:
    """Some steps of a run, with the states at the ends of blocks of them."""

    choice: Choice
    steps: int  # of a block
    states: NDArray[Any]  # (K + 1, state shape)
    samples: Array  # (K n N + beside, 3): increments in rad, as the algorithm takes them
    measured: Array | None  # before they were rounded to its format, where that changed them
    with_method: bool
    rate: Rate | None
    first: int = 0  # steps of the run before these
    restoring: Restoring | None = None


def certify(
    run: History,
    *,
    band_hz: float | str | Fraction | None = None,
    amplitude_deg_s: float | str | Fraction | None = None,
    with_method: bool = True,
    instants: int | None = 400,
    results: str | Path | None = None,
    jobs: int = 1,
) -> CertificateResult:
    """Certify what rounding and the method did to the attitude of a run along a recording.

    The states are compared with exact arithmetic on the same increments, in balls: the numbers hold for this run, where
    the bound of a header holds for every one.

    Parameters
    ----------
    run : History
        What `propagate` returns for an attitude step that multiplies the state by a transition, on any back end.
    band_hz, amplitude_deg_s : number, optional
        If the true rate is a sum of lines at up to `band_hz` in Hz, whose amplitudes add up to `amplitude_deg_s` in
        deg/s (the length of the sums about x, y, z), the attitude is within ``band_bound_rad`` of the true one, if it
        was at the start and the increments are those of the rate.
    with_method : bool, optional
        Whether the step is also compared with the exact rotation of the rate that it fits to its samples.
    instants : int, optional
        Number of states, of those that the run has, that are compared; None for all of them.
    results : path, optional
        File for the results of finished parts, from which an interrupted certificate goes on.
    jobs : int, optional
        Number of processes.

    Returns
    -------
    CertificateResult
        Angles in rad about reference axes, each with the radius of its ball, rounded up.

    Raises
    ------
    InputError
        If the run does not say along which increments it went, its step multiplies by no transition, the states are not
        those of this step along these increments, or a band is stated without an amplitude.
    MissingExtraError
        If python-flint is not installed.

    Examples
    --------
    >>> from strapgen import Recording, backend, propagate
    >>> turns = np.random.default_rng(1).normal(0, 0.01, (400, 3))
    >>> run = propagate(backend("euler", backend="c-fixed32"), Recording(0.0, 0.01, turns))
    >>> certificate = certify(run)
    >>> certificate.rounding_rad < certificate.header_bound_rad / 10, certificate.rounding_radius_rad < 1e-20
    (True, True)
    """
    balls.flint()
    backend, taken = run.backend, run.taken
    if backend is None or taken is None:
        raise InputError("the run does not say along which increments it went; one along one piece is needed")
    choice = backend.choice
    if choice is None:
        raise InputError(
            f"the back end of {backend.kernel} tells no choice; one of strapgen.backend is needed"
        )
    rate = _rate(run, band_hz, amplitude_deg_s)
    _check_state(backend)
    fit = catalogue.fit(choice) if with_method or rate is not None else None
    if rate is not None and fit is None:
        raise InputError(
            f"a band bounds nothing for {choice.kernel}, which fits no rate to its samples; "
            "leave band_hz and amplitude_deg_s out"
        )
    run = _thinned(run, instants)
    places = _places(run)
    parts = _parts(run, places, choice, with_method and fit is not None, rate)
    if results is None:
        finished = side_by_side(depart, parts, jobs)
    else:
        finished = resume(depart, parts, results, _identity(run, choice, with_method, rate), jobs)
    return _joined(run, places, {int(name): rows for name, rows in finished}, rate)


def _thinned(run: History, instants: int | None) -> History:
    """Return a run with no more than so many states, the first and the last among them."""
    if instants is None or len(run.time) <= checks.count("instants", instants, smallest=2):
        return run
    every = math.ceil((len(run.time) - 1) / (instants - 1))
    chosen = np.unique([*range(0, len(run.time), every), len(run.time) - 1])
    return replace(run, time=run.time[chosen], states=run.states[chosen])


def _check_state(backend: Backend) -> None:
    """Refuse a state whose numbers a double does not hold."""
    fixed = backend.sources.fixed
    if fixed is not None and fixed.inputs[0].format.word > 53:
        raise InputError(
            f"states of {fixed.inputs[0].format.word} bits are rounded in a run's record; up to 53 bits are certified"
        )


def _rate(run: History, band_hz: Any, amplitude: Any) -> Rate | None:
    """Return what is stated of the true rate."""
    if (band_hz is None) != (amplitude is None):
        missing = "amplitude_deg_s" if amplitude is None else "band_hz"
        raise InputError(f"{missing} is needed too: a band and the sum of the amplitudes in it go together")
    if band_hz is None or run.taken is None:
        return None
    data = run.taken.recording
    rate = Rate(
        float(checks.number("band_hz", band_hz, positive=True)),
        float(checks.number("amplitude_deg_s", amplitude, positive=True)),
        data.interval,
    )
    if rate.band >= math.pi:
        raise InputError(
            f"band_hz is {band_hz}; below half the sampling rate, {0.5 / data.interval:g} Hz, is needed"
        )
    turns = np.linalg.norm(data.samples, axis=1)
    place = int(turns.argmax())
    if turns[place] > rate.amplitude * (1 + 1e-9):
        raise InputError(
            f"amplitude_deg_s is {amplitude}, but increment {place + 1} turns at "
            f"{math.degrees(turns[place]) / data.interval:.6g} deg/s"
        )
    return rate


def _places(run: History) -> NDArray[np.int64]:
    """Return the numbers of steps after which the states are known."""
    assert run.backend is not None and run.taken is not None
    start = run.taken.recording.start + run.taken.recording.interval * run.backend.previous
    exact = (run.time - start) / run.step
    places = np.rint(exact).astype(np.int64)
    off = np.flatnonzero(np.abs(exact - places) > np.maximum(_OFF, 1e-9 * np.abs(exact)))
    if len(off):
        raise InputError(
            f"the state at {run.time[off[0]]:.9g} s is at no end of a step of {run.step:.6g} s from {start:.9g} s on"
        )
    wrong = np.flatnonzero(np.diff(places) < 1)
    if len(wrong):
        raise InputError(f"the state at {run.time[wrong[0] + 1]:.9g} s is not after that before it")
    count, beside = run.backend.increments, run.backend.previous + run.backend.ahead
    most = (len(run.taken.recording.samples) - beside) // count
    if len(places) < 2 or places[0] < 0 or places[-1] > most:
        raise InputError(
            f"{len(places)} states at {run.time[0]:.9g} s to {run.time[-1]:.9g} s do not lie along the recording's "
            f"{most} steps from {start:.9g} s on"
        )
    return places


def _parts(
    run: History, places: NDArray[np.int64], choice: Choice, with_method: bool, rate: Rate | None
) -> dict[str, Part]:
    """Return a run in parts of equal blocks, by the number of the first state."""
    backend, taken = run.backend, run.taken
    assert backend is not None and taken is not None
    count, beside = backend.increments, backend.previous + backend.ahead
    row = taken.recording.samples
    if taken.pulse is not None:
        row = pulses(row[:, None], taken.pulse)[:, 0]
    rounded, every = _as_taken(backend, row), taken.orthonormalize_every
    kernel = backend.orthonormalization
    # Parameters stay where they are, but for their length.
    is_matrix = backend.attitude is None
    restoring = Restoring(kernel, every) if is_matrix and every and kernel is not None else None
    same = np.array_equal(rounded, row)
    lengths, first, parts = np.diff(places), 0, {}
    while first < len(lengths):
        length = int(lengths[first])
        last = first + 1
        while last < len(lengths) and lengths[last] == length and (last + 1 - first) * length <= _TOGETHER:
            last += 1
        within = slice(int(places[first]) * count, int(places[last]) * count + beside)
        parts[str(first)] = Part(
            choice,
            length,
            np.asarray(run.states[first : last + 1], np.float64),
            rounded[within],
            None if same else row[within],
            with_method,
            rate,
            int(places[first]),
            restoring,
        )
        first = last
    return parts


def _as_taken(backend: Backend, row: Array) -> Array:
    """Return increments as the algorithm takes them, in its format."""
    per_step = backend.samples_per_step
    padded = np.zeros((-(-len(row) // per_step) * per_step, 3))
    padded[: len(row)] = row
    taken = backend.representable(padded.reshape(-1, per_step, 3))
    return np.asarray(taken, np.float64).reshape(-1, 3)[: len(row)]


def _identity(run: History, choice: Choice, with_method: bool, rate: Rate | None) -> dict[str, Any]:
    """Return what results belong to."""
    assert run.taken is not None and run.backend is not None
    samples = cache.digest([np.ascontiguousarray(run.taken.recording.samples).tobytes()])
    states = cache.digest([np.ascontiguousarray(run.states).tobytes(), run.time.tobytes()])
    return {
        "study": "certificate",
        "version": VERSION,
        "code": cache.generator_digest(),
        "algorithm": choice.identity,
        "backend": run.backend.name,
        "increments": samples,
        "states": states,
        "with_method": with_method,
        "rate": None if rate is None else list(rate),
    }


# Parts


@lru_cache(maxsize=4)
def _steps(choice: Choice, with_fit: bool) -> tuple[ExactStep, FittedRotation | None]:
    fit = catalogue.fit(choice) if with_fit else None
    return ExactStep(choice), None if fit is None else FittedRotation(fit)


@lru_cache(maxsize=4)
def _band_bound(choice: Choice, rate: Rate) -> BandBound:
    fit = catalogue.fit(choice)
    assert fit is not None, "checked before"
    return BandBound.of(fit, choice.increments_per_step, choice.previous, rate.band, rate.amplitude)


class _Block(NamedTuple):
    """What happened in a block of steps: rotations as matrices near 1, and the bound of what the band allows."""

    rounding: Any  # from the exact algorithm, with its orthonormalizations, to the states
    restoring: Any  # from the exact steps to these with exact orthonormalizations
    method: Any  # from the rotation of the fitted rate to the exact algorithm
    whole: Any  # from the rotation of the rate that is fitted to what was measured to the states
    band: float  # rad

    def written(self) -> list[Any]:
        """Return the block as plain JSON data, exactly."""
        return [*(None if x is None else [*map(_text, x.entries())] for x in self[:-1]), self.band]

    @classmethod
    def read(cls, row: Sequence[Any]) -> _Block:
        """Return the block from what `written` returns."""
        from flint import arb_mat

        rounding, restoring, method, whole = (x and arb_mat(3, 3, [*map(_ball, x)]) for x in row[:-1])
        return cls(rounding, restoring, method, whole, row[-1])


def _text(x: Any) -> str:
    """Return a ball as a text, exactly."""
    return " ".join(f"{int(part)}" for end in (x.mid(), x.rad()) for part in end.man_exp())


def _ball(text: str) -> Any:
    from flint import arb

    middle, exponent, radius, of_radius = map(int, text.split())
    two = arb(2)
    return arb(middle) * two**exponent + arb(0, arb(radius) * two**of_radius)


def depart(part: Part) -> list[list[Any]]:
    """Return what happened in each block of a part, see `_Block.written`."""
    from flint import ctx

    count, beside = part.choice.increments_per_step, part.choice.previous + part.choice.ahead
    samples = windows(part.samples, count, beside)
    shape = (-1, part.steps, *samples.shape[1:])
    angles = np.zeros(len(samples))
    if part.rate is not None:
        of_band = samples if part.measured is None else windows(part.measured, count, beside)
        angles = _band_bound(part.choice, part.rate).angles(of_band)
    bands = np.nextafter(angles.reshape(-1, part.steps).sum(axis=1) * (1 + 1e-12), np.inf)
    step, fitted = _steps(part.choice, part.with_method or part.rate is not None)
    with ctx.workprec(BITS):
        exact = step.transitions(samples.reshape(shape))
        turns = None if fitted is None else fitted.rotations(samples.reshape(shape))
        true = turns
        if fitted is not None and part.rate is not None and part.measured is not None:
            true = fitted.rotations(windows(part.measured, count, beside).reshape(shape))
        rows = []
        for k in range(len(part.states) - 1):
            before, after = (step.state(part.states[k + i]) for i in (0, 1))
            reached = step.matrix(step.after(before, [column[k] for column in exact]))
            computed, begun = step.matrix(after), step.matrix(before)
            method = whole = None
            if fitted is not None and turns is not None and part.with_method:
                method = reached * (begun * fitted.matrix([column[k] for column in turns])).inv()
            if fitted is not None and true is not None and part.rate is not None:
                whole = computed * (begun * fitted.matrix([column[k] for column in true])).inv()
            band, restored, restoring = float(bands[k]) if part.rate is not None else 0.0, reached, None
            first, every = part.first + k * part.steps, part.restoring.every if part.restoring else 0
            if part.restoring and first // every != (first + part.steps) // every:
                block = samples[k * part.steps : (k + 1) * part.steps]
                restored = step.matrix(step.restored(before, block, first, part.restoring))
                restoring = restored * reached.inv()
            rows.append(_Block(computed * restored.inv(), restoring, method, whole, band).written())
    return rows


def roundings(
    choice: Choice, steps: int, states: Sequence[NDArray[Any]], samples: Iterable[Array]
) -> Iterator[Departed]:
    """Yield what rounding has made of a state after every block of so many steps.

    `states`: at the start, and after each block. `samples` ((n N + beside, 3) each): increments of a block in rad, as
    the algorithm takes them.
    """
    from flint import ctx

    total = None
    for first, (last, row) in enumerate(zip(states[1:], samples, strict=True)):
        part = Part(choice, steps, np.stack([states[first], last]), row, None, False, None)
        with ctx.workprec(BITS):
            matrix = _Block.read(depart(part)[0]).rounding
            total = matrix if total is None else matrix * total
            angle, scale = Angle.of(total), _shape(total)[0]
            if last.size == matrix.nrows() * matrix.ncols():
                apart = (total - _one()).entries()
                distance = math.hypot(*(float(abs(x).upper()) for x in apart))
            else:  # parameters turn by half the angle
                distance = math.hypot(angle.above / 2, sum(scale) / 6)
            yield Departed(angle, distance)


class Departed(NamedTuple):
    """What rounding has made of a state."""

    angle: Angle
    distance: float  # from the exact state, for a state of length 1 or a matrix near a rotation


# The whole


def _joined(
    run: History, places: NDArray[np.int64], parts: Mapping[int, Sequence[Any]], rate: Rate | None
) -> CertificateResult:
    """Return the certificate of all parts."""
    from flint import ctx

    backend = run.backend
    assert backend is not None
    with ctx.workprec(BITS):
        blocks = [_Block.read(row) for first in sorted(parts) for row in parts[first]]
    bound, with_method = _header_bound(run), blocks[0].method is not None
    one = _one()
    rounding, restoring, method, whole, band = one, one, one, one, 0.0
    rows = [Departure(float(run.time[0]), 0, 0.0, 0.0, 0.0, 0.0 if with_method else None)]
    faults = []
    with ctx.workprec(BITS):
        for k, (block, length) in enumerate(zip(blocks, np.diff(places).tolist(), strict=True)):
            alone, limit = Angle.of(block.rounding), _limit(run, bound, int(places[k]), length)
            if limit is not None and not alone.size - alone.radius <= limit:
                faults.append(Fault(float(run.time[k]), float(run.time[k + 1]), alone.size, limit))
            rounding = block.rounding * rounding
            restoring = restoring if block.restoring is None else block.restoring * restoring
            method = block.method * method if with_method else method
            whole, band = (block.whole * whole, band + block.band) if rate is not None else (whole, band)
            computed, steps = Angle.of(rounding), int(places[k + 1] - places[0])
            truncation = Angle.of(method) if with_method else None
            rows.append(
                Departure(
                    *(float(run.time[k + 1]), steps, computed.size, computed.radius, bound(steps)),
                    None if truncation is None else truncation.size,
                )
            )
        if len(faults) > max(1.0, _FEW * len(blocks)):
            first = faults[0]
            raise InputError(
                f"the states are not those of {backend.kernel} in the formats of {backend.name} along these "
                f"increments: from {first.from_s:.9g} s to {first.to_s:.9g} s they turn by {first.angle_rad:.3g} rad, "
                f"where rounding makes at most {first.bound_rad:.2g} rad"
            )
        within = None
        if rate is not None:
            within = math.nextafter((Angle.of(whole).above + band) * (1 + 1e-12), math.inf)
        matrix, shape = backend.attitude is None, _shape(rounding)
        is_restored = any(block.restoring is not None for block in blocks)
        turned = Angle.of(restoring).size if is_restored else None
    return CertificateResult(
        kernel=backend.kernel,
        backend=backend.name,
        steps=rows[-1].steps,
        duration_s=float(run.time[-1] - run.time[0]),
        rounding_rad=computed.size,
        rounding_radius_rad=max(computed.radius, computed.axes_radius),
        rounding_axes_rad=computed.axes,
        largest_rounding_rad=max(row.rounding_rad for row in rows),
        header_bound_rad=rows[-1].header_bound_rad,
        orthonormalization_rad=turned,
        truncation_rad=None if truncation is None else truncation.size,
        truncation_radius_rad=None if truncation is None else truncation.radius,
        truncation_axes_rad=None if truncation is None else truncation.axes,
        length_error=None if matrix else sum(shape[0]) / 6,
        skew_rad=shape[1] if matrix else None,
        scale=shape[0] if matrix else None,
        band_bound_rad=within,
        band_bound_status=None if within is None else "proved",
        band_hz=None if rate is None else rate.band_hz,
        amplitude_deg_s=None if rate is None else rate.amplitude_deg_s,
        faults=faults,
        departures=rows,
    )


def _one() -> Any:
    from flint import arb_mat

    return arb_mat(3, 3, [int(i == j) for i in range(3) for j in range(3)])


def _shape(matrix: Any) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the scale and the skew of a matrix near 1: its diagonal, and the means across it."""
    scale = tuple(float(matrix[i, i] - 1) for i in range(3))
    skew = tuple(float(matrix[i, j] + matrix[j, i]) / 2 for i, j in ((1, 2), (2, 0), (0, 1)))
    return scale, skew


def _limit(run: History, bound: Callable[[int], float | None], first: int, steps: int) -> float | None:
    """Return the most that rounding makes in some steps, of which the first follows `first` others; None if not known.

    An orthonormalization of a matrix removes skew, of which no header tells how far it turns the attitude.
    """
    assert run.taken is not None
    every = run.taken.orthonormalize_every
    if not every or first // every == (first + steps) // every:
        return bound(steps)
    return None if run.states.ndim > 2 else bound((steps // every + 1) * every)


def _header_bound(run: History) -> Callable[[int], float | None]:
    """Return a function from a number of steps to the bound of the angle that the header of the code states."""
    backend, taken = run.backend, run.taken
    assert backend is not None and taken is not None
    states = np.asarray(run.states, np.float64)
    if states.ndim == 2:
        shortest = float(np.linalg.norm(states, axis=1).min())
    else:
        shortest = float(np.linalg.svd(states, compute_uv=False).min())
    every, rounding = taken.orthonormalize_every, backend.sources.rounding
    largest = float(np.abs(taken.recording.samples).max(initial=0.0))
    # The sine of half the angle is at most the distance by the length; of matrices, whose rows are that far apart, the
    # nearest rotations differ by at most the root of 6 times the distance by the least singular value.
    factor = 2 if states.ndim == 2 else math.sqrt(6)

    def distance(steps: int) -> float:
        if every:
            return math.inf
        if rounding is None or rounding.accumulation is None:
            return backend.rounding_bound(steps) or math.inf
        covered = (
            all(largest <= condition.high for condition in rounding.inputs[1:]) and not rounding.conditions
        )
        return rounding.accumulation.bound(steps) if covered else math.inf

    def bound(steps: int) -> float | None:
        angle = factor * distance(steps) / shortest * (1 + 1e-3)
        known = [backend.angle_bound(steps, orthonormalize_every=every, shortest=shortest)]
        known += [angle] if angle < _SMALL else []
        return min((one for one in known if one is not None), default=None)

    return bound
