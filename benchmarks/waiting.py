"""What a user waits for: a step called from Python, and commands with a cache that is filled or empty.

All is processor time, of a command with the processes that it starts. An earlier version, which Git has, takes turns
with this one; the least time of each counts, since others on the machine only ever add to it.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
#: The version before steps took one sample where it lies, and commands imported less.
BEFORE = "85523899"
#: Back ends whose step is called, each with the most microseconds that it may take.
STEPS = {"c": 3.0, "c-float": 3.0, "c-fixed32": 10.0, "numpy": None}
#: Prints the microseconds of a step that Python calls on arrays of the back end's own type.
STEP = """
import sys, time
import numpy as np
import strapgen
for name in sys.argv[1:]:
    made = strapgen.backend("euler", "rk4", 2, backend=name)
    state, samples = np.array(made.identity), np.full((2, 3), 1e-3, made.dtype)
    best = float("inf")
    for _ in range(9):
        begin = time.process_time()
        for _ in range(5000):
            made.step(state, samples)
        best = min(best, time.process_time() - begin)
    print(best / 5000 * 1e6)
"""
_WINDOW = ("window", "design", "--previous", "7", "--ahead", "7", "--band", "1.3", "--out", "{}/window.toml")


class Waiting(NamedTuple):
    """A command, whether its cache is empty, and the most seconds that it may take."""

    words: tuple[str, ...]
    cold: bool = False
    most: float | None = None


COMMANDS = {
    "strapgen --help": Waiting(("--help",), most=0.15),
    "generate, from the cache": Waiting(
        ("generate", "euler", "--method", "rk4", "--target", "c", "--force", "--out", "{}")
    ),
    "window design, from the cache": Waiting(_WINDOW),
    "window design, cold": Waiting(_WINDOW, cold=True),
    "design of a whole catalogue, cold": Waiting(
        ("design", str(ROOT / "examples/briefs/ahrs.toml")), cold=True, most=15
    ),
    "report euler, cold": Waiting(("report", "euler", "--out", "{}/report.html"), cold=True, most=15),
}


class Version(NamedTuple):
    """A version of strapgen: the folder of its code, and one for a cache and for output."""

    code: Path
    work: Path

    def run(self, words: tuple[str, ...], cache: str = "filled") -> tuple[float, str]:
        """Run Python with some words; return the processor time in s, and what it printed."""
        environment = os.environ | {
            "PYTHONPATH": str(self.code),
            "STRAPGEN_CACHE_DIR": str(self.work / cache),
        }
        environment.pop("PYTHONDONTWRITEBYTECODE", None)
        command = [sys.executable, *(word.format(self.work) for word in words)]
        with tempfile.TemporaryFile("w+") as said:
            process = subprocess.Popen(
                command, env=environment, cwd=self.work, stdout=said, stderr=subprocess.DEVNULL
            )
            _, status, used = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            if process.returncode:
                raise RuntimeError(f"{' '.join(command)} ends with status {process.returncode}")
            said.seek(0)
            return used.ru_utime + used.ru_stime, said.read()


def show(what: str, times: Mapping[str, float], unit: str, most: float | None) -> None:
    """Print the figures of both versions, their ratio and the limit."""
    before = times.get("before")
    cells = "" if before is None else f"{before:>9.3g} {unit} before, ratio {times['now'] / before:.2f}"
    limit = "" if most is None else f"   at most {most:g}"
    print(f"{what:<40}{times['now']:>9.3g} {unit}{cells}{limit}", flush=True)


def steps(versions: Mapping[str, Version]) -> None:
    """Print what a step takes that is called from Python."""
    found = {name: version.run(("-c", STEP, *STEPS))[1].split() for name, version in versions.items()}
    for place, (name, most) in enumerate(STEPS.items()):
        show(f"Backend.step, {name}", {of: float(each[place]) for of, each in found.items()}, "us", most)


def commands(versions: Mapping[str, Version], rounds: int, cold: bool) -> None:
    """Print what commands take, those that derive much only where `cold` says so, once each."""
    known: dict[str, dict[str, float]] = {}
    for what, one in COMMANDS.items():
        if one.cold and not cold:
            continue
        times = known[what] = dict.fromkeys(versions, float("inf"))
        for turn in range(1 if one.cold else rounds + 1):
            for name, version in versions.items():
                cache = f"cold {what}" if one.cold else "filled"
                seconds, _ = version.run(("-m", "strapgen", *one.words), cache)
                if turn or one.cold:  # the first turn fills the cache
                    times[name] = min(times[name], seconds)
        show(what, times, "s", one.most)
        if what.startswith("generate"):
            beyond = {name: times[name] - known["strapgen --help"][name] for name in versions}
            show("  the same less strapgen --help", beyond, "s", 0.15)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--before", default=BEFORE, help="earlier version to compare with; empty for none")
    parser.add_argument("--warm", action="store_true", help="leave out what derives much with an empty cache")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        versions: dict[str, Version] = {}
        earlier = Path(folder, "before")
        archive = subprocess.run(
            ["git", "archive", options.before or "-", "codegen", "templates", "generated"],
            cwd=ROOT,
            capture_output=True,
            check=False,
        )
        if options.before and archive.returncode == 0:
            earlier.mkdir()
            subprocess.run(["tar", "x", "-C", str(earlier)], input=archive.stdout, check=True)
            versions["before"] = Version(earlier / "codegen", Path(folder, "of-before"))
        elif options.before:
            print(f"without {options.before}, which Git does not have here")
        versions["now"] = Version(ROOT / "codegen", Path(folder, "of-now"))
        for version in versions.values():
            version.work.mkdir()
            version.run(("-m", "compileall", "-q", str(version.code)))
        steps(versions)
        commands(versions, options.rounds, not options.warm)


if __name__ == "__main__":
    main()
