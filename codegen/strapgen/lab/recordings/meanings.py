"""Finds what the columns of a log mean by their names and units, or refuses names that leave it open."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

from strapgen.ir import checks, units
from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings.log_topic import LogColumn, LogTopic

_TIME = re.compile(
    r"(?:.*_)?(?:t|time|times|timestamp|timestamps|stamp|seconds|elapsed)"
    r"(?:_?(?:elapsed|stamp|sample|boot))?(?:_?(?:s|sec|ms|us|usec|ns|nsec))?|sampleus"
)
#: Of two stamps the sensor's own is taken in place of the logger's.
_OWN_TIME = re.compile(r"sampleus|timestamp_sample|header_stamp(?:_.*)?")
#: A word with an axis at its end, and one with it at its beginning.
_AXIS = re.compile(r"(.*?)_?(?:axis_?)?([xyz012])(?:_?axis)?|([xyz])_?(gyro|acc|mag)")
_SUFFIXES = ("ns", "us", "ms", "s", "sec", "rad_s", "rads", "deg_s", "dps", "mdps", "m_s2", "mss", "g", "mg")

#: What the names of three columns are before the axis, by what they hold; a name that no other has is open.
_ANGLES = re.compile(r"(?:.*_)?(?:d|d_?theta|d_?ang(?:le)?|delta_?(?:theta|ang(?:le)?))")
_VELOCITIES = re.compile(r"(?:.*_)?(?:d_?v|d_?vel(?:ocity)?|delta_?v(?:el(?:ocity)?)?)")
_RATES = re.compile(
    r"(?!.*covariance)(?:.*_)?(?:gyr\w*|angular_?(?:velocity|rate|vel|speed)|ang_?vel|omega|rotation_?rate|w_rs_s)(?:_.*)?|g|w|rate"
)
_FORCES = re.compile(
    r"(?!.*covariance)(?:.*_)?(?:acc\w*|linear_?acc\w*|specific_?force|force|a_rs_s)(?:_.*)?|a|f|user_?acc\w*"
)
#: Those of a magnetometer and an attitude, beside which, as beside forces, a bare axis is open.
_OTHER = re.compile(r"(?:.*_)?(?:mag\w*|quat\w*|euler\w*)(?:_.*)?|m|b|e|q")

#: Types of messages in the order in which a file's rates are looked for.
_MESSAGES = ("sensor_combined", "imu", "highres_imu", "sensor_msgs/msg/imu", "scaled_imu", "raw_imu")
#: What --columns names: the time, rates or angle increments, and specific forces or velocity increments.
KEYS = ("t", "x", "y", "z", "fx", "fy", "fz")
INPUTS = ("increments", "rates", "instants")

#: The elements of an attitude by the names that logs have for them: w, x, y, z, and roll, pitch, heading.
_QUATERNIONS = tuple(
    (rf"(?:.*_)?(?:q|quat\w*|orientation|attitude){frame}_?{{}}", names)
    for frame in ("", "(?:_.*)?")
    for names in (("w", "x", "y", "z"), ("s", "x", "y", "z"), ("0", "1", "2", "3"), ("1", "2", "3", "4"))
)
_ANGLE_NAMES = tuple(
    (r"(?:.*_)?{}(?:_deg|_rad|_angle)?", ("roll", "pitch", heading)) for heading in ("yaw", "heading")
)


class Stated(NamedTuple):
    """What a user says of the columns, in place of what the file says or leaves open."""

    input: str | None = None
    columns: str | None = None
    time_unit: str | None = None
    rate_unit: str | None = None
    force_unit: str | None = None
    has_time: bool = True
    with_force: bool = False


@dataclass(frozen=True)
class Meanings:
    """The columns of a topic that a recording is read from, and their units."""

    topic: str
    time: str | None
    #: About or along x, y, z
    samples: tuple[str, ...]
    forces: tuple[str, ...]
    #: "increments", "rates" or "instants"
    input: str
    #: In the spelling of `ir.units`; None where neither file nor user states one
    time_unit: str | None
    unit: str | None
    force_unit: str | None

    @property
    def columns(self) -> list[str]:
        """All columns."""
        return [*([] if self.time is None else [self.time]), *self.samples, *self.forces]


class _Column(NamedTuple):
    """A column: its name in lower case with underscores, its unit, and its name in the file."""

    name: str
    unit: str | None
    text: str

    @property
    def stem(self) -> str | None:
        """What stands beside the axis; None without an axis."""
        match = _AXIS.fullmatch(self.name)
        return match and (match[1] or match[4] or "").strip("_")

    @property
    def axis(self) -> int:
        """0, 1 or 2."""
        match = _AXIS.fullmatch(self.name)
        letter = (match[2] or match[3]) if match else "x"
        return "xyz".find(letter) if letter in "xyz" else int(letter)


#: The time, three samples, and three forces or none.
_Found = tuple[_Column | None, Sequence[_Column], Sequence[_Column]]


def find(topics: Sequence[LogTopic], topic: str, stated: Stated) -> tuple[Meanings, str]:
    """Return what the columns of a topic mean, by default of the one that has rates, and a remark on its choice."""
    if topic:
        return of_topic(topics[_place([one.name for one in topics], topic)], stated), ""
    if len(topics) == 1:
        return of_topic(topics[0], stated), ""
    found: dict[str, tuple[int, Meanings]] = {}
    for one in topics:
        try:
            message = one.message.lower().replace("sensor_msgs/imu", "sensor_msgs/msg/imu")
            rank = _MESSAGES.index(message) if message in _MESSAGES else len(_MESSAGES)
            found[one.name] = rank, of_topic(one, stated)
        except InputError:
            continue
    if not found:
        seen = ", ".join(one.name for one in topics[: checks.MOST_NAMES])
        raise InputError(
            f"no topic has a time and rates about three axes; it has {seen}; FILE:TOPIC names one"
        )
    names, first = checks.alternatives([*found]), min(found.values(), key=lambda one: one[0])
    if first[0] == len(_MESSAGES) and len(found) > 1:
        raise InputError(
            f"{len(found)} topics have rates about three axes, {names}; FILE:TOPIC says which is meant"
        )
    others = ", ".join(name for name in found if name != first[1].topic)
    remark = f"the rates are those of topic {first[1].topic}; there are others in {others}" if others else ""
    return first[1], remark


def _place(names: Sequence[str], topic: str) -> int:
    if topic not in names and [*names] == [""]:
        raise InputError(f"topic {topic!r} is not known; the log has none, and FILE alone names it")
    if topic not in names:
        checks.choice("topic", topic, names)
    return [*names].index(topic)


def of_topic(topic: LogTopic, stated: Stated) -> Meanings:
    """Return what the columns of a topic mean."""
    columns = [_column(one) for one in topic.columns]
    is_named = not all(one.text.isdigit() for one in columns)
    input = stated.input
    if stated.columns is not None:
        time, samples, forces = _stated_columns(stated, columns)
    elif not is_named:
        time, samples, forces = _by_place(stated, columns)
    else:
        time = _time(columns) if stated.has_time else None
        looked_for = (_ANGLES, ("rad",)) if input == "increments" else (_RATES, units.RATES)
        three = _three(columns, looked_for[0], time, looked_for[1])
        if three is None and input is None and (three := _three(columns, _ANGLES, time, ("rad",))):
            input = "increments"
        if three is None:
            what = "increments" if input == "increments" else "rates"
            raise InputError(_open(f"no {what} about three axes are", columns))
        samples = three
        of_force = (_VELOCITIES, ("m/s",)) if input == "increments" else (_FORCES, units.FORCES)
        forces = (_three(columns, of_force[0], time, of_force[1]) or ()) if stated.with_force else ()
    if stated.with_force and not forces:
        what = "velocity increments" if input == "increments" else "specific forces"
        raise InputError(_open(f"no {what} along three axes are", columns))
    input = input or "rates"
    of_samples = {"rad": Fraction(1)} if input == "increments" else units.RATES
    of_forces = {"m/s": Fraction(1)} if input == "increments" else units.FORCES
    what = "increments" if input == "increments" else "rates"
    names = ("", "velocity increments") if input == "increments" else ("--force-unit", "specific forces")
    rate_option = "" if input == "increments" else "--rate-unit"
    return Meanings(
        topic.name,
        None if time is None else time.text,
        tuple(one.text for one in samples),
        tuple(one.text for one in forces),
        input,
        None if time is None else _unit("--time-unit", stated.time_unit, [time], units.TIMES, "times"),
        _unit(rate_option, None if rate_option == "" else stated.rate_unit, samples, of_samples, what),
        _unit(names[0], stated.force_unit if names[0] else None, forces, of_forces, names[1]),
    )


@dataclass(frozen=True)
class AttitudeColumns:
    """The columns of an attitude with its time."""

    #: None where the sampling rate is stated
    time: str | None
    #: A quaternion, or roll, pitch and heading, in the order of the file's names
    columns: tuple[str, ...]
    #: "sxyz" or "xyzs"; "" for angles
    order: str
    #: In the spelling of `ir.units`; None where neither file nor user states one
    time_unit: str | None
    #: Of angles: "rad" or "deg"
    unit: str | None


def attitude(
    topic: LogTopic,
    columns: str | None = None,
    order: str | None = None,
    time_unit: str | None = None,
    *,
    has_time: bool = True,
) -> AttitudeColumns:
    """Return the columns of the time and of an attitude, as a user or their names say.

    `columns`: names or numbers, the time and a quaternion or three angles. `order`: of a quaternion.

    >>> found = attitude(LogTopic("", tuple(LogColumn(name) for name in ("t", "q[0]", "q[1]", "q[2]", "q[3]")), None))
    >>> found.columns, found.order
    (('q[0]', 'q[1]', 'q[2]', 'q[3]'), 'sxyz')
    """
    known = [_column(one) for one in topic.columns]
    time: _Column | None
    if columns is not None:
        words = [word.strip() for word in columns.split(",")]
        if len(words) - has_time not in (3, 4):
            time_too = "the time and " if has_time else ""
            raise InputError(
                f"--true-columns {columns} names {len(words)} columns; {time_too}a quaternion, or roll, pitch and "
                "heading, are needed"
            )
        found = [_named(known, word, "--true-columns") for word in words]
        time = found.pop(0) if has_time else None
        order = (order or _order(found)) if len(found) == 4 else ""
    elif (
        all(one.text.isdigit() for one in known) and len(known) == 8
    ):  # a trajectory of the TUM RGB-D benchmark
        time, found, order = known[0], known[4:], order or "xyzs"
    else:
        time, found = _time(known) if has_time else None, []
        for pattern, names in (*_QUATERNIONS, *_ANGLE_NAMES):
            each = [[one for one in known if re.fullmatch(pattern.format(name), one.name)] for name in names]
            if all(len(one) == 1 for one in each):
                found = [one[0] for one in each]
                break
        order = "sxyz" if len(found) == 4 else ""  # the patterns have the scalar first
    if not found or (len(found) == 4 and not order):
        what = "no attitude is" if not found else "the scalar of the quaternion is not"
        raise InputError(
            f"{what} named among the columns {_shown(known)}; --true-columns NAME,... says which are the time and the "
            "attitude, --true-quaternion the order"
        )
    stated = [word for one in found for word in (one.unit, one.name.rpartition("_")[2])]  # as in roll_deg
    unit = next((word for word in stated if word in ("rad", "deg")), None)
    stamps = _unit("--true-time-unit", time_unit, [time] if time and time.unit else [], units.TIMES, "times")
    return AttitudeColumns(time and time.text, tuple(one.text for one in found), order, stamps, unit)


def _order(columns: Sequence[_Column]) -> str:
    """Return the order of a quaternion whose columns are named by their element; "" where they are not."""
    ends = "".join(one.name[-1:] for one in columns).replace("w", "s")
    return {"sxyz": "sxyz", "0123": "sxyz", "1234": "sxyz", "xyzs": "xyzs"}.get(ends, "")


def _column(column: LogColumn) -> _Column:
    """Return a column with the unit that stands in its name if it has no other."""
    text = column.name.strip().lstrip("#%/ ").strip()
    match = re.fullmatch(r"(.*?)[\s_]*[\[(]([^\])]*)[\])]\s*", text)
    name, unit = text, None
    if match is not None and not match[2].strip().isdigit():
        name, unit = match[1], units.spelled(match[2])
    elif match is not None:  # an index, as in gyro[0]
        name = f"{match[1]}_{match[2].strip()}"
    name = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    if unit is None:
        for suffix in _SUFFIXES:
            stem = name.removesuffix(f"_{suffix}")
            if stem not in (name, "", "w_r") and (_TIME.fullmatch(stem) or _AXIS.fullmatch(stem)):
                name, unit = stem, units.spelled(suffix.replace("_s", "/s"))
                break
    return _Column(name, column.unit or unit, column.name)


def _three(
    columns: Sequence[_Column], pattern: re.Pattern[str], time: _Column | None, known: Iterable[str]
) -> tuple[_Column, ...] | None:
    """Return the only three columns about or along the axes whose names say what they hold."""
    known = {*known}
    axes: dict[str, list[_Column | None]] = {}
    for one in columns:
        bare = one.stem == "" and pattern in (_RATES, _ANGLES)
        if one == time or one.stem is None or (one.unit in {*units.FORCES} - known):
            continue
        if "covariance" in one.stem:  # beside the values, in messages of ROS
            continue
        if pattern.fullmatch(one.stem) or (bare and one.unit in {None, *known}):
            axes.setdefault(one.stem, [None] * 3)[one.axis] = one
    groups = [group for group in axes.values() if None not in group]
    if not groups or ("" in axes and any(_is_other(one) for one in columns)):
        return None
    if len(groups) > 1:
        raise InputError(_open(f"{len(groups)} sets of columns about three axes are", columns))
    return tuple(one for one in groups[0] if one)


def _is_other(column: _Column) -> bool:
    """Return whether a column is one of another sensor, or of an attitude."""
    stem = column.stem
    return bool(stem) and any(one.fullmatch(stem or "") for one in (_OTHER, _FORCES))


def _time(columns: Sequence[_Column]) -> _Column | None:
    times = [one for one in columns if _TIME.fullmatch(one.name) and one.unit in (None, *units.TIMES)]
    times = [one for one in times if _OWN_TIME.fullmatch(one.name)] or times
    if len(times) > 1:  # beside a time, T is a temperature
        times = [one for one in times if one.name != "t"]
    if len(times) == 1:
        return times[0]
    what = "several columns of time" if times else "no column of time"
    raise InputError(
        f"{what} among {_shown(columns)}; --columns NAME,... says which it is, or --sample-hz the sampling rate"
    )


def _by_place(stated: Stated, columns: Sequence[_Column]) -> _Found:
    """Return the columns of a table without names."""
    first = int(stated.has_time)
    counts = (first + 3, first + 6) if stated.with_force else (first + 3,)
    if len(columns) not in counts:
        raise InputError(
            f"{len(columns)} columns without a header; --columns says by their numbers which are the time and the "
            "rates, as 1,2,3,4"
        )
    return (columns[0] if first else None), columns[first : first + 3], columns[first + 3 :]


def _stated_columns(stated: Stated, columns: Sequence[_Column]) -> _Found:
    """Return the columns that a user names: the time and three or six others, in their order or as t=NAME,x=NAME."""
    words = [word.strip() for word in (stated.columns or "").split(",")]
    pairs = [word.partition("=") for word in words]
    has_keys = all(equals and key in KEYS for key, equals, _ in pairs)
    keys = KEYS if stated.has_time else KEYS[1:]
    if not has_keys and all(equals for _, equals, _ in pairs) and pairs[0][0] in KEYS:
        for key, _, _ in pairs:
            checks.choice("--columns key", key, KEYS)
    if not has_keys:
        pairs = [(key, "=", word) for key, word in zip(keys, words, strict=False)]
    named = {key: name.strip() for key, _, name in pairs}
    wanted = keys[: len(keys) - (0 if "fx" in named else 3)]
    if len({*named.values()}) < len(words) or {*named} != {*wanted}:
        what = (
            "the time and three rates"
            if stated.has_time
            else "three rates, since --sample-hz states the time"
        )
        raise InputError(
            f"--columns {stated.columns} names {len(words)} columns; {len(keys) - 3} are needed: {what}, as "
            f"{','.join(f'{key}=NAME' for key in keys[: len(keys) - 3])}; fx, fy, fz are specific forces"
        )
    found = [_named(columns, named[key]) for key in wanted]
    first = int(stated.has_time)
    return (found[0] if first else None), found[first : first + 3], found[first + 3 :]


def _named(columns: Sequence[_Column], name: str, option: str = "--columns") -> _Column:
    exact = [one for one in columns if name == one.text]
    exact = exact or [one for one in columns if name.lower() in (one.text.lower(), one.name)]
    if len(exact) == 1:
        return exact[0]
    if not exact and name.isdigit() and 1 <= int(name) <= len(columns):
        return columns[int(name) - 1]
    raise InputError(
        f"{option}: {name!r} is {'more than one' if exact else 'no'} column of {_shown(columns)}"
    )


def _shown(columns: Sequence[_Column]) -> str:
    if all(one.text.isdigit() for one in columns):
        return f"{len(columns)} without names"
    return ", ".join(repr(one.text) for one in columns)


def _open(what: str, columns: Sequence[_Column]) -> str:
    return f"{what} named among the columns {_shown(columns)}; --columns NAME,... says which they are"


def known_unit(what: str, text: str, table: Mapping[str, Fraction]) -> str:
    """Return a unit of a table in its usual spelling."""
    name = units.spelled(checks.text(what, text))
    return name if name in table else checks.choice(what, text, [*table])


def _unit(
    option: str, stated: str | None, columns: Sequence[_Column], table: Mapping[str, Fraction], what: str
) -> str | None:
    """Return the unit that a user or some columns state."""
    if stated is not None:
        stated = known_unit(f"{option[2:].replace('-', ' ')}", stated, table)
    of_columns = {one.unit: one for one in columns if one.unit is not None}
    if len({*of_columns} & {*table}) > 1:
        raise InputError(
            f"the {what} are in {' and '.join(sorted(map(str, of_columns)))}; one unit is needed"
        )
    for unit, column in of_columns.items():
        if unit not in table:
            raise InputError(
                f"column {column.text!r} is in {unit} where {what} are expected, in {', '.join(table)}"
            )
        if stated not in (None, unit):
            raise InputError(f"{option} {stated} contradicts the header: column {column.text!r} is in {unit}")
        stated = unit
    return stated
