"""The targets that print C++17, one header a function, in floating point and in fixed point."""

from __future__ import annotations

from strapgen.targets.registry import Target

TARGETS = {
    "cpp": Target("C++17 in double: one header", f"{__name__}.emit:emit", language="C++", number="double"),
    "cpp-float": Target(
        "C++17 in float: one header", f"{__name__}.emit:emit", language="C++", number="float"
    ),
    "cpp-fixed": Target(
        "C++17 in fixed point: one header, constexpr, with the bits of the C",
        f"{__name__}.fixed:emit",
        fixed=True,
        words=(16, 32, 64),
        language="C++",
    ),
}
