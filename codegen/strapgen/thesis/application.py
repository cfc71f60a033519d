"""What the application brings."""

from __future__ import annotations

from strapgen.applications import Application, Command

_HERE = __name__.rpartition(".")[0]

APPLICATION = Application(
    "tables and statements of the thesis",
    commands={
        "tables": Command(f"{_HERE}.tables_command:tables", "Reproduce"),
        "statements": Command(f"{_HERE}.statements_command:statements", "Reproduce"),
    },
    requires=("lab", "analysis"),
)
