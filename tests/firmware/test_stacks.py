"""The script that writes a table of checked sources: it has what ran, and nothing else."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "check_foreign_c"
OPTIONS = "options = '--function integrator_update --scalar first --init integrator_init'\n"


def run(file: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(EXAMPLES / "stacks.py"), str(file)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.long
def test_the_table_has_what_ran_and_which_text_was_read(tmp_path):
    text = (EXAMPLES / "wrong_sign.c").read_bytes()
    (tmp_path / "own.c").write_bytes(text)
    (tmp_path / "shim.c").write_text('#include "own.c"\n')
    (tmp_path / "long.c").write_text('#include "own.c"\n' + "int a;\n" * 10)
    entries = [
        f"name = 'own'\nversion = '7'\nsource = 'own.c'\nlines = '3-9'\n{OPTIONS}",
        f"name = 'shimmed'\nversion = '8'\nsource = 'own.c'\nshim = 'shim.c'\n{OPTIONS}",
        f"name = 'absent'\nversion = '1'\nsource = 'absent.c'\n{OPTIONS}",
        f"name = 'long'\nversion = '1'\nsource = 'own.c'\nshim = 'long.c'\n{OPTIONS}",
        "name = 'uncalled'\nversion = '1'\nsource = 'own.c'\noptions = '--function none'\n",
    ]
    (tmp_path / "list.toml").write_text("".join(f"[[stack]]\n{entry}" for entry in entries))
    done = run(tmp_path / "list.toml")
    head, rule, own, shimmed = done.stdout.splitlines()
    assert head.startswith("| stack | version | verdict |") and set(rule) == set("| -")
    digest = hashlib.sha256(text).hexdigest()[:16]
    assert own == (
        f"| own | 7 | fails | correction of the wrong sign | 244.7 | `own.c` lines 3-9, SHA-256 {digest} | - | "
        "`strapgen check own.c --function integrator_update --scalar first --init integrator_init` |"
    )
    assert "| 1 lines |" in shimmed and "strapgen check shim.c" in shimmed
    said = done.stderr.splitlines()
    assert [line.partition(":")[0] for line in said] == ["absent", "long", "uncalled"]
    assert all(line.endswith("not run") for line in said) and "has 11 lines; 10 are allowed" in said[1]


def test_a_list_with_an_unknown_key_is_refused(tmp_path):
    (tmp_path / "list.toml").write_text(
        "[[stack]]\nname = 'a'\nversion = '1'\nsource = 'a.c'\nlicence = 'x'\n"
    )
    done = run(tmp_path / "list.toml")
    assert done.returncode == 1 and "stack 1: licence, options: name, options, source" in done.stderr
    assert done.stderr.count("\n") == 1


def test_the_example_of_a_list_names_files_that_there_are():
    text = (EXAMPLES / "stacks.toml").read_text()
    for name in ("correct.c", "wrong_sign.c"):
        assert f'source = "{name}"' in text and (EXAMPLES / name).is_file()
