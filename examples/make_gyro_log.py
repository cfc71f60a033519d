"""Make `gyro_log.csv`: what a hand-held rate sensor would record, with uneven times and some noise.

The motion is our own: a slow turn, a wobble about two axes, then rest. The same seed gives the same file.
"""

import csv
import io
from pathlib import Path

import numpy as np

LOG = Path(__file__).parent / "gyro_log.csv"


def rows(seconds=12.0, rate_hz=100.0, seed=7):
    rng = np.random.default_rng(seed)
    intervals = 1 / rate_hz * (1 + rng.normal(scale=0.03, size=int(seconds * rate_hz)))
    intervals[rng.integers(0, len(intervals), 8)] *= 2  # samples that the logger lost
    t = np.concatenate([[0.0], np.cumsum(intervals)])
    moving = np.clip((seconds - 2 - t) / 2, 0, 1)
    rates = np.stack(
        [
            40 * np.sin(2.1 * t) * moving,
            25 * np.sin(1.3 * t + 0.4) * moving,
            30 * moving,
        ],
        axis=1,
    )
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
    print(f"wrote {LOG.name}")


if __name__ == "__main__":
    main()
