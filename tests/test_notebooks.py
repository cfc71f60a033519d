"""The notebooks of the examples run from top to bottom, and what stands in them is what they return."""

from __future__ import annotations

import json
import re
from pathlib import Path

import notebooks
import pytest

#: Most characters of a file, and lines of one output.
LARGEST, MOST_LINES = 10_000, 24
NAMES = {"from-gyro-to-firmware", "truncation-error", "which-word-length"}


def test_there_are_three_notebooks_and_a_page_names_them():
    assert {path.stem for path in notebooks.NOTEBOOKS} == NAMES
    page = (notebooks.FOLDER.parents[1] / "docs" / "python-api.md").read_text()
    assert {name for name in NAMES if f"../examples/notebooks/{name}.ipynb" in page} == NAMES


@pytest.mark.parametrize("path", notebooks.NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_small_and_whole(path: Path):
    notebook = json.loads(path.read_text())
    assert len(path.read_text()) < LARGEST
    assert notebook["nbformat"] == 4 and notebook["cells"][0]["cell_type"] == "markdown"
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            for output in cell["outputs"]:
                data = output.get("data", {"text/plain": output.get("text")})
                assert {*data} <= {"text/plain", "text/latex"}
                assert all(len(lines) <= MOST_LINES for lines in data.values())
            # What a reader copies needs the package alone, as all examples.
            assert re.findall(r"(?:from|import) strapgen\.", "".join(cell["source"])) == []


@pytest.mark.parametrize("path", notebooks.NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs_with_its_stored_output(path: Path):
    notebook = json.loads(path.read_text())
    stored = [cell["outputs"] for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert notebooks.executed(notebook) == stored


def test_another_result_is_seen():
    cell = {"cell_type": "code", "source": ["x = 2\n", "print(x)\n", "x + 1"]}
    (outputs,) = notebooks.executed({"cells": [{"cell_type": "markdown", "source": ["x"]}, cell]})
    assert [output.get("text", output.get("data")) for output in outputs] == [["2\n"], {"text/plain": ["3"]}]
