"""A user's function in C or C++: a right one of any design holds, and of each fault the cause is named."""

from __future__ import annotations

import json
import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.catalogue.methods.coning_coefficients import design
from strapgen.firmware.check_code import coning_causes as causes
from strapgen.firmware.check_code.bridge import read_source
from strapgen.firmware.check_code.check_foreign import check_foreign
from strapgen.firmware.check_code.foreign import Convention, ForeignStep
from strapgen.firmware.check_code.ladder import closed_form_deg_h, cone
from strapgen.firmware.check_code.rotation import FIRST_ORDER
from strapgen.ir.exceptions import InputError

EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "check_foreign_c"
FAULTS = {
    "correction_absent.c": causes.ABSENT,
    "wrong_sign.c": causes.WRONG_SIGN,
    "sample_late.c": causes.LATE,
    "factor_two.c": causes.FACTOR_TWO,
    "state_kept.c": causes.STATE_KEPT,
}

#: Parts of which the functions below consist; quaternions have the scalar part last.
PARTS = """
#include <math.h>
#ifndef NUMBER
#define NUMBER double
#endif
static void cross(const NUMBER *a, const NUMBER *b, NUMBER *c)
{
    c[0] = a[1] * b[2] - a[2] * b[1]; c[1] = a[2] * b[0] - a[0] * b[2]; c[2] = a[0] * b[1] - a[1] * b[0];
}
static void turn(const NUMBER *q, const NUMBER *v, NUMBER *r)
{
    const NUMBER a = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]), w = cos(a / 2);
    const NUMBER s = a > 1e-4 ? sin(a / 2) / a : 0.5 - a * a / 48, x = s * v[0], y = s * v[1], z = s * v[2];
    const NUMBER p[4] = {
        q[3] * x + q[0] * w + q[1] * z - q[2] * y, q[3] * y - q[0] * z + q[1] * w + q[2] * x,
        q[3] * z + q[0] * y - q[1] * x + q[2] * w, q[3] * w - q[0] * x - q[1] * y - q[2] * z};
    for (int i = 0; i < 4; i++) r[i] = p[i];
}
"""
#: The two-sample algorithm without memory, its coefficient and the order of its product left open.
TWO_SAMPLES = (
    PARTS
    + """
void step(const double state[4], const double d[2][3], double next[4])
{
    double c[3], v[3];
    cross(d[0], d[1], c);
    for (int i = 0; i < 3; i++) v[i] = d[0][i] + d[1][i] + %s * c[i];
    turn(state, v, next);
}
"""
)
#: Direction cosines, reference to body, in a flat array, with three samples.
COSINES = (
    PARTS
    + """
void step(double m[3][3], const double *d)
{
    double a[3], b[3], c[3], v[3], n[3][3];
    const double one[4] = {0, 0, 0, 1};
    double p[4];
    cross(d, d + 3, a); cross(d, d + 6, b); cross(d + 3, d + 6, c);
    for (int i = 0; i < 3; i++) v[i] = d[i] + d[3 + i] + d[6 + i] + (57 * a[i] + 33 * b[i] + 57 * c[i]) / 80;
    turn(one, v, p);
    const double x = p[0], y = p[1], z = p[2], w = p[3];
    const double t[3][3] = {
        {1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
        {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
        {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
    for (int i = 0; i < 3; i++) for (int j = 0; j < 3; j++) {
        n[i][j] = 0;
        for (int k = 0; k < 3; k++) n[i][j] += t[k][i] * m[k][j];
    }
    for (int i = 0; i < 3; i++) for (int j = 0; j < 3; j++) m[i][j] = n[i][j];
}
"""
)
#: A filter in C++ that holds its attitude, from rates in single precision.
FILTER = (
    "#define NUMBER float\n"
    + PARTS
    + """
namespace nav {
struct Filter {
    float last[3];
    struct { float q[4]; } attitude;
};
void begin(Filter &filter)
{
    filter = Filter();
    filter.attitude.q[3] = 1.0F;
}
void update(Filter &filter, const float (&gyro)[3], float dt)
{
    float d[3], c[3], v[3];
    for (int i = 0; i < 3; i++) d[i] = gyro[i] * dt;
    cross(filter.last, d, c);
    for (int i = 0; i < 3; i++) {
        v[i] = d[i] + c[i] / 12;
        filter.last[i] = d[i];
    }
    turn(filter.attitude.q, v, filter.attitude.q);
}
}
"""
)
#: A function as attitude filters have it: a global quaternion, scalar first, of first order, normalized.
GLOBAL = """
#include <math.h>
volatile float q[4];
void reset(void) { q[0] = 1; q[1] = q[2] = q[3] = 0; }
void update(float g[3], float dt)
{
    const float a = q[0], b = q[1], c = q[2], d = q[3];
    const float x = 0.5f * dt * g[0], y = 0.5f * dt * g[1], z = 0.5f * dt * g[2];
    q[0] = a - b * x - c * y - d * z; q[1] = b + a * x + c * z - d * y;
    q[2] = c + a * y - b * z + d * x; q[3] = d + a * z + b * y - c * x;
    const float n = 1 / sqrtf(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int i = 0; i < 4; i++) q[i] *= NORMALIZED ? n : 1;
}
"""


#: The convention without options.
PLAIN = Convention()


def example(name: str) -> ForeignStep:
    arguments = "state[4], increments[3] -> state[4]"
    source = read_source(EXAMPLES / name, "integrator_update", arguments, "integrator_init")
    return ForeignStep(source, Convention("first"))


def failed(outcome) -> list[str]:
    return [finding.name for finding in outcome.findings if finding.holds is False]


@pytest.mark.long
def test_the_right_example_holds():
    outcome = check_foreign(example("correct.c"))
    assert (outcome.holds, outcome.cause, failed(outcome)) == (True, None, [])
    assert outcome.order == pytest.approx(3, abs=0.05)
    names = "calls scalar sense axes,at rest,delay,rotation,coefficients,order drift symmetry norm runs NaN,long run"
    listed = names.replace(" ", ",").replace("at,", "at ").replace("long,", "long ").split(",")
    assert [finding.name for finding in outcome.findings] == listed
    assert [finding.name for finding in outcome.findings if finding.holds is not True] == ["NaN"]
    # The closed form with the correction d_before x d / 12: alpha^2 / T (sin(l) - l / 2 - (2 sin(l) - sin(2 l)) ...)
    lam, alpha = 0.2 * math.pi, math.radians(1)
    rate = alpha**2 / 0.01 * (math.sin(lam) / 2 - lam / 2 + (1 - math.cos(lam)) * math.sin(lam) / 6)
    assert outcome.closed_form_deg_h == pytest.approx(abs(math.degrees(rate)) * 3600, rel=1e-9)
    assert outcome.drift_deg_h == pytest.approx(outcome.closed_form_deg_h, rel=1e-3)


@pytest.mark.long
@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_seen_and_named(name):
    outcome = check_foreign(example(name))
    assert (outcome.holds, outcome.cause) == (False, FAULTS[name])
    assert failed(outcome) == (["runs"] if name == "state_kept.c" else ["coefficients", "order", "drift"])
    data = json.loads(outcome.written("json"))
    old = {"file", "holds", "order", "drift_deg_h", "closed_form_deg_h", "cause", "checks"}
    new = {"drift_axes_deg_h", "drift_by_axis_deg_h", "coefficients", "coefficient_ratio", "cause_confidence"}
    assert data.keys() == old | new | {"schema", "next_cause", "replacement", "replacement_command"}
    assert math.hypot(*data["drift_axes_deg_h"]) == pytest.approx(outcome.drift_deg_h)
    assert data["drift_by_axis_deg_h"] == data["drift_axes_deg_h"]
    if name == "state_kept.c":  # no fault of the coefficients
        assert data["cause_confidence"] is data["replacement"] is None
    elif name == "sample_late.c":  # two kept samples in reverse order would give the same
        assert (round(data["cause_confidence"], 3), data["next_cause"]) == (0, causes.EARLIER_REVERSED)
    else:
        assert data["cause_confidence"] > 0.99 and data["next_cause"] not in (None, outcome.cause)
    assert {tuple(check) for check in data["checks"]} == {("name", "holds", "value")}
    # What the faults leave follows from the closed form: correction times factor.
    if name in ("correction_absent.c", "wrong_sign.c", "factor_two.c"):
        absent = closed_form_deg_h(design(1))
        factor = {"correction_absent.c": 0, "wrong_sign.c": -1, "factor_two.c": 2}[name]
        expected = absent + factor * (closed_form_deg_h(design(1, 1)) - absent)
        assert outcome.drift_deg_h == pytest.approx(abs(expected), rel=1e-3)


@pytest.mark.long
def test_the_generated_code_that_is_shown_corrects_coning(outcome):
    faulty = PARTS + (
        "void step(const double past[1][3], const double d[3], double rotation[3])\n"
        "{\n    for (int i = 0; i < 3; i++) rotation[i] = d[i];\n}\n"
    )
    arguments = "previous[1][3], increments[3] -> rotation[3]"
    checked = outcome(faulty, arguments)
    assert checked.cause == causes.ABSENT and checked.replacement in checked.text().replace("\n    ", "\n")
    inputs = [
        f"const double {name}_{axis} = {array}[{k}];"
        for name, array in (("past1", "past[0]"), ("d1", "d"))
        for k, axis in enumerate("xyz")
    ]
    results = [f"rotation[{k}] = phi_{axis};" for k, axis in enumerate("xyz")]
    body = "\n".join([*inputs, checked.replacement, *results])
    mended = outcome(faulty.replace("for (int i = 0; i < 3; i++) rotation[i] = d[i];", body), arguments)
    assert (mended.holds, mended.replacement) == (True, None)


def test_a_cause_is_as_sure_as_the_next_one_allows():
    # One sample a call: 1/12 is right. The residuals of the wrong sign and of no correction are 0.01 and 0.07333.
    table = {(-4, 0): 0.0, (-3, 0): 0.0, (-2, 0): 0.0, (-1, 0): -1 / 12 + 0.01}
    value, other = causes.confidence(causes.Products(1, table, table), causes.WRONG_SIGN)
    assert (value, other) == (pytest.approx(1 - 0.01 / (1 / 12 - 0.01)), causes.ABSENT)
    # Two samples: the wrong sign and the reverse order are the same.
    table = {(older, newer): 0.0 for newer in (0, 1) for older in range(-4, newer)} | {(0, 1): -2 / 3}
    products = causes.Products(2, table, table)
    value, other = causes.confidence(products, causes.cause(products))
    assert (value, other) == (0.0, causes.REVERSED)
    # Without a correction nothing is left, and of one that is late, nothing can be seen in a call of one sample.
    table = {(-4, 0): 0.0, (-3, 0): 0.0, (-2, 0): 0.0, (-1, 0): 0.0}
    assert causes.confidence(causes.Products(1, table, table), causes.ABSENT) == (1.0, causes.FACTOR_TWO)
    # A size of its own leaves nothing.
    table = {(-4, 0): 0.0, (-3, 0): 0.0, (-2, 0): 0.0, (-1, 0): 0.9 / 12}
    products = causes.Products(1, table, table)
    value, other = causes.confidence(products, causes.cause(products))
    assert (round(value, 6), other) == (1.0, causes.RIGHT)


def test_there_is_an_example_of_every_fault():
    assert {path.name for path in EXAMPLES.glob("*.c")} == {"correct.c", *FAULTS}


@pytest.mark.long
@pytest.mark.parametrize(
    ("coefficient", "cause"),
    [
        ("(2.0 / 3)", None),
        pytest.param("0", causes.ABSENT, marks=pytest.mark.long),
        pytest.param("(1.0 / 2)", causes.ABSENT, marks=pytest.mark.long),
        pytest.param("(1.0 / 3)", causes.FACTOR_TWO, marks=pytest.mark.long),
        pytest.param("(-2.0 / 3)", causes.WRONG_SIGN, marks=pytest.mark.long),
    ],
)
def test_two_samples_without_memory(outcome, coefficient, cause):
    checked = outcome(TWO_SAMPLES % coefficient, "state[4], increments[2][3] -> next[4]")
    assert (checked.holds, checked.cause) == (cause is None, cause)
    assert checked.closed_form_deg_h == pytest.approx(abs(closed_form_deg_h(design(2))))


@pytest.mark.long
def test_direction_cosines_from_reference_to_body_hold_and_the_wrong_sense_is_named(outcome):
    arguments = "state[3][3], increments[9] -> state[3][3]"
    checked = outcome(COSINES, arguments, Convention(sense="reference-to-body"))
    assert (checked.holds, checked.cause) == (True, None)
    assert "scalar" not in {finding.name for finding in checked.findings}
    checked = outcome(COSINES, arguments)
    assert failed(checked) == ["sense"]
    assert (
        checked.cause
        == "the attitude is reference-to-body, not body-to-reference: --sense reference-to-body fits"
    )


def test_a_rotation_of_the_wrong_sign_is_named(outcome):
    transposed = COSINES.replace("t[k][i]", "t[i][k]")
    arguments = "state[3][3], increments[9] -> state[3][3]"
    checked = outcome(transposed, arguments, Convention(sense="reference-to-body"))
    assert failed(checked) == ["axes"]
    assert checked.cause.startswith(
        "the rotation has the wrong sign, or the attitude is body-to-reference, with"
    )


@pytest.mark.needs("g++")
def test_a_filter_in_cpp_that_holds_its_attitude_and_takes_rates(outcome):
    checked = outcome(
        *(FILTER, "nav::Filter &filter, rates[3], dt -> filter.attitude.q[4]"),
        file="filter.cpp",
        name="nav::update",
        init="nav::begin",
        takes="rates",
        precision="float",
    )
    assert (checked.holds, checked.cause) == (True, None)


@pytest.mark.long
@pytest.mark.parametrize("normalized", [0, 1])
def test_a_global_attitude_of_first_order(outcome, normalized):
    text = GLOBAL.replace("NORMALIZED", str(normalized))
    arguments = "rates[3], dt -> global q[4]"
    more = {"name": "update", "takes": "rates", "precision": "float"}
    checked = outcome(text, arguments, Convention("first"), init="reset", **more)
    first = f"{FIRST_ORDER}: it turns by 2 atan(d/2) in place of d; {causes.ABSENT}"
    if normalized:
        assert (checked.holds, checked.cause) == (False, first)
    else:
        # A call makes the quaternion longer by the root of 1 + d^2 / 4.
        increments = cone().increments(Fraction(1, 100), 6008, 1)
        longer = np.prod(np.sqrt(1 + (increments**2).sum(axis=-1) / 4))
        cause, _, length = checked.cause.partition("; the state's length is off: 1.00001 at first, ")
        assert (checked.holds, cause) == (False, first)
        assert float(length.split()[0]) == pytest.approx(longer, abs=1e-4)
    if normalized:
        started = text.replace("volatile float q[4];", "volatile float q[4] = {1, 0, 0, 0};")
        checked = outcome(started, arguments, Convention("first"), **more)
        assert checked.cause == f"{first}; {causes.STATE_KEPT}"
        checked = outcome(text, arguments, Convention("last"), init="reset", **more)
        assert "the scalar part stands first, not last: --scalar first fits" in checked.cause


#: What a line behind the step does wrong, and its words.
LINES = {
    "next[1] = -next[1];": "rotations about x, y, z turn about x, -y, z",
    "next[4] = 1;": "it writes beyond the ends of its arrays",
    "((double *)d)[1] = 0;": "it changes an argument that is no result",
    "next[0] = NAN;": "it leaves no finite numbers in its result, or does not write all of it",
    "for (int i = 0; i < 4; i++) next[i] = state[i];": "a small rotation about an axis does not turn the attitude",
}


@pytest.mark.parametrize(
    "line",
    [line if line.startswith("next[1]") else pytest.param(line, marks=pytest.mark.long) for line in LINES],
)
def test_other_faults_have_their_words(outcome, line):
    text = TWO_SAMPLES.replace("turn(state, v, next);", f"turn(state, v, next); {line}") % "(2.0 / 3)"
    checked = outcome(text, "state[4], increments[2][3] -> next[4]")
    assert (checked.holds, checked.cause) == (False, LINES[line])
    assert failed(checked) == (["axes"] if "axis" in LINES[line] or "rotations" in LINES[line] else ["calls"])


@pytest.mark.long
def test_a_state_that_moves_without_rotation_is_seen(outcome):
    text = (
        TWO_SAMPLES.replace("turn(state, v, next);", "turn(state, v, next); next[0] += 1e-9;") % "(2.0 / 3)"
    )
    checked = outcome(text, "state[4], increments[2][3] -> next[4]")
    assert "at rest" in failed(checked) and checked.cause is None


def test_a_product_in_the_wrong_order_is_the_only_cause(outcome):
    arguments = "state[4], increments[2][3] -> next[4]"
    left = TWO_SAMPLES % "(2.0 / 3)"
    left = left.replace("turn(state, v, next);", "double p[4]; const double one[4] = {0, 0, 0, 1}; turn(one, v, p);"
        "double q[4] = {state[0], state[1], state[2], state[3]}; double w[4];"
        "w[0] = p[3]*q[0] + p[0]*q[3] + p[1]*q[2] - p[2]*q[1]; w[1] = p[3]*q[1] - p[0]*q[2] + p[1]*q[3] + p[2]*q[0];"
        "w[2] = p[3]*q[2] + p[0]*q[1] - p[1]*q[0] + p[2]*q[3]; w[3] = p[3]*q[3] - p[0]*q[0] - p[1]*q[1] - p[2]*q[2];"
        "for (int i = 0; i < 4; i++) next[i] = w[i];")  # fmt: skip
    checked = outcome(left, arguments)
    assert failed(checked) == ["axes"]
    words = "a rotation turns about reference axes, not about body axes: a product in the wrong order"
    assert checked.cause == words


@pytest.mark.long
def test_axes_with_a_preference_are_seen(outcome):
    arguments = "state[4], increments[2][3] -> next[4]"
    checked = outcome(
        TWO_SAMPLES.replace("turn(state", "v[2] -= 0.1 * c[2]; turn(state") % "(2.0 / 3)", arguments
    )
    assert "symmetry" in failed(checked)


@pytest.mark.long
def test_a_correction_and_a_rotation_that_a_later_call_brings(outcome):
    text = (
        PARTS
        + """
static double e[3], c[3];
void begin(void) { for (int i = 0; i < 3; i++) e[i] = c[i] = 0; }
void step(double q[4], const double d[3])
{
    double v[3];
    for (int i = 0; i < 3; i++) v[i] = LATE;
    cross(e, d, c);
    for (int i = 0; i < 3; i++) e[i] = d[i];
    turn(q, v, q);
}
"""
    )
    arguments = "state[4], increments[3] -> state[4]"
    checked = outcome(text.replace("LATE", "d[i] + c[i] / 12"), arguments, init="begin")
    assert (checked.cause, failed(checked)) == (causes.LATE, ["delay"])
    checked = outcome(text.replace("LATE", "e[i]"), arguments, init="begin")
    assert "rotation one sample late" in checked.cause and "delay" in failed(checked)


def test_conflicting_options_are_refused(tmp_path):
    (tmp_path / "a.c").write_text(
        "void f(const double q[4], const double g[3], double n[4]) { n[0] = q[0] + g[0]; }"
    )
    source = read_source(tmp_path / "a.c", "f", "state[4], rates[3] -> next[4]")
    with pytest.raises(
        InputError,
        match="--input increments contradicts the argument rates; --input rates or instants fits it",
    ):
        ForeignStep(source)
    with pytest.raises(InputError, match="input 'angles' is not known; allowed: increments, rates, instants"):
        ForeignStep(source, takes="angles")
    with pytest.raises(InputError, match="scalar 'middle' is not known; allowed: last, first"):
        Convention("middle")
    with pytest.raises(InputError, match="sense 'body' is not known"):
        Convention(sense="body")


@pytest.mark.parametrize("scalar", ["first", "last"])
@pytest.mark.parametrize("sense", ["body-to-reference", "reference-to-body"])
def test_a_convention_reads_an_attitude(scalar, sense):
    half = math.sqrt(0.5)  # a quarter of a turn about z
    vector = [0.0, 0.0, half if sense == "body-to-reference" else -half]
    state = np.array([[half, *vector] if scalar == "first" else [*vector, half]])
    convention = Convention(scalar, sense)
    expected = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    np.testing.assert_allclose(convention.matrices(state)[0], expected, atol=1e-15)
    np.testing.assert_allclose(convention.matrices(convention.identity(4)[None])[0], np.eye(3), atol=0)
    matrix = np.array(expected, float) if sense == "body-to-reference" else np.array(expected, float).T
    np.testing.assert_array_equal(convention.matrices(matrix.reshape(1, 9))[0], expected)


#: One sample a call and two from before it, which it is handed, the oldest first.
HANDED = (
    PARTS
    + """
void step(const double previous[2][3], const double d[3], double rotation[3])
{
    double older[3], newer[3];
    cross(previous[OLDER], d, older); cross(previous[1 - OLDER], d, newer);
    for (int i = 0; i < 3; i++) rotation[i] = d[i] + (7 * newer[i] - older[i]) / 60;
}
"""
)


@pytest.mark.parametrize(("older", "cause"), [(0, None), (1, causes.EARLIER_REVERSED)])
def test_order_of_samples_that_are_handed_over_is_seen(outcome, older, cause):
    text = HANDED.replace("OLDER", str(older))
    checked = outcome(text, "previous[2][3], increments[3] -> rotation[3]")
    assert (checked.holds, checked.cause) == (cause is None, cause)


#: The recursion of an integrator between a gyro at a high rate and an attitude at a low one; it corrects a delta angle.
RECURSION = (
    PARTS
    + """
typedef struct { double alpha[3], beta[3], before[3]; } integrator_t;
void put(integrator_t *self, const double d[4][3], double rotation[3])
{
    for (int i = 0; i < 3; i++) self->alpha[i] = self->beta[i] = 0;
    for (int k = 0; k < 4; k++) {
        double left[3], c[3];
        for (int i = 0; i < 3; i++) left[i] = self->alpha[i] + self->before[i] / 6;
        FAULT
        cross(left, d[k], c);
        for (int i = 0; i < 3; i++) {
            self->beta[i] += c[i] / 2;
            self->alpha[i] += d[k][i];
            self->before[i] = d[k][i];
        }
    }
    for (int i = 0; i < 3; i++) rotation[i] = self->alpha[i] + self->beta[i];
}
"""
)


@pytest.mark.parametrize(
    ("fault", "cause"),
    [
        ("", None),
        pytest.param(
            "for (int i = 0; i < 3; i++) left[i] = self->alpha[i] + d[k][i] / 6;",
            causes.ABSENT,
            marks=pytest.mark.long,
        ),
        pytest.param(
            "for (int i = 0; i < 3; i++) left[i] += self->before[i] / 6;",
            causes.FACTOR_TWO,
            marks=pytest.mark.long,
        ),
        pytest.param("for (int i = 0; i < 3; i++) left[i] = 0;", causes.ABSENT, marks=pytest.mark.long),
    ],
)
def test_a_function_that_corrects_a_delta_angle(outcome, fault, cause):
    arguments = "integrator_t *self, increments[4][3] -> rotation[3]"
    checked = outcome(RECURSION.replace("FAULT", fault), arguments, name="put")
    assert (checked.holds, checked.cause) == (cause is None, cause)
    assert checked.closed_form_deg_h == pytest.approx(
        abs(closed_form_deg_h(design(1, 1) if cause is None else design(4))), rel=1e-9
    )


@pytest.mark.long
@pytest.mark.parametrize(
    ("algorithm", "method", "samples"),
    [("euler", "rk4", 2), ("dcm", "rk4", 2), ("euler", "coning-uncompressed", 3), ("dcm", "magnus6", 4)],
)
def test_generated_steps_hold(tmp_path, algorithm, method, samples):
    sources = pipeline.compile(choose(algorithm, method, samples), "c")
    for name, text in sources.step_files.items():
        (tmp_path / name).write_text(text)
    (file,) = tmp_path.glob("*.c")
    elements = 4 if algorithm == "euler" else 9
    arguments = f"state[{elements}], increments[{3 * samples}] -> next[{elements}]"
    outcome = check_foreign(ForeignStep(read_source(file, sources.function.name, arguments)))
    assert (outcome.holds, outcome.cause) == (True, None)
    assert outcome.order > 3.9
