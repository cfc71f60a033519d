"""Options for the source of increments: a motion or a recording."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple, TypeVar

from strapgen import registration
from strapgen.cli import terminal
from strapgen.cli.option_groups import Excludes, Needs, OneOf, Rule
from strapgen.cli.options import option
from strapgen.cli.output import Output, format_option, plot_option
from strapgen.cli.progress import say_unused, waiting
from strapgen.cli.values import Number, Positive, Vector, line, names, whole
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motion_names import is_file
from strapgen.lab.recordings.attitude_names import TRAJECTORIES
from strapgen.lab.recordings.log_topic import split_topic
from strapgen.run.orders import ORDERS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from strapgen.lab.motions.motions import Motion
    from strapgen.lab.parallel_cases import Cluster
    from strapgen.lab.recordings.reading import Reading
    from strapgen.lab.recordings.recording import Recording
    from strapgen.lab.sensor_errors.instruments import InstrumentErrors

_Text = str | None

#: Names of motions with a closed-form attitude, and of all that a run can have, for the help.
MOTION_NAMES = "constant, sinusoidal, coning or polynomial"
_RUN_MOTION_NAMES = "constant, sinusoidal, coning, polynomial, cone, random, slew, ramps or vibration"

#: The settings of the motion of a line, for a shell to complete
MOTION_SETTINGS = f"{__name__}:motion_settings"
MotionSettings = Annotated[
    dict[str, str] | None,
    option(
        "--set",
        metavar="KEY=VALUE...",
        help="Parameters of the motion; strapgen list motions shows their names.",
        panel="Input",
        words=MOTION_SETTINGS,
    ),
]

#: Rules of the commands that run an algorithm: where its increments come from, and the angle of a count.
SOURCE_NEEDED = OneOf(
    "--motion --recording --increments-csv --rates-csv",
    needed="one of --motion, --recording is needed; none given",
)
ONE_SCALE = OneOf("--pulse-arcsec --lsb --lsb-rad")

Recorded = TypeVar("Recorded", bound="Recording")

#: The option of sensor errors, for every command that runs an algorithm.
SensorFile = Annotated[
    str | None,
    option(
        "--errors",
        metavar="FILE",
        help="TOML file of sensor errors, or a class: ins-0.1, ins-1, ahrs or midcourse.  [default: no errors]",
        words="strapgen.lab.sensor_errors.error_file:CLASSES",
        panel="Input",
    ),
]

#: Most processes of a study on this machine.
_MOST = 1024


def a_motion(option: str, text: str) -> str:
    """Read a motion with a closed form, or the file of one."""
    return text if is_file(text) else names("strapgen.catalogue:MOTIONS")(option, text)


def motion_settings(values: Mapping[str, Any]) -> list[str]:
    """Return the settings of the motion that a command line names."""
    from strapgen.lab.motions.motions import keys

    motion = values.get("motion")
    return [f"{key}=" for choices in keys(str(motion)).values() for key in choices] if motion else []


def _motion_of_a_run(option: str, text: str) -> str:
    return text if is_file(text) else names("strapgen.lab.motions.motion_names:MOTIONS")(option, text)


def motion_option(default: str = "") -> Any:
    """Return the option of a motion that a run can have; `default` is what is run without one, in words."""
    remark = f"  [default: {default}]" if default else ""
    text = f"Motion: {_RUN_MOTION_NAMES}, or a Python file of your own.{remark}"
    return option("--motion", metavar="NAME", help=text, panel="Input", read=_motion_of_a_run)


@dataclass(frozen=True)
class Inputs:
    """Increments of a run, and the truth where it is known."""

    #: (N, K, 3): in rad
    increments: NDArray[Any]
    #: (1 + N, 3, 3)
    truth: NDArray[Any] | None
    #: In s
    step: float
    #: Where they come from, in words for a reader
    title: str


#: Names of the faults that are repaired, what is done at a gap, and what samples are, for completion.
_REPAIRS = ("repeats", "order", "clock", "nan", "stuck", "all")
_GAPS = ("refuse", "split", "bridge")
_INPUTS = ("increments", "rates", "instants")


@dataclass(frozen=True)
class RecordingOptions:
    """Options of a recording: its file, what its columns mean, and what is done about its faults."""

    panel: ClassVar[str] = "Input"
    rules: ClassVar[tuple[Rule, ...]] = (
        Needs(
            "--input --columns --time-unit --rate-unit --force-unit --sample-hz --axes --start --end --every --gaps "
            "--repair --grid --resample-hz",
            "--recording --rates-csv --increments-csv",
        ),
    )

    recording: Annotated[
        Path | None,
        option(
            "--recording",
            metavar="FILE[:TOPIC]",
            help="Recorded rates or increments of a gyro; strapgen log FILE shows what a file holds.",
        ),
    ] = None
    input: Annotated[
        _Text,
        option(
            "--input",
            metavar="NAME",
            help="What the samples are: increments in rad; rates, means over the interval before each time; or "
            "instants, rates at the times.  [default: increments or rates, by the names of the columns]",
            read=names(_INPUTS),
        ),
    ] = None
    columns: Annotated[
        tuple[str, ...] | None,
        option(
            "--columns",
            metavar="NAME,...",
            help="Names or numbers of the columns where the file leaves them open: the time and three samples, or "
            "t=NAME,x=NAME,y=NAME,z=NAME, with fx, fy, fz for forces; with --sample-hz without the time.",
        ),
    ] = None
    time_unit: Annotated[
        _Text,
        option(
            "--time-unit",
            metavar="UNIT",
            help="Unit of the times where the file has none: s, ms, us or ns.",
        ),
    ] = None
    rate_unit: Annotated[
        _Text,
        option(
            "--rate-unit",
            metavar="UNIT",
            help="Unit of the rates where the file has none: rad/s, mrad/s, deg/s, dps, mdps or deg/h.",
        ),
    ] = None
    force_unit: Annotated[
        _Text,
        option(
            "--force-unit",
            metavar="UNIT",
            help="Unit of the specific forces where the file has none: m/s^2, g or mg.",
        ),
    ] = None
    sample_hz: Annotated[
        Positive | None,
        option(
            "--sample-hz",
            metavar="HZ",
            help="Samples of the gyro in a second, in place of a column of times.",
        ),
    ] = None
    axes: Annotated[
        _Text,
        option(
            "--axes",
            metavar="X,Y,Z",
            help="The sensor's axes that are the body's x, y and z, as x,-y,-z.",
        ),
    ] = None
    start: Annotated[
        Number | None,
        option("--start", metavar="S", help="Time in s after the first row from which rows are read."),
    ] = None
    end: Annotated[
        Number | None,
        option("--end", metavar="S", help="Time in s after the first row up to which rows are read."),
    ] = None
    every: Annotated[
        int | None,
        option(
            "--every",
            metavar="N",
            help="Number of samples that are summed into one increment.  [default: 1]",
            read=whole(1),
        ),
    ] = None
    grid: Annotated[
        bool,
        option(
            "--grid",
            help="The times are the instants of the samples: take these to an even grid by filters.  [default: samples "
            "are even]",
        ),
    ] = False
    gaps: Annotated[
        _Text,
        option(
            "--gaps",
            metavar="NAME",
            help="What is done where samples are lost: refuse; split, each piece starts anew; or bridge, single ones "
            "are restored by a filter, several put on a line.  [default: refuse]",
            read=names(_GAPS),
        ),
    ] = None
    repair: Annotated[
        tuple[str, ...] | None,
        option(
            "--repair",
            metavar="NAME,...",
            help="Faults that are repaired: repeats, order, clock, nan, stuck, or all.  [default: none]",
            read=names(_REPAIRS),
        ),
    ] = None
    increments_csv: Annotated[
        Path | None,
        option(
            "--increments-csv", metavar="FILE", help="Old: --recording with --input increments.", hidden=True
        ),
    ] = None
    rates_csv: Annotated[
        Path | None,
        option("--rates-csv", metavar="FILE", help="Old: --recording with --input instants.", hidden=True),
    ] = None
    resample_hz: Annotated[
        Positive | None,
        option("--resample-hz", metavar="HZ", help="Old: --every, a whole number of samples.", hidden=True),
    ] = None

    @property
    def source(self) -> str:
        """The file, with its topic if one is stated."""
        return str(self.recording or self.increments_csv or self.rates_csv or "")

    @property
    def place(self) -> tuple[Path, str]:
        """The file and the topic."""
        return split_topic(self.source)

    @property
    def file(self) -> Path:
        """The file of recorded data."""
        return self.place[0]

    def reading(self, *, force: bool = False) -> Reading:
        """Return how the recorded data are read."""
        from strapgen.lab.recordings.reading import Reading

        of_old = (
            "increments"
            if self.increments_csv is not None
            else "instants"
            if self.rates_csv is not None
            else None
        )
        if self.resample_hz is not None and self.every is not None:
            raise InputError("--every and --resample-hz are both given; one is needed")
        return Reading(
            self.input or of_old,
            None if self.columns is None else ",".join(self.columns),
            *(
                self.time_unit,
                self.rate_unit,
                self.force_unit,
                self.sample_hz,
                self.axes,
                self.start,
                self.end,
            ),
            *(self.every or 1, self.gaps or "refuse", self.repair or (), force, self.resample_hz, self.grid),
        )

    def load(self, *, force: bool = False) -> Recording:
        """Read the recorded data."""
        from strapgen.lab.recordings import recording

        file, topic = self.place
        reading = self.reading(force=force)
        with waiting(f"reading {file.name}"):
            return recording.recorded(file, topic, reading)

    def say_remarks(self, data: Recording) -> None:
        """Say what was taken for what, once a run along a recording is not refused."""
        for remark in data.remarks:
            terminal.remark(f"strapgen: {self.file}: {remark}")
        old = {
            "--increments-csv is now --recording, with --input increments": self.increments_csv,
            "--rates-csv is now --recording, with --input instants": self.rates_csv,
            "--resample-hz is now --every, a whole number of samples": self.resample_hz,
        }
        for text in (text for text, value in old.items() if value is not None):
            terminal.remark(f"strapgen: {text}")


@dataclass(frozen=True)
class SampleSource(RecordingOptions):
    """Options for the source of the increments of a run."""

    rules: ClassVar[tuple[Rule, ...]] = (
        *RecordingOptions.rules,
        OneOf("--motion --recording --increments-csv --rates-csv"),
        Needs("--set --step --duration --specific-force", "--motion"),
        Needs("--motion", "--duration"),
        Needs("--pulse-arcsec --errors", "--motion --recording --increments-csv --rates-csv"),
    )

    motion: Annotated[_Text, motion_option()] = None
    settings: MotionSettings = None
    step: Annotated[Positive | None, option("--step", metavar="S", help="Step length in s.")] = None
    duration: Annotated[
        Positive | None, option("--duration", metavar="S", help="Duration of each run in s.")
    ] = None
    pulse_arcsec: Annotated[
        Positive | None,
        option(
            "--pulse-arcsec",
            metavar="ARCSEC",
            help="Angle of a gyro pulse in arc seconds; increments become whole pulses, the rest goes into the next.",
        ),
    ] = None

    specific_force: Annotated[
        Vector | None,
        option(
            "--specific-force",
            metavar="X,Y,Z",
            help="Specific force in m/s^2, constant in reference axes: on a described system, or on sensors with "
            "--errors.  [default: 0,0,0]",
        ),
    ] = None
    errors: SensorFile = None

    def check(self) -> None:
        """Check the options of an algorithm that is not a described system."""
        if self.specific_force is not None and self.errors is None:
            raise InputError("--specific-force goes with a described system or --errors")
        if self.motion is not None and self.step is None:
            raise InputError("--motion needs --step in s")

    @property
    def pulse(self) -> float | None:
        """The angle of a gyro pulse in rad."""
        return None if self.pulse_arcsec is None else math.radians(float(self.pulse_arcsec) / 3600)

    @property
    def force(self) -> tuple[float, float, float]:
        """The specific force in m/s^2, in reference axes."""
        x, y, z = map(float, self.specific_force or (0, 0, 0))
        return x, y, z

    def profile(self, start: Any = None) -> Motion:
        """Return the motion with its parameters, as sensors measure it if they have errors.

        A motion of a file is checked over the duration of the run.

        `start` (3, 3): attitude at the start, body to reference; by default there is no rotation.
        """
        from strapgen.lab.motions.users_motions import any_motion

        true = any_motion(self.motion or "", self.duration or "", self.settings or {})
        errors = self.sensor_errors()
        if errors is None:
            return true
        from strapgen.lab.sensor_errors.measured_motions import measured

        force = None if self.specific_force is None else self.force
        return measured(true, errors, force=force, start=start)

    def sensor_errors(self) -> InstrumentErrors | None:
        """Return the errors of the sensors; None without a file."""
        errors = read_errors(self.errors)
        if errors is not None and self.pulse_arcsec is not None and errors.gyro.pulse.any():
            raise InputError("--pulse-arcsec and the pulse in --errors are both there; one of them is needed")
        return errors

    @property
    def facts(self) -> dict[str, Any]:
        """Facts on the sensors for a report; none without errors."""
        return {} if self.errors is None else {"errors": self.errors}

    def described(self, name: str, noun: str = "") -> str:
        """Return the name of the motion with its parameters, for a title."""
        words = in_words(self.settings or {})
        return f"{name}{noun} ({words})" if words else f"{name}{noun}"

    @property
    def files(self) -> tuple[Path | None, ...]:
        """The files that the options name."""
        of_motion = Path(self.motion) if self.motion is not None and is_file(self.motion) else None
        return self.file if self.source else None, of_motion, Path(self.errors) if self.errors else None

    def recorded(self) -> Recording:
        """Read the recorded data, as sensors measure it if they have errors."""
        errors = self.sensor_errors()
        return with_errors(self.load(), errors)

    def read(self, samples: int, previous: int = 0, ahead: int = 0) -> Inputs:
        """Return the increments that the options describe."""
        from strapgen.run.increments import pulses

        pulse = self.pulse
        read = (self._recorded if self.motion is None else self._computed)(samples, previous, ahead)
        if pulse is None:
            return read
        return Inputs(pulses(read.increments, pulse, previous + ahead), read.truth, read.step, read.title)

    def _computed(self, samples: int, previous: int, ahead: int) -> Inputs:
        import numpy as np

        profile, step, duration = self.profile(), self.step or Positive("1"), self.duration or Positive("1")
        steps = checks.multiple("duration", duration, "step", step)
        increments, length = profile.increments(step, steps, samples, previous, ahead), float(step)
        truth = profile.attitude(np.arange(1 + steps) * length)
        return Inputs(
            increments,
            truth,
            length,
            f"{self.described(self.motion or '', ' motion')}, {steps} steps of {self.step} s",
        )

    def _recorded(self, samples: int, previous: int, ahead: int) -> Inputs:
        from strapgen.run.increments import windows

        data = whole_recording(self.recorded())
        beside = previous + ahead
        steps = max(0, len(data.samples) - beside) // samples
        if steps < 1:
            raise InputError(
                f"the recording holds {len(data.samples)} increments; a step needs {samples + beside}"
            )
        self.say_remarks(data)
        say_unused(self.file, len(data.samples) - beside - steps * samples, samples)
        increments = windows(data.samples[: beside + steps * samples], samples, beside)
        length = data.interval * samples
        return Inputs(increments, None, length, f"{self.file.name}, {steps} steps of {length:.6g} s")


def whole_recording(data: Recorded) -> Recorded:
    """Return a recording of one piece; refuse others."""
    if data.breaks:
        raise InputError("--gaps split goes with simulate alone; --gaps bridge goes here too")
    return data


def inertial(source: RecordingOptions, errors: str | None) -> Any:
    """Return a recording with velocity increments, as sensors with errors measure it."""
    return with_errors(whole_recording(source.load(force=True)), read_errors(errors))


def read_errors(source: str | None) -> InstrumentErrors | None:
    """Return the errors that --errors names; None without it."""
    if source is None:
        return None
    from strapgen.lab.sensor_errors.error_file import read

    return read(source)


def with_errors(data: Recorded, errors: InstrumentErrors | None) -> Recorded:
    """Return a recording as sensors with errors measure what it holds."""
    if errors is None:
        return data
    from strapgen.lab.sensor_errors.measured_motions import measured_recording

    return measured_recording(data, errors)


def in_words(settings: Mapping[str, str]) -> str:
    """Return settings for a reader."""
    return ", ".join(f"{key}={value}" for key, value in settings.items())


@dataclass(frozen=True)
class RunOptions:
    """Options of the attitude at the start, and of the times between orthonormalizations and between records."""

    panel: ClassVar[str] = "Run"

    orthonormalize: Annotated[
        Positive | None,
        option(
            "--orthonormalize",
            metavar="S",
            help="Time from one orthonormalization to the next in s.  [default: never]",
        ),
    ] = None
    scheme: Annotated[
        _Text,
        option(
            "--scheme",
            metavar="NAME",
            help="Kernel that orthonormalizes; strapgen list kernels shows all.  [default: the thesis's scheme]",
            words="strapgen.catalogue:KERNELS",
        ),
    ] = None
    record: Annotated[
        Positive | None,
        option(
            "--record",
            metavar="S",
            help="Time from one record to the next in s; it must divide the duration.  [default: every step]",
        ),
    ] = None
    initial: Annotated[
        Vector | None,
        option(
            "--initial-deg",
            metavar="R,P,H",
            help="Roll, pitch and heading at the start in deg, of each piece of a recording.  [default: zero rotation]",
        ),
    ] = None
    order: Annotated[
        _Text,
        option(
            "--order",
            metavar="ORDER",
            help="sequential multiplies the steps one after the other; scan multiplies blocks of steps side by side, "
            "on the back ends c and c-float: its bits are its own, by rounding.  [default: sequential]",
            read=names(ORDERS),
        ),
    ] = None

    def start(self) -> Any:
        """Return the matrix at the start of a run, (3, 3); None for zero rotation."""
        if self.initial is None:
            return None
        import numpy as np

        from strapgen.run.backends import evaluator

        return evaluator("dcm-from-euler-angles")(np.radians([*map(float, self.initial)]))


@dataclass(frozen=True)
class RunOutput(Output):
    """Options for the output of a run; the attitude along a recording is CSV by default."""

    rules: ClassVar[tuple[Rule, ...]] = (
        Needs("--matrices", "--format=json"),
        Excludes("--print", "--format=json|csv|markdown|latex"),
    )
    formats: ClassVar[tuple[str, ...]] = (*Output.formats, *TRAJECTORIES, "parquet")

    plot: Annotated[Path | None, plot_option("the plots")] = None
    format: Annotated[
        _Text,
        format_option(formats, "  [default: text; for recorded data csv, or parquet by the file's name]"),
    ] = None
    title: Annotated[
        _Text, option("--title", metavar="TEXT", help="Title of the text, and of the plots.", read=line)
    ] = None
    print_every: Annotated[
        Positive | None,
        option(
            "--print",
            metavar="S",
            help="Time in s from one print of the matrices to the next in the text.  [default: at the end alone]",
        ),
    ] = None
    matrices: Annotated[
        bool, option("--matrices", help="Add the computed and the true matrices to the JSON output.")
    ] = False

    def check(self, *read: str | Path | None) -> None:
        """Check what `Output` checks, and that a file without text is none for the terminal."""
        super().check(*read)
        if self.format == "parquet" and self.file is None:
            raise InputError("--format parquet is no text; --out FILE is needed")


@dataclass(frozen=True)
class WorkerOptions:
    """Options for the workers of a study."""

    panel: ClassVar[str] = "Run"
    rules: ClassVar[tuple[Rule, ...]] = (OneOf("--jobs --scheduler --cluster"),)

    jobs: Annotated[
        int | None,
        option(
            "--jobs",
            metavar="N",
            help="Number of processes that run side by side.  [default: one for each processor]",
            read=whole(1, _MOST),
        ),
    ] = None
    scheduler: Annotated[
        str | None,
        option(
            "--scheduler",
            metavar="ADDRESS",
            help="Dask scheduler whose workers run the cases, as tcp://10.0.0.7:8786.",
        ),
    ] = None
    cluster: Annotated[
        str | None,
        option(
            "--cluster",
            metavar="CLUSTER",
            help="local:N runs the cases on a Dask cluster of N workers on this machine.",
        ),
    ] = None

    def workers(self) -> Cluster | None:
        """Return the cluster, checked; None where none is stated."""
        from strapgen.lab.parallel_cases import Cluster

        return Cluster.of(self.scheduler, self.cluster)


class DescribedAlgorithms(NamedTuple):
    """What runs algorithms of a kind: the functions take what the commands of their names read."""

    #: Tells whether a name stands for one
    covers: Callable[[object], bool]
    #: Run one, and deliver the result
    simulate: Callable[..., None]
    compare: Callable[..., None]
    certify: Callable[..., None]


def described(name: Any) -> DescribedAlgorithms | None:
    """Return the runner of an algorithm that another application describes; None for any other."""
    return next((kind for kind in registration.extensions("lab.described") if kind.covers(name)), None)
