"""Every pass, on random programs: no value changes, and nothing that means something is lost."""

from dataclasses import replace
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from strapgen.ir.kernel_info import KernelInfo
from strapgen.ir.program import (
    Assignment,
    Constant,
    Node,
    Operation,
    Program,
    Reference,
    Result,
    references,
    walk,
)
from strapgen.ir.signals import Signal
from strapgen.lowering.passes import PASSES, cost, optimize, remove_unused
from strapgen.lowering.trees import FACTOR, SHARED, is_temporary

INPUTS = ("x", "y", "z")
EVERY = pytest.mark.parametrize("run", PASSES, ids=lambda run: run.__name__)
SETTINGS = settings(max_examples=25, derandomize=True, database=None, deadline=None)

KINDS = 2 * ("add", "subtract", "multiply", "negate") + ("scale", "divide", "select", "maximum")
#: What the name of a value begins with; a value without a name is written out wherever it is used.
PREFIXES = ("", "", SHARED, SHARED, FACTOR, "part_")
#: Trees can grow twofold with every instruction: larger ones get a name.
LARGEST = 8

numbers = st.sampled_from([Fraction(n, d) for n in (-3, -2, -1, 0, 1, 2, 3, 5) for d in (1, 2, 3)])
places = st.sampled_from([0, 0, 0, 1, 1, 2, 3, 4, 5])
instructions = st.tuples(st.sampled_from(KINDS), places, places, places, numbers, st.sampled_from(PREFIXES))
points = st.fixed_dictionaries({name: numbers.map(lambda x: x + Fraction(1, 7)) for name in INPUTS})


@st.composite
def programs(draw: st.DrawFn) -> Program:
    """Sums and products, most of all; quotients by numbers; and choices, whose conditions are no values."""
    body: list[Assignment] = []
    known: list[Node] = list(map(Reference, INPUTS))
    drawn = draw(st.lists(instructions, min_size=1, max_size=14))
    for k, (kind, first, second, third, number, prefix) in enumerate(drawn, 1):
        a, b, c = (known[-1 - place % len(known)] for place in (first, second, third))
        constant = Constant(number)
        match kind:
            case "negate":
                node = Operation("negate", (a,))
            case "scale":
                node = Operation("multiply", (constant, a) if second % 2 else (a, constant))
            case "divide":
                node = Operation("divide", (a, constant if number else Constant(Fraction(7))))
            case "select":
                condition = Operation("at_least", (a, constant if first == third else b))
                node = Operation("select", (condition, b, c))
            case _:
                node = Operation(kind, (a, constant if first == second else b))
        if not prefix and sum(1 for _ in walk(node)) > LARGEST:
            prefix = SHARED
        if prefix:
            body.append(Assignment(f"{prefix}{k}", node, "" if is_temporary(prefix) else "a stage"))
            node = Reference(f"{prefix}{k}")
        known.append(node)
    if isinstance(known[-1], Operation):
        body.append(Assignment("last", known[-1]))
        known[-1] = Reference("last")
    names = [node for node in known if isinstance(node, Reference)]
    held = [names[-1], *draw(st.lists(st.sampled_from(names), max_size=3))]
    moved = draw(st.lists(st.sampled_from(names), max_size=2))
    return Program(
        KernelInfo("p", "", ""),
        tuple(map(Signal.scalar, INPUTS)),
        tuple(body),
        tuple(Result(Signal.scalar(f"output_{k}"), (name,)) for k, name in enumerate(held)),
        Result(Signal.labelled("transition", "t", map(str, range(len(moved)))), tuple(moved))
        if moved
        else None,
    )


def results(program: Program, point: dict[str, Fraction]) -> dict[str, list[Fraction]]:
    """Return the outputs, and the transition with them."""
    return replace(program, outputs=program.results, transition=None).run(point)


def named(program: Program) -> list[Assignment]:
    return [assignment for assignment in program.body if not is_temporary(assignment.name)]


def stages(program: Program, point: dict[str, Fraction]) -> dict[str, list[Fraction]]:
    """Return the values of all names that stand for something."""
    outputs = tuple(Result(Signal.scalar(a.name), (Reference(a.name),)) for a in named(program))
    return replace(program, outputs=outputs, transition=None).run(point)


@pytest.mark.long
@EVERY
@SETTINGS
@given(program=programs(), point=points)
def test_a_pass_keeps_every_value_and_the_stages_that_are_used(run, program, point):
    changed = run(program)
    assert results(changed, point) == results(program, point)
    # Not only what comes out: a name that is said to mean something still holds it.
    before, after = stages(program, point), stages(changed, point)
    assert after == {name: before[name] for name in after}
    # ... and is there at all where it is used, with its meaning.
    stated = [(a.name, a.meaning) for a in named(program)]
    if run is remove_unused:
        stated = [(name, meaning) for name, meaning in stated if name in program.used()]
    assert [(a.name, a.meaning) for a in named(changed)] == stated


@SETTINGS
@given(program=programs(), point=points)
def test_all_passes_together_keep_every_value_and_never_add_operations(program, point):
    optimized = optimize(program)
    assert results(optimized, point) == results(program, point)
    assert cost(optimized) <= cost(program)


@SETTINGS
@given(program=programs())
def test_all_passes_together_leave_nothing_to_tidy_up(program):
    optimized = optimize(program)
    assert remove_unused(optimized) is optimized
    for assignment in optimized.body:
        for node in walk(assignment.value):
            if isinstance(node, Operation) and node.kind in ("add", "subtract", "multiply", "negate"):
                assert not all(isinstance(argument, Constant) for argument in node.arguments)
    # Results and inputs are where they were.
    assert [result.signal for result in optimized.results] == [result.signal for result in program.results]
    assert optimized.inputs == program.inputs


@SETTINGS
@given(program=programs())
def test_all_passes_together_invent_no_meanings(program):
    before = {a.name: a.meaning for a in program.body}
    after = {a.name: a.meaning for a in named(optimize(program))}
    assert after.items() <= before.items()
    # What a result refers to by a name that means something is still called so.
    held = {name for r in program.results for node in r.nodes for name in references(node)} & before.keys()
    assert {name for name in held if not is_temporary(name)} <= after.keys()


def test_cost_counts_all_operations_and_of_these_the_multiplications(parse):
    assert cost(parse("a = x * y + z; b = -a")) == (3, 1)
    # A division, root or function is as long as ten short operations.
    assert cost(parse("a = x * y + z; b = sqrt(-a)")) == (13, 1)
    assert cost(parse("a = x / y")) == cost(parse("a = sqrt(x)")) == (10, 0)
    # An addition is preferred to a multiplication.
    assert cost(parse("a = x + x")) < cost(parse("a = 2 * x"))


def test_a_pass_that_would_cost_operations_is_left_out(parse, show, monkeypatch):
    def wasteful(program: Program) -> Program:
        return parse("y = 1 * x + 0")

    monkeypatch.setattr("strapgen.lowering.passes.PASSES", (wasteful,))
    assert show(optimize(parse("y = 2 * x"))) == "y = 2 * x"
    assert show(optimize(parse("y = 2 * x + 1 + 1"))) == "y = 1 * x + 0"


def test_passes_run_again_while_that_saves_operations(parse, show, monkeypatch):
    def peel(program: Program) -> Program:
        (assignment,) = program.body
        match assignment.value:
            case Operation("negate", (Operation("negate", (inner,)),)):
                return replace(program, body=(replace(assignment, value=inner),))
        return program

    monkeypatch.setattr("strapgen.lowering.passes.PASSES", (peel,))
    assert show(optimize(parse("y = -(-(-(-(-(-(-x))))))"))) == "y = -x"


def test_no_division_by_a_number_is_left(parse, show):
    assert show(optimize(parse("y = x / 3"))) == "y = q(1, 3) * x"
