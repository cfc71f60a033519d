"""What the stages of the generator take: an argument that belongs to another stage is refused in one line."""

from __future__ import annotations

import reprlib
from typing import Any

from strapgen.support.exceptions import InputTypeError

#: The call that makes the next stage's argument, by the class of this one's, and the class of what it makes.
_NEXT = {
    "str": ("derive({})", "Kernel"),
    "Kernel": ("lower({})", "Program"),
    "Program": ("generate({}, target)", "Sources"),
    "FixedProgram": ("generate({}, target)", "Sources"),
    "Sources": ("build({})", "Backend"),
}
#: What makes an argument from a name at once.
_NAMED = {"Backend": "backend({})", "Motion": "motion({}, ...)"}
#: What makes an argument otherwise.
_MAKERS = {
    "str": "strapgen list shows the names",
    "Kernel": "strapgen.derive makes one",
    "Program": "strapgen.lower makes one",
    "FixedProgram": "strapgen.quantize makes one",
    "Sources": "strapgen.generate makes them",
    "Backend": "strapgen.backend makes one",
    "Motion": "strapgen.motion makes one",
    "Settings": "strapgen.Settings makes them",
}
#: What takes an argument that has come to another stage.
_TAKERS = {
    "Kernel": "strapgen.lower takes it",
    "Program": "strapgen.generate takes it",
    "FixedProgram": "strapgen.generate takes it",
    "Sources": "strapgen.build takes them",
    "Backend": "strapgen.simulate takes it",
    "Motion": "strapgen.simulate takes it",
    "Settings": "strapgen.quantize takes them",
}


def require(function: str, value: Any, *classes: type) -> None:
    """Check that an argument is what a stage takes.

    Parameters
    ----------
    function : str
        The stage, as a user calls it.
    value : object
        What it is called with.
    *classes : type
        What it takes.

    Raises
    ------
    InputTypeError
        If the argument is of another class; the message names the call that makes the right one.

    Examples
    --------
    >>> require("derive", "euler", str)
    >>> require("derive", 3, str)
    Traceback (most recent call last):
        ...
    strapgen.InputTypeError: derive takes a name, not 3; strapgen list shows the names
    """
    if isinstance(value, classes):
        return
    names = [cls.__name__ for cls in classes]
    needed = " or ".join(map(_with_article, names))
    raise InputTypeError(f"{function} takes {needed}, not {describe(value)}; {_remedy(value, names[0])}")


def describe(value: Any) -> str:
    """Return a value in a few words: a short one itself, another one by its class.

    Examples
    --------
    >>> describe("euler"), describe(None), describe({})
    ("'euler'", 'None', 'a dict')
    """
    if value is None or isinstance(value, str | int | float):
        return reprlib.repr(value)
    return _with_article(_stage_class(value))


def _stage_class(value: Any) -> str:
    """Return the name of a class that stages exchange, for a back end that of all of them; else of the value's own."""
    names = [cls.__name__ for cls in type(value).__mro__]
    return next((name for name in names if name in _MAKERS), names[0])


def _remedy(value: Any, needed: str) -> str:
    """Return which call makes what is needed of what is there; or what takes what is there."""
    reached = _stage_class(value)
    call = describe(value) if reached == "str" else reached.lower()
    if reached == "str" and needed in _NAMED:
        return f"strapgen.{_NAMED[needed].format(call)} makes one"
    while reached in _NEXT:
        template, reached = _NEXT[reached]
        call = f"strapgen.{template.format(call)}"
        if reached == needed:
            return f"{call} makes {'them' if needed == 'Sources' else 'one'}"
    return _TAKERS.get(_stage_class(value), _MAKERS[needed])


def _with_article(name: str) -> str:
    if name in ("Sources", "Settings"):
        return name
    article = "an" if name[0] in "AEIOUaeiou" or name == "ndarray" else "a"
    return {"str": "a name", "PathLike": "a path"}.get(name, f"{article} {name}")
