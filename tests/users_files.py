"""Files of users, for the tests: a step whose title tells what was imported for it."""

from __future__ import annotations

from pathlib import Path

#: A step whose title tells what was imported for it; the first lines are the test's.
STEP = """{beginning}
from fractions import Fraction
from strapgen.ir.kernel_info import AttitudeStep
from strapgen.kernel.kernel import KernelBuilder
from strapgen.ir.signals import Signal

def algorithm():
    {inside}
    build = KernelBuilder()
    state = build.input(Signal.matrix("state", "C"))
    build.input(Signal("increments", (1, 3), ("d_x", "d_y", "d_z"), unit="rad"))
    build.output(Signal.matrix("next", "next"), state)
    step = AttitudeStep(None, None, None, (Fraction(0),) * 9)
    return build.kernel("mine", str({title}), "this test", attitude_step=step)
"""


def written(path: Path, beginning: str = "", title: str = "WORD", inside: str = "pass") -> str:
    """Write a step to a file and return its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(STEP.format(beginning=beginning, title=title, inside=inside))
    return str(path)


def beside(path: str, **modules: str) -> None:
    """Write modules beside a file."""
    for name, text in modules.items():
        (Path(path).parent / f"{name}.py").write_text(text)
