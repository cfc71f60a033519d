"""Sine, cosine, sin(x)/x and atan2 in fixed point: model and C agree, and no error exceeds its certified bound."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import product
from typing import Any

import mpmath
import numpy as np
import pytest
from derived import programs

from strapgen import generate
from strapgen.fixedpoint import can_lower, quantize, series
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.kernel_info import KernelInfo
from strapgen.ir.program import Assignment, Constant, Operation, Program, Reference, Result
from strapgen.ir.signals import Signal
from strapgen.run.compiled_code import CEvaluator, ModelEvaluator
from strapgen.run.compiler import compile_together
from strapgen.run.evaluators import Evaluator
from strapgen.targets import emit

PRECISE = mpmath.mp.clone()
PRECISE.prec = 400

C_WORDS = (16, 32, 64)
#: Functions, the ranges of their arguments, and how many last places the bound may be.
CASES = {
    "sin-unreduced": ("sin", (Fraction(1),), 1),
    "sin": ("sin", (Fraction(10),), 1),
    "sin-many-turns": ("sin", (Fraction(1000),), 1),
    "cos-unreduced": ("cos", (Fraction(1),), 1),
    "cos": ("cos", (Fraction(10),), 1),
    "sinc-small": ("sinc", (Fraction(1, 10),), 1),
    "sinc-near": ("sinc", (Fraction(2),), 2),
    "sinc": ("sinc", (Fraction(20),), 2),
    "atan2": ("atan2", (Fraction(1), Fraction(1)), 1),
    "atan2-unlike": ("atan2", (Fraction(100), Fraction(1, 3)), 11),
    "wrap": ("wrap", (Fraction(9),), 1),
}
EXACT = {
    "sin": PRECISE.sin,
    "cos": PRECISE.cos,
    "sinc": lambda x: PRECISE.sin(x) / x if x else PRECISE.mpf(1),
    "atan2": PRECISE.atan2,
    "direction": PRECISE.atan2,
    "wrap": lambda x: x - 2 * PRECISE.pi * ((x > PRECISE.pi) - (x < -PRECISE.pi)),
}
#: Functions whose errors are told without whole turns.
TURNING = ("direction", "wrap")
STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-O3"]
#: Largest magnitudes of the inputs of motions, for some seconds of flight.
RANGES = {
    **{"time": 10, "middle": 10, "width": Fraction(1, 4), "a": Fraction(1, 10), "b": 3, "g": Fraction(1, 20)},
    **{axis: Fraction(1, 10) for axis in "xyz"},
    **{f"a{k}": Fraction(1, 10 ** (k + 1)) for k in range(5)},
}
MOTIONS = [
    f"{motion}-{what}"
    for motion in ("constant", "sinusoidal", "coning", "polynomial")
    for what in ("truth", "increments")
]


def program_of(kind: str, bounds: tuple[Fraction, ...], body: Any = None) -> Program:
    """Return a program of scalars x0, x1: the function of them, or of what `body` makes of each."""
    names = [f"x{k}" for k in range(len(bounds))]
    signals = tuple(Signal.scalar(n, bound=b, meaning="argument") for n, b in zip(names, bounds, strict=True))
    arguments = tuple((body or (lambda node: node))(Reference(name)) for name in names)
    return Program(
        KernelInfo("tested", "a function", "none", arguments="tested"),
        inputs=signals,
        body=(Assignment("value", Operation(kind, arguments)),),
        outputs=(Result(Signal.scalar("result", meaning="value"), (Reference("value"),)),),
    )


@cache
def fixed(case: str, word: int, rounding: str = "nearest") -> FixedProgram:
    kind, bounds, _ = CASES[case]
    named = replace(program_of(kind, bounds), name=f"tested_{case.replace('-', '_')}")
    return quantize(named, Settings(word=word, rounding=rounding))


@cache
def model(case: str, word: int, rounding: str = "nearest") -> ModelEvaluator:
    return ModelEvaluator(emit(fixed(case, word, rounding), "fixed-model"))


def corners_and_others(evaluator: Evaluator, count: int, seed: int = 0) -> list[np.ndarray]:
    """Return integers for every input: all combinations of corners, small ones, and random ones."""
    rng = np.random.default_rng(seed)
    highs = [argument.high for argument in evaluator.interface.inputs for _ in argument.values]
    corners = [np.array([-h, 1 - h, -h // 3, -1, 0, 1, h // 2, h - 1, h], object) for h in highs]
    if len(highs) <= 2:
        columns = [grid.ravel() for grid in np.meshgrid(*corners)]
    else:
        columns = [rng.choice(corner, 100) for corner in corners]
    made = []
    for column, high in zip(columns, highs, strict=True):
        inside = [int(x * high) for x in rng.uniform(-1, 1, count)]
        small = [int(x) for x in rng.integers(-min(high, 40), min(high, 40) + 1, count // 4)]
        made.append(np.array([*column, *inside, *small], object))
    arrays, place = [], 0
    for argument in evaluator.interface.inputs:
        size = argument.signal.size
        block = np.stack(made[place : place + size], axis=-1)
        arrays.append(block.astype(evaluator.number))
        place += size
    return arrays


def outputs(evaluator: Evaluator, inputs: list[np.ndarray]) -> list[np.ndarray]:
    made, _ = evaluator.run(inputs, evaluator.fresh(len(inputs[0])))
    return [array.astype(object) for array in made]


def distance(kind: str, computed: Any, exact: Any) -> Any:
    apart = abs(computed - exact)
    return min(apart, abs(apart - 2 * PRECISE.pi)) if kind in TURNING else apart


def worst_error(lowered: FixedProgram, inputs: list[np.ndarray], integers: np.ndarray, kind: str) -> Fraction:
    """Return the worst distance from the function of the same integers."""
    units = [argument.format.unit for argument in lowered.interface.inputs]
    unit = lowered.interface.outputs[0].format.unit
    worst = PRECISE.mpf(0)
    for number, computed in enumerate(integers[:, 0]):
        arguments = [
            PRECISE.mpf(int(a[number, 0])) * PRECISE.mpf(u.numerator) / u.denominator
            for a, u in zip(inputs, units, strict=True)
        ]
        scaled = PRECISE.mpf(int(computed)) * unit.numerator / unit.denominator
        worst = max(worst, distance(kind, scaled, EXACT[kind](*arguments)))
    return Fraction(int(PRECISE.floor(worst * 2**300)), 2**300)


# The series


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("bits", [9, 17, 33, 65])
@pytest.mark.parametrize("reach", [Fraction(1, 10), Fraction(4, 5), Fraction(2)])
def test_sine_series_leaves_out_no_more_than_it_says(first, bits, reach):
    coefficients, left_out = series.sine_series(first, reach, Fraction(1, 2**bits))
    assert left_out <= Fraction(1, 2**bits)
    function = PRECISE.sin if first else PRECISE.cos
    for k in range(-20, 21):
        x = reach * k / 20
        value = sum(c * x ** (2 * n + first) for n, c in enumerate(coefficients))
        distance = abs(PRECISE.mpf(value.numerator) / value.denominator - function(_precise(x)))
        assert distance <= _precise(left_out) + PRECISE.mpf(2) ** -390


@pytest.mark.parametrize("bits", [9, 17, 33, 65])
def test_arctangent_series_leaves_out_no_more_than_it_says(bits):
    coefficients, left_out = series.arctangent_series(Fraction(1, 2**bits))
    assert left_out <= Fraction(1, 2**bits)
    for k in range(-40, 41):
        u = Fraction(7, 16) * k / 40
        value = u * sum(c * u ** (2 * n) for n, c in enumerate(coefficients))
        assert abs(_precise(value) - PRECISE.atan(_precise(u))) <= _precise(left_out)


def test_pi_is_below_by_less_than_its_bound():
    lacking = PRECISE.pi - _precise(series.pi())
    assert 0 < lacking < _precise(series.PI_ERROR)


def _precise(value: Fraction) -> Any:
    return PRECISE.mpf(value.numerator) / value.denominator


# One function


@pytest.mark.long
@pytest.mark.every_combination
@pytest.mark.parametrize("rounding", ["nearest", "truncation"])
@pytest.mark.parametrize("word", [16, 24, 32, 64])
@pytest.mark.parametrize("case", CASES)
def test_error_stays_below_its_bound(case, word, rounding):
    kind, _, places = CASES[case]
    lowered, evaluator = fixed(case, word, rounding), model(case, word, rounding)
    inputs = corners_and_others(evaluator, 120)
    (integers,) = outputs(evaluator, inputs)
    (argument,) = lowered.interface.outputs
    bound = argument.errors[0]
    worst = worst_error(lowered, inputs, integers, kind)
    assert worst <= bound
    # Truncation loses up to twice as much in every rounding.
    assert bound <= places * argument.format.unit * (1 if rounding == "nearest" else 2)
    if kind in ("sin", "cos"):
        assert bound <= 3 * worst


@pytest.mark.parametrize(
    ("word", "rounding"),
    [
        pytest.param(word, rounding, marks=() if (word, rounding) == (16, "nearest") else pytest.mark.long)
        for word, rounding in product(C_WORDS, ("nearest", "truncation"))
    ],
)
def test_c_agrees_with_the_model(word, rounding):
    sources = {case: emit(fixed(case, word, rounding), "c-fixed") for case in CASES}
    compile_together(sources.values())
    for case, compiled in sources.items():
        evaluator = model(case, word, rounding)
        inputs = corners_and_others(evaluator, 3000)
        (expected,), (computed,) = outputs(evaluator, inputs), outputs(CEvaluator(compiled), inputs)
        assert (expected == computed).all(), case


@pytest.mark.parametrize(
    ("kind", "bounds"),
    [
        ("sin", (Fraction(3),)),
        ("cos", (Fraction(3),)),
        ("sinc", (Fraction(5),)),
        ("atan2", (Fraction(1),) * 2),
        ("wrap", (Fraction(25),)),
    ],
)
def test_error_of_the_argument_is_in_the_bound(kind, bounds):
    # A third of the input is rounded: its error goes on through the function.
    body = lambda node: Operation("multiply", (Constant(Fraction(1, 3)), node))  # noqa: E731
    lowered = quantize(program_of(kind, bounds, body), Settings(word=16))
    evaluator = ModelEvaluator(emit(lowered, "fixed-model"))
    inputs = corners_and_others(evaluator, 400)
    (integers,) = outputs(evaluator, inputs)
    thirds = Fraction(1, 3)
    (argument,) = lowered.interface.outputs
    for number, computed in enumerate(integers[:, 0]):
        arguments = [
            _precise(int(a[number, 0]) * g.format.unit * thirds)
            for a, g in zip(inputs, lowered.interface.inputs, strict=True)
        ]
        exact = EXACT[kind](*arguments)
        made = _precise(int(computed) * argument.format.unit)
        assert distance(kind, made, exact) <= _precise(argument.errors[0])
    if kind == "atan2":  # the cut and the origin lie in its range
        assert argument.errors[0] > 6


def test_atan2_away_from_the_origin_and_the_cut_keeps_a_small_bound():
    # The first argument is a root, so not below 0; the second is at least 1/2.
    one, half = Constant(Fraction(1)), Constant(Fraction(1, 2))
    x = Reference("x0")
    square = Operation("multiply", (x, x))
    root = Operation("sqrt", (Operation("add", (square, half)),))
    made = program_of("sin", (Fraction(1),))
    for second, places in ((Operation("add", (square, half)), 4), (Operation("subtract", (x, one)), 4)):
        value = Assignment("value", Operation("atan2", (root, second)))
        changed = Program(**{**made.__dict__, "body": (value,)})
        lowered = quantize(changed, Settings(word=24))
        (argument,) = lowered.interface.outputs
        assert argument.errors[0] <= places * argument.format.unit


def test_a_direction_has_no_error_at_the_cut():
    # Both arguments are rounded, and the angle is near half a turn: only whole turns are uncertain.
    third, x = Constant(Fraction(1, 3)), Reference("x0")
    small = Operation("multiply", (third, x))
    far = Operation("subtract", (small, Constant(Fraction(1))))
    errors = {}
    for kind in ("atan2", "direction"):
        value = Assignment("value", Operation(kind, (small, far)))
        made = program_of("sin", (Fraction(1),))
        lowered = quantize(Program(**{**made.__dict__, "body": (value,)}), Settings(word=32))
        errors[kind] = lowered.interface.outputs[0].errors[0]
        evaluator = ModelEvaluator(emit(lowered, "fixed-model"))
        inputs = corners_and_others(evaluator, 100)
        (integers,) = outputs(evaluator, inputs)
        unit, place = (a.format.unit for a in (lowered.interface.inputs[0], lowered.interface.outputs[0]))
        for given_, computed in zip(inputs[0][:, 0], integers[:, 0], strict=True):
            y = _precise(int(given_) * unit) / 3
            apart = distance(kind, _precise(int(computed) * place), PRECISE.atan2(y, y - 1))
            assert apart <= _precise(errors[kind])
    assert errors["atan2"] > 6
    assert errors["direction"] < Fraction(1, 10**8)


def test_a_wrapped_angle_is_at_most_a_turn_and_a_half():
    with pytest.raises(InputError, match="more than a turn and a half"):
        quantize(program_of("wrap", (Fraction(10),)), Settings())


def test_arguments_on_a_circle_are_checked_to_be_off_the_origin():
    # y and the root of the rest of 1: a check while the code runs proves the bound; a proof where there is one.
    y, z = Reference("x0"), Reference("x1")
    made = program_of("atan2", (Fraction(1), Fraction(1)))
    root = Operation("sqrt", (Operation("multiply", (z, z)),))
    free = Program(**{**made.__dict__, "body": (Assignment("value", Operation("atan2", (y, root))),)})
    assert quantize(free, Settings()).interface.outputs[0].errors[0] > 1
    rest = Operation("subtract", (Constant(Fraction(1)), Operation("multiply", (y, y))))
    root = Operation("sqrt", (Operation("maximum", (Constant(Fraction(0)), rest)),))
    value = Operation("atan2", (y, root))
    bound = Program(**{**made.__dict__, "body": (Assignment("value", value),)})
    lowered = quantize(bound, Settings())
    assert lowered.interface.outputs[0].errors[0] < Fraction(1, 10**8)


def test_both_arguments_zero_give_zero():
    evaluator = model("atan2", 32)
    (integers,) = outputs(evaluator, [np.zeros((1, 1), np.int64)] * 2)
    assert integers[0, 0] == 0


def test_sine_and_cosine_of_one_angle_share_their_reduction():
    made = program_of("sin", (Fraction(10),))
    other = Assignment("other", Operation("cos", (Reference("x0"),)))
    result = Result(Signal.scalar("second", meaning="cosine"), (Reference("other"),))
    changed = Program(**{**made.__dict__, "body": (*made.body, other), "outputs": (*made.outputs, result)})
    alone, both = (quantize(p, Settings()).operations["multiply"] for p in (made, changed))
    assert both == alone


def test_too_wide_a_range_is_refused():
    with pytest.raises(
        InputError, match="words of 8 bits are too short for the sine of angles up to 1000 rad"
    ):
        quantize(program_of("sin", (Fraction(1000),)), Settings(word=8))


# The catalogue


def motion(kernel: str, word: int) -> FixedProgram:
    made = programs()[kernel]
    ranges = {signal.name: Fraction(RANGES[signal.name]) for signal in made.inputs}
    return quantize(made, Settings(word=word, ranges=ranges))


def exact_outputs(made: Program, values: dict[str, Any]) -> dict[str, list[Any]]:
    """Return what a program computes on precise numbers."""
    known = dict(values)
    meanings: dict[str, Any] = {
        **EXACT,
        "sqrt": PRECISE.sqrt,
        "maximum": max,
        "add": lambda a, b: a + b,
        "subtract": lambda a, b: a - b,
        "multiply": lambda a, b: a * b,
        "divide": lambda a, b: a / b,
        "negate": lambda a: -a,
    }

    def value(node: Any) -> Any:
        if isinstance(node, Constant):
            return _precise(node.value)
        if isinstance(node, Reference):
            return known[node.name]
        return meanings[node.kind](*map(value, node.arguments))

    for assignment in made.body:
        known[assignment.name] = value(assignment.value)
    return {result.signal.name: [value(node) for node in result.nodes] for result in made.outputs}


def assert_certified(lowered: FixedProgram, inputs: list[np.ndarray], made: list[np.ndarray]) -> None:
    arguments = lowered.interface.inputs
    for number in range(len(inputs[0])):
        values = {
            name: _precise(int(a[number, k]) * argument.format.unit)
            for argument, a in zip(arguments, inputs, strict=True)
            for k, name in enumerate(argument.signal.elements)
        }
        exact = exact_outputs(lowered.program, values)
        for argument, computed in zip(lowered.interface.outputs, made, strict=True):
            for k, expected in enumerate(exact[argument.signal.name]):
                error = abs(_precise(int(computed[number, k]) * argument.format.unit) - expected)
                assert error <= _precise(argument.errors[k]), (argument.signal.name, k)


@pytest.mark.long
@pytest.mark.parametrize("word", C_WORDS)
@pytest.mark.parametrize("kernel", MOTIONS)
def test_motions_on_stated_ranges(kernel, word):
    lowered = motion(kernel, word)
    evaluator = ModelEvaluator(emit(lowered, "fixed-model"))
    inputs = corners_and_others(evaluator, 120)
    made = outputs(evaluator, inputs)
    assert_certified(lowered, inputs, made)
    for expected, computed in zip(made, outputs(CEvaluator(emit(lowered, "c-fixed")), inputs), strict=True):
        assert (expected == computed).all()


def test_motion_without_ranges_says_which_is_missing():
    made = programs()["constant-truth"]
    assert not can_lower(made)
    with pytest.raises(InputError, match="the range of input time is not known"):
        quantize(made, Settings())


def near_rotations(evaluator: Evaluator, count: int, size: float) -> np.ndarray:
    """Return integers of rotations with an error of about `size` in every element."""
    rng = np.random.default_rng(3)
    rotations = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    rotations *= np.linalg.det(rotations)[:, None, None]
    wrong = rotations + size * rng.uniform(-1, 1, rotations.shape)
    return evaluator.integers(evaluator.interface.inputs[0], wrong.reshape(count, 9))


@pytest.mark.long
@pytest.mark.parametrize("size", [0.0, 1e-6, 1e-3, 1e-2])
def test_nearest_rotation(size):
    made = programs()["dcm-orthonormalize-optimal"]
    assert can_lower(made)
    lowered = quantize(made, Settings(word=32))
    evaluator, generated = (
        ModelEvaluator(emit(lowered, "fixed-model")),
        CEvaluator(emit(lowered, "c-fixed")),
    )
    inputs = [near_rotations(evaluator, 60, size)]
    (integers,) = outputs(evaluator, inputs)
    assert (integers == outputs(generated, inputs)[0]).all()
    for words, computed in zip(inputs[0], integers, strict=True):
        matrix = words.reshape(3, 3) * float(lowered.interface.inputs[0].format.unit)
        left, _, right = np.linalg.svd(matrix)
        nearest = (left @ right).ravel()
        unit = float(lowered.interface.outputs[0].format.unit)
        error = np.abs(computed.astype(float) * unit - nearest).max()
        assert error <= lowered.error_bounds["orthonormalized"]
        # The bound is that of any two attitudes: the angle of the cubic is undetermined at equal eigenvalues. What
        # comes out is far better, for to second order it is the same whatever that angle is.
        assert error < 1e-6


# The generated C


def sources(name: str, word: int) -> Any:
    if name in CASES:
        return emit(fixed(name, word), "c-fixed")
    if name in MOTIONS:
        return emit(motion(name, word), "c-fixed")
    return generate(programs()[name], "c-fixed", Settings(word=word))


_DRIVER = """
static void run_{name}(void)
{{
    unsigned long long random = 88172645463325252ULL;
    {type} in[{inputs}][9], out[{outputs}][9];
    const {type} high[{inputs}] = {{{highs}}};
    unsigned long done = 0;
    for (unsigned long k = 0; k < 20000; ++k) {{
        for (int s = 0; s < {inputs}; ++s)
            for (int j = 0; j < 9; ++j) {{
                random ^= random << 13; random ^= random >> 7; random ^= random << 17;
                switch (random % 8) {{
                case 0: in[s][j] = high[s]; break;
                case 1: in[s][j] = ({type})-high[s]; break;
                case 2: in[s][j] = ({type})((long long)(random >> 8) % 5 - 2); break;
                default: in[s][j] = ({type})((long long)(random >> 1) % high[s] * (random >> 40 & 1 ? 1 : -1));
                }}
            }}
        done += !{name}({arguments});
    }}
    printf("{name} %lu\\n", done);
}}
"""


def driver(made: Any, word: int) -> str:
    """Return the C that calls a kernel on 20,000 random inputs, and prints how many it took."""
    inputs, results = made.fixed.inputs, made.fixed.outputs
    arguments = [f"in[{k}]" for k in range(len(inputs))] + [f"out[{k}]" for k in range(len(results))]
    return _DRIVER.format(
        name=made.function.name,
        type=f"int{word}_t",
        inputs=len(inputs),
        outputs=len(results),
        highs=", ".join(str(argument.high) for argument in inputs),
        arguments=", ".join(arguments),
    )


@pytest.mark.long
@pytest.mark.parametrize("word", C_WORDS)
def test_c_compiles_without_a_warning_and_has_no_undefined_behaviour(word, tmp_path):
    """Without optimization the sanitizers see every operation of the source."""
    gcc = shutil.which("gcc") or pytest.skip("gcc is not on this machine")
    every = {name: sources(name, word) for name in (*CASES, *MOTIONS, "dcm-orthonormalize-optimal")}
    texts = {file: text for one in every.values() for file, text in one.step_files.items()}
    for file, text in texts.items():
        (tmp_path / file).write_text(text)
    (tmp_path / "all.c").write_text("".join(f'#include "{file}"\n' for file in texts if file.endswith(".c")))
    command = [gcc, *STRICT, "-c", "-o", "/dev/null", "all.c"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    calls = "".join(f"    run_{made.function.name}();\n" for made in every.values())
    main = ['#include <stdio.h>\n#include "all.c"\n', *(driver(made, word) for made in every.values())]
    (tmp_path / "main.c").write_text("".join([*main, f"int main(void)\n{{\n{calls}    return 0;\n}}\n"]))
    flags = ["-std=c99", "-O0", "-fsanitize=undefined,address", "-fno-sanitize-recover=all"]
    subprocess.run([gcc, *flags, "-o", "main", "main.c"], cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "main"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    taken = dict(line.split() for line in done.stdout.splitlines())
    # Most matrices are too far from a rotation; every argument of the others is accepted.
    del taken[every["dcm-orthonormalize-optimal"].function.name]
    assert taken == {
        made.function.name: "20000" for name, made in every.items() if not name.startswith("dcm")
    }
