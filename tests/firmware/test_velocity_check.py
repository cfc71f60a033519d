"""Velocity, position and moving frames of a user's function: right ones hold, and the cause of a fault is named."""

from __future__ import annotations

import json
import shlex

import numpy as np
import pytest

from strapgen.cli import main
from strapgen.firmware.check_code import coning_causes as causes
from strapgen.firmware.check_code import velocity_findings as said

#: One sample a call and the one before it; quaternions have the scalar part last. What is in capitals is left open.
NAVIGATOR = r"""
#include <math.h>
#ifndef NUMBER
#define NUMBER double
#endif
#define FOR(i) for (int i = 0; i < 3; i++)
static void cross(const NUMBER *a, const NUMBER *b, NUMBER *c)
{
    c[0] = a[1] * b[2] - a[2] * b[1]; c[1] = a[2] * b[0] - a[0] * b[2]; c[2] = a[0] * b[1] - a[1] * b[0];
}
static void multiply(const NUMBER *q, const NUMBER *p, NUMBER *r)
{
    const NUMBER t[4] = {
        q[3] * p[0] + q[0] * p[3] + q[1] * p[2] - q[2] * p[1], q[3] * p[1] - q[0] * p[2] + q[1] * p[3] + q[2] * p[0],
        q[3] * p[2] + q[0] * p[1] - q[1] * p[0] + q[2] * p[3], q[3] * p[3] - q[0] * p[0] - q[1] * p[1] - q[2] * p[2]};
    for (int i = 0; i < 4; i++) r[i] = t[i];
}
static void turn(const NUMBER *v, NUMBER *p)
{
    const NUMBER a = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]), s = a > 1e-4 ? sin(a / 2) / a : 0.5 - a * a / 48;
    FOR(i) p[i] = s * v[i];
    p[3] = cos(a / 2);
}
/* w = C s, or its transpose with a negative sign */
static void rotate(const NUMBER *q, NUMBER sign, const NUMBER *s, NUMBER *w)
{
    const NUMBER u[3] = {sign * q[0], sign * q[1], sign * q[2]};
    NUMBER a[3], b[3];
    cross(u, s, a); cross(u, a, b);
    FOR(i) w[i] = s[i] + 2 * (q[3] * a[i] + b[i]);
}
typedef struct { NUMBER q[4], v[3], p[3], d[3], s[3]; } nav_t;
void begin(nav_t *nav) { nav->q[3] = 1; }
void step(nav_t *nav, const NUMBER d[3], const NUMBER f[3], NUMBER dt)
{
    NUMBER c[3], a[3], b[3], push[3], w[3], v[3], p[4], q[4], s[3];
    FOR(i) { s[i] = SAMPLE; q[i] = nav->q[i]; }
    q[3] = nav->q[3];
    cross(nav->d, d, c);
    FOR(i) w[i] = d[i] + c[i] / 12;
    turn(w, p);
    multiply(q, p, nav->q);
    FRAME
    cross(d, s, c); cross(nav->d, s, a); cross(nav->s, d, b);
    FOR(i) push[i] = s[i] + (HALF) * c[i] + (SCULLING) * (a[i] + b[i]);
    rotate(TURNED_BY, push, w);
    FOR(i) {
        v[i] = nav->v[i] + w[i] + (GRAVITY);
        nav->p[i] += (POSITION) * dt;
    }
    CORIOLIS
    FOR(i) { nav->v[i] = v[i]; nav->d[i] = d[i]; nav->s[i] = s[i]; }
}
"""
RIGHT = {
    "SAMPLE": "f[i]",
    "HALF": "0.5",
    "SCULLING": "1.0 / 12",
    "TURNED_BY": "q, 1",
    "GRAVITY": "i == 2 ? -9.80665 * dt : 0",
    "POSITION": "(nav->v[i] + v[i]) / 2",
    "FRAME": "",
    "CORIOLIS": "",
}
ARGUMENTS = (
    "nav_t *nav, increments[3], velocity_increments[3], dt "
    "-> nav.q[4], velocity = nav.v[3], position = nav.p[3]"
)
EARTH = 7.292115e-5
#: Turns the attitude by the rate of the frame, and the velocity that is relative to it.
FRAME = "const NUMBER e[3] = {SIGN * 7.292115e-5 * dt, 0, 0}; turn(e, p); multiply(p, nav->q, nav->q);"
CORIOLIS = (
    "const NUMBER r[3] = {TIMES * 7.292115e-5 * dt, 0, 0};"
    "FOR(i) w[i] = (nav->v[i] + v[i]) / 2; cross(w, r, c); FOR(i) v[i] += c[i];"
)


def navigator(**parts: str) -> str:
    text = NAVIGATOR
    for name, part in (RIGHT | parts).items():
        text = text.replace(name, part)
    return text


def failed(outcome) -> list[str]:
    return [finding.name for finding in outcome.findings if finding.holds is False]


ONE_SIDED = "turned push,sculling,velocity order,velocity drift,position order"
MIDDLE = "NUMBER h[4], e[3]; FOR(i) e[i] = d[i] / 2; turn(e, p); multiply(q, p, h);"
#: What a fault replaces, the checks that fail, and the cause.
FAULTS = {
    "no sculling": ({"SCULLING": "0"}, "sculling,velocity drift", f"sculling {causes.ABSENT}"),
    "sculling wrong": (
        {"SCULLING": "-1.0 / 12"},
        "sculling,velocity drift",
        f"sculling {causes.WRONG_SIGN}",
    ),
    "sculling twice": ({"SCULLING": "1.0 / 6"}, "sculling,velocity drift", f"sculling {causes.FACTOR_TWO}"),
    "sculling large": (
        {"SCULLING": "1.0 / 11"},
        "sculling",
        "sculling correction 1.09 times as large as needed",
    ),
    "one term": ({"(a[i] + b[i])": "b[i]"}, ONE_SIDED, "and a newer j d_i x v_j is absent, v_i x d_j right"),
    "other term": (
        {"(a[i] + b[i])": "a[i]"},
        ONE_SIDED,
        "and a newer j v_i x d_j is absent, d_i x v_j right",
    ),
    "half a term": (
        {"(a[i] + b[i])": "(a[i] + b[i] / 2)"},
        *(ONE_SIDED, "v_i x d_j is 0.5 times as large as needed, d_i x v_j right"),
    ),
    "opposite terms": (
        {"(a[i] + b[i])": "(a[i] - b[i])"},
        *(ONE_SIDED, "v_i x d_j is -1 times as large as needed, d_i x v_j right"),
    ),
    "other products": (
        {"(a[i] + b[i])": "(0.5 * a[i] + 2 * b[i])"},
        *(ONE_SIDED, "known: their mean is 0.375, that of a sample with itself is right"),
    ),
    "twice": ({"HALF": "1.0"}, "turned push,velocity order,position order", said.TWICE),
    "twice by the middle": (
        {"SCULLING) * (a[i] + b[i]);": f"1.0 / 12) * (a[i] + b[i]); {MIDDLE}", "TURNED_BY": "h, 1"},
        "turned push,velocity order,position order",
        said.TWICE,
    ),
    "opposite": ({"HALF": "-0.5"}, "turned push,velocity order,position order", said.OPPOSITE),
    "three halves": (
        {"HALF": "0.75"},
        "turned push,velocity order,position order",
        "rotation of the increment 1.5 times as large as needed",
    ),
    "start": ({"HALF": "0.0"}, "turned push,velocity order,position order", said.START),
    "end": (
        {"HALF": "0.0", "TURNED_BY": "nav->q, 1"},
        "turned push,velocity order,position order",
        said.END,
    ),
    "transposed": ({"TURNED_BY": "q, -1"}, "force", "the force is turned by the transposed attitude"),
    "not turned": ({"rotate(TURNED_BY, push, w);": "FOR(i) w[i] = push[i];"}, "force", "by no attitude"),
    "force wrong": ({"SAMPLE": "-f[i]"}, "force", "the force has the wrong sign"),
    "force times dt": ({"SAMPLE": "f[i] * dt"}, "force", "multiplied by the sampling interval"),
    "force size": ({"SAMPLE": "f[i] * 1.5"}, "force", "a push comes out 1.5 times as large as it is fed"),
    "force late": (
        {"SAMPLE": "nav->f[i]", "s[3]; }": "s[3], f[3]; }"},
        "force",
        "the force acts a call late",
    ),
    "force axes": ({"SAMPLE": "f[(i + 1) % 3]"}, "force", "along other axes"),
    "gravity wrong": ({"GRAVITY": "i == 2 ? 9.80665 * dt : 0"}, "gravity", said.GRAVITY_SIGN),
    "gravity absent": ({"GRAVITY": "0"}, "gravity", said.GRAVITY_ABSENT),
    "gravity alone": ({"GRAVITY": "i == 2 ? -9.80665 : 0"}, "gravity", said.GRAVITY_TIME),
    "gravity small": ({"GRAVITY": "i == 2 ? -9.6 * dt : 0"}, "gravity", "not by (0, 0, -9.807)"),
    "gravity in body axes": (
        {"GRAVITY": "0", "FOR(i) push": "s[2] -= 9.80665 * dt; FOR(i) push"},
        "gravity",
        "and by another vector when the body has turned",
    ),
    "position end": ({"POSITION": "v[i]"}, "position,position order", said.AT_THE_END),
    "position start": ({"POSITION": "nav->v[i]"}, "position,position order", said.AT_THE_START),
    "position size": (
        {"POSITION": "nav->v[i] + v[i]"},
        "position,position order",
        "the position advances by 2 times the velocity",
    ),
}
OFTEN = ("no sculling", "one term", "twice", "gravity wrong", "position end")


def test_a_right_navigator_holds_and_json_has_what_is_measured(outcome):
    checked = outcome(navigator(), ARGUMENTS, init="begin", gravity=(0, 0, -9.80665))
    assert (checked.holds, checked.cause, failed(checked)) == (True, None, [])
    data = json.loads(checked.written("json"))
    assert data["sculling_coefficients"] == [
        {"older": -1, "newer": 0, "seen": pytest.approx(1 / 12, abs=1e-5), "wanted": 1 / 12}
    ]
    assert data["sculling_ratio"] == pytest.approx(1, abs=1e-4)
    assert data["increment_rotation"] == pytest.approx(1, abs=1e-4)
    # 1 degree at 10 Hz and 10 m/s^2 in phase: 1/2 less what the design of coning leaves, by the sines of 0.2 pi
    lam = 0.2 * np.pi
    mean = 1 / 2 - (2 * np.sin(lam) / 3 - np.sin(2 * lam) / 12) / lam / 2 * 2
    closed = abs(np.radians(1) * 10 * mean)
    assert data["velocity_closed_form_m_s2"] == pytest.approx(closed, rel=1e-3)
    assert data["velocity_drift_m_s2"] == pytest.approx(closed, rel=2e-3)
    assert data["velocity_order"] == pytest.approx(2, abs=0.15) == data["position_order"]
    assert data["gravity_m_s2"] == pytest.approx([0, 0, -9.80665])
    assert data["velocity_error_m_s"] > data["generated_velocity_error_m_s"] > 0
    assert data["position_error_m"] > data["generated_position_error_m"] > 0


@pytest.mark.parametrize(
    "name", [n if n in OFTEN else pytest.param(n, marks=pytest.mark.long) for n in FAULTS]
)
def test_a_fault_of_the_velocity_is_seen_and_named(outcome, name):
    parts, fails, cause = FAULTS[name]
    text = NAVIGATOR
    for old, new in parts.items():
        assert old in text
        text = text.replace(old, new)
    for old, new in RIGHT.items():
        text = text.replace(old, new)
    text = text.replace("nav->s[i] = s[i]", "nav->s[i] = s[i], nav->f[i] = f[i]") if "late" in name else text
    checked = outcome(text, ARGUMENTS, init="begin", gravity=(0, 0, -9.80665))
    assert failed(checked) == fails.split(",")
    assert (checked.cause_confidence is not None) == checked.cause.startswith("sculling correction")
    assert checked.cause.endswith(cause) if name != "position size" else cause in checked.cause


#: A rate of the frame, its factors in the code for attitude and velocity, the checks that fail, and the cause.
FRAMES = {
    "inertial velocity": (-1, 1, "", None),
    "relative velocity": (-1, 2, "", None),
    "wrong sign": (1, 2, "at rest", "the rate of the frame has the wrong sign: the frame moves"),
    "absent": (0, 0, "at rest,coriolis", "the rate of the frame is absent; "),
    "half": (-0.5, 1, "at rest", "the rate of the frame is another: "),
    "Coriolis wrong": (-1, -2, "coriolis", said.TURNS_BACK),
    "Coriolis absent": (-1, 0, "coriolis", said.TURNS_NOT),
}


@pytest.mark.parametrize(
    "name",
    [
        n if n in ("relative velocity", "wrong sign") else pytest.param(n, marks=pytest.mark.long)
        for n in FRAMES
    ],
)
def test_a_frame_that_moves_is_held_to_what_is_declared(outcome, name):
    turns, times, fails, cause = FRAMES[name]
    parts = {"FRAME": FRAME.replace("SIGN", str(turns)), "CORIOLIS": CORIOLIS.replace("TIMES", str(times))}
    more = {"gravity": (0, 0, -9.80665), "frame_rate": (EARTH, 0, 0)}
    checked = outcome(navigator(**parts), ARGUMENTS, init="begin", **more)
    assert failed(checked) == ([*fails.split(",")] if fails else [])
    assert checked.cause is None if cause is None else checked.cause.startswith(cause)


EARLY = (
    "FOR(i) w[i] = 0; w[0] = 7.292115e-5 * dt; rotate(FROM, -1, w, a); FOR(i) w[i] = d[i] - a[i];"
    "cross(nav->d, d, c); FOR(i) w[i] += c[i] / 12; turn(w, p); multiply(q, p, nav->q);"
)


@pytest.mark.parametrize(("of", "place"), [("q", "start"), ("nav->q", "end")])
def test_a_frame_rate_in_the_axes_of_the_start_or_of_the_end_is_named(outcome, of, place):
    parts = {"FRAME": EARLY.replace("FROM", of), "CORIOLIS": CORIOLIS.replace("TIMES", "2")}
    more = {"gravity": (0, 0, -9.80665), "frame_rate": (EARTH, 0, 0)}
    checked = outcome(navigator(**parts), ARGUMENTS, init="begin", **more)
    assert "frame placement" in failed(checked) and "at rest" not in failed(checked)
    assert f"body axes of the {place} of the call, not of its middle" in checked.cause


def test_gravity_and_the_rate_of_the_frame_as_arguments(outcome):
    takes = (
        "nav_t *nav, increments[3], forces[3], gravity[3], frame_rate[3], dt "
        "-> nav.q[4], velocity = nav.v[3], position = nav.p[3]"
    )
    parts = {"SAMPLE": "f[i] * dt", "GRAVITY": "g[i] * dt"}
    frame = "FOR(i) w[i] = -o[i] * dt; turn(w, p); multiply(p, nav->q, nav->q);"
    coriolis = "FOR(i) w[i] = (nav->v[i] + v[i]) / 2; cross(w, o, c); FOR(i) v[i] += SIGN 2 * dt * c[i];"
    text = navigator(**parts, FRAME=frame, CORIOLIS=coriolis).replace(
        "const NUMBER f[3], NUMBER dt", "const NUMBER f[3], const NUMBER g[3], const NUMBER o[3], NUMBER dt"
    )
    checked = outcome(text.replace("SIGN", ""), takes, init="begin")
    assert (checked.holds, checked.cause) == (True, None)
    np.testing.assert_allclose(checked.translation.gravity_m_s2, (0, 0, -9.80665), atol=0.01)
    checked = outcome(text.replace("SIGN", "-").replace("g[i] * dt", "-g[i] * dt"), takes, init="begin")
    assert checked.cause == f"{said.GRAVITY_SIGN}; {said.TURNS_BACK}"


#: Two samples a call, whose turn in body axes is all that it returns.
CHANGE = (
    NAVIGATOR[: NAVIGATOR.index("typedef struct")]
    + """
void step(const NUMBER d[2][3], const NUMBER f[2][3], ROTATION NUMBER change[3])
{
    NUMBER c[3], a[3], b[3], sum[3], push[3];
    FOR(i) { sum[i] = d[0][i] + d[1][i]; push[i] = f[0][i] + f[1][i]; }
    cross(sum, push, c); cross(d[FIRST], f[1 - FIRST], a); cross(f[FIRST], d[1 - FIRST], b);
    FOR(i) change[i] = push[i] + (HALF) * c[i] + (SCULLING) * (a[i] + b[i]);
    MORE
}
"""
)
CHANGE_TAKES = "increments[2][3], velocity_increments[2][3] -> velocity_change[3]"


@pytest.mark.parametrize(
    ("parts", "cause"),
    [
        ({}, None),
        ({"FIRST": "1"}, f"sculling {causes.WRONG_SIGN}"),
        pytest.param({"SCULLING": "0"}, f"sculling {causes.ABSENT}", marks=pytest.mark.long),
        pytest.param({"HALF": "1"}, said.TWICE, marks=pytest.mark.long),
    ],
)
def test_a_velocity_change_without_an_attitude(outcome, parts, cause):
    text = CHANGE
    for name, part in (
        {"FIRST": "0", "SCULLING": "2.0 / 3", "HALF": "0.5", "ROTATION": "", "MORE": ""} | parts
    ).items():
        text = text.replace(name, part)
    checked = outcome(text, CHANGE_TAKES)
    assert (checked.holds, checked.cause) == (cause is None, cause)
    assert {"gravity", "order", "axes"}.isdisjoint(finding.name for finding in checked.findings)


def test_a_rotation_and_a_velocity_change_in_single_precision(outcome):
    more = "cross(d[0], d[1], a); FOR(i) rotation[i] = sum[i] + 2 * a[i] / 3;"
    text = "#define NUMBER float\n" + CHANGE
    for name, part in {"FIRST": "0", "HALF": "0.5f", "ROTATION": "NUMBER rotation[3],", "MORE": more}.items():
        text = text.replace(name, part)
    takes = "increments[2][3], velocity_increments[2][3] -> rotation[3], velocity_change[3]"
    right = outcome(text.replace("SCULLING", "2.0f / 3"), takes, precision="float")
    assert (right.holds, right.cause) == (True, None)
    wrong = outcome(text.replace("SCULLING", "1.0f / 3"), takes, precision="float")
    assert (failed(wrong)[0], wrong.cause) == ("sculling", f"sculling {causes.FACTOR_TWO}")


#: Each of four samples is turned on its own, the force by the attitude of what is left open.
ONE_BY_ONE = (
    NAVIGATOR[: NAVIGATOR.index("typedef struct")]
    + """
void step(NUMBER q[4], const NUMBER d[4][3], const NUMBER s[4][3], NUMBER v[3])
{
    for (int k = 0; k < 4; k++) {
        NUMBER p[4], r[4], half[3], m[4], w[3], before[4];
        for (int i = 0; i < 4; i++) before[i] = q[i];
        turn(d[k], p); multiply(q, p, r);
        FOR(i) half[i] = d[k][i] / 2;
        turn(half, p); multiply(q, p, m);
        for (int i = 0; i < 4; i++) q[i] = r[i];
        rotate(AT, 1, s[k], w);
        FOR(i) v[i] += w[i];
    }
}
"""
)


@pytest.mark.long
@pytest.mark.parametrize(
    ("at", "cause"),
    [("m", None), ("before", said.START), ("q", said.END)],
)
def test_samples_that_are_turned_one_by_one(outcome, at, cause):
    takes = "state[4], increments[4][3], velocity_increments[4][3], velocity[3] -> state[4], velocity[3]"
    checked = outcome(ONE_BY_ONE.replace("AT", at), takes)
    assert {"coefficients", "sculling"} <= {*failed(checked)}
    words = [causes.ABSENT, *([cause] if cause else []), f"sculling {causes.ABSENT}"]
    assert checked.cause == "; ".join(words)


WRONG = """
void turn(const double d[3], double rotation[3]) { for (int i = 0; i < 3; i++) rotation[i] = d[i]; }
void push(double q[4], const double d[3], const double s[3], double v[3]) { q[3] = d[0]; v[0] += s[0]; }
void free_fall(double q[4], const double d[3], double v[3]) { q[3] = d[0]; v[0] += 1; }
void change(const double d[2][3], const double s[3], double c[3]) { c[0] = d[0][0] + s[0]; }
"""
PUSH = (
    "--function push --arguments 'state[4], increments, velocity_increments, velocity -> state[4], velocity'"
)
TURN = "--function turn --arguments 'increments -> rotation'"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (f"{TURN} --frame-rate-rad-s 0,0,1e-5", "--frame-rate-rad-s goes with an attitude behind the arrow"),
        (f"{TURN} --gravity-m-s2 0,0,9.8", "--gravity-m-s2 goes with a velocity behind the arrow"),
        (f"{PUSH} --gravity-m-s2 9.8", "--gravity-m-s2 is '9.8'; three numbers"),
        (f"{PUSH} --frame-rate-rad-s 0,0,a", "--frame-rate-rad-s"),
        (f"{PUSH} --input instants", "--input instants goes without a velocity"),
        (PUSH.replace(" velocity_increments,", " zeros,"), "need each other"),
        (PUSH.replace("velocity -> state[4], velocity", "zeros -> state[4]"), "need each other"),
        (PUSH.replace(", velocity'", ", velocity, velocity'"), "twice behind the arrow"),
        (PUSH.replace("velocity -> state[4], velocity", "velocity -> velocity"), "need"),
        (PUSH.replace("> state[4], velocity", "> state[4], position"), "position needs a velocity"),
        (
            PUSH.replace("> state[4], velocity", "> state[4], speed = velocity"),
            "names no result; allowed: velocity",
        ),
        (
            "--function free_fall --arguments 'state, increments, gravity -> state'",
            "gravity needs a velocity",
        ),
        (
            "--function change --arguments 'increments[2][3], forces -> velocity_change'",
            "forces has 3 numbers, increments 6; they must agree",
        ),
    ],
)
def test_what_cannot_be_judged_gets_one_line_and_status_2(tmp_path, capsys, words, says):
    (tmp_path / "a.c").write_text(WRONG)
    with pytest.raises(SystemExit) as stop:
        main(["check", f"{tmp_path}/a.c", *shlex.split(words)])
    said = capsys.readouterr()
    assert (stop.value.code, said.out) == (2, "")
    assert said.err.count("\n") == 1 and says in said.err
