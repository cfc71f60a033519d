"""A step as one writes it by hand from a textbook: functions and loops, no symbolic work at all."""

from __future__ import annotations

import shutil
from pathlib import Path

from generators import Case

LANGUAGE = "c"


def version() -> str:
    """Return the version of the generator."""
    return ""


def write(case: Case, folder: Path) -> None:
    """Write the step of a case into a folder."""
    source = Path(__file__).parent / "hand"
    shutil.copy(source / f"{case.algorithm}.inc", folder / "algorithm.inc")
    shutil.copy(source / "runge_kutta.inc", folder)
    (folder / "step.inc").write_text((source / f"{case.samples}.inc").read_text())
