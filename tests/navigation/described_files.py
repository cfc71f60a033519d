"""Files of systems that tests start from, and the system that a text describes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from strapgen.navigation.systems.wiring import Description, read_system

#: Two speeds with a navigation frame: sums, states that two rates share, words of two lengths, inputs of two frames.
TWO_SPEEDS = """
name = "two"
title = "Two speeds"
sample_hz = 3200

[inputs.gyro]
unit = "rad"
frame = "b"
range = 0.001

[inputs.accelerometer]
unit = "m/s"
frame = "b"
range = 0.05

[inputs.earth]
unit = "rad"
frame = "n"
range = 0.0001

[[stage]]
name = "fast"
kernel = "two-speed-fast-2"
every = 1
word = 16
carry = "full"
wires = { increment = "gyro", velocity_increment = "accelerometer" }
ranges = { angle_sum = 0.008, coning = 0.002, velocity_sum = 0.4, sculling = 0.02 }

[[stage]]
name = "slow"
kernel = "euler-two-speed-slow-2"
every = 8
word = 16
carry = "full"
ranges = { navigation_velocity = 16, turn = 0.0001 }
[stage.wires]
angle_sum = "fast.angle_sum"
coning = "fast.coning"
velocity_sum = "fast.velocity_sum"
sculling = "fast.sculling"
turn = "earth"

[[stage]]
name = "navigation"
kernel = "euler-two-speed-navigation"
every = 16
word = 32
[stage.wires]
state = "slow.state"
navigation_rotation = "slow.navigation_rotation"
navigation_velocity = "slow.navigation_velocity"
"""

#: An attitude step that collects increments, a wire that goes back, a normalization that writes the state, outputs.
ATTITUDE = """
name = "att"
title = "An attitude step that collects increments"
sample_hz = 100
outputs = ["step.state", "turned.transformed"]

[inputs.gyro]
unit = "rad"
frame = "b"
range = 0.02

[inputs.force]
unit = "m/s^2"
frame = "b"
range = 20

[[stage]]
name = "step"
kernel = "euler"
method = "rk4"
increments = 2
every = 2
wires = { increments = "gyro" }

[[stage]]
name = "turned"
kernel = "dcm-acceleration"
every = 4
wires = { state = "matrix.attitude", acceleration = "force" }
delay = { state = 1 }

[[stage]]
name = "matrix"
kernel = "dcm-from-euler"
every = 4
wires = { state = "step.state" }
initial = { attitude = [[1, 0, 0], [0, 1, 0], [0, 0, 1]] }

[[stage]]
name = "norm"
kernel = "euler-normalize-first-order"
every = 8
wires = { state = "step.state" }
"""


def description(folder: Path, text: str, name: str = "case.toml") -> Description:
    """Return the system of a text, which is written into a file first."""
    path = folder / name
    path.write_text(text)
    return read_system(path)


def samples(
    system: Description, cycles: int, rng: np.random.Generator, part: float = 0.9
) -> dict[str, np.ndarray]:
    """Return random samples for every input, up to a part of its range."""
    return {
        signal.name: rng.uniform(-part, part, (cycles, *signal.shape)) * float(signal.bound or 1)
        for signal in system.system.inputs
    }
