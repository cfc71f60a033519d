"""Reads the command in the header of a generated file as data: nothing that it says is run or written."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, get_args, get_origin

from typer.models import OptionInfo

from strapgen.cli import generate_command
from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.options import MethodOptions
from strapgen.cli.source_options import SourceOptions
from strapgen.design.commit_late import window_generate_command
from strapgen.ir.exceptions import InputError
from strapgen.ir.suggestions import alternatives
from strapgen.navigation.systems import system_command as system
from strapgen.navigation.two_speed import two_speed_command as two_speed

if TYPE_CHECKING:
    from strapgen.ir.sources import Sources
    from strapgen.navigation.systems.fitting import Fitted
    from strapgen.run.generation import Request

Group = TypeVar("Group")

#: The commands that generate C; a header can state these alone.
COMMANDS: dict[str, Callable[..., Any]] = {
    "generate": generate_command.generate,
    "two-speed": two_speed.two_speed,
    "window generate": window_generate_command.generate,
    "system": system.system,
}
#: Parameters of these commands that say what is generated. All others write, print or ask for files beside it.
_VALUES = {
    *("algorithm", "file", "window", "target", "sculling", "sample_hz", "cpu", "name", "prefix"),
    *(field.name for group in (MethodOptions, FixedOptions) for field in fields(group)),
}


@dataclass(frozen=True)
class HeaderCommand:
    """A command that generates C, with the values that its header states."""

    #: The command as the header has it
    text: str
    #: A key of `COMMANDS`
    name: str
    #: Values by parameter; those that are not stated have their defaults
    values: Mapping[str, Any]

    def request(self, algorithms: Iterable[str] = ()) -> Request:
        """Return the request of a command that generates one function."""
        if self.name != "generate":
            raise InputError(f"'{self.text}' does not generate one function")
        _require_named(self.values["algorithm"], algorithms)
        return generate_command.request(
            self.values["algorithm"],
            self._group(MethodOptions),
            self.values["target"],
            self._group(FixedOptions),
            self._group(SourceOptions),
        )

    def whole(self, algorithms: Iterable[str] = ()) -> Sources:
        """Return the files of a command that generates several functions; see `request`."""
        values, fixed = self.values, self._group(FixedOptions)
        if self.name == "two-speed":
            from strapgen.navigation.two_speed import two_speed_sources

            return two_speed_sources.sources(*self.two_speed())
        if self.name == "window generate":
            return window_generate_command.generated(
                values["window"],
                values["algorithm"],
                values["target"],
                values["sample_hz"],
                fixed,
                values["name"],
            )
        return self.system(algorithms)[1]

    def system(self, algorithms: Iterable[str] = ()) -> tuple[Fitted, Sources]:
        """Return the generated stages of a described system, and its files; see `request`."""
        from strapgen.navigation.systems import built_in, system_file
        from strapgen.navigation.systems.system_bounds import bounds

        values = self.values
        for stage in system_file.read(built_in.file_of(values["file"])).stages:
            _require_named(stage.kernel, algorithms)
        fit, needs, command = system.fitted_stages(
            values["file"], values["target"], values["sample_hz"], values["cpu"], self._group(FixedOptions)
        )
        return fit, system.unit(fit, needs, bounds(fit), command)

    def two_speed(self) -> two_speed.TwoSpeedRequest:
        """Return what a command of two speeds generates: algorithm, form of sculling, target and settings."""
        values = self.values
        return two_speed.request(
            values["algorithm"], values["sculling"], values["target"], self._group(FixedOptions)
        )

    def _group(self, kind: type[Group]) -> Group:
        """Return a group of options with the values that are stated."""
        names = {field.name for field in fields(kind)}  # type: ignore[arg-type]
        return kind(**{name: value for name, value in self.values.items() if name in names})


def read(text: str) -> HeaderCommand:
    """Read a command as data."""
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise InputError(f"the header's command cannot be read ({error}): {text}") from None
    name = next(
        (name for name in COMMANDS if words[: 2 + name.count(" ")] == ["strapgen", *name.split()]), None
    )
    if name is None:
        known = alternatives([f"strapgen {command}" for command in COMMANDS])
        raise InputError(f"the header's command is none that generates C, which are {known}: {text}")
    return HeaderCommand(text, name, _values(name, words[2 + name.count(" ") :], text))


def _values(name: str, words: list[str], text: str) -> dict[str, Any]:
    """Return the values of the words behind the name of a command."""
    parameters = signature(COMMANDS[name]).parameters
    values = {key: parameter.default for key, parameter in parameters.items() if key in _VALUES}
    (argument,) = (key for key in values if not _spellings(parameters[key].annotation))
    by_option = {spelling: key for key in values for spelling in _spellings(parameters[key].annotation)}
    stated: dict[str, list[str]] = {}
    rest = iter(words)
    for word in rest:
        option, equals, value = word.partition("=")
        if not word.startswith("-"):
            key, value = argument, word
        elif option not in by_option:
            raise InputError(f"{option} is no option that says what strapgen {name} generates: {text}")
        else:
            key = by_option[option]
            if _kind(parameters[key].annotation) is not bool:
                value = value if equals else next(rest, "")
                if not value or (not equals and value.startswith("--")):
                    raise InputError(f"{option} has no value in the header's command: {text}")
        stated.setdefault(key, []).append(value)
    if argument not in stated:
        raise InputError(f"the header's command names nothing to generate: {text}")
    for key, words_of in stated.items():
        values[key] = _value(_kind(parameters[key].annotation), key, words_of, text)
    _require_file(name, values)
    return values


def _value(kind: Any, key: str, words: list[str], text: str) -> Any:
    """Return the words of one parameter as a value of its type."""
    if kind is list:
        return words
    if len(words) > 1:
        raise InputError(f"the header's command states {key.replace('_', '-')} {len(words)} times: {text}")
    if kind is bool:
        return True
    return _regular(words[0]) if kind is Path else words[0]


def _require_file(name: str, values: Mapping[str, Any]) -> None:
    """Refuse an argument that is a device or a pipe where a file may stand."""
    if name == "window generate":
        _regular(values["window"])


def _regular(word: str) -> Path:
    """Return a path; one that is there must be a regular file, since others can wait or have effects.

    Files of the kernel, which can wait too, have no size.
    """
    path = Path(word)
    if path.exists() and not (path.is_file() and path.stat().st_size):
        raise InputError(f"{word} in the header's command is no regular file, or empty")
    return path


def _spellings(annotation: Any) -> tuple[str, ...]:
    """Return the spellings of an option; none for an argument."""
    info = annotation.__metadata__[0]
    if not isinstance(info, OptionInfo):
        return ()
    return str(info.default), *(info.param_decls or ())


def _kind(annotation: Any) -> Any:
    """Return the type of a parameter: list, bool, Path or str."""
    hint = annotation.__origin__
    for candidate in (hint, *get_args(hint)):
        if get_origin(candidate) is list:
            return list
        if candidate in (bool, Path):
            return candidate
    return str


def _require_named(algorithm: str, algorithms: Iterable[str]) -> None:
    """Refuse a user's algorithm, which runs as a program, unless the command line names it too."""
    from strapgen.catalogue.names import reserved
    from strapgen.catalogue.user import loading

    if algorithm in reserved() or not (algorithm.endswith(".py") or algorithm in loading.installed()):
        return
    if not any(algorithm == name or _same(algorithm, name) for name in algorithms):
        raise InputError(
            f"the header names {algorithm}, a user's algorithm, which would run as a program; --algorithm {algorithm} "
            "allows it"
        )


def _same(one: str, other: str) -> bool:
    return one.endswith(".py") and Path(one).resolve() == Path(other).resolve()
