"""Groups of options: declared once, shown in the place and the order that a command states."""

from __future__ import annotations

import dataclasses
import inspect
import pickle
from copy import deepcopy
from dataclasses import dataclass
from fractions import Fraction
from typing import Annotated, Any

import pytest
import typer
from typer.main import get_command

from strapgen.cli import app
from strapgen.cli.option_groups import Excludes, Needs, OneOf, Shown, _fields, grouped, rules
from strapgen.cli.options import option
from strapgen.cli.values import NotNegative, Number, Positive, Vector, names, whole, written
from strapgen.ir.exceptions import InputError
from strapgen.lab.run_options import SampleSource

Speed = Annotated[str, typer.Option("--speed", help="Speed in m/s.")]
Course = Annotated[str | None, typer.Option("--course", help="Course in deg.")]


@dataclass(frozen=True)
class Motion:
    """Options of a motion."""

    speed: Speed = "1"
    course: Course = None


def parameters(command) -> list[str]:
    return list(inspect.signature(command).parameters)


def test_a_group_is_handed_over_as_one_object(capsys):
    @grouped
    def go(where: Annotated[str, typer.Argument()], *, motion: Motion, twice: bool = False) -> None:
        typer.echo(f"{where} {motion} {twice}")

    application = typer.Typer()
    application.command()(go)
    application(["home", "--course", "90", "--twice"], standalone_mode=False)
    assert capsys.readouterr().out == f"home {Motion('1', '90')} True\n"
    assert parameters(go) == ["where", "speed", "course", "twice", "variant"]


def test_a_command_may_show_some_options_in_its_own_order_and_place():
    @grouped
    def only(*, motion: Annotated[Motion, Shown(only=("course",))]) -> Motion:
        return motion

    assert parameters(only) == ["course", "variant"]
    assert only(course="3") == Motion("1", "3")

    @grouped
    def turned(
        *, first: int = 1, motion: Annotated[Motion, Shown(("course", "speed"), before="first")]
    ) -> None: ...

    assert parameters(turned) == ["course", "speed", "first", "variant"]


def test_values_have_the_types_of_their_options():
    """A text is read once; what prints a value shows the text."""

    @grouped
    def go(
        *,
        count: Annotated[int | None, option("--count", help=".", read=whole(1, 9))] = None,
        rates: Annotated[tuple[Positive, ...], option("--rate", help=".")] = (Positive("1/4"),),
        origin: Annotated[Vector | None, option("--origin", help=".")] = None,
        sizes: Annotated[dict[str, Fraction] | None, option("--size", help=".")] = None,
        kind: Annotated[str, option("--kind", help=".", read=names(("round", "flat")))] = "flat",
    ) -> dict[str, Any]:
        return {"count": count, "rates": rates, "origin": origin, "sizes": sizes, "kind": kind}

    assert go() == {"count": None, "rates": (Fraction(1, 4),), "origin": None, "sizes": None, "kind": "flat"}
    read = go(count="3", rates="0.50,1/3", origin="1,-2,0", sizes=["a=1/3", "b=2"], kind="round")
    assert read == {
        "count": 3,
        "rates": (Fraction(1, 2), Fraction(1, 3)),
        "origin": (1, -2, 0),
        "sizes": {"a": Fraction(1, 3), "b": 2},
        "kind": "round",
    }
    assert written(read["rates"]) == "0.50,1/3"
    for words, refusal in (
        ({"count": "1_0"}, "--count is '1_0'; a whole number is needed"),
        ({"count": "10"}, "--count is 10; a whole number from 1 to 9 is needed"),
        ({"rates": "1,0"}, "--rate is 0; a number above 0 is needed"),
        ({"rates": ","}, "--rate is ','; at least one value is needed"),
        ({"origin": "1,2"}, "--origin is '1,2'; three numbers with commas between are needed"),
        ({"sizes": ["a"]}, "--size 'a' is no setting; NAME=VALUE is needed"),
        ({"sizes": ["a=1", "a=2"]}, "--size a is given twice; one is needed"),
        ({"sizes": ["a=x"]}, "--size a is 'x'; a finite number is needed"),
        ({"kind": "round,flat"}, "--kind round,flat is a list; one name is needed here"),
        ({"kind": "square"}, "kind 'square' is not known; allowed: round, flat"),
    ):
        with pytest.raises(InputError) as error:
            go(**words)
        assert str(error.value) == refusal


def test_number_is_exact_and_keeps_its_text():
    number = Positive.read("--step", "0.10")
    assert number == Fraction(1, 10) and number > 0.05 and not number > 0.2
    for same in (number, pickle.loads(pickle.dumps(number)), deepcopy(number)):
        assert (type(same), same, str(same)) == (Positive, Fraction(1, 10), "0.10")
    assert type(number + 1) is Fraction and NotNegative.read("--noise", "0") == 0
    for kind, text in ((Positive, "0"), (NotNegative, "-1e-9"), (Number, "1e999"), (Number, "1_0")):
        with pytest.raises(InputError, match="--x is"):
            kind.read("--x", text)


def test_rules_refuse_conflicting_options():
    @grouped
    @rules(
        OneOf("--speed --pace", needed="--speed is needed, or --pace"),
        Needs("--course=north|south --twice --height", "--speed --course=east"),
        Excludes("--all", "@motion --twice", reason="--all goes everywhere"),
    )
    def go(
        *,
        motion: Motion,
        pace: Annotated[str | None, option("--pace", help=".")] = None,
        twice: Annotated[bool, option("--twice", help=".")] = False,
        height: Annotated[int | None, option("--height", help=".")] = None,
        everywhere: Annotated[bool, option("--all", help=".")] = False,
    ) -> str:
        return "gone"

    for words in ({}, {"course": "north"}, {"speed": None, "pace": "1", "course": "east", "twice": True}):
        assert go(**words) == "gone", "a default is given, but not stated"
    for words, refusal in (
        ({"speed": None}, "--speed is needed, or --pace"),
        ({"pace": "2"}, "--speed and --pace are both given; one is needed"),
        ({"speed": None, "pace": "2", "course": "south"}, "--course south needs --speed or --course east"),
        ({"speed": None, "pace": "2", "twice": True}, "--twice needs --speed or --course east"),
        ({"speed": None, "pace": "2", "height": "0"}, "--height needs --speed or --course east"),
        ({"everywhere": True, "course": "west"}, "--all goes everywhere; --course does not go with it"),
    ):
        with pytest.raises(InputError) as error:
            go(**words)
        assert str(error.value) == refusal
    assert go(everywhere=True) == "gone"


def test_rules_name_options_of_their_commands():
    checked = 0
    for name, command in commands(get_command(app)):
        options = command.callback.__dict__["options"]
        tables = [(options.rules, {one.spelling for one in options.options.values()})]
        tables += [
            (getattr(group.kind, "rules", ()), {one.spelling for one in _fields(group.kind, ())})
            for group in options.groups.values()
        ]
        for table, known in tables:
            for rule in table:
                for condition in " ".join(
                    rule.options if isinstance(rule, OneOf) else " ".join(rule[:2]) for rule in [rule]
                ).split():
                    spelling = condition.partition("=")[0]
                    assert spelling in known or spelling[1:] in options.groups, (name, condition)
                    checked += 1
    assert checked > 100


def test_mistakes_in_a_command_are_found_at_declaration():
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


def test_every_option_of_every_command_has_help():
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
                if p.name in {field.name for field in dataclasses.fields(SampleSource)}
            ]
    assert shown["simulate"] == shown["compare"]
    assert len(shown["simulate"]) == 24
