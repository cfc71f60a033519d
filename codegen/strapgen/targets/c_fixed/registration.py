"""What the folder brings."""

from __future__ import annotations

from strapgen.registration import Registration

REGISTRATION = Registration("C in fixed point", targets=(f"{__package__}:TARGETS",))
