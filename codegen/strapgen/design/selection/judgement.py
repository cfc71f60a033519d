"""Judges algorithms by a brief: drift by cause, cost, the limit that excludes them, and a verdict in sentences."""

from __future__ import annotations

import hashlib
import math
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any

from strapgen import catalogue
from strapgen.analysis.vibration.rectification import DEGREE, Rectification
from strapgen.design.brief import DesignBrief, files_of, read_brief
from strapgen.design.frontier import Candidate
from strapgen.design.selection import causes
from strapgen.design.selection.candidates import (
    STATES,
    Algorithm,
    AttitudeStep,
    algorithm_of,
    is_tuned_window,
)
from strapgen.design.selection.causes import Rounding
from strapgen.ir.exceptions import InputError
from strapgen.ir.version import VERSION
from strapgen.lab.parallel_cases import Bundle, Cluster, moved, resume, side_by_side
from strapgen.lab.processors import PROCESSORS
from strapgen.storage import cache as disk_cache

#: The causes of a drift, in the order of a report; the first three are the software's.
CAUSES = ("truncation", "coning", "rounding", "quantization", "noise")
SOFTWARE = CAUSES[:3]


@dataclass(frozen=True)
class Judgement:
    """Drift by cause and cost of an algorithm, and whether it meets a brief."""

    #: State, method and samples, as "euler coning-compressed:2"
    name: str
    state: str
    method: str
    #: Samples of a step; of two speeds the fast cycles in a slow one
    increments: int
    previous: int
    ahead: int
    meets: bool
    #: The cause or the limit that is exceeded most, of those that were computed; None if none is
    binding: str | None
    #: The same in words; empty if none is
    reason: str
    #: Drift by cause; None where it is not known, or not looked at because a cheaper findings had refused the
    #: algorithm
    drift_deg_h: dict[str, float | None]
    #: Additions, multiplications, divisions, roots, functions and choices
    operations_per_s: float
    #: Error feedback of the fixed-point code
    carry: str = "none"
    #: Errors due to sculling at the end of the budget's time; None without accelerations
    velocity_m_s: float | None = None
    position_m: float | None = None
    #: Counted on the processor of the brief, where it has a limit
    instructions_per_s: float | None = None
    bytes: float | None = None
    #: Why it meets the brief by errors that cancel, and so for these very lines alone; empty if it does not
    fragile: str = ""
    #: Drift by cause in a run in time; None where it was not run
    run_deg_h: dict[str, float] | None = None
    #: The largest drift under lines of each order in their angles, "2" to "4"; None where it was not computed
    coning_parts_deg_h: dict[str, float] | None = None

    @property
    def software_deg_h(self) -> float:
        """Drift of truncation, coning and rounding together; infinite where one is not known."""
        parts = [self.drift_deg_h[cause] for cause in SOFTWARE]
        return math.fsum(math.inf if part is None else part for part in parts)


@dataclass(frozen=True)
class JudgementSpec:
    """A candidate and the path of its brief, as a worker process takes them."""

    #: The file of the brief
    path: str
    candidate: Candidate

    def moved(self, begin: Path, end: Path) -> JudgementSpec:
        """Return the specification with its brief in another folder, see `parallel_cases.Bundle`."""
        return replace(self, path=moved(self.path, begin, end))


@dataclass
class _Findings:
    """Drifts, costs and failed predictions of an algorithm, as far as they are computed."""

    brief: DesignBrief
    drift: dict[str, float | None] = field(default_factory=lambda: dict.fromkeys(CAUSES))
    figures: dict[str, float | None] = field(default_factory=dict)
    unknown: dict[str, str] = field(default_factory=dict)
    coning_parts: dict[str, float] | None = None
    rounding: Rounding = field(default_factory=lambda: Rounding(None, causes.CARRIES[0]))

    @property
    def software_limit(self) -> float:
        return self.brief.budget.drift_deg_h * self.brief.budget.software_share

    def excesses(self) -> dict[str, tuple[float, str]]:
        """Return the quantities that exceed their limits: each with its ratio to the limit, and the excess in words."""
        limits = {}
        for cause in SOFTWARE:
            value = self.drift[cause]
            if value is not None:
                limits[cause] = value, self.software_limit, "deg/h of the software's"
        known = {cause: self.drift[cause] or 0.0 for cause in SOFTWARE}
        total = math.fsum(known.values())
        if total > self.software_limit:
            most = max(known, key=lambda cause: known[cause])
            limits[most] = total, self.software_limit, "deg/h of the software's"
        budget = self.brief.budget.drift_deg_h
        random = {cause: self.drift[cause] or 0.0 for cause in CAUSES[3:]}
        whole = total + math.hypot(*random.values())
        if total <= self.software_limit and whole > budget:
            most = max(random, key=lambda cause: random[cause])
            limits[most] = whole, budget, "deg/h of the budget's"
        for name, limit, unit in self._other_limits():
            value = self.figures.get(name)
            if value is not None and limit is not None:
                limits[name] = value, limit, unit
        excess = {
            name: (value / limit, f"{name} {value:.3g} exceeds {limit:.3g} {unit}")
            for name, (value, limit, unit) in limits.items()
            if value > limit
        }
        return excess | {name: (math.inf, reason) for name, reason in self.unknown.items()}

    def _other_limits(self) -> list[tuple[str, float | None, str]]:
        budget, processor = self.brief.budget, self.brief.processor
        share = budget.software_share
        return [
            ("velocity", None if budget.velocity_m_s is None else budget.velocity_m_s * share, "m/s"),
            ("position", None if budget.position_m is None else budget.position_m * share, "m"),
            ("operations_per_s", processor.operations_per_s, "operations a second"),
            ("instructions_per_s", processor.instructions_per_s, f"instructions a second, {processor.cpu}"),
            ("bytes", processor.bytes, f"bytes, {processor.cpu}"),
        ]


def judge_states(spec: JudgementSpec) -> list[dict[str, Any]]:
    """Return the judgements of an algorithm with every state it can have, as plain JSON data."""
    brief = _brief(spec.path)
    known: dict[str, Any] = {}
    judgements = []
    for state in STATES:
        try:
            algorithm = algorithm_of(spec.candidate, state, brief, spec.path)
        except InputError:  # the state has no such step
            continue
        judgements.append(vars(judge(brief, spec.candidate, state, algorithm, known)))
    return judgements


@lru_cache(maxsize=4)
def _brief(path: str) -> DesignBrief:
    return read_brief(path)


def once(known: dict[str, Any], cause: Callable[[], Any]) -> Any:
    """Return the result of a method of an `Algorithm`, or raise its error; only the first call computes it.

    `known` holds results and errors by the names of methods. Quantities that follow from a step to the second power of
    its increments are the same for all states.
    """
    name = cause.__name__
    if name not in known:
        try:
            known[name] = cause()
        except InputError as error:
            known[name] = error
    if isinstance(known[name], InputError):
        raise known[name]
    return known[name]


def judge(
    brief: DesignBrief, candidate: Candidate, state: str, algorithm: Algorithm, known: dict[str, Any]
) -> Judgement:
    """Return the judgement of an algorithm.

    Long computations come last, and are left out once a limit is exceeded.
    """
    findings = _Findings(brief)
    operations = findings.figures["operations_per_s"] = algorithm.operations_per_s()
    findings.drift["noise"] = causes.noise(brief)
    findings.drift["truncation"] = algorithm.truncation()
    try:
        if not findings.excesses():
            findings.drift["coning"] = once(known, algorithm.coning)
        if not findings.excesses() and brief.budget.limits_velocity:
            _add_velocity_error(findings, once(known, algorithm.sculling))
        if not findings.excesses() and causes.tones(brief):
            _add_higher_orders(findings, algorithm.rectification())
    except InputError as error:
        findings.unknown["coning"] = str(error)
    if not findings.excesses():
        findings.drift["quantization"] = once(known, algorithm.quantization)
    if not findings.excesses():
        left = findings.software_limit - math.fsum(findings.drift[cause] or 0.0 for cause in SOFTWARE[:2])
        findings.rounding = algorithm.rounding(left)
        findings.drift["rounding"] = findings.rounding.deg_h
        if findings.rounding.deg_h is None:
            findings.unknown["rounding"] = findings.rounding.reason
    if not findings.excesses() and brief.processor.is_measured:
        _add_measured_cost(findings, algorithm)
    excesses = findings.excesses()
    binding = max(excesses, key=lambda name: excesses[name][0]) if excesses else None
    figures: Mapping[str, float | None] = findings.figures
    return Judgement(
        f"{state} {candidate.name}",
        state,
        candidate.method,
        candidate.increments,
        candidate.previous,
        candidate.ahead,
        binding is None,
        binding,
        "" if binding is None else excesses[binding][1],
        findings.drift,
        operations,
        findings.rounding.carry,
        figures.get("velocity"),
        figures.get("position"),
        figures.get("instructions_per_s"),
        figures.get("bytes"),
        _fragility(findings, candidate, algorithm, known) if binding is None else "",
        coning_parts_deg_h=findings.coning_parts,
    )


def after_run(brief: DesignBrief, one: Judgement, run_deg_h: dict[str, float]) -> Judgement:
    """Return a judgement by the drifts of a time simulation in place of the predicted ones."""
    findings = _Findings(brief, {**one.drift_deg_h, **run_deg_h})
    excesses = findings.excesses()
    if not excesses:
        return replace(one, run_deg_h=run_deg_h)
    binding = max(excesses, key=lambda name: excesses[name][0])
    reason = f"in a run {excesses[binding][1]}; {one.drift_deg_h[binding] or 0.0:.2g} is predicted"
    return replace(one, meets=False, binding=binding, reason=reason, run_deg_h=run_deg_h)


#: By what the response of a gyro may be off without notice.
_OFF = Fraction(1, 100)


def _fragility(findings: _Findings, candidate: Candidate, algorithm: Algorithm, known: dict[str, Any]) -> str:
    """Return in words why a limit is met for this vibration and this gyro alone; empty where it is not."""
    gyro = findings.brief.gyro
    if gyro.seen is None or not (is_tuned_window(candidate.method) and isinstance(algorithm, AttitudeStep)):
        return _cancellation(findings, once(known, algorithm.line_errors))
    other = replace(findings.brief, gyro=replace(gyro, response=gyro.seen.stretched(1 + _OFF)))
    drift = causes.coning(algorithm.choice, other)
    if drift <= findings.software_limit:
        return ""
    return (
        f"the filters take out the response of this gyro, and one of {float(_OFF):.0%} higher frequencies leaves "
        f"{drift:.2g} deg/h"
    )


def _cancellation(findings: _Findings, errors: list[float]) -> str:
    """Return in words how errors of lines cancel; empty where the limit is met without cancellation."""
    largest = math.fsum(map(abs, errors))
    if largest <= findings.software_limit:
        return ""
    return (
        f"errors of up to {max(map(abs, errors)):.2g} deg/h, of the algorithm and of the gyro at "
        f"{len(errors) // 2} line{'s' if len(errors) > 2 else ''}, cancel to "
        f"{findings.drift['coning'] or 0.0:.2g} deg/h; other frequencies or a changed gyro undo it"
    )


def _add_higher_orders(findings: _Findings, found: Rectification) -> None:
    """Replace the coning drift of second order by the largest one over all phases of the lines, to fourth order."""
    findings.drift["coning"] = found.worst() * causes.DEG_H
    findings.coning_parts = {str(order): found.worst(order) * causes.DEG_H for order in range(2, DEGREE + 1)}


def _add_velocity_error(findings: _Findings, error: float | None) -> None:
    """Add velocity and position errors at the end of the budget's time due to a sculling error in m/s^2."""
    if error is not None:
        over = float(findings.brief.budget.over_s)
        findings.figures |= {"velocity": error * over, "position": error * over**2 / 2}


def _add_measured_cost(findings: _Findings, algorithm: Algorithm) -> None:
    """Add bytes and instructions of the fixed-point code on the processor of the brief."""
    cpu = findings.brief.processor.cpu
    if shutil.which(PROCESSORS[cpu].compiler) is None:
        raise InputError(
            f"instructions and bytes on {cpu} are counted with {PROCESSORS[cpu].compiler}; it is not installed"
        )
    one = algorithm.cost(findings.rounding.carry)
    findings.figures["bytes"] = one.bytes
    if one.instructions_per_s is not None:
        findings.figures["instructions_per_s"] = one.instructions_per_s


def judgements(
    path: str | Path,
    several: Iterable[Candidate],
    results: str | Path | None = None,
    jobs: int | None = None,
    cluster: Cluster | None = None,
) -> Iterator[list[Judgement]]:
    """Judge algorithms by a brief, and yield the judgements of each with all states as they are finished."""
    cases = {one.name: JudgementSpec(str(path), one) for one in several}
    files = None if cluster is None else Bundle.of(files_of(path))
    if results is None:
        finished = side_by_side(judge_states, cases, jobs, cluster, files)
    else:
        finished = resume(judge_states, cases, results, _identity(path), jobs, cluster, files)
    for _, rows in finished:
        yield [Judgement(**row) for row in rows]


def _identity(path: str | Path) -> dict[str, Any]:
    """Return the identity of results: the code and the brief."""
    return {
        "study": "design",
        "version": VERSION,
        "code": disk_cache.generator_digest(),
        "brief": hashlib.sha256(Path(path).read_bytes()).hexdigest(),
    }


def in_order(several: Iterable[Judgement]) -> list[Judgement]:
    """Return judgements in order: those that meet the brief first, and the cheapest of each kind first."""
    return sorted(several, key=lambda one: (not one.meets, one.operations_per_s, one.name))


def verdicts(brief: DesignBrief, ordered: list[Judgement]) -> list[str]:
    """Return the verdict on a brief in sentences."""
    sentences = []
    accepted = [one for one in ordered if one.meets]
    share = brief.budget.software_share * brief.budget.drift_deg_h
    if accepted:
        best = accepted[0]
        sentences.append(
            f"{best.name} is the cheapest of {len(accepted)} that meet the brief: {best.software_deg_h:.2g} deg/h of "
            f"the {share:.2g} deg/h that the software may add, {best.operations_per_s:.0f} operations a second"
        )
        if best.run_deg_h is not None:
            coning = (
                f" and {best.run_deg_h['coning']:.2g} under the vibration"
                if "coning" in best.run_deg_h
                else ""
            )
            sentences.append(
                f"its run in time confirms it: {best.run_deg_h['truncation']:.2g} deg/h in the turn{coning}"
            )
        if best.fragile:
            sentences.append(f"the choice is fragile: {best.fragile}")
    else:
        counts: dict[str, int] = {}
        for one in ordered:
            counts[one.binding or ""] = counts.get(one.binding or "", 0) + 1
        causes_of_refusal = ", ".join(f"{name} of {count}" for name, count in counts.items())
        sentences.append(f"no algorithm meets the brief; what binds: {causes_of_refusal}")
    undone = [one for one in ordered if one.run_deg_h is not None and not one.meets]
    if undone:
        sentences.append(
            f"{len(undone)} cheaper by prediction {'does' if len(undone) == 1 else 'do'} not meet it in a run, the "
            f"first {undone[0].name}: {undone[0].reason.removeprefix('in a run ')}"
        )
    rectified = [
        one
        for one in ordered
        if one.binding == "coning" and one.coning_parts_deg_h and one.coning_parts_deg_h["2"] <= share
        if one.run_deg_h is None
    ]
    if rectified:
        parts = rectified[0].coning_parts_deg_h or {}
        sentences.append(
            f"{len(rectified)} {'meets' if len(rectified) == 1 else 'meet'} it to second order alone, the first "
            f"{rectified[0].name}: the lines leave {parts['3']:.2g} deg/h of third order and {parts['4']:.2g} of fourth"
        )
    effect = _coning_effect(brief)
    if effect is not None and brief.environment is not None:
        needed = "is needed" if effect > share else "is not needed here"
        side = "above" if effect > share else "below"
        sentences.append(
            f"the coning loop {needed}: without it the vibration leaves {effect:.2g} deg/h at the sampling rate, "
            f"{side} the software's {share:.2g} deg/h"
        )
    noise = causes.noise(brief)
    if noise > brief.budget.drift_deg_h:
        sentences.append(
            f"no algorithm helps: the gyro's noise alone leaves {noise:.2g} deg/h after "
            f"{float(brief.budget.over_s):g} s, and the budget is {brief.budget.drift_deg_h:g} deg/h"
        )
    return sentences


def _coning_effect(brief: DesignBrief) -> float | None:
    """Return the drift in deg/h without any coning compensation: one sample of a step is its rotation vector."""
    if brief.environment is None:
        return None
    return causes.coning(catalogue.choose_step("euler", "coning-compressed", 1), brief)
