"""Compiles cffi extensions one after another, in a separate process.

Run as ``python -P worker.py``. Every line of standard input is a JSON object: the module's ``name``, the
declarations ``cdef``, the ``header`` of its C text, the C ``sources``, ``libraries`` and ``flags``, the ``folder`` to
work in and the ``environment``. For every line one is printed: an object with the ``path`` of the compiled module, or
null, what was ``said``, and the ``failure``. What setuptools and the compiler do to environment, folder and output
stays in this process, and they are imported once.
"""

from __future__ import annotations

import importlib.metadata
import json
import os
import sys
import tempfile
from functools import cache
from typing import Any


def main() -> None:
    """Answer the requests on standard input until it ends."""
    # setuptools looks through all installed packages whenever it compiles; they stay the same while this process runs
    importlib.metadata.entry_points = cache(importlib.metadata.entry_points)  # type: ignore[assignment]
    answers = os.fdopen(os.dup(1), "w")
    for line in sys.stdin:
        request = json.loads(line)
        os.environ.clear()
        os.environ.update(request["environment"])
        with tempfile.TemporaryFile("w+", errors="replace") as said:
            for stream in (1, 2):
                os.dup2(said.fileno(), stream)
            path, failure = None, ""
            try:
                path = _compiled(request)
            except BaseException as error:  # setuptools raises SystemExit too
                failure = f"{type(error).__name__}: {error}"
            sys.stdout.flush()
            sys.stderr.flush()
            said.seek(0)
            print(
                json.dumps({"path": path, "said": said.read(), "failure": failure}), file=answers, flush=True
            )


def _compiled(request: dict[str, Any]) -> str:
    from cffi import FFI

    ffi = FFI()
    ffi.cdef(request["cdef"])
    ffi.set_source(
        request["name"],
        request["header"],
        sources=request["sources"],
        include_dirs=[request["folder"]],
        extra_compile_args=request["flags"],
        libraries=request["libraries"],
    )
    return str(ffi.compile(tmpdir=request["folder"]))


if __name__ == "__main__":
    main()
