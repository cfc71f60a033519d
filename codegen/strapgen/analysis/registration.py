"""What the folder brings."""

from __future__ import annotations

from strapgen.registration import Command, Registration

REGISTRATION = Registration(
    "series of the truncation error, growth, vibration, methods with unknowns",
    commands={
        "tableau": Command(f"{__package__}.tableau.tableau_command:tableau", "Derive"),
        "solve": Command(f"{__package__}.unknowns.solve_command:solve", "Derive"),
        "series": Command(f"{__package__}.error_analysis.series_command:series", "Analyse"),
        "vibration": Command(f"{__package__}.vibration.vibration_command:vibration", "Analyse"),
        "stability": Command(f"{__package__}.growth.stability_command:stability", "Analyse"),
    },
    requires=("lab",),
)
