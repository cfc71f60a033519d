"""The vector form of a step is its transition, exactly, in few vectors."""

from __future__ import annotations

import itertools
from fractions import Fraction
from typing import Any

import pytest
from derived import kernel

from strapgen.catalogue import Choice
from strapgen.kernel.algebra import cross_elements, dot
from strapgen.kernel.kernel import evaluate_stages
from strapgen.kernel.polynomials import Polynomial
from strapgen.lowering.canonical import extract_core
from strapgen.lowering.canonical.vector_form import Sum, VectorForm, vector_form

Vectors = dict[str, list[Fraction]]

STEPS = [
    Choice("euler", "rk4", 2),
    Choice("dcm", "rk4", 2),
    Choice("euler", "rk4", 1),
    Choice("dcm", "rk1", 1),
    *(
        pytest.param(Choice(*words), marks=pytest.mark.long)
        for words in itertools.product(("dcm", "euler"), ("rk1", "rk2", "rk3", "rk4"), (1, 2, 3, None))
    ),
    # The same form; its elements have an order of their own.
    Choice("cayley-klein", "rk4", 2),
]


def value(polynomial: Polynomial, vectors: Vectors) -> Fraction:
    total = Fraction(0)
    for monomial, number in polynomial.items():
        term = number
        for first, second, *third in monomial:
            other = cross_elements(vectors[second], vectors[third[0]]) if third else vectors[second]
            term *= dot(vectors[first], other)
        total += term
    return total


def total(terms: Sum, vectors: Vectors) -> list[Fraction]:
    added = [Fraction(0)] * 3
    for (name, *other), weight in terms.items():
        vector = cross_elements(vectors[name], vectors[other[0]]) if other else vectors[name]
        added = [a + value(weight, vectors) * x for a, x in zip(added, vector, strict=True)]
    return added


def transition(form: VectorForm, inputs: Vectors) -> list[Fraction]:
    """Return the elements of a transition from its form alone: x, y, z, s, or row by row."""
    vectors = dict(inputs)
    for name, coefficients in form.vectors.items():
        pairs = list(zip(coefficients, form.inputs, strict=True))
        vectors[name] = [sum((c * inputs[i][axis] for c, i in pairs), Fraction(0)) for axis in range(3)]
    x, y, z = total(form.vector, vectors)
    diagonal = value(form.scalar, vectors)
    if not form.matrix:
        return [x, y, z, diagonal]
    matrix = [[diagonal, -z, y], [z, diagonal, -x], [-y, x, diagonal]]
    for name, terms in form.outers.items():
        partner = total(terms, vectors)
        for i, j in itertools.product(range(3), repeat=2):
            matrix[i][j] += vectors[name][i] * partner[j] + partner[i] * vectors[name][j]
    return [element for row in matrix for element in row]


@pytest.mark.parametrize("choice", STEPS, ids=lambda choice: choice.kernel)
def test_the_form_is_the_transition_on_fractions(choice):
    core = extract_core(kernel(choice))
    form = vector_form(kernel(choice))
    if form is None:
        assert choice.increments is None or choice.increments > 2
        return
    numbers = (Fraction(7 * k * k % 11 - 5, 3 + k % 4) for k in itertools.count(1))
    inputs = {name: [next(numbers) for _ in range(3)] for name in core.inputs}
    elements: dict[str, Any] = {}
    for signal, coefficients in core.vectors.values():
        for axis, element in enumerate(signal.elements):
            pairs = zip(coefficients, core.inputs, strict=True)
            elements[element] = sum((c * inputs[i][axis] for c, i in pairs), Fraction(0))
    known = evaluate_stages(core.stages, elements)
    shown = transition(form, inputs)
    if not form.matrix:
        by_label = dict(zip("xyzs", shown, strict=True))
        shown = [by_label[element[-1]] for element in core.transition.elements]
    assert [known[element] - x for element, x in zip(core.transition.elements, shown, strict=True)] == [
        0
    ] * len(shown)


def test_a_step_that_is_no_polynomial_has_no_form():
    assert vector_form(kernel(Choice("euler", "magnus4", 2))) is None
    assert vector_form(kernel(Choice("dcm-from-euler"))) is None
