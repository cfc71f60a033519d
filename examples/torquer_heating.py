"""Scale factors of gyros whose torquers heat up: exact, and in fixed point with and without error feedback."""

from __future__ import annotations

import numpy as np

import strapgen

#: Rate of a turn in rad/s, time constant of the torquers in s, steady deviation for a squared rate of 1 rad/s.
RATE, TAU, GAIN = np.radians(100), 150, -2.6e-4
#: Cycles a second, and the length of the turn in s.
HERTZ, SECONDS = 93, 360


def exact() -> list[float]:
    """Return the deviation after the turn, and after a pause of 540 s, in cycles of a second in double."""
    heating = strapgen.evaluator("scale-factor-heating")
    deviation, found = np.zeros(3), []
    for rate, seconds in ((RATE, SECONDS), (0.0, 540)):
        torques = np.array([rate, 0, rate, 0, rate, 0])
        for _ in range(seconds):
            deviation, _ = heating(deviation, torques, -np.expm1(-1 / TAU), np.full(3, GAIN), 1.0)
        found.append(float(deviation[0]))
    return found


def fixed_point(word: int, carry: str) -> float:
    """Return the error of the deviation after the turn in fixed-point C."""
    settings = strapgen.Settings(word=word, carry=carry)
    heating = strapgen.evaluator("scale-factor-heating", f"c-fixed{word}", settings)
    torque = RATE / np.sqrt(2) / HERTZ
    values = np.zeros(3), np.full(6, torque), -np.expm1(-1 / TAU / HERTZ), np.full(3, GAIN), float(HERTZ)
    arguments = zip(heating.interface.inputs, values, strict=True)
    words = [heating.integers(argument, value).reshape(1, -1) for argument, value in arguments]
    feedback = heating.fresh(1)
    for _ in range(SECONDS * HERTZ):
        (words[0], _), feedback = heating.run(words, feedback)
    (reached, *_), *_ = heating.numbers(heating.interface.outputs[0], words[0])
    return float(abs(reached - GAIN * RATE**2 * -np.expm1(-SECONDS / TAU)))


def main() -> None:
    """Print the deviations, and the errors of words of 32 and 16 bits."""
    turned, rested = exact()
    print(f"after 360 s at 100 deg/s {turned:.5e}, after 540 s at rest {rested:.5e}")
    for word in (32, 16):
        for carry in ("none", "state"):
            print(f"{word} bits, error feedback {carry:5}  error {fixed_point(word, carry):.0e}")


if __name__ == "__main__":
    main()
