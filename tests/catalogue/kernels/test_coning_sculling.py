"""Coning and sculling by recursion: derived from what they assume of the motion, and the drift known of them."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

import strapgen
from strapgen import derive
from strapgen.kernel.algebra import cross_elements
from strapgen.run.backends import BACKENDS

RING, T, *SYMBOLS = sp.ring(
    "T " + " ".join(f"{v}{k}{axis}" for v in "wabuex" for k in (0, 1) for axis in "xyz"), sp.QQ
)
W0, W1, A0, _, B0, _, U0, _, ETA0, _, _, _ = (SYMBOLS[3 * k : 3 * k + 3] for k in range(12))


class Path:
    """A vector that is a polynomial of the time, by powers."""

    def __init__(self, *powers):
        self.powers = [list(map(RING, power)) for power in powers]

    def integral(self, start):
        raised = [[x / (k + 1) for x in power] for k, power in enumerate(self.powers)]
        return Path(start, *raised)

    def cross(self, other):
        powers = [[RING(0)] * 3 for _ in range(len(self.powers) + len(other.powers) - 1)]
        for j, left in enumerate(self.powers):
            for k, right in enumerate(other.powers):
                powers[j + k] = [
                    a + b for a, b in zip(powers[j + k], cross_elements(left, right), strict=True)
                ]
        return Path(*powers)

    def __add__(self, other):
        size = max(len(self.powers), len(other.powers))
        zero = [RING(0)] * 3
        padded = [p.powers + [zero] * (size - len(p.powers)) for p in (self, other)]
        return Path(*([a + b for a, b in zip(x, y, strict=True)] for x, y in zip(*padded, strict=True)))

    def at(self, time):
        return [sum((power[k] * time**n for n, power in enumerate(self.powers)), RING(0)) for k in range(3)]


def given(kernel, **vectors):
    """Return what a kernel makes of vectors by the names of its inputs; others are zero."""
    values = {}
    for signal in kernel.inputs:
        vector = vectors.pop(signal.name, [RING(0)] * 3)
        values |= dict(zip(signal.elements, vector, strict=True))
    assert not vectors
    return {name: list(map(RING, result)) for name, result in kernel.expand(values).items()}


def test_the_coning_recursion_is_exact_for_a_constant_rate_and_a_ramp():
    # (26) from (22) and (25): the integral of beta x w / 2 over a cycle from 0 to T, the one before from -T to 0.
    rate = Path(W0, W1)
    angle = rate.integral([0, 0, 0])
    increment, previous = angle.at(T), [-x for x in angle.at(-T)]
    beta = rate.integral(B0)
    wanted = beta.cross(rate).integral([0, 0, 0]).at(T)
    made = given(
        derive("coning-fast"), angle_sum=B0, coning=ETA0, previous_increment=previous, increment=increment
    )
    assert made["next_coning"] == [e + w / 2 for e, w in zip(ETA0, wanted, strict=True)]
    assert made["next_angle_sum"] == beta.at(T)
    assert made["next_previous_increment"] == increment


@pytest.mark.parametrize("form", [1, 2])
def test_the_sculling_recursions_are_exact_for_constant_rate_and_force(form):
    rate, force = Path(W0), Path(A0)
    beta, u = rate.integral(B0), force.integral(U0)
    moved = beta.cross(force)  # (50)
    factor = 1
    if form == 2:
        moved, factor = moved + u.cross(rate), 2
    wanted = [e + x / factor for e, x in zip(ETA0, moved.integral([0, 0, 0]).at(T), strict=True)]
    made = given(
        derive(f"sculling-fast-{form}"),
        angle_sum=B0,
        velocity_sum=U0,
        sculling=ETA0,
        increment=Path(W0).integral([0, 0, 0]).at(T),
        velocity_increment=Path(A0).integral([0, 0, 0]).at(T),
    )
    assert made["next_sculling"] == wanted
    assert made["next_velocity_sum"] == u.at(T)


def test_both_sculling_integrals_give_one_velocity():
    # (49): S1 = S2 + beta x u / 2, held by the recursions from cycle to cycle, whatever the increments are.
    start = {"angle_sum": B0, "velocity_sum": U0, "increment": W0, "velocity_increment": A0}
    second = given(derive("sculling-fast-2"), sculling=ETA0, **start)
    first_start = [e + c / 2 for e, c in zip(ETA0, cross_elements(B0, U0), strict=True)]
    first = given(derive("sculling-fast-1"), sculling=first_start, **start)
    added = cross_elements(second["next_angle_sum"], second["next_velocity_sum"])
    assert first["next_sculling"] == [s + c / 2 for s, c in zip(second["next_sculling"], added, strict=True)]


@pytest.mark.parametrize("name", ["coning-fast", "sculling-fast-1", "sculling-fast-2"])
def test_states_are_handed_on(name):
    kernel = derive(name)
    inputs = {signal.name: signal for signal in kernel.inputs}
    outputs = {stage.signal.name: stage.signal for stage in kernel.outputs}
    assert list(kernel.recursion.inputs) == list(outputs)
    for output, held in kernel.recursion.inputs.items():
        assert outputs[output].shape == inputs[held].shape and outputs[output].unit == inputs[held].unit
    samples = inputs.keys() - set(kernel.recursion.inputs.values())
    coning = name == "coning-fast"
    assert samples == ({"increment"} if coning else {"increment", "velocity_increment"})
    assert kernel.recursion.retained == (("previous_increment",) if coning else ())


# Drift, by running the recursions

FREQUENCY, FAST, SLOW, TURNS = 7.0, 0.01, 0.1, 10


def oscillation(amplitude, phase, cycles):
    """Return increments of amplitude sin(2 pi f t + phase), from one cycle before the start."""
    times = FAST * np.arange(-1, TURNS * cycles + 1)
    return np.diff(amplitude * np.sin(2 * np.pi * FREQUENCY * times + phase))


def run(loop, samples, kept, slow_cycles):
    """Run a fast loop from numpy's increments, and return its states at the end of every slow cycle."""
    recursion = derive(loop.sources.kernel).recursion
    names = [signal.name for signal in loop.function.inputs]
    outputs = [signal.name for signal in loop.function.outputs]
    state = {name: np.zeros(3) for name, _ in recursion.states} | kept
    ends = []
    for cycle in range(slow_cycles):
        state = state | {name: np.zeros(3) for name in recursion.reset}
        for k in range(TURNS):
            now = {name: values[cycle * TURNS + k] for name, values in samples.items()}
            result = loop(*(state[name] if name in state else now[name] for name in names))
            state = {
                recursion.inputs[name]: np.asarray(value, float)
                for name, value in zip(outputs, result, strict=True)
            }
        ends.append(state)
    return ends


def tolerance(loop, output, exact_to):
    """Return what a slow cycle may be off by: certified in fixed point, with the rounding of the increments."""
    if hasattr(loop, "interface"):
        (argument,) = [a for a in loop.interface.outputs if a.signal.name == output]
        return TURNS * (float(max(argument.errors)) + 2.0 * float(argument.format.unit))
    return exact_to if loop.dtype == np.float64 else 1e4 * exact_to


def test_coning_drift_is_that_of_the_source(backend_name):
    # Checked independently by the project's transcription of the source: -2.720926166e-3 rad/s in every slow cycle.
    loop = strapgen.evaluator("coning-fast", backend_name)
    x, y = oscillation(0.01, 0, 3), oscillation(0.013, 0.9, 3)
    increments = np.stack([x, y, 0 * x], axis=-1)
    ends = run(loop, {"increment": increments[1:]}, {"previous_increment": increments[0]}, 3)
    for end in ends:
        off = abs(end["coning"][2] - SLOW * -2.720926166e-3)
        assert off <= tolerance(loop, "next_coning", SLOW * 1e-10 * 5e-3)
        if not BACKENDS[backend_name].fixed:
            assert np.abs(end["coning"][:2]).max() == 0


def test_sculling_rate_is_that_of_the_source(backend_name):
    # 1.1042645359e-2 m/s^2 in every slow cycle; the integral of D sin is D (1 - cos)/(2 pi f).
    loop = strapgen.evaluator("sculling-fast-2", backend_name)
    x = oscillation(0.01, 0, 3)
    y = -oscillation(3 / (2 * np.pi * FREQUENCY), 0.9 + np.pi / 2, 3)
    samples = {
        "increment": np.stack([x, 0 * x, 0 * x], axis=-1)[1:],
        "velocity_increment": np.stack([0 * y, y, 0 * y], axis=-1)[1:],
    }
    for end in run(loop, samples, {}, 3):
        off = abs(end["sculling"][2] - SLOW * 1.1042645359e-2)
        assert off <= tolerance(loop, "next_sculling", SLOW * 1e-10 * 2e-2)
