"""Registration of this folder."""

from __future__ import annotations

from strapgen.registration import Command, Registration

REGISTRATION = Registration(
    "verification of generated C with independent tools",
    commands={
        "evidence": Command(
            f"{__package__}.evidence_command:evidence",
            "Generate",
            summary="Verify the generated C with external tools",
        ),
    },
    results={"evidence": f"{__package__}.evidence_report:EvidenceResult"},
    requires=("lab", "navigation", "firmware"),
)
