"""What clang-tidy and clang find in generated C, where every check is on but those that are named here."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable, Mapping
from functools import cache, partial
from pathlib import Path

from strapgen import pipeline
from strapgen.evidence.fuzzing import fuzz_files
from strapgen.evidence.motion_rows import motion_rows
from strapgen.evidence.same_bits import LONGEST_WORD, ROWS
from strapgen.evidence.subjects import Subject
from strapgen.evidence.verdicts import Result, Tool, Verdict, verdict
from strapgen.firmware.vectors.vectors import vectors_of_choice
from strapgen.firmware.vectors.vectors_c import table_files
from strapgen.lab.runner_c import CallRun, run_files
from strapgen.storage.files import write_files

#: Checks of clang-tidy. That parameters of one type can be swapped is left out: an input, an output and a state are
#: arrays of one type by nature, and their names stand in the header.
CHECKS = "-*,bugprone-*,cert-*,-bugprone-easily-swappable-parameters"
#: Warnings of clang that are left out of all that it has, with the first version that knows each.
UNWARNED = {
    # C99 allows a declaration where a value is first known; so every value is a constant.
    "declaration-after-statement": 0,
    # A vector of a test has padding after its status; nothing depends on it.
    "padded": 0,
    # Arrays are reached through pointers in C.
    "unsafe-buffer-usage": 16,
}
#: Vectors of a test whose style is examined; more of them are only more numbers.
_VECTORS = 20


def style(subject: Subject, folder: Path) -> list[Verdict]:
    """Tell what two tools find in the C of a kernel."""
    verdicts = []
    for case, files in _cases(subject).items():
        place = folder / "style" / case.replace(" ", "_")

        def judge(examine: Callable[[Path], list[str]], place: Path, files: _Files) -> tuple[Result, str]:
            write_files(place, files())
            return judged(examine(place))

        verdicts += [
            verdict(subject.name, f"style: {case}", tool, partial(judge, examine, place, files))
            for tool, examine in TOOLS
        ]
    return verdicts


_Files = Callable[[], Mapping[str, str]]


def _cases(subject: Subject) -> dict[str, _Files]:
    def floating() -> dict[str, str]:
        double, single = (pipeline.compile(subject.choice, name).files for name in ("c", "c-float"))
        return {
            f"{name}/{file}": text
            for name, files in (("double", double), ("float", single))
            for file, text in files.items()
        }

    def tests() -> dict[str, str]:
        table = vectors_of_choice(
            subject.choice, "c-fixed", subject.settings, _VECTORS, naming=subject.naming
        )
        files = {**fuzz_files(subject), **table_files(table)}
        assert subject.sources.fixed is not None
        if subject.sources.fixed.settings.word <= LONGEST_WORD:
            files |= run_files(CallRun(subject.sources, motion_rows(subject.sources.fixed, ROWS)))
        return files

    return {"fixed point": lambda: subject.sources.files, "floating point": floating, "tests": tests}


def judged(findings: list[str]) -> tuple[Result, str]:
    """Return the result of findings, with the first of them."""
    if not findings:
        return "agrees", ""
    return "fails", f"{len(findings)} findings, first {findings[0]}"


def found_by_clang_tidy(folder: Path) -> list[str]:
    """Return the findings of clang-tidy in all C files below a folder, a line each."""
    sources, include = _sources(folder)
    command = [
        "clang-tidy",
        "--quiet",
        "--config={}",
        f"-checks={CHECKS}",
        *sources,
        "--",
        "-std=c99",
        *include,
    ]
    return _findings(command, folder)


def found_by_clang(folder: Path) -> list[str]:
    """Return what clang warns of in all C files below a folder, a line each; see `found_by_clang_tidy`."""
    sources, include = _sources(folder)
    version = int(_clang_version().partition(".")[0])
    silent = [f"-Wno-{name}" for name, first in UNWARNED.items() if version >= first]
    return _findings(
        ["clang", "-std=c99", "-Weverything", *silent, "-fsyntax-only", *include, *sources], folder
    )


def _sources(folder: Path) -> tuple[list[str], list[str]]:
    paths = sorted(path.relative_to(folder) for path in folder.rglob("*.c"))
    return [*map(str, paths)], [f"-I{place}" for place in sorted({path.parent for path in paths} | {Path()})]


def _findings(command: list[str], folder: Path) -> list[str]:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    said = f"{done.stdout}\n{done.stderr}"
    rows = re.findall(r"^(\S+?):(\d+):\d+: (?:warning|(?:fatal )?error): (.*)$", said, flags=re.MULTILINE)
    if done.returncode and not rows:
        return [said.strip().splitlines()[-1]]
    lines = [f"{Path(path).name}:{line}: {text}" for path, line, text in rows]
    return list(dict.fromkeys(lines))  # a header's, once


def _version(program: str) -> str:
    said = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout
    match = re.search(r"version (\d[\w.]*)", said)
    return match[1] if match else ""


@cache
def _clang_version() -> str:
    return _version("clang")


#: The tools, each with the function that lists its findings.
TOOLS = (
    (Tool("clang-tidy", ("clang-tidy",), "clang-tidy", partial(_version, "clang-tidy")), found_by_clang_tidy),
    (Tool("clang", ("clang",), "clang", _clang_version), found_by_clang),
)
