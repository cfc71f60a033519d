"""Shows that no fault of the machine leaves anything wrong: kills processes, fills disks, stops writing, moves clocks.

Each trial has a cache, an output folder and a temporary folder of its own. A command runs in them and meets one fault
at a moment that is drawn at random; then it runs again without any. Whatever the moment, a file in the output folder is
whole after the fault; the second run gives the result of a run without faults, and leaves no draft, no temporary file,
no damaged entry of the cache and no process. Disks are filled and closed on small file systems in memory, for which one
must be root; for others the size of files is limited.

    python tests/faults.py --seconds 240 --seed 1969
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: Number of kills, and of trials of every other kind, if the time does.
KILLS, OTHERS = 100, 15
#: A run that takes longer hangs, and so does a process that outlives its parent longer, in s.
HANGS_S, ORPHANS_S = 120, 10
#: Part of the trials whose cache holds what is derived.
WARM = 0.75
#: Sizes of a disk in kB that is full sooner or later, and of one that is not.
SMALL_KB, LARGE_KB = (16, 3000), 64_000

#: Writes the checked-in tree as `generate --all` does, without deriving it again.
WRITE_TREE = """
import sys
from pathlib import Path
from strapgen.run import standard_tree
tree = Path(sys.argv[1])
files = {path.relative_to(tree).as_posix(): path.read_text() for path in sorted(tree.rglob("*")) if path.is_file()}
files = {name: text for name, text in files.items() if name.rpartition("/")[0] or name == "README.md"}
files["README.md"] = files.pop("README.md")
try:
    print(len(standard_tree.write(Path("out"), files)))
except ValueError as error:
    print(f"strapgen: {error}", file=sys.stderr)
    sys.exit(2)
"""


def strapgen(words: str) -> list[str]:
    """Return a command line of strapgen."""
    return [sys.executable, "-m", "strapgen", *words.split()]


#: What is run: by its name the command before the fault, which must succeed, and the command that meets it.
COMMANDS = {
    "generate": (
        [],
        strapgen("generate euler --method rk1 --increments 1 --target c-fixed --with-runs --out out"),
    ),
    "generate --all": ([], [sys.executable, "-c", WRITE_TREE, str(ROOT / "generated")]),
    "tables": ([], strapgen("tables --table 1 --backend c --format csv --out out/table.csv")),
    "study": (
        [],
        strapgen(
            "study word-length --method rk1 --word 12,16 --carry none --duration 2 --jobs 2 --out out/study.txt"
        ),
    ),
    "verify": (
        strapgen("generate euler --method rk1 --increments 1 --target c --out out"),
        strapgen("verify out/euler_rk1_1.c --format json"),
    ),
}


@dataclass
class Place:
    """The folders of a trial."""

    root: Path
    changes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        for name in ("cache", "out", "tmp"):
            (self.root / name).mkdir(exist_ok=True)

    def start(self, command: list[str], limit: int = 0) -> subprocess.Popen[str]:
        """Start a command in a session of its own."""
        import resource  # of POSIX systems alone

        environment = os.environ | {
            "PYTHONPATH": str(ROOT / "codegen"),
            "STRAPGEN_CACHE_DIR": str(self.root / "cache"),
            "TMPDIR": str(self.root / "tmp"),
            "PYTHONDONTWRITEBYTECODE": "1",
        }

        def limited() -> None:
            if limit:
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

        return subprocess.Popen(
            command,
            cwd=self.root,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            preexec_fn=limited,
        )

    def files(self, hidden: bool = True) -> dict[str, str]:
        """Return the files of the output folder by their paths; hidden folders too, if that is said."""
        out = self.root / "out"
        paths = {path: path.relative_to(out) for path in sorted(out.rglob("*")) if path.is_file()}
        return {
            str(name): path.read_text(errors="replace")
            for path, name in paths.items()
            if hidden or not any(part.startswith(".strapgen-draft-") for part in name.parts)
        }

    def left(self) -> list[str]:
        """Return what no run may leave: drafts, temporary files, entries of the cache that are not whole."""
        cache = self.root / "cache"
        names = [path for path in cache.rglob("*") if path.name.startswith(".")]
        names += [path for path in (self.root / "out").rglob("*") if path.name.startswith(".")]
        names += (self.root / "tmp").iterdir()
        for entry in cache.glob("*/*"):
            try:
                listed = json.loads((entry / "manifest.json").read_text())
                present = {path.name for path in entry.iterdir()} - {"manifest.json"}
                if set(listed) != present or not all((entry / name).stat().st_size for name in listed):
                    names.append(entry)
            except (OSError, ValueError):
                names.append(entry)
        return [*dict.fromkeys(str(path.relative_to(self.root)) for path in names)]


@dataclass(frozen=True)
class Result:
    """What a run returned."""

    status: int
    out: str
    err: str


def finish(process: subprocess.Popen[str]) -> Result:
    """Wait for a process."""
    try:
        out, err = process.communicate(timeout=HANGS_S)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        out, err = process.communicate()
        return Result(-999, out, f"hangs: {err}")
    return Result(process.returncode, out, err)


def members(session: int) -> list[int]:
    """Return the processes of a session that have not ended."""
    there = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            with contextlib.suppress(OSError, IndexError):
                state, _, _, of_session = (entry / "stat").read_text().rpartition(")")[2].split()[:4]
                if int(of_session) == session and state not in "ZX":
                    there.append(int(entry.name))
    return there


@dataclass
class Reference:
    """A run without faults: its result, its files, how long it takes in s, and the programs of its cache."""

    result: Result
    files: dict[str, str]
    seconds: float
    programs: Path


class Trials:
    """Runs trials and collects what is wrong."""

    def __init__(self, folder: Path, seed: int, until: float) -> None:
        self.folder, self.seed, self.until = folder, seed, until
        self.counts: Counter[str] = Counter()
        self.wrong: list[str] = []
        self.references: dict[str, Reference] = {}
        self._lock = threading.Lock()
        self._number = 0

    @contextlib.contextmanager
    def place(self) -> Iterator[Place]:
        """Yield new folders, which are gone after the block."""
        with self._lock:
            self._number += 1
            root = self.folder / str(self._number)
        root.mkdir()
        try:
            yield Place(root)
        finally:
            shutil.rmtree(root, ignore_errors=True)

    def refer(self, name: str) -> None:
        """Run a command without a fault."""
        before, command = COMMANDS[name]
        with self.place() as place:
            if before:
                assert finish(place.start(before)).status == 0, name
            begin = time.monotonic()
            result = finish(place.start(command))
            seconds = time.monotonic() - begin
            if result.status or result.err.count("\n") > 1 or place.left():
                raise SystemExit(f"{name} without a fault: {result}, it leaves {place.left()}")
            programs = self.folder / f"programs of {name}"
            if (place.root / "cache" / "programs").is_dir():
                shutil.copytree(place.root / "cache" / "programs", programs)
            self.references[name] = Reference(result, place.files(), seconds, programs)
            print(f"{name}: {seconds:.1f} s without a fault", flush=True)

    def warm(self, name: str, place: Place, draw: random.Random) -> None:
        """Let most trials begin with what is derived, so that more of them fit into the time."""
        programs = self.references[name].programs
        if draw.random() < WARM and programs.is_dir():
            shutil.copytree(programs, place.root / "cache" / "programs", dirs_exist_ok=True)

    def note(self, what: str, seed: str, complaints: list[str]) -> None:
        """Count a trial, and print what is wrong."""
        with self._lock:
            self.counts[what] += 1
            for complaint in complaints:
                self.wrong.append(f"{what}, {seed}: {complaint}")
                print(f"WRONG: {self.wrong[-1]}", flush=True)

    def after(self, name: str, place: Place) -> list[str]:
        """Run a command again, and return what is wrong with its result, or left behind."""
        expected = self.references[name]
        result = finish(place.start(COMMANDS[name][1]))
        complaints = []
        if (result.status, result.out) != (0, expected.result.out):
            complaints.append(
                f"the next run returns {result.status}, {result.out[-200:]!r}, {result.err[-500:]!r}"
            )
        if place.files() != expected.files:
            complaints.append(f"the next run leaves the files {sorted(place.files())}")
        return complaints

    def halves(self, name: str, place: Place, before: dict[str, str]) -> list[str]:
        """Return the files of the output folder that are neither old nor new."""
        expected = self.references[name].files
        files = place.files(hidden=False)
        return [
            f"half a file: {path}"
            for path, text in files.items()
            if text not in (before.get(path), expected.get(path))
        ]


def outlived(session: int) -> list[str]:
    """Return the processes of a killed session that do not end by themselves, and end them."""
    until = time.monotonic() + ORPHANS_S
    while (there := members(session)) and time.monotonic() < until:
        time.sleep(0.05)
    said = []
    for process in there:
        with contextlib.suppress(OSError):
            said.append((Path("/proc") / str(process) / "cmdline").read_text().replace("\0", " ")[:100])
            os.kill(process, signal.SIGKILL)
    return [f"a process goes on: {line}" for line in said]


def killed(trials: Trials, name: str, draw: random.Random) -> list[str]:
    """Kill a command, alone or beside another one on the same cache, and run it again at once."""
    before, command = COMMANDS[name]
    expected = trials.references[name]
    with trials.place() as place:
        if before:
            finish(place.start(before))
        trials.warm(name, place, draw)
        files = place.files()
        complaints, other = [], None
        process = place.start(command)
        if draw.random() < 0.4:
            (place.root / "other").mkdir()
            beside = Place(place.root / "other")
            if before:
                finish(beside.start(before))
            shutil.rmtree(beside.root / "cache")
            (beside.root / "cache").symlink_to(place.root / "cache")
            other = beside.start(command)
        time.sleep(draw.uniform(0.1, 1.0) ** 2 * expected.seconds)  # most begin with what is derived
        process.kill()
        process.wait()
        for stream in (process.stdout, process.stderr):  # others may hold the other ends
            if stream is not None:
                stream.close()
        complaints += trials.halves(name, place, files)
        complaints += trials.after(name, place)
        if other is not None:
            result = finish(other)
            if (result.status, result.out) != (0, expected.result.out) or beside.files() != expected.files:
                complaints.append(f"the other process returns {result}")
        complaints += outlived(process.pid)
        if (
            other is not None
        ):  # what the other has seen of the first one's end may be its draft, which a last run removes
            complaints += trials.after(name, place)
        return complaints + [f"left behind: {path}" for path in place.left()]


@contextlib.contextmanager
def small_disk(place: Path, size: int) -> Iterator[None]:
    """Mount a file system in memory of some kB."""
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}k,mode=755", "tmpfs", place], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", "-l", place], check=True)


def remount(place: Path, options: str) -> None:
    """Change a file system."""
    subprocess.run(["mount", "-o", f"remount,{options}", place], check=True)


def refused_or_right(
    trials: Trials, name: str, place: Place, result: Result, before: dict[str, str]
) -> list[str]:
    """Return what is wrong with a run that meets an obstacle: it does what it should, or says in one line why not."""
    if result.status == 0 and result.out == trials.references[name].result.out:
        wrong = (
            []
            if place.files(hidden=False) == trials.references[name].files
            else ["it succeeds without its files"]
        )
    elif result.status == 2 and result.err.startswith("strapgen: ") and result.err.count("\n") == 1:
        wrong = trials.halves(name, place, before)
    else:
        wrong = [f"status {result.status}: {result.err[-700:]!r}"]
    return wrong


def full(trials: Trials, name: str, draw: random.Random) -> list[str]:
    """Run a command on a disk that is too small, or with a limit of the size of files, and again with more room."""
    before, command = COMMANDS[name]
    size = draw.randint(*SMALL_KB)
    with trials.place() as outer, contextlib.ExitStack() as stack:
        root = outer.root / "disk"
        root.mkdir()
        if os.geteuid() == 0:
            stack.enter_context(small_disk(root, LARGE_KB))
        place = Place(root)
        if before:
            finish(place.start(before))
            shutil.rmtree(root / "cache")
            (root / "cache").mkdir(mode=0o700)
        trials.warm(name, place, draw)
        files = place.files()
        if os.geteuid() == 0:
            room = sum(path.stat().st_blocks // 2 for path in root.rglob("*"))
            remount(root, f"size={room + size}k")
        result = finish(place.start(command, limit=0 if os.geteuid() == 0 else size << 10))
        complaints = refused_or_right(trials, name, place, result, files)
        if os.geteuid() == 0:
            remount(root, f"size={LARGE_KB}k")
        complaints += trials.after(name, place)
        return [
            f"{size} kB: {text}" for text in complaints + [f"left behind: {path}" for path in place.left()]
        ]


def read_only(trials: Trials, name: str, draw: random.Random) -> list[str]:
    """Run a command where nothing can be written, with an empty or a full cache, and again where it can."""
    before, command = COMMANDS[name]
    with trials.place() as outer, contextlib.ExitStack() as stack:
        root = outer.root / "disk"
        root.mkdir()
        if os.geteuid() == 0:
            stack.enter_context(small_disk(root, LARGE_KB))
        place = Place(root)
        for words in (before, command if draw.random() < 0.5 else []):
            if words:
                finish(place.start(words))
        trials.warm(name, place, draw)
        if name != "verify":
            for path in (root / "out").iterdir():
                shutil.rmtree(path) if path.is_dir() else path.unlink()
        files, closed = place.files(), [root, *(path for path in root.rglob("*") if path.is_dir())]
        if os.geteuid() == 0:
            remount(root, "ro")
        else:
            for folder in closed:
                folder.chmod(0o555)
        result = finish(place.start(command))
        complaints = refused_or_right(trials, name, place, result, files)
        if os.geteuid() == 0:
            remount(root, "rw")
        else:
            for folder in closed:
                folder.chmod(0o755)
        complaints += trials.after(name, place)
        return complaints + [f"left behind: {path}" for path in place.left()]


def jumped(trials: Trials, name: str, draw: random.Random) -> list[str]:
    """Set the times of all files to the past or the future, before a run or again and again during two of them."""
    before, command = COMMANDS[name]
    expected = trials.references[name]
    with trials.place() as place:
        for words in (before, command if draw.random() < 0.5 else []):
            if words:
                finish(place.start(words))
        trials.warm(name, place, draw)
        processes = [place.start(command)]
        (place.root / "other").mkdir()
        beside = Place(place.root / "other")
        if before:
            finish(beside.start(before))
        shutil.rmtree(beside.root / "cache")
        (beside.root / "cache").symlink_to(place.root / "cache")
        processes.append(beside.start(command))
        while any(process.poll() is None for process in processes):
            then = draw.choice([0, 1, time.time() - 10 * 365 * 86400, time.time() + 10 * 365 * 86400])
            for folder, folders, files in os.walk(place.root / "cache"):
                for path in (*folders, *files):
                    with contextlib.suppress(OSError):
                        os.utime(Path(folder) / path, (then, then))
            time.sleep(0.02)
        complaints = []
        for process in processes:
            result = finish(process)
            if (result.status, result.out) != (0, expected.result.out):
                complaints.append(f"under a clock that jumps: {result.status}, {result.err[-700:]!r}")
        complaints += trials.after(name, place)
        return complaints + [f"left behind: {path}" for path in place.left()]


KINDS: dict[str, Callable[[Trials, str, random.Random], list[str]]] = {
    "killed": killed,
    "full disk": full,
    "read-only disk": read_only,
    "clock that jumps": jumped,
}


def plan(seed: int, kinds: list[str], commands: list[str]) -> list[tuple[str, str, str]]:
    """Return the trials in the order in which they are begun: kind, command, seed."""
    trials = []
    for kind in kinds:
        for number in range(KILLS if kind == "killed" else OTHERS):
            trials.append((kind, commands[number % len(commands)], f"{seed}:{kind}:{number}"))
    random.Random(seed).shuffle(trials)
    return trials


def main() -> None:
    """Run the trials until all are done or the time is over."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=240, help="begin no trial after so many seconds")
    parser.add_argument("--seed", type=int, default=1969)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--kind", choices=KINDS, action="append", help="only faults of this kind")
    parser.add_argument("--command", choices=COMMANDS, action="append", help="only this command")
    parser.add_argument("--trials", type=int, help="no more than so many trials")
    parser.add_argument("--trial", help="only the trial of this seed, as a complaint names it")
    options = parser.parse_args()
    until = time.monotonic() + options.seconds
    with tempfile.TemporaryDirectory(prefix="faults-") as folder:
        trials = Trials(Path(folder).resolve(), options.seed, until)
        chosen = options.command or [*COMMANDS]
        for name in chosen:
            trials.refer(name)
        planned = plan(options.seed, options.kind or [*KINDS], chosen)[: options.trials]

        def run(trial: tuple[str, str, str]) -> None:
            kind, name, seed = trial
            if time.monotonic() < until and options.trial in (None, seed):
                complaints = KINDS[kind](trials, name, random.Random(seed))
                trials.note(f"{kind}: {name}", seed, complaints)

        with ThreadPoolExecutor(options.jobs) as pool:
            list(pool.map(run, planned))
    for what, count in sorted(trials.counts.items()):
        print(f"{what}: {count} trials")
    print(
        f"{sum(trials.counts.values())} of {len(planned)} trials, {len(trials.wrong)} faults left something wrong"
    )
    sys.exit(1 if trials.wrong else 0)


if __name__ == "__main__":
    main()
