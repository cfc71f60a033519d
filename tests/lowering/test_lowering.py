"""Lowering: every program of the catalogue computes its kernel, exactly."""

from collections import Counter
from fractions import Fraction
from functools import cache
from random import Random

import mpmath
import pytest
import sympy as sp
from derived import FUNCTIONS, kernel, precisely, program, tells_more

from strapgen import catalogue, derive
from strapgen.catalogue import STANDARD_METHODS, Choice
from strapgen.ir.program import RESOLUTION, Constant, Node, Operation, Program, Reference, walk
from strapgen.kernel.kernel import Kernel, rationalize
from strapgen.lowering import candidates, canonical
from strapgen.lowering.passes import PASSES, cost, optimize

STANDARD = catalogue.standard()
EVERY = pytest.mark.parametrize(
    "choice",
    [pytest.param(c, marks=() if tells_more(c) else pytest.mark.long, id=c.kernel) for c in STANDARD],
)
TOGETHER = pytest.mark.parametrize("choice", STANDARD, ids=lambda choice: choice.kernel)


def input_names(made: Kernel | Program) -> list[str]:
    return [name for signal in made.inputs for name in signal.elements]


def is_polynomial(choice: Choice) -> bool:
    try:
        kernel(choice).polynomials()
    except TypeError:
        return False
    return True


#: Kernels with roots and functions, by the names of their choices.
OTHER_NAMES = {
    "dcm-orthonormalize",
    "dcm-orthonormalize-optimal",
    "euler-normalize",
    "cayley-klein-normalize",
    "euler-from-dcm",
    "cayley-klein-from-dcm",
    "constant-truth",
    "sinusoidal-truth",
    "sinusoidal-increments",
    "coning-truth",
    "coning-increments",
    "polynomial-truth",
    "dcm-update",
    "euler-from-dcm-sheppard",
    "dcm-from-euler-angles",
    "euler-angles-from-dcm",
}
OTHER = [choice for choice in STANDARD if choice.name in OTHER_NAMES]
POLYNOMIAL = [choice for choice in STANDARD if choice not in OTHER]


def test_roots_and_functions_are_where_they_belong():
    # Else a kernel that no longer is a polynomial would slip into the weaker test below.
    assert {choice.name for choice in STANDARD if not is_polynomial(choice)} == OTHER_NAMES


@pytest.mark.parametrize("choice", POLYNOMIAL, ids=lambda choice: choice.kernel)
def test_a_program_is_the_same_polynomial_as_its_kernel(choice):
    names = input_names(kernel(choice))
    ring, *generators = sp.ring(names, sp.QQ)
    result = program(choice).run(dict(zip(names, generators, strict=True)))
    result = {name: [ring(element) for element in elements] for name, elements in result.items()}
    assert result == kernel(choice).polynomials()


#: What the operations mean, in any precision.
MEANING = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
    "negate": lambda a: -a,
    "sqrt": mpmath.sqrt,
    "sin": mpmath.sin,
    "cos": mpmath.cos,
    "sinc": mpmath.sinc,
    "atan2": mpmath.atan2,
    "direction": FUNCTIONS["Direction"],
    "wrap": FUNCTIONS["Wrapped"],
    "maximum": max,
    "at_least": lambda a, b: a >= b,
    "select": lambda condition, yes, no: yes if condition else no,
}


def run_precisely(made: Program, values: dict[str, Fraction]) -> list:
    """Return all elements of all outputs in the precision of mpmath."""
    known = {name: mpmath.mpf(value.numerator) / value.denominator for name, value in values.items()}
    known[RESOLUTION] = mpmath.mpf(2) ** -52

    def value(node: Node):
        if isinstance(node, Constant):
            return mpmath.mpf(node.value.numerator) / node.value.denominator
        if isinstance(node, Reference):
            return known[node.name]
        return MEANING[node.kind](*map(value, node.arguments))

    for assignment in made.body:
        known[assignment.name] = value(assignment.value)
    return [value(node) for result in made.outputs for node in result.nodes]


def expand_precisely(made: Kernel, values: dict[str, Fraction]) -> list:
    """Return the same from the kernel's expressions, which SymPy hands to mpmath stage by stage."""
    known = {name: mpmath.mpf(value.numerator) / value.denominator for name, value in values.items()}
    known[RESOLUTION] = mpmath.mpf(2) ** -52
    known = precisely(made, known)
    return [known[name] for stage in made.outputs for name in stage.signal.elements]


@pytest.mark.long
@pytest.mark.parametrize("choice", OTHER, ids=lambda choice: choice.kernel)
def test_a_program_agrees_with_its_kernel_to_forty_digits(choice):
    random = Random(1969)
    names = input_names(kernel(choice))
    for _ in range(6):
        values = {name: Fraction(random.randint(-999, 999), 500) for name in names}
        if kernel(choice).inputs[0].shape == (3, 3):
            values |= near_a_rotation(dict(list(values.items())[:9]), random)
        with mpmath.workdps(60):
            result = run_precisely(program(choice), values)
            expected = expand_precisely(kernel(choice), values)
            assert all(mpmath.isfinite(x) for x in expected)
            # Twenty digits to spare: more than any cancellation in these formulas takes.
            for a, b in zip(result, expected, strict=True):
                assert abs(a - b) <= mpmath.mpf("1e-40") * max(1, abs(b))


def near_a_rotation(values: dict[str, Fraction], random: Random) -> dict[str, Fraction]:
    """Return the elements of a matrix of positive determinant in some attitude, so that every branch is taken."""
    q = [Fraction(random.randint(-9, 9)) for _ in range(3)] + [Fraction(random.randint(1, 9))]
    random.shuffle(q)
    matrix = sp.Matrix(
        3,
        3,
        derive("dcm-from-euler").expand(dict(zip(("e_x", "e_y", "e_z", "e_s"), q, strict=True)))["attitude"],
    )
    matrix /= sum(x * x for x in q)
    return {
        name: Fraction(int(element.p), int(element.q)) + values[name] / 50
        for name, element in zip(values, matrix, strict=True)
    }


@cache
def every_candidate(choice: Choice) -> list[Program]:
    rational = rationalize(kernel(choice))
    return list(candidates(rational, canonical.extract_core(rational)))


@pytest.mark.long
@EVERY
def test_passes_leave_the_values(choice):
    # On random exact rationals: equal where a kernel has no roots or functions, else to forty digits.
    random = Random(7)
    for before in every_candidate(choice):
        names = input_names(before)
        values = near_a_rotation(dict.fromkeys(names, Fraction(0)), random) if len(names) == 9 else {}
        values = values or {name: Fraction(random.randint(1, 99), 100) for name in names}
        if choice in POLYNOMIAL:
            exact = before.run(values)
            for run in PASSES:
                before = run(before)
                assert before.run(values) == exact
            continue
        with mpmath.workdps(60):
            expected = run_precisely(before, values)
            for run in PASSES:
                before = run(before)
                for a, b in zip(run_precisely(before, values), expected, strict=True):
                    assert abs(a - b) <= mpmath.mpf("1e-40") * max(1, abs(b))


@EVERY
def test_the_cheapest_candidate_is_taken(choice):
    assert cost(program(choice)) == min(map(cost, map(optimize, every_candidate(choice))))


@TOGETHER
def test_nothing_unused_is_left(choice):
    made = program(choice)
    used = made.used()
    assert [a.name for a in made.body if a.name not in used] == []
    # A constant rate does not ask for the time.
    unused = {
        "constant-increments": {"middle"},
        "euler-angles-from-dcm": {"last_pitch", "last_heading"},  # only roll is held
    }
    assert set(input_names(made)) - used == unused.get(choice.name, set())


@TOGETHER
def test_results_are_names_or_constants(choice):
    # The count leaves results out, so nothing may be computed in them.
    made = program(choice)
    results = [*made.outputs, *([made.transition] if made.transition else [])]
    nodes = [node for result in results for node in result.nodes]
    assert all(isinstance(node, Reference | Constant) for node in nodes)


@pytest.mark.parametrize("choice", STANDARD, ids=lambda choice: choice.kernel)
def test_equal_operations_are_computed_once(choice):
    # Conditions apart: they are no values that a program could hold.
    operations = Counter(
        node
        for assignment in program(choice).body
        for node in walk(assignment.value)
        if isinstance(node, Operation) and node.kind != "at_least"
    )
    assert [node for node, count in operations.items() if count > 1] == []


@pytest.mark.parametrize(
    ("method", "count"),
    [
        *((method, 2) for method in STANDARD_METHODS),
        *(pytest.param(*step, marks=pytest.mark.long) for step in (("rk2", 4), ("rk4", 3), ("rk3", None))),
    ],
)
def test_euler_and_cayley_klein_are_one_arithmetic(method, count):
    # a1 = e4, a2 = e1, a3 = e2, a4 = e3: the labels s, x, y, z say which is which.
    euler, cayley_klein = (program(Choice(name, method, count)) for name in ("euler", "cayley-klein"))
    assert body(euler, "e") == body(cayley_klein, "a")
    # ... and the same elements come out.
    held = [
        {n: node for n, node in zip(r.signal.elements, r.nodes, strict=True)}
        for r in (euler.outputs[0], cayley_klein.outputs[0])
    ]
    assert held[0] == held[1]


@pytest.mark.parametrize("suffix", ["product", "normalize"])
def test_euler_and_cayley_klein_companions_are_one_arithmetic(suffix):
    assert body(program(Choice(f"euler-{suffix}")), "e") == body(
        program(Choice(f"cayley-klein-{suffix}")), "a"
    )


def body(made: Program, prefix: str) -> list[tuple[str, Node]]:
    def renamed(node: Node) -> Node:
        if isinstance(node, Reference) and node.name.startswith(f"{prefix}_"):
            return Reference(f"state_{node.name[-1]}")
        if isinstance(node, Operation):
            return Operation(node.kind, tuple(map(renamed, node.arguments)))
        return node

    return [(assignment.name, renamed(assignment.value)) for assignment in made.body]


@pytest.mark.parametrize("choice", STANDARD[:12], ids=lambda choice: choice.kernel)
def test_the_transition_asks_for_the_increments_alone(choice):
    made = program(choice)
    part = made.transition_program()
    assert [signal.name for signal in part.inputs] == ["increments"]
    # The transition is the step of the identity.
    ring, *d = sp.ring(part.inputs[0].elements, sp.QQ)
    (transition,) = part.run(dict(zip(part.inputs[0].elements, d, strict=True))).values()
    start = [*made.attitude_step.identity, *d]
    (step,) = made.run(dict(zip(input_names(made), start, strict=True))).values()
    assert [ring(x) for x in transition] == [ring(x) for x in step]


def test_stages_keep_their_names_and_meanings():
    made = program(Choice("euler", "rk4", 2))
    said = {a.name: a.meaning for a in made.body if a.meaning}
    assert said["sigma_x"] == "the angle increment of the whole step"
    assert "the identity" in said["p_x"]
    assert "scalar part" in said["p_s"]
