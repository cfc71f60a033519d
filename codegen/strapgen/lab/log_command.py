"""The command ``strapgen log`` shows what a log holds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import argument
from strapgen.cli.output import TEXT_OUTPUT, Output
from strapgen.lab.run_options import RecordingOptions

_SHOWN = ("input", "columns", "time_unit", "rate_unit", "sample_hz")


@grouped
def log(
    file: Annotated[Path, argument("FILE", help="Log of any format, or FILE:TOPIC for one of its tables.")],
    *,
    source: Annotated[RecordingOptions, Shown(only=_SHOWN)],
    output: Annotated[Output, Shown(only=TEXT_OUTPUT)],
) -> None:
    """Show what a log holds, and the command that runs it.

    You see the columns with what they mean, the sampling rate and its jitter, gaps, and where the gyro rests. What
    names and units leave open is guessed from the numbers, and said to be a guess.

    Example: strapgen log examples/gyro_log.csv
    """
    source = replace(source, recording=file)
    output.check(source.file)
    from strapgen.cli.progress import waiting
    from strapgen.lab.recordings.log_file import open_log
    from strapgen.lab.recordings.log_report import survey

    path, topic = source.place
    with waiting(f"reading {path.name}"):
        result = survey(open_log(path), topic, source.reading())
    output.show(result)
