"""Make `gyro_log.csv`: what a hand-held rate sensor would record, with uneven times and some noise.

The motion is our own: a slow turn, a wobble about two axes, then rest. The same seed gives the same file. Beside it is
`gyro_truth.tum`: the attitude as cameras would see it, 20 times a second, on a clock that is ahead by 3.21 s.
"""

import csv
import io
from pathlib import Path

import numpy as np

LOG = Path(__file__).parent / "gyro_log.csv"
TRUTH = Path(__file__).parent / "gyro_truth.tum"
SECONDS = 12.0
#: Clock of the cameras, their rate, and the noise of their attitude in rad.
AHEAD, CAMERA_HZ, CAMERA_NOISE = 3.21, 20, 0.001


def turning(t, seconds=SECONDS):
    """Return the true body rates in deg/s at some times."""
    moving = np.clip((seconds - 2 - t) / 2, 0, 1)
    return np.stack(
        [
            40 * np.sin(2.1 * t) * moving,
            25 * np.sin(1.3 * t + 0.4) * moving,
            30 * moving,
        ],
        axis=1,
    )


def product(p, q):
    """Return the quaternion of the rotation q, then p; x, y, z, s."""
    vector = p[3] * q[:3] + q[3] * p[:3] + np.cross(p[:3], q[:3])
    return np.array([*vector, p[3] * q[3] - p[:3] @ q[:3]])


def small(turn):
    """Return the quaternion of a rotation vector in rad."""
    half = np.linalg.norm(turn) / 2
    return np.array([*(np.sinc(half / np.pi) / 2 * turn), np.cos(half)])


def attitudes(step=0.001, seed=8):
    """Yield times on the cameras' clock and quaternions."""
    rng = np.random.default_rng(seed)
    q, each = small(np.radians([5, -10, 70])), round(1 / CAMERA_HZ / step)
    for k, rate in enumerate(turning((np.arange(round(SECONDS / step)) + 0.5) * step)):
        if k % each == 0:
            yield AHEAD + k * step, product(q, small(rng.normal(scale=CAMERA_NOISE, size=3)))
        q = product(q, small(np.radians(rate) * step))


def rows(seconds=SECONDS, rate_hz=100.0, seed=7):
    rng = np.random.default_rng(seed)
    intervals = 1 / rate_hz * (1 + rng.normal(scale=0.03, size=int(seconds * rate_hz)))
    intervals[rng.integers(0, len(intervals), 8)] *= 2  # samples that the logger lost
    t = np.concatenate([[0.0], np.cumsum(intervals)])
    rates = turning(t, seconds)
    rates += np.array([0.12, -0.2, 0.05]) + rng.normal(scale=0.08, size=rates.shape)
    return t, rates


def text():
    t, rates = rows()
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["time (s)", "gyroscope x (deg/s)", "gyroscope y (deg/s)", "gyroscope z (deg/s)"])
    writer.writerows(
        [f"{time:.6f}", *(f"{rate:.4f}" for rate in row)] for time, row in zip(t, rates, strict=True)
    )
    return out.getvalue()


def main():
    LOG.write_text(text())
    poses = (f"{time:.3f} 0 0 0 {' '.join(f'{x:.6f}' for x in q)}\n" for time, q in attitudes())
    TRUTH.write_text("".join(poses))
    print(f"wrote {LOG.name} and {TRUTH.name}")


if __name__ == "__main__":
    main()
