"""Write the recordings of this folder: one made-up motion as rates and as increments, at even and uneven times.

python tests/data/make_recordings.py
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterable
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
HERTZ = 100
SAMPLES = 401

#: Amplitude in deg/s, frequency in rad/s and phase in rad of the waves of each axis, and its constant part.
WAVES = (
    ((18.0, 2.3, 0.0), (3.0, 9.1, 0.4)),
    ((11.0, 3.7, 1.1), (2.0, 11.3, 2.0)),
    ((25.0, 1.4, 2.2), (1.5, 7.9, 0.9)),
)
CONSTANT = (4.0, -2.5, 9.0)


def rate(axis: int, time: float) -> float:
    """Return the true rate about an axis in deg/s."""
    return CONSTANT[axis] + sum(a * math.cos(b * time + phase) for a, b, phase in WAVES[axis])


def angle(axis: int, time: float) -> float:
    """Return the integral of the rate from 0 in degrees."""
    return CONSTANT[axis] * time + sum(
        a / b * (math.sin(b * time + phase) - math.sin(phase)) for a, b, phase in WAVES[axis]
    )


def rates(times: Iterable[float], draw: random.Random) -> str:
    """Return rates with noise, and an accelerometer's columns as a logger adds them."""
    header = [f"Gyroscope {axis} (deg/s)" for axis in "XYZ"] + [f"Accelerometer {axis} (g)" for axis in "XYZ"]
    lines = [",".join(["Time (s)", *header])]
    for time in times:
        gyro = [rate(axis, time) + draw.gauss(0, 0.05) for axis in range(3)]
        accelerometer = [draw.gauss(mean, 0.01) for mean in (0, 0, 1)]
        lines.append(",".join([f"{time:.6f}", *(f"{value:.5f}" for value in gyro + accelerometer)]))
    return "\n".join(lines) + "\n"


def increments(draw: random.Random) -> str:
    """Return exact increments in rad, counted in units of 2 microradians as a gyro with pulses does."""
    unit = 2e-6
    counted = [0, 0, 0]
    lines = ["t,dx,dy,dz"]
    for sample in range(1, SAMPLES):
        time = sample / HERTZ
        cells = []
        for axis in range(3):
            total = round(math.radians(angle(axis, time)) / unit + draw.gauss(0, 0.5))
            cells.append(f"{(total - counted[axis]) * unit:.6f}")
            counted[axis] = total
        lines.append(",".join([f"{time:.2f}", *cells]))
    return "\n".join(lines) + "\n"


def recordings() -> dict[str, str]:
    """Return the text of every recording by its name."""
    draw = random.Random(1969)
    even = [sample / HERTZ for sample in range(SAMPLES)]
    uneven = [0.0, *(time + draw.uniform(-2e-3, 2e-3) for time in even[1:-1]), even[-1]]
    return {
        "rates_even.csv": rates(even, draw),
        "rates_uneven.csv": rates(uneven, draw),
        "increments.csv": increments(draw),
    }


if __name__ == "__main__":
    for name, text in recordings().items():
        (FOLDER / name).write_text(text)
