"""`compare` runs back ends over the same increments and measures the difference of each from a reference."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen import fixedpoint, pipeline
from strapgen.catalogue import AnyAlgorithm, Choice, choose_step, named
from strapgen.catalogue.choice import AnyMethod
from strapgen.ir import checks
from strapgen.ir.exceptions import CompilerError, InputError, InputTypeError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.notebook_display import notebook_html, short_repr, to_pandas
from strapgen.ir.read_only import ReadOnly
from strapgen.ir.renamed import warn
from strapgen.lab.cost import code_size
from strapgen.lab.motions.motions import motion
from strapgen.lab.runs import attitude, drift_between, require_finite, samples_of_steps
from strapgen.results.records import INTERNAL, Record, entry
from strapgen.results.table import ANGLE
from strapgen.run.backends import BACKENDS, DEFAULT_BACKENDS, Backend, sources_to_build
from strapgen.run.backends import backend as attitude_backend
from strapgen.run.compiler import C, compile_together
from strapgen.run.increments import pulses
from strapgen.targets import TARGETS

Array = NDArray[np.float64]

#: The motion of a comparison without samples: rates of coning in deg/s, step in s, number of steps.
CONING_DEG_S, STEP, STEPS = dict.fromkeys(("a_deg_s", "b_deg_s", "g_deg_s"), 10), Fraction(1, 100), 1000
#: Number of timed runs, of which the shortest counts.
_TIMED = 3
#: Number of steps, about, at which a history has the certified bound.
_BOUNDS = 65
#: Angle up to which a bound of an angle is taken, in rad: lengths then differ by less than a sixty-fourth.
_SMALL_ANGLE = 1 / 32


@dataclass(frozen=True)
class AngleHistory(ReadOnly):
    """The angle of a back end from the reference along a run."""

    #: (1 + N,): the angle after every step in rad, the first one before the run
    angles_rad: Array
    #: Numbers of steps, and the certified bound of the angle after as many; empty where no useful bound is
    #: known
    bounds_rad: tuple[tuple[int, float], ...]


def _in_words(operations: Mapping[str, int]) -> str:
    return ", ".join(f"{number} {kind}" for kind, number in operations.items() if number)


@dataclass(frozen=True)
class Comparison(ReadOnly, Record):
    """A back end beside a reference.

    Parameters
    ----------
    backend : str
    max_abs_rad, rms_rad : float
        Largest and root-mean-square angle from the reference's attitude over all steps, in rad.
    max_ulp : float
        Largest difference of an element of the state, in units in the last place of the back end's format near 1.
    bound_rad : float or None
        Certified bound of `max_abs_rad` in fixed point, against exact arithmetic on the increments of the run; None in
        floating point, and where no useful bound is known.
    drift_deg : float
        Mean drift (thesis, chapter 5) from the truth, or from the reference where the truth is not known, in deg.
    ns_per_step : float
        Time of a step in nanoseconds, in a run that records all states.
    bytes : int or None
        Size of code and constants in object code; None for Python.
    operations : mapping of str to int
        Number of operations of a step by kind.
    history : AngleHistory, optional
        The angle along the run, for a plot; no part of the JSON data.
    kernel : str, optional

    Examples
    --------
    >>> (row,) = compare("euler", "rk4", 2, ["numpy"], np.full((5, 2, 3), 0.01))
    >>> row.backend, row.max_abs_rad, row.operations["multiply"]
    ('numpy', 0.0, 37)
    """

    backend: str = field(metadata=entry("back end", align="<"))
    max_abs_rad: float = field(metadata=entry("largest", ANGLE))
    rms_rad: float = field(metadata=entry("rms", ANGLE))
    max_ulp: float = field(metadata=entry("ulp", ".3g"))
    bound_rad: float | None = field(metadata=entry("certified", ANGLE))
    drift_deg: float = field(metadata=entry("drift", ".4g"))
    ns_per_step: float = field(metadata=entry("ns/step", ".1f"))
    bytes: int | None = field(metadata=entry("bytes"))
    operations: Mapping[str, int] = field(metadata=entry("operations", align="<", cell=_in_words, split=True))
    history: AngleHistory | None = field(default=None, repr=False, compare=False, metadata=INTERNAL)
    kernel: str = field(default="", metadata=entry("kernel", align="<"))

    __repr__ = short_repr

    def _in_words(self) -> str:
        bound = "" if self.bound_rad is None else f", certified {self.bound_rad:.3g} rad"
        angle = f"angle from the reference up to {self.max_abs_rad:.3g} rad{bound}"
        return f"{self.backend}: {angle}\ndrift {self.drift_deg:.4g} deg, {self.ns_per_step:.1f} ns a step"


class Comparisons(tuple[Comparison, ...]):
    """Back ends beside one reference, a `Comparison` each; a tuple that a notebook shows as a table.

    Examples
    --------
    >>> rows = compare("euler", "rk4", 2, ["numpy", "exact"], np.full((5, 2, 3), 0.01))
    >>> [row.backend for row in rows]
    ['numpy', 'exact']
    """

    __repr__ = short_repr
    _repr_html_ = notebook_html
    to_pandas = to_pandas

    def _in_words(self) -> str:
        return "\n".join(f"{row.backend}: up to {row.max_abs_rad:.3g} rad from the reference" for row in self)


def compare(
    algorithm: AnyAlgorithm,
    method: AnyMethod | None = None,
    increments: int | None = None,
    backends: Sequence[str | Backend] | None = None,
    samples: Any = None,
    *,
    reference: str = "numpy",
    truth: Array | None = None,
    settings: Settings | None = None,
) -> Comparisons:
    """Run an algorithm on several back ends and compare each with a reference.

    Parameters
    ----------
    algorithm, method, increments : optional
        As for `strapgen.backend`. A choice, and that of an algorithm object, has its own method and increments a step.
    backends : sequence of str or Backend, optional
        Keys of `BACKENDS`, by default all but the slow ones that can run here: those in C need a compiler, those in
        fixed point an algorithm that it can compute. Or back ends of the same step, as `verification.file_backend`
        makes one of a file.
    samples : array_like, (N, K, 3), optional
        Angle increments of N steps in rad, body axes; every back end rounds the same ones to its own format. Where
        settings state a gyro that counts, all back ends take its counts, and the rest of each goes into the next. By
        default those of 1000 steps of 0.01 s of coning with all three parameters at 10 deg/s, whose true attitude is
        then the truth.
    reference : str, optional
        A key of `BACKENDS`; "exact" shows all rounding.
    truth : array, (1 + N, 3, 3), optional
        True direction cosine matrices.
    settings : Settings, optional
        Settings of fixed point; by default for increments of the size of these.

    Returns
    -------
    Comparisons
        A tuple of `Comparison`, in the order of `backends`.

    Raises
    ------
    InputError, InputTypeError
        If a name is not allowed, the samples do not fit, or a run leaves the range of a back end's numbers.

    Examples
    --------
    >>> rows = compare("euler", "rk4", 2, ["numpy", "c"], np.full((5, 2, 3), 0.01))
    >>> [row.backend for row in rows], rows[0].max_abs_rad
    (['numpy', 'c'], 0.0)
    """
    if hasattr(increments, "__len__") or isinstance(samples, Integral):
        warn("compare(samples=count, increments=array)", "compare(increments=count, samples=array)")
        increments, samples = samples, increments
    choice = choose_step(named("compare", algorithm), method, increments)
    if backends is None:
        backends = usable_backends(choice)
    for name in backends:
        if not isinstance(name, Backend):
            checks.choice("backend", name, BACKENDS)
    checks.choice("reference", reference, BACKENDS)
    if not backends:
        raise InputError("no back end is named; at least one is needed")
    if settings is not None and not isinstance(settings, Settings):
        raise InputTypeError(f"settings is {checks.describe(settings)}; strapgen.Settings is needed")
    if samples is None:
        samples, true = _coning(choice)
        truth = true if truth is None else truth
    d = checks.numbers("samples", samples, (None, None, 3))
    fixed = (settings or Settings()).for_increments(float(np.abs(d).max(initial=0.0)))

    def settings_of(name: str) -> Settings | None:
        return fixed if BACKENDS[name].fixed else None

    def load(name: str) -> Backend:
        return attitude_backend(choice, backend=name, settings=settings_of(name))

    names = [reference, *(name for name in backends if isinstance(name, str))]
    compile_together(s for name in names for s in sources_to_build(choice, name, settings_of(name)))
    if fixed.sensor is not None:
        d = pulses(d, fixed.sensor.count, choice.previous + choice.ahead)
    standard = load(reference)
    states: Array = standard.propagate(d).astype(np.float64)
    require_finite(standard, states, np.arange(len(states), dtype=np.float64))
    matrices = attitude(standard, states)
    rows = (
        _compare(name, load(name), d, states, matrices, truth)
        if isinstance(name, str)
        else _compare(name.name, name, d, states, matrices, truth)
        for name in backends
    )
    return Comparisons(replace(row, kernel=choice.kernel) for row in rows)


def usable_backends(choice: Choice) -> tuple[str, ...]:
    """Return the back ends of a comparison that names none: those that run here and can compute the algorithm."""
    compiler = False
    with suppress(CompilerError):
        compiler = bool(C.command())
    can_fix = fixedpoint.can_lower(pipeline.program(choice))
    return tuple(
        name
        for name in DEFAULT_BACKENDS
        if (can_fix or not BACKENDS[name].fixed) and (compiler or not TARGETS[BACKENDS[name].target].compiled)
    )


def _coning(choice: Choice) -> tuple[Array, Array]:
    """Return the samples of a coning motion for the steps of a choice, and its attitude."""
    profile = motion("coning", **CONING_DEG_S)
    read = samples_of_steps(attitude_backend(choice), profile, STEP)
    return read(0, STEPS), profile.attitude(np.arange(1 + STEPS) * float(STEP))


def _compare(
    name: str,
    candidate: Backend,
    increments: Array,
    reference: Array,
    matrices: Array,
    truth: Array | None,
) -> Comparison:
    """Compare a back end, under the name that was asked for, with the states and the attitudes of the reference."""
    steps = len(increments)
    states = candidate.propagate(increments)
    run, seconds = candidate.prepared(increments), math.inf
    for _ in range(1 if name in BACKENDS and BACKENDS[name].slow else _TIMED):
        start = time.perf_counter()
        run()
        seconds = min(seconds, time.perf_counter() - start)
    require_finite(candidate, states, np.arange(1 + steps, dtype=np.float64))
    computed = attitude(candidate, states)
    angles = np.linalg.norm(drift_between(computed, matrices), axis=-1)
    drifts = drift_between(computed, matrices if truth is None else truth)
    bound = _angle_bound(candidate, increments, reference)
    return Comparison(
        name,
        float(angles.max()),
        float(np.sqrt(np.mean(angles**2))),
        float(np.abs(states.astype(np.float64) - reference).max() / candidate.unit),
        bound(steps),
        math.degrees(float(np.linalg.norm(np.abs(drifts).max(axis=0)))),
        seconds / max(1, steps) * 1e9,
        code_size(candidate.sources),
        candidate.sources.operations,
        AngleHistory(angles, _bounds(bound, steps)),
    )


def certified_angle(candidate: Backend, increments: Array, reference: Array) -> float | None:
    """Return the certified bound of the angle between a run in fixed point and the exact one.

    The angle is the length of the drift vector, the skew-symmetric part of the product of one matrix and the transpose
    of the other. Where states differ by at most b in length, and reference states have at most length s, it is at most
    sqrt(3/2) s b for rows of matrices, and 2 s b (s^2 + s b) for Euler parameters. Where rounding turns these by an
    angle of at most a, it changes their length by no more than a factor exp(a/2), and the drift vector is at most
    a s^4 exp(a).

    `increments` has shape (N, K, 3). `reference` (1 + N, state shape): states of the exact run.
    """
    return _angle_bound(candidate, increments, reference)(len(increments))


def _angle_bound(candidate: Backend, increments: Array, reference: Array) -> Callable[[int], float | None]:
    """Return a function from a number of steps of a run to the bound of `certified_angle` after as many."""
    rounded = not np.array_equal(candidate.representable(increments), increments)
    matrix = candidate.attitude is None
    norms = np.linalg.norm(reference, ord=2, axis=(-2, -1)) if matrix else np.linalg.norm(reference, axis=-1)
    size = float(norms.max())
    # The computed state is as long as the exact one up to a factor exp(a/2).
    shortest = float(norms.min()) * math.exp(-_SMALL_ANGLE / 2)
    # What saturates loses a unit of an element of 1 in a step, and of a larger one what it exceeds 1 by.
    excess = max(0.0, float(np.abs(reference).max()) - 1) if candidate.saturates else 0.0

    def bound(steps: int) -> float | None:
        known = []
        length = candidate.rounding_bound(steps, rounded)
        if length is not None and math.isfinite(length):
            length *= 1 + excess / candidate.unit
            known.append(
                math.sqrt(1.5) * size * length if matrix else 2 * size * length * (size**2 + size * length)
            )
        angle = None if matrix else candidate.angle_bound(steps, rounded, shortest=shortest)
        if angle is not None and angle < _SMALL_ANGLE:
            known.append(angle * size**4 * math.exp(angle))
        return min(known, default=None)

    return bound


def _bounds(bound: Callable[[int], float | None], steps: int) -> tuple[tuple[int, float], ...]:
    """Return steps along a run with their bounds."""
    every = sorted({*range(1, steps + 1, -(-steps // _BOUNDS) or 1), steps} - {0})
    pairs = [(step, bound(step)) for step in every]
    return tuple((step, value) for step, value in pairs if value is not None)
