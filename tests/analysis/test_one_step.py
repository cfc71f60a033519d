"""The error of one step as a series, held against one step in 60 digits, and the arithmetic of power series."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

import derived
import mpmath
import pytest
import sympy as sp

from strapgen.analysis.series import invariants
from strapgen.catalogue import ALGORITHMS, Choice, choose, derive
from strapgen.kernel import algebra
from strapgen.kernel.covariants import Frame
from strapgen.kernel.kernel import Kernel
from strapgen.kernel.power_series import Powers, function
from strapgen.lab.one_step import errors, step
from strapgen.run import exact

CASES = [
    ("rk1", 2, 0),
    ("rk3", 2, 0),
    ("rk4", 2, 0),
    *(
        pytest.param(*case, marks=pytest.mark.long)
        for case in (
            ("rk4", 1, 2),
            ("taylor4", 3, 0),
            ("magnus4", 2, 0),
            ("munthe-kaas4", 2, 0),
            ("butcher6", 4, 0),
        )
    ),
]


def constant(choice: Choice, top: int) -> tuple[list, list]:
    """Return symbols w_x, w_y, w_z and the error matrix at a constant rate."""
    ring, *w = sp.ring("w_x w_y w_z", sp.QQ)
    return w, errors(step(choice), ring, [w], top)["error"]


@pytest.mark.parametrize(("algorithm", "share"), [("dcm", 1), ("euler", 16), ("cayley-klein", 16)])
def test_fourth_order_at_a_constant_rate(algorithm, share):
    """The drift of the thesis, (x - sin x) cut at x^5, and its sixteenth."""
    w, error = constant(choose(algorithm, "rk4", 2), 6)
    square = sum((x * x for x in w), w[0].ring.zero)
    for axis, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        drift = (error[3 * i + j] - error[3 * j + i]) * sp.Rational(1, 2)
        assert drift.parts == {5: w[axis] * square**2 * sp.Rational(1, 120 * share)}


@pytest.mark.long
@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("method", ["magnus4", "magnus6", "munthe-kaas4"])
def test_exponentials_are_exact_at_a_constant_rate(algorithm, method):
    _, error = constant(choose(algorithm, method, 3), 9)
    assert not any(element.parts for element in error)


def rate(number: int) -> list[list[sp.Rational]]:
    """Return rational vectors for a rate and its derivatives."""
    return [
        [sp.Rational((7 * j + 3 * axis) % 11 - 5, 6 + j + axis) for axis in range(3)] for j in range(number)
    ]


def in_digits(kernel: Kernel, *inputs: list) -> list:
    """Return the last output of a kernel in the digits of mpmath."""
    elements = [element for signal in kernel.inputs for element in signal.elements]
    numbers = dict(zip(elements, (x for values in inputs for x in values), strict=True))
    outputs = kernel.expand(numbers, lambda number: mpmath.mpf(number.p) / number.q)
    return [mpmath.mpmathify(x) for x in outputs[kernel.outputs[-1].signal.name]]


def one_step(choice: Choice, vectors: list[list[sp.Rational]], h: Fraction) -> list:
    """Return the error matrix of one step of length h in the digits of mpmath."""
    kernel = derived.kernel(choice)
    attitude_step = kernel.attitude_step
    count = kernel.inputs[1].shape[0] - attitude_step.previous

    def angle(t):
        return [
            sum(
                exact.number(Fraction(int(v[k].p), int(v[k].q))) * t ** (j + 1) / mpmath.factorial(j + 1)
                for j, v in enumerate(vectors)
            )
            for k in range(3)
        ]

    times = [exact.number(h) * k / count for k in range(-attitude_step.previous, count + 1)]
    angles = [angle(t) for t in times]
    state = [exact.number(x) for x in attitude_step.identity]
    taken = [b - a for pair in pairwise(angles) for a, b in zip(*pair, strict=True)]
    state = in_digits(kernel, state, taken)
    if attitude_step.attitude:
        state = in_digits(derived.kernel(choose(attitude_step.attitude)), state)
    computed = mpmath.matrix([state[3 * i : 3 * i + 3] for i in range(3)])

    # The true matrix by its own Taylor series, term after term, to 40 terms.
    terms = [mpmath.eye(3)]
    for n in range(40):
        total = mpmath.zeros(3)
        for j, v in enumerate(vectors[: n + 1]):
            g = [exact.number(Fraction(int(x.p), int(x.q))) / mpmath.factorial(j) for x in v]
            total += terms[n - j] * mpmath.matrix([[0, -g[2], g[1]], [g[2], 0, -g[0]], [-g[1], g[0], 0]])
        terms.append(total / (n + 1))
    true = sum((term * exact.number(h) ** n for n, term in enumerate(terms)), mpmath.zeros(3))
    return list(computed * true.T - mpmath.eye(3))


@pytest.mark.long
@pytest.mark.parametrize("algorithm", ["dcm", "euler"])
@pytest.mark.parametrize(("method", "increments", "previous"), CASES)
def test_two_terms_leave_an_error_of_the_square_of_the_step(algorithm, method, increments, previous):
    """For a general rate, in vector-invariant form: held against one step in 60 digits, as the step is halved."""
    choice = choose(algorithm, method, increments, previous=previous)
    kernel = derive(choice)
    lowest = kernel.order.step + 1
    frame = Frame(lowest + 1)
    error = errors(step(choice), frame.ring, frame.vectors, lowest + 1)["error"]
    assert all(power >= lowest for element in error for power in element.parts)
    vectors = rate(lowest + 1)
    terms = {}
    for power in (lowest, lowest + 1):
        found = invariants.invariants(frame, [element.parts.get(power, frame.ring.zero) for element in error])
        terms[power] = [sp.Rational(x) for x in invariants.matrix(found, vectors)]
    left = []
    with mpmath.workdps(60):
        for h in (Fraction(1, 1000), Fraction(1, 2000)):
            computed = one_step(choice, vectors, h)
            predicted = [
                sum(
                    exact.number(Fraction(int(c[k].p), int(c[k].q))) * exact.number(h) ** p
                    for p, c in terms.items()
                )
                for k in range(9)
            ]
            off = max(abs(a - b) for a, b in zip(computed, predicted, strict=True))
            left.append(off / max(map(abs, computed)))
    assert left[0] < mpmath.mpf("1e-4")
    # Relative to the error two powers are known: what is left falls with the square of the step.
    assert float(mpmath.log(left[0] / left[1], 2)) == pytest.approx(2, abs=0.1)


RING, X, Y = sp.ring("x y", sp.QQ)
TOP = 5
H = sp.Symbol("h")
x, y = sp.symbols("x y")


def number(value: sp.Rational) -> Powers:
    return Powers(RING, {0: RING(RING.domain.from_sympy(sp.sympify(value)))}, TOP)


def evaluated(expression: sp.Expr) -> sp.Expr:
    """Return an expression of a = h x and b = h^2 y as a series."""
    values = {"a": Powers(RING, {1: X}, TOP), "b": Powers(RING, {2: Y}, TOP)}
    made = algebra.evaluate(expression, values, number, function)
    assert isinstance(made, Powers)
    return sum(part.as_expr() * H**power for power, part in made.parts.items())


def expected(expression: sp.Expr) -> sp.Expr:
    replaced = expression.subs({sp.Symbol("a", real=True): H * x, sp.Symbol("b", real=True): H**2 * y})
    if replaced.has(sp.sinc):  # SymPy has no series of it
        (argument,) = {part.args[0] for part in replaced.atoms(sp.sinc)}
        replaced = sp.sin(argument).series(H, 0, TOP + 2).removeO() / argument
    return sp.series(sp.expand(replaced), H, 0, TOP + 1).removeO()


a, b = sp.symbols("a b", real=True)


@pytest.mark.long
@pytest.mark.parametrize(
    "expression",
    [
        a * b - 3 * a**2 + sp.Rational(1, 7),
        (1 + a) ** 5,
        1 / (1 + a - b),
        (2 + b) / (3 - a) ** 2,
        sp.sqrt(4 + a),
        1 / sp.sqrt(1 + a**2 + b),
        sp.cos(a + b),
        sp.sin(a) * (1 + b),
        sp.sinc(a / 2),
        sp.asin(a - b) + sp.atan2(a, 1 + b),
        (4 + a) ** sp.Rational(3, 2),
        sp.Max(a**2, 1) + sp.Piecewise((b, a > 1), (a, True)),
    ],
    ids=str,
)
def test_expressions_give_their_series(expression):
    wanted = a - a + (1 + a if expression.has(sp.Max) else 0)
    wanted = expected(wanted if expression.has(sp.Max) else expression)
    assert sp.expand(evaluated(expression) - wanted) == 0


def test_even_functions_of_a_root_are_series():
    angle = sp.sqrt(a**2 + b**2)
    made = evaluated(sp.cos(angle / 2) + sp.sinc(angle))
    square = (H * x) ** 2 + (H**2 * y) ** 2
    wanted = sum(
        sp.Rational((-1) ** k) * (square / 4) ** k / sp.factorial(2 * k)
        + sp.Rational((-1) ** k) * square**k / sp.factorial(2 * k + 1)
        for k in range(5)
    )
    cut = sum(sp.expand(wanted).coeff(H, power) * H**power for power in range(TOP + 1))
    assert sp.expand(made - cut) == 0


@pytest.mark.parametrize(
    ("expression", "says"),
    [
        (1 / a, "begins with 0"),
        (sp.sqrt(2 + a), "no series as its root"),
        (sp.sqrt(a**2 + b) + a, "root of a series that begins with 0"),
        (sp.sqrt(a**2 + b) + sp.sqrt(a), "root of a series that begins with 0"),
        (sp.sqrt(a**2 + b) * sp.sqrt(b), "root of a series that begins with 0"),
        (sp.sin(sp.sqrt(a)), "root of a series that begins with 0"),
        ((a**2 + b) ** sp.Rational(3, 2), "an odd power of it"),
        (a ** sp.Rational(1, 3), "the power 1/3"),
        (sp.cos(1 + a), "no series with rational coefficients"),
        (sp.sin(1 + a), "sin is no power series"),
        (sp.acos(a), "acos is no power series"),
        (sp.pi * a, "pi is no root of a polynomial"),
        (sp.atan2(a, b), "does not begin on the first axis"),
        (sp.atan2(1 + a, b), "atan2 is no power series"),
        (sp.Max(a, b), "at its very limit"),
        (sp.Piecewise((1, a > 0), (2, True)), "at its very limit"),
    ],
    ids=str,
)
def test_missing_series_is_reported(expression, says):
    with pytest.raises(ArithmeticError, match=says):
        evaluated(expression)


def test_an_odd_power_of_a_root_is_no_series():
    root = function(sp.sqrt(sp.Symbol("square")), [Powers(RING, {2: X * X}, TOP)])
    assert (root**2).parts == {2: X**2}
    with pytest.raises(ArithmeticError, match="odd power"):
        root**3
