"""Programs run operation by operation in one floating-point type: the reference for the bits of the C."""

from __future__ import annotations

import pickle
from fractions import Fraction

import numpy as np
import pytest

from strapgen.firmware.vectors import ProgramEvaluator
from strapgen.ir.kernel_info import KernelInfo
from strapgen.ir.program import Assignment, Constant, Operation, Program, Reference, Result
from strapgen.ir.signals import Signal
from strapgen.run.kernel_sources import sources_of_program


def evaluator(target: str, node: Operation) -> ProgramEvaluator:
    """Return a program of one scalar input x and one operation."""
    program = Program(
        KernelInfo("one", "one", "this test"),
        (Signal.scalar("x"),),
        (Assignment("y", node),),
        (Result(Signal("out", (1,), ("y",)), (Reference("y"),)),),
    )
    return ProgramEvaluator(sources_of_program(program, "exact"), target)


@pytest.mark.parametrize(("target", "kind"), [("c", np.float64), ("c-float", np.float32)])
def test_every_operation_is_rounded_in_the_type_of_the_target(target, kind):
    third = evaluator(target, Operation("multiply", (Reference("x"), Constant(Fraction(1, 3)))))
    x = kind(1.1)
    nearest = min(
        (kind(1 / 3), np.nextafter(kind(1 / 3), kind(0)), np.nextafter(kind(1 / 3), kind(1))),
        key=lambda value: abs(Fraction(float(value)) - Fraction(1, 3)),
    )
    result = third(x)
    assert result.dtype == kind and result[0] == x * nearest


def test_functions_have_their_values_where_formulas_break():
    ratio = evaluator("c", Operation("sinc", (Reference("x"),)))
    assert ratio(np.array([0.0, 0.5])).ravel().tolist() == [1.0, np.sin(0.5) / 0.5]
    angle = evaluator("c", Operation("wrap", (Reference("x"),)))
    assert angle(np.array([4.0, -4.0, 3.0])).ravel() == pytest.approx([4 - 2 * np.pi, 2 * np.pi - 4, 3.0])


def test_a_copy_in_another_process_is_the_same():
    half = evaluator("c-float", Operation("multiply", (Reference("x"), Constant(Fraction(1, 2)))))
    copy = pickle.loads(pickle.dumps(half))
    assert (copy.dtype, copy(np.float32(3))) == (half.dtype, half(np.float32(3)))
