"""Reports the error series of the velocity and position change of a step as text and LaTeX."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from strapgen.analysis.series.notation import LATEX, TEXT, covariant_text, with_forces
from strapgen.analysis.series.velocity_series import VelocitySeries, VelocityTerms
from strapgen.results.display.latex import equations
from strapgen.results.result import Result

#: Names of the errors in LaTeX.
_SYMBOLS = {"velocity": r"\delta\mathbf{v}", "position": r"\delta\mathbf{r}/h"}


@dataclass(frozen=True)
class VelocitySeriesResult(Result):
    """What one step of velocity and position loses, as power series in its length."""

    each = VelocityTerms

    several: Sequence[VelocitySeries]

    def results(self) -> Sequence[VelocityTerms]:
        """Return the series as text and terms."""
        return [VelocityTerms.of(one) for one in self.several]

    def text(self) -> str:
        """Return the series one after the other."""
        return "\n\n".join(map(_text, self.several))

    def latex(self) -> str:
        """Return the series as align environments."""
        return "\n\n".join(map(velocity_series_latex, self.several))


def _text(series: VelocitySeries) -> str:
    lines = [f"{series.kernel}, any motion: what one step of length h loses, computed less true"]
    if series.order is None:
        return "\n".join([*lines, f"nothing in the {series.parts[0]}, to the power {series.known} of h"])
    lines += [
        f"order {series.order} in the {series.parts[0]}; terms to the power {series.known} of h were looked at",
        "w0, w1, ... : the rate and its derivatives; f0, f1, ... : the specific force and its derivatives",
    ]
    notation = with_forces(TEXT, series.known)
    for part in series.parts:
        title = "velocity" if part == "velocity" else "position/h"
        for power, one in series.coefficients(part).items():
            lines += ["", f"h^{power}  {title:10}  {covariant_text(one, notation=notation)}"]
    return "\n".join(lines)


def velocity_series_latex(series: VelocitySeries) -> str:
    """Return the errors of a step as one align environment."""
    notation = with_forces(LATEX, series.known, r"\mathbf{{f}}_{{{}}}".format)
    rows = [
        (rf"h^{{{power}}}\!:\ {_SYMBOLS[part]}", covariant_text(one, notation=notation))
        for part in series.parts
        for power, one in series.coefficients(part).items()
    ]
    return equations(rows)
