"""Faults that are none of the coning coefficients, each in several integrators, beside right ones that are near."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from strapgen.firmware.check_code import coning_causes as causes
from strapgen.firmware.check_code import ladder
from strapgen.firmware.check_code.bridge import read_source
from strapgen.firmware.check_code.foreign import ENDS, Convention, ForeignStep
from strapgen.firmware.check_code.ladder import cone
from strapgen.firmware.check_code.rotation import FIRST_ORDER

#: Parts of the integrators. A state of four elements has the scalar part first.
PARTS = r"""
#include <math.h>
#ifndef NUMBER
#define NUMBER double
#endif
#define FOR(i, n) for (int i = 0; i < (n); i++)
static void cross(const NUMBER *a, const NUMBER *b, NUMBER *c)
{
    c[0] = a[1] * b[2] - a[2] * b[1]; c[1] = a[2] * b[0] - a[0] * b[2]; c[2] = a[0] * b[1] - a[1] * b[0];
}
static void product(const NUMBER *q, const NUMBER *p, NUMBER *r)
{
    r[0] = q[0] * p[0] - q[1] * p[1] - q[2] * p[2] - q[3] * p[3];
    r[1] = q[1] * p[0] + q[0] * p[1] + q[2] * p[3] - q[3] * p[2];
    r[2] = q[2] * p[0] + q[0] * p[2] + q[3] * p[1] - q[1] * p[3];
    r[3] = q[3] * p[0] + q[0] * p[3] + q[1] * p[2] - q[2] * p[1];
}
static void exact(const NUMBER *v, NUMBER *p)
{
    const NUMBER a = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]), s = a > 1e-5 ? sin(a / 2) / a : 0.5 - a * a / 48;
    p[0] = cos(a / 2); FOR(i, 3) p[1 + i] = s * v[i];
}
static void normalize(NUMBER *q)
{
    const NUMBER n = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    FOR(i, 4) q[i] /= n;
}
static NUMBER before[3];
void begin(void) { FOR(i, 3) before[i] = 0; }
/* The rotation vector of a call with one sample. */
static void corrected(const NUMBER *d, NUMBER *v)
{
    NUMBER c[3];
    cross(before, d, c);
    FOR(i, 3) { v[i] = d[i] + (COEFFICIENT) * c[i]; before[i] = d[i]; }
}
"""
#: One sample a call, a quaternion that is an argument: what turns it and what follows are left open.
QUATERNION = (
    PARTS
    + """
void step(NUMBER q[4], const NUMBER d[3])
{
    NUMBER v[3], p[4], r[4];
    corrected(d, v);
    TURN
    FOR(i, 4) q[i] = r[i];
    AFTER
}
"""
)
#: The same with a matrix, whose rows turn by what is left open.
MATRIX = (
    PARTS
    + """
void step(NUMBER m[3][3], const NUMBER d[3])
{
    NUMBER v[3], n[3][3], t[3][3];
    corrected(d, v);
    const NUMBER a = v[0] * v[0] + v[1] * v[1] + v[2] * v[2], w = sqrt(a);
    const NUMBER s = a > 1e-8 ? sin(w) / w : 1 - a / 6, c = a > 1e-8 ? (1 - cos(w)) / a : 0.5 - a / 24;
    (void)s; (void)c; (void)n;
    const NUMBER k[3][3] = {{0, -v[2], v[1]}, {v[2], 0, -v[0]}, {-v[1], v[0], 0}};
    FOR(i, 3) FOR(j, 3) { t[i][j] = i == j; t[i][j] += FORMULA; }
    UPDATE
    AFTER
}
"""
)
#: A matrix that leads from body to reference turns by its rows, one that leads from reference to body by its columns.
PUT = " FOR(i, 3) FOR(j, 3) m[i][j] = n[i][j];"
ROWS = "FOR(i, 3) FOR(j, 3) { n[i][j] = 0; FOR(l, 3) n[i][j] += m[i][l] * t[l][j]; }" + PUT
COLUMNS = "FOR(i, 3) FOR(j, 3) { n[i][j] = 0; FOR(l, 3) n[i][j] += t[l][i] * m[l][j]; }" + PUT
EXACT_MATRIX = "s * k[i][j] + c * (v[i] * v[j] - (i == j) * a)"
#: Makes the rows orthogonal one after the other, of length 1.
GRAM_SCHMIDT = """
    FOR(i, 3) {
        FOR(j, i) { NUMBER e = 0; FOR(l, 3) e += m[i][l] * m[j][l]; FOR(l, 3) m[i][l] -= e * m[j][l]; }
        NUMBER e = 0; FOR(l, 3) e += m[i][l] * m[i][l]; FOR(l, 3) m[i][l] /= sqrt(e);
    }
"""
EXACT = "exact(v, p); product(q, p, r);"
FIRST = "p[0] = 1; FOR(i, 3) p[1 + i] = v[i] / 2; product(q, p, r);"
FULL = "1.0 / 12"
TAKES_4, TAKES_9 = "state[4], increments[3] -> state[4]", "state[3][3], increments[3] -> state[3][3]"
FIRST_SCALAR = Convention("first")
TO_BODY = Convention(sense="reference-to-body")


def quaternion(turn: str = EXACT, after: str = "", coefficient: str = FULL) -> str:
    return QUATERNION.replace("TURN", turn).replace("AFTER", after).replace("COEFFICIENT", coefficient)


def matrix(formula: str = EXACT_MATRIX, update: str = ROWS, after: str = "", coefficient: str = FULL) -> str:
    text = MATRIX.replace("FORMULA", formula).replace("UPDATE", update)
    return text.replace("AFTER", after).replace("COEFFICIENT", coefficient)


def rates(scale: str = "dt", before: str = "", **parts: str) -> str:
    """Return the function of a quaternion that takes rates."""
    return (
        quaternion(**parts)
        .replace("const NUMBER d[3])", "const NUMBER g[3], NUMBER dt)")
        .replace(
            "corrected(d, v);", f"NUMBER d[3]; FOR(i, 3) d[i] = g[i] * ({scale}); {before} corrected(d, v);"
        )
    )


def failed(outcome) -> list[str]:
    return [finding.name for finding in outcome.findings if finding.holds is False]


def in_float(text: str) -> str:
    return "#define NUMBER float\n" + text


def long(*values, **more):
    return pytest.param(*values, marks=pytest.mark.long, **more)


THIRD = (
    "const NUMBER a = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]; p[0] = 1 - a / 8;"
    "FOR(i, 3) p[1 + i] = v[i] * (0.5 - a / 48); product(q, p, r);"
)
NORMALIZED = "normalize(q);"
EVENLY = (
    "const NUMBER n = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]; FOR(i, 4) q[i] *= 1.5 - 0.5 * n;"
)
RIGHT = {
    "quaternion": (quaternion(), TAKES_4, FIRST_SCALAR),
    "third order": (quaternion(THIRD, NORMALIZED), TAKES_4, FIRST_SCALAR),
    "normalized to first order": (quaternion(after=EVENLY), TAKES_4, FIRST_SCALAR),
    "matrix": (matrix(), TAKES_9, Convention()),
    "matrix made orthogonal": (matrix(after=GRAM_SCHMIDT), TAKES_9, Convention()),
    "matrix to body": (matrix(update=COLUMNS), TAKES_9, TO_BODY),
    "coefficient of three digits": (quaternion(coefficient="0.0833"), TAKES_4, FIRST_SCALAR),
}


@pytest.mark.long
@pytest.mark.parametrize("precision", ["double", "float"])
@pytest.mark.parametrize("name", RIGHT)
def test_a_right_integrator_is_accused_of_nothing(outcome, name, precision):
    text, arguments, convention = RIGHT[name]
    text = in_float(text) if precision == "float" else text
    checked = outcome(text, arguments, convention, init="begin", precision=precision)
    assert (failed(checked), checked.cause) == ([], None)
    assert checked.order == pytest.approx(3, abs=0.02)
    assert checked.drift_deg_h == pytest.approx(9.783, abs=0.06)
    assert checked.coefficient_ratio == pytest.approx(1, abs=0.001)


# The rotation itself

TURNS_BY = ": it turns by {} in place of d"
SECOND = "const NUMBER a = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]; p[0] = 1 - a / 8; FOR(i, 3) p[1 + i] = v[i] / 2;"
SECOND += "product(q, p, r);"


@pytest.mark.parametrize(
    ("text", "arguments", "convention", "cause", "order"),
    [
        (
            quaternion(FIRST, NORMALIZED),
            *(TAKES_4, FIRST_SCALAR, FIRST_ORDER + TURNS_BY.format("2 atan(d/2)"), 2),
        ),
        (matrix("k[i][j]", after=GRAM_SCHMIDT), TAKES_9, Convention(), FIRST_ORDER, 1),
        long(matrix("k[i][j]", COLUMNS, GRAM_SCHMIDT), TAKES_9, TO_BODY, FIRST_ORDER, 1),
        long(
            quaternion(SECOND, NORMALIZED),
            *(TAKES_4, FIRST_SCALAR, "the rotation itself is of second order", 2),
        ),
        long(
            matrix("k[i][j] + (v[i] * v[j] - (i == j) * a) / 2", after=GRAM_SCHMIDT),
            *(TAKES_9, Convention(), "the rotation itself is of second order", 2),
        ),
    ],
)
def test_a_rotation_of_low_order_is_named(outcome, text, arguments, convention, cause, order):
    checked = outcome(text, arguments, convention, init="begin")
    assert checked.cause == cause
    assert checked.order == pytest.approx(order, abs=0.1)
    assert {"rotation", "order"} <= {*failed(checked)} and "coefficients" not in failed(checked)
    single = outcome(in_float(text), arguments, convention, init="begin", precision="float")
    assert (single.cause, single.order) == (cause, order)


#: The elements of a product, which read the state s and the elements that are replaced already as it says.
ELEMENTS = [
    "q[0] = s0 * p[0] - s1 * p[1] - s2 * p[2] - s3 * p[3];",
    "q[1] = s1 * p[0] + s0 * p[1] + s2 * p[3] - s3 * p[2];",
    "q[2] = s2 * p[0] + s0 * p[2] + s3 * p[1] - s1 * p[3];",
    "q[3] = s3 * p[0] + s0 * p[3] + s1 * p[2] - s2 * p[1];",
]


def in_place(read: str = "", step: int = 1, formula: str = "exact(v, p);", only: int | None = None) -> str:
    """Return the update of a quaternion in place, which reads some elements after they have been replaced."""
    lines = [f"{formula} const NUMBER " + ", ".join(f"o{k} = q[{k}]" for k in range(4)) + "; (void)o3;"]
    for number, line in list(enumerate(ELEMENTS))[::step]:
        for k in range(4):
            early = str(k) in read and only in (None, number)
            line = line.replace(f"s{k}", f"q[{k}]" if early else f"o{k}")
        lines.append(line)
    return " ".join([*lines, "(void)o0; (void)o1; (void)o2; FOR(i, 4) r[i] = q[i];"])


IN_PLACE = {
    "all upwards": (quaternion(in_place("0123")), "elements 0, 1, 2"),
    "all downwards": (quaternion(in_place("0123", -1)), "elements 1, 2, 3"),
    "the scalar part": (quaternion(in_place("0")), "element 0"),
    "in one place": (quaternion(in_place("0", only=1)), "element 0"),
    "then normalized": (quaternion(in_place("0123"), NORMALIZED), "elements 0, 1, 2"),
    "of first order": (quaternion(in_place("0123", formula=FIRST), NORMALIZED), "elements 0, 1, 2"),
}
IN_ROWS = "FOR(i, 3) FOR(j, 3) { NUMBER x = 0; FOR(l, 3) x += m[i][l] * t[l][j]; m[i][j] = x; }"
IN_COLUMNS = "FOR(i, 3) FOR(j, 3) { NUMBER x = 0; FOR(l, 3) x += t[l][i] * m[l][j]; m[i][j] = x; }"
#: What a likely cause says of an update in place.
OF_RESULT = "of the result read in place of"


@pytest.mark.parametrize(
    "name",
    [
        IN_PLACE_NAME if IN_PLACE_NAME == "the scalar part" else long(IN_PLACE_NAME)
        for IN_PLACE_NAME in IN_PLACE
    ],
)
def test_an_update_of_a_quaternion_in_place_is_named(outcome, name):
    text, elements = IN_PLACE[name]
    for precision in ("double", "float"):
        written = in_float(text) if precision == "float" else text
        checked = outcome(written, TAKES_4, FIRST_SCALAR, init="begin", precision=precision)
        assert checked.cause.split(";")[0].startswith(f"{elements} {OF_RESULT}"), precision
        assert "correction" not in checked.cause
        assert "order" in failed(checked) and "coefficients" not in failed(checked)


@pytest.mark.long
@pytest.mark.parametrize("orthogonal", ["", GRAM_SCHMIDT])
def test_an_update_of_a_matrix_in_place_is_named(outcome, orthogonal):
    checked = outcome(matrix(update=IN_ROWS, after=orthogonal), TAKES_9, init="begin")
    assert checked.cause.startswith(f"columns 0, 1 {OF_RESULT}")
    checked = outcome(matrix(update=IN_COLUMNS, after=orthogonal), TAKES_9, TO_BODY, init="begin")
    # Of row 2 rows that are made orthogonal one after the other keep nothing.
    assert checked.cause.startswith(f"{'row 0' if orthogonal else 'rows 0, 1'} {OF_RESULT}")


@pytest.mark.parametrize(
    "text",
    [
        quaternion(in_place()),
        long(quaternion(in_place("3"))),
        long(quaternion(in_place("0", -1))),
    ],
)
def test_update_that_saves_needed_elements_passes(outcome, text):
    checked = outcome(text, TAKES_4, FIRST_SCALAR, init="begin")
    assert (checked.cause, failed(checked)) == (None, [])


@pytest.mark.long
def test_a_square_that_nothing_explains_has_no_cause(outcome):
    text = matrix(after="const NUMBER x = 0.2 * m[0][0] * v[1] * v[2]; m[0][1] += x; m[1][0] -= x;")
    checked = outcome(text, TAKES_9, init="begin")
    assert {"rotation", "order", "symmetry"} <= {*failed(checked)}
    assert checked.cause is None


# Sizes and units

RATES = "state[4], rates[3], dt -> state[4]"
FED = "rotations come out {} times as large as they are fed"


@pytest.mark.parametrize(
    ("scale", "cause"),
    [
        (
            "dt * 0.017453292519943295",
            "degrees for radians, it takes radians for degrees: " + FED.format("0.01745"),
        ),
        (
            "dt * 57.29577951308232",
            "degrees for radians, it turns radians into degrees: " + FED.format("57.3"),
        ),
        long("1", "it does not multiply rates by the sampling interval: " + FED.format(100)),
        long("2 * dt", FED.format(2)),
        long("dt * 60", FED.format(60)),
        long("1.05 * dt", FED.format(1.05)),
    ],
)
def test_a_wrong_size_of_rotations_is_named(outcome, scale, cause):
    checked = outcome(rates(scale), RATES, FIRST_SCALAR, init="begin", takes="rates")
    assert checked.cause == cause
    assert failed(checked)[0] == "axes"
    single = in_float(rates(scale))
    checked = outcome(single, RATES, FIRST_SCALAR, init="begin", takes="rates", precision="float")
    assert checked.cause == cause


@pytest.mark.long
def test_sizes_and_axes_that_differ_are_named_alone(outcome):
    arguments = (RATES, FIRST_SCALAR)
    checked = outcome(rates(before="d[2] *= 1.05;"), *arguments, init="begin", takes="rates")
    assert checked.cause == "rotations about x, y, z come out 1, 1, 1.05 times as large as they are fed"
    checked = outcome(rates(before="d[2] += 0.03 * d[0];"), *arguments, init="begin", takes="rates")
    assert checked.cause == "a small rotation about an axis turns about others too"
    checked = outcome(
        rates("dt * 57.29577951308232", "const NUMBER x = d[0]; d[0] = d[1]; d[1] = -x;"),
        *arguments,
        init="begin",
        takes="rates",
    )
    assert checked.cause.endswith("; rotations about x, y, z turn about -y, x, z")
    assert checked.cause.startswith("degrees for radians")


# The length of the state

LENGTHS = {
    "grows": (
        quaternion(after="FOR(i, 4) q[i] *= 1.00001;"),
        ["at rest", "norm"],
        "1.00009 at first, 1.06201",
    ),
    "explodes": (
        quaternion(after="FOR(i, 4) q[i] *= 1.01;"),
        ["at rest", "norm"],
        "1.09369 at first, 9.93996e+25",
    ),
    "begins with 2": (
        quaternion().replace("void begin(void) {", "void begin(NUMBER *q) { q[0] = 2;"),
        ["norm"],
        "2 at first, 2",
    ),
}


@pytest.mark.parametrize("name", ["grows", long("explodes"), long("begins with 2")])
def test_the_length_of_the_state_distorts_no_other_figure(outcome, name):
    text, fails, sizes = LENGTHS[name]
    checked = outcome(text, TAKES_4, FIRST_SCALAR, init="begin")
    assert failed(checked) == fails
    assert checked.cause == f"the state's length is off: {sizes} in the end"
    assert (checked.order, checked.drift_deg_h) == pytest.approx((3.0004, 9.78274), abs=1e-4)


@pytest.mark.long
def test_a_matrix_that_grows_is_read_as_the_rotation_near_it(outcome):
    checked = outcome(matrix(after="FOR(i, 3) FOR(j, 3) m[i][j] *= 1.00002;"), TAKES_9, init="begin")
    assert failed(checked) == ["at rest", "norm"]
    assert checked.cause.startswith("the state's length is off: 1.00018 at first, ")
    assert (checked.order, checked.drift_deg_h) == pytest.approx((3.0004, 9.78274), abs=1e-4)


# Frames and constant rates

#: Turns the attitude about reference axes by a rotation vector in rad a call.
FRAME = "const NUMBER w[3] = {%s}; NUMBER e[4], s[4]; exact(w, e); product(e, q, s); FOR(i, 4) q[i] = s[i];"
#: The rate of the earth at 100 Hz, at a latitude of 45 degrees: north and down, in rad a call.
EARTH = "-5.156e-7, 0, 5.156e-7"


@pytest.mark.parametrize("precision", ["double", "float"])
def test_a_frame_that_moves_is_named_with_its_rate(outcome, precision):
    text = quaternion(after=FRAME % EARTH)
    text = in_float(text) if precision == "float" else text
    checked = outcome(text, TAKES_4, FIRST_SCALAR, init="begin", precision=precision)
    assert failed(checked) == ["at rest"]
    said, _, parts = checked.cause.partition(" deg/h (")
    assert said == "the frame moves at a constant rate, 15.04"
    numbers = np.array(parts.partition(" about")[0].split(", "), float)
    np.testing.assert_allclose(numbers, [10.635, 0, -10.635], atol=0.0051)
    assert (checked.order, checked.drift_deg_h) == pytest.approx((3, 9.783), abs=2e-3)


def test_the_rate_of_a_frame_counts_the_samples_of_a_call(outcome):
    text = (
        PARTS.replace("COEFFICIENT", "0")
        + f"""
void step(NUMBER q[4], const NUMBER d[2][3])
{{
    NUMBER v[3], c[3], p[4], r[4];
    cross(d[0], d[1], c);
    FOR(i, 3) v[i] = d[0][i] + d[1][i] + 2.0 / 3 * c[i];
    exact(v, p); product(q, p, r); FOR(i, 4) q[i] = r[i];
    {FRAME % EARTH}
}}
"""
    )
    checked = outcome(text, "state[4], increments[2][3] -> state[4]", FIRST_SCALAR)
    # The same angle a call, of twice the duration.
    assert checked.cause.startswith("the frame moves at a constant rate, 7.52")


@pytest.mark.long
def test_rotating_frame_is_distinguished_from_added_rate(outcome):
    turning = "FOR(i, 3) FOR(j, 3) n[i][j] = m[i][j]; FOR(i, 3) { const double c = cos(1e-6), s2 = sin(1e-6);"
    turning += "m[i][0] = c * n[i][0] + s2 * n[i][1]; m[i][1] = c * n[i][1] - s2 * n[i][0]; }"
    checked = outcome(matrix(update=COLUMNS + turning), TAKES_9, TO_BODY, init="begin")
    assert checked.cause.startswith("the frame moves at a constant rate, 20.63 deg/h (")
    assert failed(checked) == ["at rest"]
    for precision in ("double", "float"):
        text = quaternion("FOR(i, 3) v[i] += i * 1e-6; " + EXACT)
        text = in_float(text) if precision == "float" else text
        checked = outcome(text, TAKES_4, FIRST_SCALAR, init="begin", precision=precision)
        assert checked.cause.startswith("a constant rate is added to that of the gyro, 46.12 deg/h (")
        assert "order" in failed(checked)


# Rates at instants

#: A function of rates at instants: the rotation vector of the interval is left open; g is the newest rate, e the last.
INSTANTS = (
    PARTS.replace("COEFFICIENT", "0")
    + """
void step(NUMBER q[4], const NUMBER g[K][3], NUMBER dt)
{
    FOR(k, K) {
        NUMBER v[3], c[3], p[4], r[4], e[3];
        FOR(i, 3) e[i] = before[i];
        cross(e, g[k], c);
        FOR(i, 3) { v[i] = VECTOR; before[i] = g[k][i]; }
        exact(v, p); product(q, p, r);
        FOR(i, 4) q[i] = r[i];
    }
}
"""
)
TRAPEZOID = "dt * (e[i] + g[k][i]) / 2 + dt * dt * c[i] / 12"


def instants(outcome, vector: str, takes: str, samples: int = 1):
    text = (
        INSTANTS.replace("VECTOR", vector).replace("K]", f"{samples}]").replace("(k, K)", f"(k, {samples})")
    )
    arguments = f"state[4], rates[{samples}][3], dt -> state[4]"
    return outcome(text, arguments, FIRST_SCALAR, init="begin", takes=takes)


@pytest.mark.parametrize("samples", [1, long(2), long(4)])
def test_rates_at_instants_are_told_from_means(outcome, samples):
    as_means = instants(outcome, TRAPEZOID, "rates", samples)
    words = "rates at instants are taken for means: its rates are those at the ends of the intervals"
    assert as_means.cause == f"{words}; --input instants fits, order 2.00"
    assert "delay" in failed(as_means)
    as_instants = instants(outcome, TRAPEZOID, ENDS, samples)
    delay = next(finding for finding in as_instants.findings if finding.name == "delay")
    assert delay.measured == pytest.approx(0, abs=1e-6)
    assert (as_instants.cause, failed(as_instants)) == (None, [])
    assert as_instants.order == pytest.approx(2, abs=0.02)
    assert (as_instants.closed_form_deg_h, as_instants.coefficients) == (None, ())


@pytest.mark.long
def test_other_delays_are_no_rate_at_an_instant(outcome):
    late = instants(outcome, "dt * e[i] + dt * dt * c[i] / 12", "rates")
    assert late.cause == "rotation one sample late"
    assert "delay" in failed(late) and late.coefficients == ()
    thirds = instants(outcome, "dt * (e[i] + 2 * g[k][i]) / 3 + dt * dt * c[i] / 12", "rates")
    assert thirds.cause == "rotation 0.33 samples late"
    averaged = quaternion().replace("v[i] = d[i]", "v[i] = (d[i] + before[i]) / 2")
    assert outcome(averaged, TAKES_4, FIRST_SCALAR, init="begin").cause == "rotation 0.5 samples late"


def test_means_that_are_taken_for_rates_at_instants_are_named(outcome):
    checked = instants(outcome, "dt * g[k][i] + dt * dt * c[i] / 12", ENDS)
    words = "means are taken for rates at instants: its rates are means over the intervals"
    assert checked.cause == f"{words}; --input rates fits, order 3.00"
    assert failed(checked) == ["delay", "order"]


# The sum of samples

#: The recursion of a delta angle: a is the sum of the samples before, `late` the one without the last of them.
RECURSION = (
    PARTS.replace("COEFFICIENT", "0")
    + """
void step(const NUMBER d[K][3], NUMBER rotation[3])
{
    NUMBER a[3] = {0}, late[3] = {0}, b[3] = {0};
    FOR(k, K) {
        NUMBER f[3], c[3];
        FOR(i, 3) f[i] = SUM + SHARE * before[i];
        cross(f, d[k], c);
        FOR(i, 3) { b[i] += 0.5 * c[i]; late[i] = a[i]; a[i] += d[k][i]; before[i] = d[k][i]; }
    }
    FOR(i, 3) rotation[i] = a[i] + b[i] + 0 * late[i];
}
"""
)


def recursion(samples: int, total: str = "a[i]", share: str = "1.0 / 6") -> tuple[str, str]:
    text = RECURSION.replace("SUM", total).replace("SHARE", share)
    text = text.replace("K]", f"{samples}]").replace("(k, K)", f"(k, {samples})")
    return text, f"increments[{samples}][3] -> rotation[3]"


@pytest.mark.parametrize("samples", [2, long(3), long(4), long(8)])
def test_a_sum_that_lacks_the_last_sample_is_named(outcome, samples):
    late = outcome(*recursion(samples, "late[i]"), init="begin")
    assert (late.cause, late.order) == (causes.SUM_LATE, pytest.approx(2, abs=0.01))
    text, arguments = recursion(samples, "late[i]")
    single = outcome(in_float(text), arguments, init="begin", precision="float")
    assert (single.cause, single.order) == (causes.SUM_LATE, 2)


@pytest.mark.long
@pytest.mark.parametrize("samples", [2, 3, 4, 8])
def test_a_sum_with_all_samples_holds(outcome, samples):
    # The sample itself adds nothing: its product with itself is 0.
    for total in ("a[i]", "(a[i] + d[k][i])"):
        right = outcome(*recursion(samples, total), init="begin")
        assert (right.cause, failed(right)) == (None, [])


# Several faults

NO_FAULT_KNOWN = "coefficients of no single fault that is known, "


@pytest.mark.parametrize(
    ("text", "arguments", "parts"),
    [
        (
            quaternion(FIRST, NORMALIZED, "-1.0 / 12"),
            TAKES_4,
            [FIRST_ORDER + TURNS_BY.format("2 atan(d/2)"), causes.WRONG_SIGN],
        ),
        (recursion(4, "late[i]", "-1.0 / 6")[0], recursion(4)[1], [NO_FAULT_KNOWN]),
        long(recursion(4, "late[i]", "1.0 / 3")[0], recursion(4)[1], [NO_FAULT_KNOWN]),
        long(recursion(4, "late[i]", "0")[0], recursion(4)[1], [NO_FAULT_KNOWN]),
        long(
            quaternion(after=FRAME % EARTH, coefficient="-1.0 / 12"),
            TAKES_4,
            ["the frame moves at a constant rate, 15.04", causes.WRONG_SIGN],
        ),
        long(
            quaternion(in_place("0123"), "FOR(i, 4) q[i] *= 1.0001;", "1.0 / 6"),
            TAKES_4,
            [f"elements 0, 1, 2 {OF_RESULT}", causes.FACTOR_TWO, "the state's length is off"],
        ),
        long(
            quaternion(FIRST, FRAME % EARTH, "0"),
            TAKES_4,
            [
                "the frame moves at a constant rate, 15.04",
                FIRST_ORDER + TURNS_BY.format("2 atan(d/2)"),
                causes.ABSENT,
                "the state's length is off",
            ],
        ),
        long(
            quaternion()
            .replace("c[1] = a[2] * b[0]", "c[1] = -a[2] * b[0]")
            .replace("- a[0] * b[2]", "+ a[0] * b[2]"),
            TAKES_4,
            ["the corrections about x, y, z differ: 1, -1, 1 of what is needed"],
        ),
    ],
)
def test_of_several_faults_none_is_named_wrongly(outcome, text, arguments, parts):
    checked = outcome(text, arguments, replace(FIRST_SCALAR), init="begin")
    said = checked.cause.split("; ")
    assert len(said) == len(parts)
    assert all(one.startswith(part) for one, part in zip(said, parts, strict=True)), said


@pytest.mark.parametrize("axis", [0, long(1), long(2)])
def test_a_correction_that_is_wrong_about_one_axis_drifts_about_it(outcome, axis):
    absent, right = 127.34, 9.78
    text = quaternion().replace("cross(before, d, c);", f"cross(before, d, c); c[{axis}] = 0;")
    checked = outcome(text, TAKES_4, FIRST_SCALAR, init="begin")
    drift = np.abs(checked.drift_axes_deg_h)
    assert drift[axis] == pytest.approx(absent, rel=1e-3)
    assert (np.delete(drift, axis) < right).all()


# The verdict and the ladder

GUARDED = rates(before="if (dt > 0.065 || dt < 0.0001) { return; }")


@pytest.mark.parametrize("sample_hz", [100, long(20), long(1000), long("8000")])
def test_code_that_guards_its_interval_is_checked(outcome, sample_hz):
    checked = outcome(GUARDED, RATES, FIRST_SCALAR, init="begin", takes="rates", sample_hz=sample_hz)
    assert (checked.cause, failed(checked)) == (None, [])
    assert (checked.order, checked.drift_deg_h) == pytest.approx((3, 9.7827), abs=2e-3)


def test_an_interval_beyond_the_guard_does_not_turn(outcome):
    checked = outcome(GUARDED, RATES, FIRST_SCALAR, init="begin", takes="rates", sample_hz=10)
    assert checked.cause == "a small rotation about an axis does not turn the attitude"


#: The largest rate that a gyro has, 2000 deg/s: above it the function does not turn.
LIMITED = rates(before="FOR(i, 3) if (fabs(g[i]) > 34.9) { return; }")


@pytest.mark.parametrize("sample_hz", [100, long(1000), long(3000)])
def test_no_rate_is_fed_that_a_gyro_does_not_have(outcome, sample_hz):
    checked = outcome(LIMITED, RATES, FIRST_SCALAR, init="begin", takes="rates", sample_hz=sample_hz)
    assert (checked.cause, failed(checked)) == (None, [])


@pytest.mark.parametrize(
    ("coefficient", "holds"),
    [
        long("0.0833", {"double": True, "float": True}),
        ("0.08", {"double": False, "float": False}),
        long("0.0875", {"double": False, "float": False}),
        long("0.0815", {"double": False, "float": False}),
    ],
)
def test_the_verdict_rests_on_the_coefficient_in_either_precision(outcome, coefficient, holds):
    for precision, right in holds.items():
        text = quaternion(coefficient=coefficient)
        text = in_float(text) if precision == "float" else text
        checked = outcome(text, TAKES_4, FIRST_SCALAR, init="begin", precision=precision)
        assert checked.holds is right
        assert checked.coefficient_ratio == pytest.approx(12 * float(coefficient), abs=2e-4)
        found = {finding.name: finding for finding in checked.findings}
        assert found["coefficients"].holds is right and found["order"].holds is right
        if (
            coefficient == "0.08"
        ):  # 14.48 deg/h: half as much again as 9.78, which rounding of single precision hides
            assert found["drift"].holds is False
        if not right:
            assert checked.order == pytest.approx(2, abs=0.3)
            assert checked.cause == f"correction {12 * float(coefficient):.3g} times as large as needed"


@pytest.mark.parametrize("samples", [1, 2])
def test_rates_at_ends_are_those_at_the_ends_of_the_intervals(tmp_path, samples):
    (tmp_path / "a.c").write_text("void step(const double r[][3], double n[4]) { n[0] = r[0][0]; }")
    arguments = f"rates[{samples}][3] -> next[4]"
    step = ForeignStep(read_source(tmp_path / "a.c", "step", arguments), takes=ENDS)
    segment = ladder.drift_segments(step)[0]
    # The rate in body axes turns about y, on the cone of 1 deg at 10 Hz, 0.01 s from instant to instant; the run
    # begins at time 0, and its first interval ends at the first instant.
    rows = segment.increments.reshape(-1, 3) / 0.01
    np.testing.assert_allclose(rows, cone().rate(0.01 * np.arange(1, len(rows) + 1)), atol=1e-12)
