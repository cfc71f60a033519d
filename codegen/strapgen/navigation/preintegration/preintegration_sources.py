"""The C++ header that preintegrates stamped samples between any two instants."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from strapgen import pipeline
from strapgen.catalogue import Choice, choose
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.interfaces import RoundingBounds
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.ir.version import VERSION
from strapgen.navigation.preintegration import AWAY, FEWEST, INPUTS, INTERPOLATION, POINTS, preintegrator
from strapgen.navigation.preintegration.preintegrator import PreintegrationStatus
from strapgen.results.result import Result
from strapgen.targets import c, cpp
from strapgen.targets.rendering import render

#: The target: the states of a factor are sums of many steps, which single precision rounds too much.
TARGETS = ("cpp",)

_SAMPLES = {
    "increments": (
        "increments of angle and velocity in rad and m/s",
        "the end of the sample, which begins at the last one",
    ),
    "rates": (
        "mean rates and specific forces in rad/s and m/s^2",
        "the end of the sample, which begins at the last one",
    ),
    "instants": ("rates and specific forces in rad/s and m/s^2", "the instant of the sample"),
}
_TEXTS = {
    "BACK": "the stamp is before the last one",
    "REPEATED": "the stamp is the last one again",
    "GAP": f"the stamp is more than {preintegrator.LONGEST:g} nominal intervals after the last one; reset begins anew",
    "OUTSIDE": "the interval, with the samples that its ends need, is outside of what was pushed and is still held",
    "ORDER": "the interval does not end after its beginning",
    "NOT_FINITE": "a number is not finite",
}


@dataclass(frozen=True)
class PreintegrationResult(Result):
    """The written header of a preintegration."""

    name: str
    #: Kernel of a step
    kernel: str
    files: Sequence[Path]
    #: Operations of a step by kind
    operations: Mapping[str, int]

    def text(self) -> str:
        """Return the name, the operations and the files."""
        counts = ", ".join(f"{number} {kind}" for kind, number in self.operations.items() if number)
        return "\n".join(
            [f"{self.name} by {self.kernel}: {counts} a step", *(f"  {path}" for path in self.files)]
        )


def sources(method: str, input: str = "increments", target: str = "cpp", name: str | None = None) -> Sources:
    """Return the header for a window, a pair, a file of one, or "kept-sample".

    Examples
    --------
    >>> list(sources("pair-1-5").files)
    ['preintegration_pair_1_5.hpp']
    """
    checks.choice("target", target, TARGETS)
    checks.choice("input", input, INPUTS)
    choice = preintegrator.choose_method(method)
    identifier = name or choice.kernel.replace("-", "_").replace("preintegrate", "preintegration", 1)
    if not (re.fullmatch(r"[A-Za-z]\w*", identifier, re.ASCII) and cpp.CPP.allows(identifier)):
        raise InputError(
            f"--name is {name!r}; letters, digits and underscores are needed, a letter first, no keyword"
        )
    step, update, interpolation = (f"{identifier}_{part}" for part in ("step", "update", "interpolation"))
    printed = [
        _function(choice, step),
        _function(choose(preintegrator.UPDATE), update),
        _function(choose(INTERPOLATION[input]), interpolation),
    ]
    program = pipeline.program(choice)
    command = ["strapgen", "preintegrate", "--window", method, "--input", input, "--target", target]
    command += [] if name is None else ["--name", name]
    samples, meaning = _SAMPLES[input]
    assert choice.increments is not None
    values = {
        "title": "Preintegration of stamped samples of a gyro and an accelerometer between any two instants.",
        "command": shlex.join(command),
        "version": VERSION,
        "program": program,
        "samples": samples,
        "meaning": meaning,
        "points": POINTS,
        "fewest": FEWEST,
        "away": AWAY,
        "interpolation": interpolation,
        "previous": choice.previous,
        "ahead": choice.ahead,
        "count": choice.increments,
        "width": choice.previous + choice.increments + choice.ahead,
        "status": list(PreintegrationStatus),
        "texts": _TEXTS,
        "longest": preintegrator.LONGEST,
        "slack": preintegrator.SLACK,
        "guard": f"{identifier}_hpp".upper(),
        "name": identifier,
        "input": input,
        "functions": "\n".join(one.files["function"] for one in printed),
        "states": program.inputs[3:12],
        "update": update,
        "step": step,
        "from": ", ".join(f"from.{signal.name}" for signal in program.inputs[3:12]),
        "to": ", ".join(f"to.{signal.name}" for signal in program.inputs[3:12]),
    }
    header = {f"{identifier}.hpp": render("preintegration_cpp/header.hpp.j2", **values)}
    return Sources.of(program, target, identifier, header)


def _function(choice: Choice, name: str) -> Sources:
    """Return a kernel as an inline function of arrays."""

    def text(program: Program, name: str, target: str, rounding: RoundingBounds) -> dict[str, str]:
        printer = c.CPrinter(c.DOUBLE, name)
        values = c.values_of(program, name, target, printer, rounding) | {"name": name}
        code = {"code": c.code_of(program, printer)}
        return {
            "function": re.sub(
                r"\n{3,}", "\n\n", render("preintegration_cpp/function.hpp.j2", **values, **code)
            )
        }

    return c.sources_of(pipeline.program(choice), "cpp", name, text, cpp.CPP, ())
