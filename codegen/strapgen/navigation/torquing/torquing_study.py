"""Measures the responses of a pulse torquing loop beside those that its source prints."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from strapgen.navigation.torquing.torquing import TorqueLoop

Array = NDArray[np.float64]

#: The step of the float angle in arcsec, the rate in deg/s below the limit, and the angular acceleration in rad/s^2.
STEP, RATE_PART, ACCELERATION = 240.0, 0.99, 5.0
#: Times in s at which the angle under that acceleration is read, and how long the others are run.
TIMES = (0.05, 0.1)
_STEP_S, _RATE_S = 0.25, 3.0
#: Half of the power.
_HALF = 2**-0.5
_HIGHEST_HZ = 400.0
PRINTED = {
    "rise_ms": 3.75,
    "overshoot_percent": 20.0,
    "offset_quanta": 44.0,
    "offset_arcsec": 350.0,
    "bandwidth_hz": 80.0,
    "angle_at_0.05_s_arcsec": None,
    "angle_at_0.1_s_arcsec": 80.0,
}
#: What a quantity is, for a reader.
MEANINGS = {
    "rise_ms": f"rise from 10 to 90 % of a step of {STEP:g} arcsec, ms",
    "overshoot_percent": "overshoot, %; printed: below",
    "offset_quanta": "offset at the largest rate, quanta",
    "offset_arcsec": "offset at the largest rate, arcsec",
    "bandwidth_hz": "bandwidth, Hz",
    "angle_at_0.05_s_arcsec": f"angle under {ACCELERATION:g} rad/s^2 after 0.05 s, arcsec",
    "angle_at_0.1_s_arcsec": f"angle under {ACCELERATION:g} rad/s^2 after 0.1 s, arcsec",
}


@dataclass(frozen=True)
class TorquingRow:
    """A quantity of the loop."""

    #: A key of `PRINTED`
    quantity: str
    #: What the source prints, the loop without quanta and limit, and with them; None where there is none
    printed: float | None
    linear: float
    quantised: float | None


def rise(angle: Array, loop: TorqueLoop) -> float:
    """Return the time in s from 10 to 90 % of a step, between cycles by straight lines."""
    start = angle[0]
    times = []
    for part in (0.9, 0.1):
        k = int(np.argmax(angle < part * start))
        before, after = angle[k - 1], angle[k]
        times.append((k - 1 + (before - part * start) / (before - after)) * loop.cycle)
    return float(times[1] - times[0])


def bandwidth(loop: TorqueLoop) -> float:
    """Return the frequency in Hz above the peak at which the commanded rate has half of the power."""
    low, high = 1.0, min(_HIGHEST_HZ, loop.cycle_hz / 2)
    hertz = np.linspace(low, high, 2000)
    gains = loop.response(hertz)
    peak = int(np.argmax(gains))
    below = np.flatnonzero(gains[peak:] < _HALF)
    if not len(below):
        return float("nan")
    k = peak + int(below[0])
    return float(np.interp(-_HALF, -gains[k - 1 : k + 1], hertz[k - 1 : k + 1]))


def torquing_rows(loop: TorqueLoop) -> Iterator[TorquingRow]:
    """Run a loop, and yield every quantity."""
    cycles = round(_STEP_S * loop.cycle_hz)
    steps = [loop.run(np.zeros_like, cycles, STEP, quantised)[0] for quantised in (False, True)]
    rises = [rise(angle, loop) * 1e3 for angle in steps]
    rises[1] = round(rises[1] / 1e3 / loop.cycle) * loop.cycle * 1e3  # whole cycles
    yield TorquingRow("rise_ms", PRINTED["rise_ms"], *rises)
    overshoots = [float(-angle.min() / STEP * 100) for angle in steps]
    yield TorquingRow("overshoot_percent", PRINTED["overshoot_percent"], *overshoots)
    linear = loop.largest_pulses / loop.steady_gain
    rate = RATE_PART * loop.largest_deg_s
    angle, _ = loop.run(lambda t: rate + 0 * t, round(_RATE_S * loop.cycle_hz), 0.0, True)
    offset = float(angle[len(angle) // 2 :].mean() / loop.quantum_arcsec)
    yield TorquingRow("offset_quanta", PRINTED["offset_quanta"], linear, offset)
    unit = loop.quantum_arcsec
    yield TorquingRow("offset_arcsec", PRINTED["offset_arcsec"], linear * unit, offset * unit)
    yield TorquingRow("bandwidth_hz", PRINTED["bandwidth_hz"], bandwidth(loop), None)
    cycles = round((TIMES[-1] + 0.02) * loop.cycle_hz)
    turning = [
        loop.run(lambda t: np.degrees(ACCELERATION) * t, cycles, 0.0, quantised)[0]
        for quantised in (False, True)
    ]
    for time in TIMES:
        k = round(time * loop.cycle_hz)
        name = f"angle_at_{time:g}_s_arcsec"
        yield TorquingRow(name, PRINTED[name], *(float(angle[k]) for angle in turning))
