"""Registration of this folder."""

from __future__ import annotations

from strapgen.registration import Command, Registration

REGISTRATION = Registration(
    "runs against truth: simulation, comparison, convergence, recordings, sensor errors, cost",
    commands={
        "simulate": Command(
            f"{__package__}.simulate_command:simulate",
            "Run",
            summary="Run an algorithm on a motion, or on recorded gyro data",
        ),
        "compare": Command(
            f"{__package__}.compare_command:compare",
            "Run",
            summary="Compare back ends on the same increments with a reference",
        ),
        "log": Command(
            f"{__package__}.log_command:log",
            "Run",
            summary="Show what a log holds, and the command that runs it",
        ),
        "certify": Command(
            f"{__package__}.certify_command:certify",
            "Analyse",
            summary="Certify the error of rounding and method on a recorded run",
        ),
        "converge": Command(
            f"{__package__}.converge_command:converge",
            "Analyse",
            summary="Measure the order of a step beside the predicted one",
        ),
        "cost": Command(
            f"{__package__}.cost_command:cost",
            "Analyse",
            summary="Measure size and execution of generated C on microcontrollers",
        ),
        "study": Command(
            f"{__package__}.study_command:app",
            "Reproduce",
            summary="Run an algorithm with many settings, and show the drift",
        ),
        "study sensor-errors": Command(f"{__package__}.sensor_errors_command:study_sensor_errors"),
        "study monte-carlo": Command(f"{__package__}.monte_carlo_command:study_monte_carlo"),
    },
    motions=(f"{__package__}.motions.motion_names:TABLE",),
    files={"sensor-errors": f"{__package__}.sensor_errors.error_file:ERRORS"},
    results={
        "run": f"{__package__}.runs_report:RunResult",
        "attitude": f"{__package__}.runs_report:HistoryResult",
        "log": f"{__package__}.recordings.log_report:LogResult",
        "comparison": f"{__package__}.comparison_report:ComparisonResult",
        "spread": f"{__package__}.attitude_spread:SpreadResult",
        "convergence": f"{__package__}.convergence_report:ConvergenceResult",
        "word-length": f"{__package__}.word_length_report:WordLengthResult",
        "certificate": f"{__package__}.certificate.certificate_report:CertificateResult",
        "cost": f"{__package__}.cost:CostResult",
        "random-runs": f"{__package__}.random_runs:RandomRunsResult",
        "sensor-errors": f"{__package__}.sensor_error_study:SensorErrorResult",
    },
    extensions={"cli.processors": f"{__package__}.processors:PROCESSORS"},
    lists={"motions": f"{__package__}.motions.motions:titles"},
    requires=("stamped",),
)
