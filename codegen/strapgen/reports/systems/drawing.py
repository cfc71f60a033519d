"""Draws the wiring of a described system as SVG: lanes by rate, boxes for stages, wires with unit and frame."""

from __future__ import annotations

from strapgen.reports.systems.layout import plan
from strapgen.reports.systems.parts import CHARACTER, HEAD, LANE_HEAD, LINE, MARGIN
from strapgen.systems.fitting import Fitted
from strapgen.targets.rendering import render


def drawing(fit: Fitted) -> str:
    """Return a drawing of the wiring of a system.

    Parameters
    ----------
    fit : Fitted

    Returns
    -------
    str
        SVG, with colours for light and dark backgrounds.
    """
    system = fit.description.system
    placed = plan(system)
    order = {"forward": 0, "shared": 1, "delayed": 2}
    kinds = sorted({link.kind for link in placed.links}, key=lambda kind: order[kind])
    return render(
        "system_svg/drawing.svg.j2",
        system=system,
        plan=placed,
        paths=sorted(placed.paths, key=lambda entry: order[entry[0].kind]),
        kinds=kinds,
        words={
            "forward": "wire",
            "shared": "shared state: the same memory",
            "delayed": "goes back: one cycle late",
        },
        sums=any(port.mark == "sum" for box in placed.boxes for port in box.outputs),
        sizes={"line": LINE, "head": HEAD, "lane_head": LANE_HEAD, "margin": MARGIN, "character": CHARACTER},
    )
