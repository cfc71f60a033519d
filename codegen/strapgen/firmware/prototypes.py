"""Reads the functions that a generated header declares."""

from __future__ import annotations

import re
from dataclasses import dataclass

_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_FOR_CXX = re.compile(r"^#ifdef __cplusplus\n.*?^#endif\n", re.DOTALL | re.MULTILINE)
_DIRECTIVE = re.compile(r"^#(?:.*\\\n)*.*\n", re.MULTILINE)
_FUNCTION = re.compile(r"^(void|int) (\w+)\(([^)]*)\);", re.MULTILINE)
_PARAMETER = re.compile(r"(const )?(\w+) (\*?)(\w+)(\[\d+\])?")


@dataclass(frozen=True)
class Parameter:
    """A parameter of a function in C."""

    name: str
    #: The type of a number, or of the struct that a pointer leads to
    type: str
    #: Numbers of an array; 0 for one number or a struct
    size: int
    is_output: bool


@dataclass(frozen=True)
class Prototype:
    """A function that a header declares."""

    name: str
    parameters: tuple[Parameter, ...]
    #: Whether it returns a code, which is an error unless it is 0, or a number, which is one below 0
    returns_code: bool
    returns_number: bool


def declarations(header: str) -> str:
    r"""Return the types and functions of a header without comments and directives.

    >>> declarations("/* Steps. */\n#include <stdint.h>\n\nint f(int32_t x[3]);\n")
    'int f(int32_t x[3]);\n'
    """
    plain = _DIRECTIVE.sub("", _FOR_CXX.sub("", _COMMENT.sub("", header)))
    return re.sub(r"\n{2,}", "\n", plain).lstrip("\n")


def prototypes(header: str) -> list[Prototype]:
    r"""Return the functions of a header; the length of an array that a pointer leads to stands in its comment.

    >>> prototypes("/* in  x[3]: a vector. */\nvoid f(const float *x, float y[2]);\n")[0].parameters[0]
    Parameter(name='x', type='float', size=3, is_output=False)
    """
    found = []
    for returned, name, text in _FUNCTION.findall(declarations(header)):
        comment = header[: header.index(f" {name}(")].rpartition("/*")[2]
        is_number = "Returns how many" in comment
        parameters = tuple(_parameters(header, text))
        found.append(Prototype(name, parameters, returned == "int" and not is_number, is_number))
    return found


def _parameters(header: str, text: str) -> list[Parameter]:
    found = []
    for constant, kind, pointer, name, brackets in _PARAMETER.findall(text):
        if kind == "void":
            continue
        size = int(brackets[1:-1]) if brackets else 0
        if pointer and not kind.endswith("_memory"):
            told = re.search(rf"\b{name}\[(\d+)\]", header)
            assert told, f"the header tells the length of {name}"
            size = int(told[1])
        found.append(Parameter(name, kind, size, bool((pointer or brackets) and not constant)))
    return found
