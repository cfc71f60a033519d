"""The rules of Rust for names, types and constants."""

from __future__ import annotations

import re
from collections.abc import Sequence

from strapgen.targets.definitions import Macro
from strapgen.targets.lines import fill_arguments
from strapgen.targets.names import C, Language

#: Keywords of every edition, those that are set aside, and names that patterns take for a variant of the core library.
_TEXT = """
Self abstract as async await become box break const continue crate do dyn else enum extern f32 f64 false final fn for
gen i16 i32 i64 i128 if impl in let loop macro match mod move mut override priv pub ref return self static struct super
trait true try type typeof u16 u32 u64 u128 union unsafe unsized use usize virtual where while yield
Err None Ok Some
"""
_WORDS = frozenset(_TEXT.split())
#: Types of Rust by those of C.
TYPES = {"double": "f64", "float": "f32", "int": "i32"} | {
    f"{sign}int{bits}_t": f"{letter}{bits}"
    for sign, letter in (("", "i"), ("u", "u"))
    for bits in (16, 32, 64)
}


def _allows(name: str) -> bool:
    return name not in _WORDS and not re.fullmatch(r"_+", name)


#: The rules of Rust for names. Its functions and blocks are scopes as those of C are.
RUST = Language(_allows, C.scopes, most=C.most)


def module_name(name: str) -> str:
    """Return the name of a function and of its module: that of C, changed if Rust has it for itself.

    >>> module_name("euler_rk4_2"), module_name("loop")
    ('euler_rk4_2', 'loop_Kernel')
    """
    return name if _allows(name) else f"{name}_Kernel"


def structure_name(name: str) -> str:
    """Return the name of the structure with the outputs of a function.

    >>> structure_name("imu_compensate")
    'ImuCompensateOutputs'
    """
    return "".join(word[:1].upper() + word[1:] for word in name.split("_")) + "Outputs"


def array(kind: str, size: int) -> str:
    """Return the type of an array."""
    return f"[{kind}; {size}]"


def constants(definitions: Sequence[Macro], real: str) -> list[str]:
    """Return the definitions of a header as constants of Rust, whose real numbers have a type of C."""
    return [_constant(definition, real) for definition in definitions]


def _constant(definition: Macro, real: str) -> str:
    kind, value = TYPES[definition.type or real], definition.value
    if definition.size:
        kind, value = array(kind, definition.size), f"[{value[1:-1]}]"
    line, comment = f"pub const {definition.name}: {kind} = {value};", f"/* {definition.meaning} */"
    if len(line) + len(comment) < 99:
        return f"{line} {comment}"
    return f"{comment}\n{fill_arguments(line, '    ')}"
