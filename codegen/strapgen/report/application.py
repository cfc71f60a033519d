"""What the application brings."""

from __future__ import annotations

from strapgen.applications import Application, Command

_HERE = __name__.rpartition(".")[0]

APPLICATION = Application(
    "a report on an algorithm as one file",
    commands={
        "report": Command(f"{_HERE}.report_command:report", "Analyse"),
    },
    requires=("lab", "design", "evidence", "thesis"),
)
