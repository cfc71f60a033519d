"""The target that prints functions for MATLAB and GNU Octave, one file each, in double."""

from __future__ import annotations

from strapgen.targets.registry import Target

TARGETS = {
    "matlab": Target(
        "MATLAB and GNU Octave in double: one function file",
        f"{__name__}.emit:emit",
        language="MATLAB",
        number="double",
    )
}
