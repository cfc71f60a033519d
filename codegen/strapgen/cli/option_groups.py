"""Groups of options: a dataclass declares options once, and a command takes it as one parameter."""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Callable, Iterable, Mapping
from copy import copy
from functools import wraps
from inspect import Parameter, Signature
from typing import Annotated, Any, NamedTuple, TypeVar, get_type_hints

Command = TypeVar("Command", bound=Callable[..., Any])
#: Typer passes every value by its name, so that one without a default may stand behind others.
_KEYWORD = Parameter.KEYWORD_ONLY


class Shown(NamedTuple):
    """The options of a group that a command has, in the annotation of the command's parameter."""

    only: tuple[str, ...] = ()  # fields in the order of the help, others keep their defaults; () for all
    before: str = ""  # the field or parameter that the help shows after these; "" for the parameter's place


def grouped(command: Command) -> Command:
    """Show Typer the fields of a command's groups as options of the command.

    A group is a parameter whose type is a dataclass with fields annotated as Typer reads them. The command gets an
    object of the dataclass in place of the single values. Its class variable `panel` is the heading of its options.
    """
    hints = get_type_hints(command, include_extras=True)
    groups: dict[str, tuple[type[Any], tuple[str, ...]]] = {}
    options: dict[str, Parameter] = {}
    for parameter in Signature.from_callable(command).parameters.values():
        hint = hints[parameter.name]
        kind = getattr(hint, "__origin__", hint)
        shown = next((item for item in getattr(hint, "__metadata__", ()) if isinstance(item, Shown)), Shown())
        if dataclasses.is_dataclass(kind) and isinstance(kind, type):
            fields = _options(kind, shown.only)
            groups[parameter.name] = kind, tuple(option.name for option in fields)
        else:
            fields = [parameter.replace(annotation=hint, kind=_KEYWORD)]
        options = _insert(options, fields, shown.before)

    @wraps(command)
    def run(**values: Any) -> Any:
        objects = {
            name: kind(**{field: values.pop(field) for field in fields})
            for name, (kind, fields) in groups.items()
        }
        return command(**values, **objects)

    del run.__dict__["__wrapped__"]  # else the command's own signature would be read
    run.__dict__["__signature__"] = Signature(list(options.values()))
    run.__annotations__ = {option.name: option.annotation for option in options.values()}
    return run  # type: ignore[return-value]


def _options(group: type[Any], only: tuple[str, ...]) -> list[Parameter]:
    hints = get_type_hints(group, include_extras=True)
    fields = {field.name: field for field in dataclasses.fields(group)}
    if unknown := {*only} - {*fields}:
        raise TypeError(f"{group.__name__} has no option {', '.join(sorted(unknown))}")
    panel = getattr(group, "panel", None)
    return [
        Parameter(name, _KEYWORD, default=_default(fields[name]), annotation=_in_panel(hints[name], panel))
        for name in only or fields
    ]


def _in_panel(hint: Any, panel: str | None) -> Any:
    metadata = [copy(item) if hasattr(item, "rich_help_panel") else item for item in hint.__metadata__]
    for item in metadata:
        if hasattr(item, "rich_help_panel"):
            item.rich_help_panel = panel
    return Annotated[hint.__origin__, *metadata]


def _default(field: dataclasses.Field[Any]) -> Any:
    return Parameter.empty if field.default is dataclasses.MISSING else field.default


def _insert(options: dict[str, Parameter], more: list[Parameter], before: str) -> dict[str, Parameter]:
    if twice := {*options} & {option.name for option in more}:
        raise TypeError(f"two options of a command are named {', '.join(sorted(twice))}")
    names = list(options)
    place = names.index(before) if before else len(names)
    items = list(options.items())
    return dict([*items[:place], *((option.name, option) for option in more), *items[place:]])


def command_line(command: str, names: Iterable[str], stated: Mapping[str, str], *groups: Any) -> str:
    """Return the command line of arguments, stated options and groups, with all options that are not the default."""
    words = ["strapgen", command, *names, *(word for pair in stated.items() for word in pair)]
    for group in groups:
        hints = get_type_hints(type(group), include_extras=True)
        for field in dataclasses.fields(group):
            value = getattr(group, field.name)
            if value == field.default or value is None:
                continue
            name = (
                hints[field.name].__metadata__[0].default
            )  # in an annotation Typer has the first name there
            values = value if isinstance(value, list) else [value]
            words += [word for each in values for word in ((name,) if each is True else (name, str(each)))]
    return shlex.join(words)
