"""An attitude that is committed a few samples late by two-sided filters, with an estimate of the present one.

The committed attitude is L samples old and has the small error of symmetric filters. The attitude of now is the
committed one times the last intervals, by filters with fewer samples ahead; it is an answer only, so that its errors do
not add up.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np

from strapgen.catalogue import AnyAlgorithm
from strapgen.catalogue.methods.window import Window
from strapgen.design.commit_late import commit_late_sources
from strapgen.design.commit_late.late_unit import (
    LateUnit,
    LateUnitInC,
    LateUnitOnIntegers,
    SampleKind,
    sample_integers,
)
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.interfaces import Argument
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.read_only import read_only
from strapgen.ir.sources import Sources
from strapgen.run.backend_names import BACKENDS
from strapgen.run.backends import fit_settings
from strapgen.run.evaluators import Array, integers, numbers
from strapgen.run.increments import pulses


class CommitLate:
    """Integrates samples as they arrive: an attitude that is committed late, and the present one on request.

    The first p + 1 + L samples are waited for; the intervals before the first whole window then have filters with fewer
    samples before them. Until then, `now` and `flush` have the rate from polynomials through up to four samples.

    A lost sample is restored within the band of the window when 8 samples after it are there; until then nothing is
    committed, and `now` goes on with the cubic estimate from the four samples before the gap, which `flush` commits.
    Where the next sample is the sum of the lost interval and its own, that is used. A sample can be restored if none of
    the 8 before it was lost too, and if there are so many.

    Parameters
    ----------
    window : str or Window
        A window of the catalogue by its name, or a family of filters.
    algorithm : str, Choice or AttitudeAlgorithm, optional
        "euler", Euler parameters, scalar last, or "dcm", the direction cosine matrix; body to reference. Of an object
        the state counts; a window as its method has to be this one.
    backend : str, optional
        "numpy" or "fixed-model", generated functions called from Python, or "c", "c-float" or "c-fixed32", generated C.
        In fixed point what rounding a sample leaves goes on to the next one, as in a gyro that counts pulses.
    sample_hz : number, optional
        Sampling rate in Hz; a family that is designed for a gyro needs it, and is refused at another one.
    settings : Settings, optional
        Settings of fixed point, with words of 32 bits.

    Attributes
    ----------
    identity : array
        The attitude of zero rotation.

    Raises
    ------
    InputError
        If a name is unknown, or the window cannot be committed late.
    CompilerError
        If the back end needs a C compiler and there is none.

    Examples
    --------
    >>> unit = CommitLate("window-3-3")
    >>> [unit.push([0.0, 0.0, 0.02]) for _ in range(8)]
    [0, 0, 0, 0, 0, 0, 4, 1]
    >>> unit.attitude.round(6), unit.now().round(6)  # 5 and 8 intervals of 0.02 rad about z
    (array([0.      , 0.      , 0.049979, 0.99875 ]), array([0.      , 0.      , 0.079915, 0.996802]))
    >>> unit.flush(), bool((unit.attitude == unit.now()).all())
    (3, True)
    """

    __repr__ = short_repr

    def _in_words(self) -> str:
        return f"at the attitude {', '.join(f'{x:.6g}' for x in np.ravel(self.attitude))}"

    def __init__(
        self,
        window: str | Window = "window-7-7",
        algorithm: AnyAlgorithm = "euler",
        backend: str = "numpy",
        sample_hz: float | str | Fraction | None = None,
        settings: Settings | None = None,
    ) -> None:
        self._state: Argument | None = None
        self._rest = np.zeros(3)
        self._unit = self._load(window, algorithm, backend, sample_hz, settings)
        self.identity: Array = read_only(self.attitude)

    def _load(
        self,
        window: str | Window,
        algorithm: AnyAlgorithm,
        backend: str,
        sample_hz: float | str | Fraction | None,
        settings: Settings | None,
    ) -> LateUnit | LateUnitInC:
        """Return the unit on a back end; in fixed point, note its formats."""
        checks.choice("backend", backend, BACKENDS)
        target, settings = BACKENDS[backend].target, fit_settings(backend, settings)
        filters = commit_late_sources.family(window, sample_hz)
        state = commit_late_sources.state_name("CommitLate", algorithm, filters)
        if target in commit_late_sources.TARGETS:
            whole = commit_late_sources.sources(window, state, target, sample_hz, settings=settings)
            self._note(whole)
            return LateUnitInC(whole)
        interpreted = ("numpy", "fixed-model")
        if target not in interpreted:
            able = (*interpreted, *commit_late_sources.TARGETS)
            names = [name for name, entry in BACKENDS.items() if entry.target in able]
            raise InputError(f"backend is {backend!r}; these commit late: {', '.join(names)}")
        parts = commit_late_sources.parts(filters, state, target, settings)
        self._note(parts.step)
        return LateUnit(parts) if settings is None else LateUnitOnIntegers(parts)

    def _note(self, step: Sources) -> None:
        if step.fixed is not None:
            self._state, self._sample = step.fixed.inputs

    def _numbers(self, attitude: Array) -> Array:
        """Return an attitude of the unit as numbers."""
        return attitude if self._state is None else numbers(self._state, attitude)

    def taken(self, samples: Array) -> Array:
        """Return samples as the unit takes them, (N, 3): in fixed point what rounding leaves goes into the next one."""
        if self._state is None:
            return np.asarray(np.asarray(samples, self.identity.dtype), np.float64)
        return np.asarray(pulses(np.asarray(samples)[:, None], self._sample.unit)[:, 0])

    @property
    def attitude(self) -> Array:
        """The committed attitude, at the end of the last committed interval."""
        return self._numbers(self._unit.attitude)

    @property
    def pending(self) -> int:
        """Intervals that are not committed yet."""
        return self._unit.pending

    @property
    def committed(self) -> list[Array]:
        """Attitudes at the ends of the intervals that the last call committed; of C the last of them alone."""
        return [self._numbers(attitude) for attitude in self._unit.committed]

    def push(self, sample: Any, kind: int = SampleKind.GOOD) -> int:
        """Take the sample of the next interval, and return how many intervals it commits.

        Parameters
        ----------
        sample : array_like, (3,)
            Angle increment of the interval in rad, body axes; of no meaning if it was lost.
        kind : int, optional
            0 if it is good, 1 if it was lost, 2 if it is the sum of this and the last interval, whose sample was lost.

        Raises
        ------
        GapError
            If a lost sample cannot be restored; nothing has changed then.
        InputError
            If a number is not allowed.
        """
        number = checks.count("kind", kind, smallest=0, largest=max(SampleKind))
        values = np.zeros(3) if number == SampleKind.LOST else checks.real_array("sample", sample, (3,))
        if values.shape != (3,):
            raise InputError(f"sample has shape {values.shape}; (3,) is needed")
        if self._state is None:
            return self._unit.push(values, number)
        values, rest = sample_integers(self._sample, values, number, self._rest)
        commits = self._unit.push(values, number)
        self._rest = rest
        return commits

    def now(self) -> Array:
        """Return the present attitude, at the end of the last interval, by one-sided filters."""
        return self._numbers(self._unit.now())

    def flush(self) -> int:
        """Commit the intervals that are not committed yet, and return how many."""
        return self._unit.flush()

    def reset(self, attitude: Any) -> None:
        """Replace the committed attitude, for instance by that of an alignment; the samples stay.

        Parameters
        ----------
        attitude : array_like, (state shape)
            At the end of the last committed interval.
        """
        state = checks.real_array("attitude", attitude, self.identity.shape)
        if state.shape != self.identity.shape:
            raise InputError(f"attitude has shape {state.shape}; {self.identity.shape} is needed")
        if self._state is not None:
            state = integers(self._state, state, "the attitude")
        self._unit.reset(state)
