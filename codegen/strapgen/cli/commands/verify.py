"""The command ``strapgen verify`` holds a generated C file to the command and the contract in its header."""

from __future__ import annotations

import shlex
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from strapgen.cli.help import PlainCommand
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.output import TEXT_OUTPUT, Output
from strapgen.cli.sample_source import SampleSource
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.library.generation import Request


@grouped
def verify(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="Source or header in C that strapgen generated, or a folder of a system."
        ),
    ],
    *,
    source: SampleSource,
    output: Annotated[Output, Shown(only=TEXT_OUTPUT)],
) -> None:
    """Verify that a generated C file is what its header says.

    The exit status is 1 if it is not. The command in the header is run again, and every line that differs is shown.
    Then the file itself is compiled and called on corners, on random input and along a run: in fixed point it must
    return the integers of the model, and stay within the certified bound of arithmetic with 40 digits. The run is a
    cone, or what --motion or a recording says.

    Of a described system, a folder or the header of the whole, all files are compared, and every stage is called.

    Example: strapgen verify generated/c_fixed/euler_rk4_2_w32.c
    """
    output.check(file, source.increments_csv, source.rates_csv)
    from strapgen.experiments import verification
    from strapgen.experiments.systems.verification import system_header
    from strapgen.reports.verification import verification_report

    header = system_header(file)
    if header is not None:
        from strapgen.cli.systems.verifying import verified_system

        return verified_system(header, source, output, request_of)
    request = request_of(file)
    increments = None
    if source.stated:
        source.check()
        choice = request.choice
        increments = source.read(choice.increments_per_step, choice.previous, choice.ahead).increments
    result = verification.verify(file, request, increments)
    output.report(verification_report(result))
    if not result.holds:
        raise typer.Exit(1)


def request_of(file: Path) -> Request:
    """Return what the command in the header of a generated file asks for."""
    from strapgen.experiments import verification
    from strapgen.library.generated_files import command_of, text_of

    header, _ = verification.paths_of(file)
    return read_command(command_of(text_of(header)) or "")


def read_command(command: str) -> Request:
    """Return what a command ``strapgen generate`` asks for.

    Raises
    ------
    InputError
        If it is another command.
    """
    from typer.main import get_command

    from strapgen.cli.commands import generate
    from strapgen.cli.fixed_options import FixedOptions
    from strapgen.cli.options import KernelOptions
    from strapgen.cli.source_options import SourceOptions

    words = shlex.split(command)
    if words[:2] != ["strapgen", "generate"]:
        raise InputError(
            f"'{command}' does not generate one function; verify takes the files of strapgen generate, and so "
            "each loop of an algorithm in two speeds"
        )
    alone = typer.Typer()
    alone.command(cls=PlainCommand)(generate.generate)
    stated = get_command(alone).make_context("generate", words[2:]).params

    def group(kind: type[Any]) -> Any:
        values = {field.name: stated[field.name] for field in fields(kind)}
        return kind(**{name: None if value == () else value for name, value in values.items()})

    return generate.request(
        stated["algorithm"], group(KernelOptions), stated["target"], group(FixedOptions), group(SourceOptions)
    )
