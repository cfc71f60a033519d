"""Conditions on unknown coefficients: their families are those of the literature and of the catalogue."""

from __future__ import annotations

import json
import shlex
from fractions import Fraction
from pathlib import Path

import pytest
import sympy as sp
from commands import run

import strapgen
from strapgen.analysis.series import velocity_series
from strapgen.analysis.series.series import series
from strapgen.analysis.unknowns import conditions
from strapgen.analysis.unknowns.conditions import Demand, attitude_conditions
from strapgen.analysis.unknowns.solving import SolvedStep, solve
from strapgen.catalogue.choice import Choice
from strapgen.catalogue.methods import coning_coefficients
from strapgen.cli import main
from strapgen.ir.exceptions import InputError
from strapgen.lab.one_step import step

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = str(ROOT / "examples" / "three_samples.py")
RATES = str(ROOT / "examples" / "rates_at_nodes.py")
VELOCITY = str(ROOT / "examples" / "two_velocity_samples.py")
PAIRS = str(ROOT / "tests" / "data" / "algorithms" / "pairs.py")
MILLER = {"a": sp.Rational(57, 80), "b": sp.Rational(33, 80)}


def solved_pairs(increments: int, previous: int, **orders: int) -> SolvedStep:
    return solve(strapgen.choose(PAIRS, increments=increments, previous=previous), orders)


def as_values(pairs: dict[tuple[int, int], Fraction]) -> dict[str, sp.Rational]:
    return {f"k_{i}_{j}": sp.Rational(c.numerator, c.denominator) for (i, j), c in pairs.items()}


def test_the_three_sample_coefficients_for_a_polynomial_rate():
    """R. B. Miller, J. Guid. Control Dyn. 6 (1983) 287-291."""
    solved = solve(strapgen.choose(EXAMPLE), {"polynomial": 5})
    assert len(solved.families) == 1
    assert solved.values() == MILLER


def test_the_three_sample_coefficients_for_coning():
    """The same paper: 9/20 of the first with the last sample, and 27/40 of neighbours."""
    solved = solve(strapgen.choose(EXAMPLE), {"coning": 6})
    assert solved.values() == {"a": sp.Rational(27, 40), "b": sp.Rational(9, 20)}


def test_the_two_sample_coefficient():
    solved = solved_pairs(2, 0, general=4)
    assert solved.values() == {"k_0_1": sp.Rational(2, 3)}


def test_a_family_of_fourth_order_has_the_order_that_the_series_shows():
    solved = solve(strapgen.choose(EXAMPLE), {"general": 4})
    (family,) = solved.families
    assert [symbol.name for symbol in family.free] == ["a"]
    for value in (0, Fraction(-7, 3)):
        kernel = solved.substitute({"a": value})
        assert kernel.unknowns == ()
        assert series(Choice.of_user(kernel), terms=1).order == 4
    beside = strapgen.derive(EXAMPLE).substitute({"a": 0, "b": 1})
    assert series(Choice.of_user(beside), terms=1).order == 2


def test_the_leading_error_is_the_next_power_and_the_least_of_it_is_a_minimum():
    solved = solve(strapgen.choose(EXAMPLE), {"general": 4})
    ((leading,),) = solved.leading
    assert leading.power == 5
    a = sp.Symbol("a", real=True)
    assert leading.least == {a: MILLER["a"]}
    at = [leading.square.subs(a, MILLER["a"] + x) for x in (-1, 0, 1)]
    assert at[1] < min(at[0], at[2])
    # The terms are those of the series of a member.
    kernel = solved.substitute({"a": 1})
    drift = series(Choice.of_user(kernel), terms=1).invariant[5].drift
    (term,) = [each.value for each in leading.terms if each.label.endswith(": w1 x w2")]
    assert term.subs(a, 1) == drift[1, 2][()] != 0


@pytest.mark.parametrize(("increments", "previous"), [(3, 0), (4, 0), (1, 2), (2, 1)])
def test_uncompressed_coefficients_are_those_of_the_catalogue(increments, previous):
    samples = increments + previous
    solved = solved_pairs(increments, previous, polynomial=2 * samples - 1)
    design = coning_coefficients.design(increments, previous, "uncompressed")
    assert solved.values() == as_values(design.pairs)


@pytest.mark.parametrize(
    ("increments", "previous"),
    [(3, 0), *(pytest.param(n, p, marks=pytest.mark.long) for n, p in ((4, 0), (1, 2), (2, 1)))],
)
def test_compressed_coefficients_are_those_of_the_catalogue(increments, previous):
    samples = increments + previous
    design = coning_coefficients.design(increments, previous, "compressed")
    solved = solved_pairs(increments, previous, coning=2 * samples)
    (family,) = solved.families
    unused = {symbol.name: 0 for symbol in family.free}
    assert all(int(name.split("_")[-1]) < samples - 1 for name in unused)
    values = {name: value for name, value in solved.values(unused).items() if value}
    assert values == as_values({pair: c for pair, c in design.pairs.items() if c})
    # No coefficients reach the next power.
    assert solved_pairs(increments, previous, coning=2 * samples + 2).families == ()


@pytest.mark.long
def test_combined_coefficients_are_a_member_of_the_family_of_both():
    design = coning_coefficients.design(4, 0, "combined")
    solved = solved_pairs(4, 0, coning=8, polynomial=5)
    (family,) = solved.families
    values = as_values(design.pairs)
    free = {symbol.name: values[symbol.name] for symbol in family.free}
    assert len(free) == 1
    assert solved.values(free) == values


def test_conditions_of_a_known_method_say_whether_it_has_the_order():
    known = step(strapgen.choose("euler", "rk4", 2))
    assert attitude_conditions(known, Demand("general", 4)) == []
    (first, *_) = attitude_conditions(known, Demand("general", 4), more=1)
    assert (first.order, first.value.is_number) == (5, True)
    # The second-order part of two increments is exact on coning up to the 4th power.
    assert attitude_conditions(known, Demand("coning", 4)) == []
    assert [each.order for each in attitude_conditions(known, Demand("coning", 4), more=1)] == [5]


def test_the_second_order_part_on_general_motion_is_the_same_by_both_expansions():
    three = step(strapgen.choose(EXAMPLE))
    whole = {each.label: each.value for each in attitude_conditions(three, Demand("general", 5))}
    second = {each.label: each.value for each in attitude_conditions(three, Demand("polynomial", 5))}
    assert second.items() <= whole.items()
    assert len(second) == 3


def test_no_solution_has_its_reason(capsys):
    run(["solve", EXAMPLE, "--order", "5"])
    said = capsys.readouterr()
    assert "no solution: h^5, drift: |w1|^2 w0 is -1/240 with the values that the others leave" in said.out
    assert "the conditions up to h^4 have one" in said.out


def test_the_command_answers_in_json(capsys):
    run(["solve", EXAMPLE, "--order", "4", "--on", "polynomial", "--set", "a=57/80", "--format", "json"])
    data = json.loads(capsys.readouterr().out)
    assert data["chosen"] == {"a": "57/80", "b": "33/80"}
    (family,) = data["families"]
    assert (family["parameters"], family["values"]) == (["a"], {"b": "9/8 - a"})
    (leading,) = family["leading_errors"]
    assert (leading["motion"], leading["power"], leading["least"]) == ("polynomial", 5, {"a": "57/80"})
    a = sp.Symbol("a")
    assert sp.solve(sp.sympify(leading["terms"]["h^5, drift: w1 x w2"], {"a": a}), a) == [MILLER["a"]]


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("{example} --order 9", "order on general motion is 9; a whole number from 1 to 8 is needed"),
        ("{example} --order 3 --on cone", "motion of the attitude step 'cone' is not known"),
        ("{example} --order 3 --on coning,coning=5", "--on has coning twice"),
        ("{example} --order 3 --on coning=x", "--on is 'x'; a whole number is needed"),
        ("{example} --order 4 --set c=1", "unknown 'c' is not known; allowed: a"),
        ("{example} --order 4 --set a=1 --family 2", "family is 2"),
        ("{example} --order 5 --set a=1", "there is no solution"),
        ("euler --order 3", "kernel euler-rk4-2 has no unknowns"),
        ("missing.py --order 3", "is no file"),
        ("euler-product --order 3", "kernel euler-product is no attitude step"),
        ("{example} --order 3 --on sculling", "motion of the attitude step 'sculling' is not known"),
        (
            "{velocity} --order 3 --on coning",
            "motion of the step of velocity and position 'coning' is not known",
        ),
        ("{velocity} --order 7", "order on general motion is 7; a whole number from 1 to 6 is needed"),
    ],
)
def test_bad_input_gets_one_line(line, reason, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["solve", *shlex.split(line.format(example=EXAMPLE, velocity=VELOCITY))])
    said = capsys.readouterr()
    assert (stop.value.code, said.out, said.err.count("\n")) == (2, "", 1)
    assert reason in said.err


def test_values_that_the_family_excludes_are_refused():
    solved = solve(strapgen.choose(EXAMPLE), {"general": 4})
    with pytest.raises(InputError, match="there is no number 1"):
        solved.values({}, family=1)


@pytest.fixture(scope="module")
def on_rates() -> SolvedStep:
    return solve(strapgen.choose(RATES), 4)


def test_the_rotation_vector_of_rates_at_three_nodes(on_rates):
    """Simpson's weights, and h^2/12 times the product of the outer rates: W. Magnus, CPAM 7 (1954), third term."""
    sixth = sp.Rational(1, 6)
    assert on_rates.values() == {"p": sixth, "q": 4 * sixth, "r": sixth, "a": 0, "b": sixth / 2}
    # To products of two rates the conditions on a polynomial are those on any motion.
    second = solve(strapgen.choose(RATES), {"polynomial": 4}).conditions
    assert {e.label: e.value for e in second}.items() <= {
        e.label: e.value for e in on_rates.conditions
    }.items()


def test_a_solved_step_on_rates_runs_with_the_order_that_was_solved_for(on_rates):
    values = {name: str(value) for name, value in on_rates.values().items()}
    backend = strapgen.backend(strapgen.choose(RATES, constants=values), backend="numpy")
    cone = strapgen.motion("coning", a_deg_s=10, b_deg_s=10, g_deg_s=10)
    runs = [strapgen.simulate(backend, cone, step, 10) for step in (0.25, 0.125)]
    coarse, fine = (abs(run.drift).max() for run in runs)
    # Of the order 4: half the step leaves a sixteenth, and what is of higher order less than a tenth of it.
    assert coarse / fine == pytest.approx(16, rel=0.1)


def test_the_velocity_and_position_of_two_samples():
    """P. G. Savage, J. Guid. Control Dyn. 21 (1998) 208-221: 2/3 for sculling, 5/6 and 1/6 for the position."""
    third = sp.Rational(1, 3)
    solved = solve(strapgen.choose(VELOCITY), {"general": 3, "polynomial": 4})
    values = solved.values()
    assert {name: values[name] for name in ("a", "b", "c1", "c2")} == {
        "a": 2 * third, "b": -2 * third, "c1": sp.Rational(5, 6), "c2": sp.Rational(1, 6)
    }  # fmt: skip
    sculling = solve(strapgen.choose(VELOCITY), {"sculling": 4})
    assert {name: sculling.values()[name] for name in "ab"} == {"a": 2 * third, "b": -2 * third}
    # By transference c w_i x w_j of the angle is c (w_i x f_j - w_j x f_i) of the velocity: twice the mean. A drift
    # has the opposite sign of an error in the angle.
    (leading,) = sculling.leading[0]
    coning = solved_pairs(2, 0, coning=4)
    assert (leading.power, leading.terms[0].value) == (5, -2 * coning.leading[0][0].terms[0].value)


def test_the_series_of_a_velocity_comes_back_from_json_with_its_unknowns():
    one = velocity_series.series(strapgen.choose(VELOCITY), terms=2)
    data = json.loads(json.dumps(one.as_dict()))
    assert data["unknowns"] == ["a", "b", "c1", "c2", "k11", "k12", "k21", "k22"]
    again = velocity_series.VelocitySeries.from_dict(data)
    assert again == one
    assert sp.Symbol("a", real=True) in sp.sympify(again.velocity[2][0, again.known][()]).free_symbols


def test_a_condition_on_a_change_that_the_step_does_not_return_is_refused(tmp_path):
    path = tmp_path / "velocity.py"
    text = Path(VELOCITY).read_text()
    position = "    build.output(" + text.split("    build.output(")[2].split("    return build")[0]
    path.write_text(text.replace(position, ""))
    with pytest.raises(InputError, match="returns no position_change"):
        solve(strapgen.choose(path), {"position": 2})
    assert len(solve(strapgen.choose(path), 3).conditions) == 3


@pytest.mark.parametrize(("increments", "previous"), [(2, 0), (1, 1)])
def test_conditions_of_a_known_velocity_say_whether_it_has_the_order(increments, previous):
    known = strapgen.derive(strapgen.choose("velocity-position", "magnus4", increments, previous=previous))
    order = known.order.step
    for motion in ("velocity", "sculling"):
        assert conditions.velocity_conditions(known, Demand(motion, order)) == []
    later = conditions.velocity_conditions(known, Demand("general", order), more=1)
    assert {each.order for each in later} <= {order, order + 1}
    whole = {each.label: each.value for each in later}
    second = conditions.velocity_conditions(known, Demand("polynomial", order + 1))
    assert {each.label: each.value for each in second}.items() <= whole.items()
    assert second
