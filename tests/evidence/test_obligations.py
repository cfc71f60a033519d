"""What the walk through C notices, on small functions whose overflow is known by hand."""

import pytest

pytest.importorskip("z3")
pytest.importorskip("pycparser")

from strapgen.evidence.overflow.c_types import MODELS
from strapgen.evidence.overflow.obligations import KernelStatements
from strapgen.evidence.overflow.parsed import ParsedSource

LONG, SHORT = MODELS["64-bit processor"], MODELS["16-bit int"]
HELPERS = """
static int64_t f_shr(int64_t x, int n) { return (x < 0) ? ~(~x >> n) : (x >> n); }
static int32_t f_fit(int64_t x, int n) { return (int32_t)((x < 0) ? ~(~x >> n) : (x >> n)); }
static int32_t f_rt(int64_t square) { return (int32_t)square; }
static int64_t f_div(int64_t numerator, int64_t denominator)
{
    const int64_t top = (numerator < 0) ? -numerator : numerator;
    const int64_t below = (denominator < 0) ? -denominator : denominator;
    const int64_t quotient = (top + (below / 2)) / below;
    return ((numerator < 0) != (denominator < 0)) ? -quotient : quotient;
}
static int f_out(int32_t x, int32_t limit) { return (x < -limit) || (x > limit); }
"""


def opened(body, ranges=None, model=LONG, word=32):
    """Return what is not proved of a function of the two words a[0] and a[1]."""
    memory = f"int{word}_t"
    text = (
        f"#include <stdint.h>\n{HELPERS}\nint f(const {memory} a[2], int32_t b[1]) {{ {body} return 0; }}\n"
    )
    functions = ParsedSource({"f.c": text}, "f.c").functions
    return KernelStatements(functions, "f", model, ranges or {}, True, 200_000).obligations()


CHECKED = (
    "const int32_t x = a[0]; const int32_t y = a[1]; if (f_out(x, 1000) || f_out(y, 1000)) { return 1; } "
)


@pytest.mark.parametrize(
    ("body", "word"),
    [
        pytest.param("b[0] = a[0] + a[1];", 32, id="sum"),
        pytest.param("b[0] = a[0] - a[1];", 32, id="difference"),
        pytest.param("b[0] = -a[0];", 32, id="negation of the least number"),
        pytest.param("const int64_t p = a[0] * a[1];", 32, id="product in words"),
        pytest.param("b[0] = (int32_t)((int64_t)a[0] + a[1]);", 32, id="narrowing"),
        pytest.param("b[0] = f_fit((int64_t)a[0] * a[1], 30);", 32, id="too small a shift"),
        pytest.param("b[0] = f_rt(a[0]);", 32, id="root of a negative number"),
        pytest.param("const int64_t q = f_div(1, a[0]);", 32, id="quotient by zero"),
        pytest.param(f"{CHECKED} b[0] = (x * y) * 3000;", 32, id="product in the checked range"),
        pytest.param(
            f"{CHECKED} int32_t m; if (x > y) {{ m = x; }} else {{ m = y; }} b[0] = m * 2147484;",
            32,
            id="branch",
        ),
    ],
)
def test_what_can_overflow_is_open(body, word):
    """Each of these fails for some input."""
    assert opened(body, word=word)


@pytest.mark.parametrize(
    "body",
    [
        pytest.param("b[0] = f_fit((int64_t)a[0] + a[1], 1);", id="mean"),
        pytest.param(f"{CHECKED} b[0] = x * y * 2000;", id="product in the checked range"),
        pytest.param(f"{CHECKED} b[0] = f_rt((int64_t)x * x + (int64_t)y * y);", id="length"),
        pytest.param(
            f"{CHECKED} const int64_t s = (int64_t)x * x + 1; b[0] = f_fit(f_div((int64_t)y * y, s), 0);",
            id="quotient",
        ),
        pytest.param(f"{CHECKED} int32_t m = x; if (y > m) {{ m = y; }} b[0] = f_rt(m - x);", id="maximum"),
        pytest.param(
            "const int64_t r = (int64_t)a[0] + a[1]; if ((r < -5) || (r > 5)) { return 2; } b[0] = f_fit(r, 0);",
            id="guard",
        ),
    ],
)
def test_what_cannot_overflow_is_proved(body):
    """Each of these holds for every input."""
    assert not opened(body)


def test_a_relation_between_values_is_used():
    """x^2 - 2xy + y^2 is not negative, which no interval of a term shows."""
    body = f"{CHECKED} b[0] = f_rt((int64_t)x * x - (int64_t)x * y * 2 + (int64_t)y * y);"
    assert not opened(body)
    assert opened(body.replace("y * 2", "y * 3"))


def test_what_holds_in_a_branch_is_not_used_outside():
    """In the branch x is positive; behind it, it need not be."""
    body = f"{CHECKED} int32_t m = 0; if (x > 0) {{ m = f_fit(x, 1); }} b[0] = f_rt(%s);"
    assert not opened(body % "m")
    assert opened(body % "x")
    assert opened(body % "m + x")


def test_int_of_16_bits_computes_in_16_bits():
    """The product of two short words is one of int, which has 32 bits or 16."""
    body = "const int32_t p = a[0] * a[1];"
    assert not opened(body, word=16)
    assert opened(body, word=16, model=SHORT)
    assert not opened("const int32_t p = (int32_t)a[0] * a[1];", word=16, model=SHORT)


def test_the_range_of_an_output_is_an_obligation():
    """An output beyond the stated range is open, though nothing overflows."""
    assert not opened(f"{CHECKED} b[0] = x + y;", {"b[0]": (-2000, 2000)})
    assert opened(f"{CHECKED} b[0] = x + y;", {"b[0]": (-2000, 1999)})


def test_a_stated_range_that_does_not_hold_is_not_used():
    """The range of a value is a hint: what is computed from it stays open where the hint is wrong."""
    body = f"{CHECKED} const int32_t s = x + y; b[0] = s * 2000000;"
    assert opened(body, {"s": (-1000, 1000)})
