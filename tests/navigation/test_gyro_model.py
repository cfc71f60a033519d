"""The error model (4.9): all entries, zeros, factors and signs of Fig. 20, from the equations of one gyro."""

from __future__ import annotations

import pytest
import sympy as sp

from strapgen.ir.exceptions import InputError
from strapgen.navigation.instruments import imu_errors
from strapgen.navigation.instruments.imu_errors import (
    PARAMETERS,
    RATE,
    TERMS,
    error_structure,
    gyro_errors,
    gyro_torques,
    parameters,
    source_structure,
)
from strapgen.navigation.instruments.separation import (
    UNBALANCE,
    TwoAxisGyro,
    X,
    Y,
    Z,
    canonical_layout,
    diagonal_layout,
)

B = UNBALANCE


def symbol(name):
    return sp.Symbol(name, real=True)


#: The matrices of Fig. 20: 0, a coefficient, or a multiple of one.
FIGURE_20 = {
    "J": "0 xy xz; 0 0 yz; 0 yz 0",
    "B": "xx xy xz; yx yy yz; zx -yz yy",
    "E": "xx xy xz; 0 yy yz; 0 yz -yy",
    "H": "0 xy xz; 2xy 0 yz; 2xz -yz 0",
    "N": "xx xy xz; 2xy yy yz; 2xz -yz zz",
    **dict.fromkeys("KGM", "xx xy xz; yx yy yz; zx zy zz"),
    "D0": "x; y; z",
    "A0": "x; y; z",
}

#: What the coefficients are in the error parameters of the gyros.
FORMS = {
    "J_xy": "-J2/2",
    "J_xz": "J3/2",
    "J_yz": "-J1",
    "H_xy": "-J2/2/B",
    "H_xz": "-J3/2/B",
    "H_yz": "J1/B",
    "B_yy": "dB1",
    "B_yz": "-dP1",
    "E_xx": "(E2-E3)/2",
    "E_xy": "-D2/2",
    "E_xz": "D3/2",
    "E_yy": "E1",
    "E_yz": "-D1",
    "N_xx": "(E2+E3)/2/B",
    "N_xy": "-D2/2/B",
    "N_xz": "-D3/2/B",
    "N_yy": "-(E1+E2)/B",
    "N_yz": "D1/B",
    "N_zz": "-(E1+E3)/B",
}


def entry(letter, text):
    sign = -1 if text.startswith("-") else 1
    factor, label = (2, text[1:]) if text.startswith("2") else (1, text.removeprefix("-"))
    return sp.S.Zero if text == "0" else sign * factor * symbol(f"{letter}_{label}")


@pytest.mark.parametrize("letter", FIGURE_20)
def test_the_matrix_is_that_of_figure_20(letter):
    rows = [[entry(letter, text) for text in row.split()] for row in FIGURE_20[letter].split(";")]
    assert source_structure().matrices[letter] == sp.Matrix(rows)


def test_the_coefficients_are_the_derived_ones():
    names = {s.name: s for number in (1, 2, 3) for s in parameters(number).values()} | {"B": B}
    forms = source_structure().forms
    for name, text in FORMS.items():
        assert sp.simplify(forms[symbol(name)] - sp.sympify(text, locals=names)) == 0, name


def test_products_are_related_through_the_unbalance():
    forms = source_structure().forms
    for one, other, sign in (
        *(("H_xy", "J_xy", 1), ("H_xz", "J_xz", -1), ("H_yz", "J_yz", -1)),
        *(("N_xy", "E_xy", 1), ("N_xz", "E_xz", -1), ("N_yz", "E_yz", -1)),
    ):
        assert sp.simplify(forms[symbol(one)] - sign * forms[symbol(other)] / B) == 0


@pytest.mark.long
def test_the_torques_are_turned_with_a_gyro_that_is_turned_about_its_spin():
    # With the sign of (4.2) as the scans print it this fails: the anisoelastic torques must turn with the gyro.
    angle = symbol("angle")
    c, s = sp.cos(angle), sp.sin(angle)
    turn = sp.Matrix([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    W, A = imu_errors.RATE, imu_errors.ACCELERATION
    none = dict.fromkeys(PARAMETERS, sp.S.Zero)
    for name in ("D", "E", "J", "dP", "dB"):
        error = none | {name: symbol(name)}
        turned = gyro_torques(turn * W, turn * A, B, error)
        assert (turned - turn[:2, :2] * gyro_torques(W, A, B, error)).applyfunc(sp.simplify) == sp.zeros(2, 1)


def test_the_last_matrix_of_the_residual_is_antisymmetric_but_for_its_diagonal():
    W, A = imu_errors.RATE, imu_errors.ACCELERATION
    errors = gyro_errors(1, W, A, B)
    D, E = symbol("D1"), symbol("E1")
    elastic = sp.Matrix([[D, E], [-E, D]]) * sp.Matrix([A[0] * A[2], A[1] * A[2]])
    part = errors.applyfunc(lambda e: e.coeff(D) * D + e.coeff(E) * E)
    assert (part - elastic).applyfunc(sp.expand) == sp.zeros(2, 1)


def test_the_products_have_the_order_of_the_source():
    x, y, z = RATE
    assert list(TERMS["rate products"]) == [y * z, z * x, x * y]


@pytest.mark.long
def test_another_layout_has_another_structure():
    # Without errors of gyro 2 to 45 degrees: the torquers of all gyros turned by it.
    turned = [gyro.turned(sp.pi / 4) for gyro in diagonal_layout()]
    structure = error_structure(turned, 1)
    assert structure.matrices["J"] == source_structure().matrices["J"]  # anisoinertia turns with a gyro
    assert structure.matrices["K"] == source_structure().matrices["K"]


def test_squares_are_refused():
    # A spin between body axes makes squares of their rates.
    _, second, third = canonical_layout()
    first = TwoAxisGyro(Z, -Y, 0)
    tilted = (first, TwoAxisGyro(X, (4 * Y - 3 * Z) / 5, second.unbalance), third)
    with pytest.raises(InputError, match=r"the errors of this layout hold [WA]_.\*\*2, which"):
        error_structure(tilted, 1)


def as_scanned(W, A, unbalance, error):
    """Return the torques with a minus before the second bracket of (4.2), as both scans print it."""
    elastic_y = (error["D"] * A[0] + error["E"] * A[1]) * A[2]
    return gyro_torques(W, A, unbalance, error) - sp.Matrix([2 * elastic_y, 0])


@pytest.mark.long
def test_with_the_sign_of_the_scans_figure_20_does_not_follow(monkeypatch):
    monkeypatch.setattr(imu_errors, "gyro_torques", as_scanned)
    structure = error_structure(diagonal_layout(), 1)
    forms = structure.matrices["E"].subs(structure.forms)
    D, E = symbol("D1"), symbol("E1")
    assert forms[1:, :] == sp.Matrix([[0, D, E], [0, -E, D]])
    assert structure.matrices["E"] != source_structure().matrices["E"]


def test_with_the_sign_of_the_scans_the_torques_do_not_turn_with_the_gyro():
    angle = sp.pi / 2
    turn = sp.Matrix([[sp.cos(angle), sp.sin(angle), 0], [-sp.sin(angle), sp.cos(angle), 0], [0, 0, 1]])
    error = dict.fromkeys(PARAMETERS, sp.S.Zero) | {"E": symbol("E")}
    W, A = imu_errors.RATE, imu_errors.ACCELERATION
    turned = as_scanned(turn * W, turn * A, B, error) - turn[:2, :2] * as_scanned(W, A, B, error)
    assert turned.applyfunc(sp.simplify) != sp.zeros(2, 1)
