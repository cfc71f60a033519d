"""Names that a file of a system must leave to the generated code, in C or in Python."""

from __future__ import annotations

import re
from collections.abc import Iterable

from strapgen.ir.exceptions import InputError
from strapgen.targets.names import PYTHON, C

_HEADERS_TEXT = """
assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal stdalign stdarg stdatomic
stdbool stdckdint stddef stdint stdio stdlib stdnoreturn string tgmath threads time uchar wchar wctype numpy
"""
#: Headers and modules that generated files include or import, or that a file of the same name would hide.
_HEADERS = frozenset(_HEADERS_TEXT.split())
#: What the functions of a system are called behind its name, and members of its memory.
_FUNCTIONS = re.compile(r"begin|cycle|memory|residuals|runs?|every_\d+")
#: Parameters, functions and modules that generated functions use.
_USED = re.compile(r"cycles|done|status|np|memcpy|memmove|memset|(u?int\w*|size|ptrdiff)_t")


def check_names(system: str, inputs: Iterable[str], stages: Iterable[str]) -> None:
    """Check that code can have the names of a system, its inputs and its stages.

    >>> check_names("imu", ["gyro"], ["fast", "slow"])
    >>> check_names("imu", ["int"], ["fast"])
    Traceback (most recent call last):
    strapgen.InputError: input 'int' has a meaning in generated code; another name is needed
    """
    stages = list(stages)
    if system in _HEADERS or not _is_free(system):
        raise _refused("the name", system)
    for name in stages:
        if _FUNCTIONS.fullmatch(name) or _USED.fullmatch(name) or not _is_free(name):
            raise _refused("stage", name)
    for name in inputs:
        rest = name.removeprefix(f"{system}_")
        shadowed = rest != name and (_FUNCTIONS.fullmatch(rest) or rest in stages)
        if shadowed or _FUNCTIONS.fullmatch(name) or _USED.fullmatch(name) or not _is_free(name):
            raise _refused("input", name)


def _is_free(name: str) -> bool:
    return C.allows(name) and PYTHON.allows(name)


def _refused(what: str, name: str) -> InputError:
    return InputError(f"{what} {name!r} has a meaning in generated code; another name is needed")
