"""The target that prints C99 in double and in float."""

from __future__ import annotations

from strapgen.targets.registry import Target

TARGETS = {
    "c": Target("C99 in double", f"{__name__}.emit:emit", language="C", number="double", folder="c"),
    "c-float": Target(
        "C99 in float", f"{__name__}.emit:emit", language="C", number="float", folder="c_float"
    ),
}
