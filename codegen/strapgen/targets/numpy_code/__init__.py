"""The target that prints numpy code, vectorised over leading axes."""

from __future__ import annotations

from strapgen.targets.registry import Target

TARGETS = {
    "numpy": Target(
        "numpy, vectorised over leading axes",
        f"{__name__}.emit:emit",
        language="Python",
        number="double",
        folder="numpy",
    )
}
