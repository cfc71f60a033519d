"""What the folder brings."""

from __future__ import annotations

from strapgen.registration import Registration

REGISTRATION = Registration("C++", targets=(f"{__package__}:TARGETS",))
