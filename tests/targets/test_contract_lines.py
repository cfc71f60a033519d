"""The contract in a header: it is read back as it was written, and the code keeps it."""

from __future__ import annotations

import ast
import re
from fractions import Fraction

import numpy as np
import pytest
from derived import programs, quantized
from small_programs import TYPES, computed

import strapgen
from strapgen import generate
from strapgen.catalogue import Choice
from strapgen.ir import formats
from strapgen.ir.fixed_settings import Settings
from strapgen.run.compiled_code import CEvaluator
from strapgen.storage import resources
from strapgen.targets.contract_lines import Contract


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
def test_numbers_of_a_header_are_rounded_away_from_what_they_bound(digits):
    rng = np.random.default_rng(1969)
    drawn = [Fraction(int(a), int(b)) for a, b in rng.integers(1, 1 << 40, (200, 2))]
    for size in (*drawn, *(x / (1 << 60) for x in drawn), *(x * 10**20 for x in drawn), Fraction(7, 1000)):
        for number in (size, -size):
            low, high = Fraction(formats.below(number, digits)), Fraction(formats.above(number, digits))
            assert low <= number <= high
            assert high - low <= size / 10 ** (digits - 1)
    assert formats.above(Fraction(1, 3)) == "0.333334"
