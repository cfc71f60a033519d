"""Prints certificates of an hour at 100 Hz, beside the bounds of the headers, and the processor time that they take."""

from __future__ import annotations

import argparse
import time
from fractions import Fraction

from strapgen import Recording, Settings, backend, certify, motion, propagate
from strapgen.catalogue import choose_step

#: Step, error feedback, motion and its settings.
ROWS = (
    ("rk4", 2, 0, "none", "cone", {"half_angle_deg": 3, "frequency_hz": 7}),
    ("rk4", 2, 0, "none", "random", {"rate_deg_s": 60}),
    ("rk4", 2, 0, "full", "cone", {"half_angle_deg": 3, "frequency_hz": 7}),
    ("rk4", 2, 0, "full", "random", {"rate_deg_s": 60}),
    ("window-7-7", None, None, "none", "random", {"rate_deg_s": 60}),
    ("window-7-7", None, None, "none", "cone", {"half_angle_deg": 1, "frequency_hz": "10.037"}),
    ("window-7-7", None, None, "full", "random", {"rate_deg_s": 60}),
    ("window-7-7", None, None, "full", "cone", {"half_angle_deg": 1, "frequency_hz": "10.037"}),
    ("coning-compressed", 1, 1, "full", "random", {"rate_deg_s": 60}),
    ("coning-compressed", 1, 1, "full", "cone", {"half_angle_deg": 1, "frequency_hz": "10.037"}),
)


def main() -> None:
    """Print a row for each run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=360_000)
    parser.add_argument("--with-method", action="store_true", help="truncation of the step too")
    options = parser.parse_args()
    print("| step, 32 bits | carry | motion | rounding, rad | +- | header | factor | truncation | s |")
    print("|---|---|---|--:|--:|--:|--:|--:|--:|")
    for method, increments, previous, carry, name, settings in ROWS:
        choice = choose_step("euler", method, increments, previous=previous)
        profile, count = motion(name, **settings), options.steps * choice.increments_per_step
        samples = profile.samples(
            Fraction(1, 100 * choice.increments_per_step), 0, count + choice.previous + choice.ahead
        )
        data = Recording(0.0, 0.01 / choice.increments_per_step, samples)
        fixed = Settings(carry=carry).fitted(data.largest)
        run = propagate(backend(choice, backend="c-fixed32", settings=fixed), data)
        begin = time.process_time()
        found = certify(run, with_method=options.with_method)
        spent = time.process_time() - begin
        factor = (found.header_bound_rad or 0.0) / found.rounding_rad
        truncation = "" if found.truncation_rad is None else f"{found.truncation_rad:.2e}"
        print(
            f"| {method} | {carry} | {profile.name} | {found.rounding_rad:.3e} | {found.rounding_radius_rad:.0e} | "
            f"{found.header_bound_rad:.1e} | {factor:.0f} | {truncation} | {spent:.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
