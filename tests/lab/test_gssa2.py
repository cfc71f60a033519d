"""The thesis's program GSSA2, ported from its text alone, beside strapgen's runs.

Its subroutines are ALGOR (the algorithms, with rate extraction), ORTHO, PULSE, TRUTH and ERROR.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import strapgen

H, STEPS, EVERY = 0.125, 1440, 40
A = B = G = math.radians(10)


def pulse(t: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the two increments of the step at t: PULSE, the coning motion on a constant pitch rate."""

    def increment(begin: float, end: float) -> np.ndarray:
        x = A / B * (math.cos(B * begin) - math.cos(B * end))
        z = A / B * (math.sin(B * end) - math.sin(B * begin))
        return np.array([x, G * H / 2, z])

    return increment(t, t + H / 2), increment(t + H / 2, t + H)


def truth(t: float) -> np.ndarray:
    W = np.array([[0, -A, B + G], [A, 0, 0], [-(B + G), 0, 0]])
    s, c, d = math.hypot(A, B + G), math.cos(B * t), math.sin(B * t)
    R = np.array([[c, 0, -d], [0, 1, 0], [d, 0, c]])
    return (np.eye(3) + W * math.sin(s * t) / s + W @ W / s**2 * (1 - math.cos(s * t))) @ R


def rate_of_change(algorithm: str, x: np.ndarray, w: np.ndarray) -> np.ndarray:
    p, q, r = w
    if algorithm == "dcm":
        return x @ np.array([[0, -r, q], [r, 0, -p], [-q, p, 0]])
    return 0.5 * np.array([[0, r, -q, p], [-r, 0, p, q], [q, -p, 0, r], [-p, -q, -r, 0]]) @ x


def algor(algorithm: str, order: int, x: np.ndarray, d1: np.ndarray, d2: np.ndarray) -> np.ndarray:
    begin, middle, end = (3 * d1 - d2) / H, (d1 + d2) / H, (3 * d2 - d1) / H

    def f(state: np.ndarray, w: np.ndarray) -> np.ndarray:
        return H * rate_of_change(algorithm, state, w)

    first = f(x, begin)
    if order == 1:
        return x + first
    if order == 2:
        return x + (f(x + first, end) + first) / 2
    second = f(x + first / 2, middle)
    third = f(x + second / 2, middle)
    fourth = f(x + third, end)
    return x + first / 6 + second / 3 + third / 3 + fourth / 6


def ortho(algorithm: str, x: np.ndarray) -> np.ndarray:
    if algorithm == "euler":
        return x / math.sqrt(x @ x)
    rows = x + np.array([np.cross(x[1], x[2]), np.cross(x[2], x[0]), np.cross(x[0], x[1])])
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def matrix(algorithm: str, x: np.ndarray) -> np.ndarray:
    if algorithm == "dcm":
        return x
    a, b, c, s = x
    return np.array(
        [
            [a * a - b * b - c * c + s * s, 2 * (a * b - c * s), 2 * (a * c + b * s)],
            [2 * (a * b + c * s), -a * a + b * b - c * c + s * s, 2 * (b * c - a * s)],
            [2 * (a * c - b * s), 2 * (b * c + a * s), -a * a - b * b + c * c + s * s],
        ]
    )


def error(computed: np.ndarray, true: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    E = computed @ true.T - np.eye(3)
    skew = np.array([E[1, 2] + E[2, 1], E[0, 2] + E[2, 0], E[0, 1] + E[1, 0]]) / 2
    drift = np.array([E[1, 2] - E[2, 1], E[2, 0] - E[0, 2], E[0, 1] - E[1, 0]]) / 2
    return np.diag(E), skew, drift


@pytest.mark.long
@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("algorithm", ["dcm", "euler"])
def test_a_run_of_gssa2_is_a_run_of_strapgen(algorithm, order):
    motion = strapgen.motion("coning", a_rad_s=A, b_rad_s=B, g_rad_s=G)
    run = strapgen.simulate(
        strapgen.backend(algorithm, f"rk{order}", 2), motion, H, STEPS * H, EVERY * H, EVERY * H
    )
    state = np.eye(3) if algorithm == "dcm" else np.array([0.0, 0, 0, 1])
    for step in range(STEPS):
        state = algor(algorithm, order, state, *pulse(step * H))
        if step == 0:  # a few roundings of numbers up to 1
            first = strapgen.simulate(strapgen.backend(algorithm, f"rk{order}", 2), motion, H, H).computed[-1]
            np.testing.assert_allclose(matrix(algorithm, state), first, rtol=0, atol=5e-16)
        if (step + 1) % EVERY == 0:
            state = ortho(algorithm, state)
            record, time = (step + 1) // EVERY, (step + 1) * H
            parts = error(matrix(algorithm, state), truth(time))
            # Roundings add up at random over 1440 steps of a few each.
            for ported, ours in zip(parts, (run.scale, run.skew, run.drift), strict=True):
                np.testing.assert_allclose(ported, ours[record], rtol=0, atol=3e-14)
