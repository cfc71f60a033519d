"""What the application brings."""

from __future__ import annotations

from strapgen.applications import Application, Command

_HERE = __name__.rpartition(".")[0]

APPLICATION = Application(
    "coefficients and windows for a band, the accuracy that a cost buys, an algorithm for a brief",
    commands={
        "coning": Command(f"{_HERE}.coning.coning_command:coning", "Derive"),
        "window": Command(f"{_HERE}.commit_late.window_generate_command:app", "Derive"),
        "frontier": Command(f"{_HERE}.frontier.frontier_command:frontier", "Analyse"),
        "design": Command(f"{_HERE}.selection.design_command:design", "Analyse"),
    },
    extensions={"lab.whole-recordings": f"{_HERE}.commit_late:whole_recordings"},
    requires=("lab", "analysis"),
)
