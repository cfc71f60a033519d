"""Old names of parameters, fields and attributes, which keep working for one version with a warning."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

T = TypeVar("T", bound=type)
P = ParamSpec("P")
R = TypeVar("R")


def warn(old: str, new: str, level: int = 3) -> None:
    """Warn at the caller's line that a name has changed."""
    warnings.warn(f"{old} is now {new}", DeprecationWarning, stacklevel=level)


def renamed_parameters(**names: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorate a function so that keywords keep old names beside the present ones.

    >>> @renamed_parameters(choice="algorithm")
    ... def derive(algorithm):
    ...     return algorithm
    >>> import warnings
    >>> with warnings.catch_warnings(record=True) as said:
    ...     derive(choice="euler"), str(said[0].message)
    ('euler', 'choice is now algorithm')
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        @functools.wraps(function)
        def call(*values: P.args, **rest: P.kwargs) -> R:
            if rest and names.keys() & rest:
                return function(*values, **current(dict(rest), names))
            return function(*values, **rest)

        return call

    return decorate


def current(fields: dict[str, Any], renamed: dict[str, str]) -> dict[str, Any]:
    """Return keywords with the present names; an old one counts, where `dataclasses.replace` adds the other."""
    old_names = renamed.keys() & fields
    for old in old_names:
        warn(old, renamed[old], level=4)
    present = {name: value for name, value in fields.items() if name not in old_names}
    return present | {renamed[old]: fields[old] for old in old_names}


def renamed(**names: str) -> Callable[[T], T]:
    """Decorate a class so that fields and attributes keep old names beside the present ones."""

    def decorate(kind: T) -> T:
        fields = {old: new for old, new in names.items() if new in getattr(kind, "__dataclass_fields__", ())}
        if fields:
            changed: Any = kind  # a type checker takes the constructors of a class as fixed
            make = changed.__init__

            @functools.wraps(make)
            def init(self: Any, *values: Any, **rest: Any) -> None:
                make(self, *values, **current(rest, fields))

            changed.__init__ = init
        for old, new in names.items():
            if old in vars(kind):  # a method has the old name
                continue

            def read(self: Any, old: str = old, new: str = new) -> Any:
                warn(f"{kind.__name__}.{old}", new)
                return getattr(self, new)

            setattr(kind, old, property(read))
        return kind

    return decorate
