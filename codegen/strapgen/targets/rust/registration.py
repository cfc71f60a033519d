"""What the folder brings."""

from __future__ import annotations

from strapgen.registration import Registration

REGISTRATION = Registration("Rust", targets=(f"{__package__}:TARGETS",))
