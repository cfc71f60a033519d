"""The target that prints fixed-point C99, on integers alone."""

from __future__ import annotations

from strapgen.targets.registry import Target

TARGETS = {
    "c-fixed": Target(
        "C99 in fixed point: integers alone, error bounds certified",
        f"{__name__}.emit:emit",
        fixed=True,
        words=(16, 32, 64),
        language="C",
        folder="c_fixed",
    )
}
