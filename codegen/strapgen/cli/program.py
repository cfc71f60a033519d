"""The program that Typer runs, with the commands that a command line needs."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import Annotated, Any

import typer

from strapgen import registration
from strapgen.cli import top_help
from strapgen.cli.help import PlainCommand, PlainGroup
from strapgen.cli.option_groups import CommandOptions
from strapgen.ir.exceptions import InputError
from strapgen.registration import Command


class _Strapgen(PlainGroup):
    """The program itself."""

    def listed(self) -> dict[str, dict[str, str]]:
        """Return all commands, of which those that a command line does not need are not imported."""
        return top_help.commands()

    def get_help(self, ctx: Any) -> str:
        """Return the help of the program."""
        return top_help.text()


_app = typer.Typer(
    name="strapgen",
    cls=_Strapgen,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
#: Commands that were added, and groups of commands by name.
_added: set[str] = set()
_groups: dict[str, typer.Typer] = {}
#: The commands of strapgen by name.
_OWN = {name: command for one in registration.built_in().values() for name, command in one.commands.items()}


def _show_versions(chosen: bool) -> None:
    if not chosen:
        return
    from strapgen.run.versions import versions

    typer.echo("\n".join(f"{name} {version}" for name, version in versions().items()))
    raise typer.Exit


@_app.callback()
def _options(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", callback=_show_versions, is_eager=True)] = False,
    verbose: Annotated[bool, typer.Option("--verbose")] = False,
) -> None:
    if verbose:
        _log_stages(context)


def _log_stages(context: typer.Context) -> None:
    """Write the log of the stages to stderr until the command ends."""
    logger, handler = logging.getLogger("strapgen"), logging.StreamHandler()
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)

    def stop() -> None:
        logger.removeHandler(handler)
        logger.setLevel(level)

    context.call_on_close(stop)


def _add(name: str, command: Command, function: Any) -> None:
    """Add a command to the program, and before it the group of which it is one."""
    if name in _added:
        return
    _added.add(name)
    group, _, member = name.rpartition(" ")
    if isinstance(function, typer.Typer):
        _app.add_typer(function, name=name)
        _groups[name] = function
        return
    if group in _OWN:
        _add_own(group)
    to = _groups[group] if group else _app
    to.command(member, cls=PlainCommand, hidden=command.hidden)(function)


def _add_own(*names: str) -> None:
    """Add commands of strapgen, which are imported for that."""
    for name in names:
        if name not in _added:
            _add(name, _OWN[name], registration.load(_OWN[name].function))


def _add_asked(words: Sequence[str], completing: bool) -> None:
    """Add the command of a command line alone; all of them where that is not enough, or a shell completes words."""
    asked = next((word for word in words if not word.startswith("-")), "")
    if completing or (asked and asked not in _OWN):
        _add_own(*_OWN)
    elif asked:
        _add_own(asked, *(name for name in _OWN if name.startswith(f"{asked} ")))
    if asked not in _OWN or asked in _groups:
        for name, command, function in registration.installed_commands():
            if not isinstance(function, InputError):
                _add(name, command, function)


def commands() -> list[str]:
    """Return the names of the commands of strapgen; one of a group has the name of the group and its own."""
    return [*_OWN]


def options_of(command: str) -> CommandOptions:
    """Return the options of a command."""
    function = registration.load(_OWN[command].function)
    if not isinstance(options := getattr(function, "options", None), CommandOptions):
        raise InputError(f"strapgen {command} takes no options of a variant")
    return options


def app() -> typer.Typer:
    """Return the program with all commands of strapgen."""
    _add_own(*_OWN)
    return _app


def run(words: Sequence[str], completing: bool = False) -> Any:
    """Run a command line, and return its exit status."""
    _add_asked(words, completing)
    return _app(words, prog_name="strapgen", standalone_mode=False)
