"""The command ``strapgen compare`` runs an algorithm on several back ends side by side."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from strapgen.cli.commands.verify import RunDiffering, header_command_of
from strapgen.cli.fixed_options import RUN_OPTIONS, FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import (
    STEP_OPTIONS,
    FastBackends,
    RunAlgorithm,
    SeveralMethods,
    backends,
    limit,
    one,
    option,
)
from strapgen.cli.output import Output
from strapgen.cli.sample_source import SampleSource
from strapgen.cli.systems.comparing import compared_system, counted
from strapgen.cli.systems.running import refuse_options
from strapgen.support.exceptions import InputError
from strapgen.systems.built_in import is_system

if TYPE_CHECKING:
    from strapgen.backends import Backend
    from strapgen.catalogue import Choice
    from strapgen.library.generation import Request
    from strapgen.reports.comparison import ComparedKernel


@grouped
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
        ),
    ] = "numpy",
    files: Annotated[
        list[Path] | None,
        option(
            "--source",
            metavar="FILE",
            help="C file that strapgen generated, as one more back end, in its own formats.",
            panel="Algorithm",
        ),
    ] = None,
    run_differing: RunDiffering = False,
    source: SampleSource,
    fixed: Annotated[FixedOptions, Shown(only=RUN_OPTIONS)],
    fail_above: Annotated[
        str | None,
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

    Of a described system you see how far each output departs over the run, and after a single pass from equal memories,
    beside the certified bound of a pass; the exit status is 1 if one is outside its bound.

    Example: strapgen compare euler --method rk4 --increments 2 --backend numpy,c,c-fixed32,c-fixed16 --carry full
    --reference exact --motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 --step 0.125 --duration 180
    """
    output.check(algorithm, *methods.files, *source.files)
    names = _backends(backend, reference, files)
    if is_system(algorithm):
        stated = {"--fail-above": fail_above, "--plot": output.plot}
        refuse_options(methods, fixed, [name for name in stated if stated[name]])
        return compared_system(algorithm, names, reference, (files, run_differing), source, fixed, output)
    choices = _taking_increments(methods.choices(algorithm))
    requests = {path: header_command_of(path).request([algorithm]) for path in files or ()}
    counts = {path: request.settings for path, request in requests.items()}
    most = limit("--fail-above", fail_above)
    source.check()
    _check_fixed(fixed, {*names, reference}, source.pulse_arcsec)

    import numpy as np

    from strapgen.experiments import comparison
    from strapgen.reports import plots
    from strapgen.reports.comparison import ComparedKernel, comparison_report

    kernels = []
    with np.errstate(all="ignore"):  # numbers that overflow are refused, in one line
        for choice in choices:
            inputs = source.read(choice.increments_per_step, choice.previous, choice.ahead)
            rows = comparison.compare(
                choice,
                backends=[*names, *_of_files(requests, choice, run_differing)],
                increments=inputs.increments,
                reference=reference,
                truth=inputs.truth,
                settings=counted(fixed.at_step(inputs.step).settings(choice.increments_per_step), counts),
            )
            kernels.append(
                ComparedKernel(choice.kernel, f"{choice.kernel}: {inputs.title}", rows, inputs.step)
            )
    drift = "drift from the truth" if source.motion is not None else f"drift from {reference}"
    output.report(
        comparison_report(kernels, reference, drift),
        lambda path: plots.comparison_image(kernels, reference, path),
    )
    _fail_above(kernels, most, f"further from {reference} than {fail_above} rad")


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
    from strapgen.experiments.verification import file_backend

    result = []
    for path, request in requests.items():
        if request.choice.kernel != choice.kernel:
            raise InputError(f"{path} is {request.choice.kernel}, and {choice.kernel} is compared")
        result.append(file_backend(path, request, run_differing=run_differing))
    return result


def _fail_above(kernels: list[ComparedKernel], most: float | None, said: str) -> None:
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


def _backends(text: str | None, reference: str, files: list[Path] | None) -> list[str]:
    from strapgen.backends import BACKENDS, DEFAULT_BACKENDS
    from strapgen.support import checks

    one("--reference", reference)
    # A file alone is compared with the reference.
    names = [] if files and text is None else backends("--backend", text, DEFAULT_BACKENDS)
    checks.choice("reference", reference, BACKENDS)
    return names


def _check_fixed(fixed: FixedOptions, backends: set[str], pulse: str | None) -> None:
    """Refuse options of fixed point that no back end of the run uses, and two scales of a gyro."""
    from strapgen.backends import BACKENDS

    fixed.check_pulse(pulse)
    fixed_point = [name for name, entry in BACKENDS.items() if entry.fixed]
    if not backends & {*fixed_point}:
        for name in fixed.stated:
            raise InputError(f"{name} is for fixed-point back ends, and none is named")
    any_word = [name for name in fixed_point if BACKENDS[name].word is None]
    if fixed.word is not None and not backends & {*any_word}:
        raise InputError(
            f"--word is for the back end {', '.join(any_word)}, which is not named; the others have their own"
        )
