"""The C that takes stamped samples to an even grid: its files, its header, its command, and other compilers."""

from __future__ import annotations

import json
import re
import shlex

import numpy as np
import pytest
from c_programs import COMPILERS, complaints, needed, said, written

from strapgen import Settings, StampedGrid
from strapgen.cli import main
from strapgen.evidence import clang_checks
from strapgen.ir.exceptions import InputError
from strapgen.run.standard_tree import command_of
from strapgen.stamped.boundary_kernels import filters
from strapgen.stamped.kernel_names import ROUNDS
from strapgen.stamped.stamped_sources import TARGETS, error_bound, parts, sources

CLOCK = (200, 1_000_000)


@pytest.fixture
def run(capsys, tmp_path, monkeypatch):
    """Return a function that runs a command line in a folder of its own and returns status, stdout and stderr."""
    monkeypatch.chdir(tmp_path)

    def run(command: str) -> tuple[object, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(command))
        return stop.value.code, *capsys.readouterr()

    return run


@pytest.mark.parametrize("target", TARGETS)
def test_files_are_narrow_plain_text_that_says_its_command(target, run, tmp_path):
    unit = sources(*CLOCK, target=target)
    name = "stamped_grid_3_5" + {"c": "", "c-float": "_float", "c-fixed": "_w32"}[target]
    assert unit.function.name == name
    assert list(unit.files)[:2] == [f"{name}.h", f"{name}.c"]
    assert len(unit.step_files) == 10
    for file, text in unit.files.items():
        assert text.isascii()
        assert all(line == line.rstrip() and len(line) < 100 for line in text.splitlines()), file
    externals = re.findall(rf"\b{name}_[a-z]+\b", unit.files[f"{name}.h"])
    assert max(map(len, externals)) <= 31
    command = command_of(unit.files[f"{name}.h"])
    assert command == command_of(unit.files[f"{name}.c"])
    assert run(f"{command.removeprefix('strapgen ')} --out out")[0] == 0
    assert {path.name: path.read_text() for path in (tmp_path / "out").iterdir()} == unit.step_files


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(
    "compiler", [name if name == "gcc" else pytest.param(name, marks=pytest.mark.long) for name in COMPILERS]
)
def test_compilers_do_not_complain(target, compiler, tmp_path):
    needed(compiler)
    if (compiler, target) == ("avr-gcc", "c"):
        pytest.skip("a double of that processor has the bits of a float, which the functions refuse")
    for bits, pairs in ((32, (3, 5)), (16, (7, 7)), (64, (3, 5))):
        unit = sources(*CLOCK, pairs, target, bits)
        place = written(tmp_path, {f"{bits}/{name}": text for name, text in unit.files.items()}) / str(bits)
        assert complaints(compiler, place, [name for name in unit.files if name.endswith(".c")]) == ""
        if compiler == "clang":
            assert clang_checks.found_by_clang(place) == []


@pytest.mark.long
@pytest.mark.parametrize("target", TARGETS)
def test_the_style_is_that_of_other_files(target, tmp_path):
    needed("clang-tidy")
    written(tmp_path, sources(*CLOCK, target=target).files)
    assert clang_checks.found_by_clang_tidy(tmp_path) == []


def test_the_header_says_latency_operations_and_the_bound():
    header = " ".join(
        sources(*CLOCK, target="c-fixed").files["stamped_grid_3_5_w32.h"].replace("\n *", " ").split()
    )
    assert "_LATENCY 8" in header
    assert "is known 8 samples after its end" in header
    assert "23 at once with stamp 32, then 1" in header
    assert "-1 for a sample outside its range" in header
    functions = parts((3, 5), "c-fixed", Settings())
    unit = functions[3].fixed.inputs[0].unit
    (bound,) = re.findall(r"is at most ([\d.]+) units", header)
    assert 0 <= float(bound) - error_bound((3, 5), functions) / unit < 1e-4
    double = sources(*CLOCK, target="c").files["stamped_grid_3_5.h"]
    assert "49 multiply" in double
    assert "Rounding" not in double


def test_the_bound_is_that_of_the_functions():
    functions = parts((3, 5), "c-fixed", Settings())
    assert {one.fixed.inputs[0].format for one in functions.values()} == {
        one.fixed.outputs[0].format for one in functions.values()
    }
    unit = functions[3].fixed.inputs[0].unit
    # Each sample has two corrections, each of them rounded by half a unit and a little more; in the second round the
    # samples around a boundary have the errors of the first one.
    for pairs in ROUNDS:
        functions = parts(pairs, "c-fixed", Settings())
        first, second = (float(max(functions[number].fixed.outputs[0].errors) / unit) for number in pairs)
        assert 0.5 < first < 0.65 and 0.5 < second < 0.65
        stated = float(error_bound(pairs, functions) / unit)
        assert stated == pytest.approx(2 * (second + 2 * first * float(filters(pairs[1]).largest)), rel=1e-3)


#: Takes rates of 1 rad/s about z at stamps that jitter and wrap, and prints what comes.
PROGRAM = """
#include <stdio.h>
#include "stamped_grid_3_5_w32.h"
static stamped_grid_3_5_w32_memory memory;
static int32_t grid[3 * STAMPED_GRID_3_5_W32_MOST];
static void print(int count)
{
    for (int k = 0; k < count; ++k) {
        printf("%ld ", (long)grid[(3 * k) + 2]);
    }
}
int main(void)
{
    uint32_t stamp = UINT32_C(4294800000);
    if (stamped_grid_3_5_w32_init(&memory) != 0) {
        return 1;
    }
    for (int k = 0; k < 60; ++k) {
        const uint32_t ticks = (uint32_t)(5000 + (37 * (k % 5)) - 74);
        const int32_t sample[3] = { 0, 0, (int32_t)(ticks * 3435) };
        stamp += ticks;
        print(stamped_grid_3_5_w32_push(&memory, sample, stamp, grid));
    }
    print(stamped_grid_3_5_w32_flush(&memory, grid));
    return 0;
}
"""


@pytest.mark.parametrize(
    "compiler",
    [
        "gcc",
        *(pytest.param(c, marks=pytest.mark.long) for c in ("arm-none-eabi-gcc", "riscv64-unknown-elf-gcc")),
    ],
)
def test_a_program_on_a_processor_prints_what_the_model_has(compiler, tmp_path):
    unit = sources(*CLOCK, target="c-fixed")
    folder = written(tmp_path, {**unit.step_files, "main.c": PROGRAM})
    status, text = said(
        folder, [name for name in (*unit.step_files, "main.c") if name.endswith(".c")], compiler
    )
    ticks = 5000 + 37 * (np.arange(60) % 5) - 74
    unit_rad = float(unit.fixed.inputs[0].unit)
    samples = np.outer(ticks * 3435, [0, 0, unit_rad])
    stamps = (4294800000 + np.cumsum(ticks)) % 2**32
    grid = StampedGrid(*CLOCK, stamp_bits=32, backend="fixed-model").whole(samples, stamps).samples
    assert (status, list(map(int, text.split()))) == (0, (grid[:, 2] / unit_rad).astype(int).tolist())


def test_the_command_says_what_it_has_written(run, tmp_path):
    status, text, _ = run("stamped --sample-hz 200 --tick-hz 1e6 --pairs 7,7 --name imu --out out")
    assert status == 0
    assert text.startswith("imu for c: a sample of the grid is known 14 samples after its end\n  out/imu.h\n")
    command = "stamped --sample-hz 200 --tick-hz 1e6 --pairs 7,7 --name imu --out out"
    assert run(f"{command} --check") == (0, "out: 8 files, in step\n", "")
    (tmp_path / "out" / "imu.c").write_text("changed\n")
    status, difference, _ = run(f"{command} --check")
    assert (status, difference.startswith("---")) == (1, True)
    status, text, _ = run("stamped --sample-hz 200 --tick-hz 1e6 --format json --out more")
    found = json.loads(text)
    assert (found["name"], found["target"], found["latency"]) == ("stamped_grid_3_5", "c", 8)
    assert found["operations"]["multiply"] == 49


@pytest.mark.parametrize("target", TARGETS)
def test_verify_compares_all_files_and_calls_every_function(run, tmp_path, target):
    options = "--name imu --max-rate-deg-s 300" if target == "c-fixed" else "--stamp-bits 16"
    assert run(f"stamped --sample-hz 200 --tick-hz 1e6 {options} --target {target} --out out")[0] == 0
    status, text, _ = run("verify out")
    assert status == 0
    assert "10 files, in step with the command" in text
    assert text.count("300 of 300 calls return what they must") == 4
    (source,) = (tmp_path / "out").glob("[is][mt]*.c")
    source.write_text(source.read_text().replace("* 20 >", "* 19 >"))
    status, text, _ = run("verify out")
    assert (status, "edited" in text) == (1, True)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ("--sample-hz 200", "--tick-hz"),
        ("--sample-hz 200 --tick-hz 1e3", r"5 ticks; from 20 to 2,147,483,648 are needed \(--tick-hz\)"),
        ("--sample-hz 200 --tick-hz 1e6 --pairs 5,5", "--pairs is 5,5; 3,5 or 7,7 is needed"),
        ("--sample-hz 200 --tick-hz 1e6 --stamp-bits 70", "--stamp-bits is 70"),
        ("--sample-hz 200 --tick-hz 1e6 --stamp-bits 12", "wraps within four sampling intervals"),
        ("--sample-hz 200 --tick-hz 1e6 --target rust", "target"),
        (
            "--sample-hz 200 --tick-hz 1e6 --max-rate-deg-s 400",
            "c takes no settings of fixed point; c-fixed does",
        ),
        ("--sample-hz 200 --tick-hz 1e6 --name 9", "a letter first"),
        (f"--sample-hz 200 --tick-hz 1e6 --name {'a' * 25}", "more than 24 characters"),
    ],
)
def test_wrong_options_are_refused_in_one_line(run, options, reason):
    status, text, warned = run(f"stamped {options}")
    assert (status, text) == (2, "")
    assert re.search(reason, warned)
    assert warned.count("\n") == 1


def test_settings_go_with_fixed_point_alone():
    with pytest.raises(InputError, match="takes no settings"):
        sources(*CLOCK, settings=Settings())
