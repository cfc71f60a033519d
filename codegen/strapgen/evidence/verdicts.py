"""What an independent tool says of a promise of the generated code."""

from __future__ import annotations

import importlib.util
import shutil
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Literal

from strapgen.results.records import entry

Result = Literal["proved", "agrees", "fails", "not examined", "not installed"]


@dataclass(frozen=True)
class Verdict:
    """What an independent tool says of one promise of a kernel's code."""

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


def verdict(kernel: str, claim: str, tool: Tool, judge: Callable[[], tuple[Result, str]]) -> Verdict:
    """Return what a tool says, or that it is not installed."""
    if not tool.installed():
        return Verdict(kernel, claim, tool.name, "", "not installed", 0.0, f"install {tool.package}")
    begun = time.perf_counter()
    result, detail = judge()
    return Verdict(kernel, claim, tool.name, tool.version(), result, time.perf_counter() - begun, detail)


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

    def installed(self) -> bool:
        """Return whether all its programs and modules are there."""
        return all(map(shutil.which, self.commands)) and all(map(importlib.util.find_spec, self.modules))


def failures(verdicts: Iterable[Verdict]) -> list[Verdict]:
    """Return the verdicts that fail where no other tool proves the same claim of the same kernel."""
    verdicts = [*verdicts]
    proved = {(verdict.kernel, verdict.claim) for verdict in verdicts if verdict.result == "proved"}
    return [
        verdict
        for verdict in verdicts
        if verdict.result == "fails" and (verdict.kernel, verdict.claim) not in proved
    ]
