"""The command ``strapgen study sensor-errors`` runs an algorithm many times on sensors with errors."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import typer

from strapgen.cli.fixed_options import RUN_OPTIONS, FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import STEP_OPTIONS, MethodOptions, OneBackend, one, option
from strapgen.cli.output import Output
from strapgen.cli.progress import track
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.lab.sensor_errors.sensor_options import force_of
from strapgen.lab.simulate.sample_source import SampleSource

if TYPE_CHECKING:
    from strapgen.catalogue import Choice
    from strapgen.lab.sensor_error_study.sensor_error_study import SensorStudy
    from strapgen.lab.sensor_errors.instruments import InstrumentErrors

#: Most runs of a study, and most increments of one.
_MOST_RUNS, _MOST_INCREMENTS = 100_000, 2_000_000


@grouped
def study_sensor_errors(
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE",
            help="TOML file of sensor errors, or a class: ins-0.1, ins-1, ahrs or midcourse.",
            show_default=False,
        ),
    ],
    *,
    algorithm: Annotated[
        str,
        option(
            "--algorithm", metavar="NAME", help="Algorithm: dcm, euler or cayley-klein.", panel="Algorithm"
        ),
    ] = "euler",
    method: Annotated[MethodOptions, Shown(only=STEP_OPTIONS)],
    backend: OneBackend = "numpy",
    source: Annotated[SampleSource, Shown(only=("motion", "settings", "step", "duration", "specific_force"))],
    runs: Annotated[
        str,
        option("--runs", metavar="N", help="Runs of each cause, each with numbers of its own.", panel="Run"),
    ] = "100",
    seed: Annotated[
        str | None,
        option(
            "--seed", metavar="N", help="Seed of the random numbers, in place of the file's.", panel="Run"
        ),
    ] = None,
    fixed: Annotated[FixedOptions, Shown(only=RUN_OPTIONS)],
    output: Output,
) -> None:
    """Show how far sensors with errors lead an attitude astray, over many runs and as predicted in closed form.

    All causes run together, and then each alone. You see the mean and the standard deviation of the error on each axis
    at the end, with intervals of 95 %, beside what covariance predicts; --plot draws the deviations over time.

    Example: strapgen study sensor-errors examples/sensors/ins-1.toml --motion coning --set a_deg_s=10 b_deg_s=10
    g_deg_s=10 --step 0.02 --duration 60 --runs 50
    """
    source = replace(source, errors=file)
    output.check(*source.files)
    count = checks.whole("runs", runs)
    choice = method.choose(algorithm)
    source.check()
    one("--backend", backend)
    fixed.check_backend(backend)
    errors = _errors(source, seed)

    from strapgen.lab.sensor_error_study.sensor_error_report import SensorErrorResult
    from strapgen.lab.sensor_error_study.sensor_error_study import FEWEST_RUNS

    checks.count("runs", count, smallest=FEWEST_RUNS, largest=_MOST_RUNS)
    study = _study(choice, backend, source, errors, fixed)
    causes = len([*errors.causes])
    rows = list(track(study.rows(count), "running", 1 + causes if causes > 1 else 1))
    motion, step = source.described(source.motion or ""), source.step or ""
    output.show(SensorErrorResult(rows, file, choice.name, choice.method_name, backend, motion, step))


def _errors(source: SampleSource, seed: str | None) -> InstrumentErrors:
    """Return the errors of the file, with the seed of the command line if there is one."""
    errors = source.sensor_errors()
    assert errors is not None, "the command names a file"
    if seed is None:
        return errors
    return replace(errors, seed=checks.count("seed", checks.whole("seed", seed), smallest=0))


def _study(
    choice: Choice, name: str, source: SampleSource, errors: InstrumentErrors, fixed: FixedOptions
) -> SensorStudy:
    """Return the study of an algorithm on the motion of the options."""
    from strapgen.lab.sensor_error_study.sensor_error_study import SensorStudy, reach, records_of
    from strapgen.lab.sensor_errors.sensor_covariance import Path
    from strapgen.run import backends as run

    motion = replace(source, errors=None).profile()
    step, duration = source.times()
    steps, force = checks.multiple("duration", duration, "step", step), force_of(source.specific_force)
    if choice.increments is None:
        raise InputError("sensor errors go with increments, and the algorithm takes rates")
    if steps * choice.increments_per_step > _MOST_INCREMENTS:
        raise InputError(
            f"{steps * choice.increments_per_step} increments are too many, a run holds up to {_MOST_INCREMENTS}"
        )
    path = Path(motion, choice, step, steps, records_of(steps), force)
    settings = fixed.settings_for_run(
        name, choice.increments_per_step, float(step), lambda: reach(path, errors)
    )
    return SensorStudy(run.backend(choice, backend=name, settings=settings), path, errors)
