"""Algorithms in two speeds, run from gyro and accelerometer increments on every back end.

A fast loop sums coning and sculling, a slow loop updates the attitude and transforms the velocity, and a third one
follows the navigation frame.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.notebook_display import short_repr
from strapgen.navigation.two_speed.loops import Cycles, Loops, LoopsInC, LoopSources, loop_sources
from strapgen.run.backend_names import BACKENDS, evaluator_class
from strapgen.run.backends import fitted
from strapgen.run.evaluators import Array, Evaluator


class TwoSpeedRun(NamedTuple):
    """The result of a run."""

    #: (slow cycles, state shape): attitude after every slow cycle, and after the navigation cycle that ends
    #: with it
    attitudes: Array
    #: (navigation cycles, 3): integral of the specific force over every navigation cycle in m/s, in the
    #: rotating navigation axes. Gravity and Coriolis terms are for the navigation to add
    velocity_changes: Array


class TwoSpeed:
    """An algorithm in two speeds on a back end.

    It can be pickled, so that a pool of processes can run it.

    Parameters
    ----------
    algorithm : str
        "dcm" or "euler".
    sculling : int, optional
        Form of the sculling integral: 1 has the rotation compensation in the fast loop, 2 in the slow loop.
    backend : str, optional
        A key of `strapgen.run.backends.BACKENDS`.
    settings : Settings, optional
        Settings of fixed point.

    Attributes
    ----------
    name : str
        Name of the back end.
    loops : tuple of Sources
        The fast, the slow and the navigation loop.
    state : Signal
        The attitude.
    identity : array
        The attitude of zero rotation.

    Raises
    ------
    InputError
        If a name or number is not allowed.
    CompilerError
        If the back end needs a C compiler and there is none.

    Examples
    --------
    A turning table, level, with 0.01 rad in a slow cycle of two fast ones:

    >>> turning = TwoSpeed("euler")
    >>> run = turning.run(np.tile([0.0, 0.0, 0.005], (4, 1)), np.zeros((4, 3)), fast_cycles=2)
    >>> run.attitudes[-1].round(5)
    array([0.     , 0.     , 0.01   , 0.99995])
    """

    __repr__ = short_repr

    def _in_words(self) -> str:
        return f"on {self.name}: {', '.join(sources.kernel for sources in self.loops)}"

    def __init__(
        self,
        algorithm: str,
        sculling: int = 2,
        backend: str = "numpy",
        settings: Settings | None = None,
    ) -> None:
        target = BACKENDS[checks.choice("backend", backend, BACKENDS)].target
        chosen = fitted(backend, settings)
        self._load(backend, loop_sources(algorithm, sculling, target, chosen))

    @classmethod
    def of_sources(cls, name: str, sources: LoopSources) -> TwoSpeed:
        """Return loops and the C of the whole, if there is any, as an algorithm under a name."""
        runner = cls.__new__(cls)
        runner._load(name, sources)
        return runner

    def _load(self, name: str, sources: LoopSources) -> None:
        """Load the code of the loops."""
        self.name = name
        self.loops = sources.loops
        loops = Loops if sources.whole is None else LoopsInC
        self._runner = loops(sources, evaluator_class(self.loops[0].target))
        self.state = self.loops[1].function.inputs[0]
        self.identity: Array = np.eye(3) if self.state.size == 9 else np.array([0.0, 0, 0, 1])

    def __getstate__(self) -> tuple[str, LoopSources]:
        """Return the name of the back end and the sources, which say all."""
        return self.name, self._runner.sources

    def __setstate__(self, state: tuple[str, LoopSources]) -> None:
        """Load the code again, C from the cache."""
        self._load(*state)

    @cached_property
    def evaluators(self) -> tuple[Evaluator, ...]:
        """The generated function of each loop by itself."""
        return tuple(map(self._runner.evaluator, self.loops))

    def run(
        self,
        increments: Any,
        velocity_increments: Any,
        *,
        fast_cycles: int,
        slow_cycles: int = 1,
        turns: Any = None,
        initial: Any = None,
        previous: Any = None,
    ) -> TwoSpeedRun:
        """Run whole navigation cycles.

        Parameters
        ----------
        increments : array_like, (N, 3)
            Angle increments of the fast cycles in rad, body axes.
        velocity_increments : array_like, (N, 3)
            Velocity increments of the fast cycles in m/s, body axes.
        fast_cycles : int
            Number of fast cycles in a slow cycle.
        slow_cycles : int, optional
            Number of slow cycles in a navigation cycle.
        turns : array_like, (1 + N / fast_cycles, 3), optional
            Rate of the navigation frame at the ends of the slow cycles, times their length, in rad; zero by default.
        initial : array_like, (state shape), optional
            Attitude at the start, by default zero rotation.
        previous : array_like, (3,), optional
            Angle increment of the fast cycle before the first; zero by default.

        Returns
        -------
        TwoSpeedRun

        Raises
        ------
        InputError, InputTypeError
            If a shape, a dtype or a value does not fit.
        """
        checks.count("fast_cycles", fast_cycles, largest=checks.MOST)
        checks.count("slow_cycles", slow_cycles, largest=checks.MOST)
        angles, velocities = _samples(increments, velocity_increments, fast_cycles * slow_cycles)
        ends = len(angles) // fast_cycles + 1
        rates = np.zeros((ends, 3)) if turns is None else turns
        rates = checks.real_array("turns", rates, (3,), np.float64)
        if rates.shape != (ends, 3):
            raise InputError(f"turns has shape {rates.shape}; {(ends, 3)} is needed")
        start = self.identity if initial is None else initial
        start = checks.real_array("initial", start, self.state.shape, np.float64)
        before = np.zeros(3) if previous is None else previous
        before = checks.real_array("previous", before, (3,), np.float64)
        stored = self._runner.stored
        cycles = Cycles(
            samples={
                "increment": stored("increment", angles, summed=True),
                "velocity_increment": stored("velocity_increment", velocities, summed=True),
                "turn": stored("turn", rates[1:]),
            },
            start={
                "state": stored("state", start.reshape(1, -1)),
                "previous_turn": stored("previous_turn", rates[:1]),
                "previous_increment": stored("previous_increment", before.reshape(1, -1)),
            },
            fast=fast_cycles,
            slow=slow_cycles,
        )
        with np.errstate(all="ignore"):  # numbers that overflow are refused, in one line
            attitudes, changes = self._runner.run(cycles)
        run = TwoSpeedRun(
            self._runner.in_si("state", attitudes).reshape(-1, *self.state.shape),
            self._runner.in_si("velocity_change", changes),
        )
        for what, values in zip(("attitude", "velocity"), run, strict=True):
            if not np.isfinite(values).all():
                raise InputError(f"the {what} does not stay finite: increments or turns are too large")
        return run


def _samples(increments: Any, velocity_increments: Any, cycle: int) -> tuple[Array, Array]:
    """Check the increments, which fill whole navigation cycles of `cycle` fast cycles, and return them."""
    angles = checks.real_array("increments", increments, (3,), np.float64)
    velocities = checks.real_array("velocity_increments", velocity_increments, (3,), np.float64)
    if angles.ndim != 2 or len(angles) % cycle:
        raise InputError(
            f"increments has shape {angles.shape}; (N, 3) with N a multiple of {cycle}, "
            "whole navigation cycles, is needed"
        )
    if velocities.shape != angles.shape:
        raise InputError(
            f"velocity_increments has shape {velocities.shape}; that of increments, {angles.shape}, is needed"
        )
    return angles, velocities
