"""Registration of this folder."""

from __future__ import annotations

from strapgen.registration import Command, Registration

REGISTRATION = Registration(
    "coefficients and windows for a band, the accuracy that a cost buys, an algorithm for a brief",
    commands={
        "coning": Command(
            f"{__package__}.coning_command:coning",
            "Derive",
            summary="Derive coning coefficients and their residual drift",
        ),
        "window": Command(
            f"{__package__}.window_command:app",
            "Derive",
            summary="Design windows, filters of samples on both sides of a step",
        ),
        "frontier": Command(
            f"{__package__}.design_command:frontier",
            "Analyse",
            summary="Compare the drift of algorithms on many motions with their cost",
        ),
        "design": Command(
            f"{__package__}.design_command:design",
            "Analyse",
            summary="Select the cheapest algorithm that meets a brief",
        ),
    },
    files={"brief": f"{__package__}.brief:BRIEF"},
    results={
        "coning": f"{__package__}.coning_report:ConingResult",
        "shaped-coning": f"{__package__}.coning_report:ShapedResult",
        "window": f"{__package__}.window_report:WindowResult",
        "late-sources": f"{__package__}.commit_late.commit_late_sources:LateResult",
        "frontier": f"{__package__}.frontier:FrontierResult",
        "selection": f"{__package__}.selection.selection_report:SelectionResult",
    },
    extensions={
        "lab.whole-recordings": f"{__package__}.commit_late:late_recording",
        "lab.late-certificate": f"{__package__}.commit_late.late_certificate:certify_late",
    },
    requires=("lab", "analysis"),
)
