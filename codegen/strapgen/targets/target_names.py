"""The targets by name, as plain data: listing them imports none of their printers."""

from __future__ import annotations

from strapgen.targets.registry import Target

#: Targets by name.
TARGETS = {
    "c": Target("C99 in double", f"{__package__}.c:emit", language="C", number="double", folder="c"),
    "c-float": Target(
        "C99 in float", f"{__package__}.c:emit", language="C", number="float", folder="c_float"
    ),
    "c-fixed": Target(
        "C99 in fixed point: integers alone, error bounds certified",
        f"{__package__}.c_fixed:emit",
        fixed=True,
        words=(16, 32, 64),
        language="C",
        folder="c_fixed",
    ),
    "cpp": Target("C++14 in double: one header", f"{__package__}.cpp:emit", language="C++", number="double"),
    "cpp-float": Target(
        "C++14 in float: one header", f"{__package__}.cpp:emit", language="C++", number="float"
    ),
    "cpp-fixed": Target(
        "C++14 in fixed point: one header, constexpr, with the bits of the C",
        f"{__package__}.cpp:emit_fixed",
        fixed=True,
        words=(16, 32, 64),
        language="C++",
    ),
    "matlab": Target(
        "MATLAB and GNU Octave in double: one function file",
        f"{__package__}.matlab:emit",
        language="MATLAB",
        number="double",
    ),
    "numpy": Target(
        "numpy, vectorised over leading axes",
        f"{__package__}.numpy_code:emit",
        language="Python",
        number="double",
        folder="numpy",
    ),
    "rust": Target(
        "Rust in double: one module", f"{__package__}.rust:emit", language="Rust", number="double"
    ),
    "rust-float": Target(
        "Rust in float: one module", f"{__package__}.rust:emit", language="Rust", number="float"
    ),
    "rust-fixed": Target(
        "Rust in fixed point: one module, no unsafe code, with the bits of the C",
        f"{__package__}.rust:emit_fixed",
        fixed=True,
        words=(16, 32, 64),
        language="Rust",
    ),
    "fixed-model": Target(  # a reference that tests generate: it is not in the tree
        "Python on integers, bit for bit what the fixed-point C computes",
        f"{__package__}.integer_model:emit",
        fixed=True,
        language="Python",
    ),
}
