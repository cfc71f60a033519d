"""The C target: strict compilation, aliasing, the contract of propagate, operation counts, literals, headers."""

from __future__ import annotations

import ctypes
import math
import platform
import re
import shutil
import subprocess
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cffi import FFI
from derived import programs, tells_more
from hypothesis import example, given
from hypothesis import strategies as st
from pycparser import c_ast, c_parser

from strapgen import pipeline
from strapgen.catalogue import choose, standard
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.run.compiled_code import CEvaluator
from strapgen.run.compiler import C_FLAGS, compile_together
from strapgen.targets.c import DOUBLE, FLOAT, CPrinter

STRICT = ["-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Werror", "-pedantic"]
COMPILERS = {
    "gcc": ["gcc", "-std=c99"],
    "clang": ["clang", "-std=c99"],
    "g++": ["g++", "-std=c++11", "-x", "c++"],
    "clang++": ["clang++", "-std=c++11", "-x", "c++"],
}
TARGETS = ("c", "c-float")
#: A file with the loops that gcc has turned into vectors.
OPTIMIZED = "optimized.txt"
DTYPES = {"c": np.float64, "c-float": np.float32}
CHOICES = {choice.kernel: choice for choice in standard()}
STEPS = ["dcm-rk1-2", "dcm-rk4-2", "euler-rk4-2"]
#: A step of a user whose transition is larger than its state.
RODRIGUES = str(Path(__file__).resolve().parents[2] / "examples" / "modified_rodrigues.py")
#: By their names; those whose code differs in more than coefficients.
KERNELS = [kernel for kernel, choice in CHOICES.items() if tells_more(choice) or kernel in STEPS]


#: What is compiled into one library: the steps, and what restores their states.
COMPILED = [*STEPS, "dcm-orthonormalize", "euler-normalize"]


@cache
def generated(kernel: str, target: str) -> Sources:
    """Return the sources of a kernel of the catalogue, which one process of the session emits for all."""
    return pipeline.compile(CHOICES[kernel], target)


def text_of(sources: Sources, ending: str) -> str:
    """Return the text of the file of the step, or of the kernel, itself."""
    (text,) = (text for name, text in sources.step_files.items() if name.endswith(ending))
    return text


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the C of the standard catalogue in both types."""
    place = tmp_path_factory.mktemp("sources")
    for kernel in KERNELS:
        for target in TARGETS:
            for name, text in generated(kernel, target).files.items():
                (place / name).write_text(text)
    return place


def needed(program: str) -> str:
    path = shutil.which(program)
    if path is None:
        pytest.skip(f"{program} is not on this machine")
    return path


# Compilation


@pytest.mark.parametrize("compiler", COMPILERS)
def test_whole_catalogue_compiles_without_a_warning(compiler, folder):
    command = COMPILERS[compiler]
    needed(command[0])
    files = sorted(path.name for path in folder.glob("*.c"))
    assert len(files) == 2 * 2 * len(KERNELS)
    together = "".join(f'#include "{name}"\n' for name in files)
    command = [*command, *(() if "++" in compiler else ("-x", "c")), *STRICT, "-fsyntax-only", "-"]
    done = subprocess.run(command, cwd=folder, input=together, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_strict_compilation_can_fail(tmp_path):
    needed("gcc")
    sources = generated("euler-rk4-2", "c-float")
    for name, text in sources.files.items():
        (tmp_path / name).write_text(text.replace("0.5f", "0.5"))
    command = ["gcc", "-std=c99", *STRICT, "-fsyntax-only", str(tmp_path / "euler_rk4_2_float.c")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode != 0
    assert "double" in done.stderr


@pytest.fixture(scope="module")
def objects(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the objects of some steps, one of each type, compiled by gcc as a user would.

    What gcc says of loops stands beside them, in `OPTIMIZED`.
    """
    needed("gcc")
    place = tmp_path_factory.mktemp("objects")
    parts = {f"{target}.c": [f for k in COMPILED for f in generated(k, target).files] for target in TARGETS}
    for part, names in parts.items():
        code = (folder / name for name in names if name.endswith(".c"))
        (place / part).write_text("".join(f'#include "{path}"\n' for path in code))
    command = ["gcc", *C_FLAGS, *STRICT, "-fPIC", "-fopt-info-vec-optimized", "-c", *parts]
    done = subprocess.run(command, cwd=place, capture_output=True, text=True)
    rest = [line for line in done.stderr.splitlines() if ": optimized: " not in line]
    assert (done.returncode, rest) == (0, [])
    (place / OPTIMIZED).write_text(done.stderr)
    return place


@pytest.mark.long
def test_objects_have_no_state_of_their_own(objects):
    needed("nm")
    files = sorted(objects.glob("*.o"))
    assert len(files) == len(TARGETS)
    listing = subprocess.run(
        ["nm", "-A", *map(str, files)], capture_output=True, text=True, check=True
    ).stdout
    kinds: dict[str, set[str]] = {}
    for line in listing.splitlines():
        *_, kind, name = line.split()
        kinds.setdefault(kind, set()).add(name)
    assert kinds["T"] >= {"euler_rk4_2", "euler_rk4_2_float_propagate"}
    assert kinds["T"] >= {
        generated(kernel, target).function.name for kernel in COMPILED for target in TARGETS
    }
    # Code and read-only data; functions of the C library, and what the compiler knows of the processor. No data (d),
    # no zeroed data (b), nothing common (c).
    assert set(kinds) <= set("TtrRU")
    library = {name.removesuffix("f") for name in kinds["U"] - kinds["T"]} - {"_GLOBAL_OFFSET_TABLE_"}
    assert library <= {*("sqrt", "sin", "cos", "atan2", "fmax", "memcpy", "memmove", "sincos", "__cpu_model")}


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("kernel", KERNELS)
def test_text_has_no_heap_and_no_static_data(kernel, target):
    for text in generated(kernel, target).files.values():
        code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
        assert not re.search(r"\b(malloc|calloc|realloc|alloca|free)\b", code)
        for line in code.splitlines():
            if re.search(r"\b(static|extern)\b", line):
                assert "(" in line or line == 'extern "C" {', f"not a function: {line}"


# One library of the whole catalogue, called through cffi


def declarations(header: str) -> str:
    plain = re.sub(r"#ifdef __cplusplus.*?#endif", "", header, flags=re.DOTALL).replace("\\\n", "")
    return "\n".join(line for line in plain.splitlines() if not line.startswith("#"))


class Library:
    """The compiled catalogue and the memory that it is called with."""

    def __init__(self, path: Path) -> None:
        self.ffi = FFI()
        for kernel in COMPILED:
            for target in TARGETS:
                for name, text in generated(kernel, target).files.items():
                    if name.endswith(".h"):
                        self.ffi.cdef(declarations(text))
        self.lib = self.ffi.dlopen(str(path))

    def pointer(self, array: np.ndarray) -> Any:
        assert array.flags.c_contiguous
        return self.ffi.from_buffer("float[]" if array.dtype == np.float32 else "double[]", array)

    def function(self, sources: Sources, suffix: str = "") -> Any:
        return getattr(self.lib, sources.function.name + suffix)


@pytest.fixture(scope="module")
def library(objects: Path, tmp_path_factory: pytest.TempPathFactory) -> Library:
    path = tmp_path_factory.mktemp("library") / "catalogue.so"
    files = sorted(str(file) for file in objects.glob("*.o"))
    subprocess.run(["gcc", "-shared", "-o", str(path), *files, "-lm"], check=True)
    return Library(path)


def samples(program: Program, count: int, dtype: Any, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return inputs in proper use: attitudes near orthonormal, all else small."""
    values = {}
    for signal in program.inputs:
        value = 0.3 * rng.normal(size=(count, *signal.shape))
        if signal.shape == (3, 3):
            value = np.linalg.qr(value)[0] + 1e-3 * rng.normal(size=(count, 3, 3))
        if signal.shape == (4,):
            value /= np.linalg.norm(value, axis=1, keepdims=True)
        values[signal.name] = value.astype(dtype)
    return values


def pairs(kernel: str) -> list[tuple[str, str]]:
    """Return names of outputs and inputs of the same shape."""
    program = programs()[kernel]
    return [
        (result.signal.name, signal.name)
        for result in program.outputs
        for signal in program.inputs
        if result.signal.shape == signal.shape and signal.shape
    ]


@pytest.mark.long
@pytest.mark.parametrize("target", TARGETS)
def test_output_may_be_an_input(target, rng):
    checked = 0
    compile_together(generated(kernel, target) for kernel in KERNELS)
    for kernel in KERNELS:
        program, sources = programs()[kernel], generated(kernel, target)
        function = CEvaluator(sources)
        lib, called = function.module.lib, sources.function.name
        for output, shared in pairs(kernel):
            inputs = samples(program, 4, DTYPES[target], rng)
            outputs = {r.signal.name: np.empty((4, *r.signal.shape), DTYPES[target]) for r in program.outputs}
            call = getattr(lib, f"{called}_array")
            call(4, *map(function.pointer, (*inputs.values(), *outputs.values())))
            wanted = {name: value.tobytes() for name, value in outputs.items()}
            assert np.isfinite(outputs[output]).all()

            # The loop over samples, in place.
            memory = {name: value.copy() for name, value in inputs.items()}
            own = outputs | {output: memory[shared]}
            call(4, *map(function.pointer, (*memory.values(), *own.values())))
            assert {name: value.tobytes() for name, value in own.items()} == wanted, (kernel, output, shared)
            for name, value in memory.items():
                assert name == shared or value.tobytes() == inputs[name].tobytes(), f"{kernel} wrote {name}"

            # One call, in place.
            memory = {name: value[:1].copy() for name, value in inputs.items()}
            own = {name: value[:1].copy() for name, value in outputs.items()} | {output: memory[shared]}
            arguments = [
                function.pointer(memory[s.name]) if s.shape else memory[s.name].item() for s in program.inputs
            ]
            getattr(lib, called)(*arguments, *map(function.pointer, own.values()))
            size = len(own[output].tobytes())
            assert own[output].tobytes() == wanted[output][:size], (kernel, output, shared)
            checked += 1
    assert checked >= len(KERNELS) / 2


def test_every_step_and_orthonormalization_has_a_shared_size():
    for kernel in KERNELS:
        if re.search(r"-rk\d-|normalize|-product", kernel):
            assert pairs(kernel), kernel


# Propagation


class Propagation:
    """The generated loop of one attitude step, with memory around the history that must stay as it is."""

    def __init__(self, library: Library, kernel: str, target: str, rng: np.random.Generator) -> None:
        self.library, self.dtype = library, DTYPES[target]
        self.program, self.sources = programs()[kernel], generated(kernel, target)
        attitude_step = self.program.attitude_step
        assert attitude_step is not None
        normalizer = generated(attitude_step.orthonormalize, target).function.name
        self.normalize = library.ffi.addressof(library.lib, normalizer)
        self.size = self.program.inputs[0].size
        self.identity = np.array([float(x) for x in attitude_step.identity], self.dtype)
        self.increments = rng.normal(scale=0.05, size=(3, 20, 6)).astype(self.dtype)

    def step(self, state: np.ndarray, increments: np.ndarray) -> np.ndarray:
        result = np.empty_like(state)
        self.library.function(self.sources)(*map(self.library.pointer, (state, increments, result)))
        return result

    def __call__(
        self,
        increments: np.ndarray | None,
        record_every: int = 1,
        orthonormalize_every: int = 0,
        *,
        runs: int = 1,
        steps: int = 20,
        initial: np.ndarray | bool | None = True,
        history: np.ndarray | bool | None = True,
        function: Any = None,
        loop: str = "_propagate",
    ) -> tuple[int, np.ndarray]:
        null, pointer = self.library.ffi.NULL, self.library.pointer
        start = np.tile(self.identity, (runs, 1)) if initial is True else initial
        records = 1 + steps // record_every if record_every else 1
        memory = np.full((runs * records + 2, self.size), 7.0, self.dtype)
        inside = memory[1:-1]
        status = self.library.function(self.sources, loop)(
            runs,
            steps,
            record_every,
            orthonormalize_every,
            null if function is None else function,
            null if start is None else pointer(start),
            null if increments is None else pointer(increments),
            pointer(inside) if history is True else null,
        )
        assert (memory[[0, -1]] == 7.0).all(), "written outside the history"
        return status, inside.reshape(runs, records, self.size)


@pytest.fixture(params=STEPS)
def step_kernel(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(params=TARGETS)
def propagate(request, step_kernel, library, rng) -> Propagation:
    return Propagation(library, step_kernel, request.param, rng)


def test_propagation_is_the_step_repeated_bit_for_bit(propagate):
    status, history = propagate(propagate.increments[0])
    assert status == 0
    state = propagate.identity
    assert history[0, 0].tobytes() == state.tobytes()
    for increments, record in zip(propagate.increments[0], history[0, 1:], strict=True):
        state = propagate.step(state, increments)
        assert record.tobytes() == state.tobytes()


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("step", [*STEPS, RODRIGUES])
def test_the_stack_that_a_loop_is_said_to_use_holds_the_largest_of_its_arrays(step, target):
    of_catalogue = step != RODRIGUES
    sources = generated(step, target) if of_catalogue else pipeline.compile(choose(step, "rk1", 1), target)
    header, source = (
        next(text for name, text in sources.files.items() if name.endswith(f"_runs{end}"))
        for end in (".h", ".c")
    )
    size, number_bytes = len(sources.attitude_step.identity), np.dtype(DTYPES[target]).itemsize

    def number(pattern: str) -> int:
        (text,) = set(re.findall(pattern, source))
        return int(text)

    prefix = sources.function.name.upper()
    abreast, lanes, fetched = (
        number(rf"enum {{ {prefix}_{name} = (\d+) }};") for name in ("ABREAST", "WIDE_LANES", "FETCHED")
    )
    # The states of runs that go side by side fill whole vectors of 64 bytes, the longest of x86-64.
    assert abreast * number_bytes == 64
    states = size * abreast * number_bytes
    prepared = 2 * number(r"_wide_prepared_ prepared\[2\]\[(\d+)\];") * lanes * number_bytes
    stated = [int(number) for number in re.findall(r"Uses about\s(?: \* )?(\d+) bytes of stack", header)]
    # A scan holds the products and the records of a block, and the states before its lanes.
    block = (2 * 8 * 16 + 8) * size * number_bytes
    assert stated == [max(states, prepared), *([block] if has_scan(sources) else [])]
    # Memory is fetched as far ahead as whole steps of samples lie within 512 bytes.
    step_bytes = sources.function.inputs[-1].size * number_bytes
    assert 0 <= 512 - fetched * step_bytes < step_bytes


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("target", TARGETS)
def test_gcc_takes_several_runs_at_once(step, target, folder, objects):
    source = next(name for name in generated(step, target).runs if name.endswith(".c"))
    told = (objects / OPTIMIZED).read_text().splitlines()
    said = "\n".join(line for line in told if f"/{source}:" in line)
    lines = (folder / source).read_text().splitlines()
    for loop in (f"{generated(step, target).function.name}_ABREAST".upper(), "runs"):
        (number,) = (
            k for k, line in enumerate(lines, 1) if line == f"    for (size_t k = 0; k < {loop}; ++k) {{"
        )
        assert re.search(rf":{number}:\d+: optimized: loop vectorized", said), said
        # The promise of separate arrays is believed: no second version of the loop for arrays that overlap.
        assert not re.search(rf":{number}:\d+: optimized:\s+loop versioned", said), said


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("target", TARGETS)
def test_several_steps_of_one_run_are_prepared_in_vectors(compiler, target, folder, tmp_path):
    multiply = {"c": "mulpd", "c-float": "mulps"}[target]
    (source,) = (name for name in generated("euler-rk4-2", target).runs if name.endswith(".c"))
    if platform.machine() != "x86_64":
        pytest.skip("the instructions are those of x86-64")
    command = [needed(compiler), *C_FLAGS, "-O0", "-S", source, "-o", str(tmp_path / "step.s")]
    subprocess.run(command, cwd=folder, check=True)
    function = f"{generated('euler-rk4-2', target).function.name}_ahead_"
    body = (tmp_path / "step.s").read_text().split(f"\n{function}:")[1].split(".cfi_endproc")[0]
    # What does not wait for the state takes 21 products.
    assert len(re.findall(rf"\b{multiply}\b", body)) == 21
    assert not re.search(r"\bmuls[sd]\b", body)


#: What other compilers and processors lack: the extensions of GNU, the AVX-512 of strict C, AVX-512, and AVX2 too.
ABSENT = [
    r"defined\(__GNUC__\)",
    r"defined\(__STRICT_ANSI__\)",
    r'__builtin_cpu_supports\("avx512f"\)',
    r'__builtin_cpu_supports\(".*?"\)',
]


def has_scan(sources: Sources) -> bool:
    """Return whether there is a scan beside the loop; there is none where a transition holds constants."""
    return f"{sources.function.name}_scan(" in sources.files[sources.runs[0]]


@pytest.mark.parametrize("target", TARGETS)
def test_steps_whose_transitions_are_complete_have_a_scan(target):
    assert [has_scan(generated(step, target)) for step in STEPS] == [False, True, True]


@pytest.mark.parametrize("absent", ABSENT)
def test_loops_for_other_compilers_and_processors_have_the_same_bits(absent, tmp_path, propagate, rng):
    sources = propagate.sources
    assert re.search(absent, sources.files[sources.runs[1]])
    for name, text in sources.files.items():
        (tmp_path / name).write_text(re.sub(absent, "0", text))
    names = [name for name in sources.files if name.endswith(".c")]
    command = [needed("gcc"), *C_FLAGS, *STRICT, "-shared", "-fPIC", *names, "-o", "plain.so", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    plain, name = ctypes.CDLL(str(tmp_path / "plain.so")), sources.function.name

    def call(function: str, *arguments: Any) -> int:
        return plain[name + function](
            *(
                ctypes.c_void_p(one.ctypes.data) if isinstance(one, np.ndarray) else ctypes.c_size_t(one)
                for one in arguments
            )
        )

    runs, steps = 37, 5
    increments = rng.normal(scale=0.05, size=(runs, steps, 6)).astype(propagate.dtype)
    initial = np.tile(propagate.identity, (runs, 1))
    history = np.empty((runs, 1 + steps, propagate.size), propagate.dtype)
    assert call("_propagate", runs, steps, 1, 0, 0, initial, increments, history) == 0
    assert propagate(increments, runs=runs, steps=steps)[1].tobytes() == history.tobytes()
    # A batch is ordered by element.
    by_element = [np.ascontiguousarray(rows.T) for rows in (history[:, 1], increments[:, 1])]
    after = np.empty_like(by_element[0])
    call("_batch", runs, *by_element, after)
    assert after.T.tobytes() == history[:, 2].tobytes()
    if not has_scan(sources):
        return
    steps = 300
    increments = rng.normal(scale=0.05, size=(steps, 6)).astype(propagate.dtype)
    history = np.empty((1 + steps, propagate.size), propagate.dtype)
    assert call("_scan", 1, steps, 1, 0, 0, initial, increments, history) == 0
    assert propagate(increments, steps=steps, loop="_scan")[1].tobytes() == history.tobytes()
    # Blocks of a scan are of another order than steps one by one.
    assert propagate(increments, steps=steps)[1].tobytes() != history.tobytes()


@pytest.mark.parametrize("runs", [0, 1, 7, 64])
def test_a_batch_is_every_run_by_itself_bit_for_bit(propagate, runs, rng):
    size = propagate.size
    states = rng.normal(size=(runs, size)).astype(propagate.dtype)
    increments = rng.normal(scale=0.05, size=(runs, 6)).astype(propagate.dtype)
    memory = np.full((size + 2, runs), 7.0, propagate.dtype)
    by_element = [np.ascontiguousarray(array.T) for array in (states, increments)]
    propagate.library.function(propagate.sources, "_batch")(
        runs, *map(propagate.library.pointer, (*by_element, memory[1:-1]))
    )
    assert (memory[[0, -1]] == 7.0).all(), "written outside the result"
    for run in range(runs):
        alone = propagate.step(states[run], increments[run])
        assert np.ascontiguousarray(memory[1:-1, run]).tobytes() == alone.tobytes()


@pytest.mark.parametrize("every", [1, 3, 7, 20])
def test_propagation_orthonormalizes_before_it_records(propagate, every):
    status, history = propagate(propagate.increments[0], 2, every, function=propagate.normalize)
    assert status == 0
    state = propagate.identity
    for number, increments in enumerate(propagate.increments[0], 1):
        state = propagate.step(state, increments)
        if number % every == 0:
            done = np.empty_like(state)
            propagate.normalize(*map(propagate.library.pointer, (state, done)))
            state = done
        if number % 2 == 0:
            assert history[0, number // 2].tobytes() == state.tobytes()


def test_no_steps_give_the_initial_state(propagate):
    for increments in (None, propagate.increments[0]):
        status, history = propagate(increments, steps=0)
        assert status == 0
        assert history[0].tobytes() == propagate.identity.tobytes()


def test_no_runs_write_nothing(propagate):
    assert propagate(propagate.increments, runs=0)[0] == 0


def test_steps_after_the_last_record_are_run_and_not_recorded(propagate):
    status, history = propagate(propagate.increments[0], 21)
    assert status == 0
    assert history.shape[1] == 1


@pytest.mark.parametrize(
    "fault",
    [
        {"initial": None},
        {"increments": None},
        {"history": None},
        {"record_every": 0},
        {"orthonormalize_every": 1},
    ],
    ids=lambda fault: next(iter(fault)),
)
def test_bad_arguments_give_status_1_and_leave_the_history_alone(propagate, fault):
    for loop in ["_propagate", *(["_scan"] if has_scan(propagate.sources) else [])]:
        status, history = propagate(**{"increments": propagate.increments[0]} | fault, loop=loop)
        assert status == 1
        assert (history == 7.0).all()


# Operation counts


BINARY = {"+": "add", "-": "add", "*": "multiply", "/": "divide"}
CALLS = {
    "sqrt": "sqrt",
    "fmax": "select",
    "sin": "function",
    "cos": "function",
    "atan2": "function",
    "sc_": "function",
    "wr_": "function",
}


class Counter(c_ast.NodeVisitor):
    """Counts the operations of a C function."""

    def __init__(self) -> None:
        kinds = ("add", "multiply", "divide", "sqrt", "negate", "select", "function")
        self.counts = dict.fromkeys(kinds, 0)

    def visit_BinaryOp(self, node):
        if node.op != ">=":  # counted with its choice
            self.counts[BINARY[node.op]] += 1
        self.generic_visit(node)

    def visit_UnaryOp(self, node):
        if node.op == "-" and not isinstance(node.expr, c_ast.Constant):
            self.counts["negate"] += 1
        else:
            assert node.op in "-*"
        self.generic_visit(node)

    def visit_TernaryOp(self, node):
        self.counts["select"] += 1
        self.generic_visit(node)

    def visit_FuncCall(self, node):
        name = re.sub(r"^\w+_(?=(sc|wr)_$)", "", node.name.name)  # behind the kernel's name
        self.counts[CALLS[name if name in CALLS else name.removesuffix("f")]] += 1
        self.generic_visit(node.args)


def function_body(source: str) -> str:
    code = re.sub(
        r"/\*.*?\*/|^#if defined\(__FAST_MATH__\).*?^#endif", "", source, flags=re.DOTALL | re.MULTILINE
    )
    (body,) = re.findall(r"^(void \w+\(.*?^\})", code, flags=re.DOTALL | re.MULTILINE)
    return body


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("kernel", KERNELS)
def test_operation_counts(kernel, target):
    program, sources = programs()[kernel], generated(kernel, target)
    tree = c_parser.CParser().parse(function_body(text_of(sources, ".c")))
    counter = Counter()
    counter.visit(tree)
    assert counter.counts == program.operations == sources.operations

    header = re.sub(r"\n \* +", " ", text_of(sources, ".h"))
    said = re.search(r"Operations of one call: (.*?); (\d+) temporaries\.", header)
    assert said is not None
    in_header = dict.fromkeys(counter.counts, 0)
    if said[1] != "none":
        in_header |= {kind: int(number) for number, kind in (part.split() for part in said[1].split(", "))}
    assert in_header == counter.counts

    loads = sum(len(signal.elements) for signal in program.inputs if signal.shape)
    assigned = [node for node in tree.ext[0].body.block_items if isinstance(node, c_ast.Decl)]
    elements = {name for signal in program.inputs for name in signal.elements}
    own = [node.name for node in assigned if node.name not in elements]
    assert len(assigned) - len(own) <= loads
    stored = {node.rvalue.name for node in tree.ext[0].body.block_items if _stores_a_name(node)}
    assert len([name for name in own if name not in stored]) == int(said[2]) == program.temporaries


def _stores_a_name(node: Any) -> bool:
    return isinstance(node, c_ast.Assignment) and isinstance(node.rvalue, c_ast.ID)


# Literals


def nearest(value: Fraction, digits: int, smallest: int) -> Fraction:
    """Round a positive rational to `digits` binary digits, ties to even; 2**smallest is the least spacing."""
    exponent = math.floor(math.log2(value.numerator) - math.log2(value.denominator)) - digits
    while value / Fraction(2) ** exponent >= 2**digits:
        exponent += 1
    exponent = max(exponent, smallest)
    return Fraction(round(value / Fraction(2) ** exponent)) * Fraction(2) ** exponent


def nearest_double(value: Fraction) -> Fraction:
    return nearest(value, 53, -1074)


def nearest_single(value: Fraction) -> Fraction:
    return nearest(value, 24, -149)


def read(literal: str) -> Fraction:
    """Read a C literal as a compiler does: the decimal exactly, then rounded once to the literal's type."""
    assert re.fullmatch(r"\d+(\.\d+(e[+-]\d+)?|e[+-]\d+)f?", literal), literal
    if literal.endswith("f"):
        return nearest_single(Fraction(literal[:-1]))
    return nearest_double(Fraction(literal))


# Just above the middle of 1 and the next float: through double it becomes the middle, and then 1.
TRAP = 1 + Fraction(1, 2**24) + Fraction(1, 2**60)
positive = st.fractions(min_value=Fraction(1, 10**12), max_value=10**12)
wide = st.builds(
    lambda top, bottom, power: Fraction(top, bottom) * Fraction(10) ** power,
    st.integers(1, 10**20),
    st.integers(1, 10**20),
    st.integers(-15, 15),
)


@given(positive | wide)
@example(Fraction(1, 3))
@example(TRAP)
@example(1 + Fraction(1, 2**24))  # ties go to even
@example(1 + Fraction(3, 2**24))
@example(Fraction(1))
@example(Fraction(10**22))
@example(Fraction(1, 10**40))
def test_literals_are_rounded_once(value):
    assert read(CPrinter(DOUBLE).constant(value)) == nearest_double(value)
    assert read(CPrinter(FLOAT).constant(value)) == nearest_single(value)


def test_compiler_reads_literals_as_meant(tmp_path):
    needed("gcc")
    values = [TRAP, *(Fraction(top, bottom) for top in range(1, 40) for bottom in (3, 7, 24, 720, 99991))]
    lines = []
    for real in (DOUBLE, FLOAT):
        numbers = ", ".join(CPrinter(real).constant(value) for value in values)
        lines.append(f"const {real.name} {real.name}s[] = {{{numbers}}};")
    (tmp_path / "literals.c").write_text("\n".join(lines))
    built = tmp_path / "literals.so"
    command = ["gcc", "-std=c99", "-shared", "-fPIC", "-o", str(built), str(tmp_path / "literals.c")]
    subprocess.run(command, check=True)
    ffi = FFI()
    ffi.cdef(f"extern const double doubles[{len(values)}]; extern const float floats[{len(values)}];")
    lib = ffi.dlopen(str(built))
    assert [Fraction(x) for x in lib.doubles] == [nearest_double(value) for value in values]
    assert [Fraction(x) for x in lib.floats] == [nearest_single(value) for value in values]


# Headers


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("kernel", KERNELS)
def test_header_is_a_contract(kernel, target):
    program, sources = programs()[kernel], generated(kernel, target)
    header = re.sub(r"\n \*\s+", " ", text_of(sources, ".h"))
    assert f"Generated by: strapgen generate {program.arguments} --target {target}" in header
    assert f"Source: {program.source}." in header
    for note in program.notes:
        assert note in header
    for way, signal in [("in", s) for s in program.inputs] + [("out", r.signal) for r in program.outputs]:
        shape = f"[{signal.size}]" if signal.shape else ""
        (line,) = re.findall(
            rf"{way}\s+{signal.name}{re.escape(shape)}: (.*?)\.(?: in | out |\n| \*)", header
        )
        assert signal.meaning in line
        assert f"; unit {signal.unit}" in line
        assert signal.meaning and signal.unit
        if way == "in":
            assert "finite number" in line
        if way == "in" and signal.bound is not None:
            assert f"at most {signal.bound} in magnitude" in line
        if signal.shape:
            shown = signal.elements if signal.size <= 4 else (signal.elements[0], "...", signal.elements[-1])
            assert ", ".join(shown) in line


@pytest.mark.parametrize("target", TARGETS)
def test_names_of_both_types_differ(target):
    suffix = "_float" if target == "c-float" else ""
    sources = generated("euler-rk4-2", target)
    name = f"euler_rk4_2{suffix}"
    assert list(sources.step_files) == [f"{name}.h", f"{name}.c"]
    assert list(sources.runs) == [f"{name}_runs.h", f"{name}_runs.c"]
    assert sources.function.name == f"euler_rk4_2{suffix}"


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(("kernel", "unused"), [("constant-increments", ["middle"]), ("euler-product", [])])
def test_inputs_that_a_kernel_does_not_read_are_named_for_the_compiler(kernel, unused, target):
    assert re.findall(r"\(void\)(\w+);", text_of(generated(kernel, target), ".c")) == unused


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("kernel", KERNELS)
def test_text_is_clean(kernel, target):
    for text in generated(kernel, target).files.values():
        assert text.endswith("\n") and not text.endswith("\n\n")
        assert "\t" not in text and "\r" not in text
        assert all(line == line.rstrip() for line in text.splitlines())
        assert text.isascii()
