"""The example of a flight on a processor: its states are certified, and a flipped bit is found."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from c_programs import needed

pytest.importorskip("flint")

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "certified_flight"


@pytest.mark.long
def test_a_flight_on_a_processor_is_certified(tmp_path):
    needed("make", "arm-none-eabi-gcc", "qemu-system-arm")
    folder = shutil.copytree(EXAMPLE, tmp_path / "flight")
    program = tmp_path / "bin" / "strapgen"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m strapgen "$@"\n')
    program.chmod(0o755)
    environment = os.environ | {
        "PATH": f"{program.parent}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(EXAMPLE.parents[1] / "codegen"),
    }

    def make(*words):
        command = ["make", f"PYTHON={sys.executable}", *words]
        return subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, check=False
        )

    honest = make()
    assert honest.returncode == 0, honest.stderr
    found = re.search(r"rounding on this run: (\S+) rad \+- (\S+) \(header: (\S+)\)", honest.stdout)
    rounding, radius, header = map(float, found.groups())
    assert radius < 1e-15 < rounding < header / 10
    assert "fault" not in honest.stdout
    flipped = make("flipped")
    assert flipped.returncode
    assert "a fault from 7 s to 8 s" in flipped.stdout
