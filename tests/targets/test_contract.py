"""Headers: what they state of arguments, values, rounding and runs holds, and programs can read it back."""

from __future__ import annotations

import ast
import re
from fractions import Fraction

import numpy as np
import pytest
from derived import program, programs, quantized
from small_programs import TYPES, computed

import strapgen
from strapgen import generate, pipeline
from strapgen.catalogue import Choice, choose
from strapgen.fixedpoint.floating import rounding_bounds
from strapgen.ir import formats
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import IntegerSum, Value
from strapgen.ir.interfaces import RoundingBounds
from strapgen.run.compiled_code import CEvaluator
from strapgen.storage import resources
from strapgen.targets import emit
from strapgen.targets.contract import argument_text, rounding_text, run_paragraphs, value_text
from strapgen.targets.contract_lines import Contract


@pytest.mark.parametrize(
    ("settings", "limits", "error"),
    [
        # A product is rounded by half a place.
        (
            Settings(word=16),
            "format Q1.14, unit 2^-14; range -17408 to 17408 (-1.0625 to 1.0625)",
            "error <= 3.05176e-05 (0.5000 ulp)",
        ),
        # What saturates stores 1 itself as a place less.
        (
            Settings(word=16, state="q15"),
            "format Q0.15, unit 2^-15; range -32768 to 32767 (-1 to 0.99997)",
            "saturates at both ends; error <= 3.05176e-05 (1.0000 ulp), where the exact value is "
            "from -1 to 1; beyond, at most the larger of this and its distance from the range",
        ),
    ],
)
def test_an_output_tells_its_error_and_whether_it_saturates_and_an_input_neither(settings, limits, error):
    interface = pipeline.compile(choose("euler-product"), "c-fixed", settings).fixed
    assert [argument_text(argument) for argument in interface.inputs] == [limits, limits]
    assert [argument_text(argument) for argument in interface.outputs] == [f"{limits}; {error}"]


def test_limits_of_an_argument_are_rounded_outward():
    settings = Settings(word=16, largest_angle=Fraction(1, 10))
    increments = quantized(Choice("euler", "rk2", 1), settings).interface.inputs[1]
    low, high = re.search(r"\((\S+) to (\S+)\)", argument_text(increments)).groups()
    assert (
        Fraction(low) < increments.low * increments.unit < increments.high * increments.unit < Fraction(high)
    )


def test_value_rounds_range_outward_and_error_upward():
    """Of integers from -7 to 1001 in Q5.10 the range is -0.0068359... to 0.97753..., rounded away from each other."""
    value = Value("x", IntegerSum(()), 10, False, -7, 1001, Fraction(0), Fraction(1, 999), 1001)
    assert value_text(value, 16) == "Q5.10, -0.00684 .. 0.978, error 0.0011"


def contract_of(header: str) -> Contract:
    contract = Contract.read(header)
    assert contract is not None
    return contract


def value(text: str, names: dict[str, Fraction]) -> Fraction:
    """Return an expression of a contract in exact arithmetic."""

    def walk(node: ast.expr) -> Fraction:
        match node:
            case ast.Constant(int(number)):
                return Fraction(number)
            case ast.Name(name):
                return names[name]
            case ast.UnaryOp(ast.USub(), argument):
                return -walk(argument)
            case ast.BinOp(left, ast.Add(), right):
                return walk(left) + walk(right)
            case ast.BinOp(left, ast.Sub(), right):
                return walk(left) - walk(right)
            case ast.BinOp(left, ast.Mult(), right):
                return walk(left) * walk(right)
            case ast.BinOp(left, ast.Div(), right):
                return walk(left) / walk(right)
            case ast.BinOp(ast.Constant(int(base)), ast.Pow(), ast.Constant(int(power))):
                return Fraction(base) ** power
        raise AssertionError(ast.dump(node))

    return walk(ast.parse(text.replace("^", "**"), mode="eval").body)


def test_every_generated_header_is_read_back():
    folder = resources.folder("generated")
    headers = [path for name in ("c", "c_float", "c_fixed") for path in (folder / name).glob("*.h")]
    assert len(headers) > 100
    for path in headers:
        contract = contract_of(path.read_text())
        assert (contract.version, contract.function) == (strapgen.__version__, path.stem)
        assert contract.of_kind("let") and contract.of_kind("ensures")
        assert f'_DIGEST "{contract.digest}"' in path.read_text()


@pytest.mark.long
@pytest.mark.parametrize(
    ("choice", "settings"),
    [
        (Choice("euler", "rk4", 2), Settings.of(max_rate_deg_s=400, step="0.01", increments=2)),
        (Choice("dcm", "rk3", 2), Settings(16, carry="full")),
    ],
    ids=lambda value: getattr(value, "kernel", ""),
)
def test_a_program_can_check_the_integers_of_a_call_by_the_header_alone(choice, settings):
    fixed = quantized(choice, settings)
    sources = generate(fixed, "c-fixed")
    header = next(text for name, text in sources.step_files.items() if name.endswith(".h"))
    contract, draw = contract_of(header), np.random.default_rng(1969)
    ranges = [
        re.fullmatch(r"(-?\d+) <= (\w+)\[0\.\.(\d+)\] <= (-?\d+)", t) for t in contract.of_kind("requires")
    ]
    memory = {
        r[2]: draw.integers(int(r[1]), int(r[4]), int(r[3]) + 1, endpoint=True).tolist() for r in ranges
    }
    of = CEvaluator(sources)
    arrays = [np.array([memory[a.signal.name]]) for a in fixed.interface.inputs]
    (after,), _ = of.run(arrays, of.fresh(1))
    names: dict[str, Fraction] = {}
    for text in contract.of_kind("let"):
        name, _, expression = text.partition(" = ")
        several = re.fullmatch(r"(\w+)\[0\.\.(\d+)\](.*)", expression)
        if several is None:
            names[name] = value(expression, names)
            continue
        for element, word in zip(name.split(", "), memory[several[1]], strict=True):
            names[element] = value(f"({word}){several[3]}", {})
    memory["next"] = after.ravel().tolist()
    bounds = 0
    for text in contract.of_kind("ensures"):
        if stated := re.fullmatch(r"\|next\[(\d+)\](.*) <= (\S+)", text):
            left = stated[2].rpartition("|")[0]
            distance = value(f"({memory['next'][int(stated[1])]}){left}", names)
            assert 0 < abs(distance) <= Fraction(stated[3])
            bounds += 1
    assert bounds == fixed.interface.outputs[0].signal.size


@pytest.mark.parametrize(("target", "number"), [("c", "double"), ("c-float", "float")])
@pytest.mark.parametrize("name", ["euler-rk4-2", "dcm-product", "coning-fast"])
def test_a_program_can_check_the_numbers_of_a_call_by_the_header_alone(name, target, number):
    code = programs()[name]
    sources = generate(code, target)
    header = next(text for file, text in sources.step_files.items() if file.endswith(".h"))
    contract, draw = contract_of(header), np.random.default_rng(1969)
    memory: dict[str, list[Fraction]] = {}
    for text in contract.of_kind("requires"):
        low, argument, last, high = re.fullmatch(r"(\S+) <= (\w+)\[0\.\.(\d+)\] <= (\S+)", text).groups()
        floats = draw.uniform(float(Fraction(low)), float(Fraction(high)), int(last) + 1)
        memory[argument] = [Fraction(float(x)) for x in floats.astype(TYPES[number])]
    names: dict[str, Fraction] = {}
    for text in contract.of_kind("let"):
        left, _, expression = text.partition(" = ")
        if several := re.fullmatch(r"(\w+)\[0\.\.\d+\]", expression):
            names |= zip(left.split(", "), memory[several[1]], strict=True)
        else:
            names[left] = value(expression, names)
    elements = {e: np.array([float(names[e])]) for signal in code.inputs for e in signal.elements}
    outputs = computed(code, elements, number)
    bounds = 0
    for text in contract.of_kind("ensures"):
        if stated := re.fullmatch(r"\|(\w+)\[(\d+)\] - (.*)\| <= (\S+)", text):
            got = Fraction(float(outputs[stated[1]][int(stated[2])][0]))
            assert abs(got - value(stated[3], names)) <= Fraction(stated[4])
            bounds += 1
        else:
            output, place, exact = re.fullmatch(r"(\w+)\[(\d+)\] = (\w+)", text).groups()
            assert Fraction(float(outputs[output][int(place)][0])) == value(exact, names)
    assert bounds == sum(error > 0 for errors in sources.rounding.errors.values() for error in errors) > 0


def test_the_digest_changes_with_the_algorithm_and_its_options_alone():
    def digest(settings: Settings, method: str = "rk2") -> str:
        files = generate(quantized(Choice("euler", method, 2), settings), "c-fixed").step_files
        return contract_of(next(text for name, text in files.items() if name.endswith(".h"))).digest

    digests = [
        digest(Settings()),
        digest(Settings(carry="full")),
        digest(Settings(), "rk1"),
    ]
    assert len(set(digests)) == 3
    assert digest(Settings()) == digests[0]


def test_a_header_without_a_contract_has_none():
    assert Contract.read("/* Nothing. */\n") is None


@pytest.mark.parametrize("digits", [2, 3, 6])
def test_header_bounds_are_rounded_to_the_safe_side(digits):
    rng = np.random.default_rng(1969)
    drawn = [Fraction(int(a), int(b)) for a, b in rng.integers(1, 1 << 40, (200, 2))]
    for size in (*drawn, *(x / (1 << 60) for x in drawn), *(x * 10**20 for x in drawn), Fraction(7, 1000)):
        for number in (size, -size):
            low, high = Fraction(formats.below(number, digits)), Fraction(formats.above(number, digits))
            assert low <= number <= high
            assert high - low <= size / 10 ** (digits - 1)
    assert formats.above(Fraction(1, 3)) == "0.333334"


def said(name: str, number: str = "double") -> tuple[RoundingBounds, str]:
    code = programs()[name]
    bounds = rounding_bounds(code, number)
    return bounds, rounding_text(bounds, code)


@pytest.mark.long
@pytest.mark.parametrize("target", ["c", "c-float"])
def test_every_header_has_a_line_on_rounding_beside_the_operations(target):
    for name, code in programs().items():
        sources = emit(code, target)
        header = next(text for file, text in sources.step_files.items() if file.endswith(".h"))
        head = " ".join(re.sub(r"^ \* ?", "", header, flags=re.MULTILINE).split())
        expected = " ".join(rounding_text(sources.rounding, code).split())
        assert re.search(r"temporaries\. Rounding: ", head), name
        assert f"Rounding: {expected}." in head, name


@pytest.mark.long
@pytest.mark.parametrize("number", ["double", "float"])
def test_header_text_has_all_proved_bounds(number):
    for name in programs():
        bounds, text = said(name, number)
        for output, worst in bounds.worst.items():
            if any(bounds.worst.values()) and worst:
                shown = re.search(rf"\berror of {output} <= (\S+?)( \(|,|;|\.(?!\d))", text)
                assert shown, text
                assert worst <= Fraction(shown[1]) <= worst * Fraction(102, 100)


def test_the_text_of_a_step_is_a_bound_of_runs():
    bounds, text = said("dcm-rk4-2")
    per_step, growth = re.search(
        r"the row of the error after N steps is at most (\S+) N exp\((\S+) N\) long", text
    ).groups()
    assert Fraction(per_step) >= bounds.accumulation.per_step
    assert 1 + Fraction(growth) >= bounds.accumulation.growth


@pytest.mark.long
def test_all_conditions_are_reported():
    assert "from 0.75 to 1.34375" in said("euler-normalize")[1]
    assert "sin of the C library within 1 ulp" in said("dcm-update")[1]
    for name in programs():
        bounds, text = said(name)
        if any(bounds.worst.values()):
            assert "-ffp-contract=off" in text
            assert all(condition.value in text for condition in (*bounds.inputs, *bounds.conditions))


def test_missing_errors_and_bounds_are_stated():
    assert said("euler-from-cayley-klein")[1] == "none; every output is exact"
    assert said("euler-from-dcm")[1].startswith("no bound: rounding may turn a comparison")


RATES = {"max_rate_deg_s": 400, "step": "0.01", "increments": 2}


def paragraphs(algorithm: str, settings: Settings, method: str = "rk4") -> list[str]:
    choice = Choice(algorithm, method, 2)
    return run_paragraphs(quantized(choice, settings).interface, program(choice))


@pytest.mark.long
@pytest.mark.parametrize("carry", ["none", "full"])
@pytest.mark.parametrize("algorithm", ["euler", "cayley-klein", "dcm"])
def test_examples_are_the_formula_rounded_up(algorithm, carry):
    settings = Settings.of(**RATES, carry=carry)
    interface = quantized(Choice(algorithm, "rk4", 2), settings).interface
    angles = interface.angle_accumulation
    error = 4 * interface.inputs[0].format.unit
    text = paragraphs(algorithm, settings)
    pattern = r"- N = (\d+)(, an hour)?: (\S+) rad; .* every 1000 steps: (\S+) rad"
    examples = [re.fullmatch(pattern, line).groups() for line in text if line.startswith("- ")]
    assert [(int(steps), hour) for steps, hour, *_ in examples] == [
        (10**4, None),
        (360_000, ", an hour"),
        (10**6, None),
    ]
    for steps, _, alone, normalized in examples:
        exact = angles.bound(int(steps)), angles.bound(int(steps), int(steps) // 1000, error)
        for printed, value in zip((alone, normalized), exact, strict=True):
            assert value <= float(printed) <= 1.001 * value
    formula = re.search(r"at most (?:(\S+) \+ )?(\S+) N rad", text[0])
    once, per_step = (Fraction(part or 0) for part in formula.groups())
    assert angles.once <= once <= Fraction(1001, 1000) * angles.once
    assert angles.per_step <= per_step <= Fraction(1001, 1000) * angles.per_step


def test_a_bound_beyond_half_a_turn_is_none():
    lines = paragraphs("dcm", Settings(16))
    assert any(line.startswith("- N = 1000000: no bound") for line in lines)


def test_a_kernel_that_is_no_step_says_nothing_of_runs():
    choice = Choice("euler-normalize")
    assert run_paragraphs(quantized(choice, Settings()).interface, program(choice)) == []
