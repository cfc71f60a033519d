"""The generated C of described systems and its twins in Python: strictly compiled, and the same numbers in all."""

from __future__ import annotations

import importlib
import subprocess
import sys
from pathlib import Path

import cffi
import numpy as np
import pytest
from c_programs import STRICT, complaints, needed, written
from navigation.described_files import ATTITUDE, TWO_SPEEDS, description, samples

import strapgen
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import Format
from strapgen.navigation.systems import system_generation
from strapgen.navigation.systems.budget import budget, lines
from strapgen.navigation.systems.fitting import fitted
from strapgen.navigation.systems.system_runner import CompiledSystem, rescaled, system_runner
from strapgen.targets.rendering import render

TEXTS = {"two": TWO_SPEEDS, "att": ATTITUDE, "writes": f'{ATTITUDE}writes = {{ next = "step.state" }}\n'}
BACKEND = {"c": "c", "c-fixed": "c-fixed16"}
SETTINGS = {"fixed-model": Settings(word=16, carry="full"), "c-fixed": Settings(word=16, carry="full")}


@pytest.fixture(scope="module")
def systems(tmp_path_factory):
    return {name: description(tmp_path_factory.mktemp(name), text) for name, text in TEXTS.items()}


def twin(fit, folder: Path):
    """Write and import the twin of a system in Python."""
    sources = system_generation.unit(fit, "strapgen system case.toml", lines(budget(fit)))
    written(folder, sources.files)
    names = [name.removesuffix(".py") for name in sources.files]
    sys.path.insert(0, str(folder))
    try:
        for name in names:
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        return importlib.import_module(fit.description.system.name)
    finally:
        sys.path.remove(str(folder))
        for name in names:
            sys.modules.pop(name, None)


@pytest.mark.long
@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.parametrize("target", ["c", "c-fixed"])
def test_python_unit_stores_the_values_of_the_c(name, target, systems, tmp_path, rng):
    """Bit for bit on integers; in double the functions of numpy and C differ by roundings of sines alone."""
    python = "fixed-model" if target == "c-fixed" else "numpy"
    compiled = CompiledSystem(fitted(systems[name], target, SETTINGS.get(target)), BACKEND[target])
    module = twin(fitted(systems[name], python, SETTINGS.get(python)), tmp_path)
    inputs = samples(systems[name], 300, rng)
    rows = compiled.samples(inputs)
    trace = compiled.trace(rows).cells
    memory = module.Memory()
    for k in range(301):
        for cell in compiled.system.cells:
            value = np.ravel(getattr(memory, cell.name))
            if target == "c-fixed":
                assert value.tolist() == trace[cell.name][k].tolist()
            else:
                scale = max(1.0, np.abs(trace[cell.name][k]).max())
                assert np.abs(value - trace[cell.name][k]).max() <= 1e-14 * scale * (k + 1)
        if k < 300:
            taken = [rows[signal.name][k] for signal in compiled.system.inputs]
            plain = target == "c-fixed"
            module.cycle(memory, *([int(n) for n in row] if plain else row.reshape(-1) for row in taken))
    again = module.run(module.Memory(), *(rows[signal.name].tolist() for signal in compiled.system.inputs))
    values = compiled._run(rows, 300, compiled.begin())[0]
    for cell in compiled.system.outputs:
        assert np.shape(np.reshape(again[cell], (len(again[cell]), -1))) == values[cell].shape


@pytest.mark.long
def test_python_unit_refuses_as_the_c_and_keeps_its_memory(systems, tmp_path, rng):
    fit = fitted(systems["two"], "fixed-model", SETTINGS["fixed-model"])
    module = twin(fit, tmp_path)
    memory = module.Memory()
    argument = fit.arguments["gyro"]
    with pytest.raises(module.Refused, match="stage fast: increment lies outside"):
        module.cycle(memory, [argument.high + 1, 0, 0], [0, 0, 0], [0, 0, 0])
    assert memory.fast_angle_sum == [0, 0, 0]
    module.cycle(memory, [argument.high, 0, 0], [0, 0, 0], [0, 0, 0])
    assert memory.fast_angle_sum != [0, 0, 0]
    assert memory.counted == 2  # as in C, a cycle that is refused counts


@pytest.mark.long
@pytest.mark.parametrize("name", TEXTS)
def test_all_back_ends_agree_and_the_integer_model_to_the_bit(name, systems, rng):
    inputs = samples(systems[name], 200, rng, 0.5)
    truth = system_runner(systems[name], "numpy").run(inputs).values
    fixed = {}
    for backend in ("c", "c-float", "c-fixed32", "fixed-model"):
        settings = Settings(word=32) if "fixed" in backend else None
        values = system_runner(systems[name], backend, settings).run(inputs).values
        assert values.keys() == truth.keys()
        for cell, expected in truth.items():
            assert values[cell].shape == expected.shape
            tolerance = {"c": 1e-12, "c-float": 1e-3}.get(backend, 2e-2)  # stages of TWO_SPEEDS have 16 bits
            assert np.abs(values[cell] - expected).max() <= tolerance * max(1, np.abs(expected).max())
        fixed[backend] = values
    for cell in truth:
        assert np.array_equal(fixed["c-fixed32"][cell], fixed["fixed-model"][cell])


@pytest.mark.long
@pytest.mark.parametrize("target", ["c", "c-float", "c-fixed"])
def test_the_c_has_no_warnings_and_the_budget_knows_its_memory(target, systems, tmp_path):
    needed("gcc")
    for name, system in systems.items():
        fit = fitted(system, target, SETTINGS.get(target))
        needs = budget(fit)
        sources = system_generation.unit(fit, "strapgen system case.toml", lines(needs))
        folder = written(tmp_path / name, sources.files)
        assert complaints("gcc", folder, [file for file in sources.files if file.endswith(".c")]) == ""
        unit = sources.function.name
        (folder / "size.c").write_text(
            f'#include "{unit}.h"\ntypedef char same[sizeof({unit}_memory) == {needs.memory_bytes}U ? 1 : -1];\n'
        )
        command = ["gcc", *STRICT, "-fsyntax-only", "size.c"]
        assert subprocess.run(command, cwd=folder, check=False, capture_output=True).returncode == 0
        header = sources.files[f"{unit}.h"]
        for rate in needs.rates:
            if rate.stages:
                assert f"every {rate.every} ({float(rate.hz):g} Hz; " in " ".join(
                    header.replace("\n *", " ").split()
                )


def test_a_budget_counts_operations_by_rate(systems):
    needs = budget(fitted(systems["two"], "c"))
    fast, slow, navigation = needs.rates
    counts = {stage.name: stage.operations for rate in needs.rates for stage in rate.stages}
    programs = systems["two"].programs
    for name, operations in counts.items():
        assert operations == {kind: count for kind, count in programs[name].operations.items() if count}
    assert (fast.hz, slow.hz, navigation.hz) == (3200, 400, 200)
    assert needs.per_second == sum(rate.hz * sum(rate.operations.values()) for rate in needs.rates)
    values = sum(cell.signal.size for cell in systems["two"].system.cells)
    assert (needs.cell_bytes, needs.feedback_bytes, needs.counter_bytes) == (8 * values, 0, 4)
    assert needs.memory_bytes % 8 == 0
    assert needs.executed_per_second is None
    measured = budget(fitted(systems["two"], "c"), {name: (10, 100, 8) for name in counts}, "cortex-m3")
    assert measured.executed_per_second == 10 * (3200 + 400 + 200)
    assert "On cortex-m3: 38 000 instructions a second, 300 bytes of object code" in " ".join(lines(measured))


WORDS = (16, 32, 64)


def rescaling(folder: Path):
    """Return the C that rescales between all words, which stops at what C leaves undefined."""
    pairs = [(there, here) for there in WORDS for here in WORDS]
    values = {
        "headers": [],
        "fixed": True,
        "rescales": [(str(there), str(here)) for there, here in pairs],
        "name": "r",
    }
    source = render("system_c/source.c.j2", **values, **_nothing())
    text = (
        source.partition("void r_begin")[0]
        .replace('#include "r.h"', "#include <stdint.h>")
        .replace("static ", "")
    )
    declarations = "\n".join(
        f"void r_{there}_to_{here}_(int{here}_t *to, const int{there}_t *from, int size, int places);"
        for there, here in pairs
    )
    ffi = cffi.FFI()
    ffi.cdef(declarations)
    (folder / "r.c").write_text(text)
    library = folder / "r.so"
    warnings = [flag for flag in STRICT if flag != "-Wshadow"]
    undefined = ["-fsanitize=undefined", "-fsanitize-undefined-trap-on-error"]
    command = ["gcc", *warnings, "-O2", *undefined, "-shared", "-fPIC", "-o", str(library), "r.c"]
    subprocess.run(command, cwd=folder, check=True)
    return ffi, ffi.dlopen(str(library))


def rescaled_in_c(compiled, there: int, here: int, row: list[int], places: int) -> list[int]:
    """Return integers of one word in another."""
    ffi, functions = compiled
    to, start = ffi.new(f"int{here}_t[]", len(row)), ffi.new(f"int{there}_t[]", row)
    getattr(functions, f"r_{there}_to_{here}_")(to, start, len(row), places)
    return [*to]


#: Word and fraction bits there and here, and integers there with what they are here: ties go up, ends are held.
RESCALED = [
    ((32, 17), (16, 16), {3: 2, 2: 1, 1: 1, -1: 0, -2: -1, -3: -1, -4: -2}),
    ((32, 24), (16, 16), {128: 1, 127: 0, -128: 0, -129: -1, -384: -1, -385: -2, 300 << 8: 300}),
    (
        (32, 24),
        (16, 16),
        {8388479: 32767, 8388480: 32767, -8388736: -32768, -8388737: -32768, 2**31 - 1: 32767},
    ),
    ((32, 24), (16, 16), {-(2**31): -32768, -(2**31) + 1: -32768}),
    ((16, 8), (32, 16), {1: 256, -1: -256, 32767: 8388352, -32768: -8388608}),
    (
        (32, 8),
        (16, 16),
        {127: 32512, 128: 32767, -128: -32768, -129: -32768, 2**31 - 1: 32767, -(2**31): -32768},
    ),
    ((16, 0), (16, 8), {-127: -32512, -128: -32768, -129: -32768, 127: 32512, 128: 32767}),
    ((64, 40), (32, 33), {64: 1, 63: 0, -64: 0, -65: -1, 2**62: 2**31 - 1, -(2**62): -(2**31)}),
    ((32, 30), (64, 62), {1: 1 << 32, -1: -(1 << 32), 2**31 - 1: (2**31 - 1) << 32, -(2**31): -(2**63)}),
]


def test_a_value_is_rescaled_to_the_nearest_and_held_at_both_ends_of_its_word(tmp_path):
    needed("gcc")
    compiled = rescaling(tmp_path)
    for there, here, values in RESCALED:
        row, expected = list(values), list(values.values())
        result = rescaled(np.array(row, object), Format(*there), Format(*here))
        assert [int(value) for value in result] == expected, (there, here)
        assert rescaled_in_c(compiled, there[0], here[0], row, here[1] - there[1]) == expected, (there, here)


def test_the_twin_rescales_alike(tmp_path):
    mixed = ATTITUDE.replace('name = "matrix"', 'name = "matrix"\nword = 16')
    module = twin(fitted(description(tmp_path, mixed), "fixed-model", Settings()), tmp_path)
    for there, here, values in RESCALED:
        moved = module._moved(list(values), here[1] - there[1], Format(*here).largest)
        assert moved == list(values.values()), (there, here)


def test_a_value_is_rescaled_in_c_as_in_python_between_all_words(tmp_path):
    """All places, at the ends of the words, around ties, and at random integers."""
    needed("gcc")
    compiled = rescaling(tmp_path)
    rng = np.random.default_rng(5)
    for there, here in [(there, here) for there in WORDS for here in WORDS]:
        top = (1 << (there - 1)) - 1
        edges = {0, 1, -1, 2, -2, 3, -3, top, -top, top - 1, -top - 1}
        edges |= {sign * ((1 << k) + d) for k in range(there - 1) for d in (-1, 0, 1) for sign in (1, -1)}
        edges |= {int(rng.integers(-top - 1, top, endpoint=True)) for _ in range(40)}
        row = sorted(value for value in edges if -top - 1 <= value <= top)
        for places in [*range(-70, 71), -200, 200]:
            expected = rescaled(np.array(row, object), Format(there, 0), Format(here, places))
            result = rescaled_in_c(compiled, there, here, row, places)
            assert result == [int(value) for value in expected], (there, here, places)


def _nothing() -> dict[str, object]:
    """Return what the template needs beside the functions that rescale."""
    system = type("System", (), {"cycle": 1})()
    empty = ("rates", "initial", "feedback", "everything")
    return {
        **{key: [] for key in empty},
        "types": {},
        "title": "",
        "command": "",
        "samples": "",
        "system": system,
    }


STEP = """
name = "one"
sample_hz = 100

[inputs.gyro]
unit = "rad"
frame = "b"
range = 0.1

[[stage]]
name = "step"
kernel = "euler"
wires = { increments = "gyro" }
"""


PREVIOUS = {"method": "rk4", "increments": 1, "previous": 2}


@pytest.mark.long
@pytest.mark.parametrize(
    ("stated", "options", "samples_per_step", "beside"),
    [
        ('method = "rk4"\nincrements = 2\nevery = 2\n', {"method": "rk4", "increments": 2}, 2, 0),
        ('method = "window-3-3"\nevery = 1\n', {"method": "window-3-3"}, 1, 6),
        (
            'method = "rk4"\nincrements = 1\nprevious = 2\nevery = 1\n',
            {"method": "rk4", "increments": 1, "previous": 2},
            1,
            2,
        ),
    ],
)
def test_a_step_in_a_system_is_the_step_alone_on_the_samples_that_it_collects(
    stated, options, samples_per_step, beside, tmp_path, rng
):
    """Samples from before the first cycle count as zero."""
    system = description(tmp_path, STEP + stated)
    increments = rng.uniform(-0.05, 0.05, (24, 3))
    states = system_runner(system, "numpy").run({"gyro": increments}).values["step_state"]
    function = strapgen.evaluator(strapgen.choose_step("euler", **options))
    collected = np.concatenate([np.zeros((beside, 3)), increments])
    state = np.array([0.0, 0.0, 0.0, 1.0])
    for number, expected in enumerate(states):
        first = number * samples_per_step
        state = function(state, collected[first : first + samples_per_step + beside])
        assert np.array_equal(state, expected)
    assert len(states) == 24 // samples_per_step


SCALARS = """
name = "course_only"
sample_hz = 100
outputs = ["heading.next_heading_bias", "heading.heading_rate"]

[inputs.course]
unit = "rad"
range = 3

[inputs.flux_valve]
unit = "rad"
range = 3

[[stage]]
name = "heading"
kernel = "heading-loop"
every = 1
wires = { heading = "course", magnetic_heading = "flux_valve" }
constants = { cycle = "T", k1 = 0.5, k2 = 0.0625 }
"""


def test_scalars_go_into_a_stage_on_every_back_end(tmp_path, rng):
    system = description(tmp_path, SCALARS)
    inputs = {name: rng.uniform(-0.5, 0.5, 50) for name in ("course", "flux_valve")}
    double = system_runner(system, "numpy").run(inputs)
    for backend, limit in (("c", 1e-14), ("c-fixed32", 1e-7)):  # 32 bits of headings up to 3 rad
        run = system_runner(system, backend).run(inputs)
        for name, values in double.values.items():
            assert np.abs(values).max() > 1e-4
            assert np.abs(run.values[name] - values).max() < limit, (backend, name)
