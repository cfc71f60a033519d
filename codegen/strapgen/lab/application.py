"""What the application brings."""

from __future__ import annotations

from strapgen.applications import Application, Command

_HERE = __name__.rpartition(".")[0]

APPLICATION = Application(
    "runs against truth: simulation, comparison, convergence, recordings, sensor errors, cost",
    commands={
        "simulate": Command(f"{_HERE}.simulate.simulate_command:simulate", "Run"),
        "compare": Command(f"{_HERE}.compare.compare_command:compare", "Run"),
        "converge": Command(f"{_HERE}.converge.converge_command:converge", "Analyse"),
        "cost": Command(f"{_HERE}.cost.cost_command:cost", "Analyse"),
        "study": Command(f"{_HERE}.word_length.study_command:app", "Reproduce"),
        "study sensor-errors": Command(
            f"{_HERE}.sensor_error_study.sensor_errors_command:study_sensor_errors"
        ),
        "study monte-carlo": Command(f"{_HERE}.monte_carlo.monte_carlo_command:study_monte_carlo"),
    },
    lists={"motions": f"{_HERE}.motions.motions:titles"},
)
