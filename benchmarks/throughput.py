"""Throughput of ``euler rk4`` on two increments in double: ratios that hold on any machine, and their limits.

C is compiled as strapgen compiles it, for the baseline of the processor's family. Rounds of all candidates are
interleaved; the least time of each counts, since others on the machine only ever add to it. Each ratio is of times
from the same run, and of processor time where one thread does the work.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import re
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

import strapgen
from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.run import compiler
from strapgen.run.evaluators import Loop

#: Runs side by side, and the steps of each.
RUNS, STEPS = 10_000, 20


def least(candidates: dict, rounds: int, clock=time.perf_counter) -> dict[str, float]:
    """Return the least seconds of each candidate over interleaved rounds."""
    times = dict.fromkeys(candidates, float("inf"))
    for _ in range(rounds):
        for name, function in candidates.items():
            start = clock()
            function()
            times[name] = min(times[name], clock() - start)
    return times


def built(folder: Path, narrow: bool) -> ctypes.CDLL:
    """Return the loops and the chain, compiled into one library; narrow ones take no instructions beyond SSE2."""
    sources = pipeline.compile(choose("euler"), "c")
    for name, text in sources.files.items():
        chosen = re.sub(r"__builtin_cpu_supports\(.*?\)", "0", text) if narrow else text
        (folder / name).write_text(chosen)
    code = Path(__file__).with_name("throughput.c")
    library = folder / "throughput.so"
    options = [*compiler.C_FLAGS, "-shared", "-fPIC", f"-I{folder}", str(code), "-o", str(library), "-lm"]
    subprocess.run([*compiler.C.command(), *options], check=True)
    return ctypes.CDLL(str(library))


class Loops:
    """Calls of the compiled loops on fixed memory."""

    def __init__(self, library: ctypes.CDLL, increments: np.ndarray) -> None:
        self._library, self._increments = library, increments
        self._transitions = np.ascontiguousarray(
            strapgen.backend("euler", backend="c").step([0.0, 0.0, 0.0, 1.0], increments)
        )
        self._state = np.array([0.0, 0.0, 0.0, 1.0])
        self._initial = np.tile(self._state, (len(increments), 1))
        self._history = np.zeros((len(increments) + RUNS, 4))

    def chain(self) -> None:
        """Multiply the transitions one after the other."""
        self._state[:] = 0.0, 0.0, 0.0, 1.0
        self._library.chain(
            ctypes.c_size_t(len(self._transitions)),
            self._pointer(self._transitions),
            self._pointer(self._state),
        )

    def batch(self, function: str) -> None:
        """Take one step of many states by one of the functions on arrays of samples, whose order is their own."""
        self._library["euler_rk4_2_" + function](
            ctypes.c_size_t(RUNS), *map(self._pointer, (self._initial, self._increments, self._history))
        )

    def propagate(self, runs: int, record_every: int) -> None:
        """Propagate all increments as so many runs."""
        counts = (runs, len(self._increments) // runs, record_every, 0)
        arrays = (self._initial, self._increments, self._history)
        status = self._library.euler_rk4_2_propagate(
            *map(ctypes.c_size_t, counts), None, *map(self._pointer, arrays)
        )
        if status:
            raise RuntimeError(f"the generated loop refused its arguments with status {status}")

    @staticmethod
    def _pointer(array: np.ndarray) -> ctypes.c_void_p:
        return ctypes.c_void_p(array.ctypes.data)


def show(what: str, ratio: float, limit: float | None = None) -> None:
    """Print a ratio beside its limit."""
    print(f"{what:<78}{ratio:>8.2f}" + ("" if limit is None else f"   at most {limit:g}"))


def loops(rounds: int, narrow: bool = False) -> None:
    """Print the ratios of loops in C."""
    increments = np.random.default_rng(1).normal(scale=0.002, size=(RUNS * STEPS, 2, 3))
    with tempfile.TemporaryDirectory() as folder:
        calls = Loops(built(Path(folder), narrow), increments)
        times = least(
            {
                "chain": calls.chain,
                "history": lambda: calls.propagate(1, 1),
                "single": lambda: calls.propagate(1, len(increments)),
                "many": lambda: calls.propagate(RUNS, STEPS),
                "batch": lambda: calls.batch("batch"),
                "array": lambda: calls.batch("array"),
            },
            rounds,
        )
    print("with SSE2 alone:" if narrow else "with all that the processor has:")
    steps = dict.fromkeys(times, len(increments)) | dict.fromkeys(("batch", "array"), RUNS)
    print(f"ns a step: {', '.join(f'{name} {t / steps[name] * 1e9:.2f}' for name, t in times.items())}")
    show(
        "a single run with history / the bare chain of quaternion products",
        times["history"] / times["chain"],
        None if narrow else 1.35,
    )
    show(
        f"one of {RUNS} runs without history / a single run, on one core",
        times["many"] / times["single"],
        None if narrow else 0.55,
    )
    show(f"one step of {RUNS} states by element / by state", times["batch"] / times["array"])


def series(rounds: int) -> None:
    """Print what series take beside the closed form, in a step by combined coning coefficients."""
    choice = choose("euler", "coning-combined", 3, previous=3)
    increments = np.random.default_rng(1).uniform(-0.02, 0.02, (RUNS, 6, 3))
    settings = strapgen.Settings.of(max_rate_deg_s=400, step="0.01")
    made = {
        name: strapgen.backend(choice, backend="c", settings=each)
        for name, each in (("closed", None), ("series", settings))
    }
    calls = {f"{name}, one": one.prepared(increments) for name, one in made.items()}
    rows = increments.reshape(-1, STEPS, 18)
    loop = Loop(
        np.tile(made["closed"].identity, (len(rows), 1)), np.empty((len(rows), 0)), record_every=STEPS
    )
    calls |= {f"{name}, many": lambda one=one: one.evaluator.loop(rows, loop) for name, one in made.items()}
    times = least(calls, rounds, time.process_time)
    print(f"ns a step: {', '.join(f'{name} {t / len(increments) * 1e9:.1f}' for name, t in times.items())}")
    for runs, what in (("one", "a single run"), ("many", "many runs")):
        ratio = times[f"series, {runs}"] / times[f"closed, {runs}"]
        show(f"series / closed form, coning-combined 3+3, {what}", ratio, 0.25)


def back_ends(rounds: int) -> None:
    """Print the ratios of back ends as Python calls them, checks of the inputs included."""
    c, numpy = (strapgen.backend("euler", backend=name) for name in ("c", "numpy"))
    scan = strapgen.backend("euler", backend="c", order="scan")
    increments = np.random.default_rng(1).normal(scale=0.002, size=(RUNS * STEPS * 5, 2, 3))
    states = c.step(c.identity, increments)
    many = increments.reshape(RUNS, -1, 2, 3)
    jobs, steps = os.cpu_count() or 1, len(increments)
    memory, copy = np.zeros((1 + steps, *c.state_shape)), np.zeros_like(increments)
    times = least(
        {
            # numpy copies so much memory by streaming stores.
            "copy": lambda: np.copyto(copy, increments),
            "history": lambda: c.propagate(increments, out=memory),
            "history, scan": lambda: scan.propagate(increments, out=memory),
            "last state": lambda: c.propagate(increments, steps),
            "last state, scan": lambda: scan.propagate(increments, steps),
            "many": lambda: c.propagate(many, many.shape[1]),
            "c": lambda: c.propagate(increments),
            "numpy": lambda: numpy.propagate(increments),
            "c, steps": lambda: c.step(states, increments),
            "numpy, steps": lambda: numpy.step(states, increments),
        },
        rounds,
        time.process_time,
    )
    print("as Python calls them:")
    run = f"a single run of {steps} steps"
    show(f"{run} with history / a copy of its increments", times["history"] / times["copy"], 1.7)
    show(f"{run} with history, scan / the same copy", times["history, scan"] / times["copy"], 1.7)
    show("scan / sequential, with history", times["history, scan"] / times["history"])
    show("scan / sequential, last state alone", times["last state, scan"] / times["last state"])
    show(f"one of {RUNS} runs / a single run, last states alone", times["many"] / times["last state"])
    show("numpy / C, single steps of many states", times["numpy, steps"] / times["c, steps"], 5)
    show("numpy / C, one run with history", times["numpy"] / times["c"], 5)
    times = least(
        {
            "one": lambda: c.propagate(many, many.shape[1]),
            "all": lambda: c.propagate(many, many.shape[1], jobs=jobs),
        },
        rounds,
    )
    show(f"{jobs} threads / one, {RUNS} runs, elapsed time", times["all"] / times["one"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=40)
    options = parser.parse_args()
    for narrow in (False, True):
        loops(5 * options.rounds, narrow)
    series(options.rounds)
    back_ends(max(1, options.rounds // 4))


if __name__ == "__main__":
    main()
