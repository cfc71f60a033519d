"""A recipe says which function derives a kernel that takes no method."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol


class Description(Protocol):
    """What a file describes for a kernel: a frozen dataclass with a name, a title and the path of the file."""

    @property
    def name(self) -> str:
        """Name in that of the kernel."""

    @property
    def title(self) -> str:
        """Name in the file."""

    @property
    def file(self) -> str:
        """Path of the file."""


class Recipe(NamedTuple):
    """A kernel that takes no method: the module, the function and its arguments that derive it.

    A kernel of a description in a file has a `reader`, "module:function", which returns what the file describes, a
    `Description`. It is the only argument of the function.
    """

    title: str
    module: str
    function: str
    arguments: tuple[Any, ...] = ()
    standard: bool = True
    reader: str = ""
