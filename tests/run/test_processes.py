"""Processes of a pool end with the one that started them."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

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
