"""Checks of generated C by clang: warnings, findings of clang-tidy, and fuzzing under sanitizers.

Every check and warning is on but those that are named here. The fuzzer runs a driver that checks every call against the
contract: ranges of inputs and outputs, range checks, error feedback, and the loops over samples and runs.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from pathlib import Path

from strapgen import pipeline
from strapgen.evidence.collection import Result, Subject, Tool, Verdict, verdict
from strapgen.evidence.processor_runs import LONGEST_WORD, ROWS, motion_rows
from strapgen.firmware.vectors import vectors_of_choice
from strapgen.firmware.vectors_c import table_files
from strapgen.ir.interfaces import Argument
from strapgen.ir.sources import Sources
from strapgen.lab.runner_c import CallRun, run_files
from strapgen.storage.drafts import temporary_folder
from strapgen.storage.files import write_files
from strapgen.targets.c_numbers import numbers_of, types_of
from strapgen.targets.rendering import render, word_literal

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
#: Inputs that are tried for the evidence of a kernel, and the seed of the fuzzer.
INPUTS, SEED = 100_000, 1
#: Longest input in bytes: several times what the calls of a driver read.
LONGEST = 512
_FLAGS = ("-std=c99", "-g", "-O1", "-fsanitize=fuzzer,address,undefined", "-fno-sanitize-recover=all")
_PROGRAM = "./fuzz"


def style(subject: Subject, folder: Path) -> list[Verdict]:
    """Run two tools on the C of a kernel, and return their verdicts."""
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
    """Return the warnings of clang for all C files below a folder, a line each; see `found_by_clang_tidy`."""
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


@cache
def _links() -> bool:
    """Return whether clang links a program with its fuzzer, which a package of its own brings."""
    with temporary_folder() as folder:
        text = "int LLVMFuzzerTestOneInput(const unsigned char *data, unsigned long size);\n"
        text += "int LLVMFuzzerTestOneInput(const unsigned char *data, unsigned long size)\n"
        (folder / "empty.c").write_text(
            f"{text}{{\n    return (data != 0) && (size > 9u) && 0;\n}}\n", encoding="utf-8", newline="\n"
        )
        done = subprocess.run(
            ["clang", *_FLAGS, "empty.c", "-o", _PROGRAM], cwd=folder, capture_output=True, check=False
        )
        return done.returncode == 0


FUZZER = Tool("libFuzzer", ("clang",), "clang libclang-rt-14-dev", _clang_version, works=lambda: _links())


def fuzzing(subject: Subject, folder: Path) -> list[Verdict]:
    """Return whether a fuzzer finds a call that violates the contract, or that a sanitizer reports."""
    place = folder / "fuzzing"

    def judge() -> tuple[Result, str]:
        write_files(place, fuzz_files(subject))
        said = compile_driver(place, subject.sources)
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


def compile_driver(folder: Path, sources: Sources) -> str:
    """Compile the driver in its folder; return the error that there is, otherwise nothing."""
    done = subprocess.run(_build(sources), cwd=folder, capture_output=True, text=True, check=False)
    if not done.returncode:
        return ""
    errors = [line for line in done.stderr.splitlines() if "error" in line]
    return f"clang failed: {(errors or done.stderr.splitlines() or [''])[0].strip()}"


def run_fuzzer(folder: Path, options: Sequence[str]) -> str:
    """Run the fuzzer; return its report with the input, or nothing."""
    command = [_PROGRAM, f"-max_len={LONGEST}", "-len_control=0", "-timeout=10", *options]
    done = subprocess.run(command, cwd=folder, capture_output=True, check=False)
    return fuzzer_report(done.stderr.decode(errors="replace")) if done.returncode else ""


def fuzzer_report(said: str) -> str:
    r"""Return the report in a fuzzer's messages: the line of the contract or of a sanitizer, and the input.

    >>> fuzzer_report("f: an input is changed\nartifact_prefix='./'; Test unit written to ./crash-1\nBase64: AQ==\n")
    'f: an input is changed; input in base 64: AQ=='
    """
    lines = [line.strip() for line in said.splitlines()]
    reason = next((line for line in lines if "runtime error: " in line or "ERROR: " in line), "")
    broken = [line for line in lines if re.match(r"\w+: (an |a |the |arguments )", line)]
    unit = re.search(r"^Base64: (\S*)$", said, flags=re.MULTILINE)
    text = re.sub(r"^==\d+==\s*", "", (broken or [reason or "the fuzzer ends early"])[0])
    return f"{text}; input in base 64: {unit[1]}" if unit else text


def driver_name(sources: Sources) -> str:
    """Return the name of a function's driver."""
    return f"fuzz_{sources.function.name}.c"


def driver_files(sources: Sources, range_checked: bool, commands: Sequence[str] = ()) -> dict[str, str]:
    """Print the driver of a function."""
    assert sources.fixed is not None
    numbers, interface = numbers_of(sources), sources.fixed
    inputs, outputs = interface.inputs, interface.outputs
    prefix = {a.signal.name: f"in_{a.signal.name}" for a in inputs}
    prefix |= {a.signal.name: f"out_{a.signal.name}" for a in outputs}
    feedback = ["feedback"] if interface.residuals else []
    order = [*(prefix[a.signal.name] for a in inputs), *feedback, *(prefix[a.signal.name] for a in outputs)]
    step = sources.attitude_step is not None and len(inputs) == 2
    values = {
        "name": sources.function.name,
        "commands": commands,
        "numbers": numbers,
        "types": types_of(sources),
        "wide": "int64_t",
        "inputs": inputs,
        "outputs": outputs,
        "prefix": prefix,
        "limits": {
            a.signal.name: [word_literal(limit, a.format.word) for limit in (a.low, a.high)]
            for a in (*inputs, *outputs)
        },
        "feedback": interface.residuals,
        "range_checked": range_checked,
        "arrays": order,
        "array_call": ", ".join(f"{name}[0]" for name in order),
        "alias": _alias(inputs, outputs, order),
        "state": inputs[0].signal if step else None,
        "samples": inputs[-1].signal,
    }
    return {driver_name(sources): render("fuzz_c/driver.c.j2", **values)}


def _alias(
    inputs: Sequence[Argument], outputs: Sequence[Argument], order: Sequence[str]
) -> dict[str, str] | None:
    """Return an input and an output of one size and type, and a call in which they have the same memory."""
    for output in outputs:
        for argument in inputs:
            if (argument.signal.size, argument.format.word) == (output.signal.size, output.format.word):
                shared, place = f"in_{argument.signal.name}", f"out_{output.signal.name}"
                names = [shared if name == place else name for name in order]
                call = ", ".join(f"again.{name}" for name in names)
                return {"input": argument.signal.name, "output": output.signal.name, "call": call}
    return None
