"""Fixed point in C++ and Rust: integers of the C for every word and rounding, compilers that warn of nothing."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from languages import check_integers_of_c, check_lines

from strapgen import catalogue, pipeline
from strapgen.catalogue import Choice
from strapgen.ir.exceptions import CompilerError, InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.run.backends import of_sources
from strapgen.run.compiler import COMPILERS
from strapgen.targets.contract_lines import Contract

LANGUAGES = {"cpp-fixed": "C++", "rust-fixed": "Rust"}
#: Words, what is carried, rounding and products: each value once.
SETTINGS = [
    Settings(word=32),
    Settings(word=16, carry="all", rounding="truncation"),
    Settings(word=64, multiply="shift-add"),
    Settings(word=64, carry="full"),
]
#: Kernels with roots, quotients, selections, products of wide numbers, several outputs and scalars.
SOME = [("euler",), ("dcm-orthonormalize-optimal",), ("euler-from-dcm",), ("euler-normalize",)]


@pytest.fixture(params=LANGUAGES)
def target(request: pytest.FixtureRequest) -> str:
    """Name of a target whose compiler is on this machine."""
    _compiler(request.param)
    return request.param


def _compiler(target: str) -> str:
    try:
        return COMPILERS[LANGUAGES[target]].path()
    except CompilerError as error:
        pytest.skip(str(error))


def can_lower(choice: Choice, settings: Settings) -> bool:
    try:
        pipeline.fixed_program(choice, settings)
    except InputError:
        return False
    return True


def test_some_kernels_have_the_integers_of_c(target, rng):
    settings = SETTINGS[1] if target == "cpp-fixed" else SETTINGS[0]
    choices = [catalogue.choose(*words) for words in SOME]
    check_integers_of_c([c for c in choices if can_lower(c, settings)], target, settings, rng)


@pytest.mark.long
@pytest.mark.parametrize("settings", SETTINGS, ids=lambda s: f"{s.word}-{s.carry}-{s.rounding}-{s.multiply}")
def test_every_kernel_has_the_integers_of_c(target, settings, rng):
    choices = [choice for choice in catalogue.standard() if can_lower(choice, settings)]
    assert len(choices) >= 30
    check_integers_of_c(choices if settings.word == 32 else choices[::3], target, settings, rng)


def written(folder: Path, target: str, settings: Settings) -> list[str]:
    """Write the files of some kernels without their loops; return their names."""
    names = []
    for choice in (choice for choice in catalogue.standard()[::4] if can_lower(choice, settings)):
        sources = pipeline.compile(choice, target, settings)
        check_lines(sources)
        for name, text in sources.step_files.items():
            (folder / name).write_text(text)
            names.append(name)
    assert len(names) >= 5
    return names


def test_headers_stand_in_one_program_of_a_strict_compiler(tmp_path):
    compiler = _compiler("cpp-fixed")
    names = [n for s in (SETTINGS[0], SETTINGS[3]) for n in written(tmp_path, "cpp-fixed", s)]
    (tmp_path / "main.cpp").write_text("".join(f'#include "{name}"\n' for name in names) + "int main() {}\n")
    strict = ("-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Wold-style-cast", "-Werror")
    command = [compiler, "-std=c++17", *strict, "-fsyntax-only", "main.cpp"]
    said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert said.returncode == 0, said.stderr


def test_modules_stand_in_one_crate_of_a_strict_compiler(tmp_path):
    compiler = _compiler("rust-fixed")
    names = [n for s in (SETTINGS[0], SETTINGS[3]) for n in written(tmp_path, "rust-fixed", s)]
    modules = "".join(f"pub mod {name.removesuffix('.rs')};\n" for name in names)
    (tmp_path / "lib.rs").write_text(f"#![no_std]\n{modules}")
    command = [compiler, "--edition=2021", "--crate-type=rlib", "-Dwarnings", "-Cpanic=abort", "lib.rs"]
    said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert said.returncode == 0, said.stderr


#: Processors without an instruction for the product of two words take four products of half words.
SMALL = "-D__ARM_ARCH_6M__"


@pytest.mark.parametrize(("right", "flags"), [(True, ()), (False, ()), (True, (SMALL,)), (False, (SMALL,))])
def test_a_step_of_c_plus_plus_is_a_constant_expression(tmp_path, right, flags):
    compiler = _compiler("cpp-fixed")
    choice, settings = catalogue.choose("euler"), Settings(word=32)
    sources = pipeline.compile(choice, "cpp-fixed", settings)
    (name,) = sources.step_files
    (tmp_path / name).write_text(sources.files[name])
    reference = of_sources(pipeline.compile(choice, "c-fixed", settings))
    state, increments = [0, 0, 0, 1 << 30], [1 << 20, 0, 0, 1 << 21, 0, 0]
    (outputs, _) = reference.run([_row(state), _row(increments)], reference.fresh(1))
    expected = int(outputs[0][0, 0]) + (not right)
    (tmp_path / "main.cpp").write_text(
        f'#include "{name}"\n'
        "constexpr std::int32_t first()\n{\n    std::array<std::int32_t, 4> next{};\n"
        f"    const int status = strapgen::{sources.function.name}({{{{{', '.join(map(str, state))}}}}},\n"
        f"        {{{{{', '.join(map(str, increments))}}}}}, next);\n    return status == 0 ? next[0] : 0;\n}}\n"
        f"static_assert(first() == {expected});\n"
    )
    command = [compiler, "-std=c++17", "-fsyntax-only", *flags, "main.cpp"]
    said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (said.returncode == 0) == right, said.stderr
    assert right or "static assertion failed" in said.stderr


def _row(numbers: list[int]) -> np.ndarray:
    return np.array([numbers])


def test_the_contract_is_that_of_the_c_but_for_the_command(target):
    choice, settings = catalogue.choose("euler"), Settings(word=32)
    (text,) = pipeline.compile(choice, target, settings).step_files.values()
    other = pipeline.compile(choice, "c-fixed", settings).files["euler_rk4_2_w32.h"]
    assert Contract.read(text).items == Contract.read(other).items
    assert Contract.read(text).digest != Contract.read(other).digest
