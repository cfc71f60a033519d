"""The word-length study measures how much rounding, quantization and truncation each add to the drift.

>>> from strapgen import study
>>> [(case.word, case.carry) for case in study.cases(words=(12, 16), carries="full")]
[(12, 'full'), (16, 'full')]
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from fractions import Fraction
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from strapgen import pipeline
from strapgen.catalogue import AnyAlgorithm, Choice, choose_step, named
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.renamed import renamed_parameters
from strapgen.lab.certificate.largest_rounding import has_balls, largest_rounding
from strapgen.lab.comparison import certified_angle
from strapgen.lab.motions.motion_names import is_file
from strapgen.lab.motions.motions import Motion
from strapgen.lab.motions.users_motions import any_motion
from strapgen.lab.parallel_cases import Bundle, Cluster, moved, side_by_side
from strapgen.lab.runs import attitude, drift_between
from strapgen.results.records import Properties, Record, entry, properties
from strapgen.run.backends import backend
from strapgen.run.increments import pulses
from strapgen.storage import cache

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from strapgen.lab.quantization_noise import QuantizationNoise

#: Most cases of one study.
_MOST_CASES = 5000


@dataclass(frozen=True)
class Case:
    """One run of a study.

    Parameters
    ----------
    algorithm, method : str
    increments : int
        Increments per step.
    word : int
        Bits of a word.
    rounding, carry : str
        See `Settings`.
    step, duration : str
        In s.
    pulse_arcsec : str
        Angle of a gyro pulse in arc seconds. With "0" the gyro does not count pulses, and increments are rounded to
        their format alone.
    motion : str
    settings : tuple of (str, str)
        Parameters of the motion.

    Examples
    --------
    >>> [case] = cases(words=12, carries="full")
    >>> case.algorithm, case.method, case.increments, case.word, case.carry
    ('euler', 'rk4', 2, 12, 'full')
    """

    algorithm: str
    method: str
    increments: int
    word: int
    rounding: str
    carry: str
    step: str
    duration: str
    pulse_arcsec: str
    motion: str
    settings: tuple[tuple[str, str], ...] = field(metadata=entry(write=dict, kind=dict[str, str]))

    __repr__ = short_repr

    def moved(self, begin: Path, end: Path) -> Case:
        """Return the case with the file of a user's motion in another folder, see `parallel_cases.Bundle`."""
        return replace(self, motion=moved(self.motion, begin, end)) if is_file(self.motion) else self

    @property
    def profile(self) -> Motion:
        """The motion with its parameters."""
        return any_motion(self.motion, self.duration, dict(self.settings))


@dataclass(frozen=True)
class Outcome(Record):
    """The result of a case; an angle is the largest of the run, in degrees.

    Parameters
    ----------
    case : Case
    drift_deg : float or None
        Drift from the truth; None if the run left the range of its format.
    rounding_deg : float or None
        Effect of the arithmetic: the angle from the same algorithm in exact arithmetic on the same rounded increments,
        at up to some hundred instants; None if the run left the range of its format.
    quantization_deg : float
        Effect of rounded increments: the angle between the runs in double on rounded and on exact increments.
    truncation_deg : float
        Effect of the method: the drift of the run in double on exact increments.
    bound_deg : float or None
        Certified bound of `rounding_deg`; None where no useful bound is known.
    expected_deg : float or None
        Root mean square of the angle that pulses cause at the end of the run, if the errors of the counted angles are
        independent; None without pulses. See `quantization_noise`.
    rounding_radius_deg : float or None
        Radius of the ball that holds `rounding_deg`, see `certify`; None where that is the angle from the run in double
        at any step: without python-flint, in words of more than 53 bits, and from a quarter turn on.

    Examples
    --------
    >>> [case] = cases(words=12, carries="full", duration="2")
    >>> run_case(case).dominates
    'rounding'
    """

    computed: ClassVar[Properties] = properties(dominates=entry(), operations_per_s=entry(unit="1/s"))

    case: Case = field(metadata=entry(spread=True))
    drift_deg: float | None
    rounding_deg: float | None
    quantization_deg: float
    truncation_deg: float
    bound_deg: float | None
    expected_deg: float | None = None
    rounding_radius_deg: float | None = None

    __repr__ = short_repr

    @property
    def operations_per_s(self) -> float:
        """Operations of the step in a second, without changes of sign."""
        case = self.case
        return _operations(case.algorithm, case.method, case.increments) / float(Fraction(case.step))

    @property
    def dominates(self) -> str:
        """The largest part of the drift: "rounding", "quantization" or "truncation"; "range" if the run left it."""
        if self.rounding_deg is None:
            return "range"
        parts = {
            "rounding": self.rounding_deg,
            "quantization": self.quantization_deg,
            "truncation": self.truncation_deg,
        }
        return max(parts, key=lambda name: parts[name])


@lru_cache
def _operations(algorithm: str, method: str, increments: int) -> int:
    program = pipeline.program(choose_step(algorithm, method, increments))
    return sum(count for name, count in program.operations.items() if name != "negate")


@dataclass(frozen=True)
class Study:
    """A study: one algorithm on one motion, in every combination of the swept values.

    Parameters
    ----------
    algorithm : str, path, Choice or AttitudeAlgorithm
        An object has its own method and increments.
    increments : int
        Increments per step.
    methods, words, roundings, carries, steps, pulses_arcsec : sequence
        Values that are swept, see `Case`; a single value stands for itself.
    duration : str
        In s.
    motion_name : str
    settings : dict of str to str, optional
        Parameters of the motion; by default those of the thesis's table 5, and none for the file of a motion.

    Examples
    --------
    >>> len(Study(words=(12, 16), methods=("rk2", "rk4")).cases())
    12
    """

    algorithm: AnyAlgorithm = "euler"
    increments: int = 2
    methods: Sequence[str] = ("rk4",)
    words: Sequence[int] = (8, 10, 12, 14, 16, 18, 20, 24, 28, 32)
    roundings: Sequence[str] = ("nearest",)
    carries: Sequence[str] = ("none", "state", "full")
    steps: Sequence[str] = ("0.125",)
    pulses_arcsec: Sequence[str] = ("0",)
    duration: str = "180"
    motion_name: str = "coning"
    settings: dict[str, str] | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        choice = named("study", self.algorithm)
        if not isinstance(choice, Choice):
            object.__setattr__(self, "algorithm", os.fspath(choice))
            return
        method, increments = choice.method, choice.increments
        if not isinstance(method, str) or choice != choose_step(choice.name, method, increments):
            raise InputError(f"a study takes a method and increments by name alone; {choice.kernel} has more")
        for option, own in {"methods": (method,), "increments": increments}.items():
            stated = getattr(self, option)
            if stated not in (own, getattr(Study, option)):
                raise InputError(f"{option} is {stated!r}, but the choice of {choice.kernel} has its own")
            object.__setattr__(self, option, own)
        object.__setattr__(self, "algorithm", choice.name)

    def cases(self) -> list[Case]:
        """Return every combination, unchecked."""
        default = {} if is_file(self.motion_name) else {"a_deg_s": "10", "b_deg_s": "10", "g_deg_s": "10"}
        parameters = tuple((self.settings or default).items())
        swept = product(
            self.methods, self.steps, self.pulses_arcsec, self.roundings, self.carries, self.words
        )
        return [
            Case(
                algorithm=str(self.algorithm),
                method=method,
                increments=self.increments,
                word=word,
                rounding=rounding,
                carry=carry,
                step=str(step),
                duration=str(self.duration),
                pulse_arcsec=str(pulse),
                motion=self.motion_name,
                settings=parameters,
            )
            for method, step, pulse, rounding, carry, word in swept
        ]


def cases(study: Study | None = None, **values: Any) -> list[Case]:
    """Return every combination of the values of a study, checked.

    Parameters
    ----------
    study : Study, optional
    **values
        Fields of `Study` that replace those of `study`.

    Returns
    -------
    list of Case

    Raises
    ------
    InputError
        If a value is not allowed, or there are too many combinations.

    Examples
    --------
    >>> [(case.word, case.carry) for case in cases(words=(12, 16), carries=("full",))]
    [(12, 'full'), (16, 'full')]
    """
    study = replace(study or Study(), **values)
    words = [checks.whole("word", w) if isinstance(w, str) else w for w in _several(study.words)]
    study = replace(
        study,
        methods=_several(study.methods),
        words=words,
        roundings=_several(study.roundings),
        carries=_several(study.carries),
        steps=_several(study.steps),
        pulses_arcsec=_several(study.pulses_arcsec),
    )
    for method in study.methods:
        choose_step(study.algorithm, method, study.increments)
    planned = study.cases()
    if not 0 < len(planned) <= _MOST_CASES:
        raise InputError(f"the study has {len(planned)} cases; 1 to {_MOST_CASES} are allowed")
    total = checks.number("duration", study.duration, positive=True)
    for step in study.steps:
        checks.multiple("duration", total, "step", checks.number("step", step, positive=True))
    for pulse in study.pulses_arcsec:
        if checks.number("pulse_arcsec", pulse) < 0:
            raise InputError(f"pulse_arcsec is {pulse}; 0 for none, or a number above 0 is needed")
    for case in planned:
        Settings(case.word, rounding=case.rounding, carry=case.carry)
    return planned


def _several(values: Any) -> tuple[Any, ...]:
    """Return the values that a study sweeps; a single one stands for itself."""
    single = isinstance(values, str | bytes) or not isinstance(values, Iterable)
    return (values,) if single else tuple(values)


def run_case(case: Case) -> Outcome:
    """Run one case, or take its outcome from the cache, so that an interrupted study resumes.

    Examples
    --------
    >>> [case] = cases(words=12, carries="full", duration="2")
    >>> 0 < run_case(case).rounding_deg < 0.1
    True
    """
    motion = Path(case.motion).read_bytes() if is_file(case.motion) else b""
    parts: list[str | bytes] = [json.dumps(asdict(case), sort_keys=True), motion, str(has_balls())]
    return cache.stored("studies", parts, lambda: _run(case))


def _run(case: Case) -> Outcome:
    h = checks.number("step", case.step, positive=True)
    steps = checks.multiple("duration", checks.number("duration", case.duration, positive=True), "step", h)
    choice = choose_step(case.algorithm, case.method, case.increments)
    exact = case.profile.increments(h, steps, case.increments, choice.previous, choice.ahead)
    pulse = float(checks.number("pulse_arcsec", case.pulse_arcsec)) / 3600
    measured = pulses(exact, math.radians(pulse), choice.previous + choice.ahead) if pulse else exact
    settings = Settings(case.word, rounding=case.rounding, carry=case.carry)
    settings = settings.fitted(float(np.abs(measured).max()))
    double = backend(case.algorithm, case.method, case.increments, "numpy")
    fixed = backend(case.algorithm, case.method, case.increments, "fixed-model", settings=settings)
    # The counter of a gyro is as long as it must be: the algorithm receives every pulse, in the unit of its format.
    rounded = fixed.representable(measured)
    truth = case.profile.attitude(np.arange(1 + steps) * float(h))
    plain, same = double.propagate(exact), double.propagate(rounded)
    plain_attitude, same_attitude = attitude(double, plain), attitude(double, same)

    def largest(computed: Any, other: Any) -> float:
        return math.degrees(float(np.linalg.norm(drift_between(computed, other), axis=-1).max()))

    drift = rounding = radius = None
    try:
        states = fixed.propagate(rounded)
        computed = attitude(fixed, states)
        drift, rounding = largest(computed, truth), largest(computed, same_attitude)
        if (found := largest_rounding(fixed, states, rounded)) is not None:
            rounding, radius = (math.degrees(value) for value in found)
    except InputError:  # in a short word without error feedback the state leaves its range
        pass
    bound = certified_angle(fixed, rounded, same)
    return Outcome(
        case,
        drift,
        rounding,
        largest(same_attitude, plain_attitude),
        largest(plain_attitude, truth),
        None if bound is None else math.degrees(bound),
        expected_noise(case, math.radians(pulse), _within(choice, exact)) if pulse else None,
        radius,
    )


def _within(choice: Choice, increments: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the increments inside the steps, without those before and after."""
    return increments[:, choice.previous : choice.previous + choice.increments_per_step]


@renamed_parameters(increments="samples")
def expected_noise(case: Case, pulse: float, samples: Any) -> float:
    """Return the root mean square of the angle in deg that pulses cause in a run, if their errors are independent.

    `pulse`: angle in rad. `samples` (N, K, 3): exact increments of the run in rad.

    Examples
    --------
    >>> [case] = cases(words=12, carries="full")
    >>> 0 < expected_noise(case, 1e-5, np.full((9, 2, 3), 1e-3)) < 0.01
    True
    """
    noise = noise_of(case.algorithm, case.method, case.increments)
    turned = np.square(samples.sum(axis=1)).sum()
    return math.degrees(math.sqrt(noise.mean_square(pulse, float(turned), len(samples))))


def noise_of(
    algorithm: AnyAlgorithm, method: str | None = None, increments: int | None = None
) -> QuantizationNoise:
    """Return the noise that quantized increments cause in a step; see `quantization_noise`.

    Examples
    --------
    >>> noise_of("euler", "rk4", 2).across() > 0
    True
    """
    return _noise_of(choose_step(algorithm, method, increments))


@lru_cache(maxsize=64)
def _noise_of(choice: Choice) -> QuantizationNoise:
    from strapgen.lab.quantization_noise import quantization_noise

    return quantization_noise(choice)


def run(
    planned: Sequence[Case], jobs: int | None = None, cluster: Cluster | None = None
) -> Iterator[Outcome]:
    """Run cases side by side, and yield each outcome when its case ends.

    Parameters
    ----------
    planned : sequence of Case
    jobs : int, optional
        Processes; by default one for every processor.
    cluster : Cluster, optional
        Where they run, in place of processes of this one.

    Yields
    ------
    Outcome

    Examples
    --------
    >>> planned = cases(words=(12, 16), carries="full", duration="2")
    >>> sorted(outcome.case.word for outcome in run(planned, jobs=1))
    [12, 16]
    """
    cases = {str(k): case for k, case in enumerate(planned)}
    users = {case.motion for case in planned if is_file(case.motion)}
    files = None if cluster is None else Bundle.of(sorted(users))
    for name, outcome in side_by_side(run_case, cases, jobs, cluster, files):
        yield replace(outcome, case=cases[name])  # whose files are here
