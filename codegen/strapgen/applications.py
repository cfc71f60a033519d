"""Applications: what each brings, declared in its own folder or package and imported when it is used.

An application of strapgen is a folder with a module ``application``, whose `APPLICATION` says what the folder brings.
An installed package names its own by an entry point of the group `GROUP`. Nothing else knows which there are.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from strapgen.ir import packages
from strapgen.ir.exceptions import InputError, StrapgenError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

#: Entry points of installed packages.
GROUP = "strapgen.applications"


class Command(NamedTuple):
    """A command: "module:function", where ``strapgen --help`` lists it; a hidden one is not listed."""

    function: str
    heading: str = ""
    hidden: bool = False


@dataclass(frozen=True)
class Application:
    """What an application brings; every place is a text "module:name", imported when it is used.

    Parameters
    ----------
    title : str
        One line that says what it is for.
    commands : mapping of str to Command, optional
        Commands by name; one of a group has the name of the group and its own, as "study loops".
    kernels : tuple of str, optional
        Tables of kernels: mappings of names to `strapgen.ir.recipe.Recipe`, as plain data.
    lists : mapping of str to str, optional
        Functions without arguments that return names with their meanings, by the kind under which ``strapgen list``
        shows them.
    extensions : mapping of str to str, optional
        What it adds to others, by the extension point that the compiler or another application defines, such as
        "lab.described".
    requires : tuple of str, optional
        Applications of strapgen that it imports; without one of them it is not there either.
    """

    title: str
    commands: Mapping[str, Command] = field(default_factory=dict)
    kernels: tuple[str, ...] = ()
    lists: Mapping[str, str] = field(default_factory=dict)
    extensions: Mapping[str, str] = field(default_factory=dict)
    requires: tuple[str, ...] = ()


def load(place: str) -> Any:
    """Return what a text "module:name" names; it may be a module of a package."""
    module, _, name = place.partition(":")
    loaded = import_module(module)
    return getattr(loaded, name) if hasattr(loaded, name) else import_module(f"{module}.{name}")


@cache
def built_in() -> dict[str, Application]:
    """Return the applications of strapgen by the names of their folders, each after those that it requires."""
    package = __name__.rpartition(".")[0]
    top = Path(__file__).parent
    folders = sorted(entry.name for entry in os.scandir(top) if (top / entry / "application.py").is_file())
    loaded = {name: import_module(f"{package}.{name}.application").APPLICATION for name in folders}
    there: dict[str, Application] = {}
    while next_ones := [
        n for n, one in loaded.items() if n not in there and all(r in there for r in one.requires)
    ]:
        there |= {name: loaded[name] for name in next_ones}
    return there


def installed() -> dict[str, Application]:
    """Return the applications of installed packages that can be used, by the names of their entry points."""
    return {name: one for name, one in _read().items() if isinstance(one, Application)}


def broken() -> list[str]:
    """Return a line on each application of an installed package that cannot be used."""
    return [one for one in _read().values() if isinstance(one, str)]


def _read() -> dict[str, Application | str]:
    """Return the applications of installed packages, or why one cannot be used."""
    result: dict[str, Application | str] = {}
    for point in packages.entry_points(GROUP):
        try:
            result[point.name] = _loaded(point)
        except StrapgenError as error:
            result[point.name] = str(error)
    return result


@cache
def _loaded(point: EntryPoint) -> Application:
    label = f"application {point.name} ({point.value})"
    if not point.pattern.match(point.value):
        raise InputError(f"{label}: the entry point is no 'module:name'")
    with packages.guarded(label, "define an Application", packages.belongs_to(point.module)):
        application = point.load()
    if not isinstance(application, Application):
        raise InputError(f"{label} is of type {type(application).__name__}; an Application is needed")
    return application


def all_applications() -> dict[str, Application]:
    """Return the applications of strapgen, then those of installed packages."""
    return {**built_in(), **installed()}


def extension(point: str, needed: str) -> Any:
    """Return what an application adds at an extension point.

    Raises
    ------
    InputError
        If none does; `needed` is the option or argument that asks for it.
    """
    added = next(extensions(point), None)
    if added is None:
        raise InputError(f"{needed} needs an application of strapgen that is not installed ({point})")
    return added


def extensions(point: str) -> Iterator[Any]:
    """Yield what applications add at an extension point."""
    for application in all_applications().values():
        if point in application.extensions:
            yield load(application.extensions[point])
