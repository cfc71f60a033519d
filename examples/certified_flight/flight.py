"""Writes a flight of 12 s: increments of the gyro as a log, flight.csv, and as words for the processor, flight.h.

The processor takes words, so that the log has what they stand for, exactly.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np

from strapgen import Settings, backend, motion

STEP, STEPS = Fraction(1, 100), 1200

settings = Settings.of(increments=2, max_rate_deg_s=400, step=STEP)
step = backend("euler", "rk4", 2, backend="fixed-model", settings=settings)
exact = motion("random", rate_deg_s=40).samples(STEP / 2, 0, 2 * STEPS)
increments = step.representable(exact.reshape(STEPS, 2, 3)).reshape(-1, 3)
words = np.rint(increments / float(step.interface.inputs[1].unit)).astype(int)

rows = [f"{0.005 * (k + 1):.3f},{x!r},{y!r},{z!r}" for k, (x, y, z) in enumerate(increments.tolist())]
Path("flight.csv").write_text("\n".join(["t [s],dx [rad],dy [rad],dz [rad]", *rows]) + "\n")
table = ",\n".join(f"    {{{', '.join(map(str, row))}}}" for row in words.reshape(STEPS, 6).tolist())
Path("flight.h").write_text(
    f"#include <stdint.h>\n\n#define STEPS {STEPS}\n\nstatic const int32_t flight[STEPS][6] = {{\n{table}\n}};\n"
)
