"""Pages of the reference for the command line: every command, described by its ``--help``."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import typer.main

from strapgen.cli import app, help_layout
from strapgen.cli.help_layout import CommandHelp
from strapgen.cli.program import help_parts


def commands() -> dict[str, tuple[Any, CommandHelp]]:
    """Return every command that the help lists and what its help says, by its words after ``strapgen``."""
    root = typer.main.get_command(app)
    return dict(_walk(root, root.context_class(root, info_name="strapgen"), ""))


def _walk(group: Any, context: Any, before: str) -> Iterator[tuple[str, tuple[Any, CommandHelp]]]:
    for name, command in group.commands.items():
        if command.hidden:
            continue
        inner = command.context_class(command, info_name=name, parent=context)
        words = f"{before} {name}".strip()
        yield words, (command, help_parts(command, inner))
        if hasattr(command, "commands"):
            yield from _walk(command, inner, words)


def pages() -> dict[str, str]:
    """Return the pages of the reference for the command line in Markdown, by their names."""
    known = commands()
    texts = {name: _page(name, known) for name in known if " " not in name}
    return {"index": _index(known), **texts}


def _index(known: dict[str, tuple[Any, CommandHelp]]) -> str:
    about = "Every command with its arguments and options, as its `--help` shows them. "
    lines = ["# Commands", "", f"{about}[The command line](/command-line.md) shows them at work."]
    for heading, names in help_layout.commands().items():
        lines += ["", f"## {heading}", "", "| command | what it does |", "|---|---|"]
        for name in names:
            for words in (name, *(other for other in known if other.startswith(f"{name} "))):
                page, anchor = name, f"#{_anchor(words)}" if words != name else ""
                lines.append(
                    f"| [`{words}`]({page}.md{anchor}) | {_escaped(known[words][1].paragraphs[0])} |"
                )
    entries = [f"{name} <{name}>" for names in help_layout.commands().values() for name in names]
    return "\n".join([*lines, "", "```{toctree}", ":hidden:", "", *entries, "```", ""])


def _page(name: str, known: dict[str, tuple[Any, CommandHelp]]) -> str:
    lines = [f"# strapgen {name}", "", *_described(known[name][1], "##")]
    for words, (_, text) in known.items():
        if words.startswith(f"{name} "):
            lines += [f"## strapgen {words}", "", *_described(text, "###")]
    return "\n".join(lines)


def _described(text: CommandHelp, mark: str) -> list[str]:
    lines = [line for part in text.paragraphs for line in (_escaped(part), "")]
    lines += ["```bash", text.usage, "```", ""]
    if text.examples:
        lines += ["Examples:" if len(text.examples) > 1 else "Example:", ""]
        lines += ["```bash", *(_folded(example) for example in text.examples), "```", ""]
    for title, rows in text.panels.items():
        lines += [f"**{title}**", ""]
        for label, meaning in rows:
            lines += [f"`{label}`", f": {_escaped(meaning) or 'No more is said.'}", ""]
    return lines


def _folded(command: str) -> str:
    """Return a command on lines of no more than 88 characters, continued by backslashes before options."""
    lines = [""]
    for chunk in re.split(r" (?=--)", command):
        if lines[-1] and len(lines[-1]) + 1 + len(chunk) > 88:
            lines[-1] += " \\"
            lines.append("   ")
        lines[-1] = f"{lines[-1]} {chunk}" if lines[-1] else chunk
    return "\n".join(lines)


def _anchor(words: str) -> str:
    return f"strapgen-{words.replace(' ', '-')}"


def _escaped(text: str) -> str:
    """Return plain text so that Markdown shows it as it is, with options and file names as code."""
    plain = re.sub(r"([\\`*_{}\[\]<>|$~#])", r"\\\1", text)
    return re.sub(r"(?<![\w-])(--?[a-z][\w-]*)", lambda m: f"`{m[1]}`", plain)
