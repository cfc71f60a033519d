"""The C++ of kernels: constant expressions and strict compilers."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from languages import check_lines

import strapgen
from strapgen import catalogue, pipeline
from strapgen.ir.exceptions import CompilerError
from strapgen.run.compiler import COMPILERS
from strapgen.targets.cpp.fixed import _word
from strapgen.targets.cpp.text import constants
from strapgen.targets.definitions import Macro

STRICT = (
    "-std=c++17",
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wshadow",
    "-Wconversion",
    "-Wold-style-cast",
    "-Werror",
)


@pytest.fixture
def cxx() -> str:
    """The path of the C++ compiler."""
    try:
        return COMPILERS["C++"].path()
    except CompilerError as error:
        pytest.skip(str(error))


def checked(cxx: str, folder: Path, text: str, *flags: str) -> subprocess.CompletedProcess[str]:
    """Let the compiler check a program in a folder."""
    (folder / "main.cpp").write_text(text)
    command = [cxx, *STRICT, "-ffp-contract=off", *flags, "-fsyntax-only", "main.cpp"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("right", [True, False])
def test_a_step_is_a_constant_expression(cxx, tmp_path, right):
    sources = pipeline.compile(catalogue.choose("euler"), "cpp")
    (tmp_path / "euler_rk4_2.hpp").write_text(sources.files["euler_rk4_2.hpp"])
    state = strapgen.backend("euler").step([0.0, 0.0, 0.0, 1.0], [[0.25, 0.0, 0.0], [0.125, 0.0, 0.0]])
    expected = float(state[0]) if right else float(np.nextafter(state[0], 1))
    said = checked(
        cxx,
        tmp_path,
        '#include "euler_rk4_2.hpp"\n'
        "constexpr auto next = strapgen::euler_rk4_2(strapgen::euler_rk4_2_identity, {{0.25, 0, 0, 0.125, 0, 0}});\n"
        f"static_assert(next[0] == {expected!r});\n",
    )
    assert (said.returncode == 0) == right, said.stderr
    assert right or "static assertion failed" in said.stderr


def test_a_constant_stands_in_one_line_with_its_comment_or_below_it_up_to_the_width():
    def lines(value: str, meaning: str) -> list[str]:
        (text,) = constants([Macro("ONE", value, meaning, "int")])
        return text.split("\n")

    begin, comment = "inline constexpr int one = ", "/* one */"
    for width in (99, 100):
        value = "1" * (width - len(f"{begin}; {comment}"))
        line = f"{begin}{value};"
        assert lines(value, "one") == ([f"{line} {comment}"] if width == 99 else [comment, line])
        value = "1" * (width - len(f"{begin};"))
        broken = [f"{begin.rstrip()}", f"    {value};"] if width == 100 else [f"{begin}{value};"]
        assert lines(value, "one") == [comment, *broken]


def test_inputs_that_a_kernel_does_not_read_are_named_for_the_compiler():
    for kernel, unused in (("constant-increments", ["middle"]), ("euler-product", [])):
        (text,) = (
            text
            for name, text in pipeline.compile(catalogue.choose(kernel), "cpp").files.items()
            if name.endswith(".hpp")
        )
        assert re.findall(r"\(void\)(\w+);", text) == unused


def test_words_of_64_bits_have_the_same_wide_numbers_in_every_header():
    words = [_word(64, name) for name in ("one", "other")]
    assert {(word.wide, word.magnitude) for word in words} == {("int128", "uint128")}
    assert (_word(32, "one").wide, _word(32, "one").magnitude) == ("std::int64_t", "std::uint64_t")


def test_what_calls_the_library_is_no_constant_expression():
    header = pipeline.compile(catalogue.choose("euler-normalize"), "cpp").files["euler_normalize.hpp"]
    assert "constexpr std::array<double, 4> euler_normalize" not in header
    assert "inline std::array<double, 4> euler_normalize" in header


def test_all_headers_stand_in_one_program_of_strict_compilers(cxx, tmp_path):
    names = []
    for choice in catalogue.standard()[::3]:
        for target in ("cpp", "cpp-float"):
            sources = pipeline.compile(choice, target)
            check_lines(sources)
            names += sources.step_files
            for name, text in sources.step_files.items():
                (tmp_path / name).write_text(text)
    said = checked(cxx, tmp_path, "".join(f'#include "{name}"\n' for name in names) + "int main() {}\n")
    assert said.returncode == 0, said.stderr


def test_fused_operations_and_fast_mathematics_are_refused(cxx, tmp_path):
    sources = pipeline.compile(catalogue.choose("euler"), "cpp")
    (tmp_path / "euler_rk4_2.hpp").write_text(sources.files["euler_rk4_2.hpp"])
    said = checked(cxx, tmp_path, '#include "euler_rk4_2.hpp"\n', "-ffast-math")
    assert "operations must round to double" in said.stderr
