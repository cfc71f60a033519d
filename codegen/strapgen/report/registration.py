"""Registration of this folder."""

from __future__ import annotations

from strapgen.registration import Command, Registration

REGISTRATION = Registration(
    "a report on an algorithm as one file",
    commands={
        "report": Command(
            f"{__package__}.report_command:report",
            "Analyse",
            summary="Write one HTML file: formulas, code, bounds, runs and evidence",
        ),
    },
    extensions={"check.report": f"{__package__}.check_page:check_page"},
    requires=("lab", "design", "evidence", "firmware", "thesis"),
)
