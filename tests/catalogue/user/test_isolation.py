"""A user's file runs as if in a process of its own: what lies beside one file is nothing to another."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from types import ModuleType

import pytest
from users_files import beside, written

import strapgen
from strapgen.ir.exceptions import InputError


def title(path: str) -> str:
    return strapgen.derive(path).title


@pytest.fixture
def folders(tmp_path: Path) -> list[str]:
    """Return files of one name in two folders, each with a helper of its own."""
    files = []
    for word in ("first", "second"):
        files.append(written(tmp_path / word / "own.py", "from helper import WORD"))
        beside(files[-1], helper=f"WORD = {word!r}\n")
    return files


def test_dataclasses_find_their_module(tmp_path):
    beginning = "from __future__ import annotations\nfrom dataclasses import dataclass\nimport sys, typing\n"
    beginning += (
        "@dataclass\nclass Settings:\n    word: str = 'of a dataclass'\n    count: typing.ClassVar[int] = 3\n"
    )
    inside = "typing.get_type_hints(Settings); assert sys.modules[__name__].algorithm is algorithm"
    path = written(tmp_path / "own.py", beginning, "Settings().word", inside)
    assert title(path) == "of a dataclass"


@pytest.mark.long
@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_each_file_gets_the_helper_beside_it(folders, order):
    assert [title(folders[place]) for place in (*order, *order)] == [
        ("first", "second")[place] for place in (*order, *order)
    ]


@pytest.mark.long
def test_late_imports_are_recorded(tmp_path):
    for word in ("first", "second"):
        path = written(tmp_path / word / "own.py", inside="from parts.late import WORD")
        (tmp_path / word / "parts").mkdir()
        (tmp_path / word / "parts" / "__init__.py").write_text("from . import base\n")
        (tmp_path / word / "parts" / "base.py").write_text(f"NAME = {word!r}\n")
        (tmp_path / word / "parts" / "late.py").write_text("from .base import NAME as WORD\n")
        assert title(path) == word


def test_a_helper_of_another_file_is_not_found(folders, tmp_path):
    title(folders[0])
    path = written(tmp_path / "third" / "own.py", "from helper import WORD")
    with pytest.raises(InputError, match=r"own\.py, line 1: ModuleNotFoundError: No module named 'helper'"):
        title(path)


def test_a_helper_of_the_program_stays_and_is_not_used(folders, monkeypatch):
    program = ModuleType("helper")
    program.__file__ = str(Path(folders[1]).parent / "helper.py")
    program.WORD = "of the program"
    monkeypatch.setitem(sys.modules, "helper", program)
    assert title(folders[0]) == "first"
    assert sys.modules["helper"] is program


@pytest.mark.parametrize("fails", [False, True])
def test_nothing_is_left_behind(folders, fails):
    if fails:
        Path(folders[0]).write_text("import helper, sys\nsys.path.append('elsewhere')\n1 / 0\n")
    else:
        beside(folders[0], helper="import sys\nsys.path.append('elsewhere')\nWORD = 'first'\n")
    before = (list(sys.path), list(sys.meta_path), dict(sys.modules))
    if fails:
        with pytest.raises(InputError, match=r"own\.py, line 3: ZeroDivisionError"):
            title(folders[0])
    else:
        assert title(folders[0]) == "first"
    assert (list(sys.path), list(sys.meta_path)) == before[:2]
    assert not [name for name in sys.modules if name == "helper" or name.startswith("strapgen_user")]
    assert not [name for name in before[2] if sys.modules.get(name) is not before[2][name]]


def test_bytecode_of_an_older_source_is_not_used(folders):
    helper = Path(folders[0]).parent / "helper.py"
    assert title(folders[0]) == "first"
    changed = helper.stat()
    helper.write_text("WORD = 'later'\n")  # of the same length, and of the same time
    os.utime(helper, ns=(changed.st_atime_ns, changed.st_mtime_ns))
    assert title(folders[0]) == "later"
    assert not list(Path(folders[0]).parent.glob("__pycache__"))
