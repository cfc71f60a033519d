"""Registration of this folder."""

from __future__ import annotations

from strapgen.registration import Command, Registration

REGISTRATION = Registration(
    "series of the truncation error, growth, vibration, methods with unknowns",
    commands={
        "tableau": Command(
            f"{__package__}.unknowns.solve_command:tableau",
            "Derive",
            summary="Show a Butcher tableau with its order, checked exactly",
        ),
        "solve": Command(
            f"{__package__}.unknowns.solve_command:solve",
            "Derive",
            summary="Solve the conditions on the unknown coefficients of an algorithm",
        ),
        "series": Command(
            f"{__package__}.series_command:series",
            "Analyse",
            summary="Derive drift, scale and skew of a step as exact power series",
        ),
        "vibration": Command(
            f"{__package__}.vibration.vibration_command:vibration",
            "Analyse",
            summary="Show the drift of an algorithm under vibration",
        ),
        "stability": Command(
            f"{__package__}.series_command:stability",
            "Analyse",
            summary="Show the limits of stability of a step at constant rates",
        ),
    },
    files={"tableau-with-unknowns": f"{__package__}.unknowns.unknown_tableau:UNKNOWN_TABLEAU"},
    results={
        "tableau": f"{__package__}.unknowns.tableau_report:TableauResult",
        "tableau-families": f"{__package__}.unknowns.tableau_report:FamiliesResult",
        "solution": f"{__package__}.unknowns.unknowns_report:SolvedResult",
        "series": f"{__package__}.error_analysis:SeriesResult",
        "velocity-series": f"{__package__}.series.velocity_series:VelocitySeriesResult",
        "overview": f"{__package__}.overview:OverviewResult",
        "ratio": f"{__package__}.ratios:RatioResult",
        "vibration": f"{__package__}.vibration.vibration_report:VibrationResult",
        "vibration-closed-forms": f"{__package__}.vibration.vibration_report:ClosedFormsResult",
        "stability": f"{__package__}.growth:StabilityResult",
    },
    requires=("lab",),
)
