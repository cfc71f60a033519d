"""Checks the arguments of the stages: an argument of another stage is refused with the call that is missing."""

from __future__ import annotations

import reprlib
from typing import Any

from strapgen.ir.exceptions import InputTypeError

#: The call that takes an argument of a class to the next stage, and the class that it returns.
_NEXT = {
    "str": ("derive({})", "Kernel"),
    "Choice": ("derive({})", "Kernel"),
    "Kernel": ("lower({})", "Program"),
    "Program": ("generate({}, target)", "Sources"),
    "FixedProgram": ("generate({}, target)", "Sources"),
    "Sources": ("build({})", "Backend"),
}
#: The call that makes an argument from a name at once.
_NAMED = {"Backend": "backend({})", "Motion": "motion({}, ...)"}
#: The function that makes an argument, where no call leads to it.
_MAKERS = {
    "str": "strapgen list shows the names",
    "Choice": "strapgen.choose makes one",
    "Kernel": "strapgen.derive makes one",
    "Program": "strapgen.lower makes one",
    "FixedProgram": "strapgen.quantize makes one",
    "Sources": "strapgen.generate makes them",
    "Backend": "strapgen.backend makes one",
    "Motion": "strapgen.motion makes one",
    "Settings": "strapgen.Settings makes them",
}
#: The function that takes an argument which was passed to another one.
_TAKERS = {
    "Choice": "strapgen.derive takes it",
    "Kernel": "strapgen.lower takes it",
    "Program": "strapgen.generate takes it",
    "FixedProgram": "strapgen.generate takes it",
    "Sources": "strapgen.build takes them",
    "Backend": "strapgen.simulate takes it",
    "Motion": "strapgen.simulate takes it",
    "Settings": "strapgen.quantize takes them",
}


def require(function: str, value: Any, *classes: type) -> None:
    """Refuse an argument of a class that a stage does not take, with the call that makes the right one.

    >>> require("derive", 3, str)
    Traceback (most recent call last):
        ...
    strapgen.InputTypeError: derive takes a name, not 3; strapgen list shows the names
    """
    if isinstance(value, classes):
        return
    names = [cls.__name__ for cls in classes]
    needed = " or ".join(map(_with_article, names))
    raise InputTypeError(
        f"{function} takes {needed}, not {describe(value)}; {_remedy(function, value, names[0])}"
    )


def describe(value: Any) -> str:
    """Return a value in a few words: a short one itself, another one by its class."""
    if value is None or isinstance(value, str | int | float):
        return reprlib.repr(value)
    return _with_article(_stage_class(value))


def _stage_class(value: Any) -> str:
    """Return the name of the class of a value; of a class that stages exchange for those derived from it."""
    names = [cls.__name__ for cls in type(value).__mro__]
    return next((name for name in names if name in _MAKERS), names[0])


def _remedy(function: str, value: Any, needed: str) -> str:
    """Return the call that makes a needed class from a value; if there is none, the function that takes the value."""
    reached = _stage_class(value)
    call = describe(value) if reached == "str" else reached.lower()
    if reached == "str" and needed in _NAMED:
        return f"strapgen.{_NAMED[needed].format(call)} makes one"
    while reached in _NEXT:
        template, reached = _NEXT[reached]
        call = f"strapgen.{template.format(call)}"
        if reached == needed:
            return f"{call} makes {'them' if needed == 'Sources' else 'one'}"
    taker = _TAKERS.get(_stage_class(value), "")
    # An argument of the same function, in another place: what makes the right one helps, not what takes this one.
    return _MAKERS[needed] if not taker or taker.startswith(f"strapgen.{function} ") else taker


def _with_article(name: str) -> str:
    if name in ("Sources", "Settings"):
        return name
    article = "an" if name[0] in "AEIOUaeiou" or name == "ndarray" else "a"
    return {"str": "a name", "PathLike": "a path"}.get(name, f"{article} {name}")
