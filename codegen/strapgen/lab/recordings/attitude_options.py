"""Options that judge the attitude along a recording, and those of the form in which it is written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple

from strapgen.cli.option_groups import Needs, OneOf, Rule
from strapgen.cli.options import option
from strapgen.cli.values import Number, names
from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings.attitude_names import ALIGNMENTS, FORMS, LEVEL_AXES, QUATERNIONS, SENSES
from strapgen.lab.recordings.log_topic import split_topic

if TYPE_CHECKING:
    from strapgen.lab.recordings.attitude_output import AttitudeForm
    from strapgen.lab.recordings.recording import History, Recording
    from strapgen.lab.recordings.rest import Rest
    from strapgen.lab.recordings.true_attitude import AttitudeError, TimeOffset, TrueAttitude
    from strapgen.lab.run_options import RecordingOptions

_REST = "rest"


def _bias(option: str, text: str) -> Any:
    """Read a bias: rest, or three numbers."""
    if text == _REST:
        return text
    words = text.replace(",", " ").split()
    if len(words) != 3:
        raise InputError(f"{option} is {text!r}; rest, or three numbers in deg/s as 0.1,-0.2,0, are needed")
    return tuple(Number.read(option, word) for word in words)


def _interval(option: str, text: str) -> Any:
    """Read two times with a colon between."""
    words = text.split(":")
    if len(words) != 2:
        raise InputError(f"{option} is {text!r}; two times in s with a colon between are needed, as 0:5")
    return tuple(Number.read(option, word) for word in words)


@dataclass(frozen=True)
class BiasOptions:
    """Options of what is taken off the rates of a recording."""

    panel: ClassVar[str] = "Input"
    rules: ClassVar[tuple[Rule, ...]] = (OneOf("--bias --bias-from"),)

    bias: Annotated[
        str | None,
        option(
            "--bias",
            metavar="X,Y,Z",
            help="Rate to take off, in deg/s; rest is that of the longest rest, found by its variance.",
            read=_bias,
        ),
    ] = None
    bias_from: Annotated[
        str | None,
        option(
            "--bias-from",
            metavar="S:S",
            help="Take off the mean rate between two times in s after the start, when the gyro rests, as 0:5.",
            read=_interval,
        ),
    ] = None

    def rest(self, data: Recording) -> Rest | None:
        """Return the rest whose rate is taken off; None where the bias is stated or there is none."""
        from strapgen.lab.recordings.rest import longest_rest, rest_between

        if self.bias_from is not None:
            begin, end = map(float, self.bias_from)
            return rest_between(data, data.start + begin, data.start + end)
        return longest_rest(data) if self.bias == _REST else None

    def taken_off(self, data: Recording, rest: Rest | None, earth: Any = 0.0) -> TakenOff:
        """Return a recording less the bias: as stated, or that of a rest, which holds the Earth's rate in rad/s too."""
        import numpy as np

        from strapgen.lab.recordings.rest import without_rate

        if rest is not None:
            bias = np.degrees(rest.rate - earth)
            spread = {"bias_uncertainty_deg_s": np.degrees(rest.uncertainty).tolist()}
            said = [f"taken off, {rest.in_words(data.start, bias)}"]
        elif self.bias is not None:
            bias, spread = np.array([*map(float, self.bias)]), {}
            said = [f"taken off, as stated: {', '.join(f'{x:g}' for x in bias)} deg/s"]
        else:
            return TakenOff(data, {}, [])
        return TakenOff(without_rate(data, np.radians(bias)), {"bias_deg_s": bias.tolist()} | spread, said)


class TakenOff(NamedTuple):
    """A recording less a bias, with facts for a report and remarks for a reader."""

    data: Recording
    facts: dict[str, Any]
    remarks: list[str]


@dataclass(frozen=True)
class TruthOptions(BiasOptions):
    """Options of the rate that is taken off, and of the true attitude that a run is judged by."""

    rules: ClassVar[tuple[Rule, ...]] = (
        *BiasOptions.rules,
        Needs(
            "--true-columns --true-quaternion --true-sense --true-time-unit --time-offset --align",
            "--true-attitude",
        ),
        Needs("--level-axes", "--latitude-deg"),
    )

    latitude: Annotated[
        Number | None,
        option(
            "--latitude-deg",
            metavar="DEG",
            help="Take off the Earth's rate at this latitude; the reference axes are level, and turn with the Earth.",
        ),
    ] = None
    level_axes: Annotated[
        str | None,
        option(
            "--level-axes",
            metavar="NAME",
            help="Level axes with --latitude-deg: north, east, down or east, north, up.  [default: ned]",
            read=names(LEVEL_AXES),
        ),
    ] = None
    true_attitude: Annotated[
        Path | None,
        option(
            "--true-attitude",
            metavar="FILE[:TOPIC]",
            help="Log with a true attitude: the run begins at it, and is compared with it.",
        ),
    ] = None
    true_columns: Annotated[
        tuple[str, ...] | None,
        option(
            "--true-columns",
            metavar="NAME,...",
            help="Names or numbers of the true attitude's columns where the file leaves them open: the time, and a "
            "quaternion or roll, pitch, heading.",
        ),
    ] = None
    true_quaternion: Annotated[
        str | None,
        option(
            "--true-quaternion",
            metavar="ORDER",
            help="Order of the true quaternion, xyzs or sxyz.  [default: by the names of the columns]",
            read=names(QUATERNIONS),
        ),
    ] = None
    true_sense: Annotated[
        str | None,
        option(
            "--true-sense",
            metavar="NAME",
            help="What the true attitude turns.  [default: body-to-reference]",
            read=names(SENSES),
        ),
    ] = None
    true_time_unit: Annotated[
        str | None,
        option(
            "--true-time-unit",
            metavar="UNIT",
            help="Unit of its times where the file has none: s, ms, us or ns.",
        ),
    ] = None
    time_offset: Annotated[
        Number | None,
        option(
            "--time-offset",
            metavar="S",
            help="What the clock of the true attitude shows more, in s.  [default: estimated by the correlation of the "
            "rates]",
        ),
    ] = None
    align: Annotated[
        str | None,
        option(
            "--align",
            metavar="NAME",
            help="Axes that are turned before the error is taken: start, equal at the start; mean, reference axes; "
            "mounting, body axes too; or none.  [default: start; none with --initial-deg]",
            read=names(tuple(ALIGNMENTS)),
        ),
    ] = None

    @property
    def files(self) -> tuple[Path | None, ...]:
        """The file that is read."""
        return (None if self.true_attitude is None else split_topic(str(self.true_attitude))[0],)

    def read(self, recording: RecordingOptions) -> TrueAttitude | None:
        """Read the true attitude, at the sampling rate of a recording in the same file; None without one."""
        from strapgen.lab.recordings.true_attitude import TrueAttitude

        if self.true_attitude is None:
            return None
        file, topic = split_topic(str(self.true_attitude))
        return TrueAttitude.read(
            file,
            topic,
            columns=None if self.true_columns is None else ",".join(self.true_columns),
            order=self.true_quaternion,
            sense=self.true_sense or "body-to-reference",
            time_unit=self.true_time_unit,
            sample_hz=recording.sample_hz if file == recording.file else None,
        )


@dataclass(frozen=True)
class Judge:
    """What a run along a recording begins at, and is compared with."""

    options: TruthOptions
    truth: TrueAttitude | None
    offset: TimeOffset | None
    #: (3, 3): stated, body to reference; None where none is
    initial: Any
    align: str
    #: Of the recording, in s
    interval: float

    @classmethod
    def of(cls, options: TruthOptions, recording: RecordingOptions, data: Recording, initial: Any) -> Judge:
        """Read the true attitude, and compare the clocks."""
        from strapgen.lab.recordings.true_attitude import TimeOffset, time_offset

        truth = options.read(recording)
        offset = None
        if truth is not None:
            if options.time_offset is None:  # a bias changes the magnitudes that tell the offset
                offset = time_offset(options.taken_off(data, options.rest(data)).data, truth)
            else:
                offset = TimeOffset(float(options.time_offset))
        align = options.align or ("start" if initial is None else "none")
        return cls(options, truth, offset, initial, align, data.interval)

    def start(self, time: float) -> Any:
        """Return the attitude at a start, (3, 3): as stated, or the true one with that alignment; None if neither."""
        import numpy as np

        from strapgen.lab.recordings.quaternions import matrices

        if self.initial is not None or self.truth is None or self.offset is None or self.align != "start":
            return self.initial
        # A first mean rate begins an interval before the first stamp.
        beyond = self.interval + float(np.median(np.diff(self.truth.time)))
        q, known = self.truth.at(np.array([time + self.offset.seconds]), beyond)
        return matrices(q[0]) if known[0] else None

    def earth(self) -> Any:
        """Return the Earth's rate in rad/s, reference axes, (3,); None without a latitude."""
        from strapgen.lab.recordings.rest import earth_rate

        if self.options.latitude is None:
            return None
        return earth_rate(float(self.options.latitude), self.options.level_axes or "ned")

    def taken_off(self, data: Recording) -> TakenOff:
        """Return a recording less the bias, that of a rest without the Earth's rate."""
        rest = self.options.rest(data)
        return self.options.taken_off(data, rest, self._earth_at_rest(data, rest))

    def _earth_at_rest(self, data: Recording, rest: Rest | None) -> Any:
        """Return the Earth's rate in rad/s that the rest of a recording holds, body axes; 0 without a latitude."""
        rate = self.earth()
        if rate is None or rest is None:
            return 0.0
        middle = (rest.start_s + rest.end_s) / 2
        attitude = self.start(middle if self.initial is None else data.start)
        if attitude is None or (self.initial is not None and rest.start_s > data.start + data.interval):
            raise InputError(
                "the attitude at rest, which tells the Earth's rate from the bias, is not known: --true-attitude has "
                "it, or --initial-deg where the rest is at the start"
            )
        return attitude.T @ rate

    @property
    def remarks(self) -> list[str]:
        """What was left out of the truth."""
        return (
            [] if self.truth is None else [f"{self.options.true_attitude}: {x}" for x in self.truth.remarks]
        )

    @property
    def facts(self) -> dict[str, Any]:
        """Facts for a report."""
        latitude = self.options.latitude
        return {} if latitude is None else {"latitude_deg": float(latitude)}

    def without_earth(self, piece: Recording, start: Any, along: Callable[..., History]) -> Recording:
        """Return a piece of a recording less the Earth's rate, by the attitude along it; itself without a latitude."""
        from strapgen.lab.recordings.rest import without_earth

        rate = self.earth()
        if rate is None:
            return piece
        if start is None:
            raise InputError(
                "--latitude-deg needs the attitude at the start against level axes: --initial-deg, or --true-attitude "
                "that is known there"
            )
        return without_earth(piece, along(piece, None, start), rate)

    def error(self, history: History) -> AttitudeError | None:
        """Return the error of a run beside the truth; None without one."""
        from strapgen.lab.recordings.true_attitude import attitude_error

        if self.truth is None or self.offset is None:
            return None
        begun = self.align == "start" and self.start(float(history.time[0])) is not None
        found = attitude_error(history, self.truth, self.offset, "none" if begun else self.align)
        return replace(found, align=self.align)


@dataclass(frozen=True)
class FormOptions:
    """Options of the form in which the attitude along a recording is written."""

    panel: ClassVar[str] = "Output"

    attitude: Annotated[
        str | None,
        option(
            "--attitude",
            metavar="FORM",
            help="Form of the attitude: the state of the algorithm; rpy, roll, pitch and heading in deg; quaternion; "
            "matrix; or rotation-vector in rad.  [default: state, or quaternion with --quaternion or --sense]",
            read=names(FORMS),
        ),
    ] = None
    quaternion: Annotated[
        str | None,
        option(
            "--quaternion",
            metavar="ORDER",
            help="Order of a quaternion: xyzs or sxyz.  [default: xyzs]",
            read=names(QUATERNIONS),
        ),
    ] = None
    sense: Annotated[
        str | None,
        option(
            "--sense",
            metavar="NAME",
            help="What a quaternion, matrix or rotation vector turns: body-to-reference, as everywhere else, or "
            "reference-to-body.  [default: body-to-reference]",
            read=names(SENSES),
        ),
    ] = None

    def form(self) -> AttitudeForm:
        """Return the form."""
        from strapgen.lab.recordings.attitude_output import AttitudeForm

        implied = "state" if self.quaternion is None and self.sense is None else "quaternion"
        form = self.attitude or implied
        if self.quaternion is not None and form != "quaternion":
            raise InputError(f"--quaternion goes with --attitude quaternion, not {form}")
        return AttitudeForm(form, self.quaternion or "xyzs", self.sense or "body-to-reference")
