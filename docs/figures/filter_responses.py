"""Draws docs/filters.svg, the responses of the filters of the MFCRS: python docs/figures/filter_responses.py."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from strapgen.navigation.filters.filter_file import read
from strapgen.navigation.filters.filter_study import decibels
from strapgen.results import figures

ROOT = Path(__file__).resolve().parents[2]
PICTURE = ROOT / "docs" / "filters.svg"
NAMES = ("dither-notch", "pitch-notch", "roll-notch", "lag-lead", "lead-lag", "accelerometer-lag")


def main() -> None:
    """Write the picture."""
    figure, grid = figures.grid_of_axes(1, 1, (8.5, 4.2))
    axes = grid[0, 0]
    for name, colour in zip(NAMES, figures.several_colours(len(NAMES)), strict=True):
        one = read(ROOT / "examples" / "filters" / f"{name}.toml")
        rate = float(one.sample_hz)
        part = np.union1d(
            np.geomspace(0.003, 0.499, 500), one.designs[0].hz / rate * np.linspace(0.99, 1.01, 41)
        )
        gains = [decibels(one.digital(x * rate)) for x in part]
        axes.plot(part, gains, color=colour, linewidth=1.4, label=one.title)
    axes.set_xscale("log")
    axes.set_ylim(-65, 8)
    axes.set_xlabel("frequency over the sampling rate")
    axes.set_ylabel("gain, dB")
    figures.style(axes)
    figures.common_legend(figure, [axes], loc="outside right center")
    figures.title(figure, "Filters of the MFCRS")
    PICTURE.write_bytes(figures.image(figure, PICTURE))


if __name__ == "__main__":
    main()
