"""What the folder brings."""

from __future__ import annotations

from strapgen.registration import Registration

REGISTRATION = Registration(
    "the integer model of the fixed-point C",
    targets=(f"{__package__}:TARGETS",),
    requires=("targets.c_fixed",),
)
