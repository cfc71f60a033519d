"""Back ends side by side: the same algorithm on the same increments, in lock-step, against a reference."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen import catalogue
from strapgen.backends import BACKENDS, Backend, exact, of
from strapgen.catalogue import Choice
from strapgen.catalogue.methods.tableau import Tableau
from strapgen.ir.fixed_settings import Settings
from strapgen.library import generated_sources
from strapgen.simulation.runs import attitude, drift_between, require_finite
from strapgen.support import checks
from strapgen.support.exceptions import InputError
from strapgen.targets import FIXED
from strapgen.toolchain import compiler

Array = NDArray[np.float64]

#: What may be compared with: any back end, or arithmetic of many digits.
EXACT = "exact"
#: Back ends that are compared by default.
DEFAULT = ("numpy", "c", "c-float", "c-q31", "c-q15")
#: Runs that are timed; the shortest counts.
_TIMED = 3


@dataclass(frozen=True)
class Comparison:
    """What a back end does to an algorithm.

    Parameters
    ----------
    backend : str
    max_abs_rad, rms_rad : float
        Largest and root-mean-square angle from the reference's attitude over all steps, in rad.
    max_ulp : float
        Largest difference of an element of the state, in units of the last place of the back end's format near 1.
    bound_rad : float or None
        Certified bound of `max_abs_rad` in fixed point, against exact arithmetic on the given increments; None in
        floating point, and where no bound of use is known.
    drift_deg : float
        Mean drift (thesis, chapter 5) from the truth, or from the reference where the truth is not known, in deg.
    ns_per_step : float
        Time of a step in a run with all states kept, in nanoseconds.
    bytes : int or None
        Code and constants in object code; None for Python.
    operations : dict of str to int
        Operations of a step by kind.
    """

    backend: str
    max_abs_rad: float
    rms_rad: float
    max_ulp: float
    bound_rad: float | None
    drift_deg: float
    ns_per_step: float
    bytes: int | None
    operations: dict[str, int]

    def as_dict(self) -> dict[str, Any]:
        """Return the comparison as plain JSON data."""
        return asdict(self)


def compare(
    algorithm: str,
    method: str | Tableau | None,
    samples: int | None,
    backends: Sequence[str],
    increments: Any,
    *,
    reference: str = "numpy",
    truth: Array | None = None,
    settings: Settings | None = None,
    previous: int = 0,
) -> list[Comparison]:
    """Run an algorithm on several back ends and hold each against a reference.

    Parameters
    ----------
    algorithm, method, samples, previous
        As for `strapgen.backend`; samples are the increments of a step.
    backends : sequence of str
        Keys of `BACKENDS`.
    increments : array_like, (N, K, 3)
        Angle increments of N steps in rad; every back end is given the same ones and rounds them to its own format.
    reference : str, optional
        A back end, or "exact".
    truth : array, (1 + N, 3, 3), optional
        True direction cosine matrices.
    settings : Settings, optional
        What fixed point is made for; by default increments of the size of these.

    Returns
    -------
    list of Comparison
        In the order of `backends`.

    Raises
    ------
    InputError
        If a name is not allowed, or a run leaves the range of a back end's numbers.

    Examples
    --------
    >>> rows = compare("euler", "rk4", 2, ["numpy", "c"], np.full((5, 2, 3), 0.01))
    >>> [row.backend for row in rows], rows[0].max_abs_rad
    (['numpy', 'c'], 0.0)
    """
    choice = catalogue.choose_step(algorithm, method, samples, previous=previous)
    return compare_choice(choice, backends, increments, reference=reference, truth=truth, settings=settings)


def compare_choice(
    choice: Choice,
    backends: Sequence[str],
    increments: Any,
    *,
    reference: str = "numpy",
    truth: Array | None = None,
    settings: Settings | None = None,
) -> list[Comparison]:
    """Run a chosen attitude step on several back ends; parameters and errors are those of `compare`."""
    for name in backends:
        checks.choice("backend", name, BACKENDS)
    checks.choice("reference", reference, [*BACKENDS, EXACT])
    if not backends:
        raise InputError("no back end is named; at least one is needed")
    d = np.asarray(increments, np.float64)
    chosen = (settings or Settings()).for_increments(float(np.abs(d).max(initial=0.0)))

    def make(name: str) -> Backend:
        own = chosen if BACKENDS[name].target in FIXED else None
        return of(choice, name, settings=own)

    wanted = _reference(make, choice, reference, d)
    matrices = attitude(make("numpy"), wanted)
    return [_compared(make(name), d, wanted, matrices, truth) for name in backends]


def _reference(make: Any, choice: Choice, reference: str, increments: Array) -> Array:
    """Return the states of the reference, in double."""
    if reference == EXACT:
        return exact.propagate(generated_sources.program(choice), increments)
    backend = make(reference)
    states: Array = backend.propagate(increments).astype(np.float64)
    require_finite(backend, states, np.arange(len(states), dtype=np.float64))
    return states


def _compared(
    candidate: Backend, increments: Array, wanted: Array, matrices: Array, truth: Array | None
) -> Comparison:
    steps = len(increments)
    states = candidate.propagate(increments)
    run, seconds = candidate.prepared(increments), math.inf
    for _ in range(_TIMED if candidate.name != "fixed-model" else 1):
        start = time.perf_counter()
        run()
        seconds = min(seconds, time.perf_counter() - start)
    require_finite(candidate, states, np.arange(1 + steps, dtype=np.float64))
    computed = attitude(candidate, states)
    angles = np.linalg.norm(drift_between(computed, matrices), axis=-1)
    drifts = drift_between(computed, matrices if truth is None else truth)
    return Comparison(
        candidate.name,
        float(angles.max()),
        float(np.sqrt(np.mean(angles**2))),
        float(np.abs(states.astype(np.float64) - wanted).max() / candidate.unit),
        certified_angle(candidate, increments, wanted),
        math.degrees(float(np.linalg.norm(np.abs(drifts).max(axis=0)))),
        seconds / max(1, steps) * 1e9,
        compiler.code_size(candidate.sources),
        candidate.sources.operations,
    )


def certified_angle(candidate: Backend, increments: Array, wanted: Array) -> float | None:
    """Return the certified bound of the angle between a run in fixed point and the exact one.

    The angle is measured as the length of the drift vector, the skew-symmetric part of the product of one matrix and
    the other one's transpose. With states that differ by at most b in length, and reference states of at most length s,
    it is at most sqrt(3/2) s b for rows of matrices, and 2 s b (s^2 + s b) for Euler parameters.

    Parameters
    ----------
    candidate : Backend
    increments : array, (N, K, 3)
    wanted : array, (1 + N, state shape)
        States of the exact run.

    Returns
    -------
    float or None
        In rad; None in floating point, and where no bound of use is known.
    """
    rounded = not np.array_equal(candidate.representable(increments), increments)
    length = candidate.rounding_bound(len(increments), rounded)
    if length is None or not math.isfinite(length):
        return None
    if candidate.attitude is None:
        size = float(np.linalg.norm(wanted, ord=2, axis=(-2, -1)).max())
        return math.sqrt(1.5) * size * length
    size = float(np.linalg.norm(wanted, axis=-1).max())
    return 2 * size * length * (size**2 + size * length)
