"""The Rust of kernels: a compiler that warns of nothing, no panic."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from languages import check_lines

import strapgen
from strapgen import catalogue, pipeline
from strapgen.ir.exceptions import CompilerError
from strapgen.run.compiler import COMPILERS
from strapgen.targets.names import Naming
from strapgen.targets.rust.fixed import _WORDS, _RustStatementPrinter
from strapgen.targets.rust.text import module_name


@pytest.fixture
def rustc() -> str:
    """The path of the Rust compiler."""
    try:
        return COMPILERS["Rust"].path()
    except CompilerError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize("value", [0, 1, 15, 16, 17, 31, 48, 2**40 - 1, 2**40, 2**40 + 1, -16, -31, -(2**40)])
def test_a_wide_constant_is_its_integer_and_a_power_of_two_from_16_on_says_its_type(value):
    printer = object.__new__(_RustStatementPrinter)
    printer.word = _WORDS[32]
    text = printer.constant(value, wide=True)
    assert eval(text.replace("_i64", "")) == value
    assert ("_i64" in text) == (abs(value) in {2**k for k in range(4, 63)})


def crate(folder: Path, choices: list, *targets: str) -> list[str]:
    """Write a crate without the standard library of the modules of some kernels; return their names."""
    names = []
    for choice in choices:
        for target in targets:
            sources = pipeline.compile(choice, target)
            check_lines(sources)
            for name, text in sources.step_files.items():
                (folder / name).write_text(text)
                names.append(name.removesuffix(".rs"))
    (folder / "lib.rs").write_text("#![no_std]\n" + "".join(f"pub mod {name};\n" for name in names))
    return names


def built(rustc: str, folder: Path, edition: int, *flags: str) -> subprocess.CompletedProcess[str]:
    command = [
        rustc,
        f"--edition={edition}",
        "--crate-type=rlib",
        "-Dwarnings",
        "-Cpanic=abort",
        *flags,
        "lib.rs",
    ]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_modules_stand_in_one_crate_without_the_standard_library_and_never_panic(rustc, tmp_path):
    names = crate(tmp_path, list(catalogue.standard())[::4], "rust", "rust-float")
    # Newer compilers leave short functions to the crates that call them, unless told to write all.
    said = built(rustc, tmp_path, 2021, "-Copt-level=1", "-Clink-dead-code", "--emit=asm")
    assert said.returncode == 0, said.stderr
    assembly = (tmp_path / "lib.s").read_text()
    assert [name for name in names if name not in assembly] == []
    assert "panic" not in assembly


def test_the_oldest_edition_takes_the_text_too(rustc, tmp_path):
    crate(tmp_path, [catalogue.choose(name) for name in ("euler-normalize", "euler-angles-from-dcm")], "rust")
    said = built(rustc, tmp_path, 2015)
    assert said.returncode == 0, said.stderr


def test_words_of_rust_name_nothing():
    assert module_name("loop") == "loop_Kernel"
    named = Naming(name="match").of(strapgen.lower(strapgen.derive("euler-product")))
    assert {*strapgen.generate(named, "rust").step_files} == {"match_Kernel.rs"}
