"""Groups of options, and rules of what options need and exclude.

A dataclass declares the options of a group once, and a command takes it as one parameter. A command declares its rules
in a table; they are checked before it runs.
"""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Callable, Mapping, Sequence, Sized
from copy import copy
from functools import partial, wraps
from inspect import Parameter, Signature
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar, get_type_hints

import typer
from typer.models import OptionInfo, ParameterInfo

from strapgen.cli import completion, values
from strapgen.cli.values import written
from strapgen.ir.checks import alternatives
from strapgen.ir.exceptions import InputError
from strapgen.storage import streams

Command = TypeVar("Command", bound=Callable[..., Any])


#: The option of every command that takes others from a variant, which are in place when the command runs.
VARIANT = Parameter(
    "variant",
    Parameter.KEYWORD_ONLY,
    default=None,
    annotation=Annotated[
        str | None,
        typer.Option(
            "--variant",
            metavar="NAME",
            help="Take options from this variant of strapgen.toml; those that you state here win.",
            autocompletion=completion.of_parameter("--variant", None),
        ),
    ],
)


def read_words(command: Any, context: Any) -> None:
    """Let the parameters of a command take what needs no conversion: no value, a switch, and words that `Option` reads.

    Typer converts each by a library whose import takes longer than the rest of a short command.
    """
    known = getattr(command.callback, "options", None)
    of_words = {VARIANT.name} if isinstance(known, CommandOptions) else set()
    if isinstance(known, CommandOptions):
        of_words |= {name for name, one in known.options.items() if one.read or one.kind in (str, Path)}
    for parameter in command.get_params(context):
        is_word = parameter.name in of_words and not getattr(parameter, "is_flag", False)
        vars(parameter)["process_value"] = partial(_process, parameter, str if is_word else bool)


def _process(parameter: Any, kind: type, context: Any, value: Any) -> Any:
    """Return a value, or a list of several, if it is of a kind; else what Typer makes of it."""
    several = parameter.multiple or parameter.nargs == -1
    if several and value is not None:
        value = list(value)
    is_kind = all(isinstance(one, kind) for one in (value if several and value else [value]))
    if (value is None or value == [] or is_kind) and not (parameter.required and not value):
        value = () if several and value is None else value
        return value if parameter.callback is None else parameter.callback(context, parameter, value)
    return type(parameter).process_value(parameter, context, value)


def grouped(command: Command) -> Command:
    """Decorate a command for Typer, so that it takes typed values and objects of its groups of options.

    A group is a parameter whose type is a dataclass with fields annotated as Typer reads them. Its class variable
    `panel` is the heading of its options, and `rules` says which of them go together.
    """
    options = CommandOptions(command)

    @wraps(command)
    def run(**words: Any) -> Any:
        return command(**options.typed(words))

    parameters = [option.parameter for option in options.options.values()]
    if VARIANT.name not in options.options:
        parameters.append(VARIANT)
    del run.__dict__["__wrapped__"]  # else the command's own signature would be read
    run.__dict__["__signature__"] = Signature(parameters)
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    run.__dict__["options"] = options
    return run  # type: ignore[return-value]


class Shown(NamedTuple):
    """The options of a group that a command has, in the annotation of the command's parameter."""

    only: tuple[str, ...] = ()  # fields in the order of the help, others keep their defaults; () for all
    before: str = ""  # the field or parameter that the help shows after these; "" for the parameter's place


class Option(NamedTuple):
    """An option or an argument of a command: its declaration for Typer, and the reader of its values."""

    spellings: tuple[str, ...]  # on the command line; of an argument its metavar
    kind: Any  # of its values, without None
    parameter: Parameter
    read: values.Reader | None

    @property
    def spelling(self) -> str:
        """The name of the option, as it is spelled."""
        return self.spellings[0]

    @property
    def is_argument(self) -> bool:
        """Whether it has no name on the command line."""
        return not self.spelling.startswith("-")

    @property
    def help(self) -> str:
        """The help of the option, in a line."""
        return next(
            (one.help or "" for one in self.parameter.annotation.__metadata__ if hasattr(one, "help")), ""
        )

    def value(self, word: Any) -> Any:
        """Return the typed value of a word; None stands for none, as no words do."""
        if word is None or word == []:
            return None
        if self.kind is Path:
            word = values.path(self.spelling, word)
        return word if self.read is None else self.read(self.spelling, word)


class Group(NamedTuple):
    """A dataclass whose fields are options of a command."""

    kind: type[Any]
    options: Sequence[Option]

    @property
    def spellings(self) -> list[str]:
        """The options as they are spelled."""
        return [option.spelling for option in self.options]


class CommandOptions:
    """The options of a command in the order of its help, its groups, and the rules between options."""

    def __init__(self, command: Callable[..., Any]) -> None:
        self.options: dict[str, Option] = {}
        self.groups: dict[str, Group] = {}
        self.rules: Sequence[Rule] = getattr(command, "rules", ())
        hints = get_type_hints(command, include_extras=True)
        for parameter in Signature.from_callable(command).parameters.values():
            hint = hints[parameter.name]
            kind = getattr(hint, "__origin__", hint)
            if dataclasses.is_dataclass(kind) and isinstance(kind, type):
                shown = next(
                    (one for one in getattr(hint, "__metadata__", ()) if isinstance(one, Shown)), Shown()
                )
                group = self.groups[parameter.name] = Group(kind, _fields(kind, shown.only))
                self._insert(group.options, shown.before)
            else:
                self._insert([_option(parameter.name, hint, parameter.default)], "")

    def _insert(self, more: Sequence[Option], before: str) -> None:
        names = list(self.options)
        added = {option.parameter.name: option for option in more}
        if twice := {*names} & {*added}:
            raise TypeError(f"two options of a command are named {', '.join(sorted(twice))}")
        place = names.index(before) if before else len(names)
        items = list(self.options.items())
        self.options = dict([*items[:place], *added.items(), *items[place:]])

    def typed(self, words: Mapping[str, Any]) -> dict[str, Any]:
        """Return the arguments of the command from the words of a command line, and refuse what breaks a rule."""
        read = {name: one.value(words.get(name, one.parameter.default)) for name, one in self.options.items()}
        line = CommandLine(
            {one.spelling: read[name] for name, one in self.options.items()},
            {one.spelling: one.value(_optional(one.parameter.default)) for one in self.options.values()},
            {name: group.spellings for name, group in self.groups.items()},
        )
        _check_standard_input(line)
        check(self.rules, line)
        for group in self.groups.values():
            check(getattr(group.kind, "rules", ()), line.of(group.spellings))
        made = {
            name: group.kind(**{one.parameter.name: read.pop(one.parameter.name) for one in group.options})
            for name, group in self.groups.items()
        }
        return read | made


def _fields(group: type[Any], only: tuple[str, ...]) -> list[Option]:
    hints = get_type_hints(group, include_extras=True)
    fields = {field.name: field for field in dataclasses.fields(group)}
    if unknown := {*only} - {*fields}:
        raise TypeError(f"{group.__name__} has no option {', '.join(sorted(unknown))}")
    panel = getattr(group, "panel", None)
    return [_option(name, hints[name], _default(fields[name]), panel) for name in only or fields]


def _default(field: dataclasses.Field[Any]) -> Any:
    return Parameter.empty if field.default is dataclasses.MISSING else field.default


def _optional(default: Any) -> Any:
    return None if default is Parameter.empty else default


def _option(name: str, hint: Any, default: Any, panel: str | None = None) -> Option:
    """Return the option of a parameter, for which Typer reads text and takes the default as it is written."""
    # Typer passes every value by its name, so that one without a default may stand behind others.
    parameter = Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=hint)
    info = copy(
        next((one for one in getattr(hint, "__metadata__", ()) if isinstance(one, ParameterInfo)), None)
    )
    if info is None:
        return Option((name,), hint, parameter, None)
    kind, parts = values.split(hint.__origin__)
    read_one, info.parser = info.parser, None
    read = values.reader(hint.__origin__, read_one)  # type: ignore[arg-type]
    info.rich_help_panel = panel or info.rich_help_panel
    # In an annotation Typer takes the first name of an option for its default.
    named = isinstance(info, OptionInfo)
    spellings = (str(info.default), *(info.param_decls or ())) if named else (info.metavar or name,)
    # Options of several values and settings add up; of others the last one would count.
    adds_up = issubclass(kind, Mapping) or (kind is tuple and ... in parts)
    if info.autocompletion is None:
        allowed = read_one.allowed if isinstance(read_one, values.Names) else None
        info.autocompletion = completion.of_parameter(spellings[0], allowed)
    words: Any = hint.__origin__
    if read is not None and kind is not Path:
        words = list[str] if adds_up else str
        words = words | None if default is None else words
        if default not in (None, Parameter.empty):
            default = [values.written(default)] if adds_up else values.written(default)
    return Option(
        spellings, kind, parameter.replace(default=default, annotation=Annotated[words, info]), read
    )


def stated(group: Any) -> dict[str, Any]:
    """Return the options of a group whose values differ from the defaults."""
    return {
        option.spelling: value
        for option in _fields(type(group), ())
        if (value := getattr(group, option.parameter.name)) is not None
        and value != option.value(_optional(option.parameter.default))
    }


def command_line(command: str, *parts: Any, files_by_name: bool = False) -> str:
    """Return a command line of arguments, of options by their names, and of groups without what is the default."""
    words = ["strapgen", *command.split()]
    for part in parts:
        if isinstance(part, str):
            words.append(part)
            continue
        for name, value in (part if isinstance(part, Mapping) else stated(part)).items():
            if value is True:
                words.append(name)
            elif isinstance(value, Mapping):
                words += [word for key, one in value.items() for word in (name, f"{key}={one}")]
            elif value is not None:
                by_name = files_by_name and isinstance(value, Path)
                words += [name, values.written(value.name if by_name else value)]
    return shlex.join(words)


def rules(*table: Rule) -> Callable[[Command], Command]:
    """Declare which options of a command need or exclude each other."""

    def declare(command: Command) -> Command:
        command.__dict__["rules"] = table
        return command

    return declare


class CommandLine(NamedTuple):
    """The options of a command line by their names, arguments by their metavars."""

    values: Mapping[str, Any]
    defaults: Mapping[str, Any]
    groups: Mapping[str, Sequence[str]]  # the options of a group, by the parameter of the command

    def given(self, condition: str) -> str:
        """Return the option of a condition if it has a value, "" if not: "--plot", or "--format=json|csv"."""
        name, equals, allowed = condition.partition("=")
        value = self.values.get(name)
        if value is None or value is False or (isinstance(value, Sized) and not len(value)):
            return ""
        if not equals:
            return name
        return f"{name} {written(value)}" if written(value) in allowed.split("|") else ""

    def of(self, options: Sequence[str]) -> CommandLine:
        """Return the options of one group."""
        return self._replace(values={name: self.values[name] for name in options})

    def stated(self, conditions: str) -> list[str]:
        """Return the options of conditions whose values differ from the defaults; "@group" stands for a whole group."""
        several = [
            name
            for condition in conditions.split()
            for name in (self.groups.get(condition[1:], ()) if condition[0] == "@" else (condition,))
        ]
        return [
            option
            for condition in several
            if (option := self.given(condition))
            and self.values[name := condition.partition("=")[0]] != self.defaults[name]
        ]


class Needs(NamedTuple):
    """Each of some options needs one of others."""

    options: str
    one_of: str

    def refusal(self, line: CommandLine) -> str:
        """Return why a command line is refused; "" if it is not."""
        conditions = self.one_of.split()
        if any(line.given(condition) for condition in conditions):
            return ""
        if not any(condition.partition("=")[0] in line.values for condition in conditions):
            return ""  # a command shows some options of a group
        needed = [_in_words(condition) for condition in conditions]
        return "".join(f"{option} needs {alternatives(needed)}" for option in line.stated(self.options)[:1])


class Excludes(NamedTuple):
    """None of some options goes with one of others; the reason says what they do."""

    options: str
    others: str
    reason: str = ""

    def refusal(self, line: CommandLine) -> str:
        """Return why a command line is refused; "" if it is not."""
        options, others = line.stated(self.options), line.stated(self.others)
        if not options or not others:
            return ""
        if self.reason:
            return f"{self.reason}; {others[0]} does not go with it"
        return f"{options[0]} and {others[0]} do not go together"


class OneOf(NamedTuple):
    """One of some options is given, or at most one where none is needed."""

    options: str
    needed: str = ""  # that one is needed, in words
    several: bool = False  # whether several may be given

    def refusal(self, line: CommandLine) -> str:
        """Return why a command line is refused; "" if it is not."""
        given = [option for option in self.options.split() if line.given(option)]
        if len(given) > 1 and not self.several:
            return f"{given[0]} and {given[1]} are both given; one is needed"
        return "" if given else self.needed


Rule = Needs | Excludes | OneOf


def check(table: Sequence[Rule], line: CommandLine) -> None:
    """Refuse a command line that breaks a rule."""
    for rule in table:
        if refusal := rule.refusal(line):
            raise InputError(refusal)


def _check_standard_input(line: CommandLine) -> None:
    """Refuse a command line that reads standard input twice."""
    reading = [name for name, value in line.values.items() if value == streams.STANDARD and name != "--out"]
    if len(reading) > 1:
        raise InputError(f"{reading[0]} and {reading[1]} are both -; standard input is read once")


def _in_words(condition: str) -> str:
    name, equals, allowed = condition.partition("=")
    return f"{name} {alternatives(allowed.split('|'))}" if equals else name
