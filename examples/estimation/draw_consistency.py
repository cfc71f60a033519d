"""Draws what consistency.py computes: python examples/estimation/draw_consistency.py docs/preintegration.svg."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from consistency import WAYS, band, mean_nees
from simulated_imu import VEHICLES

from strapgen.results import figures


def draw(path: Path, runs: int) -> None:
    """Draw the means for the quadcopter against its vibration, and against its turning."""
    _, turning, *_, hz, rate, _ = VEHICLES["quadcopter"]
    cone = np.degrees(rate / (2 * np.pi * hz))
    figure, axes = figures.pyplot().subplots(1, 2, figsize=(9, 4.4), sharey=True, layout="constrained")
    panels = [
        (axes[0], "vibration", cone, (0.5, 1, 2, 4), f"half angle of the cone at {hz} Hz, deg"),
        (axes[1], "turning", turning, (0.05, 0.2, 0.5, 1), "rms of the body rate, deg/s"),
    ]
    for panel, what, unit, parts, label in panels:
        panel.axhspan(*band(runs), color="0.85", label="95 % band")
        for way, colour, mark in zip(WAYS, figures.COLOURS, "sov", strict=True):
            found = [mean_nees("quadcopter", "industrial", way, runs, **{what: part}) for part in parts]
            panel.loglog(unit * np.array(parts), found, color=colour, marker=mark, label=way)
        panel.set_xlabel(label)
        panel.set_xticks(
            unit * np.array(parts), [f"{float(f'{unit * part:.2g}'):g}" for part in parts], minor=False
        )
        panel.set_xticks([], minor=True)
        figures.style(panel)
    axes[0].set_yticks([15, 50, 150, 500], ["15", "50", "150", "500"])
    axes[0].set_yticks([], minor=True)
    axes[0].set_ylabel("mean NEES of the last state")
    axes[0].legend(frameon=False, fontsize=9)
    figures.title(
        figure, f"Quadcopter at 200 Hz, {runs} runs of an optimiser: 15 where the covariance is right"
    )
    path.write_bytes(figures.image(figure, path))


def main() -> None:
    """Write the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("path", type=Path)
    parser.add_argument("--runs", type=int, default=100)
    options = parser.parse_args()
    draw(options.path, options.runs)


if __name__ == "__main__":
    main()
