"""Attitude from a recorded gyro log: uneven rates in deg/s, resampled to 100 Hz, on every back end.

Usage: python recorded_gyro.py [LOG.csv]   (first four columns: time in s, three rates in deg/s)
"""

import math
import sys
from pathlib import Path

import numpy as np

import strapgen

LOG = Path(__file__).parent / "gyro_log.csv"


def main(log=LOG):
    recording = strapgen.read_rates(log, "deg/s", resample_hz=100)
    print(f"{len(recording.samples)} increments of {recording.interval} s")
    for name in strapgen.BACKENDS:
        try:
            backend = strapgen.backend("euler", "rk4", 2, name)
            history = strapgen.propagate(backend, recording, orthonormalize=1)
        except strapgen.CompilerError as error:  # this machine lacks what the back end needs
            print(f"{name:<12} {error}")
            continue
        e = history.states[-1].astype(float)
        turned = 2 * math.degrees(math.atan2(np.linalg.norm(e[:3]), abs(e[3])))
        print(f"{name:<12} e = {np.array2string(e, precision=9)}, turned by {turned:.6f} deg in all")


if __name__ == "__main__":
    main(*sys.argv[1:])
