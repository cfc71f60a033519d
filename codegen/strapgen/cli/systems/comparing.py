"""`compare` with a described system: its outputs on several back ends, beside the bounds of one pass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from strapgen.cli.sensor_options import force_of
from strapgen.cli.systems.files import runner_of_file
from strapgen.cli.systems.running import described_along, described_at, recorded
from strapgen.support import checks
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from strapgen.cli.fixed_options import FixedOptions
    from strapgen.cli.output import Output
    from strapgen.cli.sample_source import SampleSource
    from strapgen.ir.fixed_settings import Settings
    from strapgen.systems.wiring import Description


def compared_system(
    name: str,
    names: list[str],
    reference: str,
    files: tuple[Sequence[Path] | None, bool],
    source: SampleSource,
    fixed: FixedOptions,
    output: Output,
) -> None:
    """Compare a described system on back ends, and exit with 1 if a pass is outside its bound."""
    output.check(name, *source.files)
    source.check(of_system=True)
    from strapgen.cli.progress import waiting
    from strapgen.experiments.systems.comparison import compare_system
    from strapgen.reports.comparison import system_comparison_report

    description, inputs, title = _inputs(name, source)
    with waiting(f"running {name}"):
        runners = {path: runner_of_file(path, description, [name], files[1]) for path in files[0] or ()}
        settings = counted(fixed.settings(1), {path: stated for path, (_, stated) in runners.items()})
        of_files = {str(path): runner for path, (runner, _) in runners.items()}
        rows = compare_system(description, names, reference, inputs, settings, of_files)
    output.report(system_comparison_report(rows, f"{name}: {title}", reference))
    broken = [f"{row.output} on {row.backend}" for row in rows if row.share is not None and row.share > 1]
    if broken:
        typer.echo(f"strapgen: outside the certified bound: {', '.join(broken)}", err=True)
        raise typer.Exit(1)


def counted(settings: Settings | None, files: Mapping[Path, Settings | None]) -> Settings | None:
    """Return settings with the gyro whose counts the files take: all back ends then run on its counts.

    Raises
    ------
    InputError
        If the files, or the options of the command, state different gyros.
    """
    from strapgen.ir.fixed_settings import Settings

    gyros = {} if settings is None or settings.sensor is None else {settings.sensor: "the command"}
    for path, stated in files.items():
        if stated is not None and stated.sensor is not None:
            gyros.setdefault(stated.sensor, str(path))
    if len(gyros) > 1:
        both = " and ".join(f"{sensor.stated} of {place}" for sensor, place in gyros.items())
        raise InputError(f"{both} are different gyros; one run has the counts of one")
    counting = next((stated for stated in files.values() if stated and stated.sensor), None)
    if counting is None or (settings is not None and settings.sensor is not None):
        return settings
    return replace(settings or Settings(), sensor=counting.sensor, input_bits=counting.input_bits)


def _inputs(name: str, source: SampleSource) -> tuple[Description, dict[str, NDArray[Any]], str]:
    """Return the system, the samples of its inputs, and where they come from in words."""
    import numpy as np

    from strapgen.simulation.sensor_errors.measured_motions import both_increments
    from strapgen.simulation.system_inputs import cycles_of, samples

    if source.motion is None:
        data = recorded(source)
        description = described_along(name, data)
        angle = np.asarray(data.increments)
        return description, samples(description, angle, np.zeros_like(angle)), Path(source.file).name
    description, profile = described_at(name, source), source.profile()
    seconds = checks.number("duration", source.duration or "", positive=True)
    system = description.system
    count, interval = cycles_of(system, seconds), 1 / system.sample_hz
    force = force_of(source.specific_force)
    angle, velocity = both_increments(profile, profile.attitude, force, interval, count)
    title = f"{source.described(profile.name, ' motion')}, {count} cycles of {float(interval):.6g} s"
    return description, samples(description, angle, velocity), title
