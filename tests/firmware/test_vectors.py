"""Test vectors: what they hold, where their numbers come from, and that they find a fault in the C."""

from __future__ import annotations

import csv
import json
import pickle
import shlex
from fractions import Fraction
from functools import cache

import numpy as np
import pytest
from c_programs import COMPILERS, complaints, line_of_avr, needed, said, written

from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.cli import main
from strapgen.firmware.vectors import ProgramEvaluator, vectors_of_choice
from strapgen.firmware.vectors_c import VectorTable, file_names, table_files
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.kernel_info import KernelInfo
from strapgen.ir.program import Assignment, Constant, Operation, Program, Reference, Result
from strapgen.ir.signals import Signal
from strapgen.run.kernel_sources import sources_of_program

SETTINGS = Settings.of(word=32, max_rate_deg_s=400, step="0.01", increments=2, carry="full")
#: Kernels, targets and settings that differ in what their vectors hold: error feedback, words, codes, functions.
TABLES = [
    ("euler", "c-fixed", SETTINGS),
    ("dcm", "c-fixed", Settings(16)),
    ("euler-normalize", "c-fixed", Settings(16, carry="state")),
    ("euler", "c", None),
    ("dcm", "c-float", None),
    ("euler-angles-from-dcm", "c-float", None),
    ("coning-truth", "c", None),
]


@cache
def table_of(kernel: str, target: str, settings: Settings | None, count: int = 200) -> VectorTable:
    return vectors_of_choice(choose(kernel), target, settings, count)


def test_of(table: VectorTable) -> list[str]:
    """Return the sources of a table's test."""
    _, test, _ = file_names(table.sources.function.name)
    return [test, *(name for name in table.sources.step_files if name.endswith(".c"))]


test_of.__test__ = False  # type: ignore[attr-defined]


def files_of(table: VectorTable) -> dict[str, str]:
    return {**table.sources.step_files, **table_files(table)}


@pytest.mark.long
@pytest.mark.parametrize(("kernel", "target", "settings"), TABLES)
def test_c_returns_the_values_of_the_vectors(kernel, target, settings, tmp_path):
    table = table_of(kernel, target, settings)
    folder = written(tmp_path, files_of(table))
    assert len(table.rows) >= 195
    assert said(folder, test_of(table)) == (0, f"{len(table.rows)} passed, 0 failed\n")


def test_corners_come_first_and_every_limit_is_reached_and_passed():
    table = table_of("euler", "c-fixed", SETTINGS)
    first = table.rows[0]
    assert (first.inputs[0], first.inputs[1], first.outputs) == (
        (0, 0, 0, 1 << 30),
        (0,) * 6,
        ((0, 0, 0, 1 << 30),),
    )
    assert first.feedback == tuple(word.fresh for word in table.sources.fixed.residuals)
    statuses = [row.status for row in table.rows]
    assert set(statuses) == {0, 1}
    for place, argument in enumerate(table.sources.fixed.inputs):
        for element in range(argument.signal.size):
            accepted = {row.inputs[place][element] for row in table.rows if row.status == 0}
            refused = {row.inputs[place][element] for row in table.rows if row.status == 1}
            assert {argument.low, argument.high} <= accepted
            assert {argument.low - 1, argument.high + 1} <= refused
            assert (min(accepted), max(accepted)) == (argument.low, argument.high)
    refused = statuses.index(1)
    assert all(row.feedback == row.next_feedback for row in table.rows if row.status)
    assert 0 not in statuses[refused : refused + statuses.count(1)], "they stand together, behind the corners"
    assert {word for row in table.rows for word in row.feedback} >= {0, (1 << 32) - 1}


def test_a_guard_on_the_way_is_refused_with_code_2():
    assert {row.status for row in table_of("euler-normalize", "c-fixed", Settings(16)).rows} == {0, 1, 2}


def test_the_outputs_are_within_the_bound_of_exact_fractions():
    """The integer model against the program in fractions, which knows of no format."""
    table = table_of("euler", "c-fixed", SETTINGS, 60)
    program = pipeline.program(choose("euler"))
    interface = table.sources.fixed
    compared = 0
    for row in table.rows:
        if row.status or row.feedback not in (table.rows[0].feedback, (0,) * 8):
            continue
        values = {
            name: number * argument.format.unit
            for argument, numbers in zip(interface.inputs, row.inputs, strict=True)
            for name, number in zip(argument.signal.elements, numbers, strict=True)
        }
        exact = program.run(values)["next"]
        (output,) = interface.outputs
        for number, value, error in zip(row.outputs[0], exact, output.errors, strict=True):
            assert abs(number * output.format.unit - value) <= error
            compared += 1
    assert compared > 60


def test_a_seed_gives_the_same_vectors_and_another_one_others():
    choice = choose("euler-product")
    tables = [vectors_of_choice(choice, "c-fixed", None, 60, seed).rows for seed in (1, 1, 2)]
    assert tables[0] == tables[1] != tables[2]
    assert vectors_of_choice(choice, "c-fixed", None, 20).rows == tables[0][:20]


def test_the_csv_holds_the_numbers_of_the_header():
    table = table_of("euler", "c-fixed", SETTINGS, 80)
    lines = table_files(table)[file_names(table.sources.function.name)[2]].splitlines()
    rows = list(csv.DictReader(lines))
    assert len(rows) == 80
    for row, vector in zip(rows, table.rows, strict=True):
        assert [int(row[f"e_{axis}"]) for axis in "xyzs"] == list(vector.inputs[0])
        assert int(row["status"]) == vector.status
        shown = [row[f"next_{axis}"] for axis in "xyzs"]
        assert shown == ([""] * 4 if vector.status else list(map(str, vector.outputs[0])))
        after = [int(text) for name, text in row.items() if name.startswith("after_")]
        assert tuple(after) == vector.next_feedback


def test_floats_in_the_csv_read_as_the_very_numbers():
    table = table_of("euler-product", "c", None, 40)
    lines = table_files(table)[file_names("euler_product")[2]].splitlines()
    numbers = [Fraction(float(text)) for text in lines[-1].split(",")]
    vector = table.rows[-1]
    assert numbers == [Fraction(x) for group in (*vector.inputs, *vector.outputs) for x in group]


def faults(text: str) -> dict[str, str]:
    """Return C with one fault each: a sign, a constant, a shift, a limit, a state written before it is checked."""
    limit = str(table_of("euler", "c-fixed", SETTINGS, 1).sources.fixed.inputs[1].high)
    result = {
        "sign": text.replace("nml(sigma_z, d1_y)", "mul(sigma_z, d1_y)", 1),
        "limit": text.replace(f"INT32_C({limit})", f"INT32_C({int(limit) + 1})"),
        "code": text.replace("return 1;", "return 2;"),
        "output": text.replace("        return 1;", "        next[0] = 0;\n        return 1;"),
        "feedback": text.replace("residuals[0] = ", "residuals[0] = 1u + "),
    }
    return {name: changed for name, changed in result.items() if changed != text}


@pytest.mark.long
@pytest.mark.parametrize("fault", ["sign", "limit", "code", "output", "feedback"])
def test_a_fault_in_the_c_is_seen(fault, tmp_path):
    table = table_of("euler", "c-fixed", SETTINGS)
    files = files_of(table)
    (source,) = (name for name in table.sources.step_files if name.endswith(".c"))
    folder = written(tmp_path, {**files, source: faults(files[source])[fault]})
    status, printed = said(folder, test_of(table))
    passed, failed = map(int, printed.splitlines()[-1].replace(" passed,", "").split()[:2])
    assert status == 1 and failed > 0 and passed + failed == 200


@pytest.mark.long
@pytest.mark.parametrize(
    "compiler", [name for name in COMPILERS if name != "gcc"]
)  # which has compiled all above; projects, which have tests of vectors too, are quick
def test_strict_compilers_are_silent(compiler, tmp_path):
    needed(compiler)
    sources = []
    for kernel, target, settings in TABLES:
        if target != "c-fixed" and compiler == "avr-gcc":  # its double has the bits of a float
            continue
        table = table_of(kernel, target, settings, 30)
        written(tmp_path, files_of(table))
        sources += test_of(table)
    assert complaints(compiler, tmp_path, sources) == ""


@pytest.mark.long
@pytest.mark.parametrize("compiler", ["arm-none-eabi-gcc", "riscv64-unknown-elf-gcc"])
def test_an_emulated_processor_returns_the_very_integers(compiler, tmp_path):
    needed(compiler)
    table = table_of("euler", "c-fixed", SETTINGS)
    folder = written(tmp_path, files_of(table))
    assert said(folder, test_of(table), compiler) == (0, "200 passed, 0 failed\n")


@pytest.mark.long
def test_a_processor_with_16_bits_returns_the_very_integers(tmp_path):
    table = table_of("euler", "c-fixed", SETTINGS)
    assert line_of_avr(written(tmp_path, files_of(table)), test_of(table)) == "200 passed, 0 failed"


def test_a_double_of_other_length_is_refused_by_the_header(tmp_path):
    needed("avr-gcc")
    table = table_of("euler-product", "c", None, 10)
    folder = written(tmp_path, files_of(table))
    assert "these vectors are for a double of 53 significant bits" in complaints(
        "avr-gcc", folder, test_of(table)[:1]
    )


@pytest.mark.parametrize(
    ("target", "count", "seed", "said_"),
    [
        ("numpy", 10, 1, "target 'numpy'"),
        ("c", 0, 1, "count is 0; a whole number from 1 to 10000 is needed"),
        ("c", 10, -1, "seed is -1"),
    ],
)
def test_impossible_vectors_are_refused(target, count, seed, said_):
    with pytest.raises(InputError, match=said_):
        vectors_of_choice(choose("euler-product"), target, None, count, seed)


FIXED = "--max-rate-deg-s 400 --step 0.01"


def command_says(command: str, capsys: pytest.CaptureFixture[str], status: int = 0) -> str:
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(command))
    printed = capsys.readouterr()
    assert stop.value.code == status, printed.err
    return printed.out if status == 0 else printed.err


def test_vectors_are_written_and_listed(tmp_path, capsys):
    printed = command_says(f"vectors euler {FIXED} --count 70 --out {tmp_path}", capsys)
    first, *others = printed.splitlines()
    files = sorted(path.name for path in tmp_path.iterdir())
    name = first.partition(":")[0]
    assert first == f"{name}: 70 vectors, 24 of them refused"
    assert files == sorted([f"{name}_vectors.csv", f"{name}_vectors.h", f"test_{name}.c"])
    assert sorted(line.split("/")[-1] for line in others) == files


def test_vectors_answer_in_json(tmp_path, capsys):
    answer = json.loads(
        command_says(f"vectors euler-product --target c --count 5 --format json --out {tmp_path}", capsys)
    )
    assert (answer["function"], answer["vectors"], answer["refused"]) == ("euler_product", 5, 0)
    assert [path.rpartition("/")[2] for path in answer["files"]] == [
        *("euler_product_vectors.h", "test_euler_product.c", "euler_product_vectors.csv"),
    ]


def test_the_command_of_a_loop_writes_the_vectors_of_its_project(tmp_path, capsys):
    """What the head of the file says can be repeated."""
    command_says(
        f"two-speed euler --target c-fixed --carry full --project --out {tmp_path / 'whole'}", capsys
    )
    (test,) = (tmp_path / "whole").glob("test_euler_two_speed_slow_2_*.c")
    head = " ".join(line.lstrip(" *") for line in test.read_text().split("*/")[0].splitlines())
    command = head.partition("Generated by: strapgen ")[2].partition(" Do not edit")[0]
    command_says(f"{command} --out {tmp_path / 'loop'}", capsys)
    written = {path.name: path.read_text() for path in (tmp_path / "loop").iterdir()}
    assert len(written) == 3
    assert written == {name: (tmp_path / "whole" / name).read_text() for name in written}


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("vectors euler --target numpy", "target 'numpy'"),
        ("vectors euler --target c --word 16", "fixed point go with --target c-fixed, not with c"),
        ("vectors euler --count none", "count is 'none'"),
        ("vectors euler --count 0", "count is 0; a whole number from 1 to 10000 is needed"),
        ("vectors euler-from-dcm --carry full", "--carry keeps nothing"),
        ("vectors euler-product --max-angle-rad 0.1", "takes no increments"),
        ("generate euler --project", "--project goes with targets in C, not with numpy"),
        ("generate --all --project", "--project does not go with it"),
        ("generate euler --target c --project sled", "project 'sled' is not known; allowed: cmake"),
        ("generate --project=make euler --target c", "project 'make' is not known"),
        ("two-speed dcm --project make", "project 'make' is not known"),
    ],
)
def test_conflicting_options_are_refused_in_one_line(command, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    error = command_says(command, capsys, 2)
    assert message in error and error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_the_kind_of_a_project_may_be_left_out(tmp_path, capsys):
    """A word behind --project that names no kind is the argument of the command, where none has come before."""
    for number, words in enumerate(
        ["euler-product --project", "euler-product --project cmake", "--project euler-product"]
    ):
        command_says(f"generate {words} --target c --out {tmp_path / str(number)}", capsys)
        names = sorted(path.name for path in (tmp_path / str(number)).iterdir())
        assert "CMakeLists.txt" in names and "euler_product.c" in names


@pytest.mark.long
@pytest.mark.parametrize("command", [f"generate euler --target c-fixed {FIXED}", "two-speed dcm --target c"])
def test_a_changed_main_program_stays(command, tmp_path, capsys):
    folder = tmp_path / "firmware"
    command_says(f"{command} --project --out {folder}", capsys)
    before = {path.name: path.read_text() for path in folder.iterdir() if path.is_file()}
    command_says(f"{command} --project --out {folder}", capsys)
    (folder / "main.c").write_text("int main(void) { return 0; }\n")
    error = command_says(f"{command} --project --out {folder}", capsys, 2)
    assert "main.c exists and differs from what --project writes" in error
    assert error.count("\n") == 1
    after = {path.name: path.read_text() for path in folder.iterdir() if path.is_file()}
    assert after == before | {"main.c": "int main(void) { return 0; }\n"}


def test_a_file_that_strapgen_has_not_generated_stays(tmp_path, capsys):
    command_says(f"vectors euler-product --target c --count 5 --out {tmp_path}", capsys)
    command_says(f"vectors euler-product --target c --count 6 --out {tmp_path}", capsys)
    header = tmp_path / "euler_product_vectors.h"
    assert "6 calls" in header.read_text()
    header.write_text("/* mine */\n")
    error = command_says(f"vectors euler-product --target c --count 5 --out {tmp_path}", capsys, 2)
    assert f"{header} exists and was not generated by strapgen" in error and error.count("\n") == 1
    assert header.read_text() == "/* mine */\n"


def evaluator(target: str, node: Operation) -> ProgramEvaluator:
    """Return a program of one scalar input x and one operation."""
    program = Program(
        KernelInfo("one", "one", "this test"),
        (Signal.scalar("x"),),
        (Assignment("y", node),),
        (Result(Signal("out", (1,), ("y",)), (Reference("y"),)),),
    )
    return ProgramEvaluator(sources_of_program(program, "exact"), target)


@pytest.mark.parametrize(("target", "kind"), [("c", np.float64), ("c-float", np.float32)])
def test_every_operation_is_rounded_in_the_type_of_the_target(target, kind):
    third = evaluator(target, Operation("multiply", (Reference("x"), Constant(Fraction(1, 3)))))
    x = kind(1.1)
    nearest = min(
        (kind(1 / 3), np.nextafter(kind(1 / 3), kind(0)), np.nextafter(kind(1 / 3), kind(1))),
        key=lambda value: abs(Fraction(float(value)) - Fraction(1, 3)),
    )
    result = third(x)
    assert result.dtype == kind and result[0] == x * nearest


def test_functions_have_their_values_where_formulas_break():
    ratio = evaluator("c", Operation("sinc", (Reference("x"),)))
    assert ratio(np.array([0.0, 0.5])).ravel().tolist() == [1.0, np.sin(0.5) / 0.5]
    angle = evaluator("c", Operation("wrap", (Reference("x"),)))
    assert angle(np.array([4.0, -4.0, 3.0])).ravel() == pytest.approx([4 - 2 * np.pi, 2 * np.pi - 4, 3.0])


def test_a_copy_in_another_process_is_the_same():
    half = evaluator("c-float", Operation("multiply", (Reference("x"), Constant(Fraction(1, 2)))))
    copy = pickle.loads(pickle.dumps(half))
    assert (copy.dtype, copy(np.float32(3))) == (half.dtype, half(np.float32(3)))
