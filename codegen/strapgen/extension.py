"""Compiles cffi extensions, in a process of its own that serves one after the other.

Run as ``python -P extension.py``. Every line of standard input is a JSON object: the module's ``name``, the
declarations ``cdef``, the ``header`` of its C text, the C ``sources``, ``libraries`` and ``flags``, the ``folder`` to
work in and the ``environment``. For every line one is printed: an object with the ``path`` of the compiled module, or
null, and what was ``said``. What setuptools and the compiler do to environment, folder and output stays in this
process, and they are imported once.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import traceback
from typing import Any


def main() -> None:
    """Compile what standard input describes, until it ends."""
    answers = os.fdopen(os.dup(1), "w")
    for line in sys.stdin:
        wanted = json.loads(line)
        os.environ.clear()
        os.environ.update(wanted["environment"])
        with tempfile.TemporaryFile("w+", errors="replace") as said:
            for stream in (1, 2):
                os.dup2(said.fileno(), stream)
            path = None
            try:
                path = _compiled(wanted)
            except BaseException:  # setuptools raises SystemExit too
                traceback.print_exc()
            sys.stdout.flush()
            sys.stderr.flush()
            said.seek(0)
            print(json.dumps({"path": path, "said": said.read()}), file=answers, flush=True)


def _compiled(wanted: dict[str, Any]) -> str:
    from cffi import FFI

    ffi = FFI()
    ffi.cdef(wanted["cdef"])
    ffi.set_source(
        wanted["name"],
        wanted["header"],
        sources=wanted["sources"],
        include_dirs=[wanted["folder"]],
        extra_compile_args=wanted["flags"],
        libraries=wanted["libraries"],
    )
    return str(ffi.compile(tmpdir=wanted["folder"]))


if __name__ == "__main__":
    main()
