"""How far a computed value can move with the inputs, and what error feedback adds to the bound of one call."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from derived import program, quantized

from strapgen import generate
from strapgen.backends.fixed import ModelEvaluator
from strapgen.catalogue import Choice
from strapgen.fixedpoint.derivation import quantities
from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.runs.accumulation import _moves
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.program import Assignment, Constant, Operation, Program, Reference, Result
from strapgen.ir.signals import Signal


def test_a_sum_of_products_moves_by_no_more_than_is_told():
    # 3 a b + a, a up to 1 and moved by 1/8, b up to 1/4 and moved by 1/2
    a, b = (
        Signal(name, (1,), (name,), bound=bound)
        for name, bound in (("a", Fraction(1)), ("b", Fraction(1, 4)))
    )
    multiple = Operation(
        "multiply", (Constant(Fraction(3)), Operation("multiply", (Reference("a"), Reference("b"))))
    )
    body = (Assignment("y", Operation("add", (multiple, Reference("a")))),)
    result = Result(Signal("out", (1,), ("out_1",)), (Reference("y"),))
    made = Program("made", "made", "Made by hand", "", "made", (), (a, b), body, (result,))
    box = {"a": Interval.symmetric(1), "b": Interval.symmetric(Fraction(1, 4))}
    by = {"a": Fraction(1, 8), "b": Fraction(1, 2)}

    def value(x: Fraction, y: Fraction) -> Fraction:
        return 3 * x * y + x

    corners = product(*(((s, t) for s in (-1, 1) for t in (-1, 1)) for _ in range(2)))
    farthest = max(
        abs(value(p + s * by["a"], q / 4 + t * by["b"]) - value(Fraction(p), Fraction(q, 4)))
        for (p, s), (q, t) in (
            (tuple(map(Fraction, one)), tuple(map(Fraction, other))) for one, other in corners
        )
    )
    assert farthest == _moves(quantities(made, box), by)["y"]


@pytest.mark.parametrize("rounding", ["nearest", "truncation"])
def test_a_call_is_inside_its_bound_whatever_the_call_before_left(rounding):
    choice = Choice("navigation-rotation")
    fixed = quantized(choice, Settings(16, rounding=rounding, carry="state"))
    interface, rng = fixed.interface, np.random.default_rng(1)
    model = ModelEvaluator(generate(fixed, "fixed-model"))
    bounds = [error for argument in interface.outputs for error in argument.errors]
    worst = Fraction(0)
    for _ in range(40):
        integers = [rng.integers(a.low, a.high + 1, a.signal.size).tolist() for a in interface.inputs]
        left = [int(rng.choice([0, 2**16 - 1])) for _ in interface.residuals]
        *computed, _ = model.step(*integers, left)
        values = {
            name: integer * argument.format.unit
            for argument, row in zip(interface.inputs, integers, strict=True)
            for name, integer in zip(argument.signal.elements, row, strict=True)
        }
        exact = [x for row in program(choice).run(values).values() for x in row]
        rounded = [
            x * argument.format.unit
            for argument, row in zip(interface.outputs, computed, strict=True)
            for x in row
        ]
        errors = [abs(a - b) for a, b in zip(exact, rounded, strict=True)]
        assert all(error <= bound for error, bound in zip(errors, bounds, strict=True))
        worst = max(worst, *errors)
    # Half a unit or a whole one is left before, and as much after: without the first the bound would not hold.
    assert worst > Fraction(3, 4) * interface.outputs[0].format.unit
