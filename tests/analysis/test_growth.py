"""Growth of length and determinant, and where a step contracts."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from strapgen.analysis.growth import StabilityResult, contraction, growth, stability
from strapgen.analysis.series.constant_rate import constant_rate
from strapgen.analysis.series.motion_rates import TIME, model, parameters
from strapgen.catalogue import ALGORITHMS, choose, choose_step
from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motions import motion
from strapgen.run.backends import backend

SQUARE = sum(w**2 for w in sp.symbols("w_x w_y w_z"))


@pytest.mark.long
@pytest.mark.parametrize(
    ("algorithm", "part", "wanted"),
    [
        ("dcm", "determinant", -(SQUARE**3) / 72),
        ("euler", "length", -(SQUARE**3) / 9216),
        ("cayley-klein", "length", -(SQUARE**3) / 9216),
        ("euler", "determinant", -(SQUARE**3) / 1536),
    ],
)
def test_fourth_order_shrinks(algorithm, part, wanted):
    found = getattr(growth(choose(algorithm, "rk4", 2), "constant", 1), part)
    assert list(found) == [6]
    assert sp.expand(found[6] - wanted) == 0


def test_the_determinant_is_the_sixth_power_of_the_length():
    found = growth(choose("euler", "rk2", 2), "general", 1)
    (power,) = found.length
    assert sp.expand(found.determinant[power] - 6 * found.length[power]) == 0
    assert found.as_dict()["invariant"]["length"]["4"] == "1/32 |w1|^2 + 1/128 |w0|^4"


@pytest.mark.long
@pytest.mark.parametrize("name", ["coning", "sinusoidal", "polynomial"])
def test_growth_on_a_motion_is_that_of_the_general_rate(name):
    """The invariants, with the derivatives of the motion's rate put in."""
    general = growth(choose("dcm", "rk2", 2), "general", 1)
    special = growth(choose("dcm", "rk2", 2), name, 1)
    rate = model(name).rate(TIME, *parameters(name))
    values = {}
    for j in range(3):
        values |= {sp.Symbol(f"w{j}_{axis}"): x for axis, x in zip("xyz", rate, strict=True)}
        rate = rate.diff(TIME)
    (power,) = special.determinant
    assert sp.simplify(general.determinant[power].subs(values) - special.determinant[power]) == 0


@pytest.mark.long
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_contraction(algorithm):
    """The imaginary axis in the stability regions of the textbooks: 3^(1/2) and 8^(1/2), twice that for parameters."""
    factor = 1 if algorithm == "dcm" else 2

    def found(method):
        return contraction(constant_rate(choose(algorithm, method, 2)))

    assert found("rk1") == found("rk2") == []
    assert found("rk3") == [(0.0, pytest.approx(factor * math.sqrt(3)))]
    assert found("rk4") == [(0.0, pytest.approx(factor * math.sqrt(8)))]
    assert found("magnus4") is None
    ((low, high),) = found("taylor5")
    assert low > 0
    assert high > low


@pytest.mark.long
@settings(max_examples=10, deadline=None)
@given(st.floats(0.05, 6.0))
def test_runs_grow_as_the_stretch_says(angle):
    """Ten steps at a constant rate on the numpy back end: the length of the state is the tenth power."""
    for method in ("rk3", "rk4"):
        made = backend("euler", method, 2, "numpy")
        increments = motion("constant", y_rad_s=angle).increments(1, 10, 2)
        state = made.propagate(increments)[-1]
        stretch = stability(choose("euler", method, 2)).stretch(np.array([angle]))[0]
        assert np.linalg.norm(state) == pytest.approx(stretch**10, rel=1e-12)


def test_report():
    text = StabilityResult(
        [stability(choose("dcm", method, 2)) for method in ("rk1", "rk4", "magnus4")]
    ).text()
    assert "nowhere" in text
    assert "0 to 2.828" in text
    assert "kept" in text


def test_a_step_that_is_not_linear_has_no_stretch(own_algorithm):
    with pytest.raises(InputError, match="not linear in its state"):
        stability(choose_step(str(own_algorithm("mrp"))))
