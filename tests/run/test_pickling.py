"""Back ends in other processes: copies compute the same bits, and workers end with their parent."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from languages import cases

import strapgen
from strapgen import catalogue
from strapgen.ir.exceptions import InputError
from strapgen.navigation.two_speed.two_speed_runner import TwoSpeed
from strapgen.run.backends import BACKENDS

ALGORITHMS = Path(__file__).resolve().parents[1] / "data" / "algorithms"
#: An algorithm of a user that brings its orthonormalization and its attitude.
FILE = str(ALGORITHMS / "one_name.py")


def copied(thing):
    return pickle.loads(pickle.dumps(thing))


@pytest.fixture
def increments(rng) -> np.ndarray:
    return rng.normal(scale=0.02, size=(24, 2, 3))


@pytest.mark.parametrize("name", cases(BACKENDS))
@pytest.mark.parametrize(
    ("algorithm", "orthonormalization"),
    [("euler", None), ("dcm", "dcm-orthonormalize-first-order"), (FILE, None), (FILE, "mend")],
)
def test_copy_runs_bit_for_bit_like_the_original(name, algorithm, orthonormalization, increments):
    backend = strapgen.backend(algorithm, "rk2", backend=name, orthonormalization=orthonormalization)
    copy = copied(backend)
    assert (type(copy), copy.name, copy.kernel, copy.sources) == (
        type(backend),
        backend.name,
        backend.kernel,
        backend.sources,
    )
    states = backend.propagate(increments, 1, 4)
    np.testing.assert_array_equal(copy.propagate(increments, 1, 4), states)
    np.testing.assert_array_equal(copy.orthonormalize(states[5]), backend.orthonormalize(states[5]))
    np.testing.assert_array_equal(copy.matrices(states), backend.matrices(states))
    np.testing.assert_array_equal(copied(copy).propagate(increments), backend.propagate(increments))


@pytest.mark.parametrize("name", cases(BACKENDS))
def test_a_copy_of_an_evaluator_gives_the_same(name):
    evaluator = strapgen.evaluator("euler-normalize", name)
    state = np.array([0.1, 0.5, 0.5, 0.7])
    np.testing.assert_array_equal(copied(evaluator)(state), evaluator(state))


@pytest.mark.long
@pytest.mark.parametrize("name", cases(BACKENDS))
def test_a_copy_of_an_algorithm_in_two_speeds_runs_bit_for_bit_the_same(name, rng):
    runner = TwoSpeed("euler", 2, name)
    copy = copied(runner)
    assert (copy.name, copy.loops, copy.state) == (runner.name, runner.loops, runner.state)
    angles, velocities = rng.uniform(-0.02, 0.02, (24, 3)), rng.uniform(-0.1, 0.1, (24, 3))
    for one, other in zip(
        copy.run(angles, velocities, fast_cycles=4, slow_cycles=3),
        runner.run(angles, velocities, fast_cycles=4, slow_cycles=3),
        strict=True,
    ):
        np.testing.assert_array_equal(one, other)


@pytest.mark.long
def test_a_back_end_that_was_built_by_hand_can_be_copied(increments):
    backend = strapgen.build(strapgen.generate(strapgen.lower(strapgen.derive(FILE)), "numpy"))
    np.testing.assert_array_equal(
        copied(backend).propagate(increments, 1, 4), backend.propagate(increments, 1, 4)
    )


@pytest.mark.long
def test_copy_refuses_as_the_back_end(increments):
    backend = strapgen.backend(catalogue.choose(str(ALGORITHMS / "mrp.py")))
    with pytest.raises(InputError, match="has nothing to orthonormalize its state with"):
        copied(backend).propagate(increments, 1, 4)


@pytest.mark.long
def test_a_pool_of_processes_runs_back_ends(rng):
    backends = [strapgen.backend(algorithm, backend="c") for algorithm in ("euler", FILE)]
    runs = [rng.normal(scale=0.02, size=(50, 2, 3)) for _ in range(2)]
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        histories = [list(pool.map(backend.propagate, runs)) for backend in backends]
    for backend, several in zip(backends, histories, strict=True):
        for run, history in zip(runs, several, strict=True):
            np.testing.assert_array_equal(history, backend.propagate(run))


@pytest.mark.long
def test_unpickling_needs_no_computer_algebra(tmp_path, increments):
    backend = strapgen.backend(FILE, backend="numpy")
    (tmp_path / "backend.pickle").write_bytes(pickle.dumps(backend))
    np.save(tmp_path / "increments.npy", increments)
    code = (
        "import pickle, sys; sys.modules['sympy'] = None; import numpy as np;"
        "backend = pickle.load(open('backend.pickle', 'rb'));"
        "states = backend.propagate(np.load('increments.npy'), 1, 4); backend.matrices(states);"
        "np.save('states.npy', states)"
    )
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True)
    np.testing.assert_array_equal(np.load(tmp_path / "states.npy"), backend.propagate(increments, 1, 4))


POOL = """
import os, sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from strapgen.run.processes import begin_worker, end_with_parent

if __name__ == "__main__":
    end_with_parent()
    with ProcessPoolExecutor(2, get_context(sys.argv[1]), initializer=begin_worker) as pool:
        list(pool.map(abs, range(20)))
        print(*pool._processes, flush=True)
        if sys.argv[2] == "killed":
            os.kill(os.getpid(), 9)
"""


def is_there(process: int) -> bool:
    try:
        os.kill(process, 0)
        # One that has ended may wait for somebody to ask for its status.
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except ProcessLookupError:
        return False
    except OSError:  # no such file system
        return True


@pytest.mark.posix
@pytest.mark.parametrize("start", ["fork", "spawn"])
@pytest.mark.parametrize("how", ["killed", "ended"])
def test_workers_end_with_their_parent(start, how, tmp_path):
    (tmp_path / "pool.py").write_text(POOL)
    process = subprocess.Popen(
        [sys.executable, tmp_path / "pool.py", start, how], stdout=subprocess.PIPE, text=True
    )
    workers = [int(word) for word in process.stdout.readline().split()]
    assert process.wait() == (-9 if how == "killed" else 0)
    process.stdout.close()
    for _ in range(1000):  # as long as the machine needs
        if not any(map(is_there, workers)):
            break
        time.sleep(0.02)
    assert workers and not any(map(is_there, workers))
