"""What ``strapgen --help`` prints, from what is registered: no command and no library is imported for it."""

from __future__ import annotations

from strapgen import registration
from strapgen.cli.help_layout import CommandHelp, lay_out, summary
from strapgen.ir.exceptions import InputError

#: Headings of the commands in their order.
HEADINGS = ("Derive", "Generate", "Run", "Analyse", "Reproduce")
#: The program itself.
PROGRAM = CommandHelp(
    usage="strapgen [OPTIONS] COMMAND [ARGS]...",
    paragraphs=(
        "Derive strapdown attitude algorithms, generate numpy and C code for them, and test it against truth.",
    ),
    examples=(
        "strapgen simulate euler --backend c --motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 "
        "--step 0.125 --duration 180",
    ),
    panels={
        "Options": (
            ("--version", "Show the versions of strapgen and of what its output depends on."),
            ("--verbose", "Show on stderr how long each stage takes, and what comes from the cache."),
            ("--install-completion", "Install completion for the current shell."),
            (
                "--show-completion",
                "Show completion for the current shell, to copy it or customize the installation.",
            ),
            ("-h, --help", "Show this message and exit."),
        )
    },
)


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


def text() -> str:
    """Return the help of the program."""
    return lay_out(PROGRAM, commands())
