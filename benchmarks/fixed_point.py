"""The fixed-point step against a step in double that is written out by hand, timed in one run; writes FIXED_POINT.md.

Rounds of all candidates are interleaved, so that a change of the machine's speed falls on all alike.
"""

from __future__ import annotations

import argparse
import ctypes
import math
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import strapgen
from compare import FLAGS, machine, run
from strapgen.ir.fixed_settings import Settings

HERE = Path(__file__).resolve().parent
STEPS, TIMED = 500, 20_000
#: Increments are below this.
LARGEST = Settings.of(max_rate_deg_s=12, step="0.125", increments=2).largest_angle
STAGED = "double, staged, written out"
#: Around a generated step, what the loop calls.
_ADAPTOR = """
typedef {word} word;

static inline int step(const word *e, const word *d, void *kept, word *next)
{{
    (void)kept;
    {call};
}}
"""


@dataclass
class Candidate:
    """A step, ready to be timed."""

    name: str
    call: Callable[[int], np.ndarray]
    seconds: list[float] = field(default_factory=list)
    final: np.ndarray | None = None

    @property
    def nanoseconds(self) -> float:
        """Median time of a step."""
        return statistics.median(self.seconds) / TIMED * 1e9


def compiled(folder: Path, text: str) -> ctypes.CDLL:
    """Compile a step and the loop around it."""
    folder.mkdir()
    (folder / "step.inc").write_text(text)
    command = ["gcc", "-std=c99", *FLAGS, "-w", "-shared", "-fPIC", '-DSTEP="step.inc"', f"-I{folder}"]
    run([*command, str(HERE / "fixed_point" / "harness.c"), "-o", str(folder / "step.so")])
    return ctypes.CDLL(str(folder / "step.so"))


def candidate(
    name: str, library: ctypes.CDLL, samples: np.ndarray, start: np.ndarray, kept: np.ndarray
) -> Candidate:
    """Return a candidate that runs chained steps of a library."""
    state = np.empty_like(start)
    fresh = kept.copy()

    def call(times: int) -> np.ndarray:
        kept[:] = fresh
        pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in (samples, start, kept, state)]
        if library.chained(ctypes.c_size_t(times), ctypes.c_size_t(STEPS), *pointers):
            raise RuntimeError(f"{name} refused its input")
        return state

    return Candidate(name, call)


def candidates(folder: Path) -> list[Candidate]:
    """Generate and compile everything that is compared."""
    increments = np.random.default_rng(1969).uniform(-0.013, 0.013, size=(STEPS, 6))
    start = np.array([0.0, 0.0, 0.0, 1.0])
    none = np.zeros(1)
    made = [
        candidate(
            STAGED,
            compiled(folder / "staged", (HERE / "fixed_point/staged.inc").read_text()),
            increments,
            start,
            none,
        )
    ]
    program = strapgen.lower(strapgen.derive("euler", "rk4", 2))
    sources = strapgen.generate(program, "c")
    (folder / "double").mkdir()
    text = "\n".join(sources.step_files.values()).replace(f'#include "{sources.function.name}.h"', "")
    text += _ADAPTOR.format(word="double", call=f"{sources.function.name}(e, d, next);\n    return 0")
    made.append(candidate("double, strapgen", compiled(folder / "plain", text), increments, start, none))
    for word in (32, 16):
        for carry in ("none", "state", "full"):
            fixed = strapgen.quantize(program, Settings(word, LARGEST, carry=carry))
            sources = strapgen.generate(fixed, "c-fixed")
            text = "\n".join(sources.step_files.values()).replace(f'#include "{sources.function.name}.h"', "")
            kept = f"(uint{word}_t *)kept, " if carry != "none" else ""
            text += _ADAPTOR.format(
                word=f"int{word}_t", call=f"return {sources.function.name}(e, d, {kept}next)"
            )
            given, held = fixed.interface.inputs[1], fixed.interface.inputs[0]
            integers = np.rint(np.ldexp(increments, given.format.fraction)).astype(f"int{word}")
            first = np.rint(np.ldexp(start, held.format.fraction)).astype(f"int{word}")
            fresh = np.array([residual.fresh for residual in fixed.interface.residuals] or [0], f"uint{word}")
            library = compiled(folder / f"q{word}{carry}", text)
            kept_words = {"none": "no residuals", "state": "residuals of the state", "full": "all residuals"}[
                carry
            ]
            made.append(candidate(f"{word} bits, {kept_words}", library, integers, first, fresh))
            made[-1].final = np.ldexp(made[-1].call(1).astype(float), -held.format.fraction)
    return made


def check(made: list[Candidate]) -> None:
    """Compare where the candidates lead: rounding of increments and arithmetic alone may part them."""
    wanted = made[0].call(1).copy()
    for other in made[1:]:
        final = other.call(1).copy() if other.final is None else other.final
        bits = 50 if other.final is None else int(other.name.split()[0])
        # Some units of the last place a step.
        allowed = 4 * STEPS * math.ldexp(1, 2 - bits)
        assert np.abs(final - wanted).max() <= allowed, other.name


def report(made: list[Candidate], rounds: int) -> str:
    """Return the report as Markdown."""
    staged = made[0]
    lines = [
        "# The fixed-point step",
        "",
        "Written by `make bench`. The fourth-order step of Euler parameters on two increments, each step on the",
        f"result of the one before; medians of {rounds} interleaved rounds. The ratio is the median of the ratios",
        "round by round. All of fixed point checks its input's range in every step.",
        "",
        "| step | ns | ratio to the staged one |",
        "|---|--:|--:|",
    ]
    for one in made:
        ratio = statistics.median(a / b for a, b in zip(one.seconds, staged.seconds, strict=True))
        lines.append(f"| {one.name} | {one.nanoseconds:.1f} | {ratio:.2f} |")
    compiler = run(["gcc", "--version"]).stdout.splitlines()[0]
    return "\n".join([*lines, "", f"{compiler}; {' '.join(FLAGS)}; {machine()}", ""])


def main() -> None:
    """Measure and write FIXED_POINT.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=301)
    parser.add_argument("--out", type=Path, default=HERE / "FIXED_POINT.md")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        made = candidates(Path(folder))
        check(made)
        for number in range(options.rounds + 1):
            for one in made:
                start = time.perf_counter()
                one.call(TIMED // STEPS)
                if number:  # the first round warms up
                    one.seconds.append(time.perf_counter() - start)
        print(file=sys.stderr)
    text = report(made, options.rounds)
    print(text)
    options.out.write_text(text)


if __name__ == "__main__":
    main()
