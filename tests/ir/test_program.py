"""Programs: their validation, their interpreter and what they say about themselves."""

import math
from dataclasses import replace
from fractions import Fraction

import pytest

from strapgen.ir.kernel_info import KernelInfo
from strapgen.ir.program import (
    COUNTED_AS,
    OPERATIONS,
    Assignment,
    Constant,
    Operation,
    Program,
    Reference,
    Result,
    once,
)
from strapgen.ir.signals import Signal

X, Y = Reference("x"), Reference("y")
SUM = Operation("add", (X, Y))


def program(*body: Assignment, result: tuple = ("r",), **rest) -> Program:
    nodes = tuple(Reference(name) if isinstance(name, str) else name for name in result)
    signal = Signal("result", (len(nodes),), tuple(f"result_{k}" for k in range(len(nodes))))
    return Program(
        KernelInfo("made-up", "Made up", "this test", arguments="made-up"),
        inputs=(Signal.scalar("x"), Signal.scalar("y")),
        body=body,
        outputs=(Result(signal, nodes),),
        **rest,
    )


def test_a_name_is_not_used_before_its_assignment():
    late = Assignment("s", SUM)
    with pytest.raises(ValueError, match=r"made_up: 'r' uses \['s'\] before assignment"):
        program(Assignment("r", Operation("negate", (Reference("s"),))), late)
    # The other way round it is right, so it is the order that was refused.
    program(late, Assignment("r", Operation("negate", (Reference("s"),))))


@pytest.mark.parametrize("turns", [-1, 0, 1])
@pytest.mark.parametrize("angle", [-3.0, -1.0, 0.0, 1.0, 3.0])
def test_an_angle_is_wrapped_by_whole_turns(angle, turns):
    beyond = angle + turns * math.tau
    if abs(beyond) <= 3 * math.pi:
        assert OPERATIONS["wrap"](beyond) == pytest.approx(angle, abs=1e-12)


def test_a_name_is_not_used_in_its_own_assignment():
    with pytest.raises(ValueError, match=r"'r' uses \['r'\]"):
        program(Assignment("r", Operation("negate", (Reference("r"),))))


@pytest.mark.parametrize("name", ["r", "x"])
def test_a_name_is_assigned_once(name):
    with pytest.raises(ValueError, match=f"'{name}' is assigned twice"):
        program(Assignment("r", SUM), Assignment(name, X))


def test_results_are_computed():
    with pytest.raises(ValueError, match=r"'result' is not computed: \['z'\]"):
        program(Assignment("r", SUM), result=("r", "z"))


def test_results_have_a_node_for_every_element():
    good = program(Assignment("r", SUM))
    with pytest.raises(ValueError, match="'result' is not computed"):
        replace(good, outputs=(Result(good.outputs[0].signal, ()),))


def test_the_transition_is_computed():
    with pytest.raises(ValueError, match="'turn' is not computed"):
        program(Assignment("r", SUM), transition=Result(Signal.scalar("turn"), (Reference("t"),)))


def test_run_is_exact_on_fractions():
    third = Constant(Fraction(1, 3))
    made = program(
        Assignment("s", SUM),
        Assignment("r", Operation("divide", (Operation("multiply", (third, Reference("s"))), Y))),
        result=("r", "x", Constant(Fraction(2, 5))),
    )
    x, y = Fraction(1, 7), Fraction(3, 11)
    assert made.run({"x": x, "y": y}) == {"result": [(x + y) / 3 / y, x, Fraction(2, 5)]}


def test_every_operation_is_counted_somehow():
    assert OPERATIONS.keys() == COUNTED_AS.keys()


def test_operations_are_counted_at_any_depth():
    inner = Operation("subtract", (Operation("multiply", (X, X)), Operation("sqrt", (Y,))))
    test = Operation("at_least", (inner, Y))
    choice = Operation("select", (test, Operation("sin", (X,)), Operation("negate", (Y,))))
    made = program(
        Assignment("s", choice),
        Assignment("t", Operation("maximum", (X, Operation("divide", (SUM, Y))))),
        Assignment("r", Operation("add", (Reference("s"), Reference("t")))),
    )
    assert made.operations == {
        "add": 3,
        "multiply": 1,
        "divide": 1,
        "sqrt": 1,
        "negate": 1,
        "select": 2,
        "function": 1,
    }
    assert made.temporaries == 2


def step() -> Program:
    """Return a program whose result is x t with the transition t = y + y, and an assignment nobody needs."""
    return program(
        Assignment("t", Operation("add", (Y, Y))),
        Assignment("unused", Operation("multiply", (X, X))),
        Assignment("r", Operation("multiply", (X, Reference("t")))),
        transition=Result(Signal.scalar("turn"), (Reference("t"),)),
    )


def test_used_follows_the_assignments_backwards():
    assert step().used() == {"x", "y", "t", "r"}
    assert step().used([step().transition]) == {"y", "t"}


def test_the_transition_is_a_program_of_its_own():
    part = step().transition_program()
    assert [signal.name for signal in part.inputs] == ["y"]
    assert [a.name for a in part.body] == ["t"]
    assert part.run({"y": Fraction(1, 3)}) == {"turn": [Fraction(2, 3)]}
    assert part.transition is None


def test_a_program_without_a_transition_has_no_transition_program():
    with pytest.raises(ValueError, match="made_up has no transition"):
        program(Assignment("r", SUM)).transition_program()


def test_split_cuts_where_the_first_input_comes_in():
    whole = program(
        Assignment("square", Operation("multiply", (Y, Y))),
        Assignment("s", SUM),
        Assignment("twice", Operation("add", (Reference("square"), Reference("square")))),
        Assignment("r", Operation("multiply", (Reference("s"), Reference("twice")))),
        result=("r", "square", Constant(Fraction(3))),
    )
    ahead, behind = whole.split()
    assert [a.name for a in ahead.body] == ["square", "twice"]
    assert [a.name for a in behind.body] == ["s", "r"]
    (prepared,) = (result.signal for result in ahead.outputs)
    assert prepared.elements == ("y", "square", "twice")
    assert [signal.name for signal in behind.inputs] == ["x", "prepared"]
    values = ahead.run({"y": Fraction(2, 3)})["prepared"]
    together = behind.run({"x": Fraction(1, 7)} | dict(zip(prepared.elements, values, strict=True)))
    assert together == whole.run({"x": Fraction(1, 7), "y": Fraction(2, 3)})
    assert ahead.operations["multiply"] + behind.operations["multiply"] == whole.operations["multiply"]


class Counted:
    """Counts how often its value is worked out."""

    times = 0

    @once
    def value(self) -> int:
        """The number of the time at which it was worked out."""
        self.times += 1
        return self.times


def test_value_is_computed_once_for_each_object():
    first, second = Counted(), Counted()
    assert [first.value, first.value, second.value] == [1, 1, 1]
    assert first.times == second.times == 1


def test_the_class_has_the_property_with_its_docstring():
    assert isinstance(Counted.value, once)
    assert Counted.value.__doc__ == "The number of the time at which it was worked out."
