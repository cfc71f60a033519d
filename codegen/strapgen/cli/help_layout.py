"""The help of the program, and the layout of all help as plain text; Typer is not imported for it."""

from __future__ import annotations

import re
import shutil
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from strapgen import registration
from strapgen.ir.exceptions import InputError


class CommandHelp(NamedTuple):
    """The help of a command before it is laid out."""

    usage: str  # the command with its arguments, as it is typed
    paragraphs: tuple[str, ...]  # the text without its examples, each paragraph in one line
    examples: tuple[str, ...]  # whole commands, each in one line
    panels: Mapping[str, Sequence[tuple[str, str]]]  # arguments and options with their help, by group


#: Headings of the commands in their order.
HEADINGS = ("Derive", "Generate", "Run", "Analyse", "Reproduce")
#: The program itself.
PROGRAM = CommandHelp(
    usage="strapgen [OPTIONS] COMMAND [ARGS]...",
    paragraphs=(
        "Derive strapdown attitude algorithms, generate numpy and C code for them, and test it against truth.",
        "strapgen help COMMAND shows the help of a command.",
    ),
    examples=(
        "strapgen simulate euler --backend c --motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 "
        "--step 0.125 --duration 180",
    ),
    panels={
        "Options": (
            ("-V, --version", "Show the versions of strapgen and of what its output depends on."),
            ("--verbose", "Show on stderr how long each stage takes, and what comes from the cache."),
            ("--quiet", "Show neither progress nor remarks on stderr; errors stay."),
            ("--install-completion", "Install completion for the current shell."),
            (
                "--show-completion",
                "Show completion for the current shell, to copy it or customize the installation.",
            ),
            ("-h, --help", "Show this message and exit."),
        )
    },
)


#: Five jobs, each with a command that runs as it stands.
_JOBS = {
    "derive": ("the formulas of an attitude step", "strapgen derive euler --method rk4 --increments 2"),
    "generate": ("its code in C", "strapgen generate euler --method rk4 --target c --out firmware"),
    "simulate": (
        "its errors against a known attitude",
        "strapgen simulate euler --motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 --step 0.125 --duration 180",
    ),
    "compare": (
        "its code in numpy, C and fixed point side by side",
        "strapgen compare euler --motion constant --set x_deg_s=10 --step 0.01 --duration 1",
    ),
    "series": ("the error of a step as a power series", "strapgen series euler --method rk4"),
}


def first_steps() -> str:
    """Return the five main jobs of strapgen, for a command line without words."""
    lines = [*_fill(PROGRAM.paragraphs[0], "", "")]
    for name, (what, command) in _JOBS.items():
        lines += ["", *_fill(f"{name}: {what}", "", "  "), *_command_lines(command)]
    return "\n".join([*lines, "", "strapgen --help shows all commands and options."])


def program_help() -> str:
    """Return the help of the program."""
    return lay_out(PROGRAM, commands())


def commands() -> dict[str, dict[str, str]]:
    """Return the commands that the help lists with their summaries, by heading."""
    listed: dict[str, dict[str, str]] = {heading: {} for heading in HEADINGS}
    for one in registration.built_in().values():
        for name, command in one.commands.items():
            if command.heading:
                listed.setdefault(command.heading, {})[name] = command.summary
    for name, command, function in registration.installed_commands():
        if command.heading and not isinstance(function, InputError):
            group = getattr(function, "registered_callback", None)
            text = command.summary or summary((group.callback if group else function).__doc__ or "")
            listed.setdefault(command.heading, {}).setdefault(name, text)
    return listed


def lay_out(parts: CommandHelp, commands: Mapping[str, Mapping[str, str]]) -> str:
    """Return the text of a help; `commands` are those of a group with their summaries, by heading."""
    lines = [*_fill(f"Usage: {parts.usage}", "", "       "), "", *_text(parts)]
    labels = [label for rows in parts.panels.values() for label, _ in rows]
    width = min(_MOST_OPTION, _width() // 3, max(map(len, labels)))
    for title, rows in parts.panels.items():
        lines += ["", f"{title}:", *_definitions(rows, width)]
    width = max((len(name) for summaries in commands.values() for name in summaries), default=0)
    for heading, summaries in commands.items():
        lines += ["", f"{heading}:", *_definitions([*summaries.items()], width)]
    return "\n".join(lines)


def summary(text: str) -> str:
    """Return the first sentence of a help text, without its full stop."""
    first = " ".join(text.strip().split("\n\n")[0].split())
    return re.split(r"\.(?: |$)", first)[0]


#: Narrowest and widest help in characters.
_NARROWEST, _WIDEST = 40, 100
#: A space at which no line ends, and the longest remark in brackets that is on one line.
_SPACE, _MOST_REMARK = "\0", 30
#: Widest column of options; the help of a longer one begins on the next line.
_MOST_OPTION = 26


def _definitions(rows: Sequence[tuple[str, str]], width: int) -> list[str]:
    """Return terms with their explanations beside them, or below a term that is too long."""
    lines: list[str] = []
    rest = " " * (width + 4)
    for term, meaning in rows:
        fits = len(term) <= width
        head = f"  {term}{' ' * (width - len(term))}  " if fits else rest
        lines += ([] if fits else [f"  {term}"]) + (_fill(meaning, head, rest) or [head.rstrip()])
    return lines


def _text(parts: CommandHelp) -> list[str]:
    """Return the paragraphs of a help text, the examples under a heading of their own at its end."""
    lines: list[str] = []
    for part in parts.paragraphs:
        lines += ["", *_fill(part, "  ", "  ")]
    if parts.examples:
        lines += ["", "Examples:" if len(parts.examples) > 1 else "Example:"]
    for command in parts.examples:
        lines += ["", *_command_lines(command)]
    return lines[1:]


def _on_one_line(remark: str, room: int) -> str:
    """Return a remark in which no line ends, if it is short enough."""
    return remark.replace(" ", _SPACE) if len(remark) <= room else remark


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


def _fill(text: str, first: str, rest: str) -> list[str]:
    """Return a text in lines as wide as the terminal; names with hyphens stay whole."""
    room = min(_MOST_REMARK, _width() - len(rest))
    whole = re.sub(r"\[(?:default|required)[^]]*\]", lambda m: _on_one_line(m[0], room), text)
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
