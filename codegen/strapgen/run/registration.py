"""Registration of this folder."""

from __future__ import annotations

from strapgen.registration import Registration

REGISTRATION = Registration("running generated code", backends=(f"{__package__}.backend_names:BUILT_IN",))
