"""The command ``strapgen simulate`` runs one algorithm on a motion or a recording."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any

from strapgen import registration
from strapgen.cli import terminal
from strapgen.cli.fixed_options import RUN_OPTIONS, FixedOptions
from strapgen.cli.option_groups import Excludes, Needs, Shown, grouped, rules, stated
from strapgen.cli.options import STEP_OPTIONS, MethodOptions, OneBackend, RunAlgorithm
from strapgen.cli.progress import say_unused
from strapgen.cli.values import Positive, written
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings.attitude_options import FormOptions, TruthOptions
from strapgen.lab.run_options import ONE_SCALE, SOURCE_NEEDED, RunOptions, RunOutput, SampleSource, described
from strapgen.run.orders import SEQUENTIAL

if TYPE_CHECKING:
    from strapgen.catalogue import Choice
    from strapgen.lab.recordings.attitude_output import AttitudeForm
    from strapgen.lab.recordings.recording import History, Recording
    from strapgen.lab.runs_report import HistoryResult
    from strapgen.run.backends import Backend


@grouped
@rules(
    SOURCE_NEEDED,
    Needs("--rates --matrices --print", "--motion"),
    Needs("@truth @form --format=tum|kitti|parquet", "--recording --increments-csv --rates-csv"),
    Excludes("--format=tum|kitti", "@form", "a trajectory has a form of its own, body to reference"),
    ONE_SCALE,
)
def simulate(
    algorithm: RunAlgorithm,
    *,
    method: Annotated[MethodOptions, Shown(only=(*STEP_OPTIONS, "rates"))],
    backend: OneBackend = "numpy",
    source: SampleSource,
    intervals: RunOptions,
    fixed: Annotated[FixedOptions, Shown(only=RUN_OPTIONS)],
    truth: TruthOptions,
    form: FormOptions,
    output: RunOutput,
) -> None:
    """Run an algorithm on a motion, or on recorded gyro data.

    The true attitude of a motion is known, so that you see the drift, scale and skew of the computed attitude; along a
    recording you see the attitude itself.

    With --errors the algorithm takes the increments of sensors with errors; the truth is still that of the motion.

    A file of a motion of your own has functions increments and attitude, which are checked against each other. With
    --rates the step takes the rate itself, so that you see the error of extracting it from increments.

    A recording is a log of any format that strapgen log shows; that command prints the one that runs it. Faults are
    refused unless --repair or --gaps allows them, and each is named once on stderr.

    Fixed-point formats are chosen for the increments of the run, or for --max-rate-deg-s if you give it.

    Example: strapgen simulate euler --method rk4 --increments 2 --backend c --motion coning --set a_deg_s=10 b_deg_s=10
    g_deg_s=10 --step 0.125 --duration 180 --orthonormalize 5 --record 5

    A described system, a built-in one or a file, runs at the rate that it states, or at that of --step; the navigation
    frame rests.

    Example: strapgen simulate dcm --backend c --recording gyro.csv --rate-unit deg/s --gaps bridge
    --out out/attitude.csv
    """
    if (others := described(algorithm)) is not None:
        for name in [*stated(truth), *stated(form)]:
            raise InputError(f"{name} is for attitude algorithms; {algorithm} is a described system")
        return others.simulate(algorithm, method, backend, source, intervals, fixed, output)
    choice = method.choose(algorithm)
    output.check(algorithm, *method.files, *source.files, *truth.files)
    source.check()
    fixed.check_backend(backend)

    import numpy as np

    from strapgen.run import backends

    def build(seconds: float, largest: Callable[[], float]) -> Backend:
        settings = fixed.settings_for_run(backend, choice.increments_per_step, seconds, largest)
        return backends.backend(
            choice,
            backend=backend,
            orthonormalization=intervals.scheme,
            settings=settings,
            order=intervals.order or SEQUENTIAL,
        )

    with np.errstate(all="ignore"):  # numbers that overflow are refused, in one line
        run = _OnRecording(truth, form.form()) if source.motion is None else _on_motion
        run(build, choice, source, intervals, output)


#: Most records that are written: the text of one takes some hundred bytes.
_MOST_RECORDS = 2_000_000


def _refuse_many(steps: float, step: float, record: Positive | None) -> None:
    """Refuse a run of more records than can be written, before it begins."""
    records = steps / max(1.0, float(record or 0) / step)
    if _MOST_RECORDS < records <= checks.MOST:  # more steps than that are refused as such
        raise InputError(
            f"{records:.0f} records are too many, up to {_MOST_RECORDS} are written; --record S thins them"
        )


_Build = Callable[[float, Callable[[], float]], "Backend"]


def _on_motion(
    build: _Build,
    choice: Choice,
    source: SampleSource,
    intervals: RunOptions,
    output: RunOutput,
) -> None:
    """Simulate, and deliver the run."""
    from strapgen.cli.progress import waiting
    from strapgen.lab import runs
    from strapgen.lab.runs_report import RunResult, step_facts

    assert source.step and source.duration, "the source is checked"
    pulse, step, duration = source.pulse, source.step, source.duration
    length = float(step)
    _refuse_many(float(duration) / length, length, intervals.record)
    every = None
    if output.print_every is not None:
        record = intervals.record or step
        every = checks.multiple("print", output.print_every, "record interval", record)
    start = intervals.start()
    profile = source.profile(start)
    samples, beside = choice.increments_per_step, (choice.previous, choice.ahead)

    def largest() -> float:
        if choice.increments is None:
            from strapgen import catalogue

            nodes = [float(node) for node in catalogue.nodes(choice)]
            return runs.largest_node_rotation(profile, step, duration, nodes)
        return runs.largest_increment(profile, step, duration, samples, pulse, beside)

    backend = build(length, largest)
    pulse = pulse or backend.count
    with waiting(f"running {backend.kernel}"):
        run = runs.simulate(
            backend, profile, step, duration, intervals.orthonormalize, intervals.record, pulse, start
        )
    facts = step_facts(backend, choice) | {
        "motion": profile.name,
        "step_s": length,
        "duration_s": float(duration),
    }
    facts |= {} if intervals.initial is None else {"initial_deg": written(intervals.initial)}
    facts |= source.facts
    title = f"{backend.kernel}, {backend.name}: {source.described(profile.name, ' motion')}, step {step} s"
    matrices, words = run if output.matrices else None, source.described(profile.name)
    output.show(RunResult(facts, run, output.title, matrices, words, every, title))


@dataclass(frozen=True)
class _OnRecording:
    """A run along recorded data: it is judged beside a true attitude, and written in a form."""

    truth: TruthOptions
    form: AttitudeForm

    def __call__(
        self, build: _Build, choice: Choice, source: SampleSource, intervals: RunOptions, output: RunOutput
    ) -> None:
        """Propagate, and deliver the attitude."""
        from strapgen.cli.progress import waiting
        from strapgen.lab.recordings import recording
        from strapgen.lab.recordings.attitude_options import Judge
        from strapgen.lab.runs_report import HistoryResult, step_facts

        pulse = source.pulse
        data = source.recorded()
        judge = Judge.of(self.truth, source, data, intervals.start())
        data, bias, said = judge.taken_off(data)
        length = data.interval * choice.increments_per_step
        _refuse_many(len(data.samples) / choice.increments_per_step, length, intervals.record)
        backend = build(length, lambda: data.largest + (pulse or 0.0))
        pulse = pulse or backend.count
        whole = (
            one for one in registration.extensions("lab.whole-recordings") if one.covers(choice, backend.name)
        )
        runner = next(whole, None)
        if runner is not None and intervals.order is not None:
            raise InputError(f"--order does not go with {choice.kernel}, which runs in a way of its own")

        def along(piece: Recording, record: Positive | None, start: Any) -> History:
            options = (intervals.orthonormalize, record, pulse, start)
            if runner is None:
                return recording.propagate(backend, piece, *options)
            found: History = runner.propagate_whole(choice, backend.name, piece, *options)
            return replace(found, elements=backend.elements, backend=backend)

        def run(piece: Recording) -> History:
            start = judge.start(piece.start)
            return along(judge.without_earth(piece, start, along), intervals.record, start)

        with waiting(f"running {backend.kernel}"):
            history = recording.along_pieces(data, run, backend.samples_per_step if runner is None else 1)
        error = judge.error(history)
        source.say_remarks(data)
        for remark in [*judge.remarks, *said]:
            terminal.remark(f"strapgen: {remark}")
        say_unused(source.file, history.unused, choice.increments_per_step)
        title = f"{backend.kernel}, {backend.name}: attitude along {source.file.name}"
        facts = step_facts(backend, choice) | {"source": source.source} | source.facts
        facts |= {} if intervals.initial is None else {"initial_deg": written(intervals.initial)}
        facts |= bias | judge.facts
        result = HistoryResult(facts, history, output.title, title, self.form, error)
        deliver_history(result, output)


def deliver_history(result: HistoryResult, output: RunOutput) -> None:
    """Deliver the attitude along a recording; text has the error, beside other formats stderr has it."""
    from strapgen.results.result import plot

    suffix = "" if output.file is None else output.file.suffix
    format = output.format or ("parquet" if suffix == ".parquet" else "csv")
    for line in result.error.lines() if result.error is not None and format != "text" else ():
        terminal.remark(f"strapgen: {line}")
    content = result.parquet() if format == "parquet" else result.written(format)
    output = replace(output, format=format)
    output.deliver(content, None if output.plot is None else plot(result, output.plot))
