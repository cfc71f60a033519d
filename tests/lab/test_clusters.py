"""Clusters: the same results as here, whatever is killed on the way."""

import json
import os
import random
import subprocess
import sys
import time
from fractions import Fraction
from pathlib import Path

import pytest
from commands import run

from strapgen.ir.exceptions import InputError, StrapgenError
from strapgen.lab import parallel_cases
from strapgen.lab.parallel_cases import Bundle, Cluster, side_by_side
from strapgen.storage import cache

BRIEFS = Path(__file__).resolve().parents[2] / "examples" / "briefs"
METHODS = "rk1,rk2:1,rk4:2,magnus4:2,coning-compressed:1+1"
STUDIES = {
    "frontier": ["frontier", "--method", METHODS, "--duration", "1"],
    "design": ["design", str(BRIEFS / "ahrs.toml"), "--method", METHODS],
    "monte-carlo": ["study", "monte-carlo", "euler", "--runs", "2500", "--length", "3000"],
}


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
def test_a_cluster_that_cannot_be_is_refused(scheduler, cluster, said):
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
    placed = parallel_cases._placed(bundle.contents)
    assert parallel_cases._placed(bundle.contents) == placed
    again = Path(parallel_cases.moved(str(files[1]), bundle.folder, placed))
    assert again.read_text() == "log.csv" and again.parent == placed
    assert Bundle.of([]) is None
    with pytest.raises(InputError, match="cannot be read"):
        Bundle.of([tmp_path / "none.toml"])


def test_a_worker_with_another_version_refuses(monkeypatch):
    assert parallel_cases._remote(Fraction, "1/3", cache.generator_digest(), None) == Fraction(1, 3)
    with pytest.raises(StrapgenError, match="another version of strapgen"):
        parallel_cases._remote(Fraction, "1/3", "0" * 24, None)


def test_a_scheduler_that_is_not_there_is_told(monkeypatch):
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
def test_a_brief_is_answered_by_workers_that_do_not_have_its_files(capsys):
    pytest.importorskip("distributed")
    words = ["design", str(BRIEFS / "ins-1.toml"), "--method", "rk4:2,coning-compressed:4"]
    command = [sys.executable, "-m", "strapgen", *words, "--cluster", "local:1", "--format", "json"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.stdout == here(words, capsys), done.stderr
