"""Runs independent cases side by side, and keeps each result in a file, from which an interrupted study resumes.

A results file has a line of JSON for the study, which says what it is, and one for each result, in the order in which
they came. A line is complete when it ends: what a killed process left of the last one is dropped.
"""

from __future__ import annotations

import json
import logging
import multiprocessing
import os
import re
import stat
import threading
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Any

from strapgen.ir.exceptions import InputError, MissingExtraError, StrapgenError
from strapgen.run.processes import begin_worker
from strapgen.storage import cache, locks

#: Longest results file that is read, in bytes.
_MOST_BYTES = 1 << 28

#: Cases that a worker has before it at any time, so that many cases do not fill the scheduler.
_AHEAD = 4
#: Times a case is given out again after its worker died.
_AGAIN = 20
#: Seconds in which a scheduler must answer.
_PATIENCE_S = 20
#: Most workers on this machine.
_MOST_WORKERS = 256
#: Arithmetic in many digits has its precision in common: a process runs one case at a time.
_one_at_a_time = threading.Lock()
#: Folders with files of the user's, by their digest.
_folders: dict[str, TemporaryDirectory[str]] = {}


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
    with _open(path) as file:
        known = _read_results(file, path, dict(identity))
        yield from ((name, known[name]) for name in cases if name in known)
        missing = {name: case for name, case in cases.items() if name not in known}
        for name, result in side_by_side(work, missing, jobs, cluster, files):
            line = _line({"case": name, "result": result})
            _append(file, path, line)
            yield name, json.loads(line)["result"]


@contextmanager
def _open(path: Path) -> Iterator[IO[bytes]]:
    """Open a results file, which no other process may write at the same time."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0), 0o666)
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror})") from None
    with os.fdopen(descriptor, "r+b", buffering=0) as file:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise InputError(f"{path} is no ordinary file; only those are written")
        if not locks.lock(descriptor):
            raise InputError(f"{path} is being written by another process")
        yield file


def _read_results(file: IO[bytes], path: Path, identity: dict[str, Any]) -> dict[str, Any]:
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
                f"{path} holds another study: {key} is {_short(there.get(key))} there and "
                f"{_short(identity.get(key))} here; another file is needed"
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


def _short(value: Any) -> str:
    """Return a value of an identity in at most a few words."""
    text = json.dumps(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


@dataclass(frozen=True)
class Bundle:
    """The user's files that cases need.

    Such a case has a method ``moved(begin, end)``, which returns it with its files in another folder.
    """

    #: The folder that holds them all
    folder: Path
    #: What they hold, by their paths in it
    contents: dict[str, bytes]

    @classmethod
    def of(cls, paths: Iterable[str | Path]) -> Bundle | None:
        """Return files with the folder that holds them all; None if there are none."""
        files = [Path(path).resolve() for path in paths]
        if not files:
            return None
        folder = Path(os.path.commonpath([file.parent for file in files]))
        contents = {}
        for file in files:
            try:
                contents[file.relative_to(folder).as_posix()] = file.read_bytes()
            except OSError as error:
                raise InputError(f"{file} cannot be read ({error.strerror})") from None
        return cls(folder, contents)


def moved(path: str, begin: Path, end: Path) -> str:
    """Return the path of a file that was in one folder and is in another."""
    return str(end / Path(path).resolve().relative_to(begin))


@dataclass(frozen=True)
class Cluster:
    """A cluster of workers: a Dask scheduler, or processes on this machine."""

    #: Address of a Dask scheduler, as "tcp://10.0.0.7:8786"; empty for workers on this machine
    scheduler: str = ""
    #: Number of workers on this machine
    workers: int = 0

    @classmethod
    def of(cls, scheduler: str | None, cluster: str | None) -> Cluster | None:
        """Return the cluster that two options state; None if neither does.

        >>> Cluster.of(None, "local:2")
        Cluster(scheduler='', workers=2)
        """
        if scheduler is not None and cluster is not None:
            raise InputError("--scheduler and --cluster are both given; one is needed")
        if scheduler is not None:
            if not re.fullmatch(r"(tcp|tls|ws|wss)://[^\s/]+:[0-9]{1,5}", scheduler):
                raise InputError(
                    f"scheduler is {scheduler!r}; an address such as tcp://10.0.0.7:8786 is needed"
                )
            return cls(scheduler)
        if cluster is None:
            return None
        match = re.fullmatch(r"local:([0-9]{1,3})", cluster)
        if not match or not 1 <= int(match[1]) <= _MOST_WORKERS:
            raise InputError(f"cluster is {cluster!r}; local:N with N from 1 to {_MOST_WORKERS} is needed")
        return cls(workers=int(match[1]))


def on_cluster(
    work: Callable[[Any], Any],
    cases: Mapping[str, Any],
    cluster: Cluster,
    files: Bundle | None = None,
) -> Iterator[tuple[str, Any]]:
    """Run cases on a cluster, and yield each result when its case ends."""
    distributed = _dask()
    run = uuid.uuid4().hex  # results of an earlier run are not taken for those of this one
    lost = (OSError, TimeoutError, distributed.comm.CommClosedError, distributed.CancelledError)
    # Workers that this process starts have its own code.
    digest, waiting = cache.generator_digest() if cluster.scheduler else "", iter(cases)
    with _client(distributed, cluster) as client:
        finished = distributed.as_completed(loop=client.loop)
        names: dict[Any, tuple[str, int]] = {}

        def give(name: str, times: int) -> None:
            key = f"{run}-{name}-{times}"
            future = client.submit(_remote, work, cases[name], digest, files, key=key, pure=False)
            names[future] = name, times
            finished.add(future)

        try:
            workers = max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
            for name in islice(waiting, workers * _AHEAD):
                give(name, 0)
            for future in finished:
                name, times = names.pop(future)
                try:
                    result = future.result()
                except distributed.KilledWorker:
                    if times >= _AGAIN:
                        raise StrapgenError(f"case {name} ends every worker; it needs more memory") from None
                    give(name, times + 1)
                    continue
                yield name, result
                for following in islice(waiting, 1):
                    give(following, 0)
        except lost:
            where = f"the scheduler at {cluster.scheduler}" if cluster.scheduler else "the scheduler"
            raise StrapgenError(f"{where} is gone; its results so far are not lost") from None


def _dask() -> Any:
    """Return the module of Dask."""
    try:
        import distributed
    except ImportError:
        raise MissingExtraError("clusters need Dask: pip install 'strapgen[cluster]'") from None
    return distributed


@contextmanager
def _client(distributed: Any, cluster: Cluster) -> Iterator[Any]:
    """Connect to a scheduler, or start one with workers on this machine."""
    import dask

    for name in ("distributed", "tornado.application"):  # what they would say, one line says here
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    quiet = {"distributed.comm.timeouts.connect": f"{_PATIENCE_S}s"}
    with dask.config.set(quiet):
        started = None
        try:
            if not cluster.scheduler:
                started = distributed.LocalCluster(
                    n_workers=cluster.workers, threads_per_worker=1, dashboard_address=None, silence_logs=50
                )
            client = distributed.Client(
                started or cluster.scheduler, timeout=_PATIENCE_S, set_as_default=False
            )
        except (OSError, TimeoutError, ValueError) as error:
            if started is not None:
                started.close()
            where = cluster.scheduler or "this machine"
            raise StrapgenError(f"no scheduler answers at {where} ({type(error).__name__})") from None
        try:
            client.wait_for_workers(1, timeout=_PATIENCE_S)
        except TimeoutError:
            client.close(timeout=2)
            raise StrapgenError(f"the scheduler at {cluster.scheduler} has no workers") from None
        try:
            yield client
        finally:
            client.close(timeout=2)
            if started is not None:
                started.close(timeout=10)


def _remote(work: Callable[[Any], Any], case: Any, digest: str, files: Bundle | None) -> Any:
    """Run a case in a worker."""
    if digest and cache.generator_digest() != digest:
        raise StrapgenError(
            "a worker has another version of strapgen; the same one is needed on all machines"
        )
    with _one_at_a_time:
        return work(case if files is None else case.moved(files.folder, _place(files.contents)))


def _place(contents: Mapping[str, bytes]) -> Path:
    """Return the folder that holds files in this process, as long as it lives."""
    digest = cache.digest([text for pair in sorted(contents.items()) for text in pair])
    if digest not in _folders:
        _folders[digest] = TemporaryDirectory(prefix="strapgen-")
        for name, content in contents.items():
            path = Path(_folders[digest].name) / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
    return Path(_folders[digest].name)
