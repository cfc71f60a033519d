"""Throughput of the back ends and whole-process times of the command line, printed as a table.

Rounds of all candidates are interleaved, so that a change of the machine's speed falls on all alike. A run has the
least processor time of its rounds, a whole process the median of the time that passes.
"""

from __future__ import annotations

import argparse
import platform
import statistics
import subprocess
import sys
import time

import numpy as np

import strapgen
from strapgen.catalogue import ALGORITHMS
from strapgen.run.backends import BACKENDS, DEFAULT_BACKENDS
from throughput import least

#: Interpreters of single operations in Python are references and too slow for runs of this length.
TIMED = DEFAULT_BACKENDS
COMMANDS = {
    "strapgen --help": ["--help"],
    "strapgen tables --backend c": ["tables", "--backend", "c"],
    "strapgen tables --backend numpy": ["tables", "--backend", "numpy"],
    "strapgen tables --backend c-fixed32": ["tables", "--backend", "c-fixed32"],
    "strapgen generate --all --check": ["generate", "--all", "--check"],
}


def timed(function) -> float:
    """Return the seconds that a call takes."""
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def interleaved(candidates: dict, rounds: int) -> dict[str, float]:
    """Return the median seconds of each candidate over interleaved rounds, after one that does not count."""
    times: dict[str, list[float]] = {name: [] for name in candidates}
    for k in range(rounds + 1):
        for name, function in candidates.items():
            seconds = timed(function)
            if k:
                times[name].append(seconds)
    return {name: statistics.median(values) for name, values in times.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=1_000_000, help="steps of the run, two increments each")
    parser.add_argument("--rounds", type=int, default=11)
    options = parser.parse_args()

    print(f"{platform.platform()}, Python {platform.python_version()}, numpy {np.__version__}")
    increments = np.random.default_rng(1).normal(scale=0.002, size=(options.steps, 2, 3))
    print(
        f"\npropagation of one run of {options.steps} steps with full history, RK4 on two increments, processor time"
    )
    print(f"{'':<14}" + "".join(f"{name + ', ns/step':>20}" for name in TIMED) + f"{'numpy/c':>10}")
    for algorithm in ALGORITHMS:
        largest = float(np.abs(increments).max())
        settings = {
            # Residuals keep a long run without orthonormalization inside its range.
            name: strapgen.Settings(carry="full").fitted(largest) if BACKENDS[name].fixed else None
            for name in TIMED
        }
        backends = {
            name: strapgen.backend(algorithm, backend=name, settings=settings[name]) for name in TIMED
        }
        candidates = {name: b.prepared(increments) for name, b in backends.items()}
        times = least(candidates, options.rounds, time.process_time)
        cells = "".join(f"{times[name] / options.steps * 1e9:>20.1f}" for name in TIMED)
        print(f"{algorithm:<14}{cells}{times['numpy'] / times['c']:>10.1f}")

    print(f"\nwhole process, seconds, median of {options.rounds} interleaved rounds, everything built before")
    program = [sys.executable, "-m", "strapgen"]
    commands = {
        name: lambda words=words: subprocess.run([*program, *words], check=True, stdout=subprocess.DEVNULL)
        for name, words in COMMANDS.items()
    }
    for name, seconds in interleaved(commands, options.rounds).items():
        print(f"{name:<34}{seconds:>8.2f}")


if __name__ == "__main__":
    main()
