"""Make `inertial_log.csv`: the increments of a gyro and an accelerometer that wobble on one spot, at 100 Hz.

The body cones, and feels the reaction to gravity alone. So the integral of the specific force in navigation axes is
known: 9.80665 m/s each second along z, upwards. The angle increments are exact, and so is the attitude.
"""

import csv
import io
from fractions import Fraction
from pathlib import Path

import numpy as np

import strapgen

LOG = Path(__file__).parent / "inertial_log.csv"
GRAVITY = np.array([0.0, 0.0, 9.80665])
WOBBLE = {"a_deg_s": 20, "b_deg_s": 200, "g_deg_s": 5}


def increments(seconds=10, rate_hz=100):
    """Return ends of the increments in s, angle increments in rad and velocity increments in m/s, body axes."""
    wobble = strapgen.motion("coning", **WOBBLE)
    step, count = Fraction(1, rate_hz), seconds * rate_hz
    angles = wobble.increments(step, count, 1)[:, 0]
    # Gauss: exact to the last place of what is printed.
    nodes, weights = np.polynomial.legendre.leggauss(6)
    begin = np.arange(count) / rate_hz
    velocities = np.zeros((count, 3))
    for node, weight in zip(nodes, weights, strict=True):
        attitude = wobble.attitude(begin + float(step) * (1 + node) / 2)
        velocities += weight / 2 * float(step) * (attitude.swapaxes(-1, -2) @ GRAVITY)
    return begin + float(step), angles, velocities


def text():
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["t", "dx", "dy", "dz", "dvx", "dvy", "dvz"])
    for time, angle, velocity in zip(*increments(), strict=True):
        writer.writerow([f"{time:.2f}", *(f"{x:.12g}" for x in angle), *(f"{x:.12g}" for x in velocity)])
    return out.getvalue()


def main():
    LOG.write_text(text())
    print(f"wrote {LOG.name}")


if __name__ == "__main__":
    main()
