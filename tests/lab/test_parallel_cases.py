"""Studies whose results stay in a file: side by side, killed, resumed, and never mixed with those of another study."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from fractions import Fraction
from pathlib import Path

import pytest
from commands import run

from strapgen.ir.exceptions import InputError, StrapgenError
from strapgen.lab import parallel_cases
from strapgen.lab.parallel_cases import Bundle, Cluster, resume, side_by_side
from strapgen.storage import cache

CASES = {f"case {k}": k for k in range(7)}
IDENTITY = {"version": "1", "rate": 100}

STUDY = """
import sys, time
from pathlib import Path
from strapgen.lab.parallel_cases import resume

def wait(number):
    # The first cases come at once; the others wait for a file that the test writes after it has killed this process.
    while number >= 3 and not Path(sys.argv[2]).exists():
        time.sleep(0.01)
    return number

if __name__ == "__main__":
    for name, result in resume(wait, {str(k): k for k in range(6)}, sys.argv[1], {"version": "1"}, 2):
        print(name, flush=True)
"""

BRIEFS = Path(__file__).resolve().parents[2] / "examples" / "briefs"
METHODS = "rk1,rk2:1,rk4:2,magnus4:2,coning-compressed:1+1"
STUDIES = {
    "frontier": ["frontier", "--method", METHODS, "--duration", "1"],
    "design": ["design", str(BRIEFS / "ahrs.toml"), "--method", METHODS],
    "monte-carlo": ["study", "monte-carlo", "euler", "--runs", "2500", "--length", "3000"],
}


def square(number: int) -> int:
    return number * number


def refuse_3(number: int) -> int:
    if number == 3:
        raise InputError("3 is not allowed")
    return number


def end_at_once(number: int) -> int:
    os._exit(1)


def never(number: int) -> int:
    raise AssertionError("a result that is there is not worked out again")


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_do_not_depend_on_the_number_of_processes(jobs):
    assert dict(side_by_side(square, CASES, jobs)) == {name: k * k for name, k in CASES.items()}


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_failing_case_raises_and_finished_results_stay(jobs, tmp_path):
    path = tmp_path / "results.jsonl"
    with pytest.raises(InputError, match="3 is not allowed"):
        list(resume(refuse_3, CASES, path, IDENTITY, jobs))
    kept = [json.loads(line)["case"] for line in path.read_text().splitlines()[1:]]
    assert {*kept} <= {*CASES} - {"case 3"}
    if jobs == 1:
        assert kept == ["case 0", "case 1", "case 2"]


def test_a_killed_worker_process_is_reported():
    with pytest.raises(StrapgenError, match="a process of the study was killed"):
        list(side_by_side(end_at_once, CASES, 2))


def test_stored_results_are_not_recomputed(tmp_path):
    path = tmp_path / "new" / "folder" / "results.jsonl"
    first = dict(resume(square, CASES, path, IDENTITY, 1))
    content = path.read_bytes()
    assert list(resume(never, CASES, path, IDENTITY, 2)) == list(first.items())
    assert path.read_bytes() == content
    # Some of the cases, or others beside them, belong to the same study.
    assert dict(resume(never, {"case 2": 2}, path, IDENTITY)) == {"case 2": 4}
    assert dict(resume(square, {"new": 9, "case 2": 2}, path, IDENTITY, 1)) == {"case 2": 4, "new": 81}


def test_stored_results_equal_fresh_ones(tmp_path):
    values = {"tuple": (1, 2), "number": 0.1, "none": None}
    path = tmp_path / "results.jsonl"
    first = dict(resume(dict, {"one": values}, path, IDENTITY))
    assert first == dict(resume(never, {"one": values}, path, IDENTITY))
    assert first["one"] == {"tuple": [1, 2], "number": 0.1, "none": None}


@pytest.mark.parametrize("end", [-1, -5, -20, -30, -50, -10_000, 1, 10, 30])
def test_a_truncated_file_resumes_after_its_last_complete_line(end, tmp_path):
    path = tmp_path / "results.jsonl"
    whole = dict(resume(square, CASES, path, IDENTITY, 1))
    content = path.read_bytes()
    path.write_bytes(content[:end])
    assert dict(resume(square, CASES, path, IDENTITY, 1)) == whole
    assert path.read_bytes() == content


@pytest.mark.parametrize(
    ("identity", "words"),
    [
        ({"version": "2", "rate": 100}, 'holds another study: version is "1" there and "2" here'),
        ({"version": "1", "rate": 200}, "holds another study: rate is 100 there and 200 here"),
        ({"version": "1"}, "holds another study: rate is 100 there and null here"),
        (
            {**IDENTITY, "band": list(range(99))},
            r"holds another study: band is null there and \[0, 1, 2.*\.\.\. here",
        ),
    ],
)
def test_results_of_another_study_are_refused_unchanged(identity, words, tmp_path):
    path = tmp_path / "results.jsonl"
    list(resume(square, CASES, path, IDENTITY, 1))
    torn = path.read_bytes()[:-3]
    path.write_bytes(torn)
    with pytest.raises(InputError, match=words) as refusal:
        list(resume(square, CASES, path, identity, 1))
    assert "\n" not in str(refusal.value)
    assert path.read_bytes() == torn


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"hello", "holds no results of a study"),
        (b"hello\n", "holds no results of a study"),
        (b"[1, 2]\n", "holds no results of a study"),
        (b'{"study": 3}\n', "holds no results of a study"),
        (b"[" * 100_000 + b"\n", "holds no results of a study"),
        (
            b'{"study": {"version": "1", "rate": 100}}\n{"case": 3, "result": 1}\n',
            "line 2 of .* is no result",
        ),
        (b'{"study": {"version": "1", "rate": 100}}\n\xff\n', "line 2 of .* is no result"),
    ],
)
def test_other_files_are_refused_unchanged(content, words, tmp_path):
    path = tmp_path / "notes.txt"
    path.write_bytes(content)
    with pytest.raises(InputError, match=words):
        list(resume(square, CASES, path, IDENTITY, 1))
    assert path.read_bytes() == content


def test_unwritable_paths_are_refused(tmp_path):
    (tmp_path / "file").write_text("")
    for path in (tmp_path, tmp_path / "file" / "results.jsonl"):
        with pytest.raises(InputError, match="cannot be written"):
            list(resume(square, CASES, path, IDENTITY, 1))


@pytest.mark.posix
def test_devices_are_refused():
    with pytest.raises(InputError, match="/dev/null is no ordinary file"):
        list(resume(square, CASES, "/dev/null", IDENTITY, 1))


@pytest.mark.posix
def test_a_killed_study_resumes_and_leaves_no_process(tmp_path):
    script, path, go = tmp_path / "study.py", tmp_path / "results.jsonl", tmp_path / "go"
    script.write_text(STUDY)
    command = [sys.executable, str(script), str(path), str(go)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    before = {process.stdout.readline().strip() for _ in range(3)}
    # While it runs, nobody else writes the file.
    second = subprocess.run(command, capture_output=True, text=True)
    assert "is being written by another process" in second.stderr.splitlines()[-1]
    os.kill(process.pid, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert process.stdout.read() == "", (
        "workers end with it: the pipe ends when the last process that holds it does"
    )
    process.stdout.close()
    assert before == {"0", "1", "2"}
    lines = path.read_bytes().splitlines()
    assert [json.loads(line)["case"] for line in lines[1:]] and len(lines) == 4
    with path.open("ab") as file:  # as if it had been killed while it wrote
        file.write(b'{"case": "4", "resu')
    go.touch()
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert sorted(done.stdout.split()) == [str(k) for k in range(6)]
    assert path.read_bytes().splitlines()[:4] == lines
    results = dict(json.loads(line).values() for line in path.read_bytes().splitlines()[1:])
    assert results == {str(k): k for k in range(6)}


@pytest.mark.parametrize(
    ("scheduler", "cluster", "said"),
    [
        ("tcp://a:1", "local:2", "--scheduler and --cluster are both given; one is needed"),
        ("10.0.0.7:8786", None, "an address such as tcp://10.0.0.7:8786 is needed"),
        ("tcp://10.0.0.7", None, "an address such as tcp://10.0.0.7:8786 is needed"),
        (None, "local:0", "local:N with N from 1 to 256 is needed"),
        (None, "here", "local:N with N from 1 to 256 is needed"),
    ],
)
def test_invalid_clusters_are_refused(scheduler, cluster, said):
    with pytest.raises(InputError, match=said):
        Cluster.of(scheduler, cluster)
    assert Cluster.of(None, None) is None


def test_files_move_with_their_folders(tmp_path):
    for name in ("a/brief.toml", "log.csv"):
        path = tmp_path / "here" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
    files = [tmp_path / "here" / name for name in ("a/brief.toml", "a/../log.csv")]
    bundle = Bundle.of(files)
    assert bundle == Bundle(tmp_path / "here", {"a/brief.toml": b"a/brief.toml", "log.csv": b"log.csv"})
    placed = parallel_cases._place(bundle.contents)
    assert parallel_cases._place(bundle.contents) == placed
    again = Path(parallel_cases.moved(str(files[1]), bundle.folder, placed))
    assert again.read_text() == "log.csv" and again.parent == placed
    assert Bundle.of([]) is None
    with pytest.raises(InputError, match="cannot be read"):
        Bundle.of([tmp_path / "none.toml"])


def test_a_worker_of_another_version_refuses(monkeypatch):
    assert parallel_cases._remote(Fraction, "1/3", cache.generator_digest(), None) == Fraction(1, 3)
    with pytest.raises(StrapgenError, match="another version of strapgen"):
        parallel_cases._remote(Fraction, "1/3", "0" * 24, None)


def test_a_missing_scheduler_is_reported(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(parallel_cases, "_PATIENCE_S", 1)
    with pytest.raises(StrapgenError, match=r"no scheduler answers at tcp://127\.0\.0\.1:9"):
        list(side_by_side(Fraction, {"a": "1"}, cluster=Cluster("tcp://127.0.0.1:9")))


def begin(words, output, **environment):
    """Begin ``strapgen ...``, or ``scheduler ...`` or ``worker ...`` of Dask; what it prints is in two files."""
    module = "strapgen" if words[0] == "strapgen" else f"distributed.cli.dask_{words[0]}"
    with Path(f"{output}.out").open("w") as out, Path(f"{output}.err").open("w") as err:
        command = [sys.executable, "-m", module, *words[1:]]
        return subprocess.Popen(command, stdout=out, stderr=err, env=os.environ | environment)


class Machines:
    """A scheduler and two workers, each a process with a cache of its own."""

    def __init__(self, folder):
        self.folder, self.port, self.processes = (
            folder,
            random.Random(os.getpid()).randrange(20000, 60000),
            {},
        )
        for name in ("scheduler", "worker-1", "worker-2"):
            self.begin(name)

    @property
    def address(self):
        return f"tcp://127.0.0.1:{self.port}"

    def begin(self, name):
        words = ["scheduler", "--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard"]
        if name != "scheduler":
            words = ["worker", self.address, "--nthreads", "1", "--no-dashboard", "--no-nanny"]
            words += ["--local-directory", str(self.folder / name), "--death-timeout", "60"]
        place = str(self.folder / f"cache-{name}")
        self.processes[name] = begin(words, self.folder / name, STRAPGEN_CACHE_DIR=place)

    def kill(self, name):
        self.processes[name].kill()
        self.processes[name].wait()
        for ended in [name] if name != "scheduler" else list(self.processes):  # without it, workers end
            self.processes[ended].kill()
            self.processes[ended].wait()
            self.begin(ended)

    def end(self):
        for process in self.processes.values():
            process.kill()
            process.wait()


@pytest.fixture
def machines(tmp_path):
    pytest.importorskip("distributed")
    several = Machines(tmp_path)
    yield several
    several.end()


def client(words, output):
    return begin(["strapgen", *words, "--format", "json"], output)


def here(words, capsys):
    """Return what a command says with one process."""
    run([*words, "--format", "json", "--jobs", "1"])
    return capsys.readouterr().out


@pytest.mark.long
def test_studies_are_completed_whatever_is_killed(tmp_path, machines, capsys):
    """What is killed knows nothing of the study: every study and every kill once, on the same machines."""
    for study, killed in zip(STUDIES, ["scheduler", "worker-1", "client"], strict=True):
        results = tmp_path / f"{study}.jsonl"
        words = [*STUDIES[study], "--scheduler", machines.address, "--results", str(results)]
        first = client(words, tmp_path / "first")
        deadline = time.monotonic() + 90
        while time.monotonic() < deadline and (not results.exists() or results.read_bytes().count(b"\n") < 2):
            time.sleep(0.02)
        assert results.read_bytes().count(b"\n") >= 2, study  # it is on its way
        if killed == "client":
            first.kill()
        else:
            machines.kill(killed)
        first.wait()
        for _ in range(5):
            again = client(words, tmp_path / "again")
            status = again.wait()
            there, said = ((tmp_path / f"again.{name}").read_text() for name in ("out", "err"))
            if status == 0:
                break
            assert said.startswith("strapgen: ") and "Traceback" not in said, study
        outcomes = [json.loads(text) for text in (there, here(STUDIES[study], capsys))]
        if study == "monte-carlo":  # the time that it takes is its own each time
            outcomes = [
                {key: one[key] for key in one if key not in ("seconds", "sweep_hours")} for one in outcomes
            ]
        assert outcomes[0] == outcomes[1], study


@pytest.mark.long
def test_workers_receive_the_files_of_a_brief(capsys):
    pytest.importorskip("distributed")
    words = ["design", str(BRIEFS / "ins-1.toml"), "--method", "rk4:2,coning-compressed:4"]
    command = [sys.executable, "-m", "strapgen", *words, "--cluster", "local:1", "--format", "json"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.stdout == here(words, capsys), done.stderr
