"""The command ``strapgen compare`` runs an algorithm on several back ends side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from strapgen import registration
from strapgen.cli import values
from strapgen.cli.fixed_options import RUN_OPTIONS, FixedOptions
from strapgen.cli.option_groups import Shown, grouped, rules, stated
from strapgen.cli.options import (
    STEP_OPTIONS,
    FastBackends,
    RunAlgorithm,
    SeveralMethods,
    a_backend,
    default_backends,
    option,
)
from strapgen.cli.output import Output
from strapgen.cli.progress import waiting
from strapgen.cli.values import NotNegative
from strapgen.ir.exceptions import InputError
from strapgen.lab.run_options import ONE_SCALE, SOURCE_NEEDED, SampleSource, described

if TYPE_CHECKING:
    from strapgen.catalogue import Choice
    from strapgen.ir.fixed_settings import Settings
    from strapgen.lab.comparison_report import ComparedKernel
    from strapgen.run.backends import Backend
    from strapgen.run.kernel_sources import Request

RunDiffering = Annotated[
    bool,
    option(
        "--run-differing",
        help="Compile and run a file that differs from what its command generates, with all that is in it.",
        panel="Input",
    ),
]


@grouped
@rules(SOURCE_NEEDED, ONE_SCALE)
def compare(
    algorithm: RunAlgorithm,
    *,
    methods: Annotated[SeveralMethods, Shown(only=STEP_OPTIONS)],
    backend: FastBackends = None,
    reference: Annotated[
        str,
        option(
            "--reference",
            metavar="NAME",
            help="Back end to compare with; exact computes with 40 digits.",
            panel="Algorithm",
            read=a_backend,
        ),
    ] = "numpy",
    files: Annotated[
        tuple[Path, ...] | None,
        option(
            "--source",
            metavar="FILE,...",
            help="C file that strapgen generated, as one more back end, in its own formats.",
            panel="Algorithm",
        ),
    ] = None,
    run_differing: RunDiffering = False,
    source: SampleSource,
    noise: Annotated[
        NotNegative | None,
        option(
            "--noise-deg-sqrt-h",
            metavar="N",
            help="Random walk of the gyro in deg per root of an hour, beside which several algorithms are judged.  "
            "[default: that of the longest rest]",
            panel="Input",
        ),
    ] = None,
    fixed: Annotated[FixedOptions, Shown(only=RUN_OPTIONS)],
    fail_above: Annotated[
        NotNegative | None,
        option(
            "--fail-above",
            metavar="RAD",
            help="Exit with 1 if a back end departs from the reference by more than this angle in rad.",
            panel="Output",
        ),
    ] = None,
    output: Output,
) -> None:
    """Compare back ends on the same increments with a reference.

    For each back end the table shows the largest and the rms angle from the reference in rad, for fixed point the
    certified bound, the largest angle in units in the last place, the drift, the time of a step, the bytes of its
    object code and its operations. Fixed-point formats are chosen for the increments of the run, or for
    --max-rate-deg-s if you give it. --plot draws the angle over time, and the certified bound after as many steps.

    Several algorithms, as euler,dcm, run along one recording on one back end: the spread of their attitudes is what the
    algorithm costs on this log, and a line says what a better one would be worth beside the noise of the gyro.

    Of a described system you see how far each output departs over the run, and after a single pass from equal memories,
    beside the certified bound of a pass; the exit status is 1 if one is outside its bound.

    Example: strapgen compare euler --method rk4 --increments 2 --backend numpy,c,c-fixed32,c-fixed16 --carry full
    --reference exact --motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 --step 0.125 --duration 180
    """
    output.check(algorithm, *methods.files, *source.files)
    if "," in algorithm:
        beside = {"--source": files, "--fail-above": fail_above, **stated(fixed)}
        return _compare_algorithms(algorithm, methods, backend, beside, source, noise, output)
    if noise is not None:
        raise InputError("--noise-deg-sqrt-h goes with several algorithms, as euler,dcm, along a recording")
    # A file alone is compared with the reference.
    names = backend or (() if files else default_backends())
    if (system := described(algorithm)) is not None:
        limits = {"--fail-above": fail_above, "--plot": output.plot}
        refused = [name for name, value in limits.items() if value is not None]
        to_run = (names, reference), (files, run_differing)
        return system.compare(algorithm, methods, refused, *to_run, source, fixed, output)
    choices = _taking_increments(methods.choices(algorithm))
    requests = {path: _source_files().header_command_of(path).request([algorithm]) for path in files or ()}
    source.check()
    _check_fixed(fixed, {*names, reference})

    from strapgen.lab.comparison_report import ComparisonResult

    kernels = [
        _compare(
            choice, [*names, *_of_files(requests, choice, run_differing)], reference, source, fixed, requests
        )
        for choice in choices
    ]
    drift = "drift from the truth" if source.motion is not None else f"drift from {reference}"
    output.show(ComparisonResult(kernels, reference, drift))
    _fail_above(kernels, fail_above, f"further from {reference} than {fail_above} rad")


def _compare_algorithms(
    algorithm: str,
    methods: SeveralMethods,
    backend: Sequence[str] | None,
    beside: Mapping[str, Any],
    source: SampleSource,
    noise: NotNegative | None,
    output: Output,
) -> None:
    """Compare the attitudes of several algorithms along a recording."""
    from strapgen.run.backends import BACKENDS

    names = values.listed("ALGORITHM", algorithm)
    source.check()
    name, *more = backend or ("numpy",)
    refused = [option for option, value in beside.items() if value is not None]
    if more or BACKENDS[name].fixed:
        refused.append(f"--backend {','.join((name, *more))}")
    if source.motion is not None or source.pulse is not None or refused:
        what = refused[0] if refused else "--motion" if source.motion is not None else "--pulse-arcsec"
        raise InputError(
            f"{what} does not go with several algorithms; they run along a --recording on one back end of doubles"
        )
    choices = _taking_increments([choice for one in names for choice in methods.choices(one)])

    from strapgen.lab.attitude_spread import spread

    data = source.recorded()
    with waiting(f"running {len(choices)} algorithms"):
        result = spread(choices, data, name, source.source, None if noise is None else float(noise))
    source.say_remarks(data)
    output.show(result)


def _compare(
    choice: Choice,
    backends: Sequence[str | Backend],
    reference: str,
    source: SampleSource,
    fixed: FixedOptions,
    requests: Mapping[Path, Request],
) -> ComparedKernel:
    """Run one step on all back ends."""
    import numpy as np

    from strapgen.lab import comparison
    from strapgen.lab.comparison_report import ComparedKernel

    counts = {path: request.settings for path, request in requests.items()}
    with np.errstate(all="ignore"):  # numbers that overflow are refused, in one line
        inputs = source.read(choice.increments_per_step, choice.previous, choice.ahead)
        rows = comparison.compare(
            choice,
            backends=backends,
            samples=inputs.increments,
            reference=reference,
            truth=inputs.truth,
            settings=with_counts(fixed.at_step(inputs.step).settings(choice.increments_per_step), counts),
        )
    return ComparedKernel(choice.kernel, f"{choice.kernel}: {inputs.title}", rows, inputs.step)


def _taking_increments(choices: list[Choice]) -> list[Choice]:
    """Return choices, and refuse a user's step that takes rates: back ends are compared on increments."""
    for choice in choices:
        if choice.increments is None:
            raise InputError(
                f"kernel {choice.kernel} takes rates at nodes; compare needs a step that takes increments"
            )
    return choices


def _of_files(requests: Mapping[Path, Request], choice: Choice, run_differing: bool) -> list[Backend]:
    """Return files as back ends of a step that is compared."""
    result = []
    for path, request in requests.items():
        if request.choice.kernel != choice.kernel:
            raise InputError(f"{path} is {request.choice.kernel}, and {choice.kernel} is compared")
        result.append(_source_files().file_backend(path, request, run_differing=run_differing))
    return result


def _source_files() -> Any:
    """Return the reader of generated files."""
    return registration.extension("lab.source-files", "--source")


def _fail_above(kernels: list[ComparedKernel], most: NotNegative | None, said: str) -> None:
    """Exit with 1 if a back end is further from the reference than allowed, where a limit is stated."""
    if most is None:
        return
    beyond = [(each.kernel, row) for each in kernels for row in each.rows if not row.max_abs_rad <= most]
    if beyond:
        several = len(kernels) > 1
        angles = ", ".join(
            f"{f'{kernel} on ' if several else ''}{row.backend} {row.max_abs_rad:.3g} rad"
            for kernel, row in beyond
        )
        typer.echo(f"strapgen: {said}: {angles}", err=True)
        raise typer.Exit(1)


def _check_fixed(fixed: FixedOptions, backends: set[str]) -> None:
    """Refuse options of fixed point that no back end of the run uses."""
    from strapgen.run.backends import BACKENDS

    fixed_point = [name for name, entry in BACKENDS.items() if entry.fixed]
    if not backends & {*fixed_point}:
        for name in stated(fixed):
            raise InputError(f"{name} is for fixed-point back ends, and none is named")
    any_word = [name for name in fixed_point if BACKENDS[name].word is None]
    if fixed.word is not None and not backends & {*any_word}:
        raise InputError(
            f"--word is for the back end {', '.join(any_word)}, which is not named; the others have their own"
        )


def with_counts(settings: Settings | None, files: Mapping[Path, Settings | None]) -> Settings | None:
    """Return settings with the gyro whose counts the files take: all back ends then run on its counts."""
    from strapgen.ir.fixed_settings import Settings

    gyros = {} if settings is None or settings.sensor is None else {settings.sensor: "the command"}
    for path, one in files.items():
        if one is not None and one.sensor is not None:
            gyros.setdefault(one.sensor, str(path))
    if len(gyros) > 1:
        both = " and ".join(f"{sensor.stated} of {place}" for sensor, place in gyros.items())
        raise InputError(f"{both} are different gyros; one run has the counts of one")
    counting = next((one for one in files.values() if one and one.sensor), None)
    if counting is None or (settings is not None and settings.sensor is not None):
        return settings
    return replace(settings or Settings(), sensor=counting.sensor, input_bits=counting.input_bits)
