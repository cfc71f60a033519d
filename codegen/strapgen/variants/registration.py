"""Registration of this folder."""

from __future__ import annotations

from strapgen.registration import Command, Registration

REGISTRATION = Registration(
    "named variants of generated code, and the gate that holds them",
    commands={
        "init": Command(
            f"{__package__}.init_command:init",
            "Generate",
            summary="Write a strapgen.toml from five answers or a brief",
        ),
        "build": Command(
            f"{__package__}.build_command:build",
            "Generate",
            summary="Generate the variants of strapgen.toml, or check them",
        ),
    },
    files={"variants": f"{__package__}.variant_file:VARIANTS"},
    results={"build": f"{__package__}.build:BuildResult"},
    extensions={
        "cli.variant": f"{__package__}.variant_file:words_of",
        "cli.variants": f"{__package__}.variant_file:titles",
    },
    requires=("design",),
)
