"""What the folder brings."""

from __future__ import annotations

from strapgen.registration import Command, Registration

REGISTRATION = Registration(
    "series of the truncation error, growth, vibration, methods with unknowns",
    commands={
        "tableau": Command(
            f"{__package__}.tableau.tableau_command:tableau",
            "Derive",
            summary="Show a Butcher tableau with its order, checked exactly",
        ),
        "solve": Command(
            f"{__package__}.unknowns.solve_command:solve",
            "Derive",
            summary="Solve the conditions on the unknown coefficients of an algorithm",
        ),
        "series": Command(
            f"{__package__}.error_analysis.series_command:series",
            "Analyse",
            summary="Derive drift, scale and skew of a step as exact power series",
        ),
        "vibration": Command(
            f"{__package__}.vibration.vibration_command:vibration",
            "Analyse",
            summary="Show the drift that an algorithm computes under vibration",
        ),
        "stability": Command(
            f"{__package__}.growth.stability_command:stability",
            "Analyse",
            summary="Show at which constant rates the state grows in a step",
        ),
    },
    files={"tableau-with-unknowns": f"{__package__}.unknowns.unknown_tableau:UNKNOWN_TABLEAU"},
    requires=("lab",),
)
