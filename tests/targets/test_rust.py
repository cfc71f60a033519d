"""The Rust of kernels: bits of the C, a compiler that warns of nothing, no panic, and what is told without one."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from commands import run
from languages import DOUBLE, check_bits_of_c, check_lines

import strapgen
from strapgen import catalogue, pipeline
from strapgen.ir.exceptions import CompilerError
from strapgen.run.backends import of_sources
from strapgen.run.compiler import COMPILERS
from strapgen.targets.contract_lines import Contract
from strapgen.targets.names import Naming
from strapgen.targets.rust.fixed import _WORDS, _RustStatementPrinter
from strapgen.targets.rust.text import module_name

#: A step that no other test compiles: what is loaded already needs no compiler.
SIMULATE = "simulate euler --method rk1 --increments 7 --motion sinusoidal --set a_deg_s=1 b_deg_s=1 --step 1"


@pytest.fixture
def rustc() -> str:
    """The path of the Rust compiler."""
    try:
        return COMPILERS["Rust"].path()
    except CompilerError as error:
        pytest.skip(str(error))


def test_some_kernels_have_the_bits_of_c(rustc, rng):
    check_bits_of_c([catalogue.choose(*words) for words in DOUBLE], "rust", "c", rng)


@pytest.mark.long
@pytest.mark.parametrize(("other", "c"), [("rust", "c"), ("rust-float", "c-float")])
def test_every_kernel_has_the_bits_of_c(rustc, other, c, rng):
    check_bits_of_c(catalogue.standard(), other, c, rng)


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


def test_the_contract_of_a_module_is_that_of_the_c_but_for_the_command():
    choice = catalogue.choose("euler")
    module = pipeline.compile(choice, "rust").files["euler_rk4_2.rs"]
    other = pipeline.compile(choice, "c").files["euler_rk4_2.h"]
    assert Contract.read(module).items == Contract.read(other).items
    assert Contract.read(module).digest != Contract.read(other).digest
    assert "-ffp-contract" not in module


def test_words_of_rust_name_nothing():
    assert module_name("loop") == "loop_Kernel"
    named = Naming(name="match").of(strapgen.lower(strapgen.derive("euler-product")))
    assert {*strapgen.generate(named, "rust").step_files} == {"match_Kernel.rs"}


def test_without_a_compiler_one_line_says_which_is_missing(monkeypatch, capsys):
    monkeypatch.setenv("RUSTC", "no-such-compiler")
    run([*SIMULATE.split(), "--duration", "2", "--backend", "rust"], 2)
    assert capsys.readouterr().err == (
        "strapgen: no Rust compiler: 'no-such-compiler' is not on the PATH; install rustc (or set RUSTC), or use the "
        "numpy back end\n"
    )


def test_what_does_not_compile_is_told_in_one_line(rustc):
    sources = pipeline.compile(catalogue.choose("euler-normalize"), "rust")
    broken = {
        name: text.replace("unsafe { sqrt(", "unsafe { sqroot(") for name, text in sources.files.items()
    }
    with pytest.raises(CompilerError, match=r"failed on euler-normalize: .*error") as caught:
        of_sources(replace(sources, files=broken))
    assert "\n" not in str(caught.value)
