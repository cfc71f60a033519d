"""What the folder brings."""

from __future__ import annotations

from strapgen.registration import Command, Registration

REGISTRATION = Registration(
    "coefficients and windows for a band, the accuracy that a cost buys, an algorithm for a brief",
    commands={
        "coning": Command(f"{__package__}.coning.coning_command:coning", "Derive"),
        "window": Command(f"{__package__}.commit_late.window_generate_command:app", "Derive"),
        "frontier": Command(f"{__package__}.frontier.frontier_command:frontier", "Analyse"),
        "design": Command(f"{__package__}.selection.design_command:design", "Analyse"),
    },
    extensions={"lab.whole-recordings": f"{__package__}.commit_late:whole_recordings"},
    requires=("lab", "analysis"),
)
