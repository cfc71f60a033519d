"""What a step costs on microcontrollers: limits of instructions, the contract of the command, and what is refused."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import pytest
from commands import run

from strapgen import catalogue, pipeline
from strapgen.cli import main
from strapgen.ir.exceptions import CompilerError, InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.lab import cost, processors
from strapgen.lab.processors import PROCESSORS, Runner

#: Instructions of a call at most, by processor and kernel, with -O2.
EXECUTED = {
    ("euler", "cortex-m0"): 1369,
    ("euler", "cortex-m3"): 140,
    ("euler", "cortex-m4"): 140,
    ("euler", "cortex-m7"): 140,
    ("euler", "rv32imc"): 275,
    ("dcm", "cortex-m3"): 350,
}
#: Instructions of a call at most in 16 bits.
SHORT = {("euler", "cortex-m3"): 140, ("euler", "cortex-m7"): 135}
#: Instructions of a call at most where the high words of products are taken alone, or those from half words.
HIGH_PRODUCTS = {
    ("high", "euler", "rv32imc"): 155,
    ("high", "dcm", "rv32imc"): 320,
    ("high", "euler", "cortex-m3"): 150,
    ("half", "euler", "cortex-m0"): 760,
}
#: Instructions of a call on a Cortex-M3 that takes the counts of a gyro: a tenth more than 226, which the step on
#: angles took once, and for direction cosines 15 % more than 520.
COUNTS = {"euler": 248, "dcm": 598}
#: Instructions of a step by a window on a Cortex-M3.
WINDOWS = {"window-7-7": 1250, "pair-1-8": 1050}

HOST = Runner("host", ("cc",), ("env",), "cc", "gcc")


def needed(cpu: str) -> None:
    processor = PROCESSORS[cpu]
    for program in (processor.compiler, *processor.emulator[:1]):
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not on this machine")


@pytest.mark.long
@pytest.mark.parametrize(
    ("kernel", "cpu"),
    [pytest.param(*case, marks=pytest.mark.long if case[1] == "cortex-m0" else ()) for case in EXECUTED],
)
def test_a_call_executes_few_instructions(kernel, cpu):
    needed(cpu)
    settings = Settings.of(word=32, max_rate_deg_s=400, step="0.01", increments=2)
    sources = pipeline.generate(pipeline.lower(pipeline.derive(kernel)), "c-fixed", settings)
    measured = cost.cost(sources, cpu)
    assert 50 < measured.executed <= EXECUTED[kernel, cpu]
    loops = PROCESSORS[cpu].compiler.startswith("arm") and cpu == "cortex-m0"  # its products are calls
    assert loops or measured.executed <= measured.instructions
    assert 0 < measured.multiplications < measured.instructions
    assert measured.code_bytes >= 2 * measured.instructions
    assert measured.stack_bytes > 0


@pytest.mark.long
@pytest.mark.parametrize(("kernel", "cpu"), SHORT)
def test_a_call_in_16_bits_executes_few_instructions(kernel, cpu):
    needed(cpu)
    settings = Settings.of(word=16, max_rate_deg_s=400, step="0.01", increments=2)
    sources = pipeline.generate(pipeline.lower(pipeline.derive(kernel)), "c-fixed", settings)
    assert 50 < cost.cost(sources, cpu).executed <= SHORT[kernel, cpu]


@pytest.mark.long
@pytest.mark.parametrize(("multiply", "kernel", "cpu"), HIGH_PRODUCTS)
def test_high_words_of_products_alone_execute_few_instructions(multiply, kernel, cpu):
    needed(cpu)
    settings = Settings.of(max_rate_deg_s=400, step="0.01", increments=2, multiply=multiply)
    sources = pipeline.generate(pipeline.lower(pipeline.derive(kernel)), "c-fixed", settings)
    assert 50 < cost.cost(sources, cpu).executed <= HIGH_PRODUCTS[multiply, kernel, cpu]


@pytest.mark.long
@pytest.mark.parametrize("kernel", COUNTS)
def test_counts_of_a_gyro_cost_little_more_than_angles(kernel):
    needed("cortex-m3")
    settings = Settings.of(max_rate_deg_s=400, sample_hz=100, increments=2, lsb="0.0175dps")
    sources = pipeline.generate(pipeline.lower(pipeline.derive(kernel)), "c-fixed", settings)
    assert cost.cost(sources, "cortex-m3").executed <= COUNTS[kernel]


@pytest.mark.long
@pytest.mark.parametrize(("window", "most"), WINDOWS.items())
def test_a_step_by_a_window_executes_few_instructions(window, most):
    needed("cortex-m3")
    settings = Settings.of(max_rate_deg_s=400, step="0.01", increments=1)
    sources = pipeline.compile(catalogue.choose_step("euler", window, None), "c-fixed", settings)
    assert 500 < cost.cost(sources, "cortex-m3").executed <= most


def test_the_command_prints_its_json_keys(capsys):
    needed("cortex-m3")
    command = "cost euler-normalize euler-product --cross arm-none-eabi-gcc --cpu cortex-m3 --format json"
    run(command.split())
    rows = json.loads(capsys.readouterr().out)
    keys = {"cpu", "instructions", "executed", "multiplications", "compiler"}
    keys |= {f"{what}_bytes" for what in ("code", "constant", "stack")}
    assert [row["kernel"] for row in rows] == ["euler-normalize", "euler-product"]
    for row in rows:
        assert row.keys() >= keys
        assert row["cpu"] == "cortex-m3" and row["compiler"].startswith("arm-none-eabi-gcc ")
        assert row["executed"] is None or row["executed"] > 20


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("", "a kernel is needed, or --all"),
        ("euler --all", "NAME... and --all are both given; one is needed"),
        ("--all --word 16", "--word does not go with it"),
        ("--all --target c", "--target does not go with it"),
        ("--all --method rk2", "--method does not go with it"),
    ],
)
def test_the_whole_catalogue_is_measured_alone(words, said, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["cost", *words.split()])
    assert stop.value.code == 2 and said in capsys.readouterr().err


def test_without_an_emulator_nothing_is_executed(monkeypatch):
    needed("cortex-m3")
    here = shutil.which
    monkeypatch.setattr(shutil, "which", lambda name: None if name.startswith("qemu") else here(name))
    sources = pipeline.generate(pipeline.lower(pipeline.derive("euler-product")), "c-float")
    assert cost.cost(sources, "cortex-m3").executed is None


@pytest.mark.parametrize(
    ("cross", "cpus", "said"),
    [
        (None, ["cortex-m9"], "cpu 'cortex-m9' is not known"),
        ("icc", [], "cross compiler 'icc' is not known"),
        ("avr-gcc", ["cortex-m3"], "avr-gcc does not compile for cortex-m3; arm-none-eabi-gcc does"),
    ],
)
def test_unknown_processors_are_refused(cross, cpus, said):
    with pytest.raises(InputError, match=said):
        cost.processors(cross, cpus)


def test_a_compiler_that_is_missing_is_named(monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda _: None)
    said = r"no cross compiler for cortex-m0, cortex-m3.*: install arm-none-eabi-gcc"
    with pytest.raises(InputError, match=said):
        cost.processors()


def test_python_is_not_measured():
    sources = pipeline.generate(pipeline.lower(pipeline.derive("euler-product")), "numpy")
    with pytest.raises(InputError, match="not in C"):
        cost.cost(sources, "cortex-m3")


@pytest.fixture(autouse=True)
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STRAPGEN_CACHE_DIR", str(tmp_path / "cache"))


@pytest.mark.long
def test_the_cache_keeps_the_size_of_each_code(monkeypatch):
    small, large = (
        pipeline.generate(pipeline.lower(pipeline.derive(kernel)), "c")
        for kernel in ("euler-normalize", "euler-product")
    )
    sizes = [cost.code_size(sources) for sources in (small, large)]
    assert None not in sizes and sizes[0] != sizes[1]

    def never(*_: object) -> None:
        raise AssertionError("measured again")

    monkeypatch.setattr(cost, "_measure_size", never)
    assert [cost.code_size(sources) for sources in (small, large)] == sizes


@pytest.mark.posix
def test_a_compiler_that_fails_leaves_nothing_in_the_cache(tmp_path, monkeypatch):
    sources = pipeline.generate(pipeline.lower(pipeline.derive("euler-normalize")), "c")
    failing = tmp_path / "failing-cc"
    failing.write_text(f'#!/bin/sh\ntest -e {tmp_path}/works || exit 1\nexec cc "$@"\n')
    failing.chmod(0o755)
    monkeypatch.setenv("CC", os.fspath(failing))
    assert cost.code_size(sources) is None
    (tmp_path / "works").touch()
    assert cost.code_size(sources) > 0


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


def test_an_endless_program_is_stopped(monkeypatch, tmp_path):
    monkeypatch.setattr(processors, "_PATIENCE", 0.2)
    (tmp_path / "program.c").write_text("int main(void)\n{\n    for (volatile int k = 0;; ++k) {\n    }\n}\n")
    with pytest.raises(CompilerError, match=r"env: the program has not ended in 0\.2 s"):
        HOST.run(tmp_path, ["program.c"])


def test_compilation_errors_are_reported(tmp_path):
    (tmp_path / "program.c").write_text("int main(void)\n{\n    return missing;\n}\n")
    with pytest.raises(CompilerError, match=r"cc failed: .*missing.* undeclared"):
        HOST.run(tmp_path, ["program.c"])
