"""Kernels: stages, outputs, exact evaluation."""

from fractions import Fraction

import pytest
import sympy as sp

from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder, Stage, symbols


def two_stages() -> Kernel:
    """Return r = (x + y)^2 / 2 and s = r - y, in two stages."""
    build = KernelBuilder()
    v = build.input(Signal("pair", (2,), ("x", "y")))
    total = build.value("total", v[0] + v[1], "the sum")
    square = build.value("square", total**2)
    r = build.output(Signal.scalar("r"), [square / 2])
    build.output(Signal("more", (2,), ("s", "seven")), [r[0] - v[1], 7])
    return build.kernel("two-stages", "Two stages", "this test")


def of_one(expression) -> Kernel:
    build = KernelBuilder()
    x = build.scalar(Signal.scalar("x"))
    build.output(Signal.scalar("r"), [expression(x)])
    return build.kernel("of-one", "Of one", "this test")


def test_symbols_have_the_signals_shape():
    assert symbols(Signal.matrix("attitude", "C"))[1, 2] == sp.Symbol("C_23", real=True)
    assert symbols(Signal.vector("rate", "w")).shape == (3, 1)
    assert symbols(Signal.scalar("time")).shape == (1, 1)
    # Increments are an array of rows.
    assert symbols(Signal("pairs", (2, 2), ("a", "b", "c", "d"))).row(1) == sp.Matrix(
        [sp.symbols("c d", real=True)]
    )


def test_the_builder_keeps_everything_in_order():
    kernel = two_stages()
    assert kernel.identifier == "two_stages"
    assert [s.name for s in kernel.inputs] == ["pair"]
    assert [s.signal.name for s in kernel.stages] == ["total", "square"]
    assert [s.signal.name for s in kernel.outputs] == ["r", "more"]
    assert kernel.stages[0].signal.meaning == "the sum"
    assert all(isinstance(e, sp.Expr) for stage in kernel.outputs for e in stage.expressions)


def test_expand_substitutes_all_stages():
    x, y = sp.symbols("x y", real=True)
    expanded = two_stages().expand()
    assert expanded == {"r": [(x + y) ** 2 / 2], "more": [(x + y) ** 2 / 2 - y, 7]}


def test_expand_is_exact():
    values = {"x": Fraction(1, 3), "y": Fraction(1, 7)}
    assert two_stages().expand(values) == {
        "r": [sp.Rational(50, 441)],
        "more": [sp.Rational(50, 441) - sp.Rational(1, 7), 7],
    }


def test_expand_needs_every_input():
    with pytest.raises(KeyError, match="y"):
        two_stages().expand({"x": 1})


def test_polynomials():
    ring, x, y = sp.ring("x y", sp.QQ)
    r = (x + y) ** 2 * sp.QQ(1, 2)
    assert two_stages().polynomials() == {"r": [r], "more": [r - y, ring(7)]}


@pytest.mark.parametrize(
    "expression",
    [
        lambda x: 1 / x,
        lambda x: 1 / (1 + x),
        sp.sqrt,
        sp.sin,
        lambda x: sp.Max(1, x),
        lambda x: sp.Piecewise((x, x > 1), (1, True)),
        lambda x: sp.sqrt(3) * x,
        lambda x: sp.sqrt(3),
    ],
)
def test_what_is_no_polynomial_is_refused(expression):
    with pytest.raises(TypeError, match="of-one"):
        of_one(expression).polynomials()


def test_every_element_has_an_expression():
    stage = Stage(Signal.vector("rate", "w"), (sp.Integer(1), sp.Integer(2)))
    kernel = Kernel("short", "Short", "this test", (), (stage,))
    with pytest.raises(ValueError, match="shorter"):
        kernel.expand({})
