"""Gains of the MFCRS filters at the frequency that says most: in double, and in C with words of 16 bits."""

from pathlib import Path

import numpy as np

import strapgen

FOLDER = Path(__file__).parent / "filters"
#: Samples in a second, and a frequency in Hz.
FILES = {
    "dither-notch": (2400, 411),
    "pitch-notch": (50, 8.5),
    "roll-notch": (50, 9.5),
    "lag-lead": (50, 24.9),
    "lead-lag": (50, 24.9),
    "accelerometer-lag": (50, 1.5915),
}
#: Cycles that are left out, until a filter has settled, and those that are measured.
SETTLING, CYCLES = 400, 2400


def gain(evaluator, rate, hertz):
    """Return the gain in dB for a sine with an amplitude of 96, one phase on each axis."""
    states = [np.zeros(3) for _ in evaluator.function.inputs[:-1]]
    angles = 2 * np.pi * hertz / rate * np.arange(SETTLING + CYCLES)
    samples = 96 * np.sin(angles[:, None] + np.arange(3))
    outputs = np.empty_like(samples)
    for k, sample in enumerate(samples):
        *states, outputs[k] = evaluator(*states, sample)
    wave = np.stack([np.sin(angles), np.cos(angles), np.ones(len(angles))], axis=1)[SETTLING:]
    found, given = (np.linalg.lstsq(wave, x[SETTLING:], rcond=None)[0] for x in (outputs, samples))
    return 20 * np.log10(np.linalg.norm(found[:2]) / np.linalg.norm(given[:2]))


def main():
    print(f"{'filter':<20}{'Hz':>8}{'double, dB':>12}{'16 bits, dB':>13}")
    for name, (rate, hertz) in FILES.items():
        choice = strapgen.choose("filter", layout=FOLDER / f"{name}.toml")
        in_double, in_words = (
            gain(strapgen.evaluator(choice, backend), rate, hertz) for backend in ("c", "c-fixed16")
        )
        print(f"{name:<20}{hertz:>8g}{in_double:>12.3f}{in_words:>13.3f}")


if __name__ == "__main__":
    main()
