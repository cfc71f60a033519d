"""Registrations of commands, names and results by folders and installed packages, imported when used.

A folder has a module ``registration``, whose `REGISTRATION` says what the folder brings; an installed package names its
own by an entry point of the group `GROUP`. Nothing else knows which there are.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator, Mapping
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
#: What a folder or a package brings by name, and the word for one.
KINDS = {
    "kernels": "kernel",
    "methods": "method",
    "tableaux": "tableau",
    "windows": "window",
    "coning_shapes": "coning shape",
    "motions": "motion",
    "targets": "target",
    "backends": "back end",
}
#: Kinds whose tables are folders of TOML files, by the names of the files.
_FOLDERS = ("tableaux", "windows", "coning_shapes")


class Command(NamedTuple):
    """A command: "module:function", and its heading and summary in ``strapgen --help``.

    With a summary, which is the first sentence of its help, the list does not import it.
    """

    function: str
    heading: str = ""
    hidden: bool = False
    summary: str = ""


class Schema(NamedTuple):
    """A JSON Schema of a "result" or of a user's "file", and its place."""

    kind: str
    #: "module:name" of a class with a method `schema`, or of a function that returns the schema
    place: str
    #: The installed package that brings it
    point: EntryPoint | None = None

    def read(self) -> dict[str, Any]:
        """Return the schema."""
        holder: Any = load(self.place) if self.point is None else loaded(self.point, self.place)
        if isinstance(holder, InputError):
            raise holder
        read: Callable[[], dict[str, Any]] = holder.schema if hasattr(holder, "schema") else holder
        return read()


@dataclass(frozen=True)
class Registration:
    """The registration of a folder or a package; every place is a text "module:name", imported when used.

    Parameters
    ----------
    title : str
        One line that says what it is for.
    commands : mapping of str to Command, optional
        Commands by name; one of a group has the name of the group and its own, as "study loops".
    kernels : tuple of str, optional
        Tables of kernels: mappings of names to `strapgen.ir.kernel_info.Recipe`, as plain data.
    methods : tuple of str, optional
        Tables of methods without coefficient files: mappings of names to `strapgen.catalogue.Integrator`.
    tableaux, windows, coning_shapes : tuple of str, optional
        Folders "package:folder" of TOML files with coefficients; a file has the name of its method.
    motions : tuple of str, optional
        Tables of motions: mappings of names to `MotionEntry` of the module `motion_names`.
    targets : tuple of str, optional
        Tables of targets: mappings of names to `strapgen.Target`.
    backends : tuple of str, optional
        Tables of back ends: mappings of names to `strapgen.run.backend_names.Entry`.
    files : mapping of str to str, optional
        Kinds of users' TOML files by name: each a `strapgen.catalogue.catalogue.toml_models.UserFile`.
    lists : mapping of str to str, optional
        Functions without arguments that return names with their meanings, by the kind under which ``strapgen list``
        shows them.
    results : mapping of str to str, optional
        Results of its commands, subclasses of `strapgen.results.result.Result`, by the names of their JSON Schemas.
    extensions : mapping of str to str, optional
        What it adds to others, by the extension point that the compiler or another application defines, such as
        "lab.described".
    requires : tuple of str, optional
        Folders of strapgen that it needs, as "lab"; without one of them it is not there either, and it comes after
        them.
    """

    title: str
    commands: Mapping[str, Command] = field(default_factory=dict)
    kernels: tuple[str, ...] = ()
    methods: tuple[str, ...] = ()
    tableaux: tuple[str, ...] = ()
    windows: tuple[str, ...] = ()
    coning_shapes: tuple[str, ...] = ()
    motions: tuple[str, ...] = ()
    targets: tuple[str, ...] = ()
    backends: tuple[str, ...] = ()
    files: Mapping[str, str] = field(default_factory=dict)
    lists: Mapping[str, str] = field(default_factory=dict)
    results: Mapping[str, str] = field(default_factory=dict)
    extensions: Mapping[str, str] = field(default_factory=dict)
    requires: tuple[str, ...] = ()


def load(place: str) -> Any:
    """Import the object that a text "module:name" refers to; without a name, the module."""
    module, _, name = place.partition(":")
    holder = import_module(module)
    return getattr(holder, name) if hasattr(holder, name) else import_module(f"{module}.{name}")


def table(kind: str, place: str) -> Mapping[str, Any]:
    """Return the table at a place: a mapping, or the files of a folder by name."""
    if kind not in _FOLDERS:
        names = load(place)
        if not isinstance(names, Mapping):
            raise InputError(f"{place} is of type {type(names).__name__}; a mapping of names is needed")
        return names
    package, _, name = place.partition(":")
    spec = importlib.util.find_spec(package)
    for folder in (spec and spec.submodule_search_locations) or ():
        if (files := Path(folder) / name).is_dir():
            return {path.stem: path for path in sorted(files.glob("*.toml"))}
    raise InputError(f"package {package} has no folder {name}")


@cache
def built_in() -> dict[str, Registration]:
    """Return the registrations of strapgen's folders by name, as "lab", each after those it requires."""
    top = Path(__file__).parent
    found: dict[str, Registration] = {}
    for path in [*sorted(top.glob("*/registration.py")), *sorted(top.glob("*/*/registration.py"))]:
        parts = path.relative_to(top).with_suffix("").parts
        # Read by its path: the packages above it are not imported, so that --help is quick.
        spec = importlib.util.spec_from_file_location(".".join([__package__, *parts]), path)
        assert spec is not None and spec.loader is not None, "it is a file of Python"
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        found[".".join(parts[:-1])] = module.REGISTRATION
    there: dict[str, Registration] = {}
    while next_ones := [
        n for n, one in found.items() if n not in there and all(r in there for r in one.requires)
    ]:
        there |= {name: found[name] for name in next_ones}
    return there


@cache
def loaded(point: EntryPoint, place: str, kind: str = "") -> Any:
    """Import an object of an installed package; return an `InputError` with the reason if that fails.

    The place is that of the entry point itself, of a table of its registration (with the kind), or of a command.
    """
    of_record = point.group != GROUP and place == point.value
    label = f"{'target' if of_record else 'application'} {point.name} ({place})"
    if not point.pattern.match(place):
        return InputError(f"{label}: the entry point is no 'module:name'")
    duty = f"define a {'Target' if of_record else 'Registration'}"
    try:
        with packages.guarded(label, duty, packages.belongs_to(point.module)):
            try:
                if place == point.value:
                    return point.load()
                return table(kind, place) if kind else load(place)
            except StrapgenError as error:
                raise InputError(f"{label}: {error}") from error
    except InputError as error:
        return error


def read() -> Iterator[tuple[EntryPoint, Registration | InputError]]:
    """Yield the registrations of installed packages, or the error of one that cannot be used."""
    for point in packages.entry_points(GROUP):
        one = loaded(point, point.value)
        if not isinstance(one, Registration | InputError):
            one = InputError(
                f"application {point.name} ({point.value}) is of type {type(one).__name__}; a Registration is needed"
            )
        yield point, one


def installed_commands() -> Iterator[tuple[str, Command, Any]]:
    """Yield the commands of installed packages with their functions; an `InputError` in place of one says why not."""
    for point, one in read():
        if isinstance(one, Registration):
            for name, command in one.commands.items():
                yield name, command, _function(point, one, name)


def _function(point: EntryPoint, one: Registration, name: str) -> Any:
    """Return the function of a command of an installed package, or the `InputError` that says why it has none."""
    own = {command for registered in built_in().values() for command in registered.commands}
    place, group = one.commands[name].function, name.rpartition(" ")[0]
    if name in own:
        reason = f"strapgen has a command {name}; another name is needed"
    elif group and group not in own and group not in one.commands:
        reason = f"command {name} is of no group that there is"
    else:
        return loaded(point, place)
    return InputError(f"application {point.name} ({place}): {reason}")


def broken() -> list[str]:
    """Return a line for every installed package with an object that cannot be imported, naming the first."""
    lines = []
    for point, one in read():
        parts: list[Any] = [one]
        if isinstance(one, Registration):
            parts += [loaded(point, place, kind) for kind in KINDS for place in getattr(one, kind)]
            others = (one.lists, one.results, one.files, one.extensions)
            parts += [loaded(point, place) for names in others for place in names.values()]
            parts += [_function(point, one, name) for name in one.commands]
        lines += [str(part) for part in parts if isinstance(part, InputError)][:1]
    return lines


def extension(point: str, needed: str) -> Any:
    """Return the extension of an application by name; `needed` is the option or argument that requires it."""
    added = next(extensions(point), None)
    if added is None:
        raise InputError(f"{needed} needs an application of strapgen that is not installed ({point})")
    return added


def extensions(point: str) -> Iterator[Any]:
    """Yield the usable extensions of applications at an extension point."""
    for one in built_in().values():
        if point in one.extensions:
            yield load(one.extensions[point])
    for entry, registered in read():
        if isinstance(registered, Registration) and point in registered.extensions:
            added = loaded(entry, registered.extensions[point])
            if not isinstance(added, InputError):
                yield added


def lists() -> dict[str, dict[str, str]]:
    """Return the names of the kinds that applications list, with their meanings, by kind."""
    kinds: dict[str, dict[str, str]] = {}
    for one in reversed(built_in().values()):
        kinds |= {kind: load(place)() for kind, place in one.lists.items()}
    for point, registered in read():
        for kind, place in registered.lists.items() if isinstance(registered, Registration) else ():
            names = loaded(point, place)
            label = f"application {point.name} ({place})"
            try:
                with packages.guarded(label, "return names", packages.belongs_to(point.module)):
                    if not isinstance(names, InputError):
                        kinds.setdefault(kind, dict(names()))
            except InputError as error:
                kinds.setdefault(kind, {place: f"cannot be used: {error}"})
    return kinds


def schemas() -> dict[str, Schema]:
    """Return the JSON Schemas: of results by name, and of users' files as "<kind>.toml"."""
    found: dict[str, Schema] = {}
    installed = ((point, one) for point, one in read() if isinstance(one, Registration))
    for entry, one in [*((None, one) for one in built_in().values()), *installed]:
        for kind, end, places in (("result", "", one.results), ("file", ".toml", one.files)):
            for name, place in places.items():
                found.setdefault(f"{name}{end}", Schema(kind, place, entry))
    return found
