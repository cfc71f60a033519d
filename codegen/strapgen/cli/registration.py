"""Registration of this folder."""

from __future__ import annotations

from strapgen.registration import Command, Registration

REGISTRATION = Registration(
    "the commands of the compiler",
    commands={
        "list": Command(
            f"{__package__}.derive_commands:list_names",
            "Derive",
            summary="List all names that the other commands take",
        ),
        "derive": Command(
            f"{__package__}.derive_commands:derive",
            "Derive",
            summary="Show the formulas, the program or the operations of a kernel",
        ),
        "generate": Command(
            f"{__package__}.generate_command:generate",
            "Generate",
            summary="Generate source code for an algorithm, or for the catalogue",
        ),
        "schema": Command(
            f"{__package__}.derive_commands:schema",
            "Derive",
            summary="Print the JSON Schema of a result or of users' files",
        ),
    },
    results={
        "names": f"{__package__}.derive_commands:NamesResult",
        "kernel": "strapgen.results.display.formulas:KernelResult",
        "generated": f"{__package__}.generated_result:GenerateResult",
        "in-step": f"{__package__}.generated_result:StepCheck",
        "catalogue": f"{__package__}.generated_result:CatalogueResult",
    },
)
