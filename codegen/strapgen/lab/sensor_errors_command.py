"""The command ``strapgen study sensor-errors`` runs an algorithm many times on sensors with errors."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

from strapgen.cli.fixed_options import RUN_OPTIONS, FixedOptions
from strapgen.cli.option_groups import OneOf, Shown, grouped, rules
from strapgen.cli.options import STEP_OPTIONS, MethodOptions, OneBackend, StepName, argument, option
from strapgen.cli.output import Output
from strapgen.cli.progress import track
from strapgen.cli.values import whole
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.lab.run_options import SampleSource

if TYPE_CHECKING:
    from strapgen.catalogue import Choice
    from strapgen.lab.sensor_error_study import SensorStudy
    from strapgen.lab.sensor_errors.instruments import InstrumentErrors

#: Most runs of a study, and most increments of one.
_MOST_RUNS, _MOST_INCREMENTS = 100_000, 2_000_000


@grouped
@rules(OneOf("--motion", needed="--motion is needed"))
def study_sensor_errors(
    file: Annotated[
        str,
        argument(
            "FILE",
            help="TOML file of sensor errors, or a class: ins-0.1, ins-1, ahrs or midcourse.",
            words="strapgen.lab.sensor_errors.error_file:CLASSES",
        ),
    ],
    *,
    algorithm: StepName = "euler",
    method: Annotated[MethodOptions, Shown(only=STEP_OPTIONS)],
    backend: OneBackend = "numpy",
    source: Annotated[SampleSource, Shown(only=("motion", "settings", "step", "duration", "specific_force"))],
    runs: Annotated[
        int,
        option("--runs", metavar="N", help="Runs of each cause, each with numbers of its own.", panel="Run"),
    ] = 100,
    seed: Annotated[
        int | None,
        option(
            "--seed",
            metavar="N",
            help="Seed of the random numbers, in place of the file's.",
            panel="Run",
            read=whole(0),
        ),
    ] = None,
    fixed: Annotated[FixedOptions, Shown(only=RUN_OPTIONS)],
    output: Output,
) -> None:
    """Measure the attitude error due to sensor errors over many runs, beside its prediction in closed form.

    All causes run together, and then each alone. You see the mean and the standard deviation of the error on each axis
    at the end, with intervals of 95 %, beside what covariance predicts; --plot draws the deviations over time.

    Example: strapgen study sensor-errors examples/sensors/ins-1.toml --motion coning --set a_deg_s=10 b_deg_s=10
    g_deg_s=10 --step 0.02 --duration 60 --runs 50
    """
    source = replace(source, errors=file)
    output.check(*source.files)
    choice = method.choose(algorithm)
    source.check()
    fixed.check_backend(backend)
    errors = source.sensor_errors()
    assert errors is not None, "the command names a file"
    errors = errors if seed is None else replace(errors, seed=seed)

    from strapgen.lab.sensor_error_study import FEWEST_RUNS, SensorErrorResult

    checks.count("runs", runs, smallest=FEWEST_RUNS, largest=_MOST_RUNS)
    study = _study(choice, backend, source, errors, fixed)
    causes = len([*errors.causes])
    rows = list(track(study.rows(runs), "running", 1 + causes if causes > 1 else 1))
    motion, step = source.described(source.motion or ""), str(source.step)
    output.show(SensorErrorResult(rows, file, choice.name, choice.method_name, backend, motion, step))


def _study(
    choice: Choice, name: str, source: SampleSource, errors: InstrumentErrors, fixed: FixedOptions
) -> SensorStudy:
    """Return the study of an algorithm on the motion of the options."""
    from strapgen.lab.sensor_error_study import SensorStudy, reach, records_of
    from strapgen.lab.sensor_errors.sensor_covariance import Path
    from strapgen.run import backends as run

    motion = replace(source, errors=None).profile()
    assert source.step and source.duration, "the source is checked"
    step = source.step
    steps = checks.multiple("duration", source.duration, "step", step)
    if choice.increments is None:
        raise InputError("sensor errors go with increments, and the algorithm takes rates")
    if steps * choice.increments_per_step > _MOST_INCREMENTS:
        raise InputError(
            f"{steps * choice.increments_per_step} increments are too many, a run holds up to {_MOST_INCREMENTS}"
        )
    path = Path(motion, choice, step, steps, records_of(steps), source.force)
    settings = fixed.settings_for_run(
        name, choice.increments_per_step, float(step), lambda: reach(path, errors)
    )
    return SensorStudy(run.backend(choice, backend=name, settings=settings), path, errors)
