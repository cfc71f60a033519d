"""The process that compiles cffi modules, see ``worker.py``: it is started when it is needed, and then stays."""

from __future__ import annotations

import atexit
import json
import os
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

from strapgen.ir.exceptions import CompilerError


class CompilingProcess:
    """A process that compiles one request after another until this process ends."""

    def __init__(self) -> None:
        self._owner = os.getpid()
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(Path(__file__).with_name("compiler_worker.py"))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        atexit.register(self.stop)

    @property
    def serves(self) -> bool:
        """Whether it runs and this process started it; a fork must not share its pipes."""
        return self._owner == os.getpid() and self._process.poll() is None

    def ask(self, request: dict[str, Any]) -> dict[str, Any]:
        """Send a request and return the answer; after an interruption or a failure the process is stopped."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            print(json.dumps(request), file=self._process.stdin, flush=True)
            answer: dict[str, Any] = json.loads(self._process.stdout.readline())
        except BaseException as error:
            self.stop()
            if isinstance(error, (OSError, ValueError)):
                raise CompilerError("the process that compiles has ended before it was done") from None
            raise
        return answer

    def stop(self) -> None:
        """End the process."""
        atexit.unregister(self.stop)
        if self._owner == os.getpid():
            self._process.kill()
            self._process.communicate()


_running: list[CompilingProcess] = []
one_at_a_time = threading.Lock()


def compiling_process() -> CompilingProcess:
    """Return the process that compiles; start one if none runs."""
    if not _running or not _running[0].serves:
        _running[:] = [CompilingProcess()]
    return _running[0]
