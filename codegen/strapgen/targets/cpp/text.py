"""The shared parts of C++ in floating point and in fixed point: names, types, constants, and the C interface."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from strapgen.targets.definitions import Macro
from strapgen.targets.lines import fill_arguments
from strapgen.targets.names import C, Language

#: What tells that a file is not what strapgen generates.
CHECK = "the same command with --check shows the differences"


def _scopes(texts: Iterable[str]) -> list[set[str]]:
    """Return the identifiers of each declaration and function; namespaces are no scopes."""
    return C.scopes(re.sub(r"^namespace \w* ?\{$|\"C\"", " ", text, flags=re.MULTILINE) for text in texts)


#: The rules of C++ for names, whose keywords those of C include.
CPP = Language(C.allows, _scopes, most=C.most)


def constants(definitions: Sequence[Macro], real: str = "double") -> list[str]:
    """Return the definitions of a header as constants of C++, under names in lower case."""
    return [_constant(definition, real) for definition in definitions]


def _constant(definition: Macro, real: str) -> str:
    kind = standard(definition.type or real)
    if definition.size:
        kind = f"std::array<{kind}, {definition.size}>"
        value = f"{{{definition.value}}}"
    else:
        value = f" = {definition.value}"
    line = f"inline constexpr {kind} {definition.name.lower()}{value};"
    comment = f"/* {definition.meaning} */"
    if len(line) > 99 and not definition.size:
        line = line.replace(" = ", " =\n    ")
    return (
        f"{line} {comment}" if len(line) + len(comment) < 99 else f"{comment}\n{fill_arguments(line, '    ')}"
    )


def standard(kind: str) -> str:
    """Return a type of C as C++ calls it."""
    return f"std::{kind}" if kind.endswith("_t") else kind


def result_of(name: str, outputs: Sequence[tuple[str, str]]) -> str:
    """Return the return type of a function: that of its output, or a structure of several (type, name)."""
    return outputs[0][0] if len(outputs) == 1 else f"{name}_result"


def runs_of(name: str, language: str = "cpp", ending: str = "cpp") -> tuple[str, str]:
    """Return the names of the files with the C interface of a function in a language."""
    return f"{name}_{language}_runs.h", f"{name}_{language}_runs.{ending}"
