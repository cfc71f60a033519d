"""What the tests of fixed point share: inputs over the whole range, and what exact arithmetic makes of them."""

from __future__ import annotations

import math
from fractions import Fraction

import mpmath
import numpy as np

from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.program import OPERATIONS, RESOLUTION, Constant, Program, Reference
from strapgen.run.evaluators import Evaluator
from strapgen.run.exact import FUNCTIONS


def corners_and_random(evaluator: Evaluator, count: int, rng: np.random.Generator) -> list[np.ndarray]:
    """Return integers for every input: corners of the range, edges, the neighbourhood of zero, and any others."""
    inputs = []
    for argument in evaluator.interface.inputs:
        shape = (count, argument.signal.size)
        made = rng.integers(argument.low, argument.high, size=shape, endpoint=True)
        part = count // 5
        made[:part] = rng.choice([argument.low, argument.high], size=(part, argument.signal.size))
        made[part : 2 * part] = rng.choice(
            [argument.low, argument.low + 1, -1, 0, 1, argument.high - 1, argument.high],
            size=(part, argument.signal.size),
        )
        if argument.signal.constraint == "unit":  # attitudes, to the place
            part = count // 2
            vectors = rng.normal(size=(count - part, argument.signal.size))
            vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
            words = np.rint(vectors / float(argument.format.unit))
            made[part:] = np.minimum(words, argument.high)  # 1 itself, where a state ends below it
        elif argument.signal.constraint == "rotation":
            part = count // 2
            matrices = np.linalg.qr(rng.normal(size=(count - part, 3, 3)))[0]
            matrices *= np.sign(np.linalg.det(matrices))[:, None, None]
            words = np.rint(matrices.reshape(-1, 9) / float(argument.format.unit))
            made[part:] = np.minimum(words, argument.high)
        inputs.append(made.astype(evaluator.number))
    return inputs


def number(value: Fraction) -> mpmath.mpf:
    return mpmath.mpf(value.numerator) / value.denominator


def fraction(value: mpmath.mpf) -> Fraction:
    sign, digits, exponent, _ = mpmath.mpf(value)._mpf_
    return (-1) ** sign * int(digits) * Fraction(2) ** exponent


def exactly(fixed: FixedProgram, inputs: list[list[int]]) -> dict[str, Fraction]:
    """Return every value of the program that was lowered, in exact arithmetic on the integers of one sample.

    Roots are rounded at 200 binary places, functions to 300 binary digits.
    """
    known = {RESOLUTION: Fraction(1, 1 << (fixed.word - 2))}
    for argument, integers in zip(fixed.interface.inputs, inputs, strict=True):
        for name, integer in zip(argument.signal.elements, integers, strict=True):
            known[name] = int(integer) * argument.format.unit

    def value(node):
        if isinstance(node, Constant):
            return node.value
        if isinstance(node, Reference):
            return known[node.name]
        arguments = [value(argument) for argument in node.arguments]
        if node.kind == "sqrt":
            return Fraction(math.isqrt(int(arguments[0] * 4**200)), 2**200)
        if node.kind in FUNCTIONS:
            with mpmath.workprec(300):
                return fraction(FUNCTIONS[node.kind](*map(number, arguments)))
        return OPERATIONS[node.kind](*arguments)

    for assignment in fixed.program.body:
        known[assignment.name] = value(assignment.value)
    for argument, result in zip(fixed.interface.outputs, fixed.program.outputs, strict=True):
        known |= zip(argument.values, map(value, result.nodes), strict=True)
    return known


def in_double(program: Program, inputs: dict[str, np.ndarray]) -> dict[str, list[np.ndarray]]:
    """Return the outputs of a program of sums and products on arrays of doubles."""
    return program.run(inputs, float)
