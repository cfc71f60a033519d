"""C++ and Rust: the bits and integers of the C, its contract, strict compilers, and one line where one fails."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from languages import DOUBLE, SAMPLES, check_lines

import strapgen
from strapgen import catalogue, pipeline
from strapgen.catalogue import Choice
from strapgen.ir.exceptions import CompilerError, InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.run import backends, compiler
from strapgen.run.backends import of_sources
from strapgen.run.evaluators import Evaluator
from strapgen.targets.contract_lines import Contract
from strapgen.targets.cpp import constants
from strapgen.targets.naming import Naming
from strapgen.targets.rendering import Macro
from strapgen.targets.rust import _RUST_WORDS, _RustStatementPrinter, module_name

#: The compiler that each target needs, and the target whose bits it has.
TARGETS = {
    **{"cpp": ("c++", "c"), "cpp-float": ("c++", "c-float"), "cpp-fixed": ("c++", "c-fixed")},
    **{"rust": ("rustc", "c"), "rust-float": ("rustc", "c-float"), "rust-fixed": ("rustc", "c-fixed")},
}
FLOATING = [
    pytest.param(name, marks=pytest.mark.needs(TARGETS[name][0])) for name in TARGETS if "fixed" not in name
]
FIXED = [pytest.param(name, marks=pytest.mark.needs(TARGETS[name][0])) for name in TARGETS if "fixed" in name]
#: Words, what is carried, rounding and products: each value once.
SETTINGS = [
    Settings(word=32),
    Settings(word=16, carry="all", rounding="truncation"),
    Settings(word=64, multiply="shift-add"),
    Settings(word=64, carry="full"),
    Settings(word=32, multiply="high"),
    Settings(word=32, multiply="half"),
]
#: Kernels with roots, quotients, selections, products of wide numbers, several outputs and scalars.
SOME = [("euler",), ("dcm-orthonormalize-optimal",), ("euler-from-dcm",), ("euler-normalize",)]


def both(choices: Sequence[Choice], target: str, settings: Settings | None = None) -> list[list[Evaluator]]:
    """Return each kernel on a target and in C, compiled as one library."""
    sources = [
        [pipeline.compile(c, name, settings) for name in (target, TARGETS[target][1])] for c in choices
    ]
    compiler.compile_together(one for pair in sources for one in pair)
    return [[of_sources(one) for one in pair] for pair in sources]


def check_bits(choices: Sequence[Choice], target: str, rng: np.random.Generator) -> None:
    differing = []
    for one, reference in both(choices, target):
        shapes = [(SAMPLES, *signal.shape) for signal in one.function.inputs]
        samples = [rng.uniform(-0.3, 0.3, shape).astype(one.dtype) for shape in shapes]
        results = [evaluator.evaluate(samples, (SAMPLES,)) for evaluator in (one, reference)]
        if any(a.tobytes() != b.tobytes() for a, b in zip(*results, strict=True)):
            differing.append(one.kernel)
    assert differing == []


@pytest.mark.parametrize("target", [case for case in FLOATING if "float" not in case.values[0]])
def test_some_kernels_have_the_bits_of_c(target, rng):
    check_bits([catalogue.choose(*words) for words in DOUBLE], target, rng)


@pytest.mark.long
@pytest.mark.parametrize("target", FLOATING)
def test_every_kernel_has_the_bits_of_c(target, rng):
    check_bits(catalogue.standard(), target, rng)


def answer(evaluator: Evaluator, sample: list[np.ndarray]) -> bytes | str:
    """Return what a function makes of a sample: its outputs and residuals, or why it refuses."""
    try:
        outputs, residuals = evaluator.run(sample, evaluator.fresh(1))
    except InputError as error:
        return str(error)
    return b"".join(array.tobytes() for array in (*outputs, residuals))


def check_integers(
    choices: Sequence[Choice], target: str, settings: Settings, rng: np.random.Generator
) -> None:
    accepted = 0
    for evaluators in both(choices, target, settings):
        ranges = [(a.low, a.high, a.signal.size) for a in evaluators[0].interface.inputs]
        samples = [
            [rng.integers(low, high, size=(1, size)) for low, high, size in ranges] for _ in range(SAMPLES)
        ]
        one, reference = ([answer(evaluator, sample) for sample in samples] for evaluator in evaluators)
        assert one == reference, evaluators[0].kernel
        accepted += sum(isinstance(result, bytes) for result in one)
    assert accepted > SAMPLES * len(choices) / 4


@pytest.mark.parametrize("target", FIXED)
def test_some_kernels_have_the_integers_of_c(target, rng):
    settings = SETTINGS[1] if target == "cpp-fixed" else SETTINGS[0]
    choices = [catalogue.choose(*words) for words in SOME]
    check_integers([choice for choice in choices if can_lower(choice, settings)], target, settings, rng)


@pytest.mark.long
@pytest.mark.every_combination
@pytest.mark.parametrize("settings", SETTINGS, ids=lambda s: f"{s.word}-{s.carry}-{s.rounding}-{s.multiply}")
@pytest.mark.parametrize("target", FIXED)
def test_every_kernel_has_the_integers_of_c(target, settings, rng):
    choices = [choice for choice in catalogue.standard() if can_lower(choice, settings)]
    assert len(choices) >= 30
    check_integers(choices if settings.word == 32 else choices[::3], target, settings, rng)


def can_lower(choice: Choice, settings: Settings) -> bool:
    try:
        pipeline.fixed_program(choice, settings)
    except InputError:
        return False
    return True


@pytest.mark.parametrize("target", TARGETS)
def test_the_contract_is_that_of_the_c_but_for_the_command(target):
    choice, settings = catalogue.choose("euler"), Settings(word=32) if "fixed" in target else None
    (text,) = pipeline.compile(choice, target, settings).step_files.values()
    in_c = pipeline.compile(choice, TARGETS[target][1], settings).files
    (other,) = (in_c[name] for name in in_c if name.endswith(".h") and "_runs" not in name)
    assert Contract.read(text).items == Contract.read(other).items
    assert Contract.read(text).digest != Contract.read(other).digest
    assert ("-ffp-contract" in text) == (target in ("cpp", "cpp-float"))


def written(folder: Path, target: str, settings: Settings | None = None) -> list[str]:
    """Write the files of some kernels without their loops; return their names."""
    names = []
    choices = catalogue.standard()[::4]
    for choice in choices if settings is None else (c for c in choices if can_lower(c, settings)):
        sources = pipeline.compile(choice, target, settings)
        check_lines(sources)
        for name, text in sources.step_files.items():
            (folder / name).write_text(text)
            names.append(name)
    assert len(names) >= 5
    return names


def checked_cpp(
    folder: Path, text: str, *flags: str, compiler: str = "c++"
) -> subprocess.CompletedProcess[str]:
    """Let the C++ compiler check a program in a folder, with all warnings on."""
    (folder / "main.cpp").write_text(text)
    strict = ("-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Wold-style-cast", "-Werror")
    command = [compiler, "-std=c++14", *strict, "-ffp-contract=off", *flags, "-fsyntax-only", "main.cpp"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def built_crate(
    folder: Path, names: list[str], edition: str, *flags: str
) -> subprocess.CompletedProcess[str]:
    """Build a crate without the standard library of the modules in a folder, each warning an error."""
    modules = "".join(f"pub mod {name.removesuffix('.rs')};\n" for name in names)
    (folder / "lib.rs").write_text(f"#![no_std]\n{modules}")
    strict = (f"--edition={edition}", "--crate-type=rlib", "-Dwarnings", "-Cpanic=abort")
    command = ["rustc", *strict, *flags, "lib.rs"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("compiler", "standard"),
    [
        pytest.param(name, standard, marks=pytest.mark.needs(name))
        for name, standard in (("g++", 14), ("g++", 17), ("clang++", 14))
    ],
)
def test_headers_stand_in_one_program_of_a_strict_compiler(tmp_path, compiler, standard):
    names = [name for target in ("cpp", "cpp-float") for name in written(tmp_path, target)]
    names += [n for s in (SETTINGS[0], SETTINGS[3]) for n in written(tmp_path, "cpp-fixed", s)]
    text = "".join(f'#include "{name}"\n' for name in names) + "int main() {}\n"
    said = checked_cpp(tmp_path, text, f"-std=c++{standard}", compiler=compiler)
    assert said.returncode == 0, said.stderr


@pytest.mark.needs("rustc")
def test_modules_stand_in_one_crate_without_the_standard_library_and_never_panic(tmp_path):
    names = [name for target in ("rust", "rust-float") for name in written(tmp_path, target)]
    names += [n for s in (SETTINGS[0], SETTINGS[3]) for n in written(tmp_path, "rust-fixed", s)]
    # Newer compilers leave short functions to the crates that call them, unless told to write all.
    said = built_crate(tmp_path, names, "2021", "-Copt-level=1", "-Clink-dead-code", "--emit=asm")
    assert said.returncode == 0, said.stderr
    assembly = (tmp_path / "lib.s").read_text()
    assert [name for name in names if name.removesuffix(".rs") not in assembly] == []
    assert "panic" not in assembly


@pytest.mark.needs("rustc")
def test_the_oldest_edition_takes_the_text_too(tmp_path):
    names = []
    for kernel in ("euler-normalize", "euler-angles-from-dcm"):
        for name, text in pipeline.compile(catalogue.choose(kernel), "rust").step_files.items():
            (tmp_path / name).write_text(text)
            names.append(name)
    said = built_crate(tmp_path, names, "2015")
    assert said.returncode == 0, said.stderr


#: Processors without an instruction for the product of two words take four products of half words.
SMALL = "-D__ARM_ARCH_6M__"


@pytest.mark.needs("c++")
@pytest.mark.parametrize(("right", "flags"), [(True, ()), (False, ()), (True, (SMALL,))])
def test_a_step_in_fixed_point_is_a_constant_expression(tmp_path, right, flags):
    choice, settings = catalogue.choose("euler"), Settings(word=32)
    sources = pipeline.compile(choice, "cpp-fixed", settings)
    (name,) = sources.step_files
    (tmp_path / name).write_text(sources.files[name])
    reference = of_sources(pipeline.compile(choice, "c-fixed", settings))
    state, increments = [0, 0, 0, 1 << 30], [1 << 20, 0, 0, 1 << 21, 0, 0]
    (outputs, _) = reference.run([np.array([state]), np.array([increments])], reference.fresh(1))
    expected = int(outputs[0][0, 0]) + (not right)
    said = checked_cpp(
        tmp_path,
        f'#include "{name}"\n'
        "constexpr std::int32_t first()\n{\n    std::array<std::int32_t, 4> next{};\n"
        f"    const int status = strapgen::{sources.function.name}({{{{{', '.join(map(str, state))}}}}},\n"
        f"        {{{{{', '.join(map(str, increments))}}}}}, next);\n    return status == 0 ? next[0] : 0;\n}}\n"
        f"static_assert(first() == {expected});\n",
        "-std=c++17",
        *flags,
    )
    assert (said.returncode == 0) == right, said.stderr
    assert right or "static assertion failed" in said.stderr


@pytest.mark.needs("c++")
@pytest.mark.parametrize("right", [True, False])
def test_a_step_is_a_constant_expression(tmp_path, right):
    sources = pipeline.compile(catalogue.choose("euler"), "cpp")
    (tmp_path / "euler_rk4_2.hpp").write_text(sources.files["euler_rk4_2.hpp"])
    state = strapgen.backend("euler").step([0.0, 0.0, 0.0, 1.0], [[0.25, 0.0, 0.0], [0.125, 0.0, 0.0]])
    expected = float(state[0]) if right else float(np.nextafter(state[0], 1))
    said = checked_cpp(
        tmp_path,
        '#include "euler_rk4_2.hpp"\n'
        "constexpr auto next = strapgen::euler_rk4_2(strapgen::euler_rk4_2_identity, {{0.25, 0, 0, 0.125, 0, 0}});\n"
        f"static_assert(next[0] == {expected!r});\n",
        "-std=c++17",
    )
    assert (said.returncode == 0) == right, said.stderr
    assert right or "static assertion failed" in said.stderr


@pytest.mark.needs("c++")
def test_fast_mathematics_without_a_bound_is_refused(tmp_path):
    sources = pipeline.compile(catalogue.choose("dcm-from-euler-angles"), "cpp")
    (tmp_path / "dcm_from_euler_angles.hpp").write_text(sources.files["dcm_from_euler_angles.hpp"])
    said = checked_cpp(tmp_path, '#include "dcm_from_euler_angles.hpp"\n', "-ffast-math")
    assert "operations must round to double" in said.stderr


def test_comment_of_a_constant_fits_the_width():
    def lines(value: str, meaning: str) -> list[str]:
        (text,) = constants([Macro("ONE", value, meaning, "int")])
        return text.split("\n")

    begin, comment = "constexpr int one = ", "/* one */"
    for width in (99, 100):
        value = "1" * (width - len(f"{begin}; {comment}"))
        line = f"{begin}{value};"
        assert lines(value, "one") == ([f"{line} {comment}"] if width == 99 else [comment, line])
        value = "1" * (width - len(f"{begin};"))
        broken = [f"{begin.rstrip()}", f"    {value};"] if width == 100 else [f"{begin}{value};"]
        assert lines(value, "one") == [comment, *broken]


def test_library_calls_are_no_constant_expressions():
    header = pipeline.compile(catalogue.choose("euler-normalize"), "cpp").files["euler_normalize.hpp"]
    assert "constexpr std::array<double, 4> euler_normalize" not in header
    assert "inline std::array<double, 4> euler_normalize" in header


@pytest.mark.parametrize("value", [0, 1, 15, 16, 17, 31, 48, 2**40 - 1, 2**40, 2**40 + 1, -16, -31, -(2**40)])
def test_a_wide_constant_is_its_integer_and_a_power_of_two_from_16_on_says_its_type(value):
    printer = object.__new__(_RustStatementPrinter)
    printer.word = _RUST_WORDS[32]
    text = printer.constant(value, wide=True)
    assert eval(text.replace("_i64", "")) == value
    assert ("_i64" in text) == (abs(value) in {2**k for k in range(4, 63)})


def test_words_of_rust_name_nothing():
    assert module_name("loop") == "loop_Kernel"
    named = Naming(name="match").of(strapgen.lower(strapgen.derive("euler-product")))
    assert {*strapgen.generate(named, "rust").step_files} == {"match_Kernel.rs"}


#: A step that no other test compiles: what is loaded already needs no compiler.
@pytest.mark.parametrize(
    ("backend", "variable", "said"),
    [
        ("cpp", "CXX", "no C++ compiler: 'none' is not on the PATH; install g++ (or set CXX)"),
        ("rust", "RUSTC", "no Rust compiler: 'none' is not on the PATH; install rustc (or set RUSTC)"),
        ("octave", "OCTAVE", "no Octave: 'none' is not on the PATH; install octave (or set OCTAVE)"),
    ],
)
def test_a_program_that_is_missing_is_named_in_one_line(backend, variable, said, monkeypatch):
    monkeypatch.setenv(variable, "none --some-option")
    with pytest.raises(CompilerError) as failure:
        backends.backend("euler", "rk1", 7, backend=backend).propagate(np.zeros((2, 7, 3)))
    assert str(failure.value) == f"{said}, or use the numpy back end"


@pytest.mark.parametrize(
    ("target", "call", "said"),
    [
        pytest.param("cpp", "std::sqrt(", "sqroot", marks=pytest.mark.needs("c++")),
        pytest.param("rust", "unsafe { sqrt(", "error", marks=pytest.mark.needs("rustc")),
    ],
)
def test_compiler_errors_are_reported_in_one_line(target, call, said):
    sources = pipeline.compile(catalogue.choose("euler-normalize"), target)
    broken = {
        name: text.replace(call, call.replace("sqrt", "sqroot")) for name, text in sources.files.items()
    }
    with pytest.raises(CompilerError, match=f"failed on euler-normalize: .*{said}") as caught:
        of_sources(replace(sources, files=broken))
    assert "\n" not in str(caught.value)
