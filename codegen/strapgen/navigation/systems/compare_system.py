"""`compare` with a described system: its outputs on several back ends, beside the bounds of one pass."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from strapgen.navigation.systems.simulate_system import (
    described_along,
    described_at,
    recorded,
    refuse_options,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from strapgen.cli.fixed_options import FixedOptions
    from strapgen.cli.options import SeveralMethods
    from strapgen.cli.output import Output
    from strapgen.lab.run_options import SampleSource
    from strapgen.navigation.systems.wiring import Description


def compared_system(
    name: str,
    methods: SeveralMethods,
    stated: list[str],
    backends: tuple[Sequence[str], str],
    files: tuple[Sequence[Path] | None, bool],
    source: SampleSource,
    fixed: FixedOptions,
    output: Output,
) -> None:
    """Compare a described system on back ends, and exit with 1 if a pass is outside its bound."""
    refuse_options(methods, fixed, stated)
    output.check(name, *source.files)
    from strapgen import registration
    from strapgen.cli.progress import waiting
    from strapgen.lab.compare_command import counted
    from strapgen.navigation.systems.system_comparison import compare_system
    from strapgen.navigation.systems.system_comparison_report import SystemComparisonResult

    names, reference = backends
    description, inputs, title = _inputs(name, source)
    with waiting(f"running {name}"):
        runners = {}
        for path in files[0] or ():
            reader = registration.extension("navigation.source-files", "--source")
            runners[path] = reader(path, description, [name], files[1])
        settings = counted(fixed.settings(1), {path: stated for path, (_, stated) in runners.items()})
        of_files = {str(path): runner for path, (runner, _) in runners.items()}
        rows = compare_system(description, names, reference, inputs, settings, of_files)
    output.show(SystemComparisonResult(rows, f"{name}: {title}", reference))
    broken = [f"{row.output} on {row.backend}" for row in rows if row.share is not None and row.share > 1]
    if broken:
        typer.echo(f"strapgen: outside the certified bound: {', '.join(broken)}", err=True)
        raise typer.Exit(1)


def _inputs(name: str, source: SampleSource) -> tuple[Description, dict[str, NDArray[Any]], str]:
    """Return the system, the samples of its inputs, and where they come from in words."""
    import numpy as np

    from strapgen.lab.sensor_errors.measured_motions import both_increments
    from strapgen.navigation.systems.system_inputs import cycles_of, samples

    if source.motion is None:
        data = recorded(source)
        description = described_along(name, data)
        angle = np.asarray(data.increments)
        return description, samples(description, angle, np.zeros_like(angle)), Path(source.file).name
    description, profile = described_at(name, source), source.profile()
    assert source.duration is not None, "a motion has a duration"
    system = description.system
    count, interval = cycles_of(system, source.duration), 1 / system.sample_hz
    angle, velocity = both_increments(profile, profile.attitude, source.force, interval, count)
    title = f"{source.described(profile.name, ' motion')}, {count} cycles of {float(interval):.6g} s"
    return description, samples(description, angle, velocity), title
