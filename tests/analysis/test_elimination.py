"""Systems of polynomial equations: families hold every solution and nothing else, or there is a reason for none."""

from __future__ import annotations

import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from strapgen.analysis.unknowns import elimination
from strapgen.analysis.unknowns.elimination import Equation, solve
from strapgen.ir.exceptions import InputError

X, Y, Z = sp.symbols("x y z", real=True)


def system(*values: sp.Expr) -> list[Equation]:
    return [Equation(f"equation {k}", k, value) for k, value in enumerate(values, 1)]


def test_every_family_satisfies_the_equations():
    equations = system(X * Y - Z, X**2 - X * Z)
    solution = solve(equations, [X, Y, Z])
    assert len(solution.families) == 2  # x = 0, z = 0; and x = z, y = 1
    assert all(family.holds(each.value) for family in solution.families for each in equations)
    assert {family.dimension for family in solution.families} == {1}


@given(st.lists(st.integers(-3, 3), min_size=8, max_size=8))
def test_linear_systems_are_those_of_linear_algebra(numbers):
    rows = [numbers[:4], numbers[4:]]
    equations = system(*(a * X + b * Y + c * Z - d for a, b, c, d in rows))
    solution = solve(equations, [X, Y, Z])
    expected = sp.linsolve([each.value for each in equations], X, Y, Z)
    if expected is sp.S.EmptySet:
        assert solution.families == () and "has to be 0" in solution.reason
    else:
        (family,) = solution.families
        matrix = sp.Matrix([row[:3] for row in rows])
        assert family.dimension == 3 - matrix.rank()
        assert all(family.holds(each.value) for each in equations)


def test_points_of_curves_are_found_with_their_roots():
    families = solve(system(X**2 + Y**2 - 1, X - Y), [X, Y]).families
    assert {family.values[X] for family in families} == {sp.sqrt(2) / 2, -sp.sqrt(2) / 2}
    assert all(family.values[X] == family.values[Y] and not family.free for family in families)


def test_groebner_basis_solves_systems_that_elimination_cannot():
    # No unknown is linear, and nothing is a product; the curves meet in one real point twice.
    families = solve(system(X**2 + Y**2 - 5, X**2 * Y**2 + X**2 - 8), [X, Y]).families
    points = {(f.values.get(X), f.values.get(Y)) for f in families}
    assert (2, 1) in points and (-2, 1) in points


def test_a_curve_that_cannot_be_solved_stays_an_equation():
    (family,) = solve(system(X**3 + Y**3 - 2 * X * Y - 1), [X, Y]).families
    assert family.dimension == 1
    assert len(family.equations) == 1


@pytest.mark.parametrize(
    ("values", "reason", "solvable"),
    [
        ((X + Y, X + Y - 1), "equation 2 is -1 with the values that the others leave, and has to be 0", 1),
        ((X, sp.Rational(1, 24)), "equation 2 is 1/24, whatever the unknowns are, and has to be 0", 1),
        ((X**2 + 1,), "equation 1 leaves x**2 + 1 = 0, which no real number solves", None),
        ((X * Y - 1, X), "equation 2", 1),
    ],
)
def test_there_is_a_reason_for_no_solution(values, reason, solvable):
    solution = solve(system(*values), [X, Y])
    assert solution.families == ()
    assert solution.reason.startswith(reason)
    assert solution.solvable == solvable


def test_conditions_beyond_the_limits_are_refused():
    many = sp.symbols(f"x:{elimination.MOST_UNKNOWNS + 1}", real=True)
    with pytest.raises(InputError, match="at most 40 are allowed"):
        solve(system(many[0]), many)
    powers = [sum((k + j) ** 2 * x**7 + x**5 for j, x in enumerate(many[:6])) + k for k in range(4)]
    with pytest.raises(InputError, match="a Groebner basis is computed of at most 12 in 5"):
        solve([Equation("power", 1, value) for value in powers], many[:6])


def test_the_same_way_is_taken_every_time_and_nothing_of_sympy_is_changed():
    equations = system(X**2 * Y**2 - Z**2, X**3 - Y**3)
    from sympy.core.random import rng

    before = rng.getstate()
    first = solve(equations, [X, Y, Z])
    assert rng.getstate() == before
    assert solve(equations, [X, Y, Z]) == first
