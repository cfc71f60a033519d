"""Reports and draws the responses of a pulse torquing loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from strapgen.navigation.torquing.torquing import TorqueLoop
from strapgen.navigation.torquing.torquing_study import MEANINGS, STEP, TorquingRow
from strapgen.results import figures
from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable

_FIGURES = ("printed", "linear", "quantised")
#: Frequencies of the printed gains and of a picture in Hz.
HERTZ = (10, 40, 80, 120)


def torquing_report(loop: TorqueLoop, rows: Sequence[TorquingRow]) -> Report:
    """Return the study as a report."""
    poles = loop.poles
    gains = dict(zip(HERTZ, map(float, loop.response(HERTZ)), strict=True))

    def text() -> str:
        table = TextTable(
            [Column("", "<"), *(Column(name, spec=".5g") for name in _FIGURES)],
            [[MEANINGS[row.quantity], *(getattr(row, name) for name in _FIGURES)] for row in rows],
        )
        shown = ", ".join(f"{gain:.4f} at {hertz} Hz" for hertz, gain in gains.items())
        return "\n".join(
            [
                *table.lines(),
                "",
                f"gain from rate to commanded rate, linear: {shown}",
                f"largest pole of the linear loop: {abs(poles[0]):.7f}; pulse {loop.pulse_arcsec:g} arcsec, "
                f"{loop.steady_gain:.6g} pulses a cycle for a quantum",
                "quantised: angle in whole quanta, command in whole pulses up to the largest; its offset is that at "
                "99 % of the largest rate",
            ]
        )

    return Report(
        text,
        lambda: {
            "loop": asdict(loop),
            "largest_pole": float(abs(poles[0])),
            "gains": {f"{hertz} Hz": gain for hertz, gain in gains.items()},
            "rows": [asdict(row) for row in rows],
        },
        lambda: TextTable(
            [Column("quantity", "<"), *(Column(name, spec=".9g", missing="") for name in _FIGURES)],
            [[row.quantity, *(getattr(row, name) for name in _FIGURES)] for row in rows],
        ),
    )


def torquing_image(loop: TorqueLoop, path: str | Path) -> bytes:
    """Return the step of the float angle and the gain over frequency."""
    figure, (step, response) = figures.pyplot().subplots(1, 2, figsize=(10.4, 4.2), layout="constrained")
    cycles = round(0.05 * loop.cycle_hz)
    time = np.arange(cycles) * loop.cycle * 1e3
    for label, quantised, colour in zip(_FIGURES[1:], (False, True), figures.COLOURS, strict=False):
        angle, _ = loop.run(np.zeros_like, cycles, STEP, quantised)
        step.plot(time, angle, color=colour, linewidth=1.6, label=label)
    step.set_xlabel("time, ms")
    step.set_ylabel("float angle, arcsec")
    step.set_title(f"step of {STEP:g} arcsec", loc="left", fontsize=10)
    hertz = np.geomspace(1, min(400.0, loop.cycle_hz / 2), 300)
    response.semilogx(hertz, loop.response(hertz), color=figures.COLOURS[0], linewidth=1.6)
    response.axhline(2**-0.5, color="0.5", linewidth=1, linestyle="--")
    response.text(1.1, 2**-0.5 + 0.02, "half of the power", fontsize=8, color="0.3")
    response.set_xlabel("frequency, Hz")
    response.set_title("commanded rate for a rate of 1", loc="left", fontsize=10)
    response.set_ylim(bottom=0)
    for axes in (step, response):
        figures.style(axes)
    figures.common_legend(figure, [step], loc="outside lower center", ncols=2)
    figures.title(figure, "pulse torquing loop")
    return figures.image(figure, path)
