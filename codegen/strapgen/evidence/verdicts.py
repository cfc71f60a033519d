"""What an independent tool says of a promise of the generated code."""

from __future__ import annotations

import importlib.util
import shutil
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal

Result = Literal["proved", "agrees", "fails", "not examined", "not installed"]


@dataclass(frozen=True)
class Verdict:
    """What an independent tool says of one promise of a kernel's code.

    Parameters
    ----------
    kernel : str
        Name of the kernel with its word, as the files have it: "euler_rk4_2_w32".
    claim : str
        The promise and the case, as "no overflow: x86_64" or "same bits: cortex-m0".
    tool, version : str
        As "Frama-C Eva", "26.0".
    result : {"proved", "agrees", "fails", "not examined", "not installed"}
        "proved" is of all inputs in the ranges; "agrees" is of those that were run; "not examined" is where the tool
        has no theorem for the code, and the detail tells for what.
    seconds : float
    detail : str
        What a reader needs beside it: the figures that were compared, the first alarm, the reason.
    """

    kernel: str
    claim: str
    tool: str
    version: str
    result: Result
    seconds: float
    detail: str = ""


def verdict(kernel: str, claim: str, tool: Tool, judge: Callable[[], tuple[Result, str]]) -> Verdict:
    """Return what a tool says, or that it is not installed.

    Parameters
    ----------
    kernel, claim : str
    tool : Tool
    judge : callable
        Runs the tool; it returns the result and the detail.
    """
    if not tool.installed():
        return Verdict(kernel, claim, tool.name, "", "not installed", 0.0, f"install {tool.package}")
    begun = time.perf_counter()
    result, detail = judge()
    return Verdict(kernel, claim, tool.name, tool.version(), result, time.perf_counter() - begun, detail)


@dataclass(frozen=True)
class Tool:
    """An independent program.

    Parameters
    ----------
    name : str
        As a reader knows it: "Gappa".
    commands : tuple of str
        The programs that it needs on the PATH.
    package : str
        Debian's packages or PyPI's that bring it.
    version : callable
        ``version()`` returns the version of the installed program.
    modules : tuple of str, optional
        The modules of Python that it needs.
    """

    name: str
    commands: tuple[str, ...]
    package: str
    version: Callable[[], str]
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
