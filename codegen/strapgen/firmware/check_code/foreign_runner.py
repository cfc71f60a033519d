"""Runs a compiled function of a user, in a process of its own that may crash.

Run as ``python -P foreign_runner.py MODULE FOLDER CALLS``. The folder holds the doubles of ``identity`` and ``input``;
the results of all calls are written to ``output`` there, and what the calls did wrong to ``flags``, last. If the module
cannot be loaded, ``refused`` says why.
"""

from __future__ import annotations

import importlib.machinery
import importlib.util
import sys
from pathlib import Path


def main(module_path: str, folder_name: str, calls: int) -> None:
    """Call the function and write its results."""
    loader = importlib.machinery.ExtensionFileLoader("strapgen_foreign", module_path)
    spec = importlib.util.spec_from_file_location("strapgen_foreign", module_path, loader=loader)
    assert spec is not None
    folder = Path(folder_name)
    try:
        module = importlib.util.module_from_spec(spec)
        loader.exec_module(module)
    except ImportError as error:  # a function that the file calls is defined nowhere
        reason = str(error).rpartition(module_path)[2].strip(": ")
        text = (
            f"the function cannot be linked: {reason}; include the file that defines it in the one to check"
        )
        (folder / "refused").write_text(text, encoding="utf-8", newline="\n")
        return
    identity, rows = (folder / "identity").read_bytes(), (folder / "input").read_bytes()
    output = bytearray(calls * len(identity))
    flags = module.lib.strapgen_foreign_run(
        calls,
        module.ffi.from_buffer("double[]", identity),
        module.ffi.from_buffer("double[]", rows),
        module.ffi.from_buffer("double[]", output, require_writable=True),
    )
    (folder / "output").write_bytes(output)
    (folder / "flags").write_text(str(flags), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
