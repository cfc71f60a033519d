"""Shows that the tests protect the code: puts faults into copies of the checkout, one at a time, and runs the tests.

Three lists of faults. The first is written down in tests/data/mutants.toml, and the tests have to notice all of it.
The others are drawn at random: 40 from everything that computes, of which they have to notice 36, and 200 from the way
from programs to text and to fixed point, of which they have to notice 180. A fault of the last list meets the
comparison of `generated/`; each meets the test that noticed it last, the nearest tests that execute its line, the files
of all that do, and then all tests; the first failure ends it.
Outcomes are kept in `.mutants/`, under a hash of the sources and tests, so that a run that was stopped goes on where it
was. Drawn faults that no test can notice, or none does, stand with a reason in tests/data/unnoticed.toml. Exit status 1
says that too many faults passed, or that the time did not do.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import tomllib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import NamedTuple

import mutation_operators
from coverage import CoverageData
from mutation_operators import Site

ROOT = Path(__file__).resolve().parents[1]
SEEDED = Path(__file__).parent / "data" / "mutants.toml"
#: Drawn faults that no test notices, each with the reason.
UNNOTICED = Path(__file__).parent / "data" / "unnoticed.toml"
#: The seed of the draws.
SEED = 1969
#: Seconds and bytes of memory after which a session is stopped: such a fault is noticed too, unless all tests take so
#: long.
HANGS_S, MEMORY = 1800, 6 << 30
#: Test functions of the first session of a fault.
FIRST = 40
#: The command of `make check` that compares `generated/` with what the sources give.
COMPARISON = "strapgen generate --all --check"
#: Seconds after which it is stopped; it takes six on an idle machine.
COMPARISON_HANGS_S = 240
#: Tests that compare the lists of faults with the sources: they fail under every fault, and are left out.
ABOUT_FAULTS = "tests/test_mutants.py"
#: What the cache has of compiled modules, each under a hash of all that goes into it: no fault changes its meaning.
_COMPILED = ("builds", "shared")


class Draw(NamedTuple):
    """The folders that faults are drawn from, how many are drawn, and how many of them the tests have to notice."""

    folders: tuple[str, ...]
    count: int
    least: int


DRAWS = {
    "random": Draw((*mutation_operators.FOLDERS, "templates"), 40, 36),
    "lowering": Draw(("fixedpoint", "lowering", "targets"), 200, 180),
}
PARTS = ("seeded", *DRAWS)


class Fault(NamedTuple):
    """A fault, the list that it is on, and its line before and after."""

    part: str
    site: Site
    line: int
    before: str
    after: str

    @classmethod
    def of(cls, part: str, site: Site) -> Fault:
        source = (ROOT / site.file).read_text()
        changed, start = site.applied(source), source.rfind("\n", 0, site.start) + 1
        ends = source.find("\n", site.end), changed.find("\n", site.start + len(site.text))
        before, after = source[start : ends[0]], changed[start : ends[1]]
        return cls(part, site, site.line(source), " ".join(before.split()), " ".join(after.split()))

    @property
    def key(self) -> str:
        """The fault as a text."""
        return f"{self.site.file}:{self.line} {self.before} -> {self.after}"

    @property
    def lasting_key(self) -> str:
        """The fault as a text that no change elsewhere in the file alters."""
        return f"{self.site.file} {self.before} -> {self.after}"


def seeded() -> list[tuple[Site, str]]:
    """Return the faults that are written down, each with what it breaks."""
    faults = []
    for entry in tomllib.loads(SEEDED.read_text())["fault"]:
        source = (ROOT / entry["file"]).read_text()
        if source.count(entry["text"]) != 1:
            raise SystemExit(f"{entry['file']} has {source.count(entry['text'])} times: {entry['text']}")
        start = source.index(entry["text"])
        site = Site(entry["file"], start, start + len(entry["text"]), entry["instead"], entry["kind"])
        faults.append((site, entry["breaks"]))
    return faults


def reasons() -> dict[str, str]:
    """Return why no test notices a fault, by its lasting key."""
    return {
        f"{entry['file']} {entry['before']} -> {entry['after']}": entry["reason"]
        for entry in tomllib.loads(UNNOTICED.read_text())["fault"]
    }


def faults(part: str, seed: int) -> list[Fault]:
    """Return the faults of a list, one of PARTS."""
    if part == "seeded":
        return [Fault.of(part, site) for site, _ in seeded()]
    draw = DRAWS[part]
    by_folder = mutation_operators.sites(ROOT, texts=part == "lowering")
    chosen = {folder: by_folder[folder] for folder in draw.folders}
    return [Fault.of(part, site) for site in mutation_operators.drawn(chosen, ROOT, draw.count, seed)]


# The tests of a fault


def executing(executed: CoverageData, file: str, line: int) -> list[str]:
    """Return the test functions that execute a line, those named after the file first, then those of its folder.

    What runs when a module is imported, or stands in a table, counts as executed by all tests that use the module or
    read the table; a template is executed by those that use its twin among the targets.
    """
    path = Path(file)
    subject, folder = path.stem, path.parts[2] if path.parts[0] == "codegen" else "targets"
    if path.parts[0] == "templates":
        subject = path.parts[1]
        file, line = filling(subject), 0
    elif path.suffix != ".py":
        file, line = "codegen/strapgen/catalogue/methods/tableaux.py", 0
    by_line = executed.contexts_by_lineno(file)
    contexts = {*by_line.get(line, ())} - {""} or {context for some in by_line.values() for context in some}
    functions = {context.partition("|")[0].partition("[")[0] for context in contexts} - {""}
    return sorted(
        functions, key=lambda test: (subject not in test, not test.startswith(f"tests/{folder}/"), test)
    )


@cache
def filling(folder: str) -> str:
    """Return the module that fills the templates of a folder: a target of its name, or the first that names it."""
    target = f"codegen/strapgen/targets/{folder}.py"
    modules = [file for file in _files() if file.startswith("codegen/") and file.endswith(".py")]
    named = (file for file in modules if re.search(rf"[\"'/]{folder}[\"'/]", (ROOT / file).read_text()))
    return target if target in modules else next(named)


# The runs


class Runner:
    """Runs sessions of pytest in copies of the checkout, up to a moment of the monotonic clock."""

    def __init__(self, state: Path, paths: Sequence[str], end: float) -> None:
        self.state, self.paths, self.end = state, list(paths), end
        self.folder = Path(tempfile.mkdtemp(prefix="strapgen-mutants-"))
        self._running: set[int] = set()

    def stop(self) -> None:
        """End all sessions."""
        self.end = 0
        for process in [*self._running]:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process, signal.SIGKILL)

    def copy(self, name: str) -> Path:
        """Return a new copy of the checkout."""
        for file in _files():
            (self.folder / name / file).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / file, self.folder / name / file)
        return self.folder / name

    def session(self, place: Path, *words: str) -> tuple[str, str]:
        """Return "passed", "failed" or "stopped", and the test of a session of pytest that failed."""
        return self.run(place, command(words), HANGS_S)

    def run(self, place: Path, command: Sequence[str], hangs_s: float) -> tuple[str, str]:
        """Run a command in a copy with a cache of its own but for compiled modules."""
        import resource  # of POSIX systems alone

        limit = min(self.end - time.monotonic(), hangs_s)
        with tempfile.TemporaryDirectory(prefix="cache-", dir=self.folder) as folder:
            for kind in _COMPILED:
                (self.state.parent / kind).mkdir(parents=True, exist_ok=True)
                (Path(folder) / kind).symlink_to(self.state.parent / kind)
            paths = {"PYTHONPATH": f"{place}/codegen:{place}/tests", "STRAPGEN_CACHE_DIR": folder}
            process = subprocess.Popen(
                command,
                cwd=place,
                env=os.environ | paths | {"COVERAGE_FILE": str(self.state / "coverage")},
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                start_new_session=True,
                preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY)),
            )
            self._running.add(process.pid)
            try:
                said, _ = process.communicate(timeout=max(limit, 0))
            except subprocess.TimeoutExpired:
                return ("stopped", "") if time.monotonic() > self.end else ("failed", f"{hangs_s} s")
            finally:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
                self._running.discard(process.pid)
        if time.monotonic() > self.end:
            return "stopped", ""
        return verdict(process.returncode, said)

    def outcome(self, place: Path, fault: Fault, executed: CoverageData, before: str) -> tuple[str, str]:
        """Return "caught", "survived" or "open" for a fault that a copy has, and the test that noticed it."""
        if fault.part == "lowering":
            result, _ = self.run(place, [sys.executable, "-m", *COMPARISON.split()], COMPARISON_HANGS_S)
            if result != "passed":
                return ("open", "") if result == "stopped" else ("caught", COMPARISON)
        tests = [test for test in executing(executed, fault.site.file, fault.line) if test != before]
        sessions = [
            [before] if (place / before.partition("::")[0]).is_file() else [],
            tests[:FIRST],
            list(dict.fromkeys(test.partition("::")[0] for test in tests)),
        ]
        for words in [*filter(None, sessions), self.paths]:
            result, by = self.session(place, "-x", *words)
            if result == "stopped" or (words is self.paths and by == f"{HANGS_S} s"):
                return "open", ""
            if result != "passed":
                return "caught", by
        return "survived", ""


def command(words: Sequence[str]) -> list[str]:
    """Return the command of a session of pytest."""
    options = ["-q", "-m", "not long", "-p", "no:cacheprovider", f"--ignore={ABOUT_FAULTS}"]
    return [sys.executable, "-m", "pytest", *options, *words]


def verdict(status: int, said: str) -> tuple[str, str]:
    """Return what a session that ended says of a fault: no test, or none that still exists, is no notice."""
    if status in (0, 5) or (status == 4 and "ERROR: not found" in said):
        return "passed", ""
    failed = re.search(r"^(?:FAILED|ERROR) (.*?)(?: - .*)?$", said, re.MULTILINE)
    return "failed", failed[1] if failed else f"status {status}"


@cache
def _files() -> list[str]:
    """Return the files of the checkout, those that are not committed yet among them."""
    words = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(words, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return sorted(file for file in set(listed.split("\0")) if file and (ROOT / file).is_file())


def state_folder(paths: Sequence[str]) -> Path:
    """Return the folder for the outcomes of these sources and tests."""
    total = hashlib.sha256("\0".join(paths).encode())
    for file in _files():
        if file.startswith(("codegen", "templates", "tests", "generated", "pyproject.toml")):
            total.update(file.encode() + b"\0" + (ROOT / file).read_bytes())
    return ROOT / ".mutants" / total.hexdigest()[:16]


def coverage_of_tests(runner: Runner, workers: int) -> CoverageData:
    """Return what every test executes, from a run of all tests without a fault."""
    file = runner.state / "coverage"
    if not file.exists():
        print("running the tests without a fault, to see what they execute", flush=True)
        several = ["-n", str(workers), "--dist", "worksteal"] if workers > 1 else []
        what = ["--cov=strapgen", "--cov-context=test", "--cov-report="]
        result, by = runner.session(runner.copy("plain"), *several, *what, *runner.paths)
        if result != "passed":
            file.unlink(missing_ok=True)
            raise SystemExit(f"the tests do not pass without a fault: {by or 'no time is left'}")
    executed = CoverageData(str(file))
    executed.read()
    return executed


def read_lines(file: Path) -> list[dict[str, str]]:
    return [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []


def run_all(runner: Runner, listed: Sequence[Fault], workers: int) -> None:
    """Run the faults that are not known, as long as there is time, and write each outcome down at once."""
    executed = coverage_of_tests(runner, workers)
    noticed = {line["lasting_key"]: line["by"] for line in read_lines(runner.state.parent / "noticed.jsonl")}
    known = outcomes(runner.state)
    pending = [fault for fault in listed if fault.key not in known]
    free = [runner.copy(f"copy{k}") for k in range(workers)]
    lock, count = threading.Lock(), iter(range(10**6))

    def run(fault: Fault) -> None:
        if time.monotonic() > runner.end:
            return
        with lock:
            place = free.pop()
        path, begin = place / fault.site.file, time.monotonic()
        source = path.read_text()
        put(path, fault.site.applied(source), next(count))
        result, by = runner.outcome(place, fault, executed, noticed.get(fault.lasting_key, ""))
        put(path, source, next(count))
        line = {"key": fault.key, "lasting_key": fault.lasting_key, "outcome": result, "by": by}
        with lock:
            free.append(place)
            if result != "open":
                for file in (runner.state / "outcomes.jsonl", runner.state.parent / "noticed.jsonl"):
                    with file.open("a") as stream:
                        stream.write(json.dumps(line) + "\n")
                print(f"{result} {time.monotonic() - begin:.0f} s {fault.key} {by}", flush=True)

    with ThreadPoolExecutor(workers) as pool:
        try:
            list(pool.map(run, pending))
        except BaseException:  # an interrupt too
            runner.stop()
            raise


def put(path: Path, text: str, number: int) -> None:
    """Write a file at a time that no compiled module has: Python compares the second of the change and the length."""
    path.write_text(text)
    os.utime(path, (1_000_000_000 + 10 * number,) * 2)


# The outcome


def outcomes(state: Path) -> dict[str, tuple[str, str]]:
    """Return what is known by now: the outcome and the test, by the key of the fault."""
    return {line["key"]: (line["outcome"], line["by"]) for line in read_lines(state / "outcomes.jsonl")}


def summary(listed: Sequence[Fault], known: dict[str, tuple[str, str]]) -> tuple[list[str], bool]:
    """Return a line for each list, the faults that passed, and whether the requirement is met."""
    lines, met, told = [], True, reasons()
    for part in dict.fromkeys(fault.part for fault in listed):
        states = {f: known.get(f.key, ("open", ""))[0] for f in listed if f.part == part}
        caught = [*states.values()].count("caught")
        needed = DRAWS[part].least if part in DRAWS else len(states)
        met &= caught >= needed
        lines.append(f"{part}: {caught} of {len(states)} caught, {needed} needed")
        for fault, state in states.items():
            if state != "caught":
                lines.append(f"  {state}: {fault.key} {told.get(fault.lasting_key, '')}".rstrip())
    return lines, met


def main() -> int:
    """Run the faults and print what became of them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--part", choices=PARTS, action="append", help="one list only")
    parser.add_argument("--seed", type=int, default=SEED, help=f"of the random lists; {SEED} by default")
    parser.add_argument("--only", default="", help="faults alone whose text contains this")
    parser.add_argument("--tests", nargs="*", default=[], help="these tests alone; all by default")
    parser.add_argument("--minutes", type=float, default=30.0, help="stop after so long; a later run goes on")
    parser.add_argument("--workers", type=int, default=2, help="how many run at once")
    parser.add_argument("--restart", action="store_true", help="forget the outcomes of earlier runs")
    parser.add_argument("--list", action="store_true", help="print the faults and run nothing")
    options = parser.parse_args()
    listed = [
        fault
        for part in options.part or PARTS
        for fault in faults(part, options.seed)
        if options.only in fault.key
    ]
    print(f"{len(listed)} faults; the random ones are drawn with seed {options.seed}", flush=True)
    if options.list:
        print("\n".join(f"{f.part} {f.site.kind}: {f.key}" for f in listed))
        return 0
    state = state_folder(options.tests)
    state.mkdir(parents=True, exist_ok=True)
    if options.restart:
        (state / "outcomes.jsonl").unlink(missing_ok=True)
    runner = Runner(state, options.tests, time.monotonic() + 60 * options.minutes)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    try:
        run_all(runner, listed, options.workers)
    finally:
        shutil.rmtree(runner.folder, ignore_errors=True)
    lines, met = summary(listed, outcomes(state))
    print("\n".join(lines))
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
