"""Names in generated code: whatever a user calls things, every target computes the same and compiles quietly."""

from __future__ import annotations

import keyword
import re
import subprocess
from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import cffi
import numpy as np
import pytest
import sympy as sp
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

import strapgen
from strapgen import targets
from strapgen.catalogue.user import admission
from strapgen.fixedpoint import quantize
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.kernel_info import AttitudeStep
from strapgen.ir.program import Program
from strapgen.ir.signals import Signal
from strapgen.ir.sources import Sources
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.run import compiler, octave
from strapgen.targets import c_library, matlab, names

STRICT = ("-pedantic", "-Wall", "-Wextra", "-Werror")
#: A file that includes all others.
TOGETHER = "all_of_them.c"
STEPS = 19  # more than the loop in C takes together
FIXED = Settings(carry="full")

PYTHON_WORDS = {"lambda", "def", "None", "True", "yield", "match", "await", "print"}
KEYWORDS = sorted(names._C_WORDS | PYTHON_WORDS | matlab._WORDS)
MACROS = ["NULL", "INT32_MAX", "I", "EOF", "NAN", "M_PI", "SIZE_MAX", "INFINITY", "EDOM", "SIGINT"]
_FUNCTIONS_TEXT = """
sqrt sin cos fmax sinf hypot write read index y0 j1 assert memcpy
"""
FUNCTIONS = _FUNCTIONS_TEXT.split()
ODD = [
    *["_", "__", "_x", "x_", "__x", "__debug__", "_Bool", "__LINE__", "_Noreturn", "np_", "state_", "k_"],
    "x" * 70,
]
DERIVED = [
    f"{front}{name}{back}"
    for name in ("x", "s_0", "k")
    for front, back in [
        *(
            ("", back)
            for back in ("_sum", "_words", "_unchecked", "_kept", "_by_element", "_0", "_factor", "_2")
        ),
        *((front, "") for front in ("next_", "residual_", "next_residual_", "shared_", "factor_")),
    ]
]
LETTERS = list("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ")


class Names(NamedTuple):
    """What a step is called, and what is in it: four scalars and four vectors."""

    kernel: str
    stage: str
    output: str
    elements: tuple[str, ...]


HARMLESS = Names("harmless", "turned", "after", tuple(f"element_{k}" for k in "abcdefghijklmnop"))


def step(called: Names) -> Kernel:
    """Return a step with a function of every sort, and names as they are told."""
    square, root, large, chosen, *rest = called.elements
    s, d, t, o = (tuple(rest[k : k + 3]) for k in (0, 3, 6, 9))
    build = KernelBuilder()
    s = build.input(Signal("state", (3,), s, bound=Fraction(1)))
    d = build.input(Signal("increments", (1, 3), d, unit="rad"))
    square = build.value(square, sum(x**2 for x in d))
    root = build.value(root, sp.sqrt(1 + square**3))
    t = build.stage(
        Signal(called.stage, (3,), t),
        [
            sp.cos(d[0]) * s[0] - sp.sin(d[0]) * s[1],
            s[1] * (1 - square / 4) + d[2] / 8,
            s[2] / root + d[1] * d[2],
        ],
    )
    large = build.value(large, sp.Max(t[0], t[1] / 2))
    chosen = build.value(chosen, sp.Piecewise((t[1], s[0] > s[1]), (t[2] / 2, True)))
    build.output(
        Signal(called.output, (3,), o),
        [
            t[0] * sp.Rational(9, 10) + square / 16,
            t[1] * sp.Rational(2, 3) + large / 8,
            t[2] * sp.Rational(4, 5) - chosen / 8,
        ],
    )
    attitude_step = AttitudeStep(None, None, None, (Fraction(0),) * 3)
    return build.kernel(called.kernel, "A step", "this test", attitude_step=attitude_step)


REFERENCE = strapgen.lower(step(HARMLESS))


def printed_names() -> list[str]:
    """Return every name that stands in the code of a step with harmless names, of the code around it and of its own."""
    found: set[str] = set()
    for target in targets.TARGETS:
        texts = strapgen.generate(
            REFERENCE, target, FIXED if targets.TARGETS[target].fixed else None
        ).files.values()
        kind = targets.TARGETS[target].language
        language = {"Python": names.PYTHON, "MATLAB": matlab.MATLAB}.get(kind, names.C)
        found = found.union(*language.scopes(texts))
    return sorted(name for name in found if name.isidentifier())


@cache
def pool() -> list[str]:
    """Return the names that are tried."""
    return sorted(
        {*KEYWORDS, *MACROS, *FUNCTIONS, *ODD, *DERIVED, *LETTERS, *printed_names()} - {"resolution"}
    )


@cache
def kernel_names() -> list[str]:
    """Return the names of kernels that are tried."""
    words = {*pool(), *sorted(c_library.LIBRARY)[::7]}
    return sorted(name for word in words if re.fullmatch(admission._NAME, name := word.replace("_", "-")))


START = np.array([0.3, -0.2, 0.25])
INCREMENTS = np.random.default_rng(7).uniform(-0.1, 0.1, (STEPS, 3))


def reference() -> np.ndarray:
    """Return the states of a run with harmless names."""
    states = [START]
    for increments in INCREMENTS:
        values = dict(
            zip(HARMLESS.elements[4:10], [*map(float, states[-1]), *map(float, increments)], strict=True)
        )
        states.append(np.array(REFERENCE.run(values, float)["after"], float))
    return np.array(states)


EXPECTED = reference()


def module(sources: Sources) -> ModuleType:
    """Return the module of Python sources."""
    ((name, text),) = sources.files.items()
    result = ModuleType(name)
    exec(compile(text, name, "exec"), result.__dict__)
    return result


def declarations(header: str) -> str:
    """Return a header as cffi reads it."""
    return compiler.declarations(header)


def library(folder: Path, several: list[Sources], together: bool) -> tuple[cffi.FFI, object]:
    """Compile C sources in one call of the compiler, together as one text or each alone, and return them loaded."""
    ffi = cffi.FFI()
    for sources in several:
        for file, text in sources.files.items():
            (folder / file).write_text(text)
            if file.endswith(".h"):
                ffi.cdef(declarations(text))
    code = sorted(file for sources in several for file in sources.files if file.endswith(".c"))
    if together:
        (folder / TOGETHER).write_text("".join(f'#include "{file}"\n' for file in code))
        code = [TOGETHER]
    command = [
        "cc",
        "-std=c99",
        *STRICT,
        "-ffp-contract=off",
        "-iquote",
        ".",
        "-shared",
        "-fPIC",
        "-o",
        "all.so",
        *code,
    ]
    done = subprocess.run([*command, "-lm"], cwd=folder, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return ffi, ffi.dlopen(str(folder / "all.so"))


class Lowered(NamedTuple):
    """A step as a program, and in fixed point."""

    program: Program
    fixed: FixedProgram


def lowered(kernel: Kernel) -> Lowered:
    """Return a step as the targets take it."""
    program = strapgen.lower(kernel)
    return Lowered(program, quantize(program, FIXED))


def renamed(step: Lowered, kernel: str) -> Lowered:
    """Return a step under another name of its kernel, which its code otherwise knows nothing of."""
    program = replace(step.program, info=replace(step.program.info, name=kernel), name="")
    return Lowered(program, replace(step.fixed, program=program))


def check_python(step: Lowered) -> np.ndarray:
    """Check the Python targets, and return the run of the integer model."""
    sources = strapgen.generate(step.program, "numpy")
    function = getattr(module(sources), sources.function.name)
    np.testing.assert_allclose(function(EXPECTED[:-1], INCREMENTS[:, None]), EXPECTED[1:], rtol=0, atol=1e-14)
    model = strapgen.generate(step.fixed, "fixed-model")
    function = getattr(module(model), model.function.name)
    state, increments = model.fixed.inputs
    now = [round(x / float(state.format.unit)) for x in START]
    kept = [residual.fresh for residual in model.fixed.residuals]
    states = [now]
    for turn in INCREMENTS:
        now, kept = function(now, [round(x / float(increments.format.unit)) for x in turn], kept)
        states.append(now)
    result = np.array(states)
    np.testing.assert_allclose(result * float(state.format.unit), EXPECTED, rtol=0, atol=1e-7)
    return result


def check_matlab(step: Lowered) -> None:
    """Check that the loop in MATLAB computes the run."""
    sources = strapgen.generate(step.program, "matlab")
    name, turns = f"{sources.function.name}_propagate", INCREMENTS[:, None].transpose(1, 2, 0)
    (history,) = octave.call([sources], name, [START, turns], [(3, STEPS + 1)])
    np.testing.assert_allclose(history.T, EXPECTED, rtol=0, atol=1e-14)


def check_c(folder: Path, steps: list[Lowered], models: list[np.ndarray], together: bool = False) -> None:
    """Check that the C targets compile together and that their loops compute the run."""
    sources = [strapgen.generate(step.program, "c") for step in steps]
    sources += [strapgen.generate(step.program, "c-float") for step in steps]
    fixed = [strapgen.generate(step.fixed, "c-fixed") for step in steps]
    ffi, lib = library(folder, sources + fixed, together)
    for made in sources:
        kind, most = {"c": (np.float64, 1e-14), "c-float": (np.float32, 1e-6)}[made.target]
        real = {np.float64: "double *", np.float32: "float *"}[kind]
        history, start, turns = np.empty((STEPS + 1, 3), kind), START.astype(kind), INCREMENTS.astype(kind)
        arrays = [ffi.cast(real, array.ctypes.data) for array in (start, turns, history)]
        propagate = getattr(lib, f"{made.function.name}_propagate")
        assert propagate(1, STEPS, 1, 0, ffi.NULL, *arrays) == 0
        np.testing.assert_allclose(history, EXPECTED, rtol=0, atol=most)
        before = np.ascontiguousarray(EXPECTED[:-1], kind)
        many, side = np.empty((STEPS, 3), kind), np.empty((3, STEPS), kind)
        getattr(lib, f"{made.function.name}_array")(
            STEPS, *(ffi.cast(real, array.ctypes.data) for array in (before, turns, many))
        )
        rows = [np.ascontiguousarray(array.T) for array in (before, turns)]
        getattr(lib, f"{made.function.name}_batch")(
            STEPS, *(ffi.cast(real, array.ctypes.data) for array in (*rows, side))
        )
        np.testing.assert_allclose(many, EXPECTED[1:], rtol=0, atol=most)
        np.testing.assert_array_equal(side.T, many)
    for made, expected in zip(fixed, models, strict=True):
        _, increments = made.fixed.inputs
        start = expected[0].astype(np.int32)
        turns = np.array(
            [[round(x / float(increments.format.unit)) for x in turn] for turn in INCREMENTS], np.int32
        )
        residuals = np.array([residual.fresh for residual in made.fixed.residuals], np.uint32)
        history = np.empty((STEPS + 1, 3), np.int32)
        pointers = [
            ffi.cast("uint32_t *" if array.dtype == np.uint32 else "int32_t *", array.ctypes.data)
            for array in (start, turns, residuals, history)
        ]
        propagate = getattr(lib, f"{made.function.name}_propagate")
        assert propagate(1, STEPS, 1, 0, ffi.NULL, *pointers, ffi.NULL) == 0
        np.testing.assert_array_equal(history, expected)


@st.composite
def calls(draw: st.DrawFn) -> list[Names]:
    """Draw names for several kernels, which are called differently."""
    kernels = draw(st.lists(st.sampled_from(kernel_names()), min_size=5, max_size=5, unique=True))
    result = []
    for kernel in kernels:
        elements = draw(st.lists(st.sampled_from(pool()), min_size=16, max_size=16, unique=True))
        stage, output = (draw(st.sampled_from(pool())) for _ in range(2))
        result.append(
            Names(kernel, stage, "after" if output in ("state", "increments") else output, tuple(elements))
        )
    return result


@pytest.mark.long
@settings(
    max_examples=2,
    phases=[Phase.generate],  # a failure shows all that it is about; smaller ones would take minutes
    derandomize=True,
    deadline=None,
    database=None,
)
@given(several=calls())
def test_every_target_computes_the_same_under_any_names(several, tmp_path_factory):
    kernels = [step(called) for called in several]
    for kernel in kernels:
        admission._require_names(kernel)
        admission._require_formulas(kernel)
    steps = list(map(lowered, kernels))
    check_c(tmp_path_factory.mktemp("names"), steps, list(map(check_python, steps)))
    if not octave.missing():
        for one in steps:
            check_matlab(one)


#: Kernels that are called as functions, headers and keywords are.
_KNOWN_TEXT = """
hypot write step main read index y0 j1 int32-t lambda np numpy math stdint int double sqrt size-t
errno true class k one isqrt abs isinstance string
"""
KNOWN = _KNOWN_TEXT.split()


@pytest.mark.long
def test_kernels_are_called_as_functions_of_the_library_are(tmp_path):
    for name in KNOWN:
        admission._require_names(step(HARMLESS._replace(kernel=name)))
    harmless = lowered(step(HARMLESS))
    steps = [renamed(harmless, name) for name in KNOWN]
    check_c(tmp_path, steps, list(map(check_python, steps)), together=True)
    # Where no standard is asked for, compilers and headers know more functions.
    command = ["cc", "-std=gnu11", *STRICT, "-fsyntax-only", "-iquote", ".", TOGETHER]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_names_that_are_free_stay_as_they_are():
    assert [names.external(name) for name in ("euler_rk4_2", "picard", "mine_array")] == [
        "euler_rk4_2",
        "picard",
        "mine_array",
    ]
    elements = tuple("abcdefghilmnopqr")
    for target in ("c", "numpy"):
        sources = strapgen.generate(strapgen.lower(step(HARMLESS._replace(elements=elements))), target)
        text = "".join(sources.files.values())
        assert all(re.search(rf"^ *(const double )?{name} = ", text, re.MULTILINE) for name in elements[:4])
        assert sources.function.name == "harmless"


def test_names_that_would_become_the_same_are_kept_apart():
    chosen = ("int", "int_", "k", "k_", "np", "np_", "int_v2", "double", "double_", "batch", "batch_")
    elements = (*chosen, *HARMLESS.elements[len(chosen) :])
    kernel = step(HARMLESS._replace(elements=elements))
    check_python(lowered(kernel))
    sources = strapgen.generate(strapgen.lower(kernel), "c")
    text = sources.files["harmless.c"]
    assert all(
        f"const double {name} = " in text for name in ("int_v3", "int_", "k_v2", "k_", "double_v2", "double_")
    )


@pytest.mark.long
def test_the_interface_keeps_the_names_of_the_kernel():
    called = HARMLESS._replace(elements=(*"kqjp", "i", "count", "out", "batch", "x", "status", *"abcdef"))
    for target in targets.TARGETS:
        settings_ = FIXED if targets.TARGETS[target].fixed else None
        sources = strapgen.generate(strapgen.lower(step(called)), target, settings_)
        assert [signal.elements for signal in sources.function.inputs] == [
            ("i", "count", "out"),
            ("batch", "x", "status"),
        ]


def test_the_model_speaks_of_the_names_of_the_kernel():
    called = HARMLESS._replace(kernel="for", stage="k", elements=("if", *HARMLESS.elements[1:]))
    model = strapgen.generate(strapgen.lower(step(called)), "fixed-model", FIXED)
    assert '"if"' in "".join(model.files.values())


def test_macros_of_the_headers_that_generated_code_includes_are_no_names():
    headers = "".join(f"#include <{name}.h>\n" for name in ("stddef", "stdint", "math", "string"))
    command = ["cc", "-std=gnu99", "-dM", "-E", "-x", "c", "-"]
    said = subprocess.run(command, input=headers, capture_output=True, text=True, check=True).stdout
    macros = re.findall(r"^#define ([A-Za-z]\w*) ", said, re.MULTILINE)
    assert len(macros) > 50
    assert [name for name in macros if names.C.allows(name)] == []


def test_functions_of_the_headers_that_generated_code_includes_are_no_kernels():
    headers = "".join(f"#include <{name}.h>\n" for name in ("stdint", "math", "string", "stdlib", "stdio"))
    command = ["cc", "-std=gnu99", "-E", "-P", "-x", "c", "-"]
    said = subprocess.run(command, input=headers, capture_output=True, text=True, check=True).stdout
    functions = set(re.findall(r"\b([a-z][a-z0-9]*(?:_[a-z0-9]+)*) ?\([^;{]*\)[^;{]*;", said))
    assert {"hypot", "memcpy", "fopen"} < functions
    assert sorted(name for name in functions if names.external(name) == name) == []


@pytest.mark.parametrize("word", sorted({*keyword.kwlist, "__debug__"}))
def test_keywords_of_python_are_no_names(word):
    assert not names.PYTHON.allows(word)


def test_names_of_common_subexpressions_are_free_for_elements():
    taken = [f"{front}_{number}" for front in ("shared", "factor") for number in range(1, 9)]
    for elements in (tuple(taken), tuple(reversed(taken))):
        check_python(lowered(step(HARMLESS._replace(elements=elements))))


def test_a_function_is_found_in_its_module_whatever_the_process_has():
    # No standard knows this function; the library of this process may.
    kernel = step(HARMLESS._replace(kernel="gnu-get-libc-version"))
    sources = strapgen.generate(strapgen.lower(kernel), "c")
    module = compiler.load(sources)
    result = module.ffi.new("double[3]")
    getattr(module.lib, sources.function.name)(list(START), list(INCREMENTS[0]), result)
    np.testing.assert_allclose(list(result), EXPECTED[1], rtol=0, atol=1e-14)
