"""Taylor series of the transition: the exact rotation up to the order and no further."""

from __future__ import annotations

from fractions import Fraction

import pytest
import sympy as sp
from peano_baker import evaluated, generic_rate, increments, true_rotation

from strapgen import derive
from strapgen.catalogue import ALGORITHMS, INTEGRATORS
from strapgen.ir.exceptions import InputError

#: Exact series of many methods: with the long tests.
pytestmark = pytest.mark.long

ALGORITHM = pytest.mark.parametrize("algorithm", ALGORITHMS)


@pytest.mark.parametrize("order", [1, 4, 7])
@ALGORITHM
def test_the_series_is_the_exact_one_cut_off(algorithm, order):
    # For a rate that the increments fit exactly, power by power: equal up to the order, and nothing beyond it
    # but what is left of the step's products of the rate's own powers.
    kernel = derive(algorithm, f"taylor{order}", 2)
    rate = generic_rate(1)
    names = kernel.inputs[1].elements
    found = evaluated(kernel, dict(zip(names, increments(rate, 2, 0, order), strict=True)), kernel.transition)
    for mine, true in zip(found, true_rotation(algorithm, rate, order), strict=True):
        assert mine.coefficients == true.coefficients


@pytest.mark.parametrize("name", [name for name in INTEGRATORS if name.startswith("taylor")])
def test_every_order_of_the_list_is_its_series(name):
    # At a constant rate about one axis: the exponential, cut off.
    order = int(name.removeprefix("taylor"))
    kernel = derive("euler", name, 1)
    ring, x = sp.ring("x", sp.QQ)
    state, samples = kernel.inputs
    values = dict(zip(state.elements, map(ring, kernel.attitude_step.identity), strict=True))
    values |= dict(zip(samples.elements, (x, ring(0), ring(0)), strict=True))
    result = [ring(element) for element in kernel.expand(values)["next"]]
    assert result[1] == result[2] == 0
    powers = [Fraction(1, 2**n) / sp.factorial(n) for n in range(order + 1)]
    signs = [(-1) ** (n // 2) for n in range(order + 1)]
    assert result[3] == sum(
        s * p * x**n for n, (s, p) in enumerate(zip(signs, powers, strict=True)) if n % 2 == 0
    )
    assert result[0] == sum(s * p * x**n for n, (s, p) in enumerate(zip(signs, powers, strict=True)) if n % 2)


def test_stages_are_the_terms_of_the_series():
    kernel = derive("euler", "taylor3", 2)
    assert [stage.signal.name for stage in kernel.stages] == [
        *("half_rate_0", "half_rate_1"),
        *("term_1", "term_2", "term_3"),
        "transition",
    ]
    assert kernel.stages[0].signal.meaning == "coefficient of t^0 in half of the rate times the step"
    d1, d2 = (sp.Symbol(f"d{k}_x", real=True) for k in (1, 2))
    # w(t) h = 3 d1 - d2 + 4 (d2 - d1) t (thesis, chapter 3 A), halved.
    assert sp.expand(kernel.stages[0].expressions[0] - (3 * d1 - d2) / 2) == 0
    assert sp.expand(kernel.stages[1].expressions[0] - 2 * (d2 - d1)) == 0


def test_a_series_takes_no_rates_at_nodes():
    with pytest.raises(
        InputError, match=r"^method taylor4 takes increments; rates at nodes do not go with it$"
    ):
        derive("euler", "taylor4", rates=True)
