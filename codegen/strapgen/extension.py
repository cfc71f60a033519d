"""Compiles one cffi extension, as a process of its own.

Run as ``python -P extension.py`` with a JSON object on standard input: the module's ``name``, the declarations
``cdef``, the ``header`` to include, the C ``sources`` and the ``flags``, with ``folder`` to work in. Prints the path of
the compiled module. What setuptools and the compiler do to environment and output stays in this process.
"""

from __future__ import annotations

import json
import sys


def main() -> None:
    """Compile what standard input describes."""
    from cffi import FFI

    wanted = json.load(sys.stdin)
    ffi = FFI()
    ffi.cdef(wanted["cdef"])
    ffi.set_source(
        wanted["name"],
        f'#include "{wanted["header"]}"',
        sources=wanted["sources"],
        include_dirs=[wanted["folder"]],
        extra_compile_args=wanted["flags"],
        libraries=wanted["libraries"],
    )
    print(ffi.compile(tmpdir=wanted["folder"]))


if __name__ == "__main__":
    main()
