"""Generated Kalman filters against closed forms, an independent dense filter, and the Riccati recursion in digits."""

from __future__ import annotations

import csv
import json
import re
import subprocess
import sys
import tomllib
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import mpmath
import numpy as np
import pytest
import sympy as sp
from commands import run, says
from languages import cases
from scipy.linalg import expm, solve_discrete_are

from strapgen.catalogue.toml_models import parse
from strapgen.ir.exceptions import InputError
from strapgen.navigation.kalman.error_bound import run_bound
from strapgen.navigation.kalman.kalman_file import KalmanFile, described
from strapgen.navigation.kalman.kalman_filter import KalmanFilter, kalman
from strapgen.run.backends import BACKENDS
from strapgen.run.standard_tree import command_of

EXAMPLE = Path("examples/kalman/gyrocompass.toml")
#: A vehicle along a line with an accelerometer's bias, a position and a velocity; the velocity is scaled by an input.
LINE = """
name = "line"
[parameters]
tau = 50
[[input]]
name = "push"
unit = "m/s^2"
range = 20
[[input]]
name = "scale"
unit = "1"
range = 2
[[state]]
name = "place"
unit = "m"
derivative = "speed"
deviation = 5
range = 5000
[[state]]
name = "speed"
unit = "m/s"
derivative = "scale*push - scale*bias + shake"
deviation = 1
range = 100
[[state]]
name = "bias"
unit = "m/s^2"
derivative = "-bias/tau + walk"
deviation = 0.1
range = 1
[[measurement]]
name = "fix"
unit = "m"
expression = "place"
deviation = 3
every = 4
range = 5000
[[measurement]]
name = "pulses"
unit = "m/s"
expression = "scale*speed + bias/10"
deviation = "1/5"
range = 200
[noise.shake]
density = 0.05
[noise.walk]
deviation = 0.001
[schedule]
interval = 0.25
kind = "online"
order = 8
"""


PUSH = '[[input]]\nname = "push"\nunit = "m/s^2"\nrange = 20\n'
SCALE = '[[input]]\nname = "scale"\nunit = "1"\nrange = 2\n'


def filter_of(text: str, **changes: str) -> KalmanFilter:
    """Return the filter of a text with other words."""
    for old, new in changes.items():
        text = text.replace(old, new)
    return KalmanFilter(described(parse(KalmanFile, tomllib.loads(text, parse_float=Decimal)), "test"))


def dense(F, G, S, H, R, every, start, P, forcing, measured, T):
    """Run a filter in plain matrices: van Loan's discretization by expm, all measurements of a step at once.

    F, G and H are functions of the step; returns estimates and covariances after each.
    """
    x, states, covariances = np.array(start, float), [start], [P]
    n = len(x)
    for k in range(1, measured.shape[0] + 1):
        A, B = F(k), G(k)
        whole = expm(np.block([[-A, B @ S @ B.T], [np.zeros((n, n)), A.T]]) * T)
        Phi = whole[n:, n:].T
        drift = expm(np.block([[A, forcing(k)[:, None]], [np.zeros((1, n + 1))]]) * T)[:n, n]
        x, P = Phi @ x + drift, Phi @ P @ Phi.T + Phi @ whole[:n, n:]
        due = [m for m, e in enumerate(every) if k % e == 0]
        if due:
            h = H(k)[due]
            K = np.linalg.solve(h @ P @ h.T + R[np.ix_(due, due)], h @ P).T
            x = x + K @ (measured[k - 1, due] - h @ x)
            P = (np.eye(n) - K @ h) @ P @ (np.eye(n) - K @ h).T + K @ R[np.ix_(due, due)] @ K.T
        states.append(x)
        covariances.append(P)
    return np.array(states), np.array(covariances)


def line(steps: int, seed: int = 3):
    """Return inputs and measurements of the vehicle, and what the dense filter makes of them."""
    random = np.random.default_rng(seed)
    push, scale = 3 * np.sin(np.arange(steps) / 9), 1 + 0.3 * np.cos(np.arange(steps) / 17)
    measured = np.stack([50 * random.standard_normal(steps), 4 * random.standard_normal(steps)], 1)
    states, covariances = dense(
        lambda k: np.array([[0, 1, 0], [0, 0, -scale[k - 1]], [0, 0, -1 / 50]]),
        lambda k: np.array([[0, 0], [1, 0], [0, 1]]),
        np.diag([0.05**2, 0.001**2 / 0.25]),
        lambda k: np.array([[1, 0, 0], [0, scale[k - 1], 0.1]]),
        np.diag([9, 0.04]),
        [4, 1],
        np.zeros(3),
        np.diag([25, 1, 0.01]),
        lambda k: np.array([0, scale[k - 1] * push[k - 1], 0]),
        measured,
        0.25,
    )
    inputs = {"push": push, "scale": scale}
    return inputs, {"fix": measured[:, 0], "pulses": measured[:, 1]}, states, covariances


@pytest.mark.parametrize("form", ["joseph", "ud"])
@pytest.mark.parametrize("backend", ["numpy", "c"])
def test_a_filter_with_inputs_is_the_dense_one(form, backend):
    inputs, measured, states, covariances = line(400)
    made = filter_of(LINE).run(measured, inputs, form=form, backend=backend)
    np.testing.assert_allclose(made.states, states, rtol=1e-10, atol=1e-10)
    scale = np.sqrt(np.einsum("kii,kjj->kij", covariances, covariances))
    assert np.abs((made.covariances - covariances) / scale).max() < 1e-10


#: A body that falls through air of an unknown drag, seen by a radar at the side.
FALL = """
[[state]]
name = "height"
unit = "m"
derivative = "-speed"
deviation = 50
initial = 9000
[[state]]
name = "speed"
unit = "m/s"
derivative = "98/10 - drag*speed**2*(1 - height/20000) + gust"
deviation = 20
initial = 300
[[state]]
name = "drag"
unit = "1/m"
derivative = "0"
deviation = 1e-4
initial = 2e-4
[[measurement]]
name = "distance"
unit = "m"
expression = "sqrt(3000**2 + height**2)"
deviation = 5
[noise.gust]
density = 0.5
[schedule]
interval = 0.5
kind = "online"
order = 6
"""


@pytest.mark.parametrize("form", ["joseph", "ud"])
def test_an_extended_filter_linearizes_at_the_estimate(form):
    measured = np.linspace(9400, 6200, 30)
    x, P, T = np.array([9000, 300, 2e-4]), np.diag([2500.0, 400, 1e-8]), 0.5
    made = filter_of(FALL).run({"distance": measured}, form=form)
    for k, z in enumerate(measured, 1):
        thin = 1 - x[0] / 20000
        f = np.array([-x[1], 9.8 - x[2] * x[1] ** 2 * thin, 0])
        F = np.array(
            [
                [0, -1, 0],
                [x[2] * x[1] ** 2 / 20000, -2 * x[2] * x[1] * thin, -(x[1] ** 2) * thin],
                [0, 0, 0],
            ]
        )
        S = np.diag([0, 0.25, 0])
        whole = expm(np.block([[-F, S], [np.zeros((3, 3)), F.T]]) * T)
        Phi = whole[3:, 3:].T
        x = x + expm(np.block([[F, f[:, None]], [np.zeros((1, 4))]]) * T)[:3, 3]
        P = Phi @ P @ Phi.T + Phi @ whole[:3, 3:]
        expected = np.hypot(3000, x[0])
        h = np.array([x[0] / expected, 0, 0])
        K = P @ h / (h @ P @ h + 25)
        x, P = x + K * (z - expected), (np.eye(3) - np.outer(K, h)) @ P
        np.testing.assert_allclose(made.states[k], x, rtol=1e-9)
        np.testing.assert_allclose(np.diag(made.covariances[k]), np.diag(P), rtol=1e-8)


def test_lost_measurements_change_nothing_and_runs_are_independent():
    inputs, measured, _, _ = line(40)
    lost = {
        name: np.stack([values, np.where(np.arange(40) % 3, values, np.nan)])
        for name, values in measured.items()
    }
    model, start = filter_of(LINE), [100.0, 10, 0.1]
    both, whole = (model.run(one, inputs, initial=start) for one in (lost, measured))
    np.testing.assert_array_equal(both.states[0], whole.states)
    np.testing.assert_array_equal(both.innovations["fix"][0], whole.innovations["fix"])
    assert np.isnan(both.innovations["pulses"][1, ::3]).all()
    coasting = model.run({name: np.full(40, np.nan) for name in measured}, inputs, initial=start)
    np.testing.assert_array_equal(both.states[1, 1], coasting.states[1])
    np.testing.assert_array_equal(both.covariances[1, 1], coasting.covariances[1])


def gyrocompass(**words: str) -> KalmanFilter:
    """Return the example with other words."""
    return filter_of(EXAMPLE.read_text(), **words)


def test_the_covariance_of_gyrocompassing_has_its_closed_form():
    """At rest the errors turn, x' = x cross Omega, and the accelerometers see all of x but its part along down.

    Without process noise the information about x after N steps is that of the start, turned, which is isotropic, and
    that of each measurement, turned too: I/p^2 + (g/r)^2 (N I - sum of v_j v_j'), where v_j is down, turned by
    j steps (Fisher's information of a linear system; A. H. Jazwinski, Stochastic Processes and Filtering Theory (1970),
    section 7.5). By Rodrigues' formula v_j = a + b cos(j w T) + c sin(j w T), and the sums of squares of cosine
    and sine are closed.
    """
    model = gyrocompass(
        **{"density = 1e-6": "density = 0", "deviation = 0.05": "deviation = 0.01", '"scheduled"': '"online"'}
    )
    steps, T, r, p, g, rate = 900, 1.0, 1e-2, 0.01, 9.80665, 7.292115e-5
    made = model.run({name: np.zeros(steps) for name in model.measurements})
    axis, down = np.array([1, 0, -1]) / np.sqrt(2), np.array([0, 0, 1])
    a = axis * (axis @ down)
    b, c = down - a, np.cross(down, axis)
    z = np.exp(1j * rate * T)
    first = (z**steps - 1) / (z - 1)
    twice = (z ** (2 * steps) - 1) / (z**2 - 1)
    cos, sin, cos2, sin2, both = (
        first.real,
        first.imag,
        (steps + twice.real) / 2,
        (steps - twice.real) / 2,
        twice.imag / 2,
    )
    terms = [(a, a, steps), (b, b, cos2), (c, c, sin2)]
    crossed = [(a, b, cos), (a, c, sin), (b, c, both)]

    total = sum(x[:, None] * y * part for x, y, part in terms)
    total = total + sum((x[:, None] * y + y[:, None] * x) * part for x, y, part in crossed)
    information = np.eye(3) / p**2 + (g / r) ** 2 * (steps * np.eye(3) - total)
    deviations = np.sqrt(np.diag(made.covariances[-1]))
    error = np.abs(made.covariances[-1] - np.linalg.inv(information))
    assert (error / np.outer(deviations, deviations)).max() < 1e-9
    # And the rule of thumb for a short time: a line through N tilts has the slope r/(g T) sqrt(12/N^3).
    slope = r / g / T * np.sqrt(12 / steps**3)
    assert deviations[2] == pytest.approx(min(1, slope / (rate * np.cos(np.pi / 4)) / p) * p, rel=0.3)


def test_a_steady_gain_has_its_closed_form():
    """A random walk that is measured: P before a measurement solves P^2 = Q (P + R)."""
    model = filter_of(
        """
        [[state]]
        name = "place"
        unit = "m"
        derivative = "walk"
        deviation = 10
        [[measurement]]
        name = "fix"
        unit = "m"
        expression = "place"
        deviation = 3
        [noise.walk]
        density = 0.5
        [schedule]
        interval = 2
        kind = "steady"
        """
    )
    with mpmath.workdps(60):
        q, r = mpmath.mpf("0.5"), mpmath.mpf(9)
        before = (q + mpmath.sqrt(q**2 + 4 * q * r)) / 2
        found = model.solved.rows["fix"][0][0]
        assert (
            abs(mpmath.mpf(found.numerator) / found.denominator - before / (before + r))
            < mpmath.mpf(10) ** -50
        )
    assert model.solved.residual < Fraction(1, 10**50)


def test_steady_gains_solve_the_riccati_equation_of_scipy():
    changes = {"scale*push - scale*bias": "-bias", "scale*speed": "speed", PUSH: "", SCALE: ""}
    words = {'"online"': '"steady"', 'deviation = "1/5"': 'deviation = "1/5"\nevery = 4'}
    model = filter_of(LINE, **changes, **words)
    Phi, H, Q = (np.array(one, float) for one in (model.transition, model.H, model.Q))
    power, noise = np.eye(3), np.zeros((3, 3))
    for _ in range(4):
        power, noise = Phi @ power, Phi @ noise @ Phi.T + Q
    R = np.diag([9, 0.04])
    before = solve_discrete_are(power.T, H.T, noise, R)
    after = np.linalg.inv(np.linalg.inv(before) + H.T @ np.linalg.inv(R) @ H)
    np.testing.assert_allclose(np.array(model.solved.deviations, float), np.sqrt(np.diag(after)), rtol=1e-8)


def test_scheduled_gains_are_those_of_the_recursion_to_the_digits():
    model = gyrocompass(**{"duration = 3600": "duration = 60"})
    with mpmath.workdps(60):

        def matrix(of: sp.Matrix) -> mpmath.matrix:
            return mpmath.matrix(
                [[mpmath.mpf(int(x.p)) / int(x.q) for x in of[i, :]] for i in range(of.rows)]
            )

        Phi, Q, H = map(matrix, (model.transition, model.Q, model.H))
        P = mpmath.diag([mpmath.mpf(1) / 10000, mpmath.mpf(1) / 10000, mpmath.mpf(25) / 10000])
        R = mpmath.mpf(1) / 10000
        for step in range(60):
            P = Phi * P * Phi.T + Q
            for m, name in enumerate(model.measurements):
                h = H[m, :]
                K = P * h.T / ((h * P * h.T)[0] + R)
                left = mpmath.eye(3) - K * h
                P = left * P * left.T + K * R * K.T
                for found, expected in zip(model.solved.rows[name][step], K, strict=True):
                    assert (
                        abs(mpmath.mpf(found.numerator) / found.denominator - expected)
                        < mpmath.mpf(10) ** -50
                    )


def test_the_transition_is_exact_where_the_series_ends():
    model = filter_of(
        LINE,
        **{
            "scale*push - scale*bias": "-bias",
            "-bias/tau": "0",
            "scale*speed": "speed",
            PUSH: "",
            SCALE: "",
        },
    )
    assert model.transition == sp.Matrix([[1, "1/4", "-1/32"], [0, 1, "-1/4"], [0, 0, 1]])
    assert model.is_nilpotent and model.left_out == 0
    q = sp.Rational(1, 400)
    assert (
        model.Q[0, 1] == q * sp.Rational(1, 32) - 4 * sp.Rational(1, 10**6) * sp.Rational(1, 4) ** 4 / 8 * -1
    )


@pytest.mark.parametrize("order", [1, 2, 4])
def test_what_a_series_leaves_out_is_bounded(order):
    model = filter_of(LINE, **{"order = 8": f"order = {order}", "interval = 0.25": "interval = 4"})
    F, ranges = np.array([[0, 1, 0], [0, 0, -2], [0, 0, -1 / 50]]), np.array([5000, 100, 1])
    series, term = np.eye(3), np.eye(3)
    for j in range(1, order + 1):
        term = term @ F * 4 / j
        series = series + term
    left = (np.abs(expm(F * 4) - series) * ranges / ranges[:, None]).sum(axis=1).max()
    assert left <= model.left_out < 1.2 * left


def test_observability_names_what_no_measurement_shows():
    model = filter_of(LINE, **{'"place"\ndeviation = 3': '"speed"\ndeviation = 3'})
    assert (model.observability.rank, model.observability.unobservable) == (2, ("place 1",))
    assert filter_of(LINE).observability.rank == 3
    hidden = filter_of(
        LINE,
        **{
            "scale*push - scale*bias + shake": "push*bias + scale*place/2 + shake",
            '"place"\ndeviation = 3': '"speed + bias"\ndeviation = 3',
            "scale*speed + bias/10": "speed + bias",
        },
    )
    assert hidden.observability.rank == 3
    turned = filter_of(
        LINE,
        **{
            "-bias/tau + walk": "walk",
            "scale*push - scale*bias": "scale*push - bias + place/4",
            '"place"\ndeviation = 3': '"speed"\ndeviation = 3',
            "scale*speed + bias/10": "speed",
        },
    )
    assert turned.observability.unobservable == ("place 1, bias 1/4",)


@pytest.mark.parametrize("backend", ["c-fixed32", "fixed-model"])
@pytest.mark.parametrize("kind", ["scheduled", "steady"])
def test_a_filter_in_fixed_point_stays_within_its_bound(kind, backend):
    steps = 3600 if backend == "c-fixed32" else 100
    model = gyrocompass(**{'"scheduled"': f'"{kind}"'})
    stepper = model.on(backend)
    bound = run_bound(model, stepper.interfaces)
    assert bound.steps == (3600 if kind == "scheduled" else None)
    random = np.random.default_rng(5)
    measured = {}
    for name, interface in zip(model.measurements, stepper.interfaces[1:], strict=True):
        unit = float(next(one for one in interface.inputs if one.signal.name == "measured").unit)
        measured[name] = np.rint(1e-2 * random.standard_normal(steps) / unit) * unit
    error = np.abs(model.run(measured, backend=backend).states - model.run(measured).states).max(0)
    limits = np.array([bound.errors[name] for name in model.states])
    assert (error < limits).all() and (error > 1e-4 * limits).all()


def test_a_bound_counts_every_call():
    """With gains of zero nothing is forgotten but by the decay of the state: the errors of all calls add up."""
    model = filter_of(
        LINE,
        **{
            "scale*push - scale*bias": "push - bias",
            "scale*speed": "speed",
            '"online"': '"scheduled"\nduration = 25',
            SCALE: "",
        },
    )
    interfaces = model.on("c-fixed32").interfaces
    zero = {name: [[Fraction(0)] * 3] * len(rows) for name, rows in model.solved.rows.items()}
    vars(model)["solved"] = replace(model.solved, rows=zero)
    bound = run_bound(model, interfaces)

    def error(place: int) -> float:
        outputs = {one.signal.name: one for one in interfaces[place].outputs}
        return float(max(outputs["next_bias"].errors))

    left, expected = np.exp(-0.25 / 50), 0.0
    for step in range(1, 101):
        expected = left * expected + error(0) + error(2) + (error(1) if step % 4 == 0 else 0)
    assert expected <= bound.errors["bias"] * (1 + 1e-12) < expected * 1.001


DECAY = """
name = "decay"
title = "A random walk, and a warm-up that decays"
[[state]]
name = "level"
unit = "m"
derivative = "walk"
deviation = 10
[[state]]
name = "warmup"
unit = "m"
derivative = "-warmup/60"
deviation = 1
[[measurement]]
name = "gauge"
unit = "m"
expression = "level + warmup"
deviation = 0.5
[noise.walk]
density = 0.1
[schedule]
interval = 1
kind = "online"
"""


@pytest.mark.parametrize("backend", ["c", "c-float", "numpy"])
def test_a_state_that_decays_to_nothing_leaves_factors_finite(backend):
    # Its variance is below 2^-120 after 2500 s, and flushed to zero in float after 3100 s.
    measured = {"gauge": np.ones(3500 if backend == "numpy" else 25000)}
    made = filter_of(DECAY).run(measured, backend=backend, form="ud")
    level = filter_of(DECAY).run(measured, backend="c", form="joseph").covariances[-1, 0, 0]
    assert np.isfinite(made.states).all()
    np.testing.assert_allclose(made.covariances[-1], [[level, 0], [0, 0]], rtol=1e-5, atol=1e-30)


@pytest.mark.parametrize("backend", cases(name for name, entry in BACKENDS.items() if name != "exact"))
@pytest.mark.parametrize("kind", ["joseph", "ud", "steady", "scheduled"])
def test_every_kernel_runs_on_every_target(kind, backend):
    online = kind in ("joseph", "ud")
    model = gyrocompass(
        **{'"scheduled"': f'"{"online" if online else kind}"', "duration = 3600": "duration = 12"}
    )
    measured = {name: np.full(8, 0.25) * (-1) ** k for k, name in enumerate(model.measurements)}
    form = kind if online else None
    if online and BACKENDS[backend].fixed:
        with pytest.raises(InputError, match="goes with steady or scheduled gains"):
            model.run(measured, backend=backend, form=form)
        return
    reference, made = model.run(measured, form=form), model.run(measured, backend=backend, form=form)
    close = {"float": 1e-5, "fixed16": 2e-3, "fixed32": 1e-6, "model": 1e-6}
    limit = next((size for word, size in close.items() if backend.endswith(word)), 1e-13)
    assert np.abs(made.states - reference.states).max() < limit
    if online:
        assert np.abs(made.covariances - reference.covariances).max() < limit


def test_the_tables_of_a_schedule_hold_its_gains(tmp_path, capsys):
    for target, ending in (
        ("c-fixed", "h"),
        ("c-float", "h"),
        ("rust", "rs"),
        ("numpy", "py"),
        ("matlab", "m"),
    ):
        status, _, err = says(
            ["kalman", str(EXAMPLE), "--target", target, "--out", str(tmp_path / target)], capsys
        )
        assert (status, err) == (0, "")
        gains = kalman(EXAMPLE).solved.rows["force_north"]
        head = (tmp_path / target / f"gyrocompass_force_north_gains.{ending}").read_text()
        rows = list(csv.reader((tmp_path / target / "gyrocompass_force_north_gains.csv").open()))[1:]
        assert len(rows) == len(gains) == 3600 and rows[-1][0] == "3600"
        for place in range(3):
            words = re.search(
                r"(\w+) in .*?(?:Q(\S+)\.(\d+), )?rounded by at most (\S+)",
                head.split("columns:")[1].splitlines()[1 + place],
            )
            unit = Fraction(2) ** -int(words[3]) if words[3] else 1
            worst = max(
                abs(Fraction(float(row[place + 1])) * unit - gain[place])
                for row, gain in zip(rows, gains, strict=True)
            )
            assert 0 < worst <= Fraction(words[4]) < worst * Fraction(102, 100)
        assert all(rows[7][1 + place] in head for place in range(3))
        assert command_of(head).startswith(f"strapgen kalman {EXAMPLE} --target {target}") or ending == "m"


@pytest.mark.needs("cmake", "cc")
@pytest.mark.parametrize("words", [("c-fixed", "scheduled"), ("c", "online")])
def test_a_project_builds_and_its_vectors_hold(words, tmp_path, capsys):
    target, kind = words
    (tmp_path / "gyro.toml").write_text(EXAMPLE.read_text().replace('"scheduled"', f'"{kind}"'))
    line = [
        "kalman",
        str(tmp_path / "gyro.toml"),
        "--target",
        target,
        "--project",
        "--out",
        str(tmp_path / "out"),
    ]
    status, _, err = says(line, capsys)
    assert (status, err) == (0, "")
    for command in ("cmake -S . -B b", "cmake --build b", "ctest --test-dir b"):
        made = subprocess.run(command.split(), cwd=tmp_path / "out", capture_output=True, text=True)
        assert made.returncode == 0, made.stdout + made.stderr
    assert "100% tests passed out of 4" in made.stdout.replace(", 0 tests failed", "")


@pytest.mark.parametrize("kind", ["zephyr", "esp-idf", "platformio", "arduino", "python", "fmu2"])
def test_other_kinds_of_projects(kind, tmp_path, capsys):
    line = ["kalman", str(EXAMPLE), "--target", "c-fixed", "--project", kind, "--out", str(tmp_path / "out")]
    status, out, err = says(line, capsys)
    if kind == "fmu2":
        assert (status, err.count("\n")) == (2, 1) and "goes with generate, two-speed and system" in err
    else:
        assert (status, err) == (0, "") and "gyrocompass_force_north_gains.csv" in out
    if kind == "python":
        build = [sys.executable, "-c", "from build_extension import ffi; ffi.compile()"]
        made = subprocess.run(build, cwd=tmp_path / "out", capture_output=True, text=True)
        assert made.returncode == 0, made.stderr


def test_the_command_says_what_the_object_has(capsys):
    run(["kalman", str(EXAMPLE), "--target", "c-fixed", "--format", "json"])
    data = json.loads(capsys.readouterr().out)
    model = kalman(EXAMPLE)
    assert data["schema"] == "strapgen/kalman/1"
    np.testing.assert_array_equal(data["transition"], np.array(model.transition, float))
    assert data["observability"] == {"rank": 3, "unobservable": []}
    assert data["gains"][0]["last"]["azimuth"] == model.gains["force_north"][-1, 2]
    assert data["states"][0]["error"] > 0 and data["bound_steps"] == 3600
    run(["kalman", str(EXAMPLE), "--target", "c"])
    assert "observability: rank 3 of 3" in capsys.readouterr().out


FORCE, HOLDS = "measurement[force_north]", "its derivative by a state or a noise holds"
TWICE = """deviation = 0
every = 3600
[[measurement]]
name = "again"
unit = "1"
expression = "2*tilt_east"
deviation = 0
every = 3600"""
SPARE = '[[input]]\nname = "spare"\nunit = "1"\nrange = 1\n'
EAST = 'name = "force_east"\nunit = "m/s^2"\nexpression = "-gravity*'
BAD = [
    (
        'name = "azimuth"',
        'name = "tilt_east"',
        "the name 'tilt_east' stands twice; all names of a filter are different",
    ),
    (
        'name = "azimuth"',
        'name = "sin"',
        "the name 'sin' has a meaning in formulas or code; another name is needed",
    ),
    ('name = "azimuth"', 'name = "gain_x"', "the name 'gain_x' has a meaning in formulas or code"),
    ('name = "force_north"', 'name = "time"', "the measurement name 'time' is that of the time update"),
    (
        'name = "azimuth"',
        'name = "Azimuth"',
        "state[Azimuth].name is 'Azimuth'; a name of at most 31 lower-case",
    ),
    (
        '"gravity*tilt_east"',
        '"gravity*tilt_eest"',
        f"{FORCE}.expression is 'gravity*tilt_eest': tilt_eest is not known",
    ),
    ('"gravity*tilt_east"', '"gravity"', "measurement[force_north].expression holds no state"),
    ('"gravity*tilt_east"', '"gravity*tilt_east**2"', f"{FORCE}: {HOLDS} tilt_east"),
    (
        '"gravity*tilt_east"',
        '"gravity*tilt_east +"',
        f"{FORCE}.expression is 'gravity*tilt_east +': an expression",
    ),
    (
        "tilt_east + walk_down",
        "exp(tilt_east) + walk_down",
        "state[azimuth].derivative is '-north_rate*exp(tilt_east)",
    ),
    ("tilt_east + walk_down", "tilt_east", "noise.walk_down stands in no derivative; it drives nothing"),
    (
        "tilt_east + walk_down",
        "tilt_east + walk_down**2",
        "state[azimuth].derivative does not hold the noise linearly",
    ),
    (
        "tilt_east + walk_down",
        "tilt_east*azimuth + walk_down",
        f"state[azimuth]: {HOLDS} azimuth; with gains that are scheduled",
    ),
    (
        'unit = "rad"\nderivative = "-north',
        'unit = ""\nderivative = "-north',
        "state[azimuth].unit is ''; a unit, '1' for a pure number, is needed",
    ),
    ("deviation = 0.05", "deviation = 0", "state[azimuth].deviation is 0; a number above 0 is needed"),
    ("deviation = 0.05\n", "", "state[azimuth].deviation is missing"),
    ("deviation = 1e-2", "deviation = -1", f"{FORCE}.deviation is -1; a number of at least 0 is needed"),
    ("deviation = 1e-2", TWICE, "measurement[again]: its innovation has no variance in step 3600"),
    (
        'kind = "scheduled"',
        'kind = "static"',
        "schedule.kind 'static' is not known; allowed: steady, scheduled, online",
    ),
    (
        "duration = 3600\n",
        "",
        "schedule.duration is missing; a scheduled filter has gains for every step of it",
    ),
    ("duration = 3600", "duration = 0.5", "schedule.duration is 0.5; a multiple of the interval is needed"),
    ("interval = 1", "interval = 0", "schedule.interval is 0; a number above 0 is needed"),
    (
        "interval = 1\nduration = 3600",
        "interval = 1e6\nduration = 1e6",
        "schedule.interval is 1e+06; the series of its transition takes more than",
    ),
    ('latitude = "pi/4"', 'latitude = "pi/0"', "parameters.latitude is 'pi/0': it divides by zero"),
    ('latitude = "pi/4"', 'latitude = "sqrt(-2)"', "parameters.latitude is no real number"),
    (
        "[noise.walk_down]\ndensity = 1e-6",
        "[noise.walk_down]",
        "noise.walk_down: one of density and deviation is needed",
    ),
    ("range = 0.05\n", 'range = "a lot"\n', "state[tilt_north].range is 'a lot': an expression"),
    ("[[state]]", SPARE + "[[state]]", "input[spare] stands in no derivative and no measurement"),
]
STEADY = ('kind = "scheduled"', 'kind = "steady"')
#: Filters without a steady gain: what no measurement shows, what no noise drives, measurements at two rates, no noise.
UNSTEADY = [
    (
        EAST + "tilt_north",
        EAST + "tilt_east",
        "there is no steady gain: no measurement shows tilt_north 1, azimuth -1, which does not decay",
    ),
    ("density = 1e-6", "density = 0", "there is no steady gain above 0: no noise drives tilt_north 1"),
    (
        "deviation = 1e-2\n",
        "deviation = 1e-2\nevery = 2\n",
        "measurement[].every is 1, 2; steady gains need the same for all",
    ),
    ("deviation = 1e-2\n", "deviation = 0\n", f"{FORCE}.deviation is 0; a steady gain needs one above 0"),
]


def refused(text: str, said: str, tmp_path, capsys, *options: str) -> None:
    """Check that a file is refused in one line, with exit status 2, and that nothing is written."""
    path = tmp_path / "bad.toml"
    path.write_text(text)
    status, out, err = says(["kalman", str(path), "--out", str(tmp_path / "out"), *options], capsys)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert f"bad.toml: {said}" in err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("old", "new", "said"), BAD, ids=[said[:50] for *_, said in BAD])
def test_bad_files_are_refused_in_one_line(old, new, said, tmp_path, capsys):
    text = EXAMPLE.read_text()
    assert old in text
    refused(text.replace(old, new, 1), said, tmp_path, capsys)


@pytest.mark.parametrize(("old", "new", "said"), UNSTEADY, ids=[said[:50] for *_, said in UNSTEADY])
def test_filters_without_a_steady_gain_are_refused(old, new, said, tmp_path, capsys):
    text = EXAMPLE.read_text().replace(*STEADY)
    assert old in text
    refused(text.replace(old, new, -1 if "density" in old else 1), said, tmp_path, capsys)


def test_an_unstable_state_without_noise_has_a_steady_gain():
    model = gyrocompass(**{'"scheduled"': '"steady"', "+ walk_down": "+ azimuth/1000 + walk_down"})
    assert max(abs(np.linalg.eigvals(np.array(model.transition, float)))) > 1
    gain = np.array([model.gains[name] for name in model.measurements]).T
    loop = (np.eye(3) - gain[:, 1:] @ np.array(model.H, float)[1:]) @ (
        np.eye(3) - gain[:, :1] @ np.array(model.H, float)[:1]
    )
    assert max(abs(np.linalg.eigvals(loop @ np.array(model.transition, float)))) < 1


def test_targets_that_do_not_go_with_a_filter_are_refused(tmp_path, capsys):
    text = EXAMPLE.read_text()
    online = tmp_path / "online.toml"
    online.write_text(text.replace('"scheduled"', '"online"'))
    for words, said in (
        (["--target", "c-fixed"], "c-fixed goes with steady or scheduled gains"),
        (
            ["--target", "c", "--word", "16"],
            "the options of fixed point go with a target in fixed point, not with c",
        ),
        (["--form", "square-root"], "form 'square-root' is not known"),
    ):
        status, _, err = says(["kalman", str(online), *words], capsys)
        assert (status, err.count("\n")) == (2, 1) and said in err
    online.write_text(text.replace("range = 0.2\n", ""))
    status, _, err = says(["kalman", str(online), "--target", "c-fixed"], capsys)
    assert (status, err.count("\n")) == (
        2,
        1,
    ) and "state[azimuth].range is missing; fixed point needs it" in err
    with pytest.raises(InputError, match=r"name in measurements 'force' is not known"):
        kalman(EXAMPLE).run({"force": np.zeros(3)})
