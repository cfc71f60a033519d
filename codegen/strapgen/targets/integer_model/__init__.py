"""The target that prints the integer model of the fixed-point C in Python."""

from __future__ import annotations

from strapgen.targets.registry import Target

TARGETS = {
    "fixed-model": Target(  # a reference that tests generate: it is not in the tree
        "Python on integers, bit for bit what the fixed-point C computes",
        f"{__name__}.emit:emit",
        fixed=True,
        language="Python",
    )
}
