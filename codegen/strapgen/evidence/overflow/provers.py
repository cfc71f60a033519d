"""z3 and Frama-C Eva prove from the C that nothing overflows and that every output lies in its range.

z3 decides formulas for all inputs; Eva interprets the C abstractly, for every input in its word and two sizes of int.
"""

from __future__ import annotations

import os
import re
import subprocess
from functools import partial
from importlib.metadata import version
from pathlib import Path

from strapgen.evidence.collection import Result, Subject, Tool, Verdict, verdict
from strapgen.evidence.overflow.c_types import MODELS, Model
from strapgen.ir.interfaces import Argument
from strapgen.ir.sources import Sources
from strapgen.targets.c_numbers import memory_type

_OPTIONS = (
    "-eva",
    "-eva-precision=2",
    "-warn-signed-overflow",
    "-warn-signed-downcast",
    "-warn-right-shift-negative",
    "-warn-left-shift-negative",
)
_SECONDS = 300
Z3 = Tool(
    "z3", ("cc",), "z3-solver and pycparser from PyPI", partial(version, "z3-solver"), ("z3", "pycparser")
)


def prove_by_z3(subject: Subject, folder: Path) -> list[Verdict]:
    """Have z3 prove that no operation of a kernel overflows and that every output lies in its stated range."""
    for name, text in subject.sources.step_files.items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
    return [
        verdict(
            subject.name,
            f"no overflow: {name}",
            Z3,
            partial(judged_by_z3, subject, subject.sources.step_files, model),
        )
        for name, model in MODELS.items()
    ]


def judged_by_z3(subject: Subject, files: dict[str, str], model: Model) -> tuple[Result, str]:
    """Return whether all obligations of the C in some files are proved, and the others."""
    from strapgen.evidence.overflow.obligations import unproved

    left = unproved(subject, files, model)
    if not left:
        return "proved", ""
    return "fails", f"{len(left)} open, the first in {left[0].place}: {left[0].text}"


def _eva_version() -> str:
    return subprocess.run(["frama-c", "-version"], capture_output=True, text=True, check=True).stdout.split()[
        0
    ]


EVA = Tool("Frama-C Eva", ("frama-c",), "frama-c-base", _eva_version)


def prove_by_eva(subject: Subject, folder: Path) -> list[Verdict]:
    """Have Eva look for overflow, for any other undefined behaviour and for outputs out of their ranges."""
    if subject.fixed.word == 64:
        return []
    write_harness(subject.sources, folder)
    return [
        verdict(
            subject.name, f"no overflow: {model}", EVA, partial(judged_by_eva, subject.name, folder, model)
        )
        for model in MODELS
    ]


def write_harness(sources: Sources, folder: Path) -> None:
    """Write the C of a kernel and the harness that calls it into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in {**sources.step_files, f"{sources.function.name}_eva.c": harness(sources)}.items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")


def harness(sources: Sources) -> str:
    """Return a C program that calls a kernel once with any words, and asserts the range of every output.

    >>> from strapgen.catalogue import Choice
    >>> from strapgen.evidence.collection import Subject
    >>> print(harness(Subject(Choice("euler-normalize")).sources).partition("int main")[2])
    (void)
    {
        int32_t state[4];
        int32_t next[4];
        int k;
        for (k = 0; k < 4; ++k) {
            state[k] = any_int32_t;
        }
        if (euler_normalize_w32(state, next) == 0) {
            //@ assert -1613406519 <= next[0] <= 1613406519;
            //@ assert -1613406519 <= next[1] <= 1613406519;
            //@ assert -1613406519 <= next[2] <= 1613406519;
            //@ assert -1613406519 <= next[3] <= 1613406519;
        }
        return 0;
    }
    <BLANKLINE>
    """
    interface, name = sources.fixed, sources.function.name
    assert interface is not None
    inputs = [(a.signal.name, a.signal.size, memory_type(a)) for a in interface.inputs]
    outputs = [(a.signal.name, a.signal.size, memory_type(a)) for a in interface.outputs]
    feedback = len(interface.residuals)
    arguments = [
        *inputs,
        *([("residuals", feedback, f"uint{interface.settings.word}_t")] if feedback else []),
    ]
    lines = [f"{kind} {argument}[{size}];" for argument, size, kind in (*arguments, *outputs)]
    lines.append("int k;")
    for argument, size, kind in arguments:
        lines += [f"for (k = 0; k < {size}; ++k) {{", f"    {argument}[k] = any_{kind};", "}"]
    call = ", ".join(argument for argument, _, _ in (*arguments, *outputs))
    lines.append(f"if ({name}({call}) == 0) {{")
    lines += [f"    {line}" for output in interface.outputs for line in _assertions(output)]
    lines += ["}", "return 0;"]
    kinds = sorted({kind for _, _, kind in arguments})
    return "\n".join(
        [
            f"/* Any words go in; what comes out lies in the ranges that {name}.h states.",
            f" * frama-c {' '.join(_OPTIONS[:3])} {' '.join(_OPTIONS[3:5])}",
            f" *     {_OPTIONS[5]} -eva-split-return-function={name}:0,{name}_out:0",
            f" *     -machdep gcc_x86_64 {name}_eva.c",
            " */",
            f'#include "{name}.c"',
            "",
            *(f"volatile {kind} any_{kind};" for kind in kinds),
            "",
            "int main(void)",
            "{",
            *(f"    {line}" for line in lines),
            "}",
            "",
        ]
    )


def _assertions(output: Argument) -> list[str]:
    return [
        f"//@ assert {output.low} <= {output.signal.name}[{k}] <= {output.high};"
        for k in range(output.signal.size)
    ]


def judged_by_eva(name: str, folder: Path, model: str) -> tuple[Result, str]:
    """Run Eva on the harness of a kernel in a folder and return its result."""
    text = _run(name, folder, model)
    alarms = re.search(r"^  (\d+) alarms? generated", text, re.MULTILINE)
    asserted = re.search(r"^    Assertions +(\d+) valid +(\d+) unknown +(\d+) invalid", text, re.MULTILINE)
    if alarms is None or "user error" in text:
        return "fails", f"Eva did not end: {_last_line(text)}"
    valid, unknown, invalid = map(int, asserted.groups()) if asserted else (0, 0, 0)
    if not valid + unknown + invalid:
        return "fails", "Eva finds no way to the end of the function"
    if int(alarms[1]) or unknown or invalid:
        return (
            "fails",
            f"{alarms[1]} alarms and {unknown + invalid} ranges of outputs that intervals leave open",
        )
    return "proved", ""


def _run(name: str, folder: Path, model: str) -> str:
    machine = MODELS[model].frama_c
    split = f"-eva-split-return-function={name}:0,{name}_out:0"
    command = ["frama-c", *_OPTIONS, split, "-machdep", machine, f"{name}_eva.c"]
    environment = os.environ | {"PWD": str(folder.absolute())}
    try:
        done = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, timeout=_SECONDS
        )
    except subprocess.TimeoutExpired:
        return f"stopped after {_SECONDS} s"
    log = done.stdout + done.stderr
    (folder / f"{name}_eva_{machine}.log").write_text(log, encoding="utf-8", newline="\n")
    return log


def _last_line(text: str) -> str:
    lines = text.strip().splitlines()
    return lines[-1] if lines else "it printed nothing"
