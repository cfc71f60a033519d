"""The program that Typer runs, with the commands that a command line needs."""

from __future__ import annotations

import logging
import re
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from strapgen import registration
from strapgen.cli import completion, help_layout, project_kinds, terminal
from strapgen.cli.help_layout import CommandHelp, lay_out, summary
from strapgen.cli.option_groups import CommandOptions, read_words
from strapgen.ir.checks import alternatives, suggestions
from strapgen.ir.exceptions import InputError, StrapgenError
from strapgen.registration import Command

#: Options whose value may be left out: the value that they then have, and a function that returns those they take.
DEFAULTS = {"--project": (project_kinds.DEFAULT, project_kinds.titles)}


class PlainCommand(TyperCommand):
    """A command whose help is plain text and whose messages name its options."""

    def get_help(self, ctx: Any) -> str:
        """Return usage, text, examples, arguments, and the options in their groups."""
        return lay_out(help_parts(self, ctx), {})

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the command line; an option's name is not the value of the option before it."""
        read_words(self, ctx)
        args = _with_defaults(self, ctx, args)
        if not ctx.resilient_parsing:  # else a shell completes the line
            _refuse_missing_values(self, ctx, args)
            _refuse_second_values(self, ctx, args)
            if name := value_of(args, "--variant"):
                ctx.default_map = _words_of_variant(self, ctx, name, args)
        rest = list(super().parse_args(ctx, args))
        several: list[Any] = [parameter for parameter in self.params if parameter.nargs == -1]
        for parameter in several:  # the parser of before Click 8.3 takes no defaults for several words
            key = parameter.name
            if not ctx.params.get(key) and key in (ctx.default_map or {}):
                ctx.params[key] = parameter.type_cast_value(ctx, ctx.default_map[key])
        return rest

    def invoke(self, ctx: Any) -> Any:
        """Run the command; in its messages the parameters of Python are options."""
        try:
            return super().invoke(ctx)
        except StrapgenError as error:
            if getattr(error, "in_file", False):
                raise
            told = type(error)(_in_options(self, str(error)))
            vars(told).update(vars(error))
            raise told from error


class PlainGroup(TyperGroup):
    """A group of commands, which its help lists."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words before the name of a command."""
        read_words(self, ctx)
        return list(super().parse_args(ctx, args))

    def listed(self) -> dict[str, dict[str, str]]:
        """Return the commands with their summaries, by heading."""
        return {"Commands": {name: summary(command.help or "") for name, command in self.commands.items()}}

    def get_help(self, ctx: Any) -> str:
        """Return usage, text, options and the commands under their headings."""
        return lay_out(help_parts(self, ctx), self.listed())


def _words_of_variant(command: Any, context: Any, name: str, words: Sequence[str]) -> dict[str, Any]:
    """Return the values of a variant for the parameters of a command, as the parser takes them."""
    stated = registration.extension("cli.variant", "--variant")(
        name, context.command_path.partition(" ")[2], words
    )
    several = {parameter.name for parameter in command.params if getattr(parameter, "multiple", False)}
    return {
        key: [value] if key in several and isinstance(value, str) else value for key, value in stated.items()
    }


def value_of(words: Sequence[str], *options: str) -> str:
    """Return the value of an option, by any of its names, in a command line; "" if it is not there."""
    for word, following in pairwise([*words, ""]):
        if word == "--":
            break
        if word.partition("=")[0] in options:
            return word.partition("=")[2] or following
    return ""


def help_parts(command: Any, context: Any) -> CommandHelp:
    """Return the help of a command or group of Typer, whose context has the path of names that begins the usage."""
    pieces = [f"[{_label(p)}]" if not p.required else _label(p) for p in _arguments(command, context)]
    if hasattr(command, "commands"):
        pieces.append("COMMAND [ARGS]...")
    parts = [" ".join(part.split()) for part in (command.help or "").strip().split("\n\n")]
    examples = {part: part.removeprefix("Example: ") for part in parts}
    commands = tuple(each for each in examples.values() if each.startswith("strapgen "))
    return CommandHelp(
        usage=f"{context.command_path} {' '.join(['[OPTIONS]', *pieces])}",
        paragraphs=tuple(part for part in parts if examples[part] not in commands),
        examples=commands,
        panels=_panels(command, context),
    )


def explanation(error: Any) -> str:
    """Return an error of Typer's parser in one sentence: the likely meaning, and the allowed words."""
    said = error.format_message() or "a command is needed"
    context = getattr(error, "ctx", None)
    command: Any = context and context.command
    name = getattr(error, "option_name", None)
    if said.startswith(("No such command", "Missing command")):
        known = [each for names in command.listed().values() for each in names]
        word = re.search(r"'(.*?)'", said)
        meant = suggestions("command", word[1], known) if word else []
        return f"{said.split('.')[0]}{_question(meant)}. Allowed: {', '.join(known)}."
    parameter = getattr(error, "param", None)
    if parameter is not None and said.startswith("Missing "):
        name = parameter.opts[0] if parameter.param_type_name == "option" else _label(parameter)
        return f"Missing {parameter.param_type_name} '{name}': {_meaning(parameter, context)}"
    if name is not None and command is not None and said.startswith("No such option"):
        known = [option.opts[0] for option in _shown_options(command, context)]
        return f"No such option: {name}{_question(suggestions('option', name, known))}; --help shows all"
    return said


def _question(meant: list[str]) -> str:
    return f" (did you mean {alternatives(meant)}?)" if meant else ""


def _needs(command: Any, name: str, context: Any) -> str:
    """Return the message that an option lacks its value, with its help."""
    option = next(option for option in _options_of(command, context) if name in option.opts)
    return f"{name} needs a value, {option.metavar}: {_meaning(option, context)}"


def _meaning(parameter: Any, context: Any) -> str:
    """Return the help of a parameter, for use after a colon."""
    text = re.sub(r"\s*\[.*\]$", "", _help_text(parameter, context)).rstrip(".")
    return text if text[1:2].isupper() else f"{text[:1].lower()}{text[1:]}"


def _options_of(command: Any, context: Any) -> list[Any]:
    return [p for p in command.get_params(context) if p.param_type_name == "option"]


def _shown_options(command: Any, context: Any) -> list[Any]:
    """Return the options without old ones, which no help and no suggestion names."""
    return [p for p in _options_of(command, context) if not getattr(p, "hidden", False)]


def _with_defaults(command: Any, context: Any, words: Sequence[str]) -> list[str]:
    """Return a command line on which options whose value may be left out have one.

    The word behind such an option is its value, unless it is the first argument of the command and no value.
    """
    names = [option.opts[0] for option in _options_of(command, context)]
    end = words.index("--") if "--" in words else len(words)
    read = list(words)
    for place in reversed(range(end)):
        if read[place] not in DEFAULTS or read[place] not in names:
            continue
        default, kinds = DEFAULTS[read[place]]
        following = read[place + 1 : place + 2]
        if following and not following[0].startswith("-"):
            stated = [*read[:place], f"{read[place]}={following[0]}", *read[place + 2 :]]
            given = command.make_parser(context).parse_args(list(stated))[0]
            if following[0] in kinds() or any(
                isinstance(given.get(one.name), str) for one in _arguments(command, context)
            ):
                read = stated
                continue
        read[place] = f"{read[place]}={default}"
    return read


def _refuse_missing_values(command: Any, context: Any, words: Sequence[str]) -> None:
    """Refuse an option that takes a value, followed by another option."""
    takes = {name: option for option in _options_of(command, context) for name in option.opts}
    before = ""
    for word in words:
        if word == "--":
            return
        option = takes.get(before)
        if option is not None and not option.is_flag:
            if word in takes and word.startswith("--"):
                context.fail(_needs(command, before, context))
            before = ""
        else:
            before = word
    if before in takes and not takes[before].is_flag:
        context.fail(_needs(command, before, context))


def _refuse_second_values(command: Any, context: Any, words: Sequence[str]) -> None:
    """Refuse an option of one value that is given twice; those of several values and settings add up."""
    *_, order = command.make_parser(context).parse_args(list(words))
    given = Counter(parameter.name for parameter in order)
    for option in _options_of(command, context):
        if given[option.name] > 1 and not option.is_flag and not option.multiple:
            context.fail(f"{option.opts[0]} is given twice; one is needed")


def _in_options(command: Any, message: str) -> str:
    """Return a message with options of the command in place of the parameters of Python."""
    names: dict[str, str] = {}
    for parameter in command.params:
        for option in reversed([o for o in parameter.opts if o.startswith("--")]):
            names[option[2:].replace("-", "_")] = option
            names[parameter.name] = option
    plain = {name: option for name, option in names.items() if "_" in name}
    if not plain:
        return message
    return re.sub(
        rf"(?<![\w.'/-])({'|'.join(map(re.escape, plain))})(?![\w.'/=(-])", lambda m: plain[m[1]], message
    )


def _panels(command: Any, context: Any) -> dict[str, list[tuple[str, str]]]:
    """Return the arguments and the options by the titles of their groups, general groups last."""
    panels: dict[str, list[tuple[str, str]]] = {}
    for parameter in (*_arguments(command, context), *_shown_options(command, context)):
        title = (
            "Arguments"
            if parameter.param_type_name == "argument"
            else getattr(parameter, "rich_help_panel", None) or "Options"
        )
        panels.setdefault(title, []).append((_label(parameter), _help_text(parameter, context)))
    for last in ("Output", "Options"):
        if rows := panels.pop(last, []):
            panels["Other options" if last == "Options" and {*panels} - {"Arguments"} else last] = rows
    return panels


def _arguments(command: Any, context: Any) -> list[Any]:
    return [p for p in command.get_params(context) if p.param_type_name == "argument"]


def _label(parameter: Any) -> str:
    """Return an argument or an option with its value as the help shows it, without its aliases."""
    if parameter.param_type_name == "argument":
        return str(parameter.metavar or parameter.name.upper())
    names = sorted((name for name in parameter.opts if not name.startswith("--")), key=len)
    names.append(next(name for name in parameter.opts if name.startswith("--")))
    return ", ".join(names) if parameter.is_flag else f"{', '.join(names)} {parameter.metavar}"


def _help_text(parameter: Any, context: Any) -> str:
    record = parameter.get_help_record(context)
    return " ".join(record[1].split()) if record else ""


class _Strapgen(PlainGroup):
    """The program itself."""

    def listed(self) -> dict[str, dict[str, str]]:
        """Return all commands, of which those that a command line does not need are not imported."""
        return help_layout.commands()

    def get_help(self, ctx: Any) -> str:
        """Return the help of the program."""
        return help_layout.program_help()


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


def run(words: Sequence[str]) -> Any:
    """Run a command line, or complete it where a shell asks for that, and return its exit status."""
    _add_asked(words)
    return _app(words, prog_name="strapgen", standalone_mode=False)


def _show_versions(chosen: bool) -> None:
    if not chosen or completion.is_asked():
        return
    from strapgen.run.compiler import versions

    typer.echo("\n".join(f"{name} {version}" for name, version in versions().items()))
    raise typer.Exit


@_app.callback()
def _program_options(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", "-V", callback=_show_versions, is_eager=True)] = False,
    verbose: Annotated[bool, typer.Option("--verbose")] = False,
    quiet: Annotated[bool, typer.Option("--quiet")] = False,
) -> None:
    if quiet:
        context.call_on_close(terminal.silence())
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


def _add_asked(words: Sequence[str]) -> None:
    """Add only the command of a command line; all commands if that is not enough or a shell asks for one."""
    asked = next((word for word in words if not word.startswith("-")), "")
    if asked not in _OWN and (asked or completion.is_asked()):
        _add_own(*_OWN)
    elif asked:
        _add_own(asked, *(name for name in _OWN if name.startswith(f"{asked} ")))
    if asked not in _OWN or asked in _groups:
        for name, command, function in registration.installed_commands():
            if not isinstance(function, InputError):
                _add(name, command, function)
