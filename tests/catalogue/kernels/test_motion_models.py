"""Motions: rate, increments and true attitude belong together, proved symbolically (thesis, chapter 4 B)."""

import pytest
import sympy as sp

from strapgen import derive
from strapgen.catalogue import MOTIONS
from strapgen.catalogue.kernels.motion_models import MOTIONS as FORMULAS

# Times of either sign would do: every formula is even in the roots that sympy splits for t > 0.
T, H = sp.symbols("t h", positive=True)
A, B, G = sp.symbols("a b g", real=True)
PARAMETERS = {
    "constant": sp.symbols("x y z", real=True),
    "sinusoidal": (A, B),
    "coning": (A, B, G),
    "polynomial": sp.symbols("a0:5", real=True),
}
MOTION = pytest.mark.parametrize("name", MOTIONS)


def skew(x, y, z) -> sp.Matrix:
    return sp.Matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def about_y(angle) -> sp.Matrix:
    c, s = sp.cos(angle), sp.sin(angle)
    return sp.Matrix([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def truth(name: str, t, *parameters) -> tuple[sp.Matrix, sp.Matrix]:
    """Return rate and attitude of a motion."""
    result = kernel_values(f"{name}-truth", t, *parameters)
    return sp.Matrix(result["rate"]), sp.Matrix(3, 3, result["attitude"])


def increment(name: str, start, end, *parameters) -> sp.Matrix:
    values = kernel_values(f"{name}-increments", (start + end) / 2, end - start, *parameters)
    return sp.Matrix(values["increment"])


def kernel_values(name: str, *values) -> dict:
    kernel = derive(name)
    elements = [element for signal in kernel.inputs for element in signal.elements]
    return kernel.expand(dict(zip(elements, values, strict=True)))


def open_sinc(matrix: sp.Matrix) -> sp.Matrix:
    """Write sin(x)/x for sinc(x), which is the same away from 0."""
    return matrix.replace(sp.sinc, lambda x: sp.sin(x) / x)


def with_norm(matrix: sp.Matrix, squared: sp.Expr, s: sp.Symbol) -> sp.Matrix:
    """Write t s for the root of t^2 times `squared`."""
    result = matrix.replace(lambda e: e.is_Add and sp.expand(e - T**2 * squared) == 0, lambda e: (T * s) ** 2)
    assert all(power.exp.is_Integer for power in result.atoms(sp.Pow))
    return result


def vanishes(matrix: sp.Matrix, squares: dict[sp.Expr, sp.Expr]) -> bool:
    """Tell whether the numerators of a matrix are zero once the squares of some symbols are replaced."""
    for element in matrix:
        numerator = sp.expand(sp.numer(sp.together(element)))
        for symbol, square in squares.items():
            numerator = sp.rem(numerator, symbol**2 - square, symbol)
        if sp.expand(numerator) != 0:
            return False
    return True


def half_angle_form(matrix: sp.Matrix, s: sp.Symbol) -> tuple[sp.Matrix, dict[sp.Expr, sp.Expr]]:
    """Write sines and cosines of s t/2 and b t as symbols; return their Pythagorean relations beside."""
    half_sine, half_cosine, sine, cosine = sp.symbols("half_sine half_cosine sine cosine")
    written = matrix.subs(
        {
            sp.sin(s * T): 2 * half_sine * half_cosine,
            sp.cos(s * T): 1 - 2 * half_sine**2,
            sp.sin(s * T / 2): half_sine,
            sp.cos(s * T / 2): half_cosine,
            sp.sin(B * T): sine,
            sp.cos(B * T): cosine,
        }
    )
    assert not written.has(sp.sin, sp.cos)
    return written, {half_sine: 1 - half_cosine**2, sine: 1 - cosine**2}


#: The squared norm of the rotation vector's rate, for the motions whose attitude holds a root.
SQUARED_NORM = {
    "constant": sum(w**2 for w in PARAMETERS["constant"]),
    "coning": A**2 + (B + G) ** 2,
}
S = sp.Symbol("s", positive=True)


def reduced_truth(name: str) -> tuple[sp.Matrix, sp.Matrix]:
    rate, attitude = truth(name, T, *PARAMETERS[name])
    return rate, with_norm(open_sinc(attitude), SQUARED_NORM[name], S)


@pytest.mark.long
@pytest.mark.parametrize("name", SQUARED_NORM)
def test_the_attitude_turns_with_the_rate_about_three_axes(name):
    # dC/dt = C skew(w), for parameters of either sign.
    rate, attitude = reduced_truth(name)
    residual, relations = half_angle_form(attitude.diff(T) - attitude * skew(*rate), S)
    assert vanishes(residual, relations | {S: SQUARED_NORM[name]})


@pytest.mark.parametrize("name", ["sinusoidal", "polynomial"])
def test_the_attitude_turns_with_the_rate_about_one_axis(name):
    rate, attitude = truth(name, T, *PARAMETERS[name])
    attitude = open_sinc(attitude)
    assert (attitude.diff(T) - attitude * skew(*rate)).expand() == sp.zeros(3, 3)


@MOTION
def test_the_attitude_begins_at_the_identity(name):
    assert truth(name, 0, *PARAMETERS[name])[1] == sp.eye(3)


def test_the_rates_are_the_printed_ones():
    x, y, z = PARAMETERS["constant"]
    a0, a1, a2, a3, a4 = PARAMETERS["polynomial"]
    printed = {
        "constant": (x, y, z),
        "sinusoidal": (0, A * sp.cos(B * T), 0),
        "coning": (A * sp.sin(B * T), G, A * sp.cos(B * T)),
        "polynomial": (0, a0 + a1 * T + a2 * T**2 + a3 * T**3 + a4 * T**4, 0),
    }
    for name, rate in printed.items():
        assert truth(name, T, *PARAMETERS[name])[0] == sp.Matrix(rate)


def opened_increment(name: str, start, end) -> sp.Matrix:
    return open_sinc(increment(name, start, end, *PARAMETERS[name]))


def equal_waves(matrix: sp.Matrix, start: sp.Symbol, end: sp.Symbol) -> bool:
    """Tell whether a matrix of sines and cosines of b start and b end, or of their halves, is zero."""
    p, q = sp.symbols("p q")
    sin_p, cos_p, sin_q, cos_q = sp.symbols("sin_p cos_p sin_q cos_q")
    halves = matrix.subs({start: 2 * p / B, end: 2 * q / B}, simultaneous=True)
    halves = halves.applyfunc(lambda e: sp.expand_trig(expanded(e)))
    halves = halves.subs({sp.sin(p): sin_p, sp.cos(p): cos_p, sp.sin(q): sin_q, sp.cos(q): cos_q})
    assert not halves.has(sp.sin, sp.cos)
    return vanishes(halves, {sin_p: 1 - cos_p**2, sin_q: 1 - cos_q**2})


def expanded(expression: sp.Expr) -> sp.Expr:
    """Expand the arguments of sines and cosines."""
    return expression.replace(lambda e: e.func in (sp.sin, sp.cos), lambda e: e.func(sp.expand(e.args[0])))


@pytest.mark.long
@MOTION
def test_increments_grow_by_the_rate_at_their_end(name):
    start, end = sp.symbols("t0 t1", real=True)
    rate, _ = truth(name, end, *PARAMETERS[name])
    assert equal_waves(opened_increment(name, start, end).diff(end) - rate, start, end)


@MOTION
def test_increments_of_no_time_are_zero(name):
    # With the derivative this proves that the increments are integrals of the rate.
    assert increment(name, T, T, *PARAMETERS[name]) == sp.zeros(3, 1)


def test_coning_at_b_zero_is_a_constant_rate():
    assert truth("coning", T, A, 0, G) == truth("constant", T, 0, G, A)
    assert increment("coning", T, T + H, A, 0, G) == increment("constant", T, T + H, 0, G, A)


def test_coning_at_s_zero_is_a_turn_about_y():
    # a = 0 and b = -g: the rotation vector vanishes and R(t) alone is left.
    rate, attitude = truth("coning", T, 0, -G, G)
    assert rate == sp.Matrix([0, G, 0])
    assert attitude == about_y(G * T)


def test_a_sinusoidal_rate_at_b_zero_is_constant():
    rate, attitude = truth("sinusoidal", T, A, 0)
    assert (rate, attitude) == (sp.Matrix([0, A, 0]), about_y(A * T))
    assert increment("sinusoidal", T, T + H, A, 0) == sp.Matrix([0, A * H, 0])
    # and the limit of the printed angle
    assert sp.limit(A / B * sp.sin(B * T), B, 0) == A * T


def test_every_motion_that_is_listed_has_its_formulas():
    assert list(FORMULAS) == list(MOTIONS)
