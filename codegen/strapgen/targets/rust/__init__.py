"""The targets that print Rust without its standard library, one module a function."""

from __future__ import annotations

from strapgen.targets.registry import Target

TARGETS = {
    "rust": Target("Rust in double: one module", f"{__name__}.emit:emit", language="Rust", number="double"),
    "rust-float": Target(
        "Rust in float: one module", f"{__name__}.emit:emit", language="Rust", number="float"
    ),
    "rust-fixed": Target(
        "Rust in fixed point: one module, no unsafe code, with the bits of the C",
        f"{__name__}.fixed:emit",
        fixed=True,
        words=(16, 32, 64),
        language="Rust",
    ),
}
