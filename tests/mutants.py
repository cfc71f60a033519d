"""Shows that the tests protect the code: puts faults into copies of the checkout, one at a time, and runs the tests.

Three lists of faults. The first is written down in tests/data/mutants.toml, and the tests have to notice all of it.
The others are drawn at random: 40 from everything that computes, of which they have to notice 36, and 200 from the way
from programs to text and to fixed point, of which they have to notice 180. Every run begins with the tests that execute
the changed line and ends at the first that fails; only faults that these let pass meet all other tests, when all faults
have had their turn. Outcomes are kept in `.mutants/`, under a hash of the sources and tests, so that a run that was
stopped goes on where it was; a test that noticed a fault before is its first one in every later state of the sources.
Drawn faults that no test can notice, or none does, stand with a reason in tests/data/unnoticed.toml. Exit status 1 says
that too many faults passed, or that the time did not do.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import tomllib
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import execution_map
import mutation_operators
from mutation_operators import Site

ROOT = Path(__file__).resolve().parents[1]
SEEDED = Path(__file__).parent / "data" / "mutants.toml"
#: Drawn faults that no test notices, each with the reason.
UNNOTICED = Path(__file__).parent / "data" / "unnoticed.toml"
#: The seed of the draws.
SEED = 1969
#: A session that takes longer hangs, in s; one of all tests may take as many times what they take without a fault more.
HANGS_S, TIMES_LONGER = 240, 5
#: The first session of a fault: most tests, most files that are collected, and most seconds without the fault.
FIRST_TESTS, FIRST_FILES, FIRST_S = 150, 12, 15
#: The second session begins with the files whose tests execute most; it stays below the number of tests from which on
#: a library is compiled beforehand.
WIDE_FILES, SECOND_TESTS = 3, 900
#: Tests that compare the lists of faults with the sources: they fail under every fault, and are left out.
ABOUT_FAULTS = "tests/test_mutants.py"
#: Memory of a process in bytes at which a fault that allocates without end is stopped.
MEMORY = 6 << 30
#: What the cache has of compiled modules, each under a hash of all that goes into it: no fault changes its meaning.
_COMPILED = ("builds", "shared")
_HASHED = ("codegen", "templates", "tests", "generated", "pyproject.toml")


@dataclass(frozen=True)
class Fault:
    """A fault, the list that it is on, and its line before and after."""

    part: str
    site: Site
    line: int
    before: str
    after: str

    @property
    def key(self) -> str:
        """The fault as a text."""
        return f"{self.part} {self.site.file}:{self.line} {self.before} -> {self.after}"

    @property
    def lasting_key(self) -> str:
        """The fault as a text that no change elsewhere in the file alters."""
        return f"{self.site.file} {self.before} -> {self.after}"


@dataclass(frozen=True)
class Outcome:
    """What became of a fault: "caught", "survived", or "open" if not all tests ran; by which test; in how many s."""

    key: str
    outcome: str
    by: str
    seconds: float


# The faults


@dataclass(frozen=True)
class Draw:
    """The folders that faults are drawn from, how many are drawn, and how many of them the tests have to notice."""

    folders: tuple[str, ...]
    count: int
    least: int


DRAWS = {
    "random": Draw((*mutation_operators.FOLDERS, "templates"), 40, 36),
    "lowering": Draw(("fixedpoint", "lowering", "targets"), 200, 180),
}
PARTS = ("seeded", *DRAWS)


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
    """Return why no test notices a fault, by the fault as it is in `Fault.lasting_key`."""
    return {
        f"{entry['file']} {entry['before']} -> {entry['after']}": entry["reason"]
        for entry in tomllib.loads(UNNOTICED.read_text())["fault"]
    }


def faults(part: str, seed: int) -> list[Fault]:
    """Return the faults of a list, one of PARTS."""
    if part == "seeded":
        sites = [site for site, _ in seeded()]
    else:
        draw = DRAWS[part]
        by_folder = mutation_operators.sites(ROOT, texts=part == "lowering")
        by_folder = {folder: by_folder[folder] for folder in draw.folders}
        sites = mutation_operators.drawn(by_folder, ROOT, draw.count, seed)
    listed = []
    for site in sites:
        source = (ROOT / site.file).read_text()
        line, changed = site.line(source), site.applied(source)
        start = source.rfind("\n", 0, site.start) + 1
        end, changed_end = source.find("\n", site.end), changed.find("\n", site.start + len(site.text))
        before, after = (" ".join(t.split()) for t in (source[start:end], changed[start:changed_end]))
        listed.append(Fault(part, site, line, before, after))
    return listed


# The tests of a fault


@dataclass(frozen=True)
class MappedTest:
    """A test as the map knows it."""

    name: str
    seconds: float
    blocks: frozenset[int]

    @property
    def file(self) -> str:
        return self.name.partition("::")[0]

    @property
    def function(self) -> str:
        return self.name.partition("[")[0]


def executing_tests(
    file: str, line: int, source: str, tests: Sequence[MappedTest], numbers: dict[str, int]
) -> list[MappedTest]:
    """Return the tests that execute a line, those first that are likeliest to notice a fault in it.

    What runs when a module is imported, or stands in a table, counts as executed by all tests that use the module or
    read the table; a template is executed by those that use its twin among the targets.
    """
    path = Path(file)
    if path.suffix == ".py":
        base = numbers[file] * execution_map._LINES
        first = execution_map.block_of_line(source, line)
        block = None if first is None else base + first
    else:
        user = (
            f"codegen/strapgen/targets/{path.parts[1]}/emit.py"
            if path.parts[0] == "templates"
            else "codegen/strapgen/catalogue/methods/tableaux.py"
        )
        base, block = numbers[user] * execution_map._LINES, None
    last = base + execution_map._LINES
    executing = [
        test
        for test in tests
        if (block in test.blocks if block is not None else any(base < b < last for b in test.blocks))
    ]
    return sorted(executing, key=lambda test: (_distance(file, test), test.seconds > 1, len(test.blocks)))


def _distance(file: str, test: MappedTest) -> int:
    """Return how far a test stands from the mirror image of a file: 0 for its own tests, 1 for its folder, 2 beyond."""
    path = Path(file)
    if path.suffix == ".toml":
        return 0 if path.stem in test.name else 1 if test.name.startswith("tests/catalogue/methods") else 2
    place = (
        Path("tests", *path.parts[2:])
        if path.parts[0] == "codegen"
        else Path("tests/targets", path.parts[1], "x")
    )
    stem = place.parts[2] if path.parts[0] == "templates" else path.stem
    if test.file in (place.with_name(f"test_{stem}.py").as_posix(), f"tests/targets/test_{stem}.py", file):
        return 0
    return 1 if test.file.startswith(f"{place.parent.as_posix()}/") else 2


def first_of(tests: Iterable[MappedTest]) -> list[MappedTest]:
    """Return a short session: two cases of every function before the rest of them, in few files, for a short time."""
    counts: dict[str, int] = {}
    early, late = [], []
    for test in tests:
        counts[test.function] = counts.get(test.function, 0) + 1
        (early if counts[test.function] <= 2 else late).append(test)
    session: list[MappedTest] = []
    chosen_files: set[str] = set()
    seconds = 0.0
    for test in (*early, *late):
        if len(session) == FIRST_TESTS:
            break
        in_time = seconds + test.seconds <= FIRST_S
        if in_time and (test.file in chosen_files or len(chosen_files) < FIRST_FILES):
            chosen_files.add(test.file)
            session.append(test)
            seconds += test.seconds
    return session


def second_of(tests: Sequence[MappedTest]) -> list[MappedTest]:
    """Return a long session; it begins with the files whose tests execute most, since a change of much shows there."""
    widest = sorted(tests, key=lambda test: -len(test.blocks))
    wide_files = list(dict.fromkeys(test.file for test in widest))[:WIDE_FILES]
    wide = [test for file in wide_files for test in tests if test.file == file]
    return list(dict.fromkeys([*first_of(wide), *tests]))[:SECOND_TESTS]


# The runs


def command(words: Sequence[str]) -> list[str]:
    """Return the command of a session of pytest."""
    options = ["-q", "-m", "not long", "-p", "no:cacheprovider", f"--ignore={ABOUT_FAULTS}"]
    return [sys.executable, "-m", "pytest", *options, *words]


class Runner:
    """Runs sessions of pytest in copies of the checkout, up to a moment of the monotonic clock; `stop` ends all."""

    def __init__(self, state: Path, paths: Sequence[str], end: float) -> None:
        self.state, self.paths, self.end = state, list(paths), end
        self.folder = Path(tempfile.mkdtemp(prefix="strapgen-mutants-"))
        self._processes: set[subprocess.Popen[bytes]] = set()
        self._lock = threading.Lock()
        self.stopped = threading.Event()

    def copy(self, name: str) -> Path:
        """Return a new copy of the checkout."""
        place = self.folder / name
        for file in _files():
            (place / file).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / file, place / file)
        return place

    def session(self, place: Path, words: Sequence[str], limit: float, **environment: str) -> int | None:
        """Run pytest in a copy, with a cache of its own but for compiled modules; None if it takes too long."""
        with tempfile.TemporaryDirectory(prefix="cache-", dir=self.folder) as cache:
            for kind in _COMPILED:
                compiled = self.state.parent / kind
                compiled.mkdir(parents=True, exist_ok=True)
                (Path(cache) / kind).symlink_to(compiled)
            process = subprocess.Popen(
                command(words),
                cwd=place,
                env=os.environ
                | {"PYTHONPATH": f"{place}/codegen:{place}/tests", "STRAPGEN_CACHE_DIR": cache}
                | environment,
                stdout=(place.with_suffix(".log")).open("wb"),
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
            with self._lock:
                self._processes.add(process)
            try:
                return self._wait(process, time.monotonic() + limit)
            finally:
                if process.poll() is None:
                    _end(process)
                with self._lock:
                    self._processes.discard(process)

    def _wait(self, process: subprocess.Popen[bytes], limit: float) -> int | None:
        """Return the exit status of a session; None if it takes too long or too much memory."""
        while time.monotonic() < limit and _resident(process.pid) < MEMORY:
            if time.monotonic() > self.end:
                self.stopped.set()
                break
            with contextlib.suppress(subprocess.TimeoutExpired):
                return process.wait(0.5)
        return None

    def stop(self) -> None:
        """End all sessions and remove the copies."""
        self.stopped.set()
        with self._lock:
            for process in self._processes:
                if process.poll() is None:
                    _end(process)
        shutil.rmtree(self.folder, ignore_errors=True)


def _resident(process: int) -> int:
    """Return the memory in bytes that a process holds; 0 where the system does not tell."""
    try:
        pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    except (OSError, IndexError):
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process and all that it started."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _files() -> list[str]:
    """Return the files of the checkout, those that are not committed yet among them."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    return sorted(file for file in set(listed.split("\0")) if file and (ROOT / file).is_file())


def state_folder(paths: Sequence[str]) -> Path:
    """Return the folder for the outcomes of these sources and tests."""
    total = hashlib.sha256("\0".join(paths).encode())
    for file in _files():
        if file.startswith(_HASHED):
            total.update(file.encode() + b"\0" + (ROOT / file).read_bytes())
    return ROOT / ".mutants" / total.hexdigest()[:16]


def map_of_tests(runner: Runner, workers: int) -> list[MappedTest]:
    """Return what every test executes, from a run of all tests without a fault.

    Raises
    ------
    SystemExit
        If a test fails.
    """
    file = runner.state / "map.jsonl"
    if not file.exists():
        print("running the tests without a fault, to see what they execute", flush=True)
        notes = runner.folder / "map"
        notes.mkdir()
        place = runner.copy("plain")
        words = [*(["-n", str(workers), "--dist", "worksteal"] if workers > 1 else []), *runner.paths]
        status = runner.session(
            place, words, 3600, PYTEST_PLUGINS="execution_map", STRAPGEN_EXECUTION_MAP=str(notes)
        )
        if runner.stopped.is_set():
            raise SystemExit("no time is left to run the tests without a fault")
        if status != 0:
            print(place.with_suffix(".log").read_text()[-3000:])
            raise SystemExit("the tests fail without a fault")
        draft = file.with_suffix(".draft")
        draft.write_text("".join(part.read_text() for part in sorted(notes.glob("tests-*.jsonl"))))
        draft.rename(file)
    lines = map(json.loads, file.read_text().splitlines())
    return [MappedTest(line["test"], line["seconds"], frozenset(line["blocks"])) for line in lines]


def put(place: Path, fault: Fault, number: int) -> None:
    """Put a fault into a copy, at a time that no compiled module has."""
    path = place / fault.site.file
    path.write_text(fault.site.applied((ROOT / fault.site.file).read_text()))
    _dated(path, number)


def take_out(place: Path, fault: Fault, number: int) -> None:
    """Undo a fault in a copy."""
    path = place / fault.site.file
    path.write_bytes((ROOT / fault.site.file).read_bytes())
    _dated(path, number)


def _dated(path: Path, number: int) -> None:
    # Python takes a compiled module for current if the second of the change and the length of the text agree.
    seconds = 1_000_000_000 + 10 * number
    os.utime(path, (seconds, seconds))


def verdict(status: int | None, failed: str, running: str) -> str | None:
    """Return by what a session noticed the fault; None if it did not."""
    if status is None:
        return f"time or memory, in {running or 'the collection'}"
    if status in (0, 5):  # 5: none of the tests exists any more
        return None
    if status < 0:
        return f"signal {-status}, in {running or 'the collection'}"
    return failed or "the import of tests/conftest.py"


@dataclass(frozen=True)
class Session:
    """Tests of one process, whether all others follow, and the seconds after which it hangs."""

    tests: list[MappedTest]
    others: bool
    limit: float


def sessions_of(fault: Fault, tests: list[MappedTest], numbers: dict[str, int], before: str) -> list[Session]:
    """Return the sessions that a fault meets, of which the first begins with what noticed it before, if anything."""
    source = (ROOT / fault.site.file).read_text()
    executing = executing_tests(fault.site.file, fault.line, source, tests, numbers)
    killer = [test for test in tests if test.name == before]
    first = list(dict.fromkeys([*killer, *first_of(executing)]))
    names = {test.name for test in first}
    second = second_of([test for test in executing if test.name not in names])
    suite = sum(test.seconds for test in tests)
    return [
        Session(first, False, HANGS_S),
        Session(second, False, HANGS_S + 60),
        Session([], True, HANGS_S + TIMES_LONGER * suite),
    ]


def run_fault(
    runner: Runner, place: Path, sessions: Sequence[Session], first_only: bool, done: Iterable[str] = ()
) -> tuple[str, str]:
    """Return the outcome of a fault that a copy has, and by what it was noticed, without the tests that are done."""
    done = list(done)
    for item in sessions[:1] if first_only else sessions:
        session, others, limit = item.tests, item.others, item.limit
        if not session and not others:
            continue
        order = place.with_suffix(".json")
        for ending in (".failed", ".running"):
            place.with_suffix(ending).unlink(missing_ok=True)
        chosen = [test.name for test in session]
        order.write_text(json.dumps({"first": chosen, "without": done, "others": others}))
        paths = runner.paths if others else sorted({test.file for test in session})
        status = runner.session(
            place, ["-x", *paths], limit, PYTEST_PLUGINS="chosen_tests", STRAPGEN_CHOSEN=str(order)
        )
        if runner.stopped.is_set():
            return "open", "stopped"
        failed, running = (
            file.read_text() if (file := place.with_suffix(ending)).exists() else ""
            for ending in (".failed", ".running")
        )
        if (by := verdict(status, failed, running)) is not None:
            return "caught", by
        done += chosen
    return ("open", f"{len(done)} tests passed") if first_only else ("survived", "")


def run_all(runner: Runner, listed: Sequence[Fault], tests: list[MappedTest], workers: int) -> None:
    """Give every fault that is not known its first session, and then those that it let pass all others."""
    for first_only in (True, False):
        known = outcomes(runner.state)
        states = {f.key: known[f.key].outcome if f.key in known else "" for f in listed}
        pending = [f for f in listed if states[f.key] == ("" if first_only else "open")]
        run_pass(runner, pending, tests, workers, first_only)


def run_pass(
    runner: Runner, listed: Sequence[Fault], tests: list[MappedTest], workers: int, first_only: bool
) -> None:
    """Run faults, as long as there is time, and write each outcome down at once."""
    numbers = {file: number for number, file in enumerate(execution_map.files(ROOT))}
    earlier = noticed_before(runner.state)
    pending = list(reversed(listed))
    lock = threading.Lock()
    count = len(pending)

    def work(worker: int) -> None:
        place = runner.copy(f"copy{worker}")
        number = 0
        while time.monotonic() < runner.end and not runner.stopped.is_set():
            with lock:
                if not pending:
                    return
                fault = pending.pop()
            begin = time.monotonic()
            sessions = sessions_of(fault, tests, numbers, earlier.get(fault.lasting_key, ""))
            put(place, fault, number := number + 1)
            if first_only:
                outcome, by = run_fault(runner, place, sessions, True)
            else:
                done = [test.name for test in sessions[0].tests]
                outcome, by = run_fault(runner, place, sessions[1:], False, done)
            take_out(place, fault, number := number + 1)
            if runner.stopped.is_set():
                return
            result = Outcome(fault.key, outcome, by, round(time.monotonic() - begin, 1))
            with lock, (runner.state / "outcomes.jsonl").open("a") as stream:
                stream.write(json.dumps(asdict(result)) + "\n")
                if outcome == "caught" and "::" in by and not by.startswith(("time", "signal", "import")):
                    with (runner.state.parent / "noticed.jsonl").open("a") as notes:
                        notes.write(json.dumps({"fault": fault.lasting_key, "test": by}) + "\n")
                print(
                    f"{count - len(pending)}/{count} {outcome} {result.seconds} s {fault.key} {by}",
                    flush=True,
                )

    with ThreadPoolExecutor(workers) as pool:
        try:
            for future in [pool.submit(work, worker) for worker in range(workers)]:
                future.result()
        except BaseException:  # an interrupt too: the other workers wait for processes
            runner.stop()
            raise


# The outcome


def outcomes(state: Path) -> dict[str, Outcome]:
    """Return what is known by now."""
    file = state / "outcomes.jsonl"
    lines: list[dict[str, Any]] = (
        [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    )
    return {line["key"]: Outcome(**line) for line in lines}


def noticed_before(state: Path) -> dict[str, str]:
    """Return the test that noticed a fault last, by the fault, in whatever state of the sources."""
    file = state.parent / "noticed.jsonl"
    lines = map(json.loads, file.read_text().splitlines()) if file.exists() else ()
    return {line["fault"]: line["test"] for line in lines}


def table(listed: Sequence[Fault], known: dict[str, Outcome]) -> str:
    """Return the faults with their outcomes, for a reader."""
    rows = []
    for fault in listed:
        result = known.get(fault.key, Outcome(fault.key, "open", "", 0.0))
        place = f"{fault.site.file.removeprefix('codegen/strapgen/')}:{fault.line}"
        rows.append((fault.part, place, fault.site.kind, result.outcome, f"{result.seconds:.1f}", result.by))
    heads = ("list", "place", "kind", "outcome", "s", "by")
    widths = [max(len(row[k]) for row in (heads, *rows)) for k in range(len(heads))]
    padded = ([text.ljust(width) for text, width in zip(row, widths, strict=True)] for row in (heads, *rows))
    return "\n".join("  ".join(row).rstrip() for row in padded)


def summary(listed: Sequence[Fault], known: dict[str, Outcome]) -> tuple[list[str], bool]:
    """Return a line for each list, the faults that passed, and whether the requirement is met."""
    lines, met, known_reasons = [], True, reasons()
    for part in PARTS:
        group = [fault for fault in listed if fault.part == part]
        if not group:
            continue
        states = [known[f.key].outcome if f.key in known else "open" for f in group]
        caught = states.count("caught")
        needed = DRAWS[part].least if part in DRAWS else len(group)
        met &= caught >= needed
        lines.append(f"{part}: {caught} of {len(group)} caught, {needed} needed; {states.count('open')} open")
        lines += [
            f"  {state}: {f.site.file}:{f.line}\n    - {f.before}\n    + {f.after}"
            + (f"\n    {known_reasons[f.lasting_key]}" if f.lasting_key in known_reasons else "")
            for f, state in zip(group, states, strict=True)
            if state != "caught"
        ]
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
    begin = time.monotonic()
    listed = [
        fault
        for part in options.part or PARTS
        for fault in faults(part, options.seed)
        if options.only in fault.key
    ]
    print(f"{len(listed)} faults; the random ones are drawn with seed {options.seed}", flush=True)
    if options.list:
        print(
            "\n".join(
                f"{f.part} {f.site.file}:{f.line} {f.site.kind}\n  - {f.before}\n  + {f.after}"
                for f in listed
            )
        )
        return 0
    state = state_folder(options.tests)
    if options.restart:
        (state / "outcomes.jsonl").unlink(missing_ok=True)
    state.mkdir(parents=True, exist_ok=True)
    (state / "draw.json").write_text(json.dumps({"seed": options.seed, "tests": options.tests}))
    runner = Runner(state, options.tests, begin + 60 * options.minutes)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    try:
        run_all(runner, listed, map_of_tests(runner, options.workers), options.workers)
    finally:
        runner.stop()
    known = outcomes(state)
    lines, met = summary(listed, known)
    print("\n".join(["", table(listed, known), "", *lines, f"{time.monotonic() - begin:.0f} s"]))
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
