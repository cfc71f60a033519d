"""Help of commands as plain text as wide as the terminal, and explanations of wrong words in one line."""

from __future__ import annotations

import re
import shutil
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from typer.core import TyperCommand, TyperGroup

from strapgen.ir.exceptions import StrapgenError
from strapgen.ir.suggestions import alternatives, suggestions

#: Narrowest and widest help in characters.
_NARROWEST, _WIDEST = 40, 100
#: A space at which no line ends, and the longest remark in brackets that is on one line.
_SPACE, _MOST_REMARK = "\0", 30
#: Widest column of options; the help of a longer one begins on the next line.
_MOST_OPTION = 26


class PlainCommand(TyperCommand):
    """A command whose help is plain text and whose messages name its options."""

    def get_help(self, ctx: Any) -> str:
        """Return usage, text, examples, arguments, and the options in their groups."""
        return "\n".join(_help(self, ctx))

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the command line; an option's name is not the value of the option before it."""
        _refuse_missing_values(self, ctx, args)
        return list(super().parse_args(ctx, args))

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
    """A group of commands, which its help lists under headings."""

    #: Headings and their commands; a command that is listed nowhere is not shown.
    headings: ClassVar[dict[str, list[str]]] = {}
    #: Summaries of commands that are known without them.
    summaries: ClassVar[dict[str, str]] = {}

    def get_help(self, ctx: Any) -> str:
        """Return usage, text, options and the commands under their headings."""
        headings = self.headings or {"Commands": list(self.commands)}
        lines = _help(self, ctx)
        width = max(len(name) for names in headings.values() for name in names)
        for heading, names in headings.items():
            rows = [
                (name, self.summaries.get(name) or _summary(self.commands[name].help or "")) for name in names
            ]
            lines += ["", f"{heading}:", *_definitions(rows, width)]
        return "\n".join(lines)


@dataclass(frozen=True)
class CommandHelp:
    """The help of a command before it is laid out."""

    usage: str  # the command with its arguments, as it is typed
    paragraphs: tuple[str, ...]  # the text without its examples, each paragraph in one line
    examples: tuple[str, ...]  # whole commands, each in one line
    panels: Mapping[str, Sequence[tuple[str, str]]]  # arguments and options with their help, by group


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
    command = context and context.command
    name = getattr(error, "option_name", None)
    if said.startswith(("No such command", "Missing command")):
        known = [each for names in _headings(command).values() for each in names]
        word = re.search(r"'(.*?)'", said)
        meant = suggestions("command", word[1], known) if word else []
        return f"{said.split('.')[0]}{_question(meant)}. Allowed: {', '.join(known)}."
    parameter = getattr(error, "param", None)
    if parameter is not None and said.startswith("Missing "):
        name = parameter.opts[0] if parameter.param_type_name == "option" else _label(parameter)
        return f"Missing {parameter.param_type_name} '{name}': {_meaning(parameter, context)}"
    if name is not None and command is not None and said.startswith("No such option"):
        known = [option.opts[0] for option in _options(command, context)]
        return f"No such option: {name}{_question(suggestions('option', name, known))}; --help shows all"
    return said


def _question(meant: list[str]) -> str:
    return f" (did you mean {alternatives(meant)}?)" if meant else ""


def _headings(group: Any) -> dict[str, tuple[str, ...]]:
    headings: dict[str, tuple[str, ...]] = getattr(group, "headings", {})
    return headings or {"Commands": tuple(getattr(group, "commands", {}))}


def _needs(command: Any, name: str, context: Any) -> str:
    """Return the message that an option lacks its value, with its help."""
    option = next(option for option in _options(command, context) if name in option.opts)
    return f"{name} needs a value, {option.metavar}: {_meaning(option, context)}"


def _meaning(parameter: Any, context: Any) -> str:
    """Return the help of a parameter, to stand behind a colon."""
    text = re.sub(r"\s*\[.*\]$", "", _help_text(parameter, context)).rstrip(".")
    return text if text[1:2].isupper() else f"{text[:1].lower()}{text[1:]}"


def _options(command: Any, context: Any) -> list[Any]:
    return [
        p
        for p in command.get_params(context)
        if p.param_type_name == "option" and not getattr(p, "hidden", False)
    ]


def _refuse_missing_values(command: Any, context: Any, words: Sequence[str]) -> None:
    """Refuse an option that takes a value, followed by another option."""
    takes = {name: option for option in _options(command, context) for name in option.opts}
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


def _help(command: Any, context: Any) -> list[str]:
    parts = help_parts(command, context)
    lines = [*_filled(f"Usage: {parts.usage}", "", "       "), "", *_text(parts)]
    labels = [label for rows in parts.panels.values() for label, _ in rows]
    width = min(_MOST_OPTION, _width() // 3, max(map(len, labels)))
    for title, rows in parts.panels.items():
        lines += ["", f"{title}:", *_definitions(rows, width)]
    return lines


def _panels(command: Any, context: Any) -> dict[str, list[tuple[str, str]]]:
    """Return the arguments and the options by the titles of their groups, general groups last."""
    panels: dict[str, list[tuple[str, str]]] = {}
    for parameter in (*_arguments(command, context), *_options(command, context)):
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


def _unbroken(remark: str, room: int) -> str:
    """Return a remark in which no line ends, if it is short enough."""
    return remark.replace(" ", _SPACE) if len(remark) <= room else remark


def _summary(text: str) -> str:
    """Return the first sentence of a help text, without its full stop."""
    first = " ".join(text.strip().split("\n\n")[0].split())
    return re.split(r"\.(?: |$)", first)[0]


def _definitions(rows: Sequence[tuple[str, str]], width: int) -> list[str]:
    """Return terms with their explanations beside them, or below a term that is too long."""
    lines: list[str] = []
    rest = " " * (width + 4)
    for term, meaning in rows:
        fits = len(term) <= width
        head = f"  {term}{' ' * (width - len(term))}  " if fits else rest
        lines += ([] if fits else [f"  {term}"]) + (_filled(meaning, head, rest) or [head.rstrip()])
    return lines


def _text(parts: CommandHelp) -> list[str]:
    """Return the paragraphs of a help text, the examples under a heading of their own at its end."""
    lines: list[str] = []
    for part in parts.paragraphs:
        lines += ["", *_filled(part, "  ", "  ")]
    if parts.examples:
        lines += ["", "Examples:" if len(parts.examples) > 1 else "Example:"]
    for command in parts.examples:
        lines += ["", *_command_lines(command)]
    return lines[1:]


def _command_lines(command: str) -> list[str]:
    """Return a command on lines that end in a backslash where it goes on; an option and its values stay together."""
    width = _width() - 2
    lines = [" "]
    for chunk in _chunks(command):
        if len(lines[-1]) + 1 + len(chunk) > width and lines[-1].strip():
            lines[-1] += " \\"
            lines.append("   ")
        lines[-1] += f" {chunk}"
    return lines


def _chunks(command: str) -> Iterator[str]:
    chunk: list[str] = []
    for word in command.split():
        if word.startswith("--") and chunk:
            yield " ".join(chunk)
            chunk = []
        chunk.append(word)
    yield " ".join(chunk)


def _filled(text: str, first: str, rest: str) -> list[str]:
    """Return a text in lines as wide as the terminal; names with hyphens stay whole."""
    room = min(_MOST_REMARK, _width() - len(rest))
    whole = re.sub(r"\[(?:default|required)[^]]*\]", lambda m: _unbroken(m[0], room), text)
    lines = textwrap.wrap(
        whole,
        _width(),
        initial_indent=first,
        subsequent_indent=rest,
        break_on_hyphens=False,
        break_long_words=False,
    )
    return [line.replace(_SPACE, " ") for line in lines]


def _width() -> int:
    return max(_NARROWEST, min(_WIDEST, shutil.get_terminal_size().columns))
