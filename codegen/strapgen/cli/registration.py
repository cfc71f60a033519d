"""What the folder brings."""

from __future__ import annotations

from strapgen.registration import Command, Registration

REGISTRATION = Registration(
    "the commands of the compiler",
    commands={
        "list": Command(f"{__package__}.list_command:list_names", "Derive"),
        "derive": Command(f"{__package__}.derive_command:derive", "Derive"),
        "generate": Command(f"{__package__}.generate_command:generate", "Generate"),
    },
)
