"""Groups of options: declared once, shown in the place and the order that a command states."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from typing import Annotated

import pytest
import typer
from typer.main import get_command

from strapgen.cli import app
from strapgen.cli.option_groups import Shown, grouped
from strapgen.lab.simulate.sample_source import SampleSource

Speed = Annotated[str, typer.Option("--speed", help="Speed in m/s.")]
Course = Annotated[str | None, typer.Option("--course", help="Course in deg.")]


@dataclass(frozen=True)
class Motion:
    """Options of a motion."""

    speed: Speed = "1"
    course: Course = None


def names(command) -> list[str]:
    return list(inspect.signature(command).parameters)


def test_a_group_is_handed_over_as_one_object(capsys):
    @grouped
    def go(where: Annotated[str, typer.Argument()], *, motion: Motion, twice: bool = False) -> None:
        typer.echo(f"{where} {motion} {twice}")

    application = typer.Typer()
    application.command()(go)
    application(["home", "--course", "90", "--twice"], standalone_mode=False)
    assert capsys.readouterr().out == f"home {Motion('1', '90')} True\n"
    assert names(go) == ["where", "speed", "course", "twice"]


def test_a_command_may_show_some_options_in_its_own_order_and_place():
    @grouped
    def only(*, motion: Annotated[Motion, Shown(only=("course",))]) -> Motion:
        return motion

    assert names(only) == ["course"]
    assert only(course="3") == Motion("1", "3")

    @grouped
    def turned(
        *, first: int = 1, motion: Annotated[Motion, Shown(("course", "speed"), before="first")]
    ) -> None: ...

    assert names(turned) == ["course", "speed", "first"]


def test_a_mistake_in_a_command_is_told_when_it_is_declared():
    with pytest.raises(TypeError, match="two options of a command are named speed"):

        @grouped
        def twice(*, speed: Speed = "1", motion: Motion) -> None: ...

    with pytest.raises(TypeError, match="Motion has no option height"):

        @grouped
        def unknown(*, motion: Annotated[Motion, Shown(only=("height",))]) -> None: ...


def commands(group, path=()):
    """Yield every command of the program with its name."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, (*path, name))
        else:
            yield " ".join((*path, name)), command


def test_every_option_of_every_command_says_what_it_is():
    checked = 0
    for name, command in commands(get_command(app)):
        for parameter in command.params:
            text = getattr(parameter, "help", None)
            assert text and text.endswith((".", "]", "...")), f"{name} {parameter.name}: {text!r}"
            checked += 1
    assert checked > 100


def test_one_option_is_the_same_in_every_command_that_shares_its_group():
    shown = {}
    for name, command in commands(get_command(app)):
        if name in ("simulate", "compare"):
            shown[name] = [
                (p.name, p.opts, p.help)
                for p in command.params
                if p.name in inspect.get_annotations(SampleSource)
            ]
    assert shown["simulate"] == shown["compare"]
    assert len(shown["simulate"]) == 16
