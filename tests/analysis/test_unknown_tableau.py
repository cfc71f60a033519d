"""Tableaux with unknowns: the families are complete, their members have the order, and no solution has a reason."""

from __future__ import annotations

import json
import shlex
import tomllib
from fractions import Fraction
from pathlib import Path

import pytest
import sympy as sp
from commands import run

from strapgen.analysis.unknowns import unknown_tableau
from strapgen.analysis.unknowns.elimination import Family
from strapgen.catalogue.methods import order_conditions, tableaux
from strapgen.catalogue.methods.tableaux import TABLEAUX
from strapgen.cli import main
from strapgen.ir.exceptions import InputError

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
THREE = {
    **{"name": "three", "source": "this test", "order": 3, "nodes": ["0", "c2", "c3"]},
    "matrix": [[], ["c2"], ["a31", "a32"]],
    "weights": ["b1", "b2", "b3"],
    "unknowns": ["c2", "c3", "a31", "a32", "b1", "b2", "b3"],
}


@pytest.fixture(scope="module")
def three():
    unknown = unknown_tableau.read(EXAMPLES / "heun3.toml")
    return unknown, unknown.solve()


@pytest.fixture(scope="module")
def four():
    """Kutta's methods."""
    unknown = unknown_tableau.read(EXAMPLES / "kutta4.toml")
    return unknown, unknown.solve()


def coefficients(method: tableaux.Tableau) -> dict[str, sp.Expr]:
    """Return the coefficients of a known method by the names of the example files."""
    values = {f"c{k}": value for k, value in enumerate(method.nodes, 1)}
    values |= {f"b{k}": value for k, value in enumerate(method.weights, 1)}
    values |= {f"a{i}{j}": x for i, row in enumerate(method.matrix, 1) for j, x in enumerate(row, 1)}
    return {name: sp.sympify(x) for name, x in values.items()}


def belongs(family: Family, values: dict[str, sp.Expr]) -> bool:
    chosen = {symbol: values[symbol.name] for symbol in family.free}
    if any(sp.expand(x.subs(chosen)) == 0 for x in family.nonzero):
        return False
    return all(sp.simplify(x.subs(chosen) - values[s.name]) == 0 for s, x in family.values.items())


def test_the_methods_of_third_order_have_two_parameters_and_two_special_cases(three):
    """K. Heun, Z. Math. Phys. 45 (1900) 23-38; W. Kutta, ibid. 46 (1901) 435-453."""
    _, solution = three
    assert [family.dimension for family in solution.families] == [2, 1, 1]
    c2, c3 = sp.symbols("c2 c3", real=True)
    values = {symbol.name: value for symbol, value in solution.families[0].values.items()}
    assert sp.cancel(values["b3"] - (2 - 3 * c2) / (6 * c3 * (c3 - c2))) == 0
    assert sp.cancel(values["b2"] - (2 - 3 * c3) / (6 * c2 * (c2 - c3))) == 0
    assert sp.cancel(values["a32"] - c3 * (c3 - c2) / (c2 * (2 - 3 * c2))) == 0
    special = {(f.values[c2], f.values[c3]) for f in solution.families[1:]}
    assert special == {(sp.Rational(2, 3), sp.Rational(2, 3)), (sp.Rational(2, 3), 0)}


def test_the_methods_of_fourth_order_are_those_of_kutta(four):
    """Two parameters with c4 = 1, or one where (c2, c3) is (1/2, 1/2), (1/2, 0) or (1, 1/2)."""
    _, solution = four
    assert [family.dimension for family in solution.families] == [2, 1, 1, 1]
    assert all(family.values[sp.Symbol("c4", real=True)] == 1 for family in solution.families)
    c2, c3 = sp.symbols("c2 c3", real=True)
    half = sp.S.Half
    special = {(f.values[c2], f.values[c3]) for f in solution.families[1:]}
    assert special == {(half, half), (half, 0), (1, half)}
    b4 = solution.families[0].values[sp.Symbol("b4", real=True)]
    true = sp.S.Half + (2 * (c2 + c3) - 3) / (12 * (1 - c2) * (1 - c3))
    assert sp.cancel(b4 - true) == 0


@pytest.mark.parametrize("stages", [3, 4])
def test_every_method_of_the_catalogue_belongs_to_one_family(stages, three, four):
    _, solution = three if stages == 3 else four
    known = [
        method
        for method in TABLEAUX.values()
        if len(method.nodes) == stages and method.order == stages and not method.tolerance
    ]
    assert len(known) >= 2
    for method in known:
        families = [family for family in solution.families if belongs(family, coefficients(method))]
        assert len(families) == 1, method.name


def test_every_family_satisfies_every_condition(three, four):
    for unknown, solution in (three, four):
        for family in solution.families:
            assert all(family.holds(each.value) for each in unknown.conditions())
            assert not family.holds(unknown.conditions(order=unknown.order + 1)[-1].value)


def test_members_are_ordinary_tableaux(three, four):
    unknown, solution = three
    heun = unknown.member(solution.families[0], {"c2": "1/3", "c3": Fraction(2, 3)})
    assert heun.weights == (Fraction(1, 4), 0, Fraction(3, 4))
    assert (heun.order, order_conditions.order(heun)) == (3, 3)
    unknown, solution = four
    rule = unknown.member(solution.families[0], {"c2": "1/3", "c3": "2/3"})
    assert rule.weights == (Fraction(1, 8), Fraction(3, 8), Fraction(3, 8), Fraction(1, 8))
    (family,) = (f for f in solution.families if f.values.get(sp.Symbol("a41", real=True)) == 0)
    gill = unknown.member(family, {"a31": "(sqrt(2) - 1)/2"})
    assert (gill.order, gill.rational) == (4, False)


@pytest.mark.long
def test_up_to_fourth_order_linear_equations_leave_no_more_freedom(three, four):
    for unknown, solution in (three, four):
        assert unknown.solve("attitude").families == solution.families


def test_from_fifth_order_on_linear_equations_leave_one_parameter_more():
    unknown = unknown_tableau.read(EXAMPLES / "fifth_order.toml")
    general, attitude = unknown.solve(), unknown.solve("attitude")
    assert [family.dimension for family in general.families] == [1]
    assert max(family.dimension for family in attitude.families) == 2
    # Butcher's method is a member of the smaller family; one of the larger beside it is of fifth order on A(t) alone.
    assert belongs(general.families[0], coefficients(TABLEAUX["butcher5"]))
    wide = attitude.families[0]
    values = {name: sp.Rational(k, 7) for k, name in enumerate(("a31", "a42"), 1)}
    assert [symbol.name for symbol in wide.free] == ["a31", "a42"]
    chosen = {symbol: values[symbol.name] for symbol in wide.free}
    data = tomllib.loads((EXAMPLES / "fifth_order.toml").read_text()) | {"order": 4}
    lower = unknown_tableau.from_data(data)
    method = lower.substitute({**values, **{s.name: x.subs(chosen) for s, x in wide.values.items()}})
    assert (order_conditions.order(method), order_conditions.attitude_order(method)) == (4, 5)


def test_row_sums_are_conditions():
    unknown = unknown_tableau.from_data(THREE)
    assert [each.label for each in unknown.conditions(order=1)] == [
        "row 3: sum a_3j = c_3",
        "sum b_i",
    ]


def test_three_stages_have_no_fourth_order():
    solution = unknown_tableau.from_data(THREE | {"order": 4}).solve()
    assert solution.families == ()
    assert solution.reason == "sum b_i a_ij a_jk c_k is -1/24, whatever the unknowns are, and has to be 0"
    assert solution.solvable == 3


def test_the_leading_error_is_the_principal_error_of_a_member(three):
    unknown, solution = three
    family = solution.families[0]
    chosen = {symbol: sp.Rational(k, 3) for k, symbol in enumerate(family.free, 1)}
    squares = sum(float(each.value.subs(chosen)) ** 2 for each in unknown.leading(family))
    heun = unknown.member(family, {symbol.name: value for symbol, value in chosen.items()})
    assert squares**0.5 == pytest.approx(order_conditions.principal_error_norm(heun), rel=1e-12)


# Command line


def says(line: str, capsys: pytest.CaptureFixture[str]) -> str:
    run(shlex.split(line))
    said = capsys.readouterr()
    return said.out


def test_the_command_shows_the_families(capsys):
    said = says(f"tableau {EXAMPLES / 'heun3.toml'}", capsys)
    assert "on any differential equation: 5 conditions; at most 2 free parameters" in said
    assert "the same families" in said
    data = json.loads(says(f"tableau {EXAMPLES / 'heun3.toml'} --format json", capsys))
    assert [family["dimension"] for family in data["general"]["families"]] == [2, 1, 1]
    assert data["general"]["families"][0]["parameters"] == ["c2", "c3"]
    assert len(data["general"]["families"][0]["leading_error"]) == 4


@pytest.mark.long
def test_a_member_is_a_file_for_other_commands(capsys, tmp_path):
    file = tmp_path / "member.toml"
    says(f"tableau {EXAMPLES / 'heun3.toml'} --set c2=1/3 --set c3=2/3 --format toml --out {file}", capsys)
    assert tableaux.read(file).order == 3
    assert "classical order               3" in says(f"tableau {file}", capsys)
    assert "euler-three-stages" in says(f"derive euler --tableau {file} --format json", capsys)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"unknowns": []}, "unknowns has 0 entries; at least 1"),
        ({"unknowns": "c2"}, "unknowns is 'c2'; a list of at least 1 texts is needed"),
        ({"unknowns": [*THREE["unknowns"], "c2"]}, "unknowns holds c2 twice"),
        ({"unknowns": [*THREE["unknowns"], "d"]}, "no coefficient holds d"),
        ({"unknowns": ["c2"]}, "nodes[3] is 'c3': c3 is not known; known are c2, pi"),
        ({"unknowns": ["c 2"]}, "names of letters, digits and underscores are needed"),
        ({"unknowns": ["sqrt"]}, "means something else"),
        ({"order": 7}, "order is 7; a whole number from 1 to 6 is needed"),
        ({"nodes": ["c2", "c2", "c3"]}, "the first stage of an explicit method is at 0"),
        ({"nodes": ["0", "c2"]}, "matrix has 3 rows"),
        ({"matrix": [[], ["c2"], ["a31"]]}, "matrix[3] has 1 entry"),
        ({"weights": ["b1"]}, "weights has 1 entry"),
        ({"weights": ["b1", "b2", "b3.real"]}, "weights[3]"),
        ({"tolerance": "1e-14"}, "key 'tolerance' is not known"),
        ({"name": "3"}, "name is '3'; a text that begins with a letter"),
    ],
)
def test_a_bad_file_gets_one_line(change, reason):
    with pytest.raises(InputError) as refusal:
        unknown_tableau.from_data(THREE | change)
    assert reason in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("tableau {heun} --set c4=1", "unknown 'c4' is not known; allowed: c2, c3"),
        ("tableau {heun} --set c2=2/3 c3=1", "3*c2 - 2 is 0 with these values; the family excludes it"),
        ("tableau {heun} --set c2=1/3", "c3 has no value"),
        ("tableau {heun} --set c2=1 c3=1/2 --family 4", "family is 4"),
        ("tableau {heun} --format csv", "families are text, json or latex"),
        ("tableau rk4 --set c2=1", "rk4 has none"),
        ("derive euler --tableau {heun}", "its coefficients hold unknowns; strapgen tableau solves for them"),
    ],
)
def test_bad_options_get_one_line(line, reason, capsys):
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(line.format(heun=EXAMPLES / "heun3.toml")))
    said = capsys.readouterr()
    assert (stop.value.code, said.out, said.err.count("\n")) == (2, "", 1)
    assert reason in said.err
