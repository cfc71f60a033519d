"""What the folder brings."""

from __future__ import annotations

from strapgen.registration import Command, Registration

REGISTRATION = Registration(
    "tables and statements of the thesis",
    commands={
        "tables": Command(
            f"{__package__}.tables_command:tables",
            "Reproduce",
            summary="Compute the tables of the thesis beside its printed figures",
        ),
        "statements": Command(
            f"{__package__}.statements_command:statements",
            "Reproduce",
            summary="Run the statements of the thesis's text, and say whether they hold",
        ),
    },
    results={
        "thesis-tables": f"{__package__}.tables_report:ThesisTablesResult",
        "predicted-tables": f"{__package__}.predicted_tables_report:PredictedTablesResult",
        "statements": f"{__package__}.statements_report:StatementsResult",
    },
    requires=("lab", "analysis"),
)
