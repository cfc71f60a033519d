"""Values that cannot be written: what a function returned stays what it was, also where the cache shares it."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

K = TypeVar("K")
V = TypeVar("V")


class ReadOnlyDict(dict[K, V]):
    """A dict that cannot be written; it is equal to a dict with the same items, pickles, and becomes JSON.

    >>> counts = ReadOnlyDict({"add": 30})
    >>> counts["add"], counts | {"multiply": 38}
    (30, {'add': 30, 'multiply': 38})
    >>> counts["add"] = 0
    Traceback (most recent call last):
        ...
    TypeError: a result cannot be written; dict(result) is a copy that can
    """

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError("a result cannot be written; dict(result) is a copy that can")

    if not TYPE_CHECKING:  # to a type checker, fields that hold one are a Mapping
        __setitem__ = __delitem__ = __ior__ = _refuse
        update = setdefault = pop = popitem = clear = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self),)


def read_only(value: Any) -> Any:
    """Return lists as tuples, dicts as `ReadOnlyDict` and arrays as views that cannot be written, parts included.

    >>> read_only({"rows": [1, [2]]})
    {'rows': (1, (2,))}
    """
    if type(value) is dict:
        return ReadOnlyDict({key: read_only(part) for key, part in value.items()})
    if type(value) in (list, tuple):
        return tuple(map(read_only, value))
    if hasattr(value, "setflags") and value.flags.writeable:
        value = value.view()
        value.setflags(write=False)
    return value


class ReadOnly:
    """A dataclass whose fields cannot be written, nor what they hold; arrays that it was made of stay as they are."""

    __slots__ = ()

    def __post_init__(self) -> None:
        hold(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)  # an array comes out of a pickle as one that can be written
        hold(self)


def hold(value: Any) -> None:
    """Put what cannot be written into the public fields of a dataclass."""
    for field in fields(value):
        if not field.name.startswith("_"):
            content = getattr(value, field.name)
            held = read_only(content)
            if held is not content:
                object.__setattr__(value, field.name, held)
