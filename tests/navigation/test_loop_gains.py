"""Gains by pole placement: polynomials, steady states, printed numbers, and the poles of a cycle."""

import math
from fractions import Fraction

import pytest
import sympy as sp

from strapgen.ir.exceptions import InputError
from strapgen.navigation.loops import loop_gains
from strapgen.navigation.loops.loop_gains import (
    ORDERS,
    R,
    T,
    check_stable,
    closed_loop,
    g,
    gains,
    poles_of_a_cycle,
    s,
    symbolic_gains,
    tau,
    z,
)
from strapgen.navigation.loops.loop_kernels import level_loop

LOOPS = [(name, order) for name, orders in ORDERS.items() for order in orders]


def steady(name, order=None):
    """Return the states that a step of each input leads to, in which nothing changes, as {state: {input: value}}."""
    loop = closed_loop(name, order)
    known = dict(zip(loop.gains, symbolic_gains(name, order), strict=True))
    states = (-loop.continuous.subs(known)).LUsolve(loop.disturbance.subs(known))
    return {
        state: {driver: sp.simplify(states[row, column]) for column, driver in enumerate(loop.inputs)}
        for row, state in enumerate(loop.states)
    }


@pytest.mark.parametrize(("name", "order"), LOOPS)
def test_all_poles_lie_at_the_time_constant(name, order):
    loop = closed_loop(name, order)
    matrix = loop.continuous.subs(dict(zip(loop.gains, symbolic_gains(name, order), strict=True)))
    assert sp.simplify(matrix.charpoly(s).as_expr() - (s + 1 / tau) ** order) == 0


def test_steady_states_are_those_of_the_source():
    level, heading, vertical, erection = map(steady, ("level", "heading", "vertical", "erection"))
    assert level["V"] == {"drift": 0, "force": 0, "Vr": 1}  # (1)
    assert level["phi"] == {"drift": 0, "force": -1 / g, "Vr": 0}  # (2)
    assert level["B"] == {"drift": 1, "force": 0, "Vr": -1 / R}  # (3)
    assert heading["psi"] == {"drift": 0, "psi_m": 1}  # (4)
    assert heading["B"] == {"drift": 1, "psi_m": 0}  # (5)
    assert vertical["V"] == {"force": 0, "hr": 0}  # (6)
    assert vertical["h"] == {"force": 0, "hr": 1}  # (7)
    assert vertical["B"] == {"force": 1, "hr": 2 * g / R}  # (8)
    assert erection["phi"] == {"drift": 2 * tau, "force": -1 / g}
    assert erection["V"] == {"drift": g * tau**2, "force": 0}


def test_gains_are_those_of_the_source():
    printed = {
        ("level", 5): (0.6, 0.0122322590, 8.15494394e-4),
        ("level", 30): (0.1, 3.39632428e-4, 3.77543701e-6),
        ("level", 240): (0.0125, 5.15230587e-6, 7.37390040e-9),
        ("heading", 40): (0.05, 6.25e-4),
        ("vertical", 50): (0.06, 1.20307843e-3, 8e-6),
    }
    for (name, seconds), numbers in printed.items():
        exact = gains(name, Fraction(seconds))
        assert all(isinstance(value, Fraction) for value in exact)
        for value, number in zip(exact, numbers, strict=True):
            # A unit in the last of nine digits.
            assert abs(value - number) <= 10.0 ** (math.floor(math.log10(number)) - 8), (name, seconds)
    assert gains("level", Fraction(15), 2)[2] == 0


@pytest.mark.parametrize(("name", "order"), LOOPS)
def test_a_cycle_leaves_the_steady_state_as_it_is(name, order):
    loop = closed_loop(name, order)
    held = loop.continuous.LUsolve(loop.disturbance)
    moved = (loop.cycle - sp.eye(order)) * held - loop.cycle_disturbance
    assert moved.applyfunc(sp.simplify) == sp.zeros(*moved.shape)


@pytest.mark.parametrize("name", ["heading", "vertical"])
def test_forward_euler_moves_every_pole_to_the_same_place(name):
    loop = closed_loop(name)
    euler = sp.eye(len(loop.states)) + T * loop.continuous
    assert (loop.cycle - euler).expand() == sp.zeros(*euler.shape)
    poles = poles_of_a_cycle(name, gains(name, Fraction(40)), Fraction(1, 100))
    assert {round(abs(pole), 14) for pole in poles} == {1 - 0.01 / 40}


def test_between_the_calls_the_tilt_splits_the_poles_of_levelling():
    # What the tilt adds is of first order in T/tau, which moves three poles that coincide by its cube root.
    for seconds in (5, 30, 240):
        ratio = 0.01 / seconds
        poles = poles_of_a_cycle("level", gains("level", Fraction(seconds)), Fraction(1, 100))
        moved = [abs((pole - 1) / ratio + 1) for pole in poles]
        assert 0.5 * ratio ** (1 / 3) < max(moved) < 1.5 * ratio ** (1 / 3)
        assert abs(poles[0]) < 1


@pytest.mark.parametrize(
    ("name", "order", "limit"),
    [("level", 3, "2/3"), ("erection", 2, "1"), ("heading", 2, "2"), ("vertical", 3, "2")],
)
def test_the_longest_stable_cycle_is_a_part_of_the_time_constant(name, order, limit):
    loop = closed_loop(name, order)
    known = dict(zip(loop.gains, symbolic_gains(name, order), strict=True))
    matrix = loop.cycle.subs(known).subs(T, sp.Rational(limit) * tau)
    assert sp.simplify(matrix.charpoly(z).as_expr().subs(z, -1)) == 0
    for part, stable in ((0.999, True), (1.001, False)):
        values = gains(name, Fraction(10), order)
        poles = poles_of_a_cycle(name, values, Fraction(part) * 10 * Fraction(limit))
        assert (abs(poles[0]) < 1) == stable


@pytest.mark.parametrize(("seconds", "cycle"), [(Fraction(10**6), "1e-5"), (Fraction(1, 1000), "1e3")])
def test_poles_of_the_shortest_and_of_the_longest_cycle(seconds, cycle):
    for name, order in LOOPS:
        poles = poles_of_a_cycle(name, gains(name, seconds, order), Fraction(cycle))
        assert len(poles) == order
        assert (abs(poles[0]) < 1) == (seconds > 1), name


def test_both_channels_of_levelling_have_the_same_poles_and_one_with_signs_of_the_other_is_unstable():
    kernel = level_loop()
    states = V, phi, B = sp.symbols("V phi B")
    names = [name for signal in kernel.inputs for name in signal.elements]

    def polynomial(velocity, turned):
        zero = dict.fromkeys(names, sp.S.Zero) | {k: sp.Symbol(k) for k in ("k1", "k2", "k3")}
        place, other = "xy".index(velocity), "yx"["xy".index(velocity)]
        known = zero | {"curvature": 1 / R, f"V_{velocity}": V, f"B_{other}": B}
        later = kernel.expand(known | {"cycle": T, f"change_{velocity}": turned * T * g * phi})
        rate = kernel.expand(known)["level_rate"][1 - place]
        changes = sp.Matrix(
            [later["next_level_velocity"][place], phi - T * rate, later["next_level_bias"][1 - place]]
        )
        return sp.expand(changes.diff(T).subs(T, 0).jacobian(states).charpoly(s).as_expr())

    # The specific force is g phi_x along y, and -g phi_y along x.
    assert polynomial("y", 1) == polynomial("x", -1)
    wrong = sp.Poly(polynomial("x", 1), s).all_coeffs()
    assert any(sp.simplify(c.subs({sp.Symbol(k): 1 for k in ("k1", "k2", "k3")})).is_negative for c in wrong)


def test_a_cycle_that_is_too_long_is_refused_in_one_line():
    values = gains("level", Fraction(5))
    check_stable("level", values, Fraction(3))
    with pytest.raises(
        InputError, match=r"^the level loop with gains 0.6, .* and a cycle of 4 s is unstable"
    ):
        check_stable("level", values, Fraction(4))
    k1, k2, k3 = values
    with pytest.raises(InputError, match=r"is unstable: a pole has magnitude 1\.0"):
        check_stable("level", (k1, k2, -k3), Fraction(1, 100))
    with pytest.raises(InputError, match="the erection loop has order 3; 2 is possible"):
        loop_gains.closed_loop("erection", 3)
