"""Runs independent cases side by side, and keeps each result in a file, from which an interrupted study goes on.

A results file has a line of JSON for the study, which says what it is, and one for each result, in the order in which
they came. A line is complete when it ends: what a killed process left of the last one is dropped.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import stat
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from strapgen.ir.exceptions import InputError, StrapgenError
from strapgen.lab.study.clusters import Bundle, Cluster, on_cluster
from strapgen.run.processes import begin_worker

try:
    import fcntl
except ImportError:  # no POSIX system
    fcntl = None  # type: ignore[assignment]

#: Longest results file that is read, in bytes.
_MOST_BYTES = 1 << 28


def side_by_side(
    work: Callable[[Any], Any],
    cases: Mapping[str, Any],
    jobs: int | None = None,
    cluster: Cluster | None = None,
    files: Bundle | None = None,
) -> Iterator[tuple[str, Any]]:
    """Run cases in several processes, here or on a cluster, and yield each result when its case ends."""
    if cluster is not None:
        yield from on_cluster(work, cases, cluster, files)
        return
    workers = min(len(cases), jobs or os.cpu_count() or 1)
    if workers <= 1:
        yield from ((name, work(case)) for name, case in cases.items())
        return
    others = set(multiprocessing.active_children())
    # An interrupt reaches this process alone, which then stops the others.
    pool = ProcessPoolExecutor(workers, initializer=begin_worker)
    try:
        pending: dict[Future[Any], str] = {pool.submit(work, case): name for name, case in cases.items()}
        for done in as_completed(pending):
            yield pending[done], done.result()
    except BaseException as error:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in set(multiprocessing.active_children()) - others:
            child.terminate()
        if isinstance(error, BrokenProcessPool):
            raise StrapgenError(
                "a process of the study was killed; its results so far are not lost"
            ) from None
        raise
    pool.shutdown()


def resume(
    work: Callable[[Any], Any],
    cases: Mapping[str, Any],
    results: str | Path,
    identity: Mapping[str, Any],
    jobs: int | None = None,
    cluster: Cluster | None = None,
    files: Bundle | None = None,
) -> Iterator[tuple[str, Any]]:
    """Run the cases whose results a file does not hold yet, and add each result to the file when its case ends."""
    path = Path(results)
    with _opened(path) as file:
        known = _known(file, path, dict(identity))
        yield from ((name, known[name]) for name in cases if name in known)
        missing = {name: case for name, case in cases.items() if name not in known}
        for name, result in side_by_side(work, missing, jobs, cluster, files):
            line = _line({"case": name, "result": result})
            _append(file, path, line)
            yield name, json.loads(line)["result"]


@contextmanager
def _opened(path: Path) -> Iterator[IO[bytes]]:
    """Open a results file, which no other process may write at the same time."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0), 0o666)
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror})") from None
    with os.fdopen(descriptor, "r+b", buffering=0) as file:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise InputError(f"{path} is no ordinary file; only those are written")
        if fcntl is not None:
            try:
                # Unlike that of flock, this lock is not passed on to the processes of the pool.
                fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise InputError(f"{path} is being written by another process") from None
        yield file


def _known(file: IO[bytes], path: Path, identity: dict[str, Any]) -> dict[str, Any]:
    """Return the results of a file by case; begin a new file, and drop a line that is not complete."""
    if os.fstat(file.fileno()).st_size > _MOST_BYTES:
        raise InputError(f"{path} is over {_MOST_BYTES} bytes long; a results file is shorter")
    content = file.read()
    complete = content.rfind(b"\n") + 1
    first, *lines = content[:complete].split(b"\n")[:-1] or [b""]
    header = _line({"study": identity})
    if not complete and not header.startswith(content):
        raise InputError(f"{path} holds no results of a study; another file is needed")
    if complete:
        _check_header(first, path, json.loads(header)["study"])
    if complete < len(content):
        file.truncate(complete)
    if not complete:
        _append(file, path, header)
    return dict(_result(line, path, number) for number, line in enumerate(lines, 2))


def _check_header(line: bytes, path: Path, identity: dict[str, Any]) -> None:
    """Refuse the results of another study."""
    there = _object(line).get("study")
    if not isinstance(there, dict):
        raise InputError(f"{path} holds no results of a study; another file is needed")
    for key in {**identity, **there}:
        if there.get(key) != identity.get(key):
            raise InputError(
                f"{path} holds another study: {key} is {_shown(there.get(key))} there and "
                f"{_shown(identity.get(key))} here; another file is needed"
            )


def _result(line: bytes, path: Path, number: int) -> tuple[str, Any]:
    entry = _object(line)
    if set(entry) != {"case", "result"} or not isinstance(entry["case"], str):
        raise InputError(f"line {number} of {path} is no result")
    return entry["case"], entry["result"]


def _object(line: bytes) -> dict[str, Any]:
    """Return a line of JSON as an object; an empty one if it is none."""
    try:
        entry = json.loads(line)
    except (ValueError, RecursionError):
        return {}
    return entry if isinstance(entry, dict) else {}


def _line(entry: dict[str, Any]) -> bytes:
    return json.dumps(entry, allow_nan=False).encode() + b"\n"


def _append(file: IO[bytes], path: Path, line: bytes) -> None:
    """Add a line to a file, and have the system store it."""
    try:
        while line:
            line = line[file.write(line) :]
        os.fsync(file.fileno())
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror})") from None


def _shown(value: Any) -> str:
    """Return a value of an identity in at most a few words."""
    text = json.dumps(value)
    return text if len(text) <= 40 else f"{text[:37]}..."
