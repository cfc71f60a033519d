"""What coning coefficients leave: drift on a cone of one degree at 10 Hz, sampled at 100 Hz for a minute, in C."""

from fractions import Fraction

import numpy as np

import strapgen

DESIGNS = (
    ("compressed", 1, 0, "no coning correction"),
    ("compressed", 1, 1, "one previous sample"),
    ("compressed", 4, 0, ""),
    ("compressed", 5, 0, ""),
    ("uncompressed", 5, 0, ""),
    ("combined", 4, 0, "terms of third and fourth order kept"),
    ("combined", 5, 0, "terms of third and fourth order kept"),
)


def main():
    half_angle, frequency, duration = np.radians(1), 20 * np.pi, 60
    # The coning motion whose axis stands still.
    cone = strapgen.motion(
        "coning",
        a_rad_s=frequency * np.sin(half_angle),
        b_rad_s=frequency,
        g_rad_s=-2 * frequency * np.sin(half_angle / 2) ** 2,
    )
    axis = np.array([0, np.cos(half_angle), np.sin(half_angle)])
    print("largest drift of the run about the axis of the cone, over its duration, deg/h")
    for form, samples, previous, remark in DESIGNS:
        backend = strapgen.backend("euler", f"coning-{form}", samples, "c", previous=previous)
        run = strapgen.simulate(backend, cone, Fraction(samples, 100), duration)
        drift = np.degrees(np.abs(run.drift @ axis).max()) / duration * 3600
        before = f" and {previous} previous" if previous else ""
        print(f"  {f'{form}, {samples}{before}':<28}{drift:>10.4f}  {remark}".rstrip())


if __name__ == "__main__":
    main()
