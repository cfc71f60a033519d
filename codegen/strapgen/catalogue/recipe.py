"""A recipe says which function derives a kernel that takes no method."""

from __future__ import annotations

from typing import Any, NamedTuple


class Recipe(NamedTuple):
    """A kernel that takes no method: the module, the function and its arguments that derive it."""

    title: str
    module: str
    function: str
    arguments: tuple[Any, ...] = ()
    standard: bool = True
