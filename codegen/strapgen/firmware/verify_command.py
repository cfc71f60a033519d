"""The command ``strapgen verify`` verifies a generated C file against the command and the contract in its header."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from strapgen.cli.option_groups import Shown, grouped, stated
from strapgen.cli.options import option
from strapgen.cli.output import TEXT_OUTPUT, Output
from strapgen.ir.exceptions import InputError
from strapgen.lab.compare_command import RunDiffering
from strapgen.lab.run_options import SampleSource


@grouped
def verify(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="Source or header in C that strapgen generated, or a folder with a system or two speeds.",
        ),
    ],
    *,
    algorithms: Annotated[
        tuple[str, ...] | None,
        option(
            "--algorithm",
            metavar="NAME,...",
            help="Your own algorithm that the header names; it runs as a program, and only if you name it here.",
            panel="Input",
        ),
    ] = None,
    run_differing: RunDiffering = False,
    source: SampleSource,
    output: Annotated[Output, Shown(only=TEXT_OUTPUT)],
) -> None:
    """Verify a generated C file against its header.

    The command in the header is parsed, the file is generated again in memory, and every line that differs is shown. A
    file without differences is then compiled and called on the corners of its ranges, on random input and along a run:
    in fixed point it must return the integers of the model, and stay within the certified bound of arithmetic with 40
    digits. The run is a cone, or the motion or recording that the options state. The exit status is 1 on failure.

    FILE may be the folder, or the main header, of a described system, an algorithm in two speeds, a commit-late unit or
    of stamped samples: all files are then compared, and every stage is called. Of the header in C++ of a preintegration
    the lines are compared.

    Example: strapgen verify generated/c_fixed/euler_rk4_2_w32.c
    """
    output.check(file, *source.files)
    from strapgen.firmware import header_command, verification

    header = verification.whole_header(file)
    if header is not None:
        if stated(source):
            raise InputError("a motion or a recording goes with the file of one function")
        output.check(header)
        return _verify_whole(header, algorithms or (), run_differing, output)
    request = header_command.header_command_of(file).request(algorithms or ())
    increments = None
    if stated(source):
        source.check()
        choice = request.choice
        increments = source.read(choice.increments_per_step, choice.previous, choice.ahead).increments
    result = verification.verify(file, request, increments, run_differing=run_differing)
    output.show(result)
    if not result.holds:
        raise typer.Exit(1)


def _verify_whole(header: Path, algorithms: tuple[str, ...], run_differing: bool, output: Output) -> None:
    """Verify the C of several functions and a whole that calls them; exit with 1 if it fails."""
    from strapgen.cli.progress import waiting
    from strapgen.firmware import header_command
    from strapgen.firmware.verification import verify_whole
    from strapgen.run.standard_tree import command_of

    with waiting(f"verifying {header.name}"):
        sources = header_command.read_file(header).whole(algorithms)
        commands = {
            name: command_of(text) or "" for name, text in sources.step_files.items() if name.endswith(".h")
        }
        stages = {
            name: header_command.read(command).request(algorithms)
            for name, command in commands.items()
            if command.startswith("strapgen generate ")
        }
        result = verify_whole(header, sources, stages, run_differing=run_differing)
    output.show(result)
    if not result.holds:
        raise typer.Exit(1)
