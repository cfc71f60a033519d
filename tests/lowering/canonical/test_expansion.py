"""Which transitions are expanded: the number of terms is bounded beforehand, and long ones keep their stages."""

from __future__ import annotations

import re
from random import Random

import pytest
import sympy as sp
from derived import kernel, program

from strapgen.catalogue import Choice
from strapgen.kernel.kernel import evaluate_stages
from strapgen.lowering import canonical
from strapgen.lowering.canonical.core import decompose

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


@pytest.mark.long
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


@pytest.mark.long
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
