"""Registration of this folder."""

from __future__ import annotations

from strapgen.registration import Registration

REGISTRATION = Registration("printing programs", targets=(f"{__package__}.target_names:TARGETS",))
