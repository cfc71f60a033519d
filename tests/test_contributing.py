"""CONTRIBUTING is followed: its files are written into a copy of the package, and its commands run there."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from strapgen.run import compiler

ROOT = Path(__file__).resolve().parents[1]
#: The sections "Add a ..." by what is added.
SECTIONS = {
    title: text
    for title, text in re.findall(
        r"^## Add a (.*?)\n(.*?)(?=^## )",
        (ROOT / "CONTRIBUTING.md").read_text(),
        flags=re.MULTILINE | re.DOTALL,
    )
}
#: A file to write, or what to add to a table of one.
_PART = re.compile(
    r"(?:Write|Add to `(\w+)`\s+of)\s+`([^`]+)`:\n\n```\w+\n(.*?)^```", re.MULTILINE | re.DOTALL
)
_COMMAND = re.compile(r"^    strapgen (.*)$", re.MULTILINE)


def test_every_kind_has_a_section():
    assert {*SECTIONS} == {"method", "kernel", "target", "back end", "motion", "command", "study"}
    fences = (ROOT / "CONTRIBUTING.md").read_text().count("\n```") // 2
    assert sum(len(_PART.findall(text)) for text in SECTIONS.values()) == fences


@pytest.mark.parametrize("kind", SECTIONS)
def test_additions_touch_one_folder(kind):
    paths = [Path(path) for _, path, _ in _PART.findall(SECTIONS[kind])]
    assert len({path.parent for path in paths}) == 1
    assert all((ROOT / path).exists() == bool(table) for table, path, _ in _PART.findall(SECTIONS[kind]))


@pytest.fixture
def followed(tmp_path):
    """Follows a section in a copy of the package, and returns what its commands print."""
    shutil.copytree(
        ROOT / "codegen",
        tmp_path / "codegen",
        copy_function=os.link,
        ignore=shutil.ignore_patterns("__pycache__"),
    )
    for name in ("templates", "generated", "pyproject.toml"):
        (tmp_path / name).symlink_to(ROOT / name)

    def follow(text: str) -> list[str]:
        for table, name, block in _PART.findall(text):
            path = tmp_path / name
            path.parent.mkdir(exist_ok=True)
            if table:
                before = path.read_text()
                (head,) = re.findall(rf"^{table} = \{{\n", before, flags=re.MULTILINE)
                block = before.replace(head, head + block)
                path.unlink()  # it is a link to the original
            path.write_text(block)
        printed = []
        for command in _COMMAND.findall(text):
            done = subprocess.run(
                [sys.executable, "-m", "strapgen", *shlex.split(command)],
                cwd=tmp_path,
                env={**os.environ, "PYTHONPATH": str(tmp_path / "codegen")},
                capture_output=True,
                text=True,
            )
            assert done.returncode == 0, done.stderr
            printed.append(done.stdout)
        return printed

    return follow


def test_the_command_runs(followed):
    assert followed(SECTIONS["command"]) == ["euler-rk4-2: 37 multiply, 31 add\n"]


def test_the_study_runs(followed):
    printed, schema = map(json.loads, followed(SECTIONS["study"]))
    assert printed == {
        "schema": "strapgen/load/1",
        "kernel": "euler-rk4-2",
        "multiply_per_s": 37 * 400,
        "add_per_s": 31 * 400,
    }
    assert schema["properties"]["add_per_s"]["unit"] == "1/s"


def test_the_kernel_is_generated(followed, tmp_path):
    """In Q14, as 16 bits hold them, the parameters 1, 5, 7, 5 have the inverse -1, -5, -7, 5."""
    followed(SECTIONS["kernel"])
    (tmp_path / "main.c").write_text(
        '#include "firmware/euler_inverse_w16.h"\n#include <stdio.h>\nint main(void) {\n'
        "    int16_t state[4] = {1, 5, 7, 5}, inverse[4];\n    int status = euler_inverse_w16(state, inverse);\n"
        '    printf("%d: %d %d %d %d", status, inverse[0], inverse[1], inverse[2], inverse[3]);\n}\n'
    )
    build = [compiler.C.path(), "-o", "main", "main.c", "firmware/euler_inverse_w16.c"]
    subprocess.run(build, cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True)
    assert done.stdout == "0: -1 -5 -7 5"


def test_the_target_prints(followed, tmp_path):
    """The statements normalize 1, 2, 2, 4, whose length is 5."""
    followed(SECTIONS["target"])
    scope: dict[str, Any] = {"sqrt": lambda x: x**0.5, "e_x": 1, "e_y": 2, "e_z": 2, "e_s": 4}
    for statement in re.findall(
        r"^(.*?)[$;]$", (tmp_path / "out" / "euler_normalize.mac").read_text(), re.MULTILINE
    ):
        name, _, value = statement.partition(": ")
        scope[name] = eval(value, {}, scope)
    assert scope[name] == pytest.approx([0.2, 0.4, 0.4, 0.8], abs=1e-15)


@pytest.mark.long
def test_the_method_has_its_order(followed):
    tableau, converged = followed(SECTIONS["method"])
    assert re.search(r"^classical order +3$", tableau, re.MULTILINE)
    orders = [float(order) for order in re.findall(r" (\d\.\d+)$", converged, re.MULTILINE)]
    assert orders and orders[-1] == pytest.approx(3, abs=0.1)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["motion", "back end"])
def test_the_motion_and_the_back_end_run(kind, followed):
    (printed,) = followed(SECTIONS[kind])
    assert "euler" in printed and "20" in printed
