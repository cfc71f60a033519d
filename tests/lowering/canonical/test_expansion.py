"""Which transitions are expanded: the number of terms is bounded beforehand, and long ones keep their stages."""

from __future__ import annotations

import re
from fractions import Fraction
from random import Random

import pytest
import sympy as sp
from derived import kernel, program

from strapgen import catalogue
from strapgen.catalogue import Choice
from strapgen.kernel.kernel import evaluate_stages
from strapgen.lowering import canonical
from strapgen.lowering.canonical.core import decompose

#: Exact series of many methods: with the long tests.
pytestmark = pytest.mark.long

#: Cayley-Klein parameters are Euler parameters by other names.
ALGORITHM = pytest.mark.parametrize("algorithm", ["dcm", "euler"])
EXPANDED = [
    *(("rk1", 8, 0), ("rk2", 2, 0), ("rk2", 3, 1), ("rk3", 3, 0), ("rk4", 1, 0), ("rk4", 2, 0)),
    *(("rk4", 1, 2), ("taylor4", 2, 0), ("butcher6", 1, 0), ("taylor6", 2, 0), ("taylor20", 1, 0)),
]
STAGED = [("butcher6", 3, 0), ("butcher6", 2, 1), ("butcher5", 4, 0), ("dormand-prince5", 3, 0)]


def core(algorithm: str, method: str, count: int, previous: int) -> canonical.Core:
    found = canonical.extract_core(kernel(Choice(algorithm, method, count, previous)))
    assert found is not None
    return found


@pytest.mark.parametrize("chosen", EXPANDED)
@ALGORITHM
def test_the_estimate_bounds_the_terms_of_the_decomposition(algorithm, chosen, monkeypatch):
    found = core(algorithm, *chosen)
    assert canonical.expansion(found) == ""
    # With no room at all the message says the estimate.
    monkeypatch.setattr(canonical, "_MOST_TERMS", {"few": 0, "many": 0})
    estimate = int(re.search(r"up to (\d+) terms", canonical.expansion(found))[1])
    terms = sum(len(polynomial) for polynomial in decompose(found).coefficients())
    # Symmetric matrices have products of vectors beside the crosses: at most as many again.
    assert terms <= estimate * (2 if algorithm == "dcm" else 1)


@pytest.mark.parametrize("chosen", STAGED)
@ALGORITHM
def test_long_transitions_are_computed_by_their_stages_and_say_so(algorithm, chosen):
    found = core(algorithm, *chosen)
    reason = canonical.expansion(found)
    assert re.fullmatch(
        r"The transition is a polynomial of degree \d+ in \d vectors, up to \d+ terms if it is expanded; "
        "it is computed by its stages, which are as exact and shorter.",
        reason,
    )
    assert f"degree {found.degree()} in {len(found.base())} vectors" in reason
    choice = Choice(algorithm, *chosen)
    assert reason in program(choice).notes and reason not in kernel(choice).notes


@pytest.mark.long
@pytest.mark.parametrize("chosen", [*STAGED, ("fehlberg5", 4, 0), *EXPANDED])
@ALGORITHM
def test_a_program_is_its_kernel_exactly(algorithm, chosen):
    choice, random = Choice(algorithm, *chosen), Random(1969)
    made, exact = program(choice), kernel(choice)
    names = [name for signal in exact.inputs for name in signal.elements]
    for _ in range(3):
        # Two polynomials that differ agree at three random points of this size next to never.
        values = {name: Fraction(random.randint(-99, 99), random.randint(1, 99)) for name in names}
        expected = exact.expand({n: sp.QQ(v.numerator, v.denominator) for n, v in values.items()}, _rational)
        found = made.run(values)
        assert [sp.QQ(x.numerator, x.denominator) for x in found["next"]] == expected["next"]


def _rational(number: sp.Rational) -> object:
    return sp.QQ(int(number.p), int(number.q))


@pytest.mark.parametrize("chosen", [*EXPANDED, ("rk3", 8, 0), ("dormand-prince5", 3, 0)])
@ALGORITHM
def test_the_degree_is_that_of_the_transition(algorithm, chosen):
    # Every input a multiple of one unknown: the degree of the polynomial is seen, unless terms cancel.
    found, random = core(algorithm, *chosen), Random(1969)
    exact = kernel(Choice(algorithm, *chosen))
    ring, x = sp.ring("x", sp.QQ)
    values = {name: x * random.randint(1, 99) for name in exact.inputs[1].elements}
    stages = [stage for stage in exact.stages if stage.signal.name != exact.transition]
    last = next(stage for stage in exact.stages if stage.signal.name == exact.transition)
    known = evaluate_stages([*stages, last], values)
    degree = max(ring(known[name]).degree() for name in last.signal.elements)
    assert degree == found.degree()


def test_other_than_polynomials_have_no_core():
    for method in ("magnus2", "magnus4", "munthe-kaas4"):
        assert canonical.extract_core(kernel(Choice("euler", method, 2))) is None
    assert canonical.extract_core(kernel(Choice("euler-normalize"))) is None


@pytest.mark.parametrize(("count", "previous"), [(1, 0), (2, 0), (1, 2), (2, 1), (3, 3)])
def test_the_whole_is_the_sum_of_the_increments_of_the_step_alone(count, previous):
    found = core("euler", "rk2", count, previous)
    assert found.inputs == [f"past{k}" for k in range(previous, 0, -1)] + [
        f"d{k}" for k in range(1, count + 1)
    ]
    assert found.whole == tuple(Fraction(int(k >= previous)) for k in range(previous + count))


def test_a_step_from_rates_has_no_whole():
    made = catalogue.derive(catalogue.choose("euler", "rk4", rates=True))
    assert canonical.extract_core(made).whole is None
