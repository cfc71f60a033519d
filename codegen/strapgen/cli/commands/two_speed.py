"""The command ``strapgen two-speed`` writes the C code of an algorithm in two speeds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import Sculling, TwoSpeedAlgorithm, option, whole
from strapgen.cli.output import Folder, Format, Project, WithRuns, check_format, print_json
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.ir.fixed_settings import Settings


@grouped
def two_speed(
    algorithm: TwoSpeedAlgorithm,
    *,
    sculling: Sculling = "2",
    target: Annotated[
        str,
        option("--target", metavar="NAME", help="Kind of code: c, c-float or c-fixed.", panel="Algorithm"),
    ] = "c",
    fixed: Annotated[
        FixedOptions,
        Shown(only=("word", "rounding", "carry", "drift_allowance", "ranges", "formats")),
    ],
    out: Folder = None,
    with_runs: WithRuns = False,
    project: Project = False,
    format: Format = "text",
) -> None:
    """Generate the C code of an algorithm in two speeds.

    You get a function for each loop, and one that runs them all.

    Example: strapgen two-speed dcm --target c --out firmware
    """
    check_format(format)
    from strapgen.ir.fixed_settings import Settings
    from strapgen.library import two_speed_sources
    from strapgen.support.files import write_files
    from strapgen.targets import fixed_targets

    form = whole("sculling", sculling) or 0
    settings = fixed.settings(1)
    if target in fixed_targets():
        settings = settings or Settings()
    elif settings is not None:
        raise InputError(f"the options of fixed point go with --target c-fixed, not with {target}")
    sources = two_speed_sources.sources(algorithm, form, target, settings)
    files = sources.files if with_runs else sources.step_files
    if project:
        files = files | _project_files(out or Path(), algorithm, form, target, settings)
    written = write_files(out or Path(), files)
    if format == "json":
        print_json(
            {
                "kernel": sources.kernel,
                "target": target,
                "loops": list(two_speed_sources.kernels(algorithm, form)),
                "files": [str(path) for path in written],
                "operations": sources.operations,
            }
        )
        return
    typer.echo(f"{sources.kernel} for {target}")
    for path in written:
        typer.echo(f"  {path}")


def _project_files(
    out: Path, algorithm: str, sculling: int, target: str, settings: Settings | None
) -> dict[str, str]:
    """Return the files that build and test the C, unless a file of the user is in their place."""
    from strapgen.experiments import project, two_speed_project

    files = two_speed_project.project_files(algorithm, sculling, target, settings)
    project.refuse_changed(out, files)
    return files
