"""Options for the source of increments: a motion, a recording of increments or one of rates."""

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
from strapgen.cli.values import Positive, Vector, line, names, whole
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motion_names import is_file

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from strapgen.lab.motions.motions import Motion
    from strapgen.lab.parallel_cases import Cluster
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
    "--motion --increments-csv --rates-csv",
    needed="one of --motion, --increments-csv, --rates-csv is needed; none given",
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


@dataclass(frozen=True)
class SampleSource:
    """Options for the source of the increments of a run."""

    panel: ClassVar[str] = "Input"
    rules: ClassVar[tuple[Rule, ...]] = (
        OneOf("--motion --increments-csv --rates-csv"),
        Needs("--set --step --duration --specific-force", "--motion"),
        Needs("--motion", "--duration"),
        Needs("--pulse-arcsec --errors", "--motion --increments-csv --rates-csv"),
        Needs(
            "--rate-unit --resample-hz --columns --time-unit --sample-hz --bridge-gaps --drop-repeated",
            "--rates-csv",
        ),
    )

    motion: Annotated[_Text, motion_option()] = None
    settings: MotionSettings = None
    step: Annotated[Positive | None, option("--step", metavar="S", help="Step length in s.")] = None
    duration: Annotated[
        Positive | None, option("--duration", metavar="S", help="Duration of each run in s.")
    ] = None
    increments_csv: Annotated[
        Path | None,
        option(
            "--increments-csv",
            metavar="FILE",
            help="CSV file of increments, in place of a motion: columns t in s, and dx, dy, dz in rad.",
        ),
    ] = None
    rates_csv: Annotated[
        Path | None,
        option(
            "--rates-csv",
            metavar="FILE",
            help="CSV file of rates, in place of a motion; its header names the time, three rates and their units.",
        ),
    ] = None
    rate_unit: Annotated[
        _Text,
        option(
            "--rate-unit",
            metavar="UNIT",
            help="Unit of the rates in --rates-csv where the header has none: rad/s, deg/s, dps or mdps.",
        ),
    ] = None
    columns: Annotated[
        tuple[str, ...] | None,
        option(
            "--columns",
            metavar="NAME,...",
            help="Names or numbers of the columns in --rates-csv where the header leaves them open: the time and three "
            "rates, or with --sample-hz the rates.",
        ),
    ] = None
    time_unit: Annotated[
        _Text,
        option(
            "--time-unit",
            metavar="UNIT",
            help="Unit of the times in --rates-csv where the header has none: s, ms, us or ns.",
        ),
    ] = None
    sample_hz: Annotated[
        Positive | None,
        option(
            "--sample-hz",
            metavar="HZ",
            help="Samples of the gyro in a second, in place of times in --rates-csv.",
        ),
    ] = None
    bridge_gaps: Annotated[
        bool,
        option(
            "--bridge-gaps",
            help="With --resample-hz, take the rate in --rates-csv as linear across gaps too, and say where.",
        ),
    ] = False
    drop_repeated: Annotated[
        bool,
        option(
            "--drop-repeated",
            help="Leave out rows of --rates-csv with the time of the row before, and say so.",
        ),
    ] = False
    resample_hz: Annotated[
        Positive | None,
        option(
            "--resample-hz",
            metavar="HZ",
            help="Integrate unevenly timed rates over an even grid of this frequency in Hz.",
        ),
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
    def file(self) -> Path:
        """The file of recorded data."""
        return self.increments_csv or self.rates_csv or Path()

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
        return self.increments_csv, self.rates_csv, of_motion, Path(self.errors) if self.errors else None

    def recording(self) -> Recording:
        """Read the recorded data."""
        from strapgen.lab.recordings import recording

        errors = self.sensor_errors()
        with waiting(f"reading {self.file.name}"):
            data = (
                recording.read_rates(
                    self.rates_csv or "",
                    self.rate_unit,
                    self.resample_hz,
                    columns=None if self.columns is None else ",".join(self.columns),
                    time_unit=self.time_unit,
                    sample_hz=self.sample_hz,
                    bridge_gaps=self.bridge_gaps,
                    drop_repeated=self.drop_repeated,
                )
                if self.increments_csv is None
                else recording.read_increments(self.increments_csv)
            )
        for remark in data.remarks:
            terminal.remark(f"strapgen: {self.file}: {remark}")
        return with_errors(data, errors)

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

        data = self.recording()
        beside = previous + ahead
        steps = max(0, len(data.samples) - beside) // samples
        if steps < 1:
            raise InputError(
                f"the recording holds {len(data.samples)} increments; a step needs {samples + beside}"
            )
        say_unused(self.file, len(data.samples) - beside - steps * samples, samples)
        increments = windows(data.samples[: beside + steps * samples], samples, beside)
        length = data.interval * samples
        return Inputs(increments, None, length, f"{self.file.name}, {steps} steps of {length:.6g} s")


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
            help="Roll, pitch and heading at the start of a motion in deg.  [default: zero rotation]",
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

    plot: Annotated[Path | None, plot_option("the plots")] = None
    format: Annotated[_Text, format_option(Output.formats, "  [default: text; csv for recorded data]")] = None
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
    """What runs algorithms of a kind: the functions take what the commands ``simulate`` and ``compare`` read."""

    #: Tells whether a name stands for one
    covers: Callable[[object], bool]
    #: Run one, and deliver the result
    simulate: Callable[..., None]
    compare: Callable[..., None]


def described(name: Any) -> DescribedAlgorithms | None:
    """Return the runner of an algorithm that another application describes; None for any other."""
    return next((kind for kind in registration.extensions("lab.described") if kind.covers(name)), None)
