"""Rules of what options need and exclude: a command declares them in a table, and they are checked before it runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Sized
from typing import Any, NamedTuple, TypeVar

from strapgen.cli.values import written
from strapgen.ir.checks import alternatives
from strapgen.ir.exceptions import InputError


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
        """Return the options of conditions that are given and have not their defaults; "@group" is all of a group."""
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


def _in_words(condition: str) -> str:
    name, equals, allowed = condition.partition("=")
    return f"{name} {alternatives(allowed.split('|'))}" if equals else name


Rule = Needs | Excludes | OneOf
Command = TypeVar("Command", bound=Callable[..., Any])


def rules(*table: Rule) -> Callable[[Command], Command]:
    """Declare what goes together of the options of a command."""

    def declare(command: Command) -> Command:
        command.__dict__["rules"] = table
        return command

    return declare


def check(table: Sequence[Rule], line: CommandLine) -> None:
    """Refuse a command line that breaks a rule."""
    for rule in table:
        if refusal := rule.refusal(line):
            raise InputError(refusal)
