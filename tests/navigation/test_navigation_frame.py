"""The kernels of the navigation frame against the equations that they stand for, exactly."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import numpy as np
import pytest
import sympy as sp
from derived import precisely

import strapgen
from strapgen import derive
from strapgen.kernel.algebra import cross, rotation
from strapgen.kernel.kernel import Kernel
from strapgen.navigation.frame.frame_rates import AZIMUTHS, Earth

PRECISE = mpmath.mp.clone()
PRECISE.dps = 40


def expressions(kernel: Kernel, **values) -> list[sp.Matrix]:
    """Return the outputs as columns, inputs in their own symbols but for elements that have values."""
    names = [name for signal in kernel.inputs for name in signal.elements]
    known = {name: sp.sympify(values.get(name, sp.Symbol(name, real=True))) for name in names}
    return [sp.Matrix(elements) for elements in kernel.expand(known).values()]


def vector(prefix: str) -> sp.Matrix:
    return sp.Matrix([sp.Symbol(f"{prefix}_{axis}", real=True) for axis in "xyz"])


def axis_of_earth() -> sp.Matrix:
    return sp.Matrix([sp.Symbol(f"P_3{k}", real=True) for k in "123"])


@pytest.mark.parametrize("azimuth", AZIMUTHS)
def test_without_eccentricity_the_ellipsoid_turns_the_frame_as_the_sphere_does(azimuth):
    (sphere,) = expressions(derive(f"{azimuth}-rate-sphere"))
    (ellipsoid,) = expressions(derive(f"{azimuth}-rate-ellipsoid"), eccentricity_squared=0)
    assert (ellipsoid - sphere).applyfunc(sp.cancel) == sp.zeros(3, 1)
    (eccentric,) = expressions(derive(f"{azimuth}-rate-ellipsoid"))
    point = {symbol: sp.Rational(1, 64) for symbol in eccentric.free_symbols}
    assert eccentric.subs(point)[0] != sphere.subs(point)[0]


def test_without_flattening_normal_gravity_is_that_of_a_sphere_that_does_not_turn():
    nothing = {"eccentricity_squared": 0, "gravity_increase": 0, "flattening": 0, "centrifugal_ratio": 0}
    (ellipsoid,) = expressions(derive("gravity-ellipsoid"), **nothing)
    (sphere,) = expressions(derive("gravity-sphere"), centrifugal=0)
    ellipsoid = ellipsoid.subs(sp.Symbol("equator_gravity", real=True), sp.Symbol("gravitation", real=True))
    assert (ellipsoid - sphere).applyfunc(sp.simplify) == sp.zeros(3, 1)


def test_gravity_of_the_sphere_is_gravitation_and_centrifugal_acceleration_once():
    (gravity,) = expressions(derive("gravity-sphere"))
    mu, R, We, h = sp.symbols("mu R We h", positive=True)
    c = axis_of_earth()
    r = sp.Matrix([0, 0, R + h])
    W = We * c
    stated = sp.Matrix([0, 0, -mu / (R + h) ** 2]) - cross(W, cross(W, r))
    constants = {"height": h, "curvature": 1 / R, "gravitation": mu / R**2, "centrifugal": We**2 * R}
    computed = gravity.subs({sp.Symbol(name, real=True): value for name, value in constants.items()})
    of_length_one = {c[0] ** 2: 1 - c[1] ** 2 - c[2] ** 2}
    assert (computed - stated).applyfunc(lambda x: sp.simplify(sp.expand(x).subs(of_length_one))) == sp.zeros(
        3, 1
    )


@pytest.mark.long
def test_the_equations_are_newtons_in_inertial_axes():
    # In axes n: V = v + W x r, and the inertial acceleration is dV/dt + (W + rho) x V, with dW/dt = -rho x W and
    # dr/dt = v - rho x r = (0, 0, v_z) over the sphere. It is specific force and gravitation.
    (rate,) = expressions(derive("wander-rate-sphere"))
    (acceleration,) = expressions(derive("coriolis-gravity"))
    v, W, f, gravitation = vector("v"), vector("W"), vector("f"), vector("gravitation")
    r, rho_z = sp.symbols("r rho_z", positive=True)
    radius = sp.Matrix([0, 0, r])
    rho = rate.subs(sp.Symbol("height", real=True), r - 1 / sp.Symbol("curvature", real=True))
    rho = rho.applyfunc(sp.simplify) + sp.Matrix([0, 0, rho_z])  # in any mode
    assert (v - cross(rho, radius) - sp.Matrix([0, 0, v[2]])).applyfunc(sp.simplify) == sp.zeros(3, 1)
    gravity = gravitation - cross(W, cross(W, radius))
    known = dict(zip([*vector("g"), *vector("rho")], [*gravity, *rho], strict=True))
    dv = f + acceleration.subs(known, simultaneous=True)
    dr = sp.Matrix([0, 0, v[2]])
    inertial = dv - cross(cross(rho, W), radius) + cross(W, dr) + cross(W + rho, v + cross(W, radius))
    assert (inertial - f - gravitation).applyfunc(sp.simplify) == sp.zeros(3, 1)


def test_each_mode_turns_about_the_vertical_as_it_says():
    (W,) = expressions(derive("earth-rate"))
    c = axis_of_earth()
    for shape in ("sphere", "ellipsoid"):
        (wander,), (free,), (north,) = (
            expressions(derive(f"{azimuth}-rate-{shape}")) for azimuth in AZIMUTHS
        )
        assert wander[2] == 0
        assert sp.expand(free[2] + W[2]) == 0  # nothing against inertial axes
        # The axis of the earth keeps off x: dC31/dt = -(rho x c)_x = 0 at C31 = 0.
        turned = -cross(north, c)[0].subs(c[0], 0).subs(sp.Max(sp.Rational(1, 64), c[1]), c[1])
        assert sp.simplify(turned) == 0
        assert sp.simplify(-cross(wander, c)[0].subs(c[0], 0)) != 0


def test_the_ellipsoid_has_its_radii_at_every_wander_angle(rng):
    kernel = derive("wander-rate-ellipsoid")
    a, e2 = PRECISE.mpf(6378137), PRECISE.mpf("0.00669437999014")
    for latitude, wander, east, north, h in rng.uniform(-1, 1, (20, 5)) * [1.55, 3, 500, 500, 2e4]:
        L, A, E, N, h = map(PRECISE.mpf, (latitude, wander, east, north, h))
        s, c, sa, ca = PRECISE.sin(L), PRECISE.cos(L), PRECISE.sin(A), PRECISE.cos(A)
        transverse = a / PRECISE.sqrt(1 - e2 * s**2)
        meridian = a * (1 - e2) / PRECISE.sqrt(1 - e2 * s**2) ** 3
        stated = -N / (meridian + h), E / (transverse + h)  # about east, about north
        values = {name: PRECISE.mpf(0) for signal in kernel.inputs for name in signal.elements}
        values |= {"P_31": c * sa, "P_32": c * ca, "P_33": s, "height": h, "curvature": 1 / a}
        values |= {"eccentricity_squared": e2, "v_x": ca * E + sa * N, "v_y": ca * N - sa * E}
        found = precisely(kernel, values)
        x, y = found["rho_x"], found["rho_y"]
        assert abs(ca * x - sa * y - stated[0]) < 1e-14 * (abs(stated[0]) + abs(stated[1]))
        assert abs(sa * x + ca * y - stated[1]) < 1e-14 * (abs(stated[0]) + abs(stated[1]))


def level_ellipsoid(a, f, mu, We, latitude, h):
    """Return normal gravity to north and up by its closed form in ellipsoidal coordinates, NIMA TR8350.2, chapter 4."""
    p = PRECISE
    b = a * (1 - f)
    E = p.sqrt(a**2 - b**2)
    N = a**2 / p.sqrt((a * p.cos(latitude)) ** 2 + (b * p.sin(latitude)) ** 2)
    rho, z = (N + h) * p.cos(latitude), (N * (b / a) ** 2 + h) * p.sin(latitude)
    square = rho**2 + z**2 - E**2
    u = p.sqrt((square + p.sqrt(square**2 + 4 * E**2 * z**2)) / 2)
    beta = p.atan2(z * p.sqrt(u**2 + E**2), u * rho)

    def q(u):
        return ((1 + 3 * u**2 / E**2) * p.atan(E / u) - 3 * u / E) / 2

    dq = 3 * (1 + u**2 / E**2) * (1 - u / E * p.atan(E / u)) - 1
    w = p.sqrt((u**2 + (E * p.sin(beta)) ** 2) / (u**2 + E**2))
    common = We**2 * a**2 / q(b)
    along_u = (
        -(mu / (u**2 + E**2) + common * E / (u**2 + E**2) * dq * (p.sin(beta) ** 2 / 2 - p.mpf(1) / 6)) / w
    )
    along_u += We**2 * u * p.cos(beta) ** 2 / w
    along_beta = (
        (common / p.sqrt(u**2 + E**2) * q(u) - We**2 * p.sqrt(u**2 + E**2)) * p.sin(beta) * p.cos(beta) / w
    )
    of_rho = u / (w * p.sqrt(u**2 + E**2)) * p.cos(beta) * along_u - p.sin(beta) / w * along_beta
    of_z = p.sin(beta) / w * along_u + u / (w * p.sqrt(u**2 + E**2)) * p.cos(beta) * along_beta
    north = -p.sin(latitude) * of_rho + p.cos(latitude) * of_z
    up = p.cos(latitude) * of_rho + p.sin(latitude) * of_z
    return north, up


def test_normal_gravity_is_that_of_the_level_ellipsoid():
    # On the ellipsoid Somigliana's formula is exact. With u = h/a, the factor of the height leaves out f^2 u and f u^2
    # (and f m u, as large as f^2 u), and so does the part along north, of which it is the slope.
    kernel = derive("gravity-ellipsoid")
    constants = {name: PRECISE.mpf(value) for name, value in Earth.wgs84().constants.items()}
    a, mu, We = PRECISE.mpf(6378137), PRECISE.mpf("3.986004418e14"), PRECISE.mpf("7.292115e-5")
    f = 1 / PRECISE.mpf("298.257223563")
    for h in (0, 1000, 10000, 20000):
        allowed = 1e-11 + 9.83 * (h / a) * (7 * f**2 + 2 * f * h / a)
        for latitude in (0, 0.3, 0.8, -1.2, 1.57):
            s, c = PRECISE.sin(latitude), PRECISE.cos(latitude)
            values = {name: PRECISE.mpf(0) for signal in kernel.inputs for name in signal.elements}
            values |= constants | {"P_32": c, "P_33": s, "height": PRECISE.mpf(h)}
            computed = precisely(kernel, {k: v for k, v in values.items() if k != "sidereal_rate"})
            north, up = level_ellipsoid(a, f, mu, We, PRECISE.mpf(latitude), PRECISE.mpf(h))
            assert abs(computed["g_z"] - up) < allowed, (h, latitude)
            assert abs(computed["g_y"] - north) < allowed, (h, latitude)
            assert computed["g_x"] == 0
    assert abs(north) < abs(up) * 1e-4


def test_the_position_turns_by_the_transport_rate_to_second_order():
    position, handed_on = expressions(derive("position-step"))
    P = sp.Matrix(3, 3, [sp.Symbol(f"P_{j}{k}", real=True) for j in "123" for k in "123"])
    rho, before = vector("rho"), vector("previous_rho")
    zeta = sp.Symbol("cycle", real=True) * (3 * rho - before) / 2
    assert (sp.Matrix(3, 3, list(position)) - P * rotation(zeta, 2)).expand() == sp.zeros(3, 3)
    assert handed_on == rho
    # A rate that is linear in time is integrated exactly: w0 + w1 t over a cycle, w0 - w1 T a cycle before.
    w0, w1, T = vector("w0"), vector("w1"), sp.Symbol("cycle", real=True)
    linear = zeta.subs(dict(zip([*rho, *before], [*w0, *(w0 - w1 * T)], strict=True)), simultaneous=True)
    assert (linear - w0 * T - w1 * T**2 / 2).expand() == sp.zeros(3, 1)


def test_velocity_and_height_follow_their_equations():
    v, a, before, change, later = (vector(p) for p in ("v", "a", "previous_a", "change", "next_v"))
    T, h = sp.symbols("cycle height", real=True)
    stated = v + change + T * (3 * a - before) / 2
    velocity, handed_on = expressions(derive("velocity-step"))
    assert (velocity - stated).expand() == sp.zeros(3, 1) and handed_on == a
    level, _ = expressions(derive("velocity-step-level"))
    stated[2] = v[2]
    assert (level - stated).expand() == sp.zeros(3, 1)
    (height,) = expressions(derive("height-step"))
    assert sp.expand(height[0] - h - T * (v[2] + later[2]) / 2) == 0
    (turn,) = expressions(derive("navigation-turn"))
    assert (turn - T * (vector("W") + vector("rho"))).expand() == sp.zeros(3, 1)


@pytest.mark.parametrize("slow_cycles", [1, 2, 5])
def test_a_turn_that_is_held_ahead_makes_the_trapezoidal_rule_exact(slow_cycles):
    # The rate is w0 + w1 t; navigation cycles of T begin at -T, 0 and T, and hold their turns over m slow cycles.
    T, w0, w1 = sp.Symbol("T"), vector("w0"), vector("w1")
    lead = sp.Rational(1, 2) + sp.Rational(1, 2 * slow_cycles)
    turns = []
    for start in (-T, 0, T):
        rate, before = (w0 + w1 * t for t in (start, start - T))
        values = dict(zip([f"before_{k}" for k in "xyz"], before, strict=True))
        values |= dict(zip([f"rho_{k}" for k in "xyz"], rate, strict=True)) | dict.fromkeys(
            ("W_x", "W_y", "W_z"), 0
        )
        turn, handed_on = expressions(
            derive("navigation-turn-ahead"), **values, cycle=T / slow_cycles, lead=lead
        )
        assert (handed_on - rate).expand() == sp.zeros(3, 1)
        turns.append(turn)
    rule = derive("navigation-rotation")
    for before, held, start in ((turns[0], turns[1], 0), (turns[1], turns[2], T)):
        theta = sp.zeros(3, 1)
        for _ in range(slow_cycles):
            signals = zip(rule.inputs, (theta, before, held), strict=True)
            values = {n: x for s, array in signals for n, x in zip(s.elements, array, strict=True)}
            theta, before = expressions(rule, **values)
        assert (theta - w0 * T - w1 * ((start + T) ** 2 - start**2) / 2).expand() == sp.zeros(3, 1)


def test_the_direction_cosines_of_a_position_are_those_of_the_frame(rng):
    position, angles = (
        strapgen.evaluator("position-from-angles"),
        strapgen.evaluator("geographic-angles"),
    )
    geographic = rng.uniform(-1, 1, (400, 3)) * [np.pi / 2, np.pi, np.pi]
    geographic[:100, 0] = np.sign(geographic[:100, 0]) * (np.pi / 2 - 10.0 ** rng.uniform(-12, -1, 100))
    P = position(geographic)
    latitude, longitude, wander = geographic.T
    up = np.stack(
        [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)], -1
    )
    east = np.stack([-np.sin(longitude), np.cos(longitude), 0 * longitude], -1)
    north = np.cross(up, east)
    np.testing.assert_allclose(P[..., 2], up, atol=4e-16)
    x = np.cos(wander)[:, None] * east + np.sin(wander)[:, None] * north
    np.testing.assert_allclose(P[..., 0], x, atol=8e-16)
    np.testing.assert_allclose(P[..., 1], np.cross(up, x), atol=8e-16)
    again = angles(P, np.zeros(3))
    np.testing.assert_allclose(position(again), P, atol=2e-15)  # at the poles too
    np.testing.assert_allclose(again[100:], geographic[100:], atol=1e-13)
    at_pole = angles(position([np.pi / 2, 0.4, 0.5]), [0, 0, 0.25])
    np.testing.assert_allclose(at_pole, [np.pi / 2, 0.65, 0.25], atol=1e-15)  # only the sum is determined


def test_attitude_and_velocity_are_told_against_north(rng):
    matrix, back, velocity = map(
        strapgen.evaluator, ("dcm-north-east-down", "dcm-navigation-axes", "ground-velocity")
    )
    C = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    angles, v = rng.uniform(-1.5, 1.5, 3), rng.normal(size=3)
    wander = angles[2]
    # x of n lies `wander` from east towards north.
    n_to_enu = np.array(
        [[np.cos(wander), -np.sin(wander), 0], [np.sin(wander), np.cos(wander), 0], [0, 0, 1]]
    )
    enu_to_ned = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    np.testing.assert_allclose(matrix(C, angles), enu_to_ned @ n_to_enu @ C, atol=1e-15)
    np.testing.assert_allclose(back(matrix(C, angles), angles), C, atol=1e-15)
    np.testing.assert_allclose(velocity(v, angles), enu_to_ned @ n_to_enu @ v, atol=1e-15)


def test_a_latitude_entered_late_turns_the_attitude_about_up():
    (turned,) = expressions(derive("late-latitude"))
    C = sp.Matrix(3, 3, [sp.Symbol(f"C_{j}{k}", real=True) for j in "123" for k in "123"])
    We, time, latitude = sp.symbols("sidereal_rate time latitude", real=True)
    behind = We * time * sp.sin(latitude)
    difference = sp.Matrix(3, 3, list(turned)) - sp.rot_axis3(behind) * C
    assert difference.expand() == sp.zeros(3, 3)


def test_the_constants_of_wgs84_follow_from_its_defining_parameters():
    constants = Earth.wgs84().constants
    a, mu, We = PRECISE.mpf(6378137), PRECISE.mpf("3.986004418e14"), PRECISE.mpf("7.292115e-5")
    f = 1 / PRECISE.mpf("298.257223563")
    equator = -level_ellipsoid(a, f, mu, We, PRECISE.mpf(0), 0)[1]
    pole = -level_ellipsoid(a, f, mu, We, PRECISE.pi / 2, 0)[1]
    assert abs(constants["equator_gravity"] - equator) < 1e-10
    assert abs(constants["gravity_increase"] - ((1 - f) * pole / equator - 1)) < 1e-13
    assert Fraction(constants["curvature"]) == Fraction(1 / 6378137)
    with pytest.raises(strapgen.InputError, match="radius is 0; a number above 0"):
        Earth.sphere(1, 0, 1)
