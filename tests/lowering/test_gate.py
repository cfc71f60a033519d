"""The gate from SymPy to programs, expression by expression."""

from fractions import Fraction

import pytest
import sympy as sp

from strapgen.ir.program import Constant, Operation, Program, Reference, walk
from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.lowering import lower

X, Y, Z = sp.symbols("x y z", real=True)
x, y, z = (Reference(name) for name in "xyz")


def kernel(*expressions) -> Kernel:
    build = KernelBuilder()
    build.input(Signal("point", (3,), ("x", "y", "z")))
    names = tuple(f"r_{k}" for k in range(len(expressions)))
    build.output(Signal("result", (len(names),), names), expressions)
    return build.kernel("made-up", "Made up", "this test")


def lowered(*expressions) -> Program:
    return lower(kernel(*expressions))


def tree(expression):
    """Return the only assignment's tree."""
    (assignment,) = lowered(expression).body
    return assignment.value


def operation(kind, *arguments):
    return Operation(kind, arguments)


def constant(*value):
    return Constant(Fraction(*value))


@pytest.mark.parametrize(
    "expression",
    [
        X - Y,
        -X - Y - Z,
        1 - X,
        X / 3 - Y / 3 + Z - sp.Rational(1, 2),
        (X + Y) * (X - Y) / 7,
        -X * Y / Z,
        1 / X,
        -1 / X,
        sp.Rational(2, 3) / (X * Y),
        X / Y**3,
        (X + Y) ** 11 * Z,
        X**7 - X**6 + X**5 - 3,
        (X + 1) ** -4,
        X * (Y - Z) ** 2 / (2 + X),
        sp.Max(X, Y, Z) + sp.Max(0, X - Y),
        sp.sqrt((X - Y) ** 2) * Z - abs(X),
        sp.Piecewise((X, X >= Y), (Y, True)),
        sp.Piecewise((X, X > Y), (Y, True)),
        sp.Piecewise((X, X <= Y), (Y, True)),
        sp.Piecewise((X, X < Y), (Y, True)),
        sp.Piecewise((X * Z, X > Y), (Y * Z, Z >= X + Y), (Z, Y < 0), (X + Y, True)),
    ],
    ids=str,
)
def test_rational_expressions_keep_their_values(expression):
    program = lowered(expression, expression * Z + 1)
    for values in ((3, 5, 7), (5, 3, -7), (-5, -3, 2), (2, 2, 2), (-1, 4, 3), (4, -9, 1)):
        point = dict(zip("xyz", map(Fraction, values), strict=True))
        exact = expression.subs({symbol: sp.Rational(point[str(symbol)]) for symbol in (X, Y, Z)})
        if not exact.is_finite:
            continue
        value = Fraction(int(exact.p), int(exact.q))
        assert program.run(point) == {"result": [value, value * point["z"] + 1]}


def test_a_pure_number_is_added_last():
    # 1 + x + y would be rounded twice at the size of 1.
    assert tree(1 + X + Y) == operation("add", operation("add", x, y), constant(1))
    assert tree(X - 1) == operation("subtract", x, constant(1))
    assert tree(sp.Rational(1, 2) - X) == operation("subtract", constant(1, 2), x)


def test_terms_with_one_coefficient_are_gathered():
    # x/3 - y/3 is one multiplication
    assert tree(X / 3 - Y / 3) == operation("multiply", constant(1, 3), operation("subtract", x, y))
    assert lowered(X / 6 + Y / 3 + Z / 6).operations["multiply"] == 2


def test_signs_become_subtractions():
    assert tree(X - Y) == operation("subtract", x, y)
    assert tree(-X - Y) == operation("negate", operation("add", x, y))
    assert tree(-X * Y) == operation("negate", operation("multiply", x, y))


def test_a_quotient_divides_once():
    assert tree(X / (Y * Z)) == operation("divide", x, operation("multiply", y, z))


@pytest.mark.parametrize(("exponent", "multiplications"), [(2, 1), (3, 2), (4, 2), (7, 4), (8, 3), (16, 4)])
def test_powers_are_multiplied_by_squaring(exponent, multiplications):
    program = lowered(X**exponent)
    assert program.operations["multiply"] == multiplications
    assert program.run({"x": Fraction(3), "y": 0, "z": 0}) == {"result": [3**exponent]}


def test_a_power_of_a_sum_computes_the_sum_once():
    program = lowered((X + Y) ** 2)
    assert (program.operations["add"], program.operations["multiply"]) == (1, 1)


def test_roots_and_functions():
    assert tree(sp.sqrt(X)) == operation("sqrt", x)
    assert tree(1 / sp.sqrt(X)) == operation("divide", constant(1), operation("sqrt", x))
    assert tree(sp.sin(X)) == operation("sin", x)
    assert tree(sp.cos(X)) == operation("cos", x)
    assert tree(sp.sinc(X)) == operation("sinc", x)
    assert tree(sp.atan2(Y, X)) == operation("atan2", y, x)


def test_symbols_need_no_temporaries():
    program = lowered(X, 7, sp.Rational(-1, 3), -X)
    assert program.outputs[0].nodes[:3] == (x, constant(7), constant(-1, 3))
    assert [assignment.name for assignment in program.body] == ["r_3"]


def test_a_common_subexpression_is_computed_once():
    program = lowered(X * Y + Z, X * Y - Z, sp.sin(X * Y))
    assert program.operations["multiply"] == 1
    assert sum(isinstance(n, Operation) and n.kind == "sin" for a in program.body for n in walk(a.value)) == 1


@pytest.mark.parametrize(
    ("expression", "named"),
    [
        (sp.tan(X), "tan"),
        (sp.exp(X) + 1, "exp"),
        (sp.Function("wobble")(X), "wobble"),
        (sp.Float("0.5") * X, "Float"),
        (sp.I * X, "ImaginaryUnit"),
        (sp.cbrt(X), "1/3"),
        (X ** sp.Rational(3, 2), "3/2"),
        (X**Y, "y of x"),
        (sp.Piecewise((X, sp.Eq(X, Y)), (Z, True)), "Eq"),
        (sp.Piecewise((X, (X > 0) & (Y > 0)), (Z, True)), "&"),
    ],
    ids=str,
)
def test_unknown_functions_are_named(expression, named):
    with pytest.raises(NotImplementedError, match=named):
        lowered(expression)


def test_unknown_functions_are_found_in_a_stage():
    build = KernelBuilder()
    v = build.scalar(Signal.scalar("x"))
    part = build.value("part", sp.log(v))
    build.output(Signal.scalar("r"), [part**2])
    with pytest.raises(NotImplementedError, match="log"):
        lower(build.kernel("made-up", "Made up", "this test"))


def test_a_stage_that_nobody_needs_is_not_computed():
    build = KernelBuilder()
    v = build.scalar(Signal.scalar("x"))
    build.value("unused", sp.sin(v))
    build.output(Signal.scalar("r"), [build.value("needed", v + 1) ** 2])
    program = lower(build.kernel("made-up", "Made up", "this test"))
    assert [assignment.name for assignment in program.body] == ["needed", "r"]
