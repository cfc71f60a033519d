"""Every kernel of the catalogue on every target of numbers, whatever its formula: a kernel's own test has the formula.

The C returns the integers of the model or refuses what it refuses, every value of the model keeps its proved range and
its error bound, and C in floating point is within its bounds of numpy. That C++, Rust and MATLAB have the bits of the C
of every kernel stands in tests/targets; the orders of methods stand in tests/catalogue/methods.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from derived import FIXED_POINT, program, quantized
from fixed_inputs import corners_and_random, exactly

import strapgen
from strapgen.catalogue import Choice, choose
from strapgen.fixedpoint import series
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.kernel_info import Recursion
from strapgen.navigation.navigation_kernels import (
    COMPENSATION,
    LOOPS,
    MODES,
    MOUNTINGS,
    NAVIGATION,
    OUTPUTS,
    REDUNDANCY,
    TWO_ROWS,
)
from strapgen.run.backends import Evaluator
from strapgen.run.compiled_code import CEvaluator, ModelEvaluator
from strapgen.run.kernel_sources import sources_of_program

VECTORS = [
    choose("velocity-position", "rk4", 2),
    choose("velocity-position", "window-3-3"),
    choose("velocity-position", "coning-combined", 2, previous=1),
    choose("euler-jacobian", "rk4", 2),
]
TRANSLATIONS = ("dcm-translation", "euler-translation")
#: Kernels beside the standard catalogue that bring the ranges of their inputs, or have them in `SETTINGS`.
NAMED = [
    Choice(name)
    for name in dict.fromkeys(
        [*NAVIGATION, *REDUNDANCY, *LOOPS, *COMPENSATION, *OUTPUTS, *MODES, *TWO_ROWS, *TRANSLATIONS]
    )
]
#: Filters of every kind of section, which bring their ranges.
FILTERS = [
    choose("filter", layout=path)
    for path in sorted((Path(__file__).resolve().parents[1] / "examples" / "filters").iterdir())
]
MORE = [*NAMED, *VECTORS, *FILTERS]
EVERY = [*FIXED_POINT, *(choice for choice in MORE if choice not in FIXED_POINT)]
#: What is compiled in the quick tests: sums, roots, functions, quotients, recursions with error feedback, steps.
COMPILED = (
    *(
        "euler-rk4-2",
        "dcm-rk4-2",
        "dcm-orthonormalize",
        "euler-angles-from-dcm",
        "euler-from-dcm",
        "dcm-update",
    ),
    *(
        "parity-hexad",
        "wander-rate-ellipsoid",
        "position-step",
        "level-loop",
        "heading-loop",
        "butterworth-2",
    ),
    *("pulse-errors", "scale-factor-heating", "euler-jacobian-rk4-2", "euler-translation"),
)
#: Ranges of what has any unit, or has none that all applications share.
RANGES = {
    "butterworth-2": {"sample": Fraction(128), "first": Fraction(128), "second": Fraction(192)},
    **{f"axes-{mounting}": {"sensed": Fraction(128)} for mounting in MOUNTINGS},
    "hysteresis": dict.fromkeys(("value", "lower", "upper"), Fraction(128)),
    "median-3": {name: Fraction(128) for name in ("unit_1", "unit_2", "unit_3", "trip")},
    "velocity-position": {"velocity_increments": Fraction(1, 2)},
    **{name: {"cycle": Fraction(1, 50)} for name in TRANSLATIONS},
}


def settings(choice: Choice, word: int, rounding: str = "nearest", carry: str = "state") -> Settings:
    angle = Fraction(1, 60) if choice in FIXED_POINT else Fraction(1, 16)
    return Settings(word, angle, rounding, carry, ranges=RANGES.get(choice.name, {}))


# Inputs


def proper_inputs(name: str, evaluator: Evaluator, count: int, rng: np.random.Generator) -> list[np.ndarray]:
    """Return integers for every input: rotations and directions to the place, corners and numbers of all others.

    States keep away from the end of their range, which they must not leave in the call.
    """
    states = [state for state, _ in (evaluator.sources.recursion or Recursion(())).states]
    inputs = []
    pairs = zip(evaluator.interface.inputs, corners_and_random(evaluator, 2 * count, rng), strict=True)
    for argument, array in pairs:
        signal = argument.signal
        proper = array[count:] if signal.constraint else array[:count]
        if signal.name == "share":  # the weight of a mean
            proper = np.abs(proper)
        share = Fraction(1) if signal.constraint else share_of_range(name, signal.name, states)
        inputs.append(proper * share.numerator // share.denominator)
    names = [argument.signal.name for argument in evaluator.interface.inputs]
    units = [float(argument.format.unit) for argument in evaluator.interface.inputs]
    if name == "butterworth-2":  # the coefficients of an edge
        warped = np.exp(rng.uniform(-6, 3, size=(count, 1)))
        n = 1 + math.sqrt(2) * warped + warped**2
        for place, coefficient in enumerate((1 - 1 / n, warped / n, warped**2 / n), 3):
            inputs[place] = np.rint(coefficient / units[place]).astype(evaluator.number)
    if name == "wind":  # a calm, where the error of its speed is largest
        speed, heading = (inputs[place].astype(float) * units[place] for place in (1, 2))
        calm = np.concatenate([speed * np.cos(heading), speed * np.sin(heading), 0 * speed], axis=1)
        inputs[0] = np.rint(calm / units[0]).astype(evaluator.number)
    if name == "lock-in-errors":  # the end of the zone, where the root of what is left is nearly nothing
        zone = inputs[2].astype(float) * units[2] * inputs[1] * units[1]
        inputs[0] = (np.rint(zone / units[0]) + rng.integers(-3, 4, zone.shape)).astype(evaluator.number)
    if "row_1" in names:
        rows = np.linalg.qr(rng.normal(size=(count, 3, 2)))[0]
        inputs[:2] = [np.rint(rows[:, :, k] / units[0]).astype(evaluator.number) for k in range(2)]
    return inputs


def share_of_range(kernel: str, signal: str, states: list[str]) -> Fraction:
    """Return how much of the range of an input is proper."""
    if kernel in LOOPS and signal in ("k1", "k2", "k3"):  # gains are for small errors
        return Fraction(1, 1 << 14)
    if kernel == "tuned-rotor-loop" and signal not in ("turn", "share"):  # small angles, whatever the turn
        return Fraction(1, 16)
    if kernel in LOOPS and (signal in states or signal.startswith(("reference", "magnetic"))):
        return Fraction(1, 4)  # no corner has two headings half a turn apart, where the error jumps
    if signal.startswith(("sample", "first", "second", "sensed")):
        return Fraction(1, 4)
    if kernel == "flight-path-angle":  # slow, where the error is largest
        return Fraction(1, 256)
    if kernel in TRANSLATIONS and signal in ("velocity", "displacement"):
        return Fraction(1, 2)
    return Fraction(7, 8) if signal in states or (states and kernel in REDUNDANCY) else Fraction(1)


# Fixed point


def spied(fixed):
    """Return the model's function, and the dictionary into which it puts the integer of every value."""
    (text,) = strapgen.generate(fixed, "fixed-model").files.values()
    seen: dict[str, int] = {}
    for check in ("_within", "_require"):
        head = f"def {check}(name, value, low, high):\n"
        text = text.replace(head, f"{head}    SEEN[name] = value\n")
    space: dict = {"SEEN": seen}
    exec(compile(text, "model", "exec"), space)
    return space[fixed.name], seen


def with_words() -> Iterator:
    """Yield every kernel with words of 16 and 32 bits and a third one in turn, and the roundings in turn."""
    for row, choice in enumerate(EVERY):
        for column, word in enumerate((8, 16, 24, 32, 64)):
            rounding = ("nearest", "truncation")[(row + column + 1) % 2]
            if choice not in FIXED_POINT:
                if word in (16, 32):
                    rounding = "nearest"
                    yield choice, word, rounding, word == 32
            elif word in (16, 32, (8, 24, 64)[(row + 2) % 3]):
                yield choice, word, rounding, (word, rounding) in ((32, "nearest"), (16, "truncation"))


@pytest.mark.parametrize(
    ("choice", "word", "rounding"),
    [
        pytest.param(
            choice,
            word,
            rounding,
            id=f"{choice.kernel}-{word}-{rounding}",
            marks=() if quick else pytest.mark.long,
        )
        for choice, word, rounding, quick in with_words()
    ],
)
def test_every_value_keeps_its_range_and_its_error_bound(choice, word, rounding, rng):
    standard = choice in FIXED_POINT
    chosen = settings(choice, word, rounding, "none" if standard else "state")
    loose = choice.name == "dcm-orthonormalize-optimal"
    if word == 8 and (loose or (choice.name, rounding) == ("euler-angles-from-dcm", "truncation")):
        with pytest.raises(InputError, match="words of 8 bits are too short"):
            quantized(choice, chosen)
        return
    fixed = quantized(choice, chosen)
    function, seen = spied(fixed)
    model = ModelEvaluator(strapgen.generate(fixed, "fixed-model"))
    inputs = corners_and_random(model, 25, rng) if standard else proper_inputs(choice.name, model, 20, rng)
    feedback = [model.fresh(1)[0].tolist()] if fixed.interface.residuals else []
    compared, share = 0, Fraction(0)
    # The eigenvalues of the nearest rotation follow from an angle that no word holds well: what comes after it keeps
    # its range, but only the result has a bound. With error feedback a value may be a rest beside an exact sum.
    outputs = {name for argument in fixed.interface.outputs for name in argument.values}
    values = [value for value in fixed.body if value.name in outputs or (standard and not loose)]
    for sample in zip(*(array.tolist() for array in inputs), strict=True):
        try:
            function(*sample, *feedback)  # asserts ranges and partial sums
        except ValueError as error:
            assert standard and "lies outside" in str(error)  # far from a proper input
            continue
        known = exactly(fixed, sample)
        for value in values:
            if value.name in known and value.name in seen:
                computed = value.offset + seen[value.name] * Fraction(2) ** -value.fraction
                apart = abs(computed - known[value.name])
                if any(
                    part in value.name + choice.name for part in ("angle", "heading")
                ):  # but for whole turns
                    apart = min(apart, abs(apart - 2 * series.pi()))
                assert apart <= value.error, value.name
                compared += 1
                if value.name in outputs and value.error:
                    share = max(share, apart / value.error)
    # What functions are made of has no name in the program.
    named = sum(value.name in known for value in values)
    assert compared > (0 if loose else 5 * named)
    assert standard or share > 0.02 or not any(fixed.error_bounds.values()), (
        "bounds are of the size of the errors"
    )


#: Words and error feedback: each kernel with the first, every other one with one of the others in turn.
IN_C = [(32, "full"), (16, "state"), (32, "state"), (16, "none")]


@pytest.mark.parametrize(
    ("choice", "word", "carry"),
    [
        pytest.param(
            choice, *row, id=f"{choice.kernel}-{row[0]}-{row[1]}", marks=() if quick else pytest.mark.long
        )
        for k, choice in enumerate(EVERY)
        # Steps of Cayley-Klein parameters have the code of Euler parameters under other names.
        if not (choice.method and choice.name == "cayley-klein")
        for row in [IN_C[0], *([IN_C[1 + k // 2 % 3]] if k % 2 else [])]
        for quick in [row == IN_C[0] and choice.kernel in COMPILED]
    ],
)
def test_c_returns_and_refuses_as_the_model(choice, word, carry, rng):
    fixed = quantized(choice, settings(choice, word, carry=carry))
    in_c = CEvaluator(strapgen.generate(fixed, "c-fixed"))
    model = ModelEvaluator(strapgen.generate(fixed, "fixed-model"))
    inputs = [
        np.concatenate(pair)
        for pair in zip(
            corners_and_random(model, 100, rng), proper_inputs(choice.name, model, 100, rng), strict=True
        )
    ]
    residuals = rng.integers(0, 2**word - 1, size=(200, len(model.interface.residuals)))
    accepted = 0
    for k in range(200):  # one by one: each may be refused
        rows = [array[k : k + 1] for array in inputs]
        computed, expected = (results(evaluator, rows, residuals[k : k + 1]) for evaluator in (in_c, model))
        assert computed == expected
        accepted += not isinstance(computed, str)
    assert accepted >= 20
    for argument, row in zip(in_c.interface.inputs, rows, strict=True):
        if argument.high < 2 ** (word - 1) - 1:  # a word holds more
            kept, row[0, 0] = row[0, 0], argument.high + 1
            for evaluator in (in_c, model):
                assert isinstance(results(evaluator, rows, residuals[-1:]), str), argument.signal.name
            row[0, 0] = kept


def results(evaluator: Evaluator, inputs: list[np.ndarray], residuals: np.ndarray) -> object:
    """Return outputs and residuals, or what was said of a refusal."""
    try:
        outputs, kept = evaluator.run(inputs, residuals)
    except InputError as error:
        return str(error).split(":")[0].split(" (")[0]
    return [array.tolist() for array in outputs], kept.tolist()


# Floating point


@pytest.mark.parametrize(
    ("choice", "backend"),
    [
        pytest.param(
            choice,
            backend,
            id=f"{choice.kernel}-{backend}",
            marks=() if choice.kernel in COMPILED and backend == "c" else pytest.mark.long,
        )
        for k, choice in enumerate(EVERY)
        for backend in ("c", "c-float")[: 2 if k % 4 == 0 else 1]  # the same code but for its type
    ],
)
def test_c_is_within_its_bounds_of_numpy(choice, backend, rng):
    in_c, double = strapgen.evaluator(choice, backend), strapgen.evaluator(choice)
    model = strapgen.evaluator(choice, "fixed-model", settings(choice, 32))
    inputs = [
        (array * float(argument.format.unit)).astype(in_c.dtype).reshape(50, *argument.signal.shape)
        for argument, array in zip(
            model.interface.inputs, proper_inputs(choice.name, model, 50, rng), strict=True
        )
    ]
    computed, expected = (
        result if isinstance(result, tuple) else (result,)
        for result in (f(*(array.astype(f.dtype) for array in inputs)) for f in (in_c, double))
    )
    bounds = in_c.sources.rounding
    largest = max(np.abs(array).max() for array in (*inputs, *expected))
    for output, one, other in zip(program(choice).outputs, computed, expected, strict=True):
        apart = np.abs(one.astype(float) - other).reshape(50, -1)
        if bounds.errors:
            # Double itself rounds 2**-29 as much as float; the bounds of both are of twice what either may lose.
            allowed = np.array([*map(float, bounds.errors[output.signal.name])])
            assert np.all(apart <= allowed * (2 if backend == "c" else 1.001)), output.signal.name
        else:
            # Functions of the library; angles may differ by whole turns.
            turned = np.minimum(apart, np.abs(apart - 2 * np.pi))
            assert turned.max() <= 64 * np.finfo(in_c.dtype).eps * largest, output.signal.name


@pytest.mark.parametrize("choice", MORE, ids=lambda choice: choice.kernel)
def test_numpy_is_generated(choice):
    sources = sources_of_program(program(choice), "numpy", None)
    assert sources.function.name == choice.kernel.replace("-", "_")


#: Inputs that have no frame.
NO_FRAME = (
    *("cycle", "cycle_rate", "decay", "unbalance", "unbalance_reciprocal", "deviation", "heating_gain"),
    *("phase_scale", "phase_scale_reciprocal"),
    *("nominal", "slope_above", "slope_below", "difference"),
)


@pytest.mark.parametrize("name", [*NAVIGATION, *LOOPS, *COMPENSATION])
def test_sources_units_and_ranges_are_stated(name):
    kernel = strapgen.derive(name)
    if name not in COMPENSATION:
        assert "derived" in kernel.source
    else:
        assert "AGARD Lecture Series 133" in kernel.source
        assert any(word in kernel.source for word in ("printed", "repaired", "derived"))
        for signal in kernel.inputs:
            assert re.search("axes|axis", signal.meaning) or signal.name in NO_FRAME, signal.name
    for signal in kernel.inputs if name not in LOOPS else ():
        assert signal.bound is not None and signal.unit, signal.name


def test_a_selection_has_no_error():
    for word in (16, 32):
        choice = Choice("select-hexad")
        assert not any(quantized(choice, settings(choice, word)).error_bounds.values())
