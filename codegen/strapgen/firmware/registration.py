"""Registration of this folder."""

from __future__ import annotations

from strapgen.registration import Command, Registration

REGISTRATION = Registration(
    "test vectors, projects, verification of files, checks of code by others",
    commands={
        "vectors": Command(
            f"{__package__}.vectors_command:vectors",
            "Generate",
            summary="Write test vectors of generated C, for a test on the processor",
        ),
        "verify": Command(
            f"{__package__}.verify_command:verify",
            "Generate",
            summary="Verify a generated C file against its header",
        ),
        "check": Command(
            f"{__package__}.check_code.check_command:check",
            "Analyse",
            summary="Run the conformance tests; exit 1 on failure",
        ),
    },
    results={
        "vectors": f"{__package__}.vectors:VectorsResult",
        "findings": f"{__package__}.check_code.conformance:FindingsResult",
        "foreign-check": f"{__package__}.check_code.check_foreign:ForeignResult",
        "verification": f"{__package__}.verification:Verification",
        "whole-verification": f"{__package__}.verification:WholeVerification",
    },
    extensions={
        "generate.project": f"{__package__}:project",
        "project.kinds": f"{__package__}.project_kinds:KINDS",
        "lab.source-files": f"{__package__}:header_command",
        "navigation.source-files": f"{__package__}.header_command:runner_of_file",
        "two-speed.project": f"{__package__}:two_speed_project",
        "kalman.project": f"{__package__}:kalman_project",
        "whole.project": f"{__package__}:whole_project",
    },
    requires=("lab", "navigation", "design", "stamped"),
)
