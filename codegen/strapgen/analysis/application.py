"""What the application brings."""

from __future__ import annotations

from strapgen.applications import Application, Command

_HERE = __name__.rpartition(".")[0]

APPLICATION = Application(
    "series of the truncation error, growth, vibration, methods with unknowns",
    commands={
        "tableau": Command(f"{_HERE}.tableau.tableau_command:tableau", "Derive"),
        "solve": Command(f"{_HERE}.unknowns.solve_command:solve", "Derive"),
        "series": Command(f"{_HERE}.error_analysis.series_command:series", "Analyse"),
        "vibration": Command(f"{_HERE}.vibration.vibration_command:vibration", "Analyse"),
        "stability": Command(f"{_HERE}.growth.stability_command:stability", "Analyse"),
    },
    requires=("lab",),
)
