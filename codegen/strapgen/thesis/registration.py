"""What the folder brings."""

from __future__ import annotations

from strapgen.registration import Command, Registration

REGISTRATION = Registration(
    "tables and statements of the thesis",
    commands={
        "tables": Command(f"{__package__}.tables_command:tables", "Reproduce"),
        "statements": Command(f"{__package__}.statements_command:statements", "Reproduce"),
    },
    requires=("lab", "analysis"),
)
