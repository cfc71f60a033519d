"""The command ``strapgen two-speed`` writes the C code of an algorithm in two speeds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from strapgen import registration
from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import CTarget, Sculling, TwoSpeedAlgorithm
from strapgen.cli.output import Format, check_format, print_json
from strapgen.cli.source_options import SourceOptions
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.ir.fixed_settings import Settings
    from strapgen.ir.sources import Sources


@grouped
def two_speed(
    algorithm: TwoSpeedAlgorithm,
    *,
    sculling: Sculling = 2,
    target: CTarget = "c",
    fixed: Annotated[
        FixedOptions,
        Shown(
            only=(
                *("word", "max_rate_deg_s", "sample_hz", "lsb", "lsb_rad", "input_bits"),
                *("rounding", "carry", "allowance", "ranges", "formats"),
            )
        ),
    ],
    output: Annotated[SourceOptions, Shown(only=("out", "with_runs", "project", "check", "force"))],
    format: Format = "text",
) -> None:
    """Generate the C code of an algorithm in two speeds.

    You get a function for each loop, and one that runs them all. --sample-hz is the rate of the fast loop, which takes
    one sample of the gyro.

    Example: strapgen two-speed dcm --target c --out firmware

    Example: strapgen two-speed dcm --target c-fixed --sample-hz 400 --lsb 0.0175dps --out firmware
    """
    check_format(format)
    from strapgen.navigation.two_speed import two_speed_sources

    task = request(algorithm, sculling, target, fixed)
    sources = two_speed_sources.sources(*task)
    files = sources.files if output.with_runs else sources.step_files
    if output.project:
        writer = registration.extension("two-speed.project", "--project")
        added = writer.project_files(*task)
        if not output.check:
            writer.refuse_changed(output.out or Path(), added, output.force)
        files = files | added
    if output.check:
        output.show_difference(files, format)
        return
    written = output.write(files)
    loops = two_speed_sources.loops(*task)
    if format == "json":
        print_json(_data(sources, loops, written))
        return
    from strapgen.cli import generated_text

    lines = generated_text.head(sources, target, written)
    for loop in loops:
        lines += [
            *generated_text.head(loop, target),
            *(f"  {line}" for line in generated_text.contract(loop)),
        ]
    typer.echo("\n".join(lines))


def _data(sources: Sources, loops: Sequence[Sources], written: Sequence[Path]) -> dict[str, Any]:
    """Return what was generated as plain JSON data, with what `generate` says of each loop."""
    from strapgen.catalogue import Choice
    from strapgen.run.generation import generated_data

    places = {path.name: str(path) for path in written}
    return {
        "kernel": sources.kernel,
        "target": sources.target,
        "loops": [loop.kernel for loop in loops],
        "files": [*places.values()],
        "operations": sources.operations,
        "functions": [
            generated_data(
                Choice(loop.kernel), loop, sources.target, [places[name] for name in loop.step_files]
            )
            for loop in loops
        ],
    }


class TwoSpeedRequest(NamedTuple):
    """What one call of ``strapgen two-speed`` generates, as `two_speed_sources.sources` takes it."""

    algorithm: str
    sculling: int
    target: str
    settings: Settings | None


def request(algorithm: str, sculling: int, target: str, fixed: FixedOptions) -> TwoSpeedRequest:
    """Return what the options ask for."""
    return TwoSpeedRequest(algorithm, sculling, target, _settings(target, fixed))


def _settings(target: str, fixed: FixedOptions) -> Settings | None:
    """Return the settings of fixed point, which a target in floating point has none of."""
    from strapgen.ir.fixed_settings import Settings
    from strapgen.targets import fixed_targets

    settings = fixed.settings(1)
    if target in fixed_targets():
        return settings or Settings()
    if settings is not None:
        raise InputError(f"the options of fixed point go with --target c-fixed, not with {target}")
    return None
