"""Options of sensors: their errors, and the specific force that they feel."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, TypeVar

from strapgen.cli.options import option

if TYPE_CHECKING:
    from strapgen.lab.recordings.recording import Recording
    from strapgen.lab.sensor_errors.instruments import InstrumentErrors

Recorded = TypeVar("Recorded", bound="Recording")

#: The option of sensor errors, for every command that runs an algorithm.
SensorFile = Annotated[
    str | None,
    option(
        "--errors",
        metavar="FILE",
        help="TOML file of sensor errors, or a class: ins-0.1, ins-1, ahrs or midcourse.  [default: no errors]",
        panel="Input",
    ),
]


def read_errors(source: str | None) -> InstrumentErrors | None:
    """Return the errors that --errors names; None without it."""
    if source is None:
        return None
    from strapgen.lab.sensor_errors.error_file import read

    return read(source)


def with_errors(data: Recorded, errors: InstrumentErrors | None) -> Recorded:
    """Return a recording as sensors with errors measure what it holds."""
    if errors is None:
        return data
    from strapgen.lab.sensor_errors.measured_motions import measured_recording

    return measured_recording(data, errors)
