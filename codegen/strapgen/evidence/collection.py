"""Collects evidence: every check on every kernel, side by side on the cores of the machine."""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

from strapgen.evidence.subjects import Subject
from strapgen.evidence.verdicts import Verdict
from strapgen.ir import checks
from strapgen.run.processes import end_with_parent

#: The checks by the names that ``--tool`` takes: the module and its function, which takes a subject and the folder for
#: its files and returns a list of verdicts.
CHECKS: dict[str, tuple[str, str]] = {
    "eva": ("strapgen.evidence.overflow.eva", "prove"),
    "z3": ("strapgen.evidence.overflow.solver", "prove"),
    "gappa": ("strapgen.evidence.gappa", "check"),
    "coq": ("strapgen.evidence.coq_proof", "check"),
    "lengths": ("strapgen.evidence.state_lengths", "check"),
    "balls": ("strapgen.evidence.actual_errors", "check"),
    "processors": ("strapgen.evidence.same_bits", "same_bits"),
    "million-steps": ("strapgen.evidence.long_run", "million_steps"),
    "style": ("strapgen.evidence.style", "style"),
    "fuzzing": ("strapgen.evidence.fuzzing", "fuzzing"),
}


def collect(subjects: Sequence[Subject], folder: Path, tools: Sequence[str] = ()) -> Iterator[list[Verdict]]:
    """Run every check on every kernel.

    `folder`: each kernel has a folder of its function's name in it, with what the tools read and a reader can
    run again.
    """
    for tool in tools:
        checks.choice("tool", tool, CHECKS)
    for subject in subjects:
        subject.sources  # noqa: B018 - one line of refusal before any work, and once for all processes
    each = [(tool, subject, folder / subject.name) for tool in tools or CHECKS for subject in subjects]
    if len(each) == 1:  # it needs no other process
        yield _examined(*each[0])
        return
    with ProcessPoolExecutor(os.cpu_count(), get_context("spawn"), end_with_parent) as pool:
        tasks = [pool.submit(_examined, *task) for task in each]
        try:
            for task in as_completed(tasks):
                yield task.result()
        finally:
            pool.shutdown(cancel_futures=True)


def in_order(verdicts: Sequence[Verdict], subjects: Sequence[Subject]) -> list[Verdict]:
    """Return verdicts kernel by kernel, as the subjects stand, and claim by claim in the order of the checks."""
    place = {subject.name: k for k, subject in enumerate(subjects)}
    claims = {claim: k for k, claim in enumerate(sorted({verdict.claim for verdict in verdicts}))}
    return sorted(verdicts, key=lambda verdict: (place[verdict.kernel], claims[verdict.claim], verdict.tool))


def _examined(tool: str, subject: Subject, folder: Path) -> list[Verdict]:
    module, function = CHECKS[tool]
    folder.mkdir(parents=True, exist_ok=True)
    verdicts: list[Verdict] = getattr(importlib.import_module(module), function)(subject, folder)
    return verdicts
