"""strapgen study."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from strapgen.cli.inputs import pairs
from strapgen.cli.options import Increments, check_format, whole
from strapgen.cli.progress import track
from strapgen.support.exceptions import InputError

app = typer.Typer(help="Sweep settings and see what they do to the drift.", rich_markup_mode=None)


@app.callback()
def _group() -> None:
    """Sweep settings and see what they do to the drift."""


@app.command("word-length")
def word_length(
    algorithm: Annotated[str, typer.Option("--algorithm", help="dcm, euler or cayley-klein.")] = "euler",
    methods: Annotated[
        str, typer.Option("--methods", metavar="NAME,...", help="Integration methods.")
    ] = "rk4",
    increments: Increments = None,
    words: Annotated[
        str, typer.Option("--words", metavar="BITS,...", help="Lengths of word, 8 to 64.")
    ] = "8,10,12,14,16,18,20,24,28,32",
    roundings: Annotated[
        str, typer.Option("--roundings", metavar="NAME,...", help="nearest, truncation.")
    ] = "nearest",
    carries: Annotated[
        str, typer.Option("--carries", metavar="NAME,...", help="Residuals kept: none, state, full.")
    ] = "none,state,full",
    steps: Annotated[str, typer.Option("--steps", metavar="S,...", help="Steps in s.")] = "0.125",
    pulses_arcsec: Annotated[
        str,
        typer.Option("--pulses-arcsec", metavar="ANGLE,...", help="Gyro pulses in arc seconds, 0 for none."),
    ] = "0",
    motion: Annotated[
        str, typer.Option("--motion", help="constant, sinusoidal, coning or polynomial.")
    ] = "coning",
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE...",
            help="Parameters of the motion.  [default: that of the thesis's table 5]",
            show_default=False,
        ),
    ] = None,
    duration: Annotated[str, typer.Option("--duration", metavar="S", help="Duration in s.")] = "180",
    jobs: Annotated[
        str | None,
        typer.Option(
            "--jobs", metavar="N", help="Processes.  [default: one a processor]", show_default=False
        ),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Image file for the plot.", show_default=False)
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="File for the output.  [default: the terminal]", show_default=False),
    ] = None,
    format: Annotated[str, typer.Option("--format", help="text, json or csv.")] = "text",
) -> None:
    """Drift against word length: every combination of word, rounding, carry, step, method and gyro pulse.

    The integer model runs each one on a motion with known attitude. Shown are the drift from the truth, what the
    arithmetic adds to it beside its certified bound, what rounded increments add, and what the method itself loses.
    Finished runs are kept in the cache: a study that was stopped goes on where it was.

    Example:

    \b
      strapgen study word-length --words 12,16,20,24,32 \\
        --carries none,full --plot out/word-length.png
    """  # noqa: D301
    check_format(format, "csv")
    from strapgen import catalogue
    from strapgen.support import checks

    checks.choice("algorithm", algorithm, catalogue.ALGORITHMS)
    checks.choice("motion", motion, catalogue.MOTIONS)
    for name in _split("methods", methods):
        catalogue.choose(algorithm, name, whole("increments", increments))
    count = whole("jobs", jobs)
    if count is not None:
        checks.count("jobs", count, largest=1024)
    if settings is None and motion != "coning":
        raise InputError(f"--motion {motion} needs --set; strapgen list shows the keys")

    import numpy as np

    from strapgen.experiments.word_length import cases, run
    from strapgen.reports.word_length import word_length_csv, word_length_text
    from strapgen.support.files import write_files

    planned = cases(
        algorithm=algorithm,
        methods=_split("methods", methods),
        increments=whole("increments", increments) or 2,
        words=[whole("words", word) or 0 for word in _split("words", words)],
        roundings=_split("roundings", roundings),
        carries=_split("carries", carries),
        steps=_split("steps", steps),
        duration=duration,
        pulses_arcsec=_split("pulses-arcsec", pulses_arcsec),
        motion_name=motion,
        settings=None if settings is None else pairs(settings),
    )
    _ = planned[0].profile  # a motion that lacks a parameter is told before anything runs
    with np.errstate(all="ignore"):
        found = {done.case: done for done in track(run(planned, count), "running", len(planned))}
    outcomes = [found[case] for case in planned]
    image = None
    if plot is not None:
        from strapgen.reports import plots

        image = plots.word_length_image(outcomes, plot)
    if format == "json":
        text = json.dumps([outcome.as_dict() for outcome in outcomes])
    elif format == "csv":
        text = word_length_csv(outcomes).rstrip("\n")
    else:
        text = word_length_text(outcomes)
    files: dict[str, str | bytes] = {}
    if out is not None:
        files[str(out)] = f"{text}\n"
    if plot is not None and image is not None:
        files[str(plot)] = image
    write_files(Path(), files)
    if out is None:
        typer.echo(text)


def _split(option: str, text: str) -> list[str]:
    """Read a list; every value once."""
    values = [value.strip() for value in text.split(",") if value.strip()]
    if not values:
        raise InputError(f"--{option} is {text!r}; at least one value is needed")
    return list(dict.fromkeys(values))
