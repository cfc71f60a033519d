"""One rule of all commands for lists: commas between values, and a list or settings given again add up."""

import pytest
import typer
from typer.main import get_command

from strapgen.cli import app, main
from strapgen.cli.program import PlainCommand


def commands(group, path=()):
    """Yield all commands with their names."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, (*path, name))
        else:
            yield " ".join((*path, name)), command


COMMANDS = dict(commands(get_command(app)))
VALUED = [
    pytest.param(command, option, id=f"{name} {option.opts[0]}")
    for name, command in COMMANDS.items()
    for option in command.params
    if option.param_type_name == "option" and not option.is_flag
]


def is_several(option) -> bool:
    """Tell whether the help shows an option as one of several values or settings."""
    return option.metavar.endswith("...") or "=" in option.metavar


@pytest.mark.parametrize(("command", "option"), VALUED)
def test_an_option_given_twice_adds_up_or_is_refused(command: PlainCommand, option):
    assert option.multiple == is_several(option)
    words = [option.opts[0], "1", f"{option.opts[-1]}=2"]
    context = typer.Context(command, info_name="command")
    if option.multiple:
        values, *_ = command.make_parser(context).parse_args(words)
        assert values[option.name] == ["1", "2"]
        return
    with pytest.raises(Exception, match=f"^{option.opts[0]} is given twice; one is needed$"):
        command.parse_args(context, words)


def typed(command: str, words: list[str], parameter: str):
    """Return a value that a command line states for an option."""
    context = typer.Context(COMMANDS[command], info_name=command, resilient_parsing=True)
    COMMANDS[command].parse_args(context, words)
    option = COMMANDS[command].callback.options.options[parameter]
    return option.value(context.params[parameter])


@pytest.mark.parametrize(
    "words",
    [
        ["--method", "rk1,rk2,rk4"],
        ["--method", "rk1", "--method", "rk2,rk4"],
        ["--method=rk1", "--method", "rk2", "--method=rk4"],
        ["--method", "rk1, rk2,,rk4", "--method", "rk1"],
    ],
)
def test_a_list_is_the_same_however_it_is_given(words):
    assert typed("compare", words, "method") == ("rk1", "rk2", "rk4")


@pytest.mark.parametrize(
    "words", [["--set", "a=1,b_c=1/2"], ["--set", "a=1", "--set", "b_c=1/2"], ["--set", "a=1, b_c=1/2"]]
)
def test_settings_are_the_same_however_they_are_given(words):
    assert {name: str(value) for name, value in typed("simulate", words, "settings").items()} == {
        "a": "1",
        "b_c": "1/2",
    }


def test_a_setting_may_have_several_numbers():
    words = ["--constant", "k=1,2,3,m=4", "--constant", "n=5,6"]
    assert typed("derive", words, "constant") == {"k": "1,2,3", "m": "4", "n": "5,6"}


def test_a_setting_that_is_given_twice_is_refused(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["derive", "dcm", "--constant", "k=1,k=2"])
    assert (stop.value.code, capsys.readouterr().err) == (
        2,
        "strapgen: --constant k is given twice; one is needed\n",
    )


def test_a_variant_states_lists_as_a_command_line_does(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "strapgen.toml").write_text(
        '[variant.two]\nalgorithm = "dcm"\ntarget = ["numpy", "c"]\nmethod = "rk2"\n', encoding="utf-8"
    )
    with pytest.raises(SystemExit) as stop:
        main(["generate", "--variant", "two", "--out", "made"])
    assert not stop.value.code
    assert {path.suffix for path in (tmp_path / "made").iterdir()} == {".py", ".c", ".h"}
