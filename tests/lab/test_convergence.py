"""The observed order: that of theory, for every method, on every back end, and where the samples are the limit."""

from __future__ import annotations

import csv
import io
import json
import math
from fractions import Fraction
from pathlib import Path

import pytest

from strapgen import catalogue, motion
from strapgen.catalogue import INTEGRATORS, choose
from strapgen.catalogue.methods.tableaux import TABLEAUX
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.kernel_info import Order
from strapgen.lab.convergence import Convergence, StepError, converge
from strapgen.lab.convergence_report import ConvergenceResult, ladder_table

#: How far an observed order may be from the one of theory: the next term of the series is still there at these steps.
WITHIN = 0.15
LADDER = ["1/2", "1/4", "1/8", "1/16", "1/32", "1/64", "1/128"]
SHORT = ["1/8", "1/16", "1/32", "1/64"]


@pytest.fixture(scope="module")
def coning():
    """Return a motion whose rate turns in every direction, by about a radian a second."""
    return motion("coning", a_rad_s=1, b_rad_s=1.5, g_rad_s=0.6)


METHODS = [
    *TABLEAUX,
    *(name for name in INTEGRATORS if name in ("taylor1", "taylor2", "taylor3", "taylor4", "munthe-kaas4")),
    *(name for name in INTEGRATORS if name.startswith("magnus") or name in ("taylor5", "taylor6", "taylor8")),
]


#: One method of every family; the others with the long tests.
QUICK = ("rk1", "rk2", "rk3", "rk4", "taylor3", "magnus4", "munthe-kaas4")


def order_of(name: str) -> int:
    return TABLEAUX[name].order if name in TABLEAUX else INTEGRATORS[name].order


@pytest.mark.parametrize(
    ("algorithm", "method"),
    [
        *(("euler" if k % 2 else "dcm", method) for k, method in enumerate(QUICK)),
        *(
            pytest.param("dcm" if k % 2 else "euler", method, marks=pytest.mark.long)
            for k, method in enumerate(QUICK)
        ),
        *(pytest.param("euler", m, marks=pytest.mark.long) for m in METHODS if m not in QUICK),
    ],
)
def test_every_method_has_its_order_with_enough_increments(algorithm, method, coning):
    increments = catalogue.enough(method)
    steps = LADDER if order_of(method) > 4 else SHORT
    found = converge(choose(algorithm, method, increments), coning, steps, "1/2")
    # From three samples on a Taylor series is symmetric about the middle of the step, and odd orders gain one.
    gained = method.startswith("taylor") and increments > 2 and order_of(method) % 2
    assert found.predicted == order_of(method) + gained
    assert found.observed == pytest.approx(found.predicted, abs=WITHIN)


@pytest.mark.long
@pytest.mark.parametrize(
    ("method", "increments", "previous", "order"),
    [
        ("rk4", 1, 0, 2),
        ("butcher6", 3, 0, 4),
        ("rk4", 1, 1, 3),
        ("rk4", 1, 2, 4),
        pytest.param("rk4", 3, 0, 4, marks=pytest.mark.long),
        pytest.param("magnus6", 2, 0, 4, marks=pytest.mark.long),
        pytest.param("taylor6", 5, 0, 6, marks=pytest.mark.long),
        # Samples beyond what the order needs do no harm.
        pytest.param("magnus6", 5, 0, 6, marks=pytest.mark.long),
        pytest.param("magnus6", 8, 0, 6, marks=pytest.mark.long),
        pytest.param("butcher6", 1, 3, 5, marks=pytest.mark.long),
        pytest.param("butcher6", 2, 1, 4, marks=pytest.mark.long),
        pytest.param("magnus6", 2, 2, 5, marks=pytest.mark.long),
        pytest.param("butcher6", 3, 2, 6, marks=pytest.mark.long),
    ],
)
def test_samples_limit_the_order(method, increments, previous, order, coning):
    found = converge(choose("euler", method, increments, previous=previous), coning, SHORT, "1/2")
    assert found.predicted == order
    assert found.observed == pytest.approx(order, abs=WITHIN)


def test_every_back_end_shows_the_order(backend_name, coning):
    # Words of 16 bits are off by more than a second-order method at these steps.
    choice = choose("euler", "rk1", 1) if backend_name == "c-fixed16" else choose("dcm", "rk2", 2)
    # One format for all steps: the largest increment is 0.06 rad.
    settings = Settings(largest_angle=Fraction(1, 16)) if backend_name == "c-fixed32" else None
    found = converge(choice, coning, SHORT, 1, backend_name, settings)
    assert found.observed == pytest.approx(found.predicted, abs=WITHIN)


def test_no_order_is_observed_below_rounding(coning):
    found = converge(choose("euler", "rk4", 2), coning, ["1/64", "1/128", "1/256"], 1, "c-float")
    assert found.observed is None
    assert not any(rung.used for rung in found.rungs)
    assert "rounding hides the order on c-float" in ConvergenceResult([found], "title").text()


@pytest.mark.long
def test_rounded_coefficients_limit_the_fitted_errors(coning):
    """The published coefficients of this method leave 1e-17; without regard to that the slope would be far below 8."""
    choice = choose("euler", "dormand-prince8", 6)
    assert 0 < catalogue.rounding(choice) < Fraction(1, 10**16)
    assert catalogue.rounding(choose("euler", "rk4")) == catalogue.rounding(choose("error-matrix")) == 0
    found = converge(choice, coning, ["1/4", "1/8", "1/64"], 1)
    assert [rung.used for rung in found.rungs] == [True, True, False]


def test_in_many_digits_the_error_is_that_of_double(coning):
    choice = choose("euler", "rk2", 2)
    exact, double = (converge(choice, coning, SHORT, 1, name) for name in ("exact", "numpy"))
    for a, b in zip(exact.rungs, double.rungs, strict=True):
        # A unit of round-off a step, of 64 steps at most, on errors above 1e-6.
        assert b.error_rad == pytest.approx(a.error_rad, rel=64 * 2.0**-52 / 1e-6)


@pytest.mark.parametrize(
    ("steps", "duration", "says"),
    [
        (["1/8"], 1, "a slope takes two steps"),
        (["1/8", "0.125"], 1, "a slope takes two steps"),
        (["1/8", "1/3"], 1, None),
        (["1/8", "0.3"], 1, "is not a whole multiple of the step"),
        (["1/8", "-1"], 1, "step is -1; a number above 0 is needed"),
        (["1/8", "1/16"], "x", "duration is 'x'"),
    ],
)
def test_invalid_steps_are_refused(steps, duration, says, coning):
    choice = choose("euler", "rk1", 1)
    if says is None:
        assert len(converge(choice, coning, steps, duration).rungs) == 2
        return
    with pytest.raises(InputError, match=says):
        converge(choice, coning, steps, duration)


def test_a_step_from_rates_is_refused(coning):
    with pytest.raises(InputError, match="takes no increments"):
        converge(choose("euler", "rk4", rates=True), coning, SHORT, 1)
    with pytest.raises(InputError, match=r"backend 'c\+\+' is not known; allowed: .* shows all"):
        converge(choose("euler", "rk4", 2), coning, SHORT, 1, "c++")


FOUND = Convergence(
    "euler-butcher6-3",
    "exact",
    Order(6, 6, 3, 4),
    (StepError(0.5, None), StepError(0.25, 1e-2, None, True), StepError(0.125, 1e-2 / 16, 4.0, True)),
    4.0,
)


def test_reports_have_every_figure():
    text = ConvergenceResult([FOUND] * 5, "A title").text()
    assert text.startswith("A title\n")
    assert text.count("euler-butcher6-3") == 10  # a heading and a note each, four side by side and one below
    assert "out of range" in text and "6.250e-04 (4.00)*" in text
    assert "method order 6, rate extraction order 3: the step is of order 4" in text
    rows = list(csv.DictReader(io.StringIO(ConvergenceResult([FOUND], "A title").written("csv"))))
    assert [row["error_rad"] for row in rows] == ["", "0.01", "0.000625"]
    assert {row["predicted_order"] for row in rows} == {"4"}
    data = json.loads(json.dumps(FOUND.as_dict()))
    assert (data["observed_order"], data["predicted_order"], data["method_order"]) == (4.0, 4, 6)
    assert math.isclose(data["rungs"][2]["slope"], 4.0)


def test_labels_distinguish_methods_of_one_kernel():
    """Kernels of a user may have one name for all methods; the label tells them apart as the text does."""
    path = str(Path(__file__).parents[2] / "examples" / "modified_rodrigues.py")
    coning = motion("coning", a_deg_s=10, b_deg_s=10, g_deg_s=10)
    steps = [catalogue.choose_step(path, TABLEAUX[name]) for name in ("rk2", "rk4")]
    outcomes = [converge(step, coning, ["1/8", "1/16"], 1) for step in steps]
    assert len({row[-1] for row in ladder_table(*outcomes).rows}) == 2
