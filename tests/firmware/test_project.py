"""Projects around generated C: they build without a warning, run, test themselves, and serve in other projects."""

from __future__ import annotations

import re
import subprocess
from functools import cache
from pathlib import Path

import pytest
from c_programs import COMPILERS, complaints, needed, said, written

from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.firmware import project, two_speed_project
from strapgen.firmware.vectors import vectors_of_choice
from strapgen.firmware.vectors_c import file_names, table_files
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings

SETTINGS = Settings.of(word=32, max_rate_deg_s=400, step="0.01", increments=2, carry="full")
#: Kernels, targets and settings, with the largest error in deg that the run may print; None for a single call.
PROJECTS = [
    ("euler", "c-fixed", SETTINGS, 1e-6),
    ("dcm", "c-float", None, 1e-4),
    ("euler", "c", None, 1e-8),
    ("dcm", "c-fixed", Settings(state="q31"), 1e-4),
    ("euler-normalize", "c-fixed", Settings(16), None),
    ("euler-angles-from-dcm", "c", None, None),
]
LOOPS = [
    ("euler", "c-fixed", Settings(carry="full"), 1e-5),
    pytest.param("dcm", "c", None, 1e-6, marks=pytest.mark.long),
    pytest.param("dcm", "c-fixed", Settings(16, carry="state"), 0.1, marks=pytest.mark.long),
    pytest.param("euler", "c-float", None, 1e-4, marks=pytest.mark.long),
]


@cache
def files_of(kernel: str, target: str, settings: Settings | None) -> dict[str, str]:
    return project.project_files(choose(kernel), target, settings)


@cache
def loop_files(algorithm: str, target: str, settings: Settings | None) -> dict[str, str]:
    return two_speed_project.project_files(algorithm, 2, target, settings)


def code(files: dict[str, str], *parts: str) -> list[str]:
    """Return the sources of the library and others of a project."""
    own = [n for n in files if n.endswith(".c") and "/" not in n and n != "main.c" and n[:5] != "test_"]
    return [*own, *parts]


def run_of(folder: Path, files: dict[str, str], largest: float | None) -> str:
    """Compile and run the main program, check the error that it prints, and return what it prints."""
    motion = [name for name in files if name.startswith("motion/") and name.endswith(".c")]
    status, printed = said(folder, code(files, "main.c", *motion))
    assert status == 0
    if largest is not None:
        (error,) = re.findall(r"^error (\S+) deg$", printed, re.MULTILINE)
        assert 0 < float(error) < largest
    return printed


@pytest.mark.long
@pytest.mark.parametrize(("kernel", "target", "settings", "largest"), PROJECTS)
def test_the_main_program_runs_and_is_near_the_truth(kernel, target, settings, largest, tmp_path):
    files = files_of(kernel, target, settings)
    printed = run_of(written(tmp_path, files), files, largest)
    function = pipeline.compile(choose(kernel), target, settings).function
    shown = function.outputs[0] if largest is None else function.inputs[0]
    assert {line.split()[0] for line in printed.splitlines()} >= {*shown.elements}


@pytest.mark.long
@pytest.mark.parametrize(("algorithm", "target", "settings", "largest"), LOOPS)
def test_all_loops_return_the_values_of_their_vectors(algorithm, target, settings, largest, tmp_path):
    files = loop_files(algorithm, target, settings)
    folder = written(tmp_path, files)
    run_of(folder, files, largest)
    tests = [name for name in files if name.startswith("test_")]
    assert len(tests) == 4
    refusal = 1 if settings else 0
    for test in tests:
        whole = "_two_speed_2" in test
        count = two_speed_project.NAVIGATION * (1 + two_speed_project.SLOW) + refusal if whole else 200
        assert said(folder, code(files, test)) == (0, f"{count} passed, 0 failed\n")


def test_a_fault_in_the_wiring_of_the_loops_is_seen(tmp_path):
    files = dict(loop_files(*LOOPS[0][:3]))
    (source,) = (name for name in files if re.fullmatch(r"euler_two_speed_2_\w+\.c", name))
    cleared = "    (void)memset(memory->coning, 0, sizeof memory->coning);\n"
    assert cleared in files[source]
    files[source] = files[source].replace(cleared, "")
    status, printed = said(written(tmp_path, files), code(files, f"test_{source}"))
    assert status == 1 and "slow cycle 1 failed" in printed


@pytest.mark.long
@pytest.mark.parametrize(
    "compiler", [name for name in COMPILERS if name != "gcc"]
)  # which has compiled all above
def test_strict_compilers_are_silent(compiler, tmp_path):
    needed(compiler)
    files = files_of(*PROJECTS[0][:3]) | loop_files(*LOOPS[0][:3])
    if compiler != "avr-gcc":  # its double has the bits of a float
        files |= files_of(*PROJECTS[1][:3])
    # A double of 53 bits, which those functions ask for, is not there on AVR.
    sources = [
        n for n in files if n.endswith(".c") and not (compiler == "avr-gcc" and n.startswith("motion/"))
    ]
    assert complaints(compiler, written(tmp_path, files), sources) == ""


def test_lines_have_fewer_than_100_columns():
    everything = [files_of(*PROJECTS[0][:3]), files_of(*PROJECTS[3][:3]), files_of(*PROJECTS[1][:3])]
    everything += [
        {n: t for n, t in loop_files(*LOOPS[0][:3]).items() if "two_speed_2_" not in n or "test" in n}
    ]
    long = [
        f"{name}: {line}"
        for files in everything
        for name, text in files.items()
        if not name.endswith(".csv")
        for line in text.splitlines()
        if len(line) > 99
    ]
    assert long == []


def test_the_vectors_of_a_project_are_those_of_their_command():
    table = vectors_of_choice(choose("euler"), "c-fixed", SETTINGS)
    assert table_files(table).items() <= files_of(*PROJECTS[0][:3]).items()


def test_user_changes_are_not_overwritten(tmp_path):
    files = files_of(*PROJECTS[0][:3])
    written(tmp_path, files)
    project.refuse_changed(tmp_path, files)  # the same files once more
    for name in filter(project.is_yours, files):
        changed = tmp_path / name
        changed.write_text("mine")
        with pytest.raises(InputError, match=f"{name} exists and differs from what --project writes"):
            project.refuse_changed(tmp_path, files)
        changed.write_text(files[name])


# CMake


def cmake(*words: str | Path, cwd: Path) -> str:
    done = subprocess.run([*map(str, words)], cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "warning" not in (done.stdout + done.stderr).lower()
    return done.stdout


OUTER = """cmake_minimum_required(VERSION 3.13)
project(outer LANGUAGES C)
{}
add_executable(outer outer.c)
target_link_libraries(outer PRIVATE strapgen::euler_rk4_2)
"""
OUTER_C = """#include "euler_rk4_2.h"
int main(void)
{
    double state[4] = {0.0, 0.0, 0.0, 1.0};
    const double increments[6] = {0.0};
    euler_rk4_2(state, increments, state);
    return (state[3] >= 1.0) ? 0 : 1;
}
"""


@pytest.mark.long
@pytest.mark.parametrize("way", ["add_subdirectory", "find_package"])
def test_another_project_links_with_the_library(way, tmp_path):
    needed("cmake")
    step = written(tmp_path / "step", files_of("euler", "c", None))
    line, more = f"add_subdirectory({step} step)", []
    if way == "find_package":
        cmake(
            "cmake", "-S", step, "-B", "build", f"-DCMAKE_INSTALL_PREFIX={tmp_path / 'there'}", cwd=tmp_path
        )
        cmake("cmake", "--build", "build", "--target", "install", cwd=tmp_path)
        line, more = (
            "find_package(strapgen_euler_rk4_2 REQUIRED)",
            [f"-DCMAKE_PREFIX_PATH={tmp_path / 'there'}"],
        )
    outer = written(tmp_path / "outer", {"CMakeLists.txt": OUTER.format(line), "outer.c": OUTER_C})
    cmake("cmake", "-S", outer, "-B", outer / "build", *more, cwd=tmp_path)
    cmake("cmake", "--build", outer / "build", cwd=tmp_path)
    assert subprocess.run([outer / "build" / "outer"], check=False).returncode == 0
    assert not list((outer / "build").rglob("test_*")), "tests belong to the project itself"


@pytest.mark.long
def test_the_project_of_two_speeds_builds_and_tests_itself(tmp_path):
    needed("cmake", "ctest")
    written(tmp_path, loop_files("dcm", "c", None))
    cmake("cmake", "-S", ".", "-B", "build", cwd=tmp_path)
    cmake("cmake", "--build", "build", cwd=tmp_path)
    printed = cmake("ctest", "--test-dir", "build", cwd=tmp_path)
    assert re.search("100% tests passed(, 0 tests failed)? out of 5", printed)


def test_the_header_of_a_test_names_its_command():
    sources = pipeline.compile(choose("euler"), "c-fixed", SETTINGS)
    _, test, _ = file_names(sources.function.name)
    head = " ".join(files_of(*PROJECTS[0][:3])[test].split("*/")[0].replace("*", "").split())
    assert (
        "strapgen vectors euler --method rk4 --increments 2 --target c-fixed --word 32 --max-rate-deg-s 400 "
        "--step 0.01 --rounding nearest --carry full --drift-allowance 1/16 --count 200 --seed 1"
    ) in head
