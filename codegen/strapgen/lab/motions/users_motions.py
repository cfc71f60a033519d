"""Motions that users bring: a Python file with a rate, or with increments and attitude, held against each other.

Either the file has one function that returns the body rate in rad/s as expressions of SymPy, from which all else is
integrated, see `rate_motions`:

    rate_expression(t)                                       three expressions of the symbol t in s

Or it has two functions, whose times are in s, and may have a third:

    increments(step, steps, samples, previous=0, ahead=0)    as `Motion.increments`
    attitude(t)                                              (..., 3, 3) at times (...), the identity at time 0
    rate(t)                                                  (..., 3) at times (...)

Nothing of it is believed: `require_consistent` integrates the increments, and a motion whose attitude is another one is
refused with the time at which they part.
"""

from __future__ import annotations

import os
import runpy
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen import registration
from strapgen.ir import checks, packages
from strapgen.ir.exceptions import InputError
from strapgen.ir.renamed import renamed_parameters
from strapgen.lab.motions.motion_names import file_readers, is_file
from strapgen.lab.motions.motions import Motion, motion
from strapgen.lab.motions.rate_expressions import rate_of
from strapgen.lab.motions.rate_motion import RateMotion
from strapgen.run.backends import backend

Array = NDArray[np.float64]

#: Names of the functions that a file must have, and of those that it may have.
FUNCTIONS, FURTHER = ("increments", "attitude"), ("rate",)
#: Name of the function that a file has instead of them.
EXPRESSION = "rate_expression"
#: Intervals into which a run is cut, and then the first of them that is at fault, to find the time; for each the most
#: pieces of an interval.
_CUTS = ((64, 1 << 10), (16, 1 << 7), (16, 1 << 4))
#: Increments of a piece that is integrated, and nodes at which the rate of a piece is summed up.
_SAMPLES, _NODES = 2, 3
#: Largest angle in rad by which a motion may contradict itself in an interval, far above round-off. What the result
#: still changes by when pieces are halved comes on top of it.
_TOLERANCE = 1e-9
#: How much of that change is allowed: the error that is left may be larger where the rate has a kink.
_SHARE = 8.0
#: Change in rad below which pieces are short enough.
_FINE = 1e-11


@dataclass(frozen=True)
class UsersMotion(Motion):
    """A motion of a user's functions."""

    #: Empty: the file has its numbers
    parameters: Mapping[str, float] = field(default_factory=dict)
    #: The functions of the file by name
    functions: Mapping[str, Callable[..., Any]] = field(default_factory=dict)

    def samples(self, interval: Fraction, first: int, stop: int) -> Array:
        """Return angle increments of some sampling intervals, see `Motion.samples`."""
        before, last = max(0, -first), max(stop, 1)
        row: Array = self._windows(float(interval) * last, 1, last, before, 0)[0]
        return row[first + before : stop + before]

    @renamed_parameters(samples="increments")
    def increments(
        self, step: Fraction, steps: int, increments: int, previous: int = 0, ahead: int = 0
    ) -> Array:
        """Return angle increments, see `Motion.increments`."""
        return self._windows(float(step), steps, increments, previous, ahead)

    def attitude(self, time: Any) -> Array:
        """Return the true attitude, see `Motion.attitude`."""
        times = np.asarray(time, float)
        return self._call("attitude", (*times.shape, 3, 3), times)

    def rate(self, time: Any) -> Array:
        """Return the body rate, see `Motion.rate`."""
        if "rate" not in self.functions:
            raise InputError(f"{self.name} defines no function rate; rates of the motion need one")
        times = np.asarray(time, float)
        return self._call("rate", (*times.shape, 3), times)

    def _windows(self, step: float, steps: int, increments: int, previous: int, ahead: int) -> Array:
        shape = (steps, previous + increments + ahead, 3)
        return self._call("increments", shape, step, steps, increments, previous, ahead)

    def _call(self, function: str, shape: tuple[int, ...], *arguments: Any) -> Array:
        """Return the checked result of a function of the file."""
        with _guard(self.name):
            value = self.functions[function](*arguments)
        try:
            array = np.asarray(value, float)
        except (TypeError, ValueError):
            raise InputError(f"{self.name}: {function} returns no array of numbers") from None
        if array.shape != shape:
            raise InputError(f"{self.name}: {function} returns shape {array.shape}; {shape} is needed")
        if not np.isfinite(array).all():
            raise InputError(f"{self.name}: {function} returns numbers that are not finite")
        return array


def read_motion(path: str | Path, duration: float | str | Fraction = 60) -> UsersMotion | RateMotion:
    r"""Read a motion from a Python file, and check it.

    Parameters
    ----------
    path : path
        A Python file with functions ``increments``, ``attitude`` and perhaps ``rate``, or with ``rate_expression``.
    duration : number, optional
        Time in s over which they must fit together.

    Returns
    -------
    UsersMotion or RateMotion

    Raises
    ------
    InputError
        If there is no such file, its code fails, a function is missing, or the functions contradict each other; the
        message then has the time.

    Examples
    --------
    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "turn.py"
    >>> _ = file.write_text('''
    ... import numpy as np
    ... def increments(step, steps, increments, previous=0, ahead=0):
    ...     return np.full((steps, previous + increments + ahead, 3), [0, 0, step / increments])
    ... def attitude(t):
    ...     c, s, o = np.cos(t), np.sin(t), np.zeros_like(t)
    ...     return np.stack([c, -s, o, s, c, o, o, o, o + 1], axis=-1).reshape(*np.shape(t), 3, 3)
    ... ''')
    >>> read_motion(file).attitude(np.pi).round(12) + 0.0
    array([[-1.,  0.,  0.],
           [ 0., -1.,  0.],
           [ 0.,  0.,  1.]])
    """
    name = str(path)
    file = Path(os.path.realpath(name))
    try:
        if not file.is_file():
            raise InputError(
                f"motion {name} is no file; a Python file with functions {' and '.join(FUNCTIONS)}, or with "
                f"{EXPRESSION}, is needed"
            )
        source = file.read_bytes()
    except OSError as error:
        raise InputError(f"motion {name} cannot be read ({error.strerror})") from None
    return _read(name, source, checks.number("duration", duration, positive=True))


@lru_cache(maxsize=4)
def _read(name: str, source: bytes, duration: Fraction) -> UsersMotion | RateMotion:
    """Return the motion of a file with these contents, checked once."""
    functions = _functions(name)
    if EXPRESSION in functions:
        with _guard(name):
            rate = rate_of(name, functions[EXPRESSION])
        motion_of_rate = RateMotion(name, {}, rate)
        motion_of_rate.error_bound(float(duration))  # integrates it over the duration, or refuses it
        return motion_of_rate
    users = UsersMotion(name, functions=functions)
    require_consistent(users, duration)
    return users


def any_motion(
    name: str, duration: float | str | Fraction, settings: Mapping[str, float | str | Fraction]
) -> Motion:
    """Return a motion of the catalogue, or of a file.

    `duration`: time in s over which a file's motion is checked.
    """
    if not is_file(name):
        return motion(name, **settings)
    if settings:
        raise InputError(
            f"{name} has its own numbers; --set goes with a motion that strapgen list motions shows"
        )
    reader = file_readers().get(Path(name).suffix)
    if reader is None:
        return read_motion(name, duration)
    read: Motion = registration.load(reader)(Path(name))
    return read


def require_consistent(users: Motion, duration: float | str | Fraction) -> None:
    """Refuse a motion whose increments lead to another attitude than its own, or whose rate has another integral.

    `duration`: time from 0 on in s that is checked.
    """
    total = float(checks.number("duration", duration, positive=True))
    edges = np.linspace(0, total, _CUTS[0][0] + 1)
    matrices = users.attitude(edges)
    skewed = np.abs(matrices @ np.swapaxes(matrices, -1, -2) - np.eye(3)).max(axis=(-2, -1)) > _TOLERANCE
    if (broken := skewed | (np.linalg.det(matrices) < 0)).any():
        raise InputError(f"{users.name}: attitude({edges[broken][0]:.6g}) is no rotation matrix")
    if np.abs(matrices[0] - np.eye(3)).max() > _TOLERANCE:
        raise InputError(
            f"{users.name}: attitude(0) is not the identity; a run can begin at another attitude with --initial-deg"
        )
    _require_windows(users, total)
    _Integral(users).require(total)


def _functions(name: str) -> dict[str, Callable[..., Any]]:
    """Return the functions of a user's file."""
    with _guard(name), packages.importing_beside(Path(name)):
        names = runpy.run_path(name, run_name=Path(name).stem)
    if callable(names.get(EXPRESSION)):
        if others := [function for function in FUNCTIONS if function in names]:
            raise InputError(
                f"{name} defines {EXPRESSION} and {', '.join(others)}; one of both ways is needed"
            )
        return {EXPRESSION: names[EXPRESSION]}
    for function in FUNCTIONS:
        if not callable(names.get(function)):
            raise InputError(
                f"{name} defines no function {function}; a motion needs {' and '.join(FUNCTIONS)}, or {EXPRESSION}"
            )
    return {function: names[function] for function in (*FUNCTIONS, *FURTHER) if callable(names.get(function))}


def rate_expressions(path: str | Path) -> tuple[Any, ...]:
    """Return the rate of a file's motion as expressions of SymPy in `time_symbol`."""
    users = read_motion(path, Fraction(1, 1000))
    if not isinstance(users, RateMotion):
        raise InputError(f"{path} has no function {EXPRESSION}, from which series are derived")
    return users.elements


def _guard(name: str) -> Any:
    """Run a user's code; a failure becomes one line with its place."""
    file = Path(name).name
    return packages.guarded(name, "define a motion", lambda path: path.name == file)


def _require_windows(users: Motion, total: float) -> None:
    """Check that increments of steps, with those beside them, are those of one row."""
    count = _CUTS[0][0]
    step = Fraction(total / count)
    row = users.samples(step / 2, 0, 2 * count + 2)
    for k, window in enumerate(users.increments(step, count, 2, 1, 2)):
        if np.abs(window[not k :] - row[max(0, 2 * k - 1) : 2 * k + 4]).max() > _TOLERANCE:
            raise InputError(
                f"{users.name}: the increments of the step at {float(k * step):.6g} s, with one from before it and two "
                "from after it, are not those of one long step"
            )


class _Integral:
    """Integrates the increments of a motion, and compares the result with its attitude and its rate."""

    def __init__(self, users: Motion) -> None:
        self._users = users
        self._step = backend("euler", "rk4", _SAMPLES)
        self._has_rate = not isinstance(users, UsersMotion) or "rate" in users.functions
        nodes, weights = np.polynomial.legendre.leggauss(_NODES)
        self._nodes, self._weights = (1 + nodes) / 2, weights / 2

    def require(self, end: float) -> None:
        """Refuse a motion that contradicts itself before a time, with the first time at which it does."""
        begin, said = 0.0, ""
        for intervals, most in _CUTS:
            fault, place = self._first_fault(np.linspace(begin, end, intervals + 1), most)
            if not fault:
                break  # nowhere, or it is too small to be seen in parts
            width = (end - begin) / intervals
            said, begin, end = fault, begin + place * width, begin + (place + 1) * width
        if said:
            raise InputError(f"{self._users.name}: {said} from {begin:.6g} s to {end:.6g} s")

    def _first_fault(self, edges: Array, most: int) -> tuple[str, int]:
        """Return the first contradiction and its interval; "" if there is none."""
        matrices = self._users.attitude(edges)
        true = np.swapaxes(matrices[:-1], -1, -2) @ matrices[1:]
        turned, angle, summed = self._integrate(edges, 1)
        added, pieces = np.zeros(len(edges) - 1), 1
        apart = change = np.zeros(len(edges) - 1)
        while True:
            pieces *= 2
            before, (turned, finer, summed) = (turned, angle, summed), self._integrate(edges, pieces)
            added = np.maximum(added, np.abs(finer - before[1]).max(axis=-1))
            # At a kink of the rate one halving may by chance change little; the one before it is told too.
            apart = np.maximum(_distance(turned, before[0]), apart / 4)
            change = np.maximum(np.abs(summed - before[2]).max(axis=-1), change / 4)
            angle = finer
            if pieces >= most or max(apart.max(), change.max()) < _FINE:
                break
        differs = np.abs(summed - angle).max(axis=-1)
        faults = {
            "the increments of parts do not add up to those of the whole": added > _TOLERANCE,
            "the increments are not the integral of the rate": differs > _TOLERANCE + _SHARE * change,
            "the attitude is not what the increments lead to": _distance(turned, true)
            > _TOLERANCE + _SHARE * apart,
        }
        places = {said: int(np.argmax(wrong)) for said, wrong in faults.items() if wrong.any()}
        return min(places.items(), key=lambda item: item[1]) if places else ("", 0)

    def _integrate(self, edges: Array, pieces: int) -> tuple[Array, Array, Array]:
        """Return the rotation, the sum of the increments and the integral of the rate of every interval."""
        row = self._row(edges, pieces)
        states = self._step.propagate(row, pieces)  # at the start of each interval and at its end
        rotations = self._step.matrices(states[:, 1])
        angle = row.sum(axis=(1, 2))
        return rotations, angle, self._integral(edges, pieces) if self._has_rate else angle

    def _row(self, edges: Array, pieces: int) -> Array:
        """Return the increments of every interval, (intervals, pieces, samples, 3)."""
        intervals, width = len(edges) - 1, edges[1] - edges[0]
        sampling = width / (pieces * _SAMPLES)
        first = round(edges[0] / sampling)
        row = self._users.samples(Fraction(sampling), first, first + intervals * pieces * _SAMPLES)
        return row.reshape(intervals, pieces, _SAMPLES, 3)

    def _integral(self, edges: Array, pieces: int) -> Array:
        """Return the integral of the rate over every interval, (intervals, 3)."""
        width = (edges[1] - edges[0]) / pieces
        starts = edges[:-1, None] + width * np.arange(pieces)
        rates = self._users.rate(starts[..., None] + width * self._nodes)
        total: Array = np.einsum("ipnx,n->ix", rates, self._weights) * width
        return total


def _distance(one: Array, other: Array) -> Array:
    """Return the angles between rotations that are near each other, in rad."""
    distances: Array = np.linalg.norm(one - other, axis=(-2, -1)) / np.sqrt(2)
    return distances
