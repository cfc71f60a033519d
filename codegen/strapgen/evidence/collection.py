"""Collects evidence: every check on every kernel, side by side on the cores of the machine.

A subject is a kernel in fixed point with its C; a tool gives a verdict on a claim of its header.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import os
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from functools import cached_property
from multiprocessing import get_context
from pathlib import Path
from typing import Literal

from strapgen import catalogue, fixedpoint, pipeline
from strapgen.catalogue import Choice
from strapgen.ir import checks
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.ir.version import VERSION
from strapgen.navigation.systems.fitting import fitted
from strapgen.navigation.systems.wiring import Description
from strapgen.results.records import entry
from strapgen.run.processes import end_with_parent
from strapgen.targets.naming import UNNAMED, Naming

#: The kernel of the examinations that take long.
REFERENCE_STEP = "euler-rk4-2"


@dataclass(frozen=True)
class Subject:
    """A kernel whose C in fixed point is verified."""

    choice: Choice
    #: Word, ranges and rounding; by default 32 bits and 1/8 rad
    settings: Settings | None = None
    #: Name of the function, where it is a stage of a system
    naming: Naming = UNNAMED

    @cached_property
    def program(self) -> Program:
        """The kernel as straight-line code in exact numbers."""
        return pipeline.program(self.choice)

    @cached_property
    def fixed(self) -> FixedProgram:
        """The program in integers, from which the C is printed."""
        return pipeline.fixed_program(self.choice, self.settings or Settings())

    @cached_property
    def sources(self) -> Sources:
        """The C."""
        return pipeline.compile(self.choice, "c-fixed", self.settings, self.naming)

    @property
    def is_reference_step(self) -> bool:
        """Whether it is the step of the standard catalogue on which the longest examinations are made."""
        return self.choice.kernel == REFERENCE_STEP and (self.settings or Settings()) == Settings()

    @property
    def name(self) -> str:
        """The function's name in C, which is also that of the files."""
        return self.sources.function.name

    @property
    def digest(self) -> str:
        """A hash of the source and the header, 16 hexadecimal digits: what was examined.

        strapgen's version in them is left out: where a new version generates the same code, evidence stays.
        """
        total = hashlib.sha256()
        for name, text in sorted(self.sources.step_files.items()):
            total.update(f"{name}\n{text.replace(VERSION, '')}".encode())
        return total.hexdigest()[:16]


def standard() -> Iterator[Subject]:
    """Yield the kernels of the standard catalogue as they stand in ``generated/c_fixed``."""
    for choice in catalogue.standard():
        if fixedpoint.can_lower(pipeline.program(choice)):
            yield Subject(choice)


def of_system(description: Description, settings: Settings | None = None) -> Iterator[Subject]:
    """Yield the stages of a described system, each with the word, ranges and formats that it has there."""
    fit = fitted(description, "c-fixed", settings)
    for stage in description.system.stages:
        sources = fit.sources[stage.name]
        assert sources.fixed is not None, "the target is fixed point"
        naming = Naming(name=sources.function.name)
        yield Subject(description.choices[stage.name], sources.fixed.settings, naming)


Result = Literal["proved", "agrees", "fails", "not examined", "not installed"]


@dataclass(frozen=True)
class Verdict:
    """The verdict of an external tool on one claim of a kernel's code."""

    #: Name of the kernel with its word, as the files have it: "euler_rk4_2_w32"
    kernel: str = field(metadata=entry("kernel", align="<"))
    #: The promise and the case, as "no overflow: x86_64" or "same bits: cortex-m0"
    claim: str = field(metadata=entry("claim", align="<"))
    #: As "Frama-C Eva", "26.0"
    tool: str = field(metadata=entry("tool", align="<"))
    version: str = field(metadata=entry("version", align="<"))
    #: "proved" is of all inputs in the ranges; "agrees" is of those that were run; "not examined" is where the
    #: tool has no theorem for the code, and the detail tells for what
    result: Result = field(metadata=entry("result", align="<"))
    seconds: float = field(metadata=entry("seconds", ".1f", write=lambda seconds: round(seconds, 2)))
    #: What a reader needs beside it: the figures that were compared, the first alarm, the reason
    detail: str = field(default="", metadata=entry("detail", align="<"))


@dataclass(frozen=True)
class Tool:
    """An independent program."""

    #: As a reader knows it: "Gappa"
    name: str
    #: The programs that it needs on the PATH
    commands: tuple[str, ...]
    #: Debian's packages or PyPI's that bring it
    package: str
    #: ``version()`` returns the version of the installed program
    version: Callable[[], str]
    #: The modules of Python that it needs
    modules: tuple[str, ...] = ()
    #: ``works()`` returns whether programs that are there can do what is needed
    works: Callable[[], bool] = lambda: True

    def installed(self) -> bool:
        """Return whether all its programs and modules are there."""
        there = all(map(shutil.which, self.commands)) and all(map(importlib.util.find_spec, self.modules))
        return there and self.works()


def verdict(kernel: str, claim: str, tool: Tool, judge: Callable[[], tuple[Result, str]]) -> Verdict:
    """Return the verdict of a tool, or that it is not installed."""
    if not tool.installed():
        return Verdict(kernel, claim, tool.name, "", "not installed", 0.0, f"install {tool.package}")
    begun = time.perf_counter()
    result, detail = judge()
    return Verdict(kernel, claim, tool.name, tool.version(), result, time.perf_counter() - begun, detail)


def failures(verdicts: Iterable[Verdict]) -> list[Verdict]:
    """Return the verdicts that fail where no other tool proves the same claim of the same kernel."""
    verdicts = [*verdicts]
    proved = {(verdict.kernel, verdict.claim) for verdict in verdicts if verdict.result == "proved"}
    return [
        verdict
        for verdict in verdicts
        if verdict.result == "fails" and (verdict.kernel, verdict.claim) not in proved
    ]


#: The checks by the names that ``--tool`` takes: the module and its function, which takes a subject and the folder for
#: its files and returns a list of verdicts.
CHECKS: dict[str, tuple[str, str]] = {
    "eva": ("strapgen.evidence.overflow.provers", "prove_by_eva"),
    "z3": ("strapgen.evidence.overflow.provers", "prove_by_z3"),
    "gappa": ("strapgen.evidence.gappa", "check"),
    "coq": ("strapgen.evidence.gappa", "check_by_coq"),
    "lengths": ("strapgen.evidence.state_lengths", "check"),
    "balls": ("strapgen.evidence.actual_errors", "check"),
    "processors": ("strapgen.evidence.processor_runs", "same_bits"),
    "million-steps": ("strapgen.evidence.processor_runs", "million_steps"),
    "style": ("strapgen.evidence.clang_checks", "style"),
    "fuzzing": ("strapgen.evidence.clang_checks", "fuzzing"),
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
        yield _verify(*each[0])
        return
    with ProcessPoolExecutor(os.cpu_count(), get_context("spawn"), end_with_parent) as pool:
        tasks = [pool.submit(_verify, *task) for task in each]
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


def _verify(tool: str, subject: Subject, folder: Path) -> list[Verdict]:
    module, function = CHECKS[tool]
    folder.mkdir(parents=True, exist_ok=True)
    verdicts: list[Verdict] = getattr(importlib.import_module(module), function)(subject, folder)
    return verdicts
