"""What the folder brings."""

from __future__ import annotations

from strapgen.registration import Command, Registration

REGISTRATION = Registration(
    "runs against truth: simulation, comparison, convergence, recordings, sensor errors, cost",
    commands={
        "simulate": Command(
            f"{__package__}.simulate.simulate_command:simulate",
            "Run",
            summary="Run an algorithm on a motion, or on recorded gyro data",
        ),
        "compare": Command(
            f"{__package__}.compare.compare_command:compare",
            "Run",
            summary="Compare back ends on the same increments with a reference",
        ),
        "converge": Command(
            f"{__package__}.converge.converge_command:converge",
            "Analyse",
            summary="Measure the order of a step and show it beside the predicted one",
        ),
        "cost": Command(
            f"{__package__}.cost.cost_command:cost",
            "Analyse",
            summary="Measure what the C of a kernel costs on microcontrollers",
        ),
        "study": Command(
            f"{__package__}.word_length.study_command:app",
            "Reproduce",
            summary="Run an algorithm with many settings, and show the drift",
        ),
        "study sensor-errors": Command(
            f"{__package__}.sensor_error_study.sensor_errors_command:study_sensor_errors"
        ),
        "study monte-carlo": Command(f"{__package__}.monte_carlo.monte_carlo_command:study_monte_carlo"),
    },
    motions=(f"{__package__}.motions.motion_names:TABLE",),
    files={"sensor-errors": f"{__package__}.sensor_errors.error_file:ERRORS"},
    lists={"motions": f"{__package__}.motions.motions:titles"},
)
