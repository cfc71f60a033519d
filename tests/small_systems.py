"""Files of small described systems for tests."""

from __future__ import annotations

#: Counts of a gyro become increments, of which a fourth-order step takes two.
COUNTING = """
sample_hz = 100
outputs = ["attitude.state"]

[inputs.counts]
unit = "1"
frame = "b"
range = 20000

[[stage]]
name = "gyro"
kernel = "angle-counts"
every = 1
wires = { count = "counts" }
constants = { scale = "1e-5" }

[[stage]]
name = "attitude"
kernel = "euler"
method = "rk4"
increments = 2
every = 2
wires = { increments = "gyro.increment" }
"""
