"""Registration of this folder."""

from __future__ import annotations

from strapgen.registration import Command, Registration

REGISTRATION = Registration(
    "samples with stamps of their own, taken to an even grid",
    commands={
        "stamped": Command(
            f"{__package__}.stamped_command:stamped_grid",
            "Generate",
            summary="Generate C that takes stamped samples to an even grid",
        ),
    },
    kernels=(f"{__package__}.kernel_names:KERNELS",),
    results={"stamped": f"{__package__}.stamped_sources:StampedResult"},
)
