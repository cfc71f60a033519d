"""A target with a syntax far from C's: Julia, whose arrays begin at 1, blocks end with a word, and names have rules."""

from __future__ import annotations

import re
from collections.abc import Iterable

from strapgen import Language, Program, Sources, Target
from strapgen.targets.names import printed
from toy_target import FUNCTIONS, PlainPrinter, text

_TEXT = """
abstract baremodule begin break catch const continue do else elseif end export false finally for function global
if import in isa let local macro module mutable outer primitive quote return struct true try type using where while
"""
#: Words that name nothing in Julia.
_RESERVED = frozenset(_TEXT.split())


class JuliaPrinter(PlainPrinter):
    """Prints expressions of Julia."""

    functions = FUNCTIONS | {
        "sqrt": "sqrt({})",
        "sin": "sin({})",
        "cos": "cos({})",
        "atan2": "atan({}, {})",
        "direction": "atan({}, {})",
        "select": "ifelse({}, {}, {})",
    }


def scopes(texts: Iterable[str]) -> list[set[str]]:
    """Return the identifiers of some files, all of them in one scope; those of remarks and strings are none."""
    plain = (re.sub(r'""".*?"""|#.*?$', " ", one, flags=re.DOTALL | re.MULTILINE) for one in texts)
    return [{name for one in plain for name in re.findall(r"(?<![\w.])[^\W\d]\w*", one)}]


#: The rules of Julia for names, by which a name of a kernel that collides is changed.
JULIA = Language(lambda name: name not in _RESERVED, scopes)


def emit(program: Program, target: str) -> Sources:
    """Print a program as one function of Julia."""
    scalars = [signal.name for signal in program.inputs if not signal.shape]

    def files(part: Program, _: object) -> dict[str, str]:
        return {f"{part.name}.jl": text(part, target, JuliaPrinter(), "function.jl.j2", first=1)}

    named, made = printed(program, files, JULIA, scalars)
    return Sources.of(program, target, named.name, made)


TARGET = Target("Julia on vectors", emit, language="Julia", number="double")
