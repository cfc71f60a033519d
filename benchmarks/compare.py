"""strapgen against general code generators: the same attitude step from each, counted and timed in one run.

Rounds of all generators are interleaved, so that a change of the machine's speed falls on all alike. Writes RESULTS.md.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import platform
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from generators import GENERATORS, Case

HERE = Path(__file__).resolve().parent
FLAGS = ["-O3", "-ffp-contract=off"]
COMPILERS = {"c": ["gcc", "-std=c99"], "c++": ["g++", "-std=c++14"]}
SIZES = {"euler": 4, "dcm": 9, "increments": 6, "rates": 9}
TITLES = {
    "euler-increments": "Euler parameters, two angle increments",
    "dcm-increments": "Direction cosines, two angle increments",
    "euler-rates": "Euler parameters, three rate vectors",
    "dcm-rates": "Direction cosines, three rate vectors",
}
#: Steps of a chain, runs side by side, and steps of a timed call, a multiple of both. None is a power of two: arrays
#: by element would meet in the same lines of the cache.
STEPS, RUNS, TIMED = 500, 250, 20_000
OURS = "strapgen"


@dataclass
class Contender:
    """One generator's code for one case, and what was measured on it."""

    name: str
    module: str
    case: Case
    folder: Path
    fault: str = ""
    version: str = ""
    counts: tuple[int, ...] = ()
    instructions: dict[str, int] = field(default_factory=dict)
    calls: dict[str, Callable[[], None]] = field(default_factory=dict)
    times: dict[str, list[float]] = field(default_factory=dict)
    results: dict[str, np.ndarray] = field(default_factory=dict)

    def add(self, what: str, seconds: float) -> None:
        """Keep a measured time."""
        self.times.setdefault(what, []).append(seconds)

    def median(self, what: str) -> float | None:
        """Return the median of a time, None if it was not measured."""
        return statistics.median(self.times[what]) if what in self.times else None


def run(command: list[str], **options: object) -> subprocess.CompletedProcess[str]:
    """Run a command; what it says on failure is in the exception."""
    done = subprocess.run(command, capture_output=True, text=True, **options)  # type: ignore[call-overload]
    if done.returncode:
        raise RuntimeError((done.stderr.strip().splitlines() or ["no message"])[-1])
    return done  # type: ignore[no-any-return]


def generate(contender: Contender) -> None:
    """Let a generator write its step, in a process of its own, and keep both times."""
    start = time.perf_counter()
    command = [
        sys.executable,
        "-m",
        "generators",
        contender.module,
        str(contender.case),
        str(contender.folder),
    ]
    told = json.loads(run(command, cwd=HERE).stdout)
    contender.add("process", time.perf_counter() - start)
    contender.add("derivation", told["seconds"])
    contender.version = told["version"]
    language = told["language"]
    if contender.calls:
        return
    state, samples = SIZES[contender.case.algorithm], SIZES[contender.case.samples]
    common = [f"-I{contender.folder}", f"-DSTATE={state}", f"-DSAMPLES={samples}", "-w"]
    library = contender.folder / "step.so"
    kind = ["-x", "c" if language == "c" else "c++"]
    run(
        [
            *COMPILERS[language],
            *FLAGS,
            *common,
            "-shared",
            "-fPIC",
            *kind,
            str(HERE / "harness.c"),
            "-o",
            str(library),
        ]
    )
    counter = contender.folder / "count"
    run(["g++", "-std=c++14", *common, str(HERE / "count.cpp"), "-o", str(counter)])
    contender.counts = tuple(map(int, run([str(counter)]).stdout.split()))
    contender.instructions = instructions(library)
    prepare(contender, library, state, samples)


def instructions(library: Path) -> dict[str, int]:
    """Count floating-point instructions of `one` and of what it calls, in the disassembly."""
    text = run(["objdump", "-d", "--no-show-raw-insn", str(library)]).stdout
    bodies = dict(re.findall(r"^[0-9a-f]+ <([^>]+)>:\n((?:.+\n)*)", text, flags=re.MULTILINE))
    counts = dict.fromkeys(("multiply", "add", "divide", "packed"), 0)
    pending, seen = ["one"], set()
    while pending:
        name = pending.pop()
        if name in seen or name not in bodies:
            continue
        seen.add(name)
        pending += re.findall(r"(?:call|jmp)\w*\s+[0-9a-f]+ <([^>+@]+)(?:@plt)?>", bodies[name])
        for kind, packed in re.findall(r"\tv?(mul|add|sub|div)([sp])d\b", bodies[name]):
            counts[{"mul": "multiply", "div": "divide"}.get(kind, "add")] += 1
            counts["packed"] += packed == "p"
    return counts


def prepare(contender: Contender, library: Path, state: int, samples: int) -> None:
    """Load a library and keep what is to be timed, each call TIMED steps."""
    loaded = ctypes.CDLL(str(library))
    rng = np.random.default_rng(1969)
    identity = np.eye(3).ravel() if state == 9 else np.array([0.0, 0.0, 0.0, 1.0])
    d = rng.normal(scale=0.01, size=(STEPS, samples))
    starts = identity + rng.normal(scale=0.01, size=(RUNS, state))
    by_element = [np.ascontiguousarray(array.T) for array in (d[:RUNS], starts)]
    ends = {"chained": np.empty(state), "independent": np.empty((RUNS, state))}
    plans = {"chained": (STEPS, d, identity), "independent": (RUNS, d, starts)}
    if contender.name == OURS:
        plans |= {"chained_loop": plans["chained"], "independent_loop": (RUNS, *by_element)}
        ends |= {"chained_loop": np.empty(state), "independent_loop": np.empty((state, RUNS))}

    def call(function: object, times: int, count: int, arrays: list[np.ndarray]) -> None:
        pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in arrays]
        function(ctypes.c_size_t(times), ctypes.c_size_t(count), *pointers)  # type: ignore[operator]

    for name, (count, *arrays) in plans.items():
        function, inputs = getattr(loaded, name), [*arrays, ends[name]]
        call(function, 1, count, inputs)
        contender.calls[name] = lambda f=function, c=count, a=inputs: call(f, TIMED // c, c, a)
    contender.results = ends


def check(contenders: list[Contender]) -> None:
    """Compare what the contenders of one case computed: they must differ by round-off alone."""
    expected = next(c.results for c in contenders if c.name == OURS)
    np.testing.assert_array_equal(expected["chained_loop"], expected["chained"])
    np.testing.assert_array_equal(expected["independent_loop"].T, expected["independent"])
    for contender in contenders:
        for name in ("chained", "independent"):
            result = contender.results[name]
            # A few units in the last place a step, of numbers up to 1.
            np.testing.assert_allclose(result, expected[name], rtol=0, atol=STEPS * 1e-15)


def measured(options: argparse.Namespace, folder: Path) -> dict[str, list[Contender]]:
    """Generate, check and time every case."""
    cases: dict[str, list[Contender]] = {}
    for title in options.cases:
        algorithm, samples = title.split("-")
        cases[title] = []
        for name in options.generators:
            module, forms = GENERATORS[name]
            for form in forms:
                case = Case(algorithm, samples, form)
                contender = Contender(name, module, case, folder / f"{module}-{case}")
                contender.folder.mkdir()
                cases[title].append(contender)
    everyone = [contender for contenders in cases.values() for contender in contenders]
    for number in range(options.process_rounds):
        for contender in everyone:
            if contender.fault:
                continue
            try:
                generate(contender)
            except RuntimeError as error:
                contender.fault = str(error)
        print(
            f"\rgenerating: round {number + 1} of {options.process_rounds}",
            end="",
            file=sys.stderr,
            flush=True,
        )
    for contenders in cases.values():
        check([c for c in contenders if not c.fault])
    for number in range(options.rounds + 1):
        for contender in everyone:
            for name, call in contender.calls.items():
                start = time.perf_counter()
                call()
                if number:  # the first round warms up
                    contender.add(name, (time.perf_counter() - start) / TIMED)
        print(f"\rtiming: round {number} of {options.rounds}        ", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return cases


def nanoseconds(seconds: float | None) -> str:
    """Return a time of a step as text."""
    return "" if seconds is None else f"{seconds * 1e9:.1f}"


def table(contenders: list[Contender]) -> list[str]:
    """Return the rows of one case."""
    rows = [
        "| generator, form | source: × | + | ÷ | − | code: × | + | ÷ | chained, ns | independent, ns "
        "| derivation, ms | process, s |",
        "|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|",
    ]
    for c in contenders:
        label = c.name if c.name in (OURS, "by hand") else f"{c.name}, {c.case.form}"
        if c.fault:
            rows.append(f"| {label} | not run: {c.fault} |" + " |" * 10)
            continue
        code = [f"{c.instructions[kind]}" for kind in ("multiply", "add", "divide")]
        derivation, process = c.median("derivation") or 0.0, c.median("process") or 0.0
        times = [nanoseconds(c.median("chained")), nanoseconds(c.median("independent"))]
        cells = [*map(str, c.counts), *code, *times, f"{derivation * 1e3:.0f}", f"{process:.2f}"]
        rows.append(f"| {label} | " + " | ".join(cells) + " |")
        if c.name == OURS:
            times = [nanoseconds(c.median("chained_loop")), nanoseconds(c.median("independent_loop"))]
            rows.append(f"| {label}, its own loops |" + " |" * 7 + f" {times[0]} | {times[1]} | | |")
    return rows


def verdict(contenders: list[Contender]) -> list[str]:
    """Return how strapgen stands against the fastest of the others: the median of the ratios round by round."""
    ours = next(c for c in contenders if c.name == OURS)
    lines = [
        "| strapgen's time / that of the fastest other generator | chained | its loop | independent | its batch |"
    ]
    lines.append("|---|--:|--:|--:|--:|")
    for form, words in (("staged", "given the same formulas"), ("transition", "given the transition form")):
        others = [
            c for c in contenders if c.name not in (OURS, "by hand") and c.case.form == form and not c.fault
        ]
        if not others:
            lines.append(f"| {words} | none could be run | | | |")
            continue
        cells, names = [], []
        for what in ("chained", "independent"):
            fastest = min(others, key=lambda c, what=what: c.median(what) or 0.0)
            names.append(fastest.name)
            for own in (what, f"{what}_loop"):
                pairs = zip(ours.times[own], fastest.times[what], strict=True)
                cells.append(f"{statistics.median(a / b for a, b in pairs):.2f}")
        named = names[0] if names[0] == names[1] else " and ".join(names)
        lines.append(f"| {words}: {named} | " + " | ".join(cells) + " |")
    return lines


def machine() -> str:
    """Return what the figures were measured on."""
    processor = platform.processor() or platform.machine()
    told = Path("/proc/cpuinfo")
    if told.exists():
        models = re.findall(r"^model name\s*: (.*)$", told.read_text(), flags=re.MULTILINE)
        processor = models[0] if models else processor
    return f"{processor}, {os.cpu_count()} processors, {platform.platform()}"


def report(cases: dict[str, list[Contender]], options: argparse.Namespace) -> str:
    """Return the whole report as Markdown."""
    versions = {c.name: c.version for contenders in cases.values() for c in contenders if c.version}
    faults = {c.name: c.fault for contenders in cases.values() for c in contenders if c.fault}
    compiler = run(["gcc", "--version"]).stdout.splitlines()[0]
    lines = [
        "# One fourth-order step, from every generator",
        "",
        "Written by `make bench`. The same classical fourth-order Runge-Kutta step, generated by strapgen and by",
        "general code generators, and written by hand. *Staged* is the textbook's form, slopes of the state;",
        "*transition* the step of the identity followed by one product: a derivation of strapgen's that already",
        "saves the others operations. All results were compared before anything was timed.",
        "",
        "- *source*: operations that the source carries out, counted by running it on numbers that count;",
        "  constants among themselves are left out.",
        "- *code*: floating-point instructions in the disassembly of one step; packed ones, and those of loops, once.",
        "- *chained*: one step after the other on the same state. *independent*: one step each of "
        f"{RUNS} states. Medians of {options.rounds} interleaved rounds, nanoseconds a step.",
        "- *derivation*: from symbols to source text, in a fresh process after its imports. *process*: the whole",
        f"  of it, start of Python and imports included. Medians of {options.process_rounds} interleaved rounds.",
        "",
    ]
    for title, contenders in cases.items():
        lines += [f"## {TITLES[title]}", "", *table(contenders), "", *verdict(contenders), ""]
    lines += [
        "## Versions and machine",
        "",
        *(f"- {name} {version}" for name, version in versions.items()),
        *(f"- {name}: could not be run ({fault})" for name, fault in faults.items()),
        f"- {compiler}; {' '.join(FLAGS)}; Python {platform.python_version()}, numpy {np.__version__}",
        f"- {machine()}",
        "",
    ]
    return "\n".join(lines)


def main() -> None:
    """Measure and write RESULTS.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=101, help="rounds of timing the steps")
    parser.add_argument("--process-rounds", type=int, default=31, help="rounds of generating")
    parser.add_argument(
        "--generators", nargs="*", choices=GENERATORS, default=list(GENERATORS), metavar="NAME"
    )
    parser.add_argument("--cases", nargs="*", choices=TITLES, default=list(TITLES), metavar="NAME")
    parser.add_argument("--out", type=Path, default=HERE / "RESULTS.md")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        text = report(measured(options, Path(folder)), options)
    print(text)
    options.out.write_text(text)


if __name__ == "__main__":
    main()
