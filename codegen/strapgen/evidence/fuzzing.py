"""Fuzzes generated C under clang's sanitizers, by a driver that checks every call against the contract."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from strapgen.evidence.fuzz_c import driver_files, driver_name
from strapgen.evidence.subjects import Subject
from strapgen.evidence.verdicts import Result, Tool, Verdict, verdict
from strapgen.ir.sources import Sources
from strapgen.storage.drafts import temporary_folder
from strapgen.storage.files import write_files

#: Inputs that are tried for the evidence of a kernel, and the seed of the fuzzer.
INPUTS, SEED = 100_000, 1
#: Longest input in bytes: several times what the calls of a driver read.
LONGEST = 512
_FLAGS = ("-std=c99", "-g", "-O1", "-fsanitize=fuzzer,address,undefined", "-fno-sanitize-recover=all")
_PROGRAM = "./fuzz"


def fuzzing(subject: Subject, folder: Path) -> list[Verdict]:
    """Tell whether a fuzzer finds a call that does not what the header says, or that a sanitizer reports."""
    place = folder / "fuzzing"

    def judge() -> tuple[Result, str]:
        write_files(place, fuzz_files(subject))
        said = built(place, subject.sources)
        if said:
            return "fails", said
        report = run_fuzzer(place, [f"-runs={INPUTS}", f"-seed={SEED}"])
        return ("fails", report) if report else ("agrees", f"{INPUTS} inputs")

    return [verdict(subject.name, "no undefined behaviour: fuzzing", FUZZER, judge)]


def fuzz_files(subject: Subject) -> dict[str, str]:
    """Return a kernel's C with its driver, text by file name."""
    sources = subject.sources
    range_checked = any(value.range_checked for value in subject.fixed.body)
    commands = (" ".join(_build(sources)), f"{_PROGRAM} -max_len={LONGEST} -len_control=0 -max_total_time=60")
    return {**sources.files, **driver_files(sources, range_checked, commands)}


def _build(sources: Sources) -> list[str]:
    code = [name for name in sources.files if name.endswith(".c")]
    return ["clang", *_FLAGS, *code, driver_name(sources), "-o", _PROGRAM]


def built(folder: Path, sources: Sources) -> str:
    """Compile the driver in its folder; return the error that there is, otherwise nothing."""
    done = subprocess.run(_build(sources), cwd=folder, capture_output=True, text=True, check=False)
    if not done.returncode:
        return ""
    errors = [line for line in done.stderr.splitlines() if "error" in line]
    return f"clang failed: {(errors or done.stderr.splitlines() or [''])[0].strip()}"


def run_fuzzer(folder: Path, options: Sequence[str]) -> str:
    """Let the fuzzer run; return what it reports, with the input that it reports it of, otherwise nothing."""
    command = [_PROGRAM, f"-max_len={LONGEST}", "-len_control=0", "-timeout=10", *options]
    done = subprocess.run(command, cwd=folder, capture_output=True, check=False)
    return reported(done.stderr.decode(errors="replace")) if done.returncode else ""


def reported(said: str) -> str:
    r"""Return what a fuzzer's messages report: the contract's line, or that of a sanitizer, and the input.

    >>> reported("f: an input is changed\nartifact_prefix='./'; Test unit written to ./crash-1\nBase64: AQ==\n")
    'f: an input is changed; input in base 64: AQ=='
    """
    lines = [line.strip() for line in said.splitlines()]
    reason = next((line for line in lines if "runtime error: " in line or "ERROR: " in line), "")
    broken = [line for line in lines if re.match(r"\w+: (an |a |the |arguments )", line)]
    unit = re.search(r"^Base64: (\S*)$", said, flags=re.MULTILINE)
    text = re.sub(r"^==\d+==\s*", "", (broken or [reason or "the fuzzer ends early"])[0])
    return f"{text}; input in base 64: {unit[1]}" if unit else text


class _LibFuzzer(Tool):
    """The fuzzer of clang, which a package of its own brings."""

    def installed(self) -> bool:
        """Return whether clang links a program with it."""
        return super().installed() and _links()


@cache
def _links() -> bool:
    with temporary_folder() as folder:
        text = "int LLVMFuzzerTestOneInput(const unsigned char *data, unsigned long size);\n"
        text += "int LLVMFuzzerTestOneInput(const unsigned char *data, unsigned long size)\n"
        (folder / "empty.c").write_text(f"{text}{{\n    return (data != 0) && (size > 9u) && 0;\n}}\n")
        done = subprocess.run(
            ["clang", *_FLAGS, "empty.c", "-o", _PROGRAM], cwd=folder, capture_output=True, check=False
        )
        return done.returncode == 0


@cache
def _version() -> str:
    said = subprocess.run(["clang", "--version"], capture_output=True, text=True, check=True).stdout
    match = re.search(r"version (\d[\w.]*)", said)
    return match[1] if match else ""


FUZZER = _LibFuzzer("libFuzzer", ("clang",), "clang libclang-rt-14-dev", _version)
