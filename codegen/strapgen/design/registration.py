"""What the folder brings."""

from __future__ import annotations

from strapgen.registration import Command, Registration

REGISTRATION = Registration(
    "coefficients and windows for a band, the accuracy that a cost buys, an algorithm for a brief",
    commands={
        "coning": Command(
            f"{__package__}.coning.coning_command:coning",
            "Derive",
            summary="Derive coning coefficients and the drift that remains",
        ),
        "window": Command(
            f"{__package__}.commit_late.window_generate_command:app",
            "Derive",
            summary="Design windows, filters of samples on both sides of a step",
        ),
        "frontier": Command(
            f"{__package__}.frontier.frontier_command:frontier",
            "Analyse",
            summary="Compare the drift of algorithms on many motions with their cost",
        ),
        "design": Command(
            f"{__package__}.selection.design_command:design",
            "Analyse",
            summary="Select the cheapest algorithm that meets a brief",
        ),
    },
    files={"brief": f"{__package__}.brief:BRIEF"},
    extensions={"lab.whole-recordings": f"{__package__}.commit_late:whole_recordings"},
    requires=("lab", "analysis"),
)
