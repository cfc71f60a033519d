"""strapgen strapdown."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from strapgen.cli.fixed_options import Carry, Fixes, Ranges, Rounding, Word, check_fixed, settings_for_run
from strapgen.cli.options import check_format, whole
from strapgen.support.exceptions import InputError

_Text = str | None


def strapdown(
    algorithm: Annotated[str, typer.Argument(help="dcm or euler.")],
    increments: Annotated[
        Path,
        typer.Option(
            "--increments-csv",
            metavar="FILE",
            help="Recorded increments of the fast cycles: columns t, dx, dy, dz, dvx, dvy, dvz; s, rad, m/s.",
        ),
    ],
    fast_cycles: Annotated[
        str, typer.Option("--fast-cycles", metavar="N", help="Fast cycles in a slow cycle.")
    ],
    slow_cycles: Annotated[
        str, typer.Option("--slow-cycles", metavar="N", help="Slow cycles in a navigation cycle.")
    ] = "1",
    sculling: Annotated[
        str,
        typer.Option(
            "--sculling", help="Sculling integral: 1 with the rotation compensation in it, 2 without."
        ),
    ] = "2",
    backend: Annotated[
        str, typer.Option("--backend", help="numpy, c, c-float, c-q31, c-q15, fixed-model or exact.")
    ] = "numpy",
    initial: Annotated[
        str,
        typer.Option("--initial-deg", metavar="R,P,H", help="Roll, pitch, heading at the start in deg."),
    ] = "0,0,0",
    frame_rate: Annotated[
        str,
        typer.Option(
            "--frame-rate-deg-h",
            metavar="X,Y,Z",
            help="Rate of the navigation frame in deg/h, navigation axes.",
        ),
    ] = "0,0,0",
    word: Word = None,
    rounding: Rounding = None,
    carry: Carry = None,
    ranges: Ranges = None,
    fix: Fixes = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="File for the output.  [default: the terminal]", show_default=False),
    ] = None,
    format: Annotated[
        _Text,
        typer.Option(
            "--format", help="text, json or csv.  [default: text; csv with --out]", show_default=False
        ),
    ] = None,
) -> None:
    """Run an algorithm in two speeds along recorded gyro and accelerometer increments.

    Printed after every navigation cycle: attitude as roll, pitch, heading, and the integral of the specific force over
    the cycle, in navigation axes. Formats of fixed point are chosen for the recording.

    Example:

    \b
      strapgen strapdown dcm --increments-csv examples/inertial_log.csv \\
        --fast-cycles 4 --slow-cycles 25 --backend c
    """  # noqa: D301
    chosen = format or ("text" if out is None else "csv")
    check_format(chosen, "csv")
    import numpy as np

    from strapgen.reports import runs
    from strapgen.simulation import recording
    from strapgen.simulation.courses import NavigationFrame, course
    from strapgen.support.files import write_files

    words = {"word": word, "rounding": rounding, "carry": carry}
    check_fixed(backend, words | {"range": ranges, "fix": fix})
    data = recording.read_inertial(increments)
    stated = words | {"ranges": ranges, "formats": fix}
    settings = settings_for_run(backend, 1, stated, data.interval, lambda: data.largest)
    begin, rate = (
        np.radians(_three(name, text))
        for name, text in (("initial-deg", initial), ("frame-rate-deg-h", frame_rate))
    )
    with np.errstate(all="ignore"):  # numbers that overflow are refused, in one line
        made = course(
            algorithm,
            data,
            fast_cycles=whole("fast-cycles", fast_cycles) or 0,
            slow_cycles=whole("slow-cycles", slow_cycles) or 0,
            sculling=whole("sculling", sculling) or 0,
            backend=backend,
            settings=settings,
            frame=NavigationFrame(begin, rate / 3600),
        )
    named: dict[str, Any] = {
        "algorithm": f"{algorithm} in two speeds",
        "backend": backend,
        "source": str(increments),
    }
    if chosen == "csv":
        text = runs.course_csv(made)
    elif chosen == "json":
        text = json.dumps(runs.course_data(made, named))
    else:
        text = runs.course_text(made, named)
    text = text.rstrip("\n")
    if out is None:
        typer.echo(text)
    else:
        write_files(Path(), {str(out): f"{text}\n"})


def _three(name: str, text: str) -> list[float]:
    from strapgen.support import checks

    parts = text.split(",")
    if len(parts) != 3:
        raise InputError(f"--{name} is {text!r}; three numbers with commas between are needed")
    return [float(checks.number(name, part)) for part in parts]
