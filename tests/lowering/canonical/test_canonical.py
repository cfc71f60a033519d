"""Canonical forms of the catalogue's steps: exact, short, readable and found quickly."""

from itertools import combinations, combinations_with_replacement
from types import SimpleNamespace

import pytest
import sympy as sp
from derived import kernel, program

from strapgen.catalogue import STANDARD_METHODS, Choice
from strapgen.ir.program import Program
from strapgen.lowering import candidates, canonical
from strapgen.lowering.canonical import plan
from strapgen.lowering.canonical.core import decompose
from strapgen.lowering.passes import optimize
from strapgen.lowering.trees import is_temporary, operation_count

#: Cayley-Klein parameters have the programs of Euler parameters by other names, which tests/lowering proves.
STEPS = [Choice(a, m, n) for a in ("dcm", "euler") for m in STANDARD_METHODS for n in (1, 2, 3, 4, 5, None)]


def is_quick(choice: Choice) -> bool:
    return choice.increments == 2 or (choice.method, choice.increments) == ("rk4", None)


#: Two increments, and steps of fourth order that take rates; all others with the long tests.
EVERY = pytest.mark.parametrize(
    "choice",
    [pytest.param(c, marks=() if is_quick(c) else pytest.mark.long, id=c.kernel) for c in STEPS],
)


def is_the_kernel(made: Program, choice: Choice) -> bool:
    """Tell whether a program's next state is the kernel's, as polynomials of state and increments."""
    names = [name for signal in made.inputs for name in signal.elements]
    ring, *generators = sp.ring(names, sp.QQ)
    results = made.run(dict(zip(names, generators, strict=True)))
    elements = {name: [ring(element) for element in found] for name, found in results.items()}
    return elements == kernel(choice).polynomials()


@EVERY
def test_the_transition_is_that_of_the_stages(choice):
    core, made = canonical.extract_core(kernel(choice)), program(choice)
    canonical.verify(core, made)
    # Another way to the same: through all stages, in the elements of the inputs themselves.
    assert is_the_kernel(made, choice)
    assert not any(made.operations[kind] for kind in ("divide", "sqrt", "select", "function"))
    # Where scalars and vectors have names nothing is left to be found that has none.
    temporaries = [a.name for a in made.body if a.name.startswith(("shared_", "factor_"))]
    assert choice.name == "dcm" or not temporaries


@pytest.mark.parametrize(
    "choice",
    [
        Choice("euler", "rk4", 2),
        pytest.param(Choice("euler", "rk3", 3), marks=pytest.mark.long),
        pytest.param(Choice("dcm", "rk3", 3), marks=pytest.mark.long),
        Choice("dcm", "rk4", 2),
    ],
    ids=lambda choice: choice.kernel,
)
def test_every_candidate_is_exact_not_only_the_one_that_is_taken(choice):
    core = canonical.extract_core(kernel(choice))
    made = list(candidates(kernel(choice), core))
    assert len(made) == 1 + len(canonical.forms(core)) > 3
    for candidate in made:
        canonical.verify(core, candidate)
        assert is_the_kernel(candidate, choice)


def test_plans_that_are_not_written_are_exact_too_and_nearly_as_long_as_estimated(monkeypatch):
    """In a step on three increments some vectors are multiples of those that have a name."""
    choice = Choice("euler", "rk2", 3)
    core = canonical.extract_core(kernel(choice))
    plans = plan.plans(core, decompose(core))
    monkeypatch.setattr(canonical, "_WRITTEN", len(plans))
    _, *written = candidates(kernel(choice), core)
    for one, form, candidate in zip(plans, canonical.forms(core), written, strict=True):
        canonical.verify(core, candidate)
        count = sum(operation_count(assignment.value) for assignment in form)
        # An estimate knows neither the scalar products that a polynomial shares nor the signs that a sum absorbs.
        assert abs(plan._estimate(one) - count) <= 2


@pytest.mark.parametrize(
    ("choice", "multiplications", "additions"),
    [
        # The product with the state takes 16 and 12 of them, or 27 and 18.
        (Choice("euler", "rk4", 1), 25, 17),
        (Choice("euler", "rk4", 2), 38, 30),
        (Choice("cayley-klein", "rk4", 2), 38, 30),
        pytest.param(Choice("euler", "rk4", 3), 58, 49, marks=pytest.mark.long),
        (Choice("dcm", "rk4", 1), 45, 32),
        (Choice("dcm", "rk4", 2), 75, 66),
        pytest.param(Choice("dcm", "rk4", 3), 96, 88, marks=pytest.mark.long),
    ],
    ids=lambda value: value.kernel if isinstance(value, Choice) else str(value),
)
def test_operations_of_the_fourth_order_step(choice, multiplications, additions):
    operations = program(choice).operations
    assert operations["multiply"] <= multiplications
    assert operations["add"] <= additions


def test_the_canonical_form_is_shorter_than_the_stages():
    for choice, share in ((Choice("euler", "rk4", 2), 0.5), (Choice("dcm", "rk4", 2), 0.7)):
        staged = optimize(next(candidates(kernel(choice), canonical.extract_core(kernel(choice)))))
        assert sum(program(choice).operations.values()) < share * sum(staged.operations.values())


def test_names_and_meanings_are_those_of_the_field():
    made = program(Choice("euler", "rk4", 2))
    names = {a.name for a in made.body}
    assert {"sigma_x", "sigma_dot_sigma", "p_x", "p_s"} <= names
    meanings = {a.name: a.meaning for a in made.body if a.meaning}
    assert meanings["sigma_x"] == "the angle increment of the whole step"
    # It is said once for a vector, where it begins.
    assert not {"sigma_y", "sigma_z", "p_y"} & meanings.keys()


def test_a_transition_depends_on_nothing_but_the_increments():
    for choice in (Choice("euler", "rk4", 2), Choice("dcm", "rk4", 2)):
        made = program(choice).transition_program()
        assert [signal.name for signal in made.inputs] == ["increments"]
        assert made.operations["multiply"] == program(choice).operations["multiply"] - (
            27 if choice.name == "dcm" else 16
        )


@EVERY
def test_values_are_named_after_what_they_are(choice):
    # Only partial sums and factors that a pass shares have no meaning: few in a matrix, none in a quaternion.
    temporaries = [a.name for a in program(choice).body if is_temporary(a.name)]
    assert len(temporaries) <= (3 if choice.name == "dcm" else 0)


@pytest.mark.parametrize("vectors", [1, 2, 3])
@pytest.mark.parametrize("degree", [0, 1, 2, 3, 4, 5])
def test_the_stated_terms_are_all_products_up_to_the_degree(degree, vectors, monkeypatch):
    """They are monomials in the scalar products, alone and with each vector and each cross product."""
    monkeypatch.setattr(canonical, "_MOST_TERMS", {"few": 0, "many": 0})
    scalar_products = list(combinations_with_replacement(range(vectors), 2))
    beside = [0, *[1] * vectors, *(2 for _ in combinations(range(vectors), 2))]
    terms = sum(
        1
        for size in beside
        for count in range(degree // 2 + 1)
        for _ in combinations_with_replacement(scalar_products, count)
        if size + 2 * count <= degree
    )
    transition = SimpleNamespace(base=lambda: range(vectors), degree=lambda: degree)
    assert f"degree {degree} in {vectors} vectors, up to {terms} terms" in canonical.expansion(transition)
