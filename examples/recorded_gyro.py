"""Attitude from a recorded gyro log, some of whose samples are lost, on every back end.

Usage: python recorded_gyro.py [LOG]   (any log that states the units of its rates)
"""

import math
import sys
from pathlib import Path

import numpy as np

import strapgen

LOG = Path(__file__).parent / "gyro_log.csv"


def main(log=LOG):
    recording = strapgen.read(log, input="instants", gaps="bridge")
    print(f"{len(recording.samples)} increments of {recording.interval:.6g} s")
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
