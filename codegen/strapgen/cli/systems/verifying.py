"""`verify` with the generated C of a described system."""

from __future__ import annotations

import contextlib
import io
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from strapgen.cli.commands import system
from strapgen.cli.help import PlainCommand
from strapgen.cli.sample_source import SampleSource
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.cli.output import Output
    from strapgen.library.generation import Request


def verified_system(
    header: Path, source: SampleSource, output: Output, request_of: Callable[[Path], Request]
) -> None:
    """Verify the C of a described system, and exit with 1 if it is not what its header says.

    Parameters
    ----------
    header : Path
        Header of the whole.
    source : SampleSource
        Must be empty: a system has no run of its own.
    output : Output
    request_of : callable
        Returns what the command in the header of a stage asks for.
    """
    if source.stated:
        raise InputError("a motion or a recording does not go with the files of a described system")
    output.check(header)
    from strapgen.cli.progress import waiting
    from strapgen.experiments.systems.verification import verify_system
    from strapgen.library.generated_files import command_of, text_of
    from strapgen.reports.verification import system_verification_report
    from strapgen.support.drafts import temporary_folder

    command = command_of(text_of(header)) or ""
    with temporary_folder() as folder, waiting(f"verifying {header.name}"):
        generated = _generate(command, folder, header)
        stages = {
            name: request_of(folder / name)
            for name, text in generated.items()
            if name.endswith(".h") and (command_of(text) or "").startswith("strapgen generate ")
            if f"{name[:-2]}.c" in generated and not name.endswith("_runs.h")
        }
        result = verify_system(header, generated, stages)
    output.report(system_verification_report(result))
    if not result.holds:
        raise typer.Exit(1)


def _generate(command: str, folder: Path, header: Path) -> dict[str, str]:
    """Run the command of a header into a folder, and return the files by name."""
    from typer.main import get_command

    from strapgen.library.generated_files import text_of

    words = shlex.split(command)[2:]
    runs = header.with_name(f"{header.stem}_runs.h").is_file()
    alone = typer.Typer()
    alone.command(cls=PlainCommand)(system.system)
    with contextlib.redirect_stdout(io.StringIO()):
        get_command(alone).main(
            [*words, "--out", str(folder), *(["--with-runs"] if runs else [])], standalone_mode=False
        )
    return {path.name: text_of(path) for path in sorted(folder.iterdir()) if path.is_file()}
