"""The command ``strapgen system`` checks a described system, shows it, draws it and writes its code."""

from __future__ import annotations

import shlex
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.generate_command import SourceOptions
from strapgen.cli.option_groups import Excludes, Needs, Shown, grouped, rules
from strapgen.cli.options import argument, option
from strapgen.cli.output import Format, NewFolder, WithRuns, check_format, show
from strapgen.cli.values import Positive
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.ir.fixed_settings import Settings
    from strapgen.ir.sources import Sources
    from strapgen.navigation.systems.budget import Budget
    from strapgen.navigation.systems.fitting import GeneratedStages
    from strapgen.navigation.systems.system_bounds import SystemBounds


def _a_target(option: str, text: str) -> str:
    from strapgen.targets import system_targets

    return checks.choice(option[2:], text, system_targets())


def _a_drawing(option: str, path: Path) -> Path:
    if path.suffix.lower() != ".svg":
        raise InputError(f"{option} {path} is no SVG file; a name that ends with .svg is needed")
    return path


@grouped
@rules(
    Needs("--with-runs --project --check --force", "--out"),
    Excludes("--check", "--draw", reason="--check writes nothing"),
)
def system(
    file: Annotated[
        Path,
        argument(
            "FILE",
            help="TOML file with the stages and their wires, or the name of a built-in system.",
            words="strapgen.navigation.systems.built_in:names",
        ),
    ],
    *,
    target: Annotated[
        str,
        option(
            "--target",
            metavar="NAME",
            help="Kind of code: c, c-float, c-fixed, numpy or fixed-model.",
            panel="System",
            read=_a_target,
        ),
    ] = "c",
    sample_hz: Annotated[
        Positive | None,
        option(
            "--sample-hz",
            metavar="HZ",
            help="Cycles of the fastest rate in a second, in place of those in the file.",
            panel="System",
        ),
    ] = None,
    cpu: Annotated[
        str | None,
        option(
            "--cpu",
            metavar="NAME",
            help="Count the instructions of every stage on this processor, as strapgen cost does; cortex-m3 is one.",
            panel="System",
        ),
    ] = None,
    fixed: Annotated[
        FixedOptions,
        Shown(
            only=(
                *("word", "lsb", "lsb_rad", "input_bits"),
                *("rounding", "carry", "allowance", "multiply", "digits"),
            )
        ),
    ],
    out: NewFolder = None,
    with_runs: WithRuns = False,
    output: Annotated[SourceOptions, Shown(only=("project", "check", "force"))],
    draw: Annotated[
        Path | None,
        option(
            "--draw",
            metavar="FILE",
            help="SVG file for a drawing of the wiring.",
            panel="Output",
            read=_a_drawing,
        ),
    ] = None,
    format: Format = "text",
) -> None:
    """Check a described system and generate its code.

    Without --out you get a summary: rates, values with their units, frames, formats and error bounds, and the budget.

    Example: strapgen system examples/strapdown.toml --target c-fixed --word 16 --out firmware

    Example: strapgen system examples/strapdown.toml --draw out/strapdown.svg
    """
    check_format(format)
    checks.text("FILE", str(file))
    if draw is not None and draw.resolve() == file.resolve():
        raise InputError(f"--draw {draw} is the file that the command reads; another one is needed")
    fit, needs, command = fitted_stages(file, target, sample_hz, cpu, fixed)
    if with_runs and not _compiled(target):
        raise InputError(
            f"--with-runs goes with targets in C, not with {target}; its module runs many cycles"
        )
    from strapgen.navigation.systems.system_bounds import bounds
    from strapgen.navigation.systems.system_drawing import drawing
    from strapgen.navigation.systems.system_report import SystemResult
    from strapgen.storage.files import write_files

    errors = bounds(fit)
    sources = unit(fit, needs, errors, command)
    place = replace(output, out=out, with_runs=with_runs)
    place.require_language(target)
    files = place.files(sources, "whole.project", sources, fit)
    if output.check:
        place.show_difference(files, format)
        return
    picture = {} if draw is None else {draw.name: drawing(fit)}
    written = place.write(files) if out is not None else []
    written += [] if draw is None else write_files(draw.parent, picture)
    show(SystemResult.of(fit, needs, errors, written), format)


def _compiled(target: str) -> bool:
    from strapgen.targets import TARGETS

    return TARGETS[target].compiled


def unit(fit: GeneratedStages, needs: Budget, errors: SystemBounds, command: str) -> Sources:
    """Return the files of the whole, with bounds and budget in its head."""
    from strapgen.navigation.systems import budget, system_generation
    from strapgen.navigation.systems.system_report import bound_lines

    return system_generation.unit(fit, command, [*bound_lines(fit, errors), *budget.lines(needs)])


def fitted_stages(
    file: Path, target: str, sample_hz: Positive | None, cpu: str | None, fixed: FixedOptions
) -> tuple[GeneratedStages, Budget, str]:
    """Return the generated stages, their budget, and the command that makes the files."""
    from strapgen.ir.fixed_settings import Settings
    from strapgen.lab.cost import processors
    from strapgen.navigation.systems.budget import budget, measured_budget
    from strapgen.navigation.systems.fitting import fitted
    from strapgen.navigation.systems.wiring import read_system
    from strapgen.targets import BUILT_IN, system_targets

    description = read_system(file, sample_hz)
    timed = None if fixed.lsb is None else Positive(str(description.system.sample_hz))
    settings = replace(fixed, sample_hz=timed).settings(1)
    if BUILT_IN[target].fixed:
        settings = settings or Settings()
    elif settings is not None:
        takers = [name for name in system_targets() if BUILT_IN[name].fixed]
        raise InputError(
            f"the options of fixed point go with --target {' or '.join(takers)}, not with {target}"
        )
    if cpu is not None:
        if not BUILT_IN[target].compiled:
            raise InputError(f"--cpu goes with targets in C, not with {target}")
        processors(None, [cpu])  # known before the stages are generated
    fit = fitted(description, target, settings)
    needs = budget(fit) if cpu is None else measured_budget(fit, cpu)
    return fit, needs, _command(file, target, sample_hz, cpu, settings)


def _command(
    file: Path, target: str, rate: Positive | None, cpu: str | None, settings: Settings | None
) -> str:
    """Return the command line that makes the files again, without those of --with-runs."""
    from strapgen.targets.contract import options

    words = [f"strapgen system {shlex.quote(file.as_posix())} --target {target}"]
    stated = "" if settings is None else options(settings)
    words += [] if rate is None or "--sample-hz" in stated else [f"--sample-hz {Fraction(rate)}"]
    words += [] if cpu is None else [f"--cpu {cpu}"]
    words += [stated] if stated else []
    return " ".join(words)
