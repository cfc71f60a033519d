"""The rules of MATLAB and Octave for names."""

from __future__ import annotations

import re
from collections.abc import Iterable

from strapgen.ir.exceptions import InputError
from strapgen.ir.program import Program
from strapgen.targets.names import Language, function_name

#: Keywords of MATLAB and of Octave, and what either takes for a number or a value.
_WORDS_TEXT = """
arguments break case catch classdef continue do else elseif end end_try_catch end_unwind_protect
endclassdef endenumeration endevents endfor endfunction endif endmethods endparfor endproperties endswitch
endwhile enumeration events for function global if methods otherwise parfor persistent properties return
spmd switch try until unwind_protect unwind_protect_cleanup while
"""
_WORDS = frozenset(_WORDS_TEXT.split())


def _allows(name: str) -> bool:
    """Tell whether an identifier can name a quantity: it begins with a letter, and has at most 63 characters."""
    return name not in _WORDS and not name.startswith("_") and len(name) <= 63


def _scopes(texts: Iterable[str]) -> list[set[str]]:
    """Return the identifiers of each function, its signature included."""
    scopes = []
    for text in texts:
        plain = re.sub(r"%.*$|'[^'\n]*'", " ", text, flags=re.MULTILINE)
        scopes += [
            set(re.findall(r"(?<![\w.])[^\W\d]\w*", part)) - {"function"}
            for part in re.split(r"^(?=function\b)", plain, flags=re.MULTILINE)
        ]
    return [scope for scope in scopes if scope]


#: The rules for the names of quantities.
MATLAB = Language(_allows, _scopes)


def file_name(program: Program) -> str:
    """Return the name of a program's function, which is that of its file: the name in C wherever it is free.

    MATLAB and Octave have thousands of functions, and a file of the same name would hide one of them. Their names are
    mostly a single word, so a kernel whose name is one gets another word behind it.
    """
    name = function_name(program)
    if not program.function:
        return name if "_" in name else f"{name}_Kernel"
    if not _allows(name):
        raise InputError(
            f"{name} is a word of MATLAB and Octave itself; another name of the function is needed"
        )
    return name
