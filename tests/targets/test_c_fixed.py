"""Fixed-point C: whole runs bit for bit those of the model, no undefined behaviour, an error code out of range."""

from __future__ import annotations

import re
import subprocess
from fractions import Fraction
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from cffi import FFI
from derived import FIXED_POINT, program, quantized
from fixed_inputs import corners_and_random
from hypothesis import given
from hypothesis import strategies as st

import strapgen
from strapgen import KernelBuilder, Signal, build, generate, pipeline
from strapgen.catalogue import Choice, choose
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import above, places_above
from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import after
from strapgen.kernel.kernel import Kernel
from strapgen.run.backends import of_sources
from strapgen.run.compiled_code import CEvaluator, ModelEvaluator
from strapgen.storage import resources
from strapgen.targets.c_fixed import _with_comment

#: Steps of Cayley-Klein parameters are those of Euler parameters under other names, which tests/lowering proves.
CHOICES = [choice for choice in FIXED_POINT if not (choice.method and choice.name == "cayley-klein")]
#: Steps of low orders have the code of high ones: they run with the long tests.
LOWERED = [
    pytest.param(
        choice, id=choice.kernel, marks=pytest.mark.long if choice.method in ("rk1", "rk2", "rk3") else ()
    )
    for choice in CHOICES
]
STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror"]
EULER = Choice("euler", "rk4", 2)
#: Methods of all of them, and None for what has no method.
ALL = (None, "rk1", "rk2", "rk3", "rk4")


def choices_of(*methods) -> list[Choice]:
    """Return the choices of these methods."""
    return [
        choice
        for choice in CHOICES
        if choice.method in methods and (methods == ALL or not choice.name.startswith("cayley-klein"))
    ]


@cache
def pair(choice: Choice, settings: Settings) -> tuple[CEvaluator, ModelEvaluator]:
    fixed = quantized(choice, settings)
    return CEvaluator(generate(fixed, "c-fixed")), ModelEvaluator(generate(fixed, "fixed-model"))


#: Random inputs: what a rounding by 16 places does with one value in 65,536 happens to each element some times.
MANY = 250_000


@pytest.mark.long
@pytest.mark.parametrize(
    "settings",
    [
        Settings(16),
        Settings(32),
        Settings(32, rounding="truncation", carry="full"),
        Settings(32, multiply="high"),
        Settings(64, multiply="high"),
        Settings(32, multiply="half"),
    ],
)
@pytest.mark.parametrize("choice", [EULER, Choice("dcm", "rk4", 2)], ids=lambda choice: choice.kernel)
def test_a_quarter_of_a_million_random_inputs(choice, settings, rng):
    in_c, model = pair(choice, settings)
    inputs = corners_and_random(model, MANY, rng)
    residuals = rng.integers(0, 2**settings.word, size=(MANY, len(model.interface.residuals)))
    (computed,), kept = in_c.run(inputs, residuals)
    for rows in np.array_split(np.arange(MANY), MANY // 10_000):  # so few that they stay near the processor
        (wanted,), left = model.run([array[rows] for array in inputs], residuals[rows])
        np.testing.assert_array_equal(computed[rows], wanted)
        np.testing.assert_array_equal(kept[rows], left)


@pytest.mark.parametrize(
    ("word", "carry"),
    [
        (16, "full"),
        *(pytest.param(32, carry, marks=pytest.mark.long) for carry in ("none", "state", "full")),
    ],
)
@pytest.mark.parametrize("choice", [p for p in LOWERED if p.values[0].method])
def test_whole_runs_agree_bit_for_bit(choice, word, carry, rng):
    fixed = quantized(choice, Settings(word, Fraction(1, 60), carry=carry))
    in_c, model = (build(generate(fixed, target)) for target in ("c-fixed", "fixed-model"))
    # Two runs at once, each with error feedback of its own.
    increments = rng.uniform(-1 / 60, 1 / 60, (2, 75, 2, 3))
    np.testing.assert_array_equal(in_c.propagate(increments, 3, 10), model.propagate(increments, 3, 10))


# The contract of the C


def test_a_widened_input_is_refused_and_nothing_is_touched():
    in_c, _ = pair(EULER, Settings(32, Fraction(1, 60), carry="full"))
    ffi, lib = in_c.module.ffi, in_c.module.lib
    call = getattr(lib, in_c.function.name)
    limits = {argument.signal.name: argument.high for argument in in_c.interface.inputs}
    for name, size in (("state", 4), ("increments", 6)):
        for place in range(size):
            for value in (
                limits[name],
                -limits[name],
                limits[name] + 1,
                -limits[name] - 1,
                2**31 - 1,
                -(2**31),
            ):
                state = ffi.new("int32_t[4]", [0, 0, 0, 1 << 30])
                increments = ffi.new("int32_t[6]")
                residuals = ffi.new("uint32_t[8]", [7] * 8)
                out = ffi.new("int32_t[4]", [5] * 4)
                (state if name == "state" else increments)[place] = value
                status = call(state, increments, residuals, out)
                refused = abs(value) > limits[name]
                assert status == (1 if refused else 0)
                assert (list(out) == [5] * 4 and list(residuals) == [7] * 8) == refused


def test_refused_calls_leave_outputs_and_residuals_alone(rng):
    in_c, _ = pair(Choice("dcm-orthonormalize-second-order"), Settings(16, carry="full"))
    ffi, call = in_c.module.ffi, getattr(in_c.module.lib, in_c.function.name)
    (argument,) = in_c.interface.inputs
    refused = 0
    for row in rng.integers(argument.low, argument.high, size=(2000, 9), endpoint=True).tolist():
        residuals, out = ffi.new("uint16_t[9]", [7] * 9), ffi.new("int16_t[9]", [5] * 9)
        if call(ffi.new("int16_t[9]", row), residuals, out):
            refused += 1
            assert list(residuals) == [7] * 9 and list(out) == [5] * 9
    assert refused > 200


def test_an_output_may_be_the_input():
    in_c, _ = pair(EULER, Settings(32, Fraction(1, 60), carry="full"))
    ffi, call = in_c.module.ffi, getattr(in_c.module.lib, in_c.function.name)
    increments = ffi.new("int32_t[6]", [10**6 * k for k in range(6)])
    state, out = ffi.new("int32_t[4]", [1, 2, 3, 1 << 30]), ffi.new("int32_t[4]")
    first, second = (ffi.new("uint32_t[8]", [7] * 8) for _ in range(2))
    assert call(state, increments, first, out) == 0
    assert call(state, increments, second, state) == 0
    assert (list(state), list(second)) == (list(out), list(first))


def test_arrays_stop_at_the_first_refusal():
    in_c, _ = pair(EULER, Settings(32, Fraction(1, 60), carry="full"))
    states = np.array([[0, 0, 0, 1 << 30]] * 5)
    increments = np.zeros((5, 6), int)
    increments[3, 2] = 2**31 - 1
    with pytest.raises(
        InputError, match=r"refuses its input \(sample 3\): its formats were chosen for state up to"
    ):
        in_c.run([states, increments], in_c.fresh(5))


def test_a_run_says_where_it_was_refused():
    fixed = quantized(Choice("dcm", "rk1", 2), Settings(32, Fraction(1, 8)))
    for target in ("c-fixed", "fixed-model"):
        made = build(generate(fixed, target))
        with pytest.raises(InputError, match="dcm-rk1-2 refuses its input in step 11"):
            made.propagate(np.full((20, 2, 3), 0.05))
    with pytest.raises(
        InputError, match=r"increments holds 0\.2; the formats of dcm-rk1-2 were chosen for at most 0\.125"
    ):
        made.propagate(np.full((20, 2, 3), 0.2))


def test_loops_refuse_bad_arguments():
    fixed = quantized(EULER, Settings(32))
    made = build(generate(fixed, "c-fixed"))
    module = made.evaluator.module
    propagate, ffi = getattr(module.lib, f"{made.sources.function.name}_propagate"), module.ffi
    array, history = ffi.new("int32_t[6]"), ffi.new("int32_t[8]", [9] * 8)
    null = ffi.NULL
    assert propagate(1, 1, 0, 0, null, array, array, history, null) == 4
    assert propagate(1, 1, 1, 1, null, array, array, history, null) == 4
    assert propagate(1, 1, 1, 0, null, null, array, history, null) == 4
    assert propagate(1, 1, 1, 0, null, array, null, history, null) == 4
    assert propagate(1, 1, 1, 0, null, array, array, null, null) == 4
    assert list(history) == [9] * 8


@pytest.mark.long
@pytest.mark.needs("c++")
@pytest.mark.parametrize(
    ("word", "methods"),
    [(16, ALL), (32, ALL), (64, ("rk4", None))],
)
def test_strict_compilers_are_silent(word, methods, tmp_path):
    files = []
    for choice in choices_of(*methods):
        sources = generate(quantized(choice, Settings(word, Fraction(1, 60), carry="full")), "c-fixed")
        for name, text in sources.files.items():
            (tmp_path / name).write_text(text)
            files += [name] * name.endswith(".c")
    (tmp_path / "all.inc").write_text("".join(f'#include "{name}"\n' for name in files))
    commands = [
        ["cc", *STRICT, "-fsyntax-only", *files],  # each by itself
        ["c++", "-x", "c++", "-std=c++14", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "all.inc"],
    ]
    if word == 64:  # shorter words are compiled with optimization where their semantics are looked at
        commands.append(["cc", *STRICT, "-O2", "-c", "-o", "all.o", "-x", "c", "all.inc"])
    for command in commands:
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        assert not done.returncode, done.stderr


def test_note_follows_a_statement_if_the_line_has_room():
    """A function indents by 4, so that 95 of its own are 99 of the file."""
    statement, end = "x = y;", " /* note */"
    for width in (95, 96):
        padded = statement.rjust(width - len(end))
        assert _with_comment(padded, "note") == padded + (end if width == 95 else f"\n       {end}")
    assert _with_comment(f"{'x' * 95}\n{statement}", "note") == f"{'x' * 95}\n{statement}{end}", (
        "the last line counts"
    )


def test_the_source_is_integers_alone():
    """But for the version and the units, which headers define for code around it."""
    texts = [path.read_text() for path in (resources.folder("generated") / "c_fixed").glob("*.[ch]")]
    assert len(texts) > 50
    for text in (*texts, *generate(quantized(EULER, Settings(carry="full")), "c-fixed").files.values()):
        code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
        code = re.sub(r"^#define \w+_(UNIT|VERSION) .*$", "", code, flags=re.MULTILINE)
        assert not re.search(r"\b(float|double|math\.h|sqrt|\d+\.\d)", code)


def test_the_header_states_format_unit_range_and_error():
    fixed = quantized(EULER, Settings.of(max_rate_deg_s=400, step="0.01", increments=2, carry="full"))
    header = generate(fixed, "c-fixed").files["euler_rk4_2_w32.h"]
    text = re.sub(r"\s+\*?\s*", " ", header)
    for argument in (*fixed.interface.inputs, *fixed.interface.outputs):
        unit = f"2^-{argument.format.fraction}" + (" rad" if argument.signal.unit == "rad" else "")
        assert f"{argument.signal.name}[{argument.signal.size}]: {argument.signal.meaning};" in text
        assert f"format {argument.format}, unit {unit}; range {argument.low} to {argument.high} (" in text
    worst = fixed.error_bounds["next"]
    assert f"error <= {above(worst)} ({places_above(worst * 2**30)} ulp)" in text
    assert "Attitude error by rounding after N steps: at most" in text
    assert "--max-rate-deg-s 400 --step 0.01 --rounding nearest --carry full --drift-allowance 1/16" in text


# Sanitizers

_HARNESS = """
static int run_{name}(void)
{{
    {word} in[{inputs}], out[{outputs}];
    {residual} kept[{kept} + 1];
    long long value;
    for (;;) {{
        for (int k = 0; k < {inputs}; ++k) {{
            if (scanf("%lld", &value) != 1)
                return 0;
            in[k] = ({word})value;
        }}
        for (int k = 0; k < {kept}; ++k) {{
            if (scanf("%lld", &value) != 1)
                return 1;
            kept[k] = ({residual})value;
        }}
        for (int k = 0; k < {outputs}; ++k)
            out[k] = 0;
        printf("%d", {name}({arguments}));
        for (int k = 0; k < {outputs}; ++k)
            printf(" %lld", (long long)out[k]);
        for (int k = 0; k < {kept}; ++k)
            printf(" %llu", (unsigned long long)kept[k]);
        puts("");
    }}
}}
"""

#: Sanitizers check code without optimization at every operation of the source. Where they find no overflow, code that
#: wraps around or traps computes the same, and an optimizer has nothing to build on.
BUILDS = {
    "plain": [*STRICT, "-O2"],
    "sanitized": ["-O0", "-fsanitize=undefined,address", "-fno-sanitize-recover=all"],
}


def harness(sources) -> str:
    """Return the C that runs a kernel on lines of integers."""
    interface, name = sources.fixed, sources.function.name
    word = interface.settings.word
    places, offset = [], 0
    for argument in interface.inputs:
        places.append(f"in + {offset}")
        offset += argument.signal.size
    arguments = [*places, *(["kept"] if interface.residuals else [])]
    size = 0
    for argument in interface.outputs:
        arguments.append(f"out + {size}")
        size += argument.signal.size
    return _HARNESS.format(
        name=name,
        word=f"int{word}_t",
        residual=f"uint{word}_t",
        inputs=offset,
        outputs=size,
        kept=len(interface.residuals),
        arguments=", ".join(arguments),
    )


def built(folder: Path, every, flags: list[str]) -> Path:
    """Compile all kernels and one program that runs the one that it is told."""
    folder.mkdir()
    names = [sources.function.name for sources in every]
    for sources in every:
        for file, text in sources.files.items():
            (folder / file).write_text(text)
    main = [
        # One text of all kernels takes the compiler half as long: their static names are different.
        *("#include <stdio.h>", "#include <string.h>", *(f'#include "{name}.c"' for name in names)),
        *map(harness, every),
        "int main(int count, char **words)",
        "{",
        *(
            f'    if (count > 1 && !strcmp(words[1], "{name}"))\n        return run_{name}();'
            for name in names
        ),
        "    return 2;",
        "}",
    ]
    (folder / "main.c").write_text("\n".join(main) + "\n")
    command = ["cc", "-std=c99", *flags, "main.c", "-o", "main"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert not done.returncode, done.stderr
    return folder / "main"


@pytest.mark.long
@pytest.mark.parametrize(("word", "methods"), [(16, (None, "rk3")), (32, (None, "rk4"))])
def test_no_undefined_behaviour(word, methods, tmp_path, rng):
    settings = Settings(word, Fraction(1, 60), carry="full")
    every = {choice: quantized(choice, settings) for choice in choices_of(*methods)}
    sources = {choice: generate(fixed, "c-fixed") for choice, fixed in every.items()}
    programs = {name: built(tmp_path / name, sources.values(), flags) for name, flags in BUILDS.items()}

    for choice in every:
        model = ModelEvaluator(generate(every[choice], "fixed-model"))
        inputs = np.hstack(corners_and_random(model, 300, rng))
        # Some far outside: any integer of the word is a lawful argument.
        inputs[::10] = rng.integers(-(2 ** (word - 1)), 2 ** (word - 1), size=inputs[::10].shape)
        kept = rng.integers(0, 2**word, size=(300, len(model.interface.residuals)))
        given = "\n".join(" ".join(map(str, row)) for row in np.hstack([inputs, kept]).tolist())
        said = {}
        for name, file in programs.items():
            command = [file, sources[choice].function.name]
            done = subprocess.run(command, input=given, capture_output=True, text=True, check=False)
            assert not done.returncode and not done.stderr, (name, done.stderr[:500])
            said[name] = done.stdout
        assert said["plain"].count("\n") == 300
        assert "\n1 " in said["plain"] and "\n0 " in said["plain"]
        assert set(said.values()) == {said["plain"]}


def test_header_names_arguments_as_the_prototype_does():
    """A scalar has the name of its only element, which the array must not have."""
    choice = Choice("imu-compensate")
    inputs = program(choice).inputs
    assert any(signal.elements == ("cycle_rate",) for signal in inputs)
    settings = Settings(ranges={signal.name: Fraction(1) for signal in inputs if signal.bound is None})
    files = generate(quantized(choice, settings), "c-fixed").files
    header = files["imu_compensate_w32.h"]
    prototype = header[header.rindex("\nint ") :]
    stated = re.findall(r"^ \* (?:in|out) +(\w+)\[", header, flags=re.MULTILINE)
    assert "cycle_rate_words" in stated
    assert all(f" {name}[" in prototype for name in stated)


#: The product has a second form for processors that multiply words to words alone.
PROCESSORS = {"any": [], "armv6-m": ["-D__ARM_ARCH_6M__"]}
WORDS = (16, 32)


def exported(text: str, name: str) -> str:
    """Return a source with functions that call its static ones."""
    word = 16 if "int16_t state" in text else 32
    kinds = {
        "out": f"int{word}_t",
        "mul": f"int{word}_t",
        "fit": f"int{2 * word}_t",
        "shr": f"int{2 * word}_t",
    }
    lines = [text]
    for helper, kind in kinds.items():
        (result,) = re.findall(rf"^static inline (\w+) {name}_{helper}\(", text, flags=re.MULTILINE)[:1]
        second = "int" if helper in ("fit", "shr") else kind
        lines.append(f"{result} {helper}({kind} x, {second} y) {{ return {name}_{helper}(x, y); }}")
    return "\n".join(lines)


@pytest.fixture(scope="module", params=[(word, processor) for word in WORDS for processor in PROCESSORS])
def arithmetic(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    word, processor = request.param
    folder: Path = tmp_path_factory.mktemp("arithmetic")
    sources = pipeline.compile(choose("euler", "rk4"), "c-fixed", Settings(word))
    name = sources.function.name
    for file, text in sources.step_files.items():
        (folder / file).write_text(exported(text, name) if file.endswith(".c") else text)
    command = [
        "cc",
        "-std=c99",
        "-O1",
        "-shared",
        "-fPIC",
        *PROCESSORS[processor],
        f"{name}.c",
        "-o",
        "its.so",
    ]
    subprocess.run(command, cwd=folder, check=True)
    ffi = FFI()
    ffi.cdef(
        f"int out(int{word}_t, int{word}_t); int{2 * word}_t mul(int{word}_t, int{word}_t);"
        f"int{word}_t fit(int{2 * word}_t, int); int{2 * word}_t shr(int{2 * word}_t, int);"
    )
    return SimpleNamespace(lib=ffi.dlopen(str(folder / "its.so")), word=word, keep=ffi)


def signed(word: int, least: int | None = None) -> st.SearchStrategy[int]:
    """Return numbers of a word, those near powers of two more often than others."""
    top = 1 << (word - 1)
    near = st.builds(
        lambda sign, power, offset: max(-top, min(top - 1, sign * (1 << power) + offset)),
        st.sampled_from((-1, 1)),
        st.integers(0, word - 1),
        st.integers(-2, 2),
    )
    return near | st.integers(-top if least is None else least, top - 1)


@pytest.mark.long
@given(data=st.data())
def test_a_product_is_exact(arithmetic, data):
    a, b = (data.draw(signed(arithmetic.word)) for _ in range(2))
    assert arithmetic.lib.mul(a, b) == a * b


@given(data=st.data())
def test_narrowing_and_shifts_round_down(arithmetic, data):
    x, word = data.draw(signed(2 * arithmetic.word)), arithmetic.word
    shift = data.draw(st.integers(0, 2 * word - 1))
    assert arithmetic.lib.shr(x, shift) == x >> shift
    if -(1 << (word - 1)) <= x >> shift < 1 << (word - 1):  # what the proof of the ranges shows
        assert arithmetic.lib.fit(x, shift) == x >> shift


@pytest.mark.long
@given(data=st.data())
def test_a_number_is_out_if_it_is_larger_than_the_limit(arithmetic, data):
    x, limit = data.draw(signed(arithmetic.word)), data.draw(signed(arithmetic.word, 0).map(abs))
    limit = min(limit, (1 << (arithmetic.word - 1)) - 1)
    assert arithmetic.lib.out(x, limit) == (abs(x) > limit)


STATE = Signal.scalar("level", meaning="output of a lag", bound=Fraction(1, 2))
DRIVE = Signal.scalar("drive", meaning="input of a lag", bound=Fraction(1, 2))


def lag() -> Kernel:
    """Return a lag whose time constant is 1000 cycles."""
    build = KernelBuilder()
    level, drive = build.scalar(STATE), build.scalar(DRIVE)
    build.output(after(STATE), [level + (drive - level) / 1000])
    return build.kernel("lag", "A lag", "test", recursion=Recursion(((STATE.name, after(STATE).name),)))


@pytest.mark.parametrize("target", ["numpy", "c", "c-float"])
def test_floating_point_stores_a_scalar(target):
    evaluator = of_sources(strapgen.generate(strapgen.lower(lag()), target))
    level = np.array([0.25, -0.125], evaluator.dtype)
    drive = np.array([0.5, 0.25], evaluator.dtype)
    expected = level.astype(float) + (drive.astype(float) - level) / 1000
    np.testing.assert_allclose(evaluator(level, drive), expected, rtol=4 * np.finfo(evaluator.dtype).eps)


@pytest.mark.parametrize("carry", ["none", "state"])
@pytest.mark.parametrize("word", [16, 32])
def test_fixed_point_carries_the_one_rounding_of_a_scalar(word, carry):
    fixed = strapgen.quantize(strapgen.lower(lag()), Settings(word=word, carry=carry))
    assert len(fixed.interface.residuals) == (carry == "state")
    in_c, model = (of_sources(strapgen.generate(fixed, target)) for target in ("c-fixed", "fixed-model"))
    highest = fixed.interface.inputs[1].high
    drive = np.array([[highest], [-highest // 3], [1]], in_c.number)
    states = [np.zeros((3, 1), in_c.number)] * 2
    feedback = [evaluator.fresh(3) for evaluator in (in_c, model)]
    for _ in range(50):
        for k, evaluator in enumerate((in_c, model)):
            (states[k],), feedback[k] = evaluator.run([states[k], drive], feedback[k])
        np.testing.assert_array_equal(*states)
        np.testing.assert_array_equal(*feedback)
    assert states[0][0, 0] > 0 > states[0][1, 0]
