"""States that were read back from a processor, from a log."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings.log_file import LogFile, open_log
from strapgen.lab.recordings.log_topic import LogTopic, split_topic
from strapgen.lab.recordings.recording import History, Recording, Taken, record_interval
from strapgen.run.backends import Backend
from strapgen.run.evaluators import numbers

#: Names of a column of times, in s on the clock of the recording.
TIMES = ("time_s", "t", "time", "time [s]", "t [s]")


def read_states(
    path: str | Path, backend: Backend, recording: Recording, orthonormalize: Any = None
) -> History:
    """Return the states of a log as a run along a recording.

    The log is a table of any format with a column of times in s, on the clock of the recording, and one for each
    element of the state, by its name in the generated code. In fixed point they are words, in the formats of the
    header; rows may stand any number of steps apart.

    `orthonormalize`: time from one orthonormalization of the processor to the next in s.
    """
    place, topic = split_topic(str(path))
    log = open_log(place)
    table, time = _table(log, topic, backend)
    columns = log.read(table.name, [time, *backend.elements])
    values = np.stack([columns[name].astype(np.float64) for name in backend.elements], axis=1)
    stamps = columns[time].astype(np.float64)
    broken = np.flatnonzero(~np.isfinite(values).all(axis=1) | ~np.isfinite(stamps))
    if len(broken):
        raise InputError(f"{place}: {log.place(table.name, int(broken[0]))} has no number")
    fixed = backend.sources.fixed
    if fixed is not None:
        state = fixed.inputs[0]
        wrong = np.flatnonzero((values != np.rint(values)).any(axis=1))
        if len(wrong):
            raise InputError(
                f"{place}: {log.place(table.name, int(wrong[0]))} holds fractions; the words of the state are needed, "
                f"whole numbers in {state.format}"
            )
        beyond = np.flatnonzero((np.abs(values) > 2.0 ** (state.format.word - 1)).any(axis=1))
        if len(beyond):
            raise InputError(
                f"{place}: {log.place(table.name, int(beyond[0]))} holds a number beyond words of "
                f"{state.format.word} bits"
            )
        values = numbers(state, values)
    step = recording.interval * backend.increments
    states = values.reshape(len(values), *backend.state_shape)
    every = 0 if orthonormalize is None else record_interval("orthonormalize", orthonormalize, step)
    taken = Taken(recording, backend.count, every)
    return History(stamps, states, step, 0, backend.elements, backend, taken=taken)


def _table(log: LogFile, topic: str, backend: Backend) -> tuple[LogTopic, str]:
    """Return the table that has the state, and the name of its column of times."""
    wanted = [one for one in log.topics if not topic or one.name == topic]
    for table in wanted:
        time = next((name for name in TIMES if name in table.names), None)
        if time is not None and {*backend.elements} <= {*table.names}:
            return table, time
    what = f"no table {topic}" if not wanted else "no table with them"
    raise InputError(
        f"{log.path} has {what}: columns {TIMES[0]} (or {', '.join(TIMES[1:])}) and {', '.join(backend.elements)} are "
        f"needed, as the code of {backend.kernel} names the state"
    )
