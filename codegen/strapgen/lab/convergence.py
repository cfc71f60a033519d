"""`converge` measures the order of an algorithm from its errors on a ladder of step lengths."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import mpmath
import numpy as np

from strapgen import catalogue
from strapgen.catalogue import AnyAlgorithm, Choice
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.kernel_info import Order
from strapgen.ir.notebook_display import notebook_html, short_repr, to_pandas
from strapgen.ir.renamed import renamed_parameters
from strapgen.lab.motions.motion_names import is_file
from strapgen.lab.motions.motions import GENERAL, Motion
from strapgen.lab.motions.motions import motion as named_motion
from strapgen.lab.motions.users_motions import any_motion
from strapgen.lab.parallel_cases import Bundle, Cluster, moved, side_by_side
from strapgen.lab.runs import exact_attitudes, largest_increment, simulate, step_of_increments, uncertainty
from strapgen.results.records import INTERNAL, Record, entry
from strapgen.run import exact
from strapgen.run.backends import BACKENDS
from strapgen.run.backends import backend as attitude_backend

#: Number of steps that the slope is fitted to: the finest of those whose error is truncation.
FITTED = 3
#: Step lengths of the ladder by default, in s.
LADDER = ("1/8", "1/16", "1/32", "1/64", "1/128")
#: Largest error in rad that the slope is fitted to; beyond it, the terms after the first count too.
MOST_ERROR = 0.3


@dataclass(frozen=True)
class StepError:
    """One step length of a ladder."""

    #: Step in s
    step_s: float
    #: Largest error over the run; None where the run left the range of the back end's numbers
    error_rad: float | None
    #: Slope between the previous rung and this one
    slope: float | None = None
    #: Whether the observed order is fitted to it
    used: bool = False


@dataclass(frozen=True)
class PredictedOrders:
    """Orders in theory; None where a user's algorithm states none."""

    #: That of the method on any differential equation
    method_order: int | None
    #: That of the method on attitude kinematics
    attitude_order: int | None
    #: That of the rates which the increments tell
    extraction_order: int | None
    #: That of the step
    predicted_order: int | None

    @staticmethod
    def of(order: Order) -> PredictedOrders:
        """Return the orders of a step."""
        return PredictedOrders(order.method, order.attitude, order.extraction, order.step)


@dataclass(frozen=True)
class Convergence(Record):
    """The errors of an algorithm on a ladder of steps.

    Parameters
    ----------
    kernel, backend : str
    order : Order or None
        Orders in theory; None where a user's algorithm states none.
    rungs : tuple of StepError
        From the longest step to the shortest.
    observed : float or None
        Slope of the logarithm of the error, fitted to the finest rungs whose error is truncation; None where no two
        rungs show it.
    arguments : str
        Name and options of the kernel on the command line; they tell kernels of one name apart.
    label : str, optional
        Name beside others, see `labels`.

    Examples
    --------
    >>> ladder = converge(catalogue.choose("euler", "rk1", 1), steps=["1/16", "1/32", "1/64"])
    >>> ladder.predicted, [rung.step_s for rung in ladder.rungs]
    (1, [0.0625, 0.03125, 0.015625])
    """

    kernel: str
    backend: str
    order: Order | None = field(metadata=entry(spread=True, write=PredictedOrders.of, kind=PredictedOrders))
    rungs: tuple[StepError, ...]
    observed: float | None = field(metadata=entry(key="observed_order"))
    arguments: str = field(default="", metadata=INTERNAL)
    label: str | None = field(default=None, metadata=entry(optional=True))

    __repr__ = short_repr
    _repr_html_ = notebook_html
    to_pandas = to_pandas

    def _in_words(self) -> str:
        observed = self.hidden if self.observed is None else f"{self.observed:.2f}"
        ladder = f"{len(self.rungs)} steps"
        return f"of {self.kernel} on {self.backend}, {ladder}: predicted order {self.predicted}, observed {observed}"

    @property
    def hidden(self) -> str:
        """The reason why there is no observed order; "" if there is one."""
        errors = [rung.error_rad for rung in self.rungs if rung.error_rad is not None]
        if self.observed is not None:
            return ""
        if not errors:
            return "every run leaves the range of its numbers"
        if min(errors) > MOST_ERROR:
            return f"the errors are over {MOST_ERROR} rad, too large for a slope; shorter steps are needed"
        if max(errors) < 1e-25:
            return "the algorithm is exact on this motion"
        return f"rounding hides the order on {self.backend}, or too few steps show it"

    @property
    def predicted(self) -> int | None:
        """Order of the step in theory."""
        return None if self.order is None else self.order.step


@dataclass(frozen=True)
class LadderCase:
    """An algorithm, a motion, steps and a back end, as a worker process takes them."""

    choice: Choice
    backend: str
    #: Name of a motion, or the file of one
    motion: str
    #: Its parameters
    settings: Mapping[str, Any]
    #: Steps in s
    steps: tuple[str, ...]
    #: In s
    duration: str

    def moved(self, begin: Path, end: Path) -> LadderCase:
        """Return the case with the file of its motion in another folder, see `parallel_cases.Bundle`."""
        return replace(self, motion=moved(self.motion, begin, end)) if is_file(self.motion) else self


def measure_case(case: LadderCase) -> Convergence:
    """Return the outcome of a case."""
    profile = any_motion(case.motion, case.duration, case.settings)
    with np.errstate(all="ignore"):  # a step that is too long for a method is part of the picture
        return converge(case.choice, profile, case.steps, case.duration, case.backend)


def converge_all(
    cases: Sequence[LadderCase], jobs: int | None = None, cluster: Cluster | None = None
) -> Iterator[tuple[int, Convergence]]:
    """Measure several algorithms side by side, and yield the index and the outcome of each as it is finished."""
    files = None if cluster is None else Bundle.of({case.motion for case in cases if is_file(case.motion)})
    numbered = {str(place): case for place, case in enumerate(cases)}
    for name, outcome in side_by_side(measure_case, numbered, jobs, cluster, files):
        yield int(name), outcome


@renamed_parameters(choice="algorithm")
def converge(
    algorithm: AnyAlgorithm,
    motion: Motion | None = None,
    steps: Sequence[float | str | Fraction] = LADDER,
    duration: float | str | Fraction = 1,
    backend: str = "exact",
    settings: Settings | None = None,
) -> Convergence:
    """Run an algorithm on a motion with a ladder of steps, and fit the order.

    The error of a run is the largest distance of the computed matrix from the true one, the root of half the sum of the
    squares of all elements. For a pure drift it is the angle in rad; scale and skew count too.

    Parameters
    ----------
    algorithm : str, path, Choice or AttitudeAlgorithm
        An attitude step that takes increments.
    motion : Motion, optional
        A motion whose rate changes direction, to show the order; on others an algorithm may do better. By default a
        coning motion with rates of 1, 1.5 and 0.6 rad/s.
    steps : sequence of number, optional
        Steps in s, each a divisor of the duration.
    duration : number, optional
        In s.
    backend : str, optional
        A key of `BACKENDS`. "exact" shows the order of any method, since its rounding cannot be seen.
    settings : Settings, optional
        Settings of fixed point, by default for the increments of each run.

    Returns
    -------
    Convergence

    Raises
    ------
    InputError
        If a name or number is not allowed, or there are fewer than two steps.

    Examples
    --------
    >>> from strapgen import motion
    >>> coning = motion("coning", a_rad_s=1, b_rad_s=2, g_rad_s=0.5)
    >>> ladder = converge(catalogue.choose("euler", "rk2", 2), coning, ["1/8", "1/16", "1/32"], 1)
    >>> ladder.predicted, round(ladder.observed, 1)
    (2, 2.0)
    """
    checks.choice("backend", backend, BACKENDS)
    choice = catalogue.choose_step(algorithm)
    kernel = step_of_increments(choice)
    if motion is None:
        motion = named_motion("coning", **GENERAL)
    if not isinstance(motion, Motion):
        raise InputTypeError(f"motion is {checks.describe(motion)}; strapgen.motion makes one")
    total = checks.number("duration", duration, positive=True)
    if isinstance(steps, str) or not isinstance(steps, Iterable):
        raise InputTypeError(f"steps is {steps!r}; a sequence of step lengths is needed")
    lengths = sorted({checks.number("step", step, positive=True) for step in steps}, reverse=True)
    if len(lengths) < 2:
        raise InputError("a slope takes two steps or more; give different ones")
    counts = [checks.multiple("duration", total, "step", length) for length in lengths]
    if BACKENDS[backend].many_digits:
        measure = _in_many_digits(choice, motion, float(catalogue.rounding(choice)))
    else:
        measure = _on_backend(choice, motion, total, backend, settings)
    rungs = []
    for length, count in zip(lengths, counts, strict=True):
        error, floor = measure(length, count)
        rungs.append((float(length), error, error is not None and floor < error < MOST_ERROR))
    return replace(fitted(kernel.name, backend, kernel.order, rungs), arguments=kernel.arguments)


def labels(outcomes: Sequence[Convergence]) -> list[str]:
    """Return a name for every outcome: that of its kernel, with options or a back end where the kernel has several.

    >>> by_rk1, by_rk4 = (Convergence("mine", "exact", None, (), None, f"mine.py --method {m}") for m in ("rk1", "rk4"))
    >>> labels([by_rk1, by_rk4])
    ['mine, mine.py --method rk1', 'mine, mine.py --method rk4']
    """
    names = [kernel for kernel, _ in {(outcome.kernel, outcome.arguments) for outcome in outcomes}]
    several = len({outcome.backend for outcome in outcomes}) > 1
    return [
        (f"{one.kernel}, {one.arguments}" if one.arguments and names.count(one.kernel) > 1 else one.kernel)
        + (f", {one.backend}" if several else "")
        for one in outcomes
    ]


def fitted(
    kernel: str, backend: str, order: Order | None, rungs: Sequence[tuple[float, float | None, bool]]
) -> Convergence:
    """Fit the slope to the finest rungs that show truncation.

    `rungs`: step in s, error in rad, and whether the error shows truncation; from the longest step to the
    shortest.
    """
    chosen = [k for k, (_, _, shows) in enumerate(rungs) if shows][-FITTED:]
    slopes: list[float | None] = [None]
    for (long, before, _), (short, after, _) in pairwise(rungs):
        slopes.append(math.log(before / after) / math.log(long / short) if before and after else None)
    observed = None
    if len(chosen) > 1:
        logs = np.array([(math.log(rungs[k][0]), math.log(rungs[k][1] or 1.0)) for k in chosen])
        observed = float(np.polyfit(logs[:, 0], logs[:, 1], 1)[0])
    ladder = tuple(
        StepError(length, error, slopes[k], k in chosen) for k, (length, error, _) in enumerate(rungs)
    )
    return Convergence(kernel, backend, order, ladder, observed)


#: Takes a step length and the number of steps; returns the error of the run and the error that rounding may cause.
_Measure = Callable[[Fraction, int], tuple[float | None, float]]


def _on_backend(
    choice: Choice, motion: Motion, total: Fraction, backend: str, settings: Settings | None
) -> _Measure:
    """Return the function that measures a step length on a back end."""
    samples, beside = choice.increments_per_step, (choice.previous, choice.ahead)

    def measure(length: Fraction, count: int) -> tuple[float | None, float]:
        chosen = None
        if BACKENDS[backend].fixed:
            largest = largest_increment(motion, length, total, samples, beside=beside)
            chosen = (settings or Settings()).fitted(largest)
        stepper = attitude_backend(choice, backend=backend, settings=chosen)
        try:
            run = simulate(stepper, motion, length, total)
        except InputError:  # the state leaves the range of its numbers
            return None, 0.0
        distances = np.linalg.norm(run.computed - run.true, axis=(-2, -1)) / math.sqrt(2)
        # In a step, rounding adds up to one unit in the last place to each of the state's few elements.
        return float(distances.max()), 8 * stepper.unit * count

    return measure


def _in_many_digits(choice: Choice, motion: Motion, rounding: float) -> _Measure:
    """Return the function that measures a step length without visible rounding.

    Where the published coefficients of a method are rounded, their rounding is the smallest error that means something;
    where the motion is known in double alone, the rounding of its increments is.
    """
    attitudes = exact_attitudes(choice, motion)

    def measure(length: Fraction, count: int) -> tuple[float | None, float]:
        with mpmath.workdps(exact.DIGITS):
            worst = mpmath.mpf(0)
            for computed, true in attitudes(length, count):
                worst = max(worst, sum((a - b) ** 2 for a, b in zip(computed, true, strict=True)))
            return float(mpmath.sqrt(worst / 2)), 100 * rounding + uncertainty(motion, length, count)

    return measure
