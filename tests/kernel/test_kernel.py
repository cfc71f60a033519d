"""Kernels: stages, outputs, exact evaluation."""

from __future__ import annotations

from fractions import Fraction

import pytest
import sympy as sp

from strapgen.ir.exceptions import InputError
from strapgen.ir.signals import Signal
from strapgen.kernel.derivatives import add_tangents
from strapgen.kernel.kernel import Kernel, KernelBuilder, Stage, evaluate_stages, symbols
from strapgen.kernel.reading import expression


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
def test_other_functions_than_polynomials_are_refused(expression):
    with pytest.raises(TypeError, match="of-one"):
        of_one(expression).polynomials()


def test_every_element_has_an_expression():
    stage = Stage(Signal.vector("rate", "w"), (sp.Integer(1), sp.Integer(2)))
    kernel = Kernel("short", "Short", "this test", (), (stage,))
    with pytest.raises(ValueError, match="shorter"):
        kernel.expand({})


def test_changes_are_derivatives_along_the_change_of_the_inputs():
    build = KernelBuilder()
    x, y, dx, dy, t = (build.scalar(Signal.scalar(name)) for name in ("x", "y", "dx", "dy", "t"))
    product = build.value("product", x * y)
    square = build.value("square", product**2 + x + 2)
    root = build.value("root", 1 / sp.sqrt(square))
    kept = build.value("kept", 3 * t)
    before = list(build.stages)
    changes = add_tangents(build, before, {x: dx, y: dy}, "change", "m/s")
    assert kept not in changes
    along = {s: sp.Symbol(s.name, real=True) for s in (x, y, dx, dy, t)}
    computed = evaluate_stages(build.stages, {s.name: s for s in along})
    for name in (product, square, root):
        value = computed[name.name]
        expected = sp.diff(value, x) * dx + sp.diff(value, y) * dy
        assert sp.simplify(computed[changes[name].name] - expected) == 0
    assert not any(stage.expressions[0].has(sp.sqrt(square)) for stage in build.stages[len(before) :])


def test_changes_that_are_symbols_have_no_stage_of_their_own():
    build = KernelBuilder()
    x, dx = build.scalar(Signal.scalar("x")), build.scalar(Signal.scalar("dx"))
    same = build.value("same", x)
    changes = add_tangents(build, list(build.stages), {x: dx}, "change", "m/s")
    assert changes[same] == dx
    assert len(build.stages) == 1


def test_units_of_changes():
    build = KernelBuilder()
    x = build.input(Signal.vector("x", "x", unit="rad"))
    dx = build.input(Signal.vector("dx", "dx", unit="m/s"))
    build.stage(Signal.vector("angle", "angle", unit="rad"), 2 * x)
    build.stage(Signal.scalar("square"), [x[0] ** 2])
    add_tangents(build, list(build.stages), dict(zip(x, dx, strict=True)), "v", "m/s")
    assert [stage.signal.unit for stage in build.stages] == ["rad", "1", "m/s", "1"]
    assert build.stages[2].signal.elements == ("angle_v_x", "angle_v_y", "angle_v_z")


A, B = sp.symbols("a b", real=True)
NAMES = {"a": A, "b": B}


@pytest.mark.parametrize(
    "value",
    [
        sp.Rational(-57, 80),
        (A - B) ** 3 / (2 * A + sp.sqrt(3)),
        sp.sqrt(1 + sp.sqrt(2)) * A**-2,
        sp.sin(2 * A) * sp.cos(B) - sp.pi / 7,
    ],
)
def test_expressions_printed_by_sympy_are_read(value):
    assert expression("value", sp.sstr(value), NAMES) == value


def test_decimals_are_exact():
    assert expression("value", "0.1 + 2e-1*a", NAMES) == sp.Rational(1, 10) + A / 5


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("c + 1", "c is not known; known are a, b, pi"),
        ("a +", "an expression such as"),
        ("1/(a - a)", "it divides by zero"),
        ("0**-1", "it divides by zero"),
        ("a**b", "a power must be whole"),
        ("a**1000", "at most 100"),
        ("1e999", "an exponent of at most 100"),
        ("sqrt(1, 2, 3, 4)", "another number of arguments"),
        ("a.real", "are allowed"),
        ("'a'", "are allowed"),
        ("[a]", "are allowed"),
        ("a if b else 1", "are allowed"),
        ("eval('1')", "are allowed"),
        (0.5, "is of type float"),
        ("(" * 3000 + "1" + ")" * 3000, "value is"),
    ],
)
def test_anything_else_is_refused_in_one_line(text, reason):
    with pytest.raises(InputError) as refusal:
        expression("value", text, NAMES)
    assert reason in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 300
