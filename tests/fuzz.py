"""Fuzzes the generated C, the readers of files and the command line, guided by what code each input reaches.

    python tests/fuzz.py --seconds 300

The C runs in clang's libFuzzer under sanitizers, the Python in atheris where it is installed, and otherwise in a loop
here that traces lines. It starts from the corpus in tests/data/corpus, one input in base 64 a line; --keep adds to it
what reaches new code. The exit status is 1 if anything was found; an input that was found belongs into the corpus too.
"""

from __future__ import annotations

import argparse
import base64
import importlib.util
import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import FrameType
from typing import Any

CORPUS = Path(__file__).resolve().parent / "data" / "corpus"
#: Most inputs that --keep leaves of a target, and the longest of them in bytes.
MOST, LONGEST = 12, 400
#: Parts of the time for the C, for the readers, and for the command line.
PARTS = {"c": 0.5, "readers": 0.25, "command-line": 0.25}


#: When this process began, which is part of the time of its target.
_STARTED = time.monotonic()


def _left(seconds: float) -> int:
    """Return the whole seconds that are left of a target's time, at least one."""
    return max(1, int(_STARTED + seconds - time.monotonic()))


def corpus(name: str) -> list[bytes]:
    """Return the inputs that are kept of a target."""
    path = CORPUS / f"{name}.txt"
    return [base64.b64decode(line) for line in path.read_text().split()] if path.is_file() else []


def keep(name: str, inputs: Iterable[bytes]) -> None:
    """Keep inputs of a target: some of each length."""
    ordered = sorted({data for data in inputs if len(data) <= LONGEST}, key=lambda data: (len(data), data))
    if len(ordered) > MOST:
        ordered = [ordered[k * (len(ordered) - 1) // (MOST - 1)] for k in range(MOST)]
    if not ordered:
        return
    CORPUS.mkdir(parents=True, exist_ok=True)
    (CORPUS / f"{name}.txt").write_text("".join(f"{base64.b64encode(data).decode()}\n" for data in ordered))


# Python


class Trace:
    """The lines of strapgen that were reached."""

    def __init__(self) -> None:
        self.lines: set[tuple[str, int]] = set()
        self._new = False

    def _line(self, frame: FrameType, event: str, _: Any) -> Any:
        name = frame.f_code.co_filename
        if "strapgen" not in name:
            return None
        place = (name, frame.f_lineno)
        if place not in self.lines:
            self.lines.add(place)
            self._new = True
        return self._line

    def reaches_more(self, target: Callable[[bytes], None], data: bytes) -> bool:
        """Run a target; tell whether it reached a line that no input before reached."""
        self._new = False
        sys.settrace(self._line)
        try:
            target(data)
        finally:
            sys.settrace(None)
        return self._new


def mutated(data: bytes, others: Sequence[bytes], stream: random.Random) -> bytes:
    """Return an input that differs from another in a few places."""
    content = bytearray(data)
    for _ in range(stream.randint(1, 4)):
        place = stream.randint(0, len(content))
        kind = stream.randrange(5)
        if kind == 0:
            content[place:place] = stream.randbytes(stream.randint(1, 4))
        elif kind == 1:
            del content[place : place + stream.randint(1, 8)]
        elif kind == 2:
            content[place : place + 1] = bytes([stream.choice(b"0123456789eE+-.,;:=[]{}\"'#\n\r\t \0\xff")])
        elif kind == 3:
            other = stream.choice(others)
            begin = stream.randint(0, len(other))
            content[place:place] = other[begin : begin + stream.randint(1, 40)]
        elif content:
            content[place % len(content)] ^= 1 << stream.randrange(8)
    return bytes(content[:4096])


def search(
    target: Callable[[bytes], None], start: Sequence[bytes], seed: int, goes_on: Callable[[], bool]
) -> tuple[bytes | None, BaseException | None, list[bytes]]:
    """Run a target on inputs that change step by step, and go on from those that reach new lines.

    Returns
    -------
    bytes or None
        An input that was found.
    BaseException or None
        What the target raised for it.
    list of bytes
        The inputs that reached new lines, one after the other.
    """
    stream, trace = random.Random(seed), Trace()
    inputs: list[bytes] = []
    waiting = [*start, b""]
    while waiting or goes_on():
        data = waiting.pop(0) if waiting else mutated(stream.choice(inputs or [b""]), inputs or [b""], stream)
        try:
            if trace.reaches_more(target, data) or not inputs:
                inputs.append(data)
        except Exception as error:
            return data, error, inputs
    return None, None, inputs


def fuzz_python(name: str, seconds: float, seed: int, keeps: bool) -> int:
    """Fuzz a target in this process, without atheris."""
    from fuzz_targets import TARGETS, seeds

    end = _STARTED + seconds
    start = [*corpus(name), *seeds(name)]
    data, error, inputs = search(TARGETS[name], start, seed, lambda: time.monotonic() < end)
    if keeps:
        keep(name, [*corpus(name), *inputs])
    if data is not None:
        print(f"{name}: {type(error).__name__}: {error}; input in base 64: {base64.b64encode(data).decode()}")
    return int(data is not None)


def fuzz_with_atheris(name: str, seconds: float, seed: int, keeps: bool) -> int:
    """Fuzz a target in this process with atheris, which ends the process."""
    import atheris

    with atheris.instrument_imports(include=["strapgen"]):
        from fuzz_targets import TARGETS, seeds

    def target(data: bytes) -> None:
        try:
            TARGETS[name](data)
        except Exception as error:
            shown = base64.b64encode(data).decode()
            print(f"{name}: {type(error).__name__}: {error}; input in base 64: {shown}", flush=True)
            if keeps:
                keep(name, [*corpus(name), data])
            os._exit(1)

    with tempfile.TemporaryDirectory() as folder:
        for number, data in enumerate([*corpus(name), *seeds(name)]):
            (Path(folder) / f"{number}").write_bytes(data)
        options = [f"-max_total_time={_left(seconds)}", f"-seed={seed}", "-handle_alrm=0", "-timeout=0"]
        options += ["-rss_limit_mb=0", "-verbosity=0", "-max_len=2048"]
        atheris.Setup([sys.argv[0], *options, folder], target)
        atheris.Fuzz()
    return 0


# C


def fuzz_c(kernel: str, seconds: float, seed: int, keeps: bool) -> int:
    """Fuzz the C of a kernel of the standard catalogue with libFuzzer."""
    from strapgen import catalogue
    from strapgen.evidence import clang_checks
    from strapgen.evidence.collection import Subject

    subject = next(Subject(choice) for choice in catalogue.standard() if choice.kernel == kernel)
    with tempfile.TemporaryDirectory() as name:
        folder, inputs = Path(name), Path(name) / "inputs"
        inputs.mkdir()
        for place, data in enumerate(corpus(f"c_{subject.name}")):
            (inputs / f"{place}").write_bytes(data)
        for file, text in clang_checks.fuzz_files(subject).items():
            (folder / file).write_text(text)
        report = clang_checks.compile_driver(folder, subject.sources)
        report = report or clang_checks.run_fuzzer(
            folder, [f"-max_total_time={_left(seconds)}", f"-seed={seed}", "inputs"]
        )
        if keeps and not report:
            (folder / "least").mkdir()
            clang_checks.run_fuzzer(folder, ["-merge=1", "least", "inputs"])
            keep(f"c_{subject.name}", [path.read_bytes() for path in (folder / "least").iterdir()])
    if report:
        print(report)
    return int(bool(report))


# All


def jobs(seconds: float, only: Sequence[str], cores: int) -> list[tuple[str, float]]:
    """Return what is fuzzed, and for how long each, so that all cores are busy for the time in all."""
    from fuzz_targets import TARGETS

    from strapgen.evidence import clang_checks
    from strapgen.evidence.collection import standard

    kinds = {
        "c": [f"c:{subject.choice.kernel}" for subject in standard()]
        if clang_checks.FUZZER.installed()
        else [],
        "readers": [name for name in TARGETS if name != "command-line"],
        "command-line": ["command-line"] * cores,
    }
    if "c" in only and not kinds["c"]:
        print("the C is not fuzzed: clang with libFuzzer is not installed")
    chosen = {kind: names for kind, names in kinds.items() if kind in only and names}
    whole = sum(PARTS[kind] for kind in chosen)
    return [
        (name, seconds * cores * PARTS[kind] / whole / len(names))
        for kind, names in chosen.items()
        for name in names
    ]


def run(job: str, seconds: float, seed: int, keeps: bool) -> int:
    """Fuzz one target in this process."""
    if job.startswith("c:"):
        return fuzz_c(job[2:], seconds, seed, keeps)
    if importlib.util.find_spec("atheris") and not keeps:
        return fuzz_with_atheris(job, seconds, seed, keeps)
    return fuzz_python(job, seconds, seed, keeps)


def main(words: Sequence[str] | None = None) -> int:
    """Fuzz everything, a process for each target."""
    parser = argparse.ArgumentParser(description="Fuzz generated C, readers and the command line.")
    parser.add_argument("--seconds", type=float, default=300, help="time in all")
    parser.add_argument("--only", default=",".join(PARTS), help="c, readers, command-line; commas between")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", action="store_true", help="keep what reaches new code in the corpus")
    parser.add_argument("--job", help=argparse.SUPPRESS)
    options = parser.parse_args(words)
    only = options.only.split(",")
    if unknown := [kind for kind in only if kind not in PARTS]:
        parser.error(f"{unknown[0]!r} is not known; allowed: {', '.join(PARTS)}")
    if options.job:
        return run(options.job, options.seconds, options.seed, options.keep)
    cores = os.cpu_count() or 1

    def start(number: int, job: str, seconds: float) -> tuple[str, int, str]:
        if time.monotonic() > _STARTED + options.seconds:
            print(f"{job}: no time was left for it")
            return job, 0, ""
        command = [
            sys.executable,
            __file__,
            "--job",
            job,
            f"--seconds={seconds}",
            f"--seed={number + options.seed}",
        ]
        done = subprocess.run(
            [*command, *(["--keep"] if options.keep else [])],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", check=False,
        )  # fmt: skip
        return job, done.returncode, done.stdout

    status = 0
    with ThreadPoolExecutor(cores) as pool:
        tasks = [
            pool.submit(start, number, *job) for number, job in enumerate(jobs(options.seconds, only, cores))
        ]
        for task in tasks:
            job, returned, said = task.result()
            if returned:
                status = 1
                print(f"{job}: exit status {returned}\n{said[-3000:]}", flush=True)
    print("something was found" if status else f"nothing was found in {len(tasks)} targets")
    return status


if __name__ == "__main__":
    sys.exit(main())
