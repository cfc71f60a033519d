"""The responses of a pulse torquing loop, as a result and drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from strapgen.navigation.torquing.torquing import TorqueLoop
from strapgen.navigation.torquing.torquing_study import MEANINGS, STEP, TorquingRow
from strapgen.results import figures
from strapgen.results.records import entry, properties
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable

_FIGURES = ("printed", "linear", "quantised")
#: Frequencies of the printed gains and of a picture in Hz.
HERTZ = (10, 40, 80, 120)


@dataclass(frozen=True)
class TorquingResult(Result):
    """The responses of a pulse torquing loop."""

    rows_in = "figures"
    computed = properties(largest_pole=entry(), gains=entry())
    drawn_by = f"{__name__}:torquing_image"

    loop: TorqueLoop
    figures: Sequence[TorquingRow] = field(metadata=entry(key="rows"))

    @property
    def largest_pole(self) -> float:
        """Magnitude of the largest pole of the linear loop."""
        return float(abs(self.loop.poles[0]))

    @property
    def gains(self) -> dict[str, float]:
        """Gain from rate to commanded rate by frequency, linear."""
        gains = zip(HERTZ, self.loop.response(HERTZ), strict=True)
        return {f"{hertz} Hz": float(gain) for hertz, gain in gains}

    def text(self) -> str:
        """Return the figures beside the printed ones, and the gains."""
        table = TextTable(
            [Column("", "<"), *(Column(name, spec=".5g") for name in _FIGURES)],
            [[MEANINGS[row.quantity], *(getattr(row, name) for name in _FIGURES)] for row in self.figures],
        )
        shown = ", ".join(f"{gain:.4f} at {hertz}" for hertz, gain in self.gains.items())
        return "\n".join(
            [
                *table.lines(),
                "",
                f"gain from rate to commanded rate, linear: {shown}",
                f"largest pole of the linear loop: {self.largest_pole:.7f}; pulse {self.loop.pulse_arcsec:g} arcsec, "
                f"{self.loop.steady_gain:.6g} pulses a cycle for a quantum",
                "quantised: angle in whole quanta, command in whole pulses up to the largest; its offset is that at "
                "99 % of the largest rate",
            ]
        )


def torquing_image(result: TorquingResult, path: str | Path) -> bytes:
    """Return the step of the float angle and the gain over frequency."""
    loop = result.loop
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
