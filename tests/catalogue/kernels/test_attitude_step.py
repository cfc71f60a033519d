"""Attitude steps: the samples they take, their names, their order in words, and what follows from history."""

from __future__ import annotations

import re
from fractions import Fraction
from itertools import pairwise
from random import Random

import numpy as np
import pytest
import sympy as sp

import strapgen
from strapgen import catalogue, derive
from strapgen.catalogue import ALGORITHMS, INTEGRATORS, MOST_INCREMENTS
from strapgen.catalogue.methods.method import increments_signal, label, labels, node_rotations_signal
from strapgen.catalogue.methods.tableaux import TABLEAUX, Tableau, read
from strapgen.catalogue.methods.windows import WINDOWS
from strapgen.design.commit_late.late_filters import LateFilters
from strapgen.ir.kernel_info import Order
from strapgen.kernel.kernel import Kernel

ALGORITHM = pytest.mark.parametrize("algorithm", ALGORITHMS)

#: A method of the thesis's time that is not in the catalogue: Heun's of third order.
HEUN = """
name = "Heun of third order"
source = "K. Heun, Z. Math. Phys. 45 (1900) 23-38"
order = 3
nodes = [0, "1/3", "2/3"]
matrix = [[], ["1/3"], [0, "2/3"]]
weights = ["1/4", 0, "3/4"]
"""


# Samples


@pytest.mark.parametrize(("previous", "ahead"), [(0, 0), (1, 0), (0, 1), (3, 2), (2, 30)])
@pytest.mark.parametrize("count", [1, MOST_INCREMENTS])
def test_increments_come_in_the_order_of_time_and_those_beside_the_step_count_from_it(count, previous, ahead):
    signal = increments_signal(count, previous, ahead)
    assert signal.shape == (previous + count + ahead, 3)
    vectors = [element.removesuffix("_x") for element in signal.elements[::3]]
    assert vectors == [
        *(f"past{k}" for k in range(previous, 0, -1)),
        *(f"d{k}" for k in range(1, count + 1)),
        *(f"ahead{k}" for k in range(1, ahead + 1)),
    ]
    assert signal.elements[1::3] == tuple(f"{vector}_y" for vector in vectors)
    assert signal.unit == "rad" and signal.bound == 1
    assert ("before the step" in signal.meaning) == bool(previous)
    if previous:
        assert f"the first {previous} are those before the step" in signal.meaning
    assert (f"the last {ahead} are those after the step" in signal.meaning) == bool(ahead)


@pytest.mark.parametrize(
    ("node", "expected"),
    [
        (Fraction(0), "0"),
        (Fraction(1, 2), "1_2"),
        (Fraction(-1, 2), "minus_1_2"),
        (Fraction(12345, 67891), "12345_67891"),
        (Fraction(1201146811, 1299019798), "0_9247"),
        (sp.Rational(1, 2) - sp.sqrt(3) / 6, "0_2113"),
        (sp.Rational(1, 2) - sp.sqrt(3), "minus_1_2321"),
    ],
)
def test_labels_of_nodes(node, expected):
    assert label(node) == expected


def test_nodes_that_are_nearly_the_same_are_told_apart():
    near, nearer, root = Fraction(123456789, 10**9), Fraction(123456788, 10**9), sp.sqrt(2) / 2
    assert labels([Fraction(0), near, root, nearer]) == {
        Fraction(0): "0",
        near: "0_1235",
        root: "0_7071",
        nearer: "0_1235_2",
    }
    rows = (), (near,), (nearer, Fraction(0))
    weights = Fraction(1, 2), Fraction(1, 4), Fraction(1, 4)
    tableau = Tableau("near", "Near", "this test", 1, (Fraction(0), near, nearer), rows, weights)
    for chosen in ({"rates": True}, {"increments": 3}):
        elements = [name for signal in derive("dcm", tableau, **chosen).signals for name in signal.elements]
        assert any("0_1235_2" in name for name in elements) and len(elements) == len(set(elements))


@pytest.mark.parametrize("name", [*TABLEAUX, *(n for n, i in INTEGRATORS.items() if i.takes_rates)])
def test_nodes_of_every_method_have_names_of_their_own(name):
    kernel = derive("euler", name, rates=True)
    signals = [*kernel.inputs, *(stage.signal for stage in kernel.stages)]
    elements = [element for signal in signals for element in signal.elements]
    assert len(elements) == len(set(elements))
    assert all(element.isidentifier() for element in elements)
    samples = kernel.inputs[1]
    assert (samples.name, samples.unit) == ("node_rotations", "rad")
    assert all(re.fullmatch(r"turn_(minus_)?\d+(_\d+)?_[xyz]", element) for element in samples.elements)


def test_a_signal_of_rates_lists_its_nodes():
    signal = node_rotations_signal([Fraction(0), sp.sqrt(2) / 2])
    assert signal.elements[::3] == ("turn_0_x", "turn_0_7071_x")
    assert signal.meaning.endswith("at nodes 0, sqrt(2)/2 of the step")


# Orders


@pytest.mark.parametrize(
    ("order", "text", "limited"),
    [
        (Order(6, 6, 3, 4), "method order 6, rate extraction order 3: the step is of order 4", True),
        (Order(4, 4, 2, 4), "method order 4, rate extraction order 2: the step is of order 4", False),
        (
            Order(4, 5, 8, 5),
            "method order 4 (5 on attitude kinematics), rate extraction order 8: the step is of order 5",
            False,
        ),
        (Order(2, 2, None, 2), "method order 2: the step is of order 2", False),
    ],
)
def test_an_order_in_words(order, text, limited):
    assert (str(order), order.limited) == (text, limited)


@pytest.mark.long
@pytest.mark.parametrize(
    ("method", "count", "previous", "expected"),
    [
        ("butcher6", 3, 0, Order(6, 6, 3, 4)),
        ("butcher6", 4, 0, Order(6, 6, 4, 6)),
        ("rk4", 1, 0, Order(4, 4, 1, 2)),
        ("rk4", 1, 2, Order(4, 4, 3, 4)),
        ("rk4", 2, 0, Order(4, 4, 2, 4)),
        ("magnus6", 2, 3, Order(6, 6, 5, 6)),
        ("taylor12", 8, 0, Order(12, 12, 8, 10)),
        ("munthe-kaas4", 1, 1, Order(4, 4, 2, 3)),
    ],
)
def test_orders_of_steps(method, count, previous, expected):
    assert derive("euler", method, count, previous=previous).order == expected


@pytest.mark.long
@ALGORITHM
def test_a_note_says_where_samples_limit_the_order_and_only_there(algorithm):
    limited = derive(algorithm, "butcher6", 3)
    assert limited.notes == ("Method order 6, rate extraction order 3: the step is of order 4.",)
    assert derive(algorithm, "butcher6", 4).notes == ()
    assert derive(algorithm, "butcher6", 3, previous=2).notes == ()
    assert derive(algorithm, "butcher6", rates=True).notes == ()
    assert derive(algorithm, "rk4", 1).notes and not derive(algorithm, "rk4", 2).notes


# Names and commands


@pytest.mark.parametrize(
    ("chosen", "name", "arguments"),
    [
        (("dcm", "rk4", 2), "dcm-rk4-2", "dcm --method rk4 --increments 2"),
        (
            ("euler", "rk4", 1, False, 2),
            "euler-rk4-1-previous2",
            "euler --method rk4 --increments 1 --previous 2",
        ),
        (("euler", "rk3", None, True), "euler-rk3-rates", "euler --method rk3 --rates"),
        (
            ("cayley-klein", "magnus6", None, True),
            "cayley-klein-magnus6-rates",
            "cayley-klein --method magnus6 --rates",
        ),
        (
            ("dcm", "taylor5", 3, False, 1),
            "dcm-taylor5-3-previous1",
            "dcm --method taylor5 --increments 3 --previous 1",
        ),
        (("euler", "munthe-kaas4", 4), "euler-munthe-kaas4-4", "euler --method munthe-kaas4 --increments 4"),
    ],
)
def test_a_step_says_the_command_that_makes_it(chosen, name, arguments):
    choice = catalogue.choose(*chosen)
    kernel = catalogue.derive(choice)
    assert choice.kernel == kernel.name == name
    assert kernel.arguments == arguments
    assert kernel.attitude_step.previous == choice.previous == (chosen[4] if len(chosen) > 4 else 0)


def test_a_step_by_a_tableau_of_a_file_says_the_command_that_makes_it(tmp_path):
    (tmp_path / "heun.toml").write_text(HEUN)
    tableau = read(tmp_path / "heun.toml")
    kernel = derive("euler", tableau, 3, previous=1)
    assert kernel.name == "euler-heun-of-third-order-3-previous1"
    assert kernel.arguments == f"euler --tableau {tmp_path}/heun.toml --increments 3 --previous 1"
    assert derive("dcm", tableau, rates=True).arguments == f"dcm --tableau {tmp_path}/heun.toml --rates"
    assert kernel.source.endswith(HEUN.split('"')[3])


def test_titles_count_the_given_samples():
    def given(*chosen: object, **rest: object) -> str:
        return derive("euler", *chosen, **rest).title.split(" from ")[1]

    assert given("rk4", 1) == "1 angle increment"
    assert given("rk4", 2) == "2 angle increments"
    assert given("rk4", 1, previous=1) == "1 angle increment and 1 before it"
    assert given("rk4", 2, previous=3) == "2 angle increments and 3 before them"
    assert given("rk4", 1, ahead=1) == "1 angle increment and 1 after it"
    assert given("rk4", 2, previous=1, ahead=3) == "2 angle increments, 1 before them and 3 after them"
    assert given("rk4", rates=True) == "the rate at 3 nodes"
    assert given("midpoint", rates=True) == "the rate at 2 nodes"
    assert given("rk1", rates=True) == "the rate at 1 node"


# Previous increments


def values_of(kernel: Kernel, state: list, samples: list) -> dict[str, object]:
    return dict(
        zip([*kernel.inputs[0].elements, *kernel.inputs[1].elements], [*state, *samples], strict=True)
    )


@pytest.mark.long
@pytest.mark.parametrize(
    ("method", "count", "previous"),
    [("rk4", 1, 1), ("rk2", 1, 3), ("nystrom5", 2, 1), ("rk4", 3, 2), ("rk2", 8, 3)],
)
@ALGORITHM
def test_with_previous_increments_a_step_is_that_of_the_rates_they_fit(algorithm, method, count, previous):
    # On a rate of degree K + m - 1, as polynomials in the step length.
    step, from_rates = (
        derive(algorithm, method, count, previous=previous),
        derive(algorithm, method, rates=True),
    )
    random = Random(1969)
    rate = [
        [sp.Rational(random.randint(-9, 9), random.randint(1, 9)) for _ in "xyz"]
        for _ in range(count + previous)
    ]
    ring, h = sp.ring("h", sp.QQ)
    times = [sp.Rational(k, count) for k in range(-previous, count + 1)]
    increments = [
        sum(
            (
                ring(c[axis] * (end ** (k + 1) - begin ** (k + 1)) / (k + 1)) * h ** (k + 1)
                for k, c in enumerate(rate)
            ),
            ring(0),
        )
        for begin, end in pairwise(times)
        for axis in range(3)
    ]
    nodes = dict.fromkeys(TABLEAUX[method].nodes)
    turns = [
        sum(
            (
                ring(c[axis] * sp.Rational(node.numerator, node.denominator) ** k) * h ** (k + 1)
                for k, c in enumerate(rate)
            ),
            ring(0),
        )
        for node in nodes
        for axis in range(3)
    ]
    state = [ring(sp.Rational(random.randint(-9, 9), 7)) for _ in step.inputs[0].elements]
    assert from_rates.inputs[1].shape[0] == len(nodes)
    found = step.expand(values_of(step, state, increments))["next"]
    assert found == from_rates.expand(values_of(from_rates, state, turns))["next"]


@pytest.mark.long
@pytest.mark.parametrize("name", ["dcm", "euler"])
@pytest.mark.parametrize("previous", [0, 3, 5, 6])
def test_filters_before_it_give_the_step_of_each_window_of_a_family(name, previous):
    family = WINDOWS["window-3-3"]
    window = family.one_sided_with(6 - previous)
    backend = strapgen.backend(name, window.name)
    samples = np.random.default_rng(previous).uniform(-0.1, 0.1, (20, 7, 3))
    rows = np.array(LateFilters(family, calm_start=True).sets[previous], float)
    coefficients = np.moveaxis(rows @ samples, -2, 0)
    state = backend.step(backend.identity, samples[0])
    ours = strapgen.evaluator(f"{name}-legendre-4")(state, *coefficients)
    theirs = np.array([backend.step(state, each) for each in samples])
    # Some hundred operations on numbers up to 1.
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=3e-15)


@pytest.mark.long
def test_the_exact_rotation_is_that_of_the_window():
    family = WINDOWS["window-9-9"]
    backend = strapgen.backend("euler", family.name)
    samples = np.random.default_rng(9).uniform(-0.1, 0.1, (5, 19, 3))
    coefficients = np.moveaxis(np.array(family.filters, float) @ samples, -2, 0)
    ours = strapgen.evaluator("euler-legendre-exact-5")(backend.identity, *coefficients)
    theirs = np.array([backend.step(backend.identity, each) for each in samples])
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=3e-15)
