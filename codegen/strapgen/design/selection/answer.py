"""Answers a brief: all algorithms, judged, the cheapest that meet it first."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from strapgen import catalogue
from strapgen.design.brief import DesignBrief, files_of
from strapgen.design.selection import causes
from strapgen.design.selection.candidates import Contender
from strapgen.design.selection.judgement import Judgement, Question, judged
from strapgen.ir.version import VERSION
from strapgen.lab.parallel_cases import Bundle, Cluster, resume, side_by_side
from strapgen.storage import cache as disk_cache


def judgements(
    path: str | Path,
    several: Iterable[Contender],
    results: str | Path | None = None,
    jobs: int | None = None,
    cluster: Cluster | None = None,
) -> Iterator[list[Judgement]]:
    """Judge algorithms by a brief, and yield the judgements of each with all states when they are there."""
    cases = {one.name: Question(str(path), one) for one in several}
    files = None if cluster is None else Bundle.of(files_of(path))
    if results is None:
        finished = side_by_side(judged, cases, jobs, cluster, files)
    else:
        finished = resume(judged, cases, results, _identity(path), jobs, cluster, files)
    for _, rows in finished:
        yield [Judgement(**row) for row in rows]


def _identity(path: str | Path) -> dict[str, Any]:
    """Return what results belong to: the code and the brief."""
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
    """Return what a brief leads to, in sentences."""
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
            sentences.append(
                f"the choice is fragile: {best.fragile}; other frequencies or a changed gyro undo it"
            )
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
