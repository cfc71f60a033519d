"""Integrators with the interfaces of flight code are read from their source; right ones are told from faulty ones."""

from __future__ import annotations

import json
import re
import shlex
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from strapgen.cli import main
from strapgen.firmware.check_code import coning_causes as causes
from strapgen.firmware.check_code.bridge import bridge_text, read_source
from strapgen.firmware.check_code.check_command import angle_unit
from strapgen.firmware.check_code.foreign import (
    ForeignStep,
    Segment,
    compile_foreign,
    run_foreign,
)
from strapgen.firmware.check_code.reading import in_words
from strapgen.ir.exceptions import InputError

#: Parts of which the integrators below consist, for numbers of either precision; a quaternion is x, y, z, w.
PARTS = r"""
#include <math.h>
#ifndef NUMBER
#define NUMBER float
#endif
static void turned(const NUMBER *q, const NUMBER *e, const NUMBER *d, NUMBER *r)
{
    const NUMBER k = (NUMBER)(COEFFICIENT);
    const NUMBER v[3] = {d[0] + k * (e[1] * d[2] - e[2] * d[1]), d[1] + k * (e[2] * d[0] - e[0] * d[2]),
                         d[2] + k * (e[0] * d[1] - e[1] * d[0])};
    const NUMBER a = (NUMBER)sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]), w = (NUMBER)cos(a / 2);
    const NUMBER s = a > 1e-3 ? (NUMBER)sin(a / 2) / a : (NUMBER)0.5 - a * a / 48;
    const NUMBER x = s * v[0], y = s * v[1], z = s * v[2];
    const NUMBER p[4] = {
        q[3] * x + q[0] * w + q[1] * z - q[2] * y, q[3] * y - q[0] * z + q[1] * w + q[2] * x,
        q[3] * z + q[0] * y - q[1] * x + q[2] * w, q[3] * w - q[0] * x - q[1] * y - q[2] * z};
    for (int i = 0; i < 4; i++) r[i] = p[i];
}
"""
#: Separate scalars, and an attitude that is memory with named elements.
SCALARS = (
    PARTS
    + """
typedef struct { float w, x, y, z; } quaternion_t;
typedef struct { quaternion_t attitude; float last[3]; int count; } filter_t;
void filter_begin(filter_t *filter) { filter->attitude.w = 1; }
void filter_update(filter_t *filter, float gx, float gy, float gz, float ax, float ay, float az, float dt)
{
    const float d[3] = {gx * dt, gy * dt, gz * dt};
    float q[4] = {filter->attitude.x, filter->attitude.y, filter->attitude.z, filter->attitude.w};
    turned(q, filter->last, d, q);
    filter->attitude.x = q[0]; filter->attitude.y = q[1]; filter->attitude.z = q[2]; filter->attitude.w = q[3];
    for (int i = 0; i < 3; i++) filter->last[i] = d[i];
    (void)ax; (void)ay; (void)az;
}
"""
)
#: A class with a vector of its own, which keeps its attitude to itself.
CLASS = (
    PARTS
    + """
namespace nav {
template <class T> struct Vector3 { T x, y, z; };
using Vector3f = Vector3<float>;
class Quaternion {
public:
    float operator()(int i) const { return e[i]; }
    float &operator()(int i) { return e[i]; }
private:
    float e[4] = {0, 0, 0, 1};
};
class Integrator {
public:
    explicit Integrator(float gain) : gain_(gain) {}
    void update(const Vector3f &gyro, const float dt, bool armed);
    const Quaternion &attitude() const { return attitude_; }
private:
    float gain_;
    float last_[3] = {0, 0, 0};
    Quaternion attitude_;
};
void Integrator::update(const Vector3f &gyro, const float dt, bool armed)
{
    const float d[3] = {gain_ * gyro.x * dt, gain_ * gyro.y * dt, gain_ * gyro.z * dt};
    if (!armed) return;
    float q[4] = {attitude_(0), attitude_(1), attitude_(2), attitude_(3)};
    turned(q, last_, d, q);
    for (int i = 0; i < 4; i++) attitude_(i) = q[i];
    for (int i = 0; i < 3; i++) last_[i] = d[i];
}
}
"""
)
#: A call a sample, which adds up N of them, and says when a delta angle is ready.
PUBLISHES = """
struct Vector3f {
    float v[3];
    float operator[](int i) const { return v[i]; }
    float &operator[](int i) { return v[i]; }
};
struct Integrator {
    float alpha[3], beta[3], last[3];
    int samples, published;
    Vector3f delta_angle;
    bool put(const Vector3f &gyro, float dt)
    {
        float c[3], left[3];
        const float d[3] = {gyro[0] * dt, gyro[1] * dt, gyro[2] * dt};
        if (samples == 0) for (int i = 0; i < 3; i++) alpha[i] = beta[i] = 0;
        for (int i = 0; i < 3; i++) left[i] = alpha[i] + last[i] / 6;
        c[0] = left[1] * d[2] - left[2] * d[1]; c[1] = left[2] * d[0] - left[0] * d[2];
        c[2] = left[0] * d[1] - left[1] * d[0];
        for (int i = 0; i < 3; i++) { beta[i] += FACTOR * c[i]; alpha[i] += d[i]; last[i] = d[i]; }
        for (int i = 0; i < 3; i++) delta_angle[i] = alpha[i] + beta[i];
        samples = (samples + 1) % 4;
        published += samples == 0;
        return samples == 0;
    }
    void add(const Vector3f &gyro, float dt) { put(gyro, dt); }
};
"""
#: Several samples a call, in an array of structs, with an attitude that it returns.
SEVERAL = (
    "#define NUMBER double\n"
    + PARTS
    + """
typedef struct { double x, y, z; } sample_t;
typedef struct { double x, y, z, w; } quat_t;
quat_t step(quat_t q, const sample_t delta_angles[2])
{
    const sample_t *a = &delta_angles[0], *b = &delta_angles[1];
    const double k = FACTOR * 2.0 / 3, none[3] = {0, 0, 0};
    const double d[3] = {a->x + b->x + k * (a->y * b->z - a->z * b->y), a->y + b->y + k * (a->z * b->x - a->x * b->z),
                         a->z + b->z + k * (a->x * b->y - a->y * b->x)};
    double e[4] = {q.x, q.y, q.z, q.w};
    turned(e, none, d, e);
    const quat_t next = {e[0], e[1], e[2], e[3]};
    return next;
}
"""
)
#: A sampled gyro: the rates at two instants, by the trapezoid with the product of both.
INSTANTS = (
    "#define NUMBER double\n"
    + PARTS
    + """
static double before[3];
void begin(void) { before[0] = before[1] = before[2] = 0; }
void step(double q[4], const double gyro[3], double dt)
{
    double d[3], none[3] = {0, 0, 0};
    const double k = FACTOR * dt * dt / 12;
    d[0] = dt * (before[0] + gyro[0]) / 2 + k * (before[1] * gyro[2] - before[2] * gyro[1]);
    d[1] = dt * (before[1] + gyro[1]) / 2 + k * (before[2] * gyro[0] - before[0] * gyro[2]);
    d[2] = dt * (before[2] + gyro[2]) / 2 + k * (before[0] * gyro[1] - before[1] * gyro[0]);
    for (int i = 0; i < 3; i++) before[i] = gyro[i];
    turned(q, none, d, q);
}
"""
)
EIGEN = (
    "#define NUMBER double\n"
    + PARTS
    + """
#include <Eigen/Geometry>
struct Preintegration {
    Eigen::Vector3d last = Eigen::Vector3d::Zero();
    Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
    void integrate(const Eigen::Vector3d &gyro, double dt)
    {
        const Eigen::Vector3d d = gyro * dt;
        const Eigen::Vector3d v = d + (COEFFICIENT) * last.cross(d);
        const double a = v.norm();
        q = q * Eigen::Quaterniond(Eigen::AngleAxisd(a, v.normalized()));
        last = d;
    }
};
"""
)
#: A matrix of a type of its own, by rows, that is memory.
MATRIX = """
template <class T, int N, int M> class Matrix {
public:
    T operator()(int i, int j) const { return e[i][j]; }
    T &operator()(int i, int j) { return e[i][j]; }
protected:
    T e[N][M];
};
template <class T> class Vector3 : public Matrix<T, 3, 1> {
public:
    T operator()(int i) const { return this->e[i][0]; }
    T &operator()(int i) { return this->e[i][0]; }
};
typedef Matrix<double, 3, 3> Matrix3d;
typedef Vector3<double> Vector3d;
#include <math.h>
inline void update(Matrix3d *dcm, Vector3d *before, const Vector3d &d)
{
    const Vector3d &e = *before;
    const double k = COEFFICIENT;
    const double v[3] = {d(0) + k * (e(1) * d(2) - e(2) * d(1)), d(1) + k * (e(2) * d(0) - e(0) * d(2)),
                         d(2) + k * (e(0) * d(1) - e(1) * d(0))};
    const double a = v[0] * v[0] + v[1] * v[1] + v[2] * v[2], w = sqrt(a);
    const double s = a > 1e-8 ? sin(w) / w : 1 - a / 6, c = a > 1e-8 ? (1 - cos(w)) / a : 0.5 - a / 24;
    const double x[3][3] = {{0, -v[2], v[1]}, {v[2], 0, -v[0]}, {-v[1], v[0], 0}};
    Matrix3d m = *dcm;
    for (int i = 0; i < 3; i++) for (int j = 0; j < 3; j++) {
        double sum = 0;
        for (int l = 0; l < 3; l++) {
            const double one = (l == j) + s * x[l][j] + c * (v[l] * v[j] - (l == j) * a);
            sum += m(i, l) * one;
        }
        (*dcm)(i, j) = sum;
    }
    *before = d;
}
"""
#: Integers: increments of 2**-22 rad, an attitude with 30 bits behind the point.
INTEGER = """
#include <stdint.h>
static int32_t last[3];
void begin(void) { last[0] = last[1] = last[2] = 0; }
static int64_t product(int64_t a, int64_t b) { return (a * b + (1LL << 29)) >> 30; }
void step(int32_t q[4], const int32_t delta_angle[3])
{
    int64_t d[3], e[3], v[3], p[4], r[4];
    for (int i = 0; i < 3; i++) {
        d[i] = (int64_t)delta_angle[i] << 8; e[i] = (int64_t)last[i] << 8; last[i] = delta_angle[i];
    }
    v[0] = d[0] + FACTOR * (product(e[1], d[2]) - product(e[2], d[1])) / 12;
    v[1] = d[1] + FACTOR * (product(e[2], d[0]) - product(e[0], d[2])) / 12;
    v[2] = d[2] + FACTOR * (product(e[0], d[1]) - product(e[1], d[0])) / 12;
    const int64_t a = product(v[0], v[0]) + product(v[1], v[1]) + product(v[2], v[2]);
    const int64_t s = (1LL << 29) - a / 48 + product(a, a) / 3840;
    p[3] = (1LL << 30) - a / 8 + product(a, a) / 384;
    for (int i = 0; i < 3; i++) p[i] = product(s, v[i]);
    r[0] = product(q[3], p[0]) + product(q[0], p[3]) + product(q[1], p[2]) - product(q[2], p[1]);
    r[1] = product(q[3], p[1]) - product(q[0], p[2]) + product(q[1], p[3]) + product(q[2], p[0]);
    r[2] = product(q[3], p[2]) + product(q[0], p[1]) - product(q[1], p[0]) + product(q[2], p[3]);
    r[3] = product(q[3], p[3]) - product(q[0], p[0]) - product(q[1], p[1]) - product(q[2], p[2]);
    for (int i = 0; i < 4; i++) q[i] = (int32_t)r[i];
}
"""

RIGHT, WRONG = {"COEFFICIENT": "1.0 / 12"}, {"COEFFICIENT": "-1.0 / 12"}
EIGEN_HEADER = Path("/usr/include/eigen3/Eigen/Geometry")


def factor(right: str, wrong: str) -> tuple[dict[str, str], dict[str, str]]:
    return {"FACTOR": right, "COEFFICIENT": "0"}, {"FACTOR": wrong, "COEFFICIENT": "0"}


#: For each: file, text, function, what its names do not say, how it is read, its right and its wrong form, the cause.
INTEGRATORS = {
    "scalars": (
        *("a.c", SCALARS, "filter_update", {"init": "filter_begin"}),
        "filter_update(filter: memory, gx, gy, gz: rates[3] in rad/s, means, ax, ay, az: zeros[3], dt) "
        "-> filter.attitude[4]",
        *(RIGHT, WRONG, causes.WRONG_SIGN),
    ),
    "class": (
        *("a.cpp", CLASS, "Integrator::update"),
        {"init": "Integrator(1.0f)", "arguments": "rates, dt, =true -> self.attitude()"},
        "Integrator::update(gyro: rates[3] in rad/s, means, dt, armed: =true) -> self.attitude()[4]",
        *(RIGHT, WRONG, causes.WRONG_SIGN),
    ),
    "publishes": (
        *("a.cpp", PUBLISHES, "Integrator::put", {"arguments": "rates, dt -> self.delta_angle"}),
        "Integrator::put(gyro: rates[3] in rad/s, means, dt) -> self.delta_angle[3], a result every 4 calls",
        *(*factor("0.5", "1"), "coefficients of no single fault that is known, 2 of what coning needs"),
    ),
    "publishes as a counter says": (
        *("a.cpp", PUBLISHES, "Integrator::add"),
        {"arguments": "rates, dt -> self.delta_angle", "publishes": "self.published"},
        "Integrator::add(gyro: rates[3] in rad/s, means, dt) -> self.delta_angle[3], a result every 4 calls",
        *(*factor("0.5", "0"), causes.ABSENT),
    ),
    "several samples": (
        *("a.c", SEVERAL, "step", {}),
        "step(q: state[4], delta_angles: increments[2][3] in rad) -> next[4]",
        *(*factor("1", "0.5"), causes.FACTOR_TWO),
    ),
    "instants": (
        *("a.c", INSTANTS, "step", {"init": "begin", "takes": "instants"}),
        "step(q: state[4], gyro: rates[3] in rad/s at instants, dt) -> state[4]",
        *(*factor("1", "-1"), None),
    ),
    "Eigen": (
        *("a.hpp", EIGEN, "Preintegration::integrate", {"cflags": f"-I{EIGEN_HEADER.parents[1]}"}),
        "Preintegration::integrate(gyro: rates[3] in rad/s, means, dt) -> self.q[4]",
        *(RIGHT, WRONG, causes.WRONG_SIGN),
    ),
    "matrix": (
        *("a.h", MATRIX, "update", {"arguments": "state, before, increments -> state"}),
        "update(dcm: state[9], before: memory, d: increments[3] in rad) -> state[9]",
        *(RIGHT, WRONG, causes.WRONG_SIGN),
    ),
    "integers": (
        *("a.c", INTEGER, "step", {"init": "begin", "angle_unit": 2.0**-22, "state_bits": 30}),
        "step(q: state[4], delta_angle: increments[3] in 2.38419e-07 rad) -> state[4]",
        *(*factor("1", "-1"), causes.WRONG_SIGN),
    ),
}


def filled(text: str, words: dict[str, str]) -> str:
    for name, value in words.items():
        text = text.replace(name, value)
    return text


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(
            name, marks=[pytest.mark.needs("g++")] * ("a.c" not in INTEGRATORS[name]) + [pytest.mark.long]
        )
        for name in INTEGRATORS
    ],
)
def test_an_integrator_is_read_and_its_fault_named(outcome, name):
    if name == "Eigen" and not EIGEN_HEADER.is_file():
        pytest.skip("Eigen is not installed")
    file, text, function, how, reads, right, wrong, cause = INTEGRATORS[name]
    checked = outcome(filled(text, right), file=file, name=function, **how)
    assert checked.reading == f"reads: {reads}"
    assert (checked.cause, [each.name for each in checked.findings if each.holds is False]) == (None, [])
    checked = outcome(filled(text, wrong), file=file, name=function, **how)
    assert (checked.holds, checked.cause) == (False, cause)
    assert "drift" in [each.name for each in checked.findings if each.holds is False]


# What is read

QUATERNION_UNION = "typedef union { float a[4]; struct { float w, x, y, z; } e; } q_t; "
READ = [
    (
        "void f(float *q, const float *gyro, float dt);",
        "q: state[4], gyro: rates[3] in rad/s, means, dt) -> state[4]",
    ),
    (
        "void f(double dcm[3][3], const double delta_angle[][3]);",
        "dcm: state[9], delta_angle: increments[3] in rad) -> state[9]",
    ),
    (
        "void f(const double q[4], double q_out[4], const double dtheta[3]);",
        "q: state[4], q_out: next[4], dtheta: increments[3] in rad) -> next[4]",
    ),
    (
        "typedef struct { double q0, q1, q2, q3; } m; void f(m *self, double p, double q, double r, double h);",
        "self: memory, p, q, r: rates[3] in rad/s, means, h: dt) -> self.q0 q1 q2 q3[4]",
    ),
    (
        "float q0, q1, q2, q3; void f(float gx, float gy, float gz, float mx, float my, float mz, float dt);",
        "gx, gy, gz: rates[3] in rad/s, means, mx, my, mz: zeros[3], dt) -> global q0 q1 q2 q3[4]",
    ),
    (
        "struct s { int k; }; void f(struct s *s, double quaternion[4], const double omega[3], unsigned dt_us);",
        "s: memory, quaternion: state[4], omega: rates[3] in rad/s, means, dt_us) -> state[4]",
    ),
    (
        QUATERNION_UNION + "q_t f(q_t q, const float d_angle[6]);",
        "q: state[4], d_angle: increments[2][3] in rad) -> next[4]",
    ),
    (
        "void f(float gx, float gy, float gz, float dt, float *q0, float *q1, float *q2, float *q3);",
        "gx, gy, gz: rates[3] in rad/s, means, dt, q0, q1, q2, q3: state[4]) -> state[4]",
    ),
    (
        "void f(double q0, double q1, double q2, double q3, const double dtheta[3], double *out0, double *out1, "
        "double *out2, double *out3);",
        "q0, q1, q2, q3: state[4], dtheta: increments[3] in rad, out0, out1, out2, out3: next[4]) -> next[4]",
    ),
    (
        "typedef struct { double bias, w, x, y, z; } m; void f(m *self, double p, double q, double r, double dt);",
        "self: memory, p, q, r: rates[3] in rad/s, means, dt) -> self.w x y z[4]",
    ),
    (
        "void f(const double gyro[3], double dt, double rotation_vector[3]);",
        "gyro: rates[3] in rad/s, means, dt, rotation_vector: rotation[3]) -> rotation[3]",
    ),
    (
        "typedef struct { float quat[4]; int k; } m; void f(const m *set, m *m, float gyro[3], float dt);",
        "set: memory, m: memory, gyro: rates[3] in rad/s, means, dt) -> m.quat[4]",
    ),
]


@pytest.mark.parametrize(("text", "reads"), READ)
def test_a_signature_says_what_is_what(tmp_path, text, reads):
    (tmp_path / "a.c").write_text(text)
    source = read_source(tmp_path / "a.c", "f")
    takes = "rates" if source.arguments.named("rates") else "increments"
    assert in_words("f", source.arguments, takes, "rad") == f"f({reads}"


@pytest.mark.parametrize(
    ("text", "options", "says"),
    [
        (
            "void f(double q[4], const double v[3]);",
            {},
            "what `const double v.3.` is, its name does not say; --arg",
        ),
        (
            "void f(double q[4], const double gyro[3]);",
            {},
            "may be an increment or a rate, since f takes no",
        ),
        (
            "void f(double q[4], double gyro_dps[3], double dt);",
            {},
            "names degrees; --angle-unit deg or --angle-unit",
        ),
        (
            "void f(const double gyro[3], double dt);",
            {},
            "the attitude that it computes is nowhere that its name says",
        ),
        (
            "typedef struct { float q[4], quat[4]; int k; } m; void f(m *m, float gyro[3], float dt);",
            {},
            "may be m.q or m.quat; --arguments says it behind the arrow",
        ),
        (
            "void f(double q[4], double gyro[3], double dt, int mode);",
            {},
            "what `int mode` is, its name does not say",
        ),
        (
            "void f(double q[4], double gyro[3], double dt, int mode);",
            {"text": "state, rates, dt -> state"},
            "leaves out `int mode` of f; what it is has to be said, a constant for instance as =0",
        ),
        (
            "void f(double q[4], double gyro[3]);",
            {"text": "state, rates, dt -> state"},
            "f takes no argument for dt; it takes double q.4., double gyro.3.",
        ),
        (
            "void f(double q[4], double g[5]);",
            {"text": "state, rates -> state"},
            "rates is `double g.5.` with 5",
        ),
        (
            "typedef struct { double q[5]; } m; void f(m *m, double gyro[3], double dt);",
            {"text": "m, rates, dt -> m.p"},
            "the result m.p is not in .*a.c",
        ),
        (
            "void f(double q[4], double gyro[3], double dt);",
            {"publishes": "count"},
            "--publishes is 'count'; a whole number from 1 to 64, or a number that changes with every result",
        ),
        (
            "void f(double q[4], double e[1][3], double gyro[3], double dt);",
            {"text": "state, previous, rates, dt -> state", "publishes": "3"},
            "--publishes does not go with the argument previous",
        ),
        (
            "void f(double q[4], double gyro[3], double dt); void b(int k);",
            {"init": "b"},
            r"b of --init does not take the memory, the state or nothing: `int k`; --init \"b\(...\)\" states",
        ),
        ("void f(double q[4]);", {"compile_commands": "none.json"}, "none.json cannot be read: No such file"),
    ],
)
def test_what_a_source_leaves_open_is_refused_in_one_line(tmp_path, text, options, says):
    (tmp_path / "a.c").write_text(text)
    with pytest.raises(InputError, match=says) as caught:
        read_source(tmp_path / "a.c", "f", **options)
    assert "\n" not in str(caught.value)


@pytest.mark.needs("g++")
def test_a_function_of_several_meanings_is_told_by_its_parameters(tmp_path):
    (tmp_path / "a.hpp").write_text(
        "struct A { void f(double q[4], const double gyro[3], double dt); void f(int k); };\nvoid g(double &x);"
    )
    with pytest.raises(
        InputError, match=r'f has several meanings; one of "f\(double \*, const double \*, double\)"'
    ):
        read_source(tmp_path / "a.hpp", "A::f")
    source = read_source(tmp_path / "a.hpp", "A::f(double*, const double*, double)")
    assert [each.name for each in source.arguments.parameters] == ["self", "state", "rates", "dt"]


@pytest.mark.needs("g++")
def test_parameters_with_a_default_value_are_left_out(tmp_path):
    (tmp_path / "a.hpp").write_text(
        "void f(double *dcm, const double *gyro, double dt, int mode = 0, bool b = true);"
    )
    source = read_source(tmp_path / "a.hpp", "f")
    assert in_words("f", source.arguments, "rates", "rad") == (
        "f(dcm: state[9], gyro: rates[3] in rad/s, means, dt) -> state[9]"
    )
    assert "f(strapgen_of_dcm.of, strapgen_of_gyro.of, strapgen_of_dt.of);" in bridge_text(source)


@pytest.mark.needs("g++")
def test_an_attitude_without_access_is_read_from_its_private_field(tmp_path):
    text = "class A { public: void f(float gx, float gy, float gz, float dt); %s private: float q0, q1, q2, q3; };"
    for public, wanted in (("", "self.q0 q1 q2 q3"), ("const float *data(); float quat[4];", "self.quat")):
        (tmp_path / "a.hpp").write_text(text % public)
        assert read_source(tmp_path / "a.hpp", "A::f").arguments.result.name == wanted


# How it is compiled

PLAIN = "void f(double q[4], const double gyro[3], double dt) { NUMBER x = gyro[0] * dt * helper(); q[0] += x; }\n"


def test_further_files_and_options_are_compiled(tmp_path, monkeypatch):
    (tmp_path / "include").mkdir()
    (tmp_path / "include" / "helper.h").write_text("double helper(void);\n")
    (tmp_path / "a.c").write_text(f'#include "helper.h"\n{PLAIN}')
    (tmp_path / "helper.c").write_text("static double x = 2; double helper(void) { return x; }\n")
    entry = {
        "directory": str(tmp_path),
        "file": "a.c",
        "command": "cc -Iinclude -DNUMBER=double -O3 -c a.c -o a.o",
    }
    (tmp_path / "compile_commands.json").write_text(json.dumps([entry]))
    monkeypatch.chdir(tmp_path)
    rows, wanted = [[1, 0.5, 0.5, 3, 0, 0]], [[4, 0, 0, 1]]
    for options in ({"cflags": "-Iinclude -DNUMBER=double"}, {"compile_commands": "compile_commands.json"}):
        source = read_source("a.c", "f", sources=["helper.c"], **options)
        np.testing.assert_array_equal(
            run_foreign(compile_foreign(source), [1, 0, 0, 1], rows).outputs, wanted
        )
    with pytest.raises(InputError, match=r"compile_commands\.json has no entry of helper\.c"):
        read_source("helper.c", "f", compile_commands="compile_commands.json")


@pytest.mark.parametrize(
    ("angle", "cause"),
    [
        pytest.param("(int32_t)((uint32_t)delta_angle[i] << 8)", None, marks=pytest.mark.long),
        (  # 2**31 is passed at 25 rad/s
            "(int32_t)((uint32_t)delta_angle[i] << 11) / 8",
            "at 30 rad/s (1719 deg/s) its integers overflow: a call turns wrong by 1.67 of it; it holds up to 15 rad/s",
        ),
    ],
)
def test_integers_that_overflow_in_a_fast_motion_are_seen(outcome, angle, cause):
    text = INTEGER.replace("FACTOR", "1").replace("(int64_t)delta_angle[i] << 8", angle)
    checked = outcome(text, init="begin", angle_unit=2.0**-22, state_bits=30)
    assert [finding.name for finding in checked.findings if finding.holds is False] == (
        ["fast"] if cause else []
    )
    assert checked.cause == cause


#: Takes an angle of so many counts for a larger one, in one direction or in both.
CLAMPED = "(int64_t)(delta_angle[i] {} ? {} : delta_angle[i]) << 8"


@pytest.mark.long
@pytest.mark.parametrize(
    ("part", "is_below", "holds"), [(0.96, False, True), (0.9, False, False), (0.9, True, False)]
)
def test_integers_that_miss_a_small_part_of_a_fast_rotation(outcome, part, is_below, holds):
    counts = int(0.3 * part * 2**22)  # 0.3 rad is that of 30 rad/s
    angle = CLAMPED.format(f"< -{counts}", -counts) if is_below else CLAMPED.format(f"> {counts}", counts)
    text = INTEGER.replace("FACTOR", "1").replace("(int64_t)delta_angle[i] << 8", angle)
    checked = outcome(text, init="begin", angle_unit=2.0**-22, state_bits=30)
    assert [each.holds for each in checked.findings if each.name == "fast"] == [holds]


def test_separate_pointers_get_the_attitude(tmp_path):
    (tmp_path / "a.c").write_text(
        "void f(double *q0, double *q1, double *q2, double *q3, const double dtheta[3])\n"
        "{ *q0 += dtheta[0]; *q1 += 2 * *q0; *q2 = *q3; }\n"
    )
    for text in (None, "state, increments -> state"):
        step = ForeignStep(read_source(tmp_path / "a.c", "f", text))
        (done,) = step.run([Segment(np.full((2, 1, 3), 0.5), settled=False)]).segments
        np.testing.assert_array_equal(done.states, [[0.5, 1, 1, 1], [1, 3, 1, 1]])


@pytest.mark.parametrize(
    ("number", "arguments", "hz", "says"),
    [
        (
            "int dt",
            None,
            100,
            "`int dt` is a whole number, and the interval is 0.01 s; --arguments with dt_ms or",
        ),
        (
            "int dt_ms",
            None,
            400,
            "`int dt_ms` is a whole number, and the interval is 2.5 ms; --sample-hz states",
        ),
        (
            "unsigned n",
            "state, rates, step -> state",
            100,
            "`unsigned n` is a whole number, and the interval is 0.01",
        ),
        ("unsigned dt_us", None, 400, None),
        ("int dt", "state, rates, dt_ms -> state", 100, None),
        ("int dt", None, 1, None),
    ],
)
def test_an_interval_that_is_no_whole_number_is_refused(tmp_path, number, arguments, hz, says):
    (tmp_path / "a.c").write_text(
        f"void f(double q[4], const double gyro[3], {number}) {{ q[0] += gyro[0]; }}\n"
    )
    source = read_source(tmp_path / "a.c", "f", arguments)
    if says is None:
        assert ForeignStep(source, takes="rates", interval=Fraction(1, hz)).samples == 1
    else:
        with pytest.raises(InputError, match=says):
            ForeignStep(source, takes="rates", interval=Fraction(1, hz))


@pytest.mark.needs("g++")
def test_memory_is_made_by_its_constructor(tmp_path):
    (tmp_path / "a.hpp").write_text(
        "struct Gain { explicit Gain(double k) : k(k) {} double k, q[4] = {0, 0, 0, 1};\n"
        "    void update(const double dtheta[3]) { q[0] += k * dtheta[0]; } };\n"
        "inline void f(Gain &gain, const double dtheta[3]) { gain.update(dtheta); }\n"
    )
    for function in ("Gain::update", "f"):
        with pytest.raises(
            InputError, match=r'Gain has no constructor without arguments; --init "Gain\(...\)" states'
        ):
            read_source(tmp_path / "a.hpp", function)
        step = ForeignStep(read_source(tmp_path / "a.hpp", function, init="Gain(3)"))
        (done,) = step.run([Segment(np.full((1, 1, 3), 0.5), settled=False)]).segments
        np.testing.assert_array_equal(done.states, [[1.5, 0, 0, 1]])


@pytest.mark.parametrize(
    ("line", "differs"),
    [
        ("", True),
        pytest.param("for (int i = 0; i < 3; i++) filter->last[i] = 0;", False, marks=pytest.mark.long),
    ],
)
def test_what_init_leaves_of_an_earlier_run_is_a_measurement(outcome, line, differs):
    begin = "filter->attitude.w = 1; filter->attitude.x = filter->attitude.y = filter->attitude.z = 0;"
    text = filled(SCALARS, RIGHT).replace("filter->attitude.w = 1;", begin + line)
    checked = outcome(text, name="filter_update", init="filter_begin")
    said = [each for each in checked.findings if each.name == "used memory"]
    assert (checked.holds, [each.holds for each in said]) == (True, [None] * differs)
    assert all("filter_begin leaves something of an earlier run, by which" in each.text for each in said)


@pytest.mark.long
@pytest.mark.needs("g++")
def test_a_correction_that_is_not_reset_is_named(outcome):
    text = filled(PUBLISHES, factor("0.5", "")[0]).replace("alpha[i] = beta[i] = 0;", "alpha[i] = 0;")
    checked = outcome(text, "rates, dt -> self.delta_angle", file="a.cpp", name="Integrator::put")
    (said,) = (each.text for each in checked.findings if each.name == "coefficients")
    assert (checked.cause, checked.cause_confidence) == (causes.STAYS, None)
    assert said.endswith("with what later calls add 3.000 of what coning needs")


def test_the_limit_of_the_drift_is_shown_and_what_rounding_hides(outcome):
    text = filled(INTEGER, {"FACTOR": "1"})
    checked = outcome(text, init="begin", angle_unit=2.0**-22, state_bits=30)
    said = {each.name: each for each in checked.findings}
    assert "rounding to int32 hides" in said["order"].text
    limit = f"; limit {said['drift'].allowed:.4g}, of which rounding to int32 hides "
    assert limit in said["drift"].text and said["drift"].text.endswith(", limit 11.74")


def test_integers_are_fed_without_a_sum_of_roundings(tmp_path):
    (tmp_path / "a.c").write_text(
        "void f(short q[4], const int delta_angle[3]) { q[0] = (short)(q[0] + delta_angle[0]); q[3] = 0; }\n"
    )
    source = read_source(tmp_path / "a.c", "f")
    assert source.precision == "int16"
    with pytest.raises(InputError, match="f computes in int16; --angle-unit is needed"):
        ForeignStep(source)
    with pytest.raises(InputError, match="f computes an attitude in integers; --state-bits is needed"):
        ForeignStep(source, angle_unit=0.1)
    step = ForeignStep(source, angle_unit=0.1, state_bits=3)
    increments = np.tile([0.04, 0, 0], (10, 1, 1))
    (done,) = step.run([Segment(increments, settled=False)]).segments
    counts = [0, 1, 1, 2, 2, 2, 3, 3, 4, 4]  # of 0.4, 0.8, 1.2, ... counts
    np.testing.assert_array_equal(done.states[:, 0], np.array(counts) / 8)


def test_degrees_are_fed_and_read(tmp_path):
    (tmp_path / "a.c").write_text(
        "void f(const double gyro_dps[3], double dt, double rotation[3])\n"
        "{ for (int i = 0; i < 3; i++) rotation[i] = gyro_dps[i] * dt; }\n"
    )
    source = read_source(tmp_path / "a.c", "f", is_angle_said=True)
    step = ForeignStep(source, takes="rates", angle_unit=angle_unit("deg"))
    (done,) = step.run([Segment(np.full((2, 1, 3), 0.01), settled=False)]).segments
    np.testing.assert_allclose(done.states, np.full((2, 3), 0.01), rtol=1e-14)
    assert (
        step.reading
        == "reads: f(gyro_dps: rates[3] in deg/s, means, dt, rotation: rotation[3]) -> rotation[3]"
    )


def test_a_result_at_irregular_calls_is_a_finding(tmp_path):
    (tmp_path / "a.c").write_text(
        "static int k; int f(double q[4], const double gyro[3], double dt)\n"
        "{ q[0] += gyro[0] * dt; k++; return k % 3 == 0 && (k < 200 || k % 2); }\n"
    )
    step = ForeignStep(read_source(tmp_path / "a.c", "f"), takes="rates")
    assert step.samples == 3
    done = step.run([Segment(np.zeros((80, 3, 3)))])
    assert done.stopped == "it has its result after another number of calls than before"


def test_the_old_name_of_rates_at_instants_warns(tmp_path):
    (tmp_path / "a.c").write_text(filled(INSTANTS, {"FACTOR": "1", "COEFFICIENT": "0"}))
    source = read_source(tmp_path / "a.c", "step", init="begin", takes="rates-at-ends")
    with pytest.warns(DeprecationWarning, match="--input rates-at-ends is now --input instants"):
        assert ForeignStep(source, takes="rates-at-ends").takes == "instants"


# The command


@pytest.fixture
def check(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path):
    """Run the command in a folder and return its exit status, its output and its messages."""
    monkeypatch.chdir(tmp_path)

    def run(words: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(["check", *shlex.split(words)])
        said = capsys.readouterr()
        return stop.value.code or 0, said.out, said.err

    return run


def test_the_shim_is_shown_and_kept(check, tmp_path):
    (tmp_path / "a.c").write_text(
        "void f(double q[4], const double gyro[3], double dt) { q[0] += gyro[0] * dt; }\n"
    )
    status, printed, said = check("a.c --function f --show-shim --keep-shim shim.c")
    assert (status, said) == (0, "wrote shim.c\n")
    assert printed.strip() == (tmp_path / "shim.c").read_text().strip()
    assert "f(strapgen_of_q.of, strapgen_of_gyro.of, strapgen_of_dt.of);" in printed


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (
            "--function f --keep-shim a.c",
            "--keep-shim a.c is a file that the command reads; another one is needed",
        ),
        (
            "--function f --angle-unit grad",
            "--angle-unit is 'grad'; rad, deg, or the rad of a count as 2..-20 is needed",
        ),
        ("--function f --angle-unit 2**-5000", "--angle-unit is '2..-5000'; rad, deg"),
        ("--function f --state-bits 63", "--state-bits is 63; a whole number from 0 to 62 is needed"),
        ("--function f --publishes 65", "--publishes is 65; a whole number from 1 to 64 is needed"),
        ("--function f --source none.c", "none.c is no file"),
        ("--function f --source a.txt", "a.txt is no file in C or C.. by its suffix"),
        (
            "--function f --cflags '-DX=\"'",
            "--cflags is .*; an option has a quotation mark that is not closed",
        ),
        (
            "--function f --compile-commands a.c",
            "a.c is no list of compile commands with directory, file and command",
        ),
        ("--function f --init 'b(1)'", "--init: a.c has no function b; it has w, f"),
        (
            "--function w --scalar first",
            "--scalar first contradicts the source, whose names say which element is",
        ),
        (
            "--function f --precision float",
            "does not take these --arguments in --precision float: .const double gyro.3.. is",
        ),
        ("--function g::f", "--function: a.c has no function g::f"),
    ],
)
def test_wrong_options_get_one_line_and_status_2(check, tmp_path, words, says):
    (tmp_path / "a.c").write_text(
        "typedef struct { double w, x, y, z; } q_t; void w(q_t *q, const double gyro[3], double dt) { q->w += dt; }\n"
        "void f(double q[4], const double gyro[3], double dt) { q[0] += gyro[0] * dt; }\n"
    )
    status, printed, said = check(f"a.c {words}")
    assert (status, printed) == (2, "")
    assert said.startswith("strapgen: ") and said.count("\n") == 1
    assert re.search(says, said), said


def test_without_libclang_one_line_says_what_to_install(check, tmp_path, monkeypatch):
    (tmp_path / "a.c").write_text(
        "void f(double q[4], const double gyro[3], double dt) { q[0] += gyro[0] * dt; }\n"
    )
    monkeypatch.setitem(__import__("sys").modules, "clang.cindex", None)
    status, printed, said = check("a.c --function f")
    assert (status, printed) == (2, "")
    assert (
        said == "strapgen: the signature of a function is read by libclang: pip install 'strapgen[check]'\n"
    )
