"""Tests of preintegration: accuracy, Jacobians, covariance, instants, refusals, and the header in C++."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from tests.commands import says

import strapgen
from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.firmware import verify_files
from strapgen.ir.exceptions import InputError
from strapgen.navigation.preintegration import INPUTS, INTERPOLATION, preintegration_sources, resampling
from strapgen.navigation.preintegration.preintegrator import (
    PreintegrationError,
    PreintegrationStatus,
    Preintegrator,
)

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples" / "estimation"))

from rotations import exponential, logarithm, truth
from simulated_imu import VEHICLES, motion, samples, stamps

#: One kept sample has its errors in `KEPT` there, rms of rotation, velocity and position.
MOTIONS = {name: motion(name) for name in VEHICLES}
QUADCOPTER = MOTIONS["quadcopter"]


def pushed(window, motion, at, kind="increments", **noise):
    unit = Preintegrator(window, sample_hz=motion[0], input=kind, **noise)
    for stamp, sample in zip(at.tolist(), samples(motion, at, kind), strict=True):
        unit.push(stamp, sample[:3], sample[3:])
    return unit


def errors(window, motion, jitter=0.0, kind="increments", any_instant=False, count=40):
    """Return the root of the mean square of the errors of rotation, velocity and position over half a second."""
    hz = motion[0]
    at = stamps(hz, 80 + count * (hz // 2), jitter)
    ends = at[40 + hz // 2 * np.arange(count + 1)]
    if any_instant:
        ends = ends + np.random.default_rng(1).integers(0, 10**9 // hz, count + 1)
    factor = pushed(window, motion, at, kind).between(ends[:-1], ends[1:])
    r, v, p = truth(*motion[1:], ends[:-1] * 1e-9, ends[1:] * 1e-9, 4 * hz)
    differences = logarithm(np.swapaxes(r, 1, 2) @ factor.rotation), factor.velocity - v, factor.position - p
    return [np.sqrt((one**2).sum(-1).mean()) for one in differences]


def test_truth_is_that_of_half_its_steps():
    begin, end = np.array([0.3, 1.1]), np.array([0.8, 1.6])
    coarse, fine = (truth(*QUADCOPTER[1:], begin, end, parts) for parts in (400, 800))
    for one, other in zip(coarse, fine, strict=True):
        np.testing.assert_allclose(one, other, atol=2e-12)


#: Errors by a pair of 5 and 4 coefficients, with even samples and with a jitter of 2 % and stamps.
EVEN = {
    "quadcopter": (8.5e-10, 2.9e-8, 1.1e-7),
    "racer": (6.3e-10, 2.3e-8, 2.5e-8),
    "car": (1.3e-9, 2.7e-8, 1.8e-7),
}
JITTER = {"quadcopter": (3.5e-9, 6.7e-8, 1.5e-7), "racer": (8e-9, 1.1e-7), "car": (1.4e-9, 2.9e-8)}


@pytest.mark.parametrize(("jitter", "limits"), [(0.0, EVEN), (0.02, JITTER)], ids=["even", "jitter"])
@pytest.mark.parametrize("name", MOTIONS)
def test_errors_over_half_a_second(name, jitter, limits):
    found = errors("pair-1-8", MOTIONS[name], jitter, count=10)
    assert all(error < 2 * limit for error, limit in zip(found, limits[name], strict=False)), found


@pytest.mark.parametrize("kind", ["increments", "rates", "instants"])
def test_instants_between_jittering_samples(kind):
    found = errors("pair-1-8", QUADCOPTER, 0.02, kind, any_instant=True, count=10)
    assert all(error < limit for error, limit in zip(found, (3e-8, 3e-7, 2e-7), strict=True)), found


@pytest.mark.parametrize(("size", "degree"), [(40, 5), (4, 3), (2, 1)])
def test_polynomials_of_time_are_integrated_exactly(size, degree):
    """Through as many samples as there are: six at the ends, fewer where there are no more."""
    times = np.arange(size) + 0.1 * np.sin(np.arange(size) ** 2)
    powers = np.arange(6) % (degree + 1)

    def integral(at: np.ndarray) -> np.ndarray:
        return (at[:, None] / size) ** (powers + 1) * size / (powers + 1)

    points = np.sort([times[0] - 0.05, times[0], 0.4, *times[1:3], size / 2, size - 1.7, times[-1] + 0.05])
    whole = np.diff(integral(times), axis=0, prepend=0)
    kernels = [strapgen.evaluator(INTERPOLATION[kind]) for kind in ("rates", "instants")]
    found = resampling.increments(kernels[0], times, whole, points)
    # The powers of a sum have one degree more than those of a rate.
    known = powers < degree
    np.testing.assert_allclose(found[:, known], np.diff(integral(points), axis=0)[:, known], atol=1e-12)
    found = resampling.interpolated(kernels[1], times, (times[:, None] / size) ** powers, points)
    expected = integral(points + 0.5) - integral(points - 0.5)
    np.testing.assert_allclose(found, expected, atol=1e-12)


KEPT = {
    "quadcopter": (6.2e-6, 4.7e-4, 1.3e-4),
    "racer": (1.3e-5, 9.5e-4, 2.5e-4),
    "car": (5.2e-6, 1.2e-4, 4.2e-5),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_a_kept_sample_leaves_what_filters_take_out(name):
    found = errors("kept-sample", MOTIONS[name], count=10)
    assert all(limit / 2 < error < 2 * limit for error, limit in zip(found, KEPT[name], strict=True)), found


def test_a_window_of_four_filters():
    found = errors("window-3-3", QUADCOPTER, count=10)
    assert all(error < 4 * limit for error, limit in zip(found, (9.7e-8, 4.8e-6, 1.2e-6), strict=True)), found


@pytest.mark.parametrize(("sloping", "size", "error"), [("rate", 0.002, 1e-6), ("force", 0.02, 2e-5)])
def test_position_of_a_pair(sloping, size, error):
    """Beside an integral over fine parts, of a rate or a force that is linear in time, and the other constant."""
    c, a = size * np.array([[1, -2, 1], [0.5, 1, -1]]), np.array([[1.0, 2, -1], [2, -1, 1]])
    (a if sloping == "rate" else c)[1] = 0
    t = np.arange(-8, 10.0)[:, None]
    increments = [np.diff(one[0] * t + one[1] * (t**2 - t), axis=0) for one in (c, a)]
    _, position = strapgen.evaluator(choose("velocity-position", "pair-1-8"))(*increments)
    ends = np.linspace(0, 1, 4001)[:, None]
    s = (ends[1:] + ends[:-1]) / 2
    turns = exponential(c[0] * s + c[1] * (s**2 - s) + np.cross(c[0], c[1]) * s**3 / 6)
    force = (turns @ (a[0] + a[1] * (2 * s - 1))[..., None])[..., 0]
    np.testing.assert_allclose(position, ((1 - s) * force).mean(0), atol=error)


# Derivatives and covariance


def test_rotation_vector_by_a_bias_is_its_exact_derivative():
    """To fourth order phi by c_0 has a closed form; what it leaves out is of the next order."""
    c0, c1, c2 = (sp.Matrix(sp.symbols(f"{name}_x:z")) for name in ("a", "b", "c"))

    def derivative(x):
        return sp.Matrix(3, 3, lambda j, k: sp.diff(x[j], c0[k]))

    third = c0 * (c0.dot(c2) - c1.dot(c1)) + c1 * c0.dot(c1) - c2 * c0.dot(c0)
    phi = c0 + c0.cross(c1) / 6 + c1.cross(c2) / 30 + third / 60
    cross = sp.Matrix([[0, -c1[2], c1[1]], [c1[2], 0, -c1[0]], [-c1[1], c1[0], 0]])
    closed = sp.eye(3) - cross / 6
    closed += (c0 * c2.T + (c0.dot(c2) - c1.dot(c1)) * sp.eye(3) + c1 * c1.T - 2 * c2 * c0.T) / 60
    assert (derivative(phi) - closed).applyfunc(sp.expand) == sp.zeros(3, 3)
    kernel = strapgen.evaluator(choose("preintegrate", "window-3-3"))
    rng = np.random.default_rng(2)
    # Samples of a rate with c_0, c_1 and c_2 alone: of the second degree in time.
    a, b, c = rng.uniform(-0.02, 0.02, (3, 3)) * [[1], [1], [0.1]]
    t = np.arange(-3, 5.0)
    integral = a * t[:, None] + b * (t**2 - t)[:, None] + c * (2 * t**3 - 3 * t**2 + t)[:, None]
    found = np.asarray(
        kernel(
            np.diff(integral, axis=0),
            np.zeros((7, 3)),
            1.0,
            *(np.eye(3), *np.zeros((2, 3)), *np.zeros((5, 3, 3)), np.zeros(45), *np.zeros((2, 3))),
        )[3]
    )
    numbers = dict(zip([*c0, *c1, *c2], [*a, *b, *c], strict=True))
    exact = np.array(closed.subs(numbers), float)
    vector = np.array(phi.subs(numbers), float).ravel()
    step = 1e-4
    right = [
        (
            logarithm(exponential(vector).T @ exponential(vector + step * x))
            - logarithm(exponential(vector).T @ exponential(vector - step * x))
        )
        / (2 * step)
        for x in exact.T
    ]
    np.testing.assert_allclose(found, -np.transpose(right), atol=2e-7)
    assert np.abs(found + np.eye(3)).max() > 1e-3


@pytest.mark.parametrize("window", ["pair-1-5", "window-3-3", "kept-sample", "pair-2-5"])
def test_jacobians_are_derivatives_of_the_sums(window):
    at = stamps(200, 160, 0.01)
    unit = pushed(window, QUADCOPTER, at)
    begin, end, step = int(at[30]), int(at[30]) + 503_000_000, 1e-4
    biases = np.array([0.01, -0.02, 0.03, 0.1, 0.2, -0.3])
    factor = unit.between(begin, end, biases[:3], biases[3:])
    for k in range(6):
        change = step * np.eye(6)[k]
        sides = [unit.between(begin, end, *np.split(biases + sign * change, 2)) for sign in (1, -1)]
        turns = [logarithm(factor.rotation.T @ side.rotation) for side in sides]
        columns = [
            (turns[0] - turns[1]) / (2 * step),
            (sides[0].velocity - sides[1].velocity) / (2 * step),
            (sides[0].position - sides[1].position) / (2 * step),
        ]
        np.testing.assert_allclose(factor.jacobian[:, k], np.concatenate(columns), atol=1e-7)


def test_a_step_carries_the_covariance_on_by_its_derivatives():
    """Differences by the errors before it and by samples that all change alike, which the sum of the filters takes."""
    kernel = strapgen.evaluator(choose("preintegrate", "pair-1-5"))
    rng = np.random.default_rng(8)
    angles, velocities = rng.uniform(-0.03, 0.03, (11, 3)), rng.uniform(-0.1, 0.1, (11, 3))
    r, (v, p) = exponential(rng.uniform(-1, 1, 3)), rng.uniform(-1, 1, (2, 3))
    root, noise = rng.uniform(-1, 1, (9, 9)), rng.uniform(0.5, 1, 6)
    before = root @ root.T
    rows = np.triu_indices(9)

    def stepped(x, covariance=before):
        """Return what follows from errors (rotation, velocity, position, rate, force)."""
        return kernel(
            angles + x[9:12],
            velocities + x[12:],
            0.1,
            *(r @ exponential(x[:3]), v + x[3:6], p + x[6:9]),
            *np.zeros((5, 3, 3)),
            *(covariance[rows], noise[:3], noise[3:]),
        )

    exact = stepped(np.zeros(15))
    step, columns = 1e-5, []
    for k in range(15):
        one, other = (stepped(sign * step * np.eye(15)[k]) for sign in (1, -1))
        turns = [logarithm(exact[0].T @ side[0]) for side in (one, other)]
        parts = turns[0] - turns[1], one[1] - other[1], one[2] - other[2]
        columns.append(np.concatenate(parts) / (2 * step))
    a, b = np.transpose(columns[:9]), np.transpose(columns[9:])
    after = a @ before @ a.T + b @ np.diag(noise) @ b.T
    np.testing.assert_allclose(exact[8], after[rows], atol=1e-8)


def test_other_biases_need_no_second_pass():
    at = stamps(200, 160, 0.01)
    unit = pushed("pair-1-5", QUADCOPTER, at)
    begin, end = int(at[30]), int(at[130])
    moved = unit.between(begin, end).at([1e-3, -2e-3, 1e-3], [0.01, 0.02, -0.01])
    again = unit.between(begin, end, [1e-3, -2e-3, 1e-3], [0.01, 0.02, -0.01])
    np.testing.assert_allclose(moved.rotation, again.rotation, atol=1e-6)
    np.testing.assert_allclose(moved.velocity, again.velocity, atol=1e-5)
    np.testing.assert_allclose(moved.position, again.position, atol=1e-5)
    assert np.abs(unit.between(begin, end).velocity - again.velocity).max() > 1e-3


def test_one_of_many_intervals_is_that_of_its_own():
    at = stamps(200, 400, 0.01)
    unit = pushed("pair-1-5", QUADCOPTER, at, rate_noise=1e-4)
    biases = [1e-3, 0.0, 0.0], [0.0, 0.1, 0.0]
    ends = at[[[30, 130], [200, 300]]].T
    many, own = unit.between(*ends, *biases), unit.between(int(at[200]), int(at[300]), *biases)
    for name in ("rotation", "velocity", "position", "covariance", "jacobian", "duration", "rate_bias"):
        np.testing.assert_array_equal(getattr(many[1], name), getattr(own, name))
    moved = many[1].at([0] * 3, [0] * 3)
    np.testing.assert_allclose(moved.velocity, many.at([0] * 3, [0] * 3).velocity[1], rtol=1e-14)
    assert many[:1].rotation.shape == (1, 3, 3)


#: Noise of an ADIS16470, about.
NOISE = {"rate_noise": 1.4e-4, "force_noise": 8e-4}


def noisy_errors(motion, window, intervals, seed, jitter):
    """Return the errors of intervals of half a second with noise, (intervals, 9), and their covariances."""
    hz = motion[0]
    rng = np.random.default_rng(seed)
    at = stamps(hz, 80 + intervals * (hz // 2), jitter, seed)
    t = at * 1e-9
    clean = samples(motion, at)
    scale = np.repeat([NOISE["rate_noise"], NOISE["force_noise"]], 3)
    noise = rng.standard_normal(clean.shape) * scale * np.sqrt(np.diff(t, prepend=t[0] - 1 / hz))[:, None]
    unit = Preintegrator(window, sample_hz=hz, **NOISE)
    for stamp, sample in zip(at.tolist(), clean + noise, strict=True):
        unit.push(stamp, sample[:3], sample[3:])
    ends = at[40 + hz // 2 * np.arange(intervals + 1)]
    factor = unit.between(ends[:-1], ends[1:])
    r, v, p = truth(*motion[1:], ends[:-1] * 1e-9, ends[1:] * 1e-9, hz)
    turn = logarithm(np.swapaxes(r, 1, 2) @ factor.rotation)
    return np.hstack([turn, factor.velocity - v, factor.position - p]), factor.covariance


@pytest.mark.parametrize("name", MOTIONS)
def test_errors_with_noise_are_consistent(name):
    found, covariance = noisy_errors(MOTIONS[name], "pair-1-5", 500, 3, 0.02)
    squares = np.einsum("ki,ki->k", found, np.linalg.solve(covariance, found[..., None])[..., 0])
    assert 8 < squares.mean() < 10.5


def test_covariance_is_that_of_many_noises():
    """One interval again and again: its own noise, two thousand times."""
    hz, at = 200, stamps(200, 140, 0.0)
    clean = samples(QUADCOPTER, at)
    begin, end = int(at[20]), int(at[120])
    unit = Preintegrator("pair-1-5", sample_hz=hz, **NOISE)
    scale = np.repeat([NOISE["rate_noise"], NOISE["force_noise"]], 3) / np.sqrt(hz)
    rng = np.random.default_rng(4)
    # Many recordings, one after the other, far enough from each other.
    count, parts = 2000, []
    exact = pushed("pair-1-5", QUADCOPTER, at, **NOISE).between(begin, end)
    kernel_inputs = []
    for _ in range(count):
        unit.reset()
        noisy = clean + rng.standard_normal(clean.shape) * scale
        unit._stamps, unit._samples = at.tolist(), list(noisy)
        kernel_inputs.append(unit._interval(begin, end, np.zeros(6)))
    steps, lengths = np.full(count, 100), np.full(count, 1 / hz)
    sums = unit._sums(kernel_inputs, steps, lengths)
    turn = logarithm(exact.rotation.T @ sums[0].reshape(-1, 3, 3))
    parts = np.hstack([turn, sums[1] - exact.velocity, sums[2] - exact.position])
    seen = np.sqrt(np.mean(parts**2, axis=0))
    np.testing.assert_allclose(seen, np.sqrt(np.diag(exact.covariance)), rtol=0.05)


# Refusals


def refused(status, call, *arguments):
    with pytest.raises(PreintegrationError) as caught:
        call(*arguments)
    assert caught.value.status is status


def test_a_sample_that_is_refused_changes_nothing():
    at = stamps(200, 60, 0.0)
    unit, twin = (pushed("pair-1-5", QUADCOPTER, at) for _ in range(2))
    last = int(at[-1])
    refused(PreintegrationStatus.BACK, unit.push, last - 1, [0] * 3, [0] * 3)
    refused(PreintegrationStatus.REPEATED, unit.push, last, [0] * 3, [0] * 3)
    refused(PreintegrationStatus.GAP, unit.push, last + 7_600_000, [0] * 3, [0] * 3)
    refused(PreintegrationStatus.NOT_FINITE, unit.push, last + 5_000_000, [np.nan, 0, 0], [0] * 3)
    refused(PreintegrationStatus.ORDER, unit.between, last, last)
    refused(PreintegrationStatus.OUTSIDE, unit.between, int(at[4]), int(at[40]))
    refused(PreintegrationStatus.OUTSIDE, unit.between, int(at[20]), int(at[-5]))
    unit.push(last + 7_400_000, [0] * 3, [0] * 3)
    twin.push(last + 7_400_000, [0] * 3, [0] * 3)
    ends = int(at[10]), int(at[50])
    np.testing.assert_array_equal(unit.between(*ends).position, twin.between(*ends).position)
    unit.reset()
    refused(PreintegrationStatus.OUTSIDE, unit.between, *ends)


def test_bad_arguments_have_one_line():
    with pytest.raises(InputError, match="input"):
        Preintegrator(sample_hz=200, input="rate")
    with pytest.raises(InputError, match="sample_hz"):
        Preintegrator(sample_hz=0)
    with pytest.raises(InputError, match="window"):
        Preintegrator("pair-9-9", sample_hz=200)


def test_fixed_point_takes_no_covariance():
    with pytest.raises(InputError, match="holds a covariance, which is computed in floating point alone"):
        pipeline.compile(choose("preintegrate", "pair-1-5"), "c-fixed")


# The header

MAIN = """
#include "imu.hpp"
#include <array>
#include <cstdio>
#include <vector>

struct Matrix {{
    double numbers[81];
    int columns;
    double &operator()(int j, int k) {{ return numbers[j * columns + k]; }}
}};

int main()
{{
    static strapgen::imu<300> unit({hz}, 1e-4, 2e-3);
    long long stamp, last = 0, first[2];
    std::array<double, 3> rate, force, rate_bias{{{{0.01, -0.02, 0.03}}}}, force_bias{{{{0.1, 0.2, -0.3}}}};
    int count = 0;
    if (std::scanf("%d %lld %lld", &count, first, first + 1) != 3)
        return 1;
    for (int k = 0; k < count; ++k) {{
        if (std::scanf("%lld %la %la %la %la %la %la", &stamp, &rate[0], &rate[1], &rate[2], &force[0],
                &force[1], &force[2]) != 7)
            return 1;
        if (unit.push(stamp, rate, force) != strapgen::imu_status::ok)
            return 1;
        last = stamp;
    }}
    strapgen::imu_factor factor;
    const double none[3] = {{ 0.0, 0.0, 0.0 }}, bad[3] = {{ 0.0, 0.0, 0.0 / none[0] }};
    const int refused[] = {{ (int)unit.push(last - 1, rate, force), (int)unit.push(last, rate, force),
        (int)unit.push(last + 1000000000, rate, force), (int)unit.between(first[0], last, none, none, factor),
        (int)unit.between(last, last, none, none, factor), (int)unit.push(last + 1, bad, none) }};
    for (int code : refused)
        std::printf("%d ", code);
    if (unit.between(first[0], first[1], rate_bias, force_bias, factor) != strapgen::imu_status::ok)
        return 1;
    factor = factor.at(none, none);
    Matrix r{{ {{}}, 3 }}, p{{ {{}}, 9 }}, j{{ {{}}, 6 }};
    factor.rotation_to(r);
    factor.covariance_to(p);
    factor.jacobian_to(j);
    for (int k = 0; k < 9; ++k)
        std::printf("%a ", r.numbers[k]);
    for (int k = 0; k < 3; ++k)
        std::printf("%a ", factor.velocity[k]);
    for (int k = 0; k < 3; ++k)
        std::printf("%a ", factor.position[k]);
    for (int k = 0; k < 81; ++k)
        std::printf("%a ", p.numbers[k]);
    for (int k = 0; k < 54; ++k)
        std::printf("%a ", j.numbers[k]);
}}
"""


@pytest.mark.needs("c++")
@pytest.mark.parametrize(
    ("window", "kind"),
    [
        ("pair-1-5", "rates"),
        ("kept-sample", "increments"),
        ("pair-2-5", "increments"),
        ("pair-1-5", "instants"),
    ],
)
def test_header_has_the_bits_of_python_and_its_refusals(tmp_path, window, kind):
    files = preintegration_sources.sources(window, kind, name="imu").files
    (tmp_path / "imu.hpp").write_text(files["imu.hpp"])
    (tmp_path / "main.cpp").write_text(MAIN.format(hz=200.0))
    command = ["c++", "-std=c++14", "-O1", "-ffp-contract=off", "-o", "main", "main.cpp"]
    subprocess.run(command, cwd=tmp_path, check=True)
    at = stamps(200, 200, 0.02)
    unit = pushed(window, QUADCOPTER, at, kind, rate_noise=1e-4, force_noise=2e-3)
    begin, end = int(at[20]) + 1_234_567, int(at[150])
    rows = [f"{len(at)} {begin} {end}"]
    rows += [
        f"{stamp} {' '.join(float(x).hex() for x in sample)}"
        for stamp, sample in zip(at.tolist(), samples(QUADCOPTER, at, kind), strict=True)
    ]
    done = subprocess.run(
        ["./main"], cwd=tmp_path, input="\n".join(rows), capture_output=True, text=True, check=True
    )
    words = done.stdout.split()
    outside = 0 if window == "kept-sample" else -4
    assert [int(word) for word in words[:6]] == [-1, -2, -3, outside, -5, -6]
    factor = unit.between(begin, end, [0.01, -0.02, 0.03], [0.1, 0.2, -0.3]).at([0] * 3, [0] * 3)
    parts = factor.rotation, factor.velocity, factor.position, factor.covariance, factor.jacobian
    found = np.array([float.fromhex(word) for word in words[6:]])
    expected = np.concatenate([part.ravel() for part in parts])
    exact = np.ones(len(expected), bool)
    exact[:15] = False  # those are moved to other biases, where numpy sums in another order
    np.testing.assert_array_equal(found[exact], expected[exact])
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-14)


STRICT = ("-std=c++14", "-Wall", "-Wextra", "-Wconversion", "-Wpedantic", "-Wshadow", "-Werror", "-O1", "-c")


@pytest.mark.parametrize(
    "compiler",
    [
        pytest.param(command, marks=pytest.mark.needs(command[0]), id=command[0])
        for command in (["g++"], ["clang++"], ["arm-none-eabi-g++", "-mcpu=cortex-m7"])
    ],
)
@pytest.mark.parametrize("kind", INPUTS)
def test_strict_compilers_are_silent(tmp_path, compiler, kind):
    files = preintegration_sources.sources("pair-1-5", kind, name="imu").files
    (tmp_path / "imu.hpp").write_text(files["imu.hpp"])
    assert max(map(len, files["imu.hpp"].splitlines())) < 100
    (tmp_path / "main.cpp").write_text('#include "imu.hpp"\ntemplate class strapgen::imu<64>;\n')
    done = subprocess.run(
        [*compiler, *STRICT, "main.cpp"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_a_header_is_verified_by_its_command(tmp_path, capsys):
    assert (
        says(["preintegrate", "--window", "pair-1-5", "--name", "imu", "--out", str(tmp_path)], capsys)[0]
        == 0
    )
    path = tmp_path / "imu.hpp"
    for place in (path, tmp_path):
        status, said, _ = says(["verify", str(place)], capsys)
        assert (status, said) == (0, f"{path}: 1 file, in step with the command\n")
    text = path.read_text()
    path.write_text(text.replace("if (end <= begin)", "if (end < begin)", 1))
    number = text[: text.index("if (end <= begin)")].count("\n") + 1
    status, said, _ = says(["verify", str(path)], capsys)
    assert status == 1
    assert f"{path}:{number}: edited: if (end < begin); generated: if (end <= begin)" in said
    assert verify_files.main([str(tmp_path)]) == 1
    path.write_text(text.replace("strapgen preintegrate", "sh -c touch", 1))
    status, _, error = says(["verify", str(path)], capsys)
    assert (status, error.count("\n")) == (2, 1) and "imu.hpp is no C file" in error
