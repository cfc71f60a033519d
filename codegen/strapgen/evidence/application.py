"""What the application brings."""

from __future__ import annotations

from strapgen.applications import Application, Command

_HERE = __name__.rpartition(".")[0]

APPLICATION = Application(
    "verification of generated C with independent tools",
    commands={
        "evidence": Command(f"{_HERE}.evidence_command:evidence", "Generate"),
    },
    requires=("lab", "navigation", "firmware"),
)
