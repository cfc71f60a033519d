"""Butcher tableaux: the built-in files, and every way in which a user's file can be wrong."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest
import sympy as sp

import strapgen
from strapgen.catalogue import METHODS, STANDARD_METHODS
from strapgen.catalogue.methods import tableaux
from strapgen.catalogue.methods.order_conditions import largest_residual
from strapgen.catalogue.methods.tableaux import TABLEAUX, Tableau, read, verify
from strapgen.ir.exceptions import InputError
from strapgen.storage import resources

FOLDER = Path(tableaux.__file__).parent / "butcher_tableaux"
BUILT_IN = pytest.mark.parametrize("name", TABLEAUX)

HEUN = {
    "name": '"Heun, written by hand"',
    "source": '"the thesis"',
    "order": "2",
    "nodes": '["0", "1"]',
    "matrix": '[[], ["1"]]',
    "weights": '["1/2", "0.5"]',
}


@pytest.fixture
def written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Return a function that writes Heun's method with some keys changed, or left out where None."""
    monkeypatch.chdir(tmp_path)

    def write(**changes: str | None) -> str:
        lines = [f"{key} = {value}" for key, value in (HEUN | changes).items() if value is not None]
        Path("mine.toml").write_text("\n".join(lines))
        return "mine.toml"

    return write


# The built-in files


def test_the_catalogue_lists_every_file_in_the_order_of_the_methods():
    assert set(TABLEAUX) == {path.stem for path in FOLDER.iterdir()}
    assert list(METHODS)[: len(TABLEAUX)] == list(TABLEAUX) and len(TABLEAUX) == len(list(TABLEAUX))
    orders = [tableau.order for tableau in TABLEAUX.values()]
    assert orders == sorted(orders) and set(orders) == set(range(1, 9))
    assert [name for name in TABLEAUX if name.startswith("rk")] == list(STANDARD_METHODS)
    assert all(METHODS[name] == tableau.title for name, tableau in TABLEAUX.items())
    assert len(set(METHODS.values())) == len(METHODS)


@pytest.mark.long
def test_the_catalogue_is_read_only_and_lazy():
    with pytest.raises(KeyError):
        TABLEAUX["rk9"]
    with pytest.raises(TypeError):
        TABLEAUX["mine"] = TABLEAUX["rk4"]
    code = (
        "import sys; from strapgen.catalogue import METHODS; from strapgen.catalogue.methods import tableaux;"
        "print(len(METHODS) > 4, len(tableaux._BUILT_IN._known));"
        "print(tableaux.TABLEAUX['dormand-prince8'].rational, 'sympy' in sys.modules);"
        "sys.modules['sympy'] = None;"  # what imports it from here on fails
        "tableaux.TABLEAUX['cooper-verner8']"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert said.stdout.split() == ["True", "0", "True", "False"]
    assert said.returncode == 1 and "import of sympy halted" in said.stderr.splitlines()[-1]


@BUILT_IN
def test_a_file_is_one_that_a_user_could_hand_over(name):
    verified = read(FOLDER / f"{name}.toml")
    assert replace(verified, name=name) == TABLEAUX[name]
    assert verified.source and verified.title


def test_only_rounded_coefficients_leave_a_residual():
    # Without a tolerance, reading the file has found every condition to hold exactly, as the test above.
    assert [name for name, tableau in TABLEAUX.items() if tableau.tolerance] == ["dormand-prince8"]
    rounded = TABLEAUX["dormand-prince8"]
    assert 0.9 * rounded.tolerance < largest_residual(rounded) <= rounded.tolerance < Fraction(1, 10**16)
    for name in ("rk4", "cooper-verner8"):
        assert largest_residual(TABLEAUX[name]) == 0


@BUILT_IN
def test_a_wrong_digit_is_found(name):
    tableau = TABLEAUX[name]
    off = Fraction(1, 10**15)
    with pytest.raises(InputError, match="order 1: sum b_i = "):
        verify(replace(tableau, weights=(*tableau.weights[:-1], tableau.weights[-1] + off)))
    if len(tableau.nodes) > 1:
        *rows, last = tableau.matrix
        with pytest.raises(InputError, match=f"matrix row {len(tableau.nodes)} sums to "):
            verify(replace(tableau, matrix=(*rows, (last[0] + off, *last[1:]))))
    if len(tableau.nodes) > 2:
        # What keeps the row sums shows in the conditions, but where nothing of the stage is used.
        used = max(k for k, b in enumerate(tableau.weights) if b != 0)
        row = tableau.matrix[used]
        moved = (row[0] + off, *row[1:-1], row[-1] - off) if used > 1 else row
        matrix = tuple(moved if k == used else other for k, other in enumerate(tableau.matrix))
        with pytest.raises(InputError, match=r"order [3-8]: sum "):
            verify(replace(tableau, matrix=matrix))


def test_the_thesis_methods_are_as_printed():
    half = Fraction(1, 2)
    heun, classical = TABLEAUX["rk2"], TABLEAUX["rk4"]
    assert (heun.matrix, heun.weights) == (((), (1,)), (half, half))
    assert classical.matrix == ((), (half,), (0, half), (0, 0, 1))
    assert classical.weights == (Fraction(1, 6), Fraction(1, 3), Fraction(1, 3), Fraction(1, 6))


def test_irrational_nodes_are_exact():
    tableau = TABLEAUX["cooper-verner8"]
    assert tableau.nodes[3] == tableau.nodes[4] == sp.Rational(1, 2) + sp.sqrt(21) / 14
    assert isinstance(tableau.nodes[1], Fraction)
    # Lobatto's nodes, in [0, 1].
    x = sp.Symbol("x")
    roots = {sp.Rational(c.numerator, c.denominator) if isinstance(c, Fraction) else c for c in tableau.nodes}
    assert roots == {(r + 1) / 2 for r in sp.roots((x**2 - 1) * sp.legendre(4, x).diff(x))}


def test_generated_code_depends_on_the_files():
    assert set(FOLDER.iterdir()) <= set(resources.package_files())


# A user's file


def test_a_file_is_read_and_named_after_its_title(written):
    tableau = read(written())
    half = Fraction(1, 2)
    rows = ((0, 1), ((), (1,)), (half, half))
    assert tableau == Tableau("heun-written-by-hand", "Heun, written by hand", "the thesis", 2, *rows)
    assert tableau.rational and largest_residual(tableau) == 0


def test_whole_numbers_need_no_quotes_and_lines_may_end_as_on_windows(written):
    path = Path(written(nodes="[0, 1]", matrix="[[], [1]]", embedded_weights="[1, 0]"))
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert read(path).embedded_weights == (1, 0)


def test_square_roots_in_a_file(written):
    # Gauss's nodes are not for explicit methods; any node of second order is.
    node = "1/2+sqrt(3)/6"
    path = written(
        nodes=f'["0", "{node}"]',
        matrix=f'[[], ["{node}"]]',
        weights=f'["1-1/(2*({node}))", "1/(2*({node}))"]',
    )
    tableau = read(path)
    assert not tableau.rational
    assert tableau.nodes == (0, sp.Rational(1, 2) + sp.sqrt(3) / 6)


def test_an_order_that_is_stated_too_low_is_found_out(written):
    assert read(written(order="1")).order == 2


def test_rounded_coefficients_pass_with_a_tolerance(written):
    rounded = {
        "order": "3",
        "nodes": '["0", "1/2", "1"]',
        "matrix": '[[], ["1/2"], [-1, 2]]',
        "weights": '["0.16666666666666667", "0.66666666666666667", "0.16666666666666667"]',
    }
    with pytest.raises(InputError, match=r"order 1: sum b_i = .*1 is needed \(off by 1/100000000000000000\)"):
        read(written(**rounded))
    tableau = read(written(**rounded, tolerance='"1e-16"'))
    assert largest_residual(tableau) == Fraction(1, 10**17)


WRONG = {
    # keys
    "weights is missing; a list of numbers is needed": {"weights": None},
    "key 'weight' is not known (did you mean weights or embedded_weights?); allowed: name, s": {
        "weight": "[]"
    },
    "name is 3; a text that begins with a letter from a to z is needed": {"name": "3"},
    "name is no text of one line and": {"name": r'"two\nlines"'},
    "name is '3/8 rule'; a text that begins with a letter from a to z is needed": {"name": '"3/8 rule"'},
    "source is ' '; a text that is not empty is needed": {"source": '" "'},
    "source is no text of one line and at most 500 characters": {"source": f'"{"x" * 501}"'},
    "name holds */, which has a meaning in generated code; leave it out": {"name": '"Mine */ int x;"'},
    'source holds """, which has a meaning': {"source": '\'"""\''},
    "source holds \\, which has a meaning": {"source": r"'a\'"},
    "order is 11; a whole number from 1 to 10 is needed": {"order": "11"},
    "order is 0; a whole number": {"order": "0"},
    "order is 2.0; a whole number": {"order": "2.0"},
    "order is true; a whole number": {"order": "true"},
    "nodes is '0 1'; a list of 1 to 20 numbers is needed": {"nodes": '"0 1"'},
    "matrix is 1; a list of lists is needed": {"matrix": "1"},
    "matrix[2] is '1'; a list of numbers is needed": {"matrix": '[[], "1"]'},
    "weights is a table; a list of numbers is needed": {"weights": "{}"},
    # numbers
    "matrix[2][1] is 'one': numbers, + - * /": {"matrix": '[[], ["one"]]'},
    "weights[1] is '1/0': it divides by zero": {"weights": '["1/0", 1]'},
    "embedded_weights[2] is '9**9**9': a power is at most": {"embedded_weights": '[1, "9**9**9"]'},
    "weights[1] is [1]; a number is needed": {"weights": "[[1], 1]"},
    "weights[1] is 1979-05-27; a number is needed": {"weights": "[1979-05-27, 1]"},
    "weights[1] is nan; a finite number is needed": {"weights": "[nan, 1]"},
    "weights[1]: numbers of over 2048 binary digits": {"weights": f"[{'9' * 2000}, 1]"},
    "too many different square roots; at most three are allowed": {
        "nodes": '["0", "sqrt(2)"]',
        "weights": '["sqrt(3)+sqrt(5)", "sqrt(7)"]',
    },
    # shapes
    "nodes has 0 entries; from 1 to 20 are needed": {"nodes": "[]", "matrix": "[]", "weights": "[]"},
    "nodes has 21 entries; from 1 to 20 are needed": {"nodes": str([0] * 21)},
    "matrix has 1 row; as many as nodes are needed: 2": {"matrix": "[[]]"},
    "matrix[2] has 2 entries: not explicit, 1 is needed, left of": {"matrix": '[[], ["1/2", "1/2"]]'},
    "matrix[1] has 1 entry: not explicit, 0 are needed": {"matrix": "[[0], [1]]"},
    "matrix[2] has 0 entries: 1 is needed": {"matrix": "[[], []]"},
    "weights has 3 entries; as many as nodes are needed: 2": {"weights": '["1/2", "1/2", 0]'},
    "embedded_weights has 1 entry; as many": {"embedded_weights": "[1]"},
    # conditions
    "matrix row 2 sums to 1; its node is 1/2": {"nodes": '[0, "1/2"]'},
    "matrix row 1 sums to 0; its node is 1/5": {"nodes": '["1/5", 1]'},
    "matrix row 2 sums to 1/2 + sqrt(2)/2; its node is 1": {"matrix": '[[], ["(1+sqrt(2))/2"]]'},
    "order 1: sum b_i = 3/4, 1 is needed (off by -1/4)": {"weights": '["1/4", "1/2"]'},
    "order 2: sum b_i c_i = 1/4, 1/2 is needed (off by -1/4)": {"weights": '["3/4", "1/4"]'},
    "order 3: sum b_i c_i^2 = 1/2, 1/3 is needed (off by 1/6)": {"order": "3"},
    "order 1: sum b_i = 1/2 + sqrt(2)/2, 1 is needed (off by -1/2 + sqrt(2)/2)": {
        "weights": '["1/2", "sqrt(2)/2"]'
    },
    "embedded_weights sum to 2; 1 is needed, that they have an order": {"embedded_weights": "[1, 1]"},
    # tolerance
    "tolerance is '1e-3'; a number from 0 to 1e-12 is needed": {"tolerance": '"1e-3"'},
    "tolerance is -1; a number from 0 to": {"tolerance": "-1"},
    "tolerance is 1e-11; a number from 0 to": {"tolerance": "1e-11"},
    "tolerance is for rounded fractions; a tableau with square roots is exact": {
        "tolerance": '"1e-16"',
        "weights": '["1/2", "sqrt(2)"]',
    },
}


@pytest.mark.parametrize("said", WRONG)
def test_errors_are_reported_in_one_line(said, written):
    with pytest.raises(InputError) as caught:
        read(written(**WRONG[said]))
    message = str(caught.value)
    assert message.startswith("mine.toml: ") and said in message
    assert "\n" not in message and len(message) < 250


def test_tableau_that_misses_a_condition_is_refused_where_it_is_used():
    """Built in or an object of Python: no file is read that would be checked."""
    wrong = replace(TABLEAUX["rk4"], name="wrong", weights=(Fraction(1, 4),) * 2 + (Fraction(1, 6),) * 2)
    with pytest.raises(InputError, match=r"^tableau wrong: order 1: .* = 5/6, 1 is needed"):
        strapgen.derive("euler", wrong)
