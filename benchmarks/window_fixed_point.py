"""Windows in fixed point: prints the table of error feedback of docs/windows.md, or runs an hour bit for bit.

Run it with ``python benchmarks/window_fixed_point.py``; with ``--minutes 60`` the C and the integer model run 360,000
steps at 100 Hz, for which the model takes some minutes.
"""

from __future__ import annotations

import argparse
from fractions import Fraction

import numpy as np

import strapgen
from strapgen.lab.runs import angles, attitude, drift_between
from strapgen.run.backends import Backend
from strapgen.run.increments import pulses

INTERVAL = Fraction(1, 100)
WINDOW = "window-7-7"
#: Half-angles in degrees and frequencies in Hz: of a whole number of samples a turn, and of none.
CONES = (("1", "10"), ("1", "10.037"), ("1", "20"), ("5", "5"))
#: Minutes between the attitudes of a long run that are printed.
SHOWN = 10


def step(carry: str, name: str = "c-fixed32") -> Backend:
    """Return the step in words of 32 bits for samples up to 1/8 rad."""
    return strapgen.backend("euler", WINDOW, None, name, settings=strapgen.Settings(carry=carry))


def unit_of(fixed: Backend) -> Fraction:
    """Return the last place of a sample in rad."""
    unit: Fraction = fixed.interface.inputs[1].format.unit
    return unit


def print_feedback() -> None:
    """Print the largest angle from the true attitude over 60 s for every error feedback, in rad."""
    double = strapgen.backend("euler", WINDOW, None, "c")
    print("cone | none | state | full | full, samples rounded one by one | double")
    for angle, hertz in CONES:
        cone = strapgen.motion("cone", half_angle_deg=angle, frequency_hz=hertz)
        every = [step(carry) for carry in ("none", "state", "full")]
        pulse = unit_of(every[0])
        runs = [strapgen.simulate(each, cone, INTERVAL, 60, pulse=pulse) for each in every]
        runs.append(strapgen.simulate(every[-1], cone, INTERVAL, 60))
        runs.append(strapgen.simulate(double, cone, INTERVAL, 60, pulse=pulse))
        print(f"{angle}° at {hertz} Hz", *(f"{angles(run).max():.1e}" for run in runs), sep=" | ")


def print_long_run(minutes: int) -> None:
    """Print whether C and integer model agree, and how far they are from the true attitude."""
    steps, motion = minutes * 6000, strapgen.motion("random", rate_deg_s=60)
    c, model = step("full"), step("full", "fixed-model")
    samples = motion.samples(INTERVAL, -c.previous, steps + c.ahead)
    whole = pulses(samples[:, None], unit_of(c))[:, 0]
    windows = np.lib.stride_tricks.sliding_window_view(whole, c.samples, axis=0).swapaxes(1, 2)
    by_c, by_model = (backend.propagate(windows) for backend in (c, model))
    same = "agree" if np.array_equal(by_c, by_model) else "DIFFER"
    print(f"{steps} steps of {c.kernel}, 32 bits, carry full: C and integer model {same}")
    double = strapgen.backend("euler", WINDOW, None, "c").propagate(windows)
    start = motion.attitude(np.zeros(1))[0]
    for minute in range(SHOWN, minutes + 1, SHOWN):
        true = motion.attitude(np.array([60.0 * minute]))[0]
        apart = (
            np.linalg.norm(drift_between(start @ attitude(c, states[minute * 6000]), true))
            for states in (by_c, double)
        )
        print("{:3d} min: fixed point {:.1e} rad, double {:.1e} rad".format(minute, *apart))


def main() -> None:
    """Print the table, or run as many minutes as are asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=int, default=0, help="length of a run of C and integer model")
    minutes = parser.parse_args().minutes
    if minutes:
        print_long_run(minutes)
    else:
        print_feedback()


if __name__ == "__main__":
    main()
