"""The command ``strapgen build``: generates the variants of strapgen.toml, or checks what is there."""

from __future__ import annotations

from typing import Annotated

import typer

from strapgen.cli import terminal
from strapgen.cli.option_groups import grouped
from strapgen.cli.options import argument, option
from strapgen.cli.output import Format, check_format, show
from strapgen.ir import checks


@grouped
def build(
    variants: Annotated[
        list[str] | None,
        argument("NAME...", help="Variants.  [default: all]", words="@cli.variants"),
    ] = None,
    *,
    check: Annotated[
        bool,
        option(
            "--check",
            help="Write nothing; exit with 1 if a file is out of step, or a check of the variant fails.",
        ),
    ] = False,
    format: Format = "text",
) -> None:
    """Generate the variants of strapgen.toml, or check them.

    The file is the nearest strapgen.toml, here or above, or the table tool.strapgen of a pyproject.toml. Every step is
    a command that you can run by itself. With --check the files are compared, the C is verified, its vectors are run,
    its cost is held to the limits and evidence is collected, as far as the variant asks.

    Example: strapgen build --check
    """
    check_format(format)
    from strapgen.variants import build as steps_of
    from strapgen.variants import variant_file

    known = variant_file.variants()
    chosen = [known[checks.choice("variant", name, known)] for name in variants or known]
    done = []
    for step in steps_of.build(chosen, check):
        done.append(step)
        if format == "text":
            terminal.write(step.line)
    result = steps_of.BuildResult(tuple(done), all(step.holds for step in done))
    show(result, format)
    if not result.holds:
        raise typer.Exit(1)
