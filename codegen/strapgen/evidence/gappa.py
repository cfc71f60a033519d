"""Has Gappa prove the error bounds of a call: how far the outputs are from exact arithmetic on the same inputs."""

from __future__ import annotations

import re
import resource
import subprocess
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from pathlib import Path

from strapgen.evidence.gappa_fixed import fixed_script
from strapgen.evidence.gappa_floating import DEGREES, floating_script
from strapgen.evidence.gappa_scripts import CannotFollowError, Script
from strapgen.evidence.subjects import Subject
from strapgen.evidence.verdicts import Result, Tool, Verdict, verdict
from strapgen.fixedpoint.floating.bounds import rounding_bounds
from strapgen.fixedpoint.floating.errors import NUMBERS

#: Processor time after which a proof is given up, and bits of the ends of intervals.
SECONDS, PRECISION = 60, 256
#: What a bound may differ from the header's before the difference is told.
_CLOSE = Fraction(1, 20)


def _version() -> str:
    return _run(["--version"]).stdout.split()[-1]


TOOL = Tool("Gappa", ("gappa",), "gappa", _version)


def check(subject: Subject, folder: Path) -> list[Verdict]:
    """Have Gappa prove the error bounds of a call in fixed point, in double and in float."""
    verdicts = [
        _verdict(subject.name, "one step", folder / "one_step.g", lambda: [fixed_script(subject.fixed)])
    ]
    for number in NUMBERS:
        write = partial(_floating, subject, number)
        file = folder / f"one_step_{number}.g"
        verdicts.append(_verdict(subject.name, f"one step in {number}", file, write))
    return verdicts


def _floating(subject: Subject, number: str) -> Iterator[Script]:
    """Yield scripts of a call in floating point, the quicker ones first."""
    rounding = rounding_bounds(subject.program, number)
    return (floating_script(subject.program, rounding, degree) for degree in DEGREES)


def _verdict(kernel: str, case: str, file: Path, write: Callable[[], Iterable[Script]]) -> Verdict:
    """Return what Gappa says of the first script with which it proves the bounds, or of the last."""

    def judge() -> tuple[Result, str]:
        outcome: tuple[Result, str] = "fails", "no script"
        try:
            for script in write():
                file.write_text(f"# Run: gappa -Eprecision={PRECISION} {file.name}\n{script.question()}")
                outcome = judged(script, answered(file))
                if outcome[0] == "proved":
                    break
        except CannotFollowError as reason:
            return "not examined", str(reason)
        return outcome

    return verdict(kernel, f"error bound: {case}", TOOL, judge)


@dataclass(frozen=True)
class Answer:
    """What Gappa says of a script that asks for bounds."""

    #: A bound of the magnitude of each expression, in order; fewer where it has none
    bounds: tuple[Fraction, ...]
    #: A rule that is no identity, or why it gave up; "" where all is well
    complaint: str = ""


def answered(file: Path) -> Answer:
    """Return the bounds that Gappa proves."""
    outcome = _run([f"-Eprecision={PRECISION}", str(file)])
    if outcome.returncode < 0:
        return Answer((), f"no answer in {SECONDS} s")
    lines = (outcome.stdout + outcome.stderr).splitlines()
    for line in lines:  # Gappa takes a rule on trust, and says so
        if "not trivially equal" in line or "assumed to be nonzero" in line or line.startswith("Error"):
            return Answer((), line.removeprefix("Warning: "))
    bounds = []
    for line in lines:
        ends = re.search(r" in \[([^, ]+), ([^] ]+)\]$", re.sub(r" \{[^}]*\}", "", line))
        if ends:
            bounds.append(max(abs(_exactly(end)) for end in ends.groups()))
    return Answer(tuple(bounds))


def judged(script: Script, answer: Answer) -> tuple[Result, str]:
    """Compare the bounds that Gappa proves with those that the header states.

    Returns: "proved" if none is larger, otherwise "fails"; and the bounds that are the closest to the header's,
    or farthest above.
    """
    if answer.complaint:
        return "fails", answer.complaint
    stated = [*script.goals.values()]
    if len(answer.bounds) != len(stated):
        return "fails", "Gappa finds no bound of every output"
    pairs = list(zip(answer.bounds, stated, strict=True))
    if any(bound > limit for bound, limit in pairs):
        return "fails", _compared([pair for pair in pairs if pair[0] > pair[1]])
    return "proved", _compared([pair for pair in pairs if pair[1]])


def _compared(pairs: Sequence[tuple[Fraction, Fraction]]) -> str:
    """Return the largest bounds beside those of the header, and their ratio."""
    if not pairs:
        return "exact"
    bound, limit = max(pairs, key=lambda pair: (pair[0] / pair[1] if pair[1] else 0, pair[0]))
    text = f"{float(bound):.4g}, the header states {float(limit):.4g}"
    if not limit:
        return text
    ratio = bound / limit
    return f"{text}, ratio {float(ratio):.3f}{'' if abs(ratio - 1) <= _CLOSE else ', more than 5 % apart'}"


def _exactly(text: str) -> Fraction:
    """Return a number as Gappa prints it: an integer, or one times a power of two."""
    integer, _, exponent = text.partition("b")
    return int(integer) * Fraction(2) ** int(exponent or 0)


def _run(arguments: Sequence[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["gappa", *arguments],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 1)),
    )
