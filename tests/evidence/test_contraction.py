"""What a compiler makes of the C in double: with contraction it computes other numbers than the proofs are of.

gcc 12 forms a fused instruction, vfmsubadd, in spite of -ffp-contract=off where it vectorises straight-line code for
a processor that has it: the flag alone is not enough there.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from derived import program

from strapgen import pipeline
from strapgen.catalogue import choose_step

CPU = Path("/proc/cpuinfo")
pytestmark = pytest.mark.skipif(
    not shutil.which("gcc") or not CPU.exists() or " fma " not in CPU.read_text(),
    reason="gcc or a processor with fused multiply-add is missing",
)

STEP = choose_step("euler", "rk4", 2)


def results(folder: Path, inputs: list[np.ndarray], *flags: str) -> np.ndarray:
    """Return what the C computes when it is compiled with some flags."""
    sources = pipeline.compile(STEP, "c")
    for name, text in sources.step_files.items():
        (folder / name).write_text(text)
    name = sources.function.name
    command = ["gcc", "-std=c99", "-O2", *flags, "-shared", "-fPIC", "-o", f"{name}.so", f"{name}.c"]
    subprocess.run(command, cwd=folder, check=True)
    function = getattr(ctypes.CDLL(str(folder / f"{name}.so")), name)
    outputs = np.empty((len(inputs[0]), 4))
    for row, output in zip(zip(*inputs, strict=True), outputs, strict=True):
        function(*(np.ascontiguousarray(array).ctypes.data_as(ctypes.c_void_p) for array in (*row, output)))
    return outputs


def test_the_c_rounds_every_operation_of_the_program_without_contraction_and_not_with_it(tmp_path):
    rng = np.random.default_rng(5)
    inputs = [rng.uniform(-1, 1, (300, 4)), rng.uniform(-0.125, 0.125, (300, 6))]
    code = program(STEP)
    names = [name for signal in code.inputs for name in signal.elements]
    columns = dict(zip(names, np.concatenate(inputs, axis=1).T, strict=True))
    (expected,) = code.run(columns, float).values()
    folders = [tmp_path / name for name in ("off", "fast")]
    for folder in folders:
        folder.mkdir()
    off = results(folders[0], inputs, "-mfma", "-ffp-contract=off", "-fno-tree-slp-vectorize")
    fast = results(folders[1], inputs, "-mfma", "-ffp-contract=fast")
    assert np.array_equal(off, np.transpose(expected))
    assert np.mean(np.any(fast != off, axis=1)) > 0.5
