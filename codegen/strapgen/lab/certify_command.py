"""The command ``strapgen certify`` says what rounding and the method did on a recorded run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from strapgen import registration
from strapgen.cli.fixed_options import RUN_OPTIONS, FixedOptions
from strapgen.cli.option_groups import Needs, OneOf, Shown, grouped, rules
from strapgen.cli.options import STEP_OPTIONS, MethodOptions, RunAlgorithm, option
from strapgen.cli.output import Output
from strapgen.cli.values import Positive, names, whole
from strapgen.ir.exceptions import InputError
from strapgen.lab.run_options import RecordingOptions, RunOptions, described

if TYPE_CHECKING:
    from strapgen.catalogue import Choice
    from strapgen.ir.fixed_settings import Settings
    from strapgen.lab.recordings.recording import History, Recording

#: The integer model of fixed-point code, with words of any length.
_MODEL = "fixed-model"
#: Part by which a stated step may differ from that of the recording.
_STEP_OFF = 0.01


@grouped
@rules(
    OneOf("--recording", needed="--recording is needed; none given"),
    Needs("--band-hz", "--amplitude-deg-s"),
    Needs("--amplitude-deg-s", "--band-hz"),
)
def certify(
    algorithm: RunAlgorithm,
    *,
    method: Annotated[MethodOptions, Shown(only=STEP_OPTIONS)],
    target: Annotated[
        str,
        option(
            "--target",
            metavar="NAME",
            help="Code that ran: c-fixed, c, c-float or numpy, or another target that strapgen list targets shows.",
            panel="Algorithm",
            read=names("strapgen.targets:TARGETS"),
        ),
    ] = "c-fixed",
    source: RecordingOptions,
    states: Annotated[
        Path | None,
        option(
            "--states",
            metavar="FILE[:TOPIC]",
            help="Log of states that the processor computed, words in the formats of the header, at ends of steps.  "
            "[default: the code runs here]",
            panel="Input",
        ),
    ] = None,
    late: Annotated[
        bool,
        option(
            "--commit-late",
            help="The unit that strapgen window generate writes: the window's attitude is committed late, from the "
            "first sample to the last, beside its answer of now.",
            panel="Algorithm",
        ),
    ] = False,
    intervals: Annotated[RunOptions, Shown(only=("orthonormalize", "scheme", "initial"))],
    band: Annotated[
        Positive | None,
        option(
            "--band-hz",
            metavar="HZ",
            help="Highest frequency of the true rate, for a bound from the true attitude.",
            panel="Input",
        ),
    ] = None,
    amplitude: Annotated[
        Positive | None,
        option(
            "--amplitude-deg-s",
            metavar="DEG_S",
            help="Sum of the amplitudes of the rate's lines: the length of the sums about x, y and z.",
            panel="Input",
        ),
    ] = None,
    fixed: Annotated[
        FixedOptions, Shown(only=(*RUN_OPTIONS, "step", "largest_angle", "multiply", "digits", "formats"))
    ],
    results: Annotated[
        Path | None,
        option(
            "--results",
            metavar="FILE",
            help="File for the results of finished parts, from which an interrupted certificate goes on.",
            panel="Run",
        ),
    ] = None,
    jobs: Annotated[
        int,
        option("--jobs", metavar="N", help="Number of processes.", panel="Run", read=whole(1, 1024)),
    ] = 1,
    output: Output,
) -> None:
    """Certify the error of rounding and method on a recorded run.

    A header's bound holds for every input; here the states are compared with exact arithmetic on the increments of this
    run, in numbers with a radius. The states are those of the code as it runs here, or those that a processor logged. A
    state that does not follow from the one before it is named with its time: the exit status is then 1.

    With --band-hz and --amplitude-deg-s you also see how far the attitude can be from the true one.

    With --commit-late it is the unit that commits the attitude of a window late: you see the rounding at its start, at
    its end and in its answer of now.

    Of a described system, such as two-speed-euler or a file, you see the rounding of each output, as of attitude,
    velocity and position, and which stage did most of it.

    Example: strapgen certify euler --recording examples/gyro_log.csv --gaps bridge
    """
    options = {
        "--states": states,
        "--orthonormalize": intervals.orthonormalize,
        "--scheme": intervals.scheme,
        "--band-hz": band,
        "--results": results,
        "--jobs": None if jobs == 1 else jobs,
    }
    given = [name for name, value in options.items() if value is not None]
    if (other := described(algorithm)) is not None:
        backend = _backend_of(target, fixed.word or 32, False)
        given += ["--commit-late"] if late else []
        return other.certify(algorithm, given, method, backend, source, intervals, fixed, output)
    choice = method.choose(algorithm)
    output.check(algorithm, *method.files, source.file, states)
    if choice.increments is None:
        raise InputError(f"{choice.kernel} takes rates; a certificate is of a step that takes increments")
    import typer

    from strapgen.cli.progress import waiting
    from strapgen.lab.certificate.certificate import certify as certified
    from strapgen.lab.run_options import whole_recording

    data = whole_recording(source.load())
    if late:
        for name in given:
            raise InputError(
                f"{name} does not go with --commit-late, whose unit normalizes and runs by itself"
            )
        return _late(choice, target, data, fixed, intervals, source, output)
    run = _run(choice, target, states, data, fixed, intervals)
    source.say_remarks(data)
    with waiting(f"certifying {choice.kernel}"):
        result = certified(
            run,
            band_hz=band,
            amplitude_deg_s=amplitude,
            results=results,
            jobs=jobs,
            instants=None if states is not None else 400,
        )
    result = replace(result, source=source.source)
    if states is not None:
        result = replace(result, backend=target, source=f"{states} along {source.source}")
    output.show(result)
    if result.faults:
        raise typer.Exit(1)


def _late(
    choice: Choice,
    target: str,
    data: Recording,
    fixed: FixedOptions,
    intervals: RunOptions,
    source: RecordingOptions,
    output: Output,
) -> None:
    """Certify the unit that commits the attitude of a window late."""
    from strapgen.cli.progress import waiting

    certified = registration.extension("lab.late-certificate", "--commit-late")
    backend = _backend_of(target, fixed.word or 32, False)
    fixed.check_backend(backend)
    settings = _settings(backend, fixed, choice, data.interval, data.largest)
    source.say_remarks(data)
    with waiting(f"certifying {choice.kernel}"):
        result = certified(choice, backend, data, settings=settings, initial=intervals.start())
    output.show(replace(result, source=source.source))


def _run(
    choice: Choice,
    target: str,
    states: Path | None,
    data: Recording,
    fixed: FixedOptions,
    intervals: RunOptions,
) -> History:
    """Return the run: the code along the recording, or the logged states."""
    from strapgen.cli.progress import waiting
    from strapgen.lab.certificate.state_log import read_states
    from strapgen.lab.recordings import recording
    from strapgen.run import backends

    step = data.interval * choice.increments_per_step
    word = fixed.word or 32
    name = _backend_of(target, word, states is not None)
    fixed.check_backend(name)
    settings = _settings(name, fixed, choice, step, None if states is not None else data.largest)
    made = backends.backend(
        choice,
        backend=name,
        orthonormalization=intervals.scheme,
        settings=settings,
    )
    if states is not None:
        if intervals.initial is not None:
            raise InputError("--initial-deg does not go with --states, which has the attitude at its start")
        return read_states(states, made, data, intervals.orthonormalize)
    with waiting(f"running {made.kernel}"):
        return recording.propagate(made, data, intervals.orthonormalize, None, made.count, intervals.start())


def _settings(
    backend: str, fixed: FixedOptions, choice: Choice, step: float, largest: float | None
) -> Settings | None:
    """Return the settings that the options of generate state; without a range, for a replay's largest increment."""
    from strapgen.ir.fixed_settings import Settings
    from strapgen.run.backend_names import BACKENDS

    if not BACKENDS[backend].fixed:
        return None
    if fixed.step is not None and abs(float(fixed.step) / step - 1) > _STEP_OFF:
        raise InputError(f"--step is {fixed.step} s, but the steps of the recording last {step:.6g} s")
    options = fixed if fixed.step is not None else fixed.at_step(step)
    settings = options.settings(choice.increments_per_step) or Settings()
    is_stated = fixed.max_rate_deg_s is not None or fixed.largest_angle is not None
    return settings if is_stated or largest is None else settings.fitted(largest)


def _backend_of(target: str, word: int, is_logged: bool) -> str:
    """Return the back end of a target with words of so many bits; of logged states, one that compiles nothing."""
    from strapgen.run.backend_names import BACKENDS
    from strapgen.targets import TARGETS

    if TARGETS[target].fixed:
        if is_logged:
            return _MODEL
        return next(
            (name for name, one in BACKENDS.items() if (one.target, one.word) == (target, word)), _MODEL
        )
    if is_logged and target not in ("c-float", "cpp-float", "rust-float"):
        return "numpy"
    return next(name for name, one in BACKENDS.items() if one.target == target)
