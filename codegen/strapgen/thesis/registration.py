"""Registration of this folder."""

from __future__ import annotations

from strapgen.registration import Command, Registration

REGISTRATION = Registration(
    "tables and statements of the thesis",
    commands={
        "tables": Command(
            f"{__package__}.thesis_commands:tables",
            "Reproduce",
            summary="Compute the tables of the thesis beside its printed figures",
        ),
        "statements": Command(
            f"{__package__}.thesis_commands:statements",
            "Reproduce",
            summary="Test the statements of the thesis's text by runs",
        ),
    },
    results={
        "thesis-tables": f"{__package__}.tables_report:ThesisTablesResult",
        "predicted-tables": f"{__package__}.predicted_tables:PredictedTablesResult",
        "statements": f"{__package__}.thesis_statements:StatementsResult",
    },
    requires=("lab", "analysis"),
)
