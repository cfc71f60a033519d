"""Programs on processors: what they report comes back, and one that does not end is stopped."""

from __future__ import annotations

import shutil

import pytest

from strapgen.ir.exceptions import CompilerError
from strapgen.lab import processors
from strapgen.lab.processors import RUNNERS, Runner

HOST = Runner("host", ("cc",), ("env",), "cc", "gcc")


@pytest.fixture(autouse=True)
def compiler():
    if shutil.which("cc") is None:
        pytest.skip("cc is not on this machine")


def test_a_program_is_compiled_and_run_from_another_folder(tmp_path):
    (tmp_path / "program.c").write_text(
        '#include <stdio.h>\nint main(void)\n{\n    puts("\\033[32mdone\\033[0m");\n}\n'
    )
    folder = tmp_path / "host"
    folder.mkdir()
    assert HOST.run(folder, ["../program.c"]) == "done\n"
    assert (
        (folder / "run.sh")
        .read_text()
        .startswith("cc -std=c99 -O2 -ffp-contract=off ../program.c -o ./program.elf &&\n")
    )


def test_a_program_that_does_not_end_is_stopped(monkeypatch, tmp_path):
    monkeypatch.setattr(processors, "_PATIENCE", 0.2)
    (tmp_path / "program.c").write_text("int main(void)\n{\n    for (volatile int k = 0;; ++k) {\n    }\n}\n")
    with pytest.raises(CompilerError, match=r"env: the program has not ended in 0\.2 s"):
        HOST.run(tmp_path, ["program.c"])


def test_a_program_that_does_not_compile_is_told_with_its_error(tmp_path):
    (tmp_path / "program.c").write_text("int main(void)\n{\n    return missing;\n}\n")
    with pytest.raises(CompilerError, match=r"cc failed: .*missing.* undeclared"):
        HOST.run(tmp_path, ["program.c"])


def test_processors_of_several_kinds_are_there():
    assert [*RUNNERS] == [
        "cortex-m0",
        "cortex-m3",
        "cortex-m4",
        "cortex-m7",
        "rv32imc",
        "avr",
        "powerpc",
        "i686",
    ]
    assert {runner.tool for runner in RUNNERS.values()} == {"QEMU", "simavr"}
