"""The options --version and --verbose, which stand before the name of a command."""

from __future__ import annotations

import logging
from typing import Annotated

import typer


def _show(chosen: bool) -> None:
    if not chosen:
        return
    from strapgen.run.versions import versions

    typer.echo("\n".join(f"{name} {version}" for name, version in versions().items()))
    raise typer.Exit


def _log_stages(context: typer.Context) -> None:
    """Write the log of the stages to stderr until the command ends."""
    logger, handler = logging.getLogger("strapgen"), logging.StreamHandler()
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)

    def stop() -> None:
        logger.removeHandler(handler)
        logger.setLevel(level)

    context.call_on_close(stop)


def options(
    context: typer.Context,
    show_version: Annotated[
        bool,
        typer.Option(
            "--version",
            callback=_show,
            is_eager=True,
            help="Show the versions of strapgen and of what its output depends on.",
        ),
    ] = False,
    verbose: Annotated[
        bool,
        typer.Option(
            "--verbose", help="Show on stderr how long each stage takes, and what comes from the cache."
        ),
    ] = False,
) -> None:
    """Derive strapdown attitude algorithms, generate numpy and C code for them, and test it against truth.

    Example: strapgen simulate euler --backend c --motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10
    --step 0.125 --duration 180
    """
    if verbose:
        _log_stages(context)
