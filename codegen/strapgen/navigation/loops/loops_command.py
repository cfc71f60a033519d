"""The command ``strapgen study loops`` runs the loops of an attitude and heading reference through a schedule."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Annotated

import typer

from strapgen.cli.option_groups import grouped
from strapgen.cli.options import option
from strapgen.cli.output import Output
from strapgen.cli.progress import track
from strapgen.cli.values import Number, filled, names


@grouped
def study_loops(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="SCHEDULE",
            help="TOML file with modes and time constants.  [default: the schedule of 1984]",
            show_default=False,
        ),
    ] = None,
    *,
    last: Annotated[
        Number,
        option("--last", metavar="S", help="Time of a last mode without an end, in s.", panel="Run"),
    ] = Number("600"),
    backend: Annotated[
        str,
        option(
            "--backend",
            metavar="NAME",
            help="Back end: numpy or c.",
            panel="Run",
            read=names(("numpy", "c")),
        ),
    ] = "numpy",
    settings: Annotated[
        dict[str, Fraction] | None,
        option(
            "--set",
            metavar="KEY=VALUE...",
            help="Errors, each run by itself: rate_deg_h, tilt_deg, velocity_m_s, heading_deg, "
            "acceleration_mg, height_m.",
            panel="Input",
        ),
    ] = None,
    output: Output,
) -> None:
    """Run levelling, heading and vertical loop of an attitude and heading reference.

    You see the gains of every mode, by pole placement, and where the loops are at its end after an error: by the
    generated kernels, cycle by cycle, and by the matrix exponential. Unstable gains are refused.

    Example: strapgen study loops --set tilt_deg=2 --plot out/loops.png
    """
    output.check(file)
    from strapgen.navigation.loops.loop_schedule import BUILT_IN, read
    from strapgen.navigation.loops.loops_report import LoopStudy, loops_image, loops_report
    from strapgen.navigation.loops.loops_study import LOOPS, LoopErrors, cycles_of_modes, designs, run_loops

    errors = filled(LoopErrors, settings)
    schedule = read(BUILT_IN if file is None else file)
    modes = schedule.timed(last)
    cycles_of_modes(schedule, modes)
    gains = designs(schedule)
    courses = tuple(track(run_loops(schedule, modes, errors, backend), "running", len(LOOPS)))
    study = LoopStudy(schedule, modes, errors, gains, courses)
    output.report(loops_report(study), lambda path: loops_image(study, path))
