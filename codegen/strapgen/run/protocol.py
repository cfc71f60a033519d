"""`Backend` is the protocol of a running algorithm: simulator, experiments and tests use nothing else of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.sources import Sources
from strapgen.run.evaluators import Array, Evaluator, StepInWords
from strapgen.run.increments import PART, run_parts
from strapgen.run.numpy_evaluator import NumpyEvaluator
from strapgen.run.step_sources import StepSources
from strapgen.targets.registry import NUMPY


class Backend(StepInWords, ABC):
    """An attitude algorithm that runs.

    It can be pickled, so that a pool of processes can run it: the sources of the step and of its kernels travel, and
    compiled C comes from the cache.

    Parameters
    ----------
    parts : StepSources
        Sources of an attitude step and of its kernels.
    step : Evaluator
        The step as a callable; the class of one target builds it.

    Attributes
    ----------
    name : str
        Name of the back end.
    kernel : str
        Name of the kernel that it runs.
    dtype : dtype
        Type of its states.
    takes : str
        Name of the step's second input: "increments", or "turns" where a step takes rates at nodes times its length.
    increments : int
        Number of increments of a step.
    previous, ahead : int
        Numbers of increments from before the step and from after it that it takes in addition.
    samples : int
        Number of increments that a step takes in all.
    state_shape : tuple of int
        Shape of the state.
    elements : tuple of str
        Names of the state's elements, row-major.
    identity : array
        The state of zero rotation.
    attitude : str or None
        Kernel that converts the state to a direction cosine matrix; None where the state is one.
    unit : float
        Unit in the last place of a state's element near 1.
    increment_unit : float or None
        Unit in the last place of an increment in rad, in fixed point; None in floating point.
    count : float or None
        Angle of a count in rad for a step that takes a gyro's counts; None for any other.
    saturates : bool
        Whether an element of a state that would exceed 1 is stored as the largest number.
    sources : Sources
        Sources of the step.
    """

    increment_unit: float | None = None
    count: float | None = None
    saturates: bool = False

    def __init__(self, parts: StepSources, step: Evaluator) -> None:
        sources, kernels = parts.step, parts.step_kernels
        state, samples = sources.function.inputs
        self.sources = sources
        self.name = sources.target
        self.kernel = sources.kernel
        self.takes = samples.name
        self.samples = samples.shape[0]
        self.previous, self.ahead = kernels.previous, kernels.ahead
        self.increments = self.samples - kernels.beside
        self.state_shape = state.shape
        self.elements = state.elements
        self.attitude = kernels.attitude
        self._parts = parts
        self._orthonormalization = parts.orthonormalization or kernels.orthonormalize
        self._step = step
        self.dtype = step.dtype
        self.identity: Array = np.array([float(x) for x in kernels.identity], self.dtype).reshape(state.shape)
        self.unit = float(np.finfo(self.dtype).eps)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the class and its sources, from which another process builds the same back end."""
        return type(self), (self._parts.complete(self._kernels()),)

    def _kernels(self) -> list[tuple[str | None, str]]:
        """Return the kernels that it may need beside the step, each with its target."""
        return [(self._orthonormalization, self.sources.target), (self.attitude, NUMPY)]

    @property
    def nodes(self) -> tuple[float, ...]:
        """Nodes at which a step takes the rate, as fractions of its length; empty if it takes increments."""
        return self._parts.nodes

    @abstractmethod
    def beside(self, kernel: str) -> Evaluator:
        """Return another kernel on the same target as the step: one that restores a state, or converts it.

        Parameters
        ----------
        kernel : str
            A kernel that the step brings, or of the catalogue.
        """

    def _sources(self, kernel: str) -> Sources:
        """Return the sources of a kernel for the step's own target."""
        return self._parts.sources(kernel, self.sources.target)

    def matrices(self, states: Any) -> Array:
        """Return the attitude of states.

        Parameters
        ----------
        states : array_like, (..., state shape)

        Returns
        -------
        array, (..., 3, 3)
            Direction cosine matrices, body to reference, in double.
        """
        states = np.asarray(states, np.float64)
        if self.attitude is None:
            return np.array(states)
        return np.asarray(NumpyEvaluator(self._parts.sources(self.attitude, NUMPY))(states))

    def rounding_bound(self, steps: int, rounded_inputs: bool = False) -> float | None:
        """Return a certified bound of what rounding does to a run without orthonormalization.

        Parameters
        ----------
        steps : int
        rounded_inputs : bool, optional
            Whether the bound covers increments that must be rounded to the input's format first.

        Returns
        -------
        float or None
            Bound of the distance from the same algorithm in exact arithmetic, as the length of the difference of two
            states, or of two rows of matrices; None where nothing is certified, as in floating point.
        """
        return None

    def angle_bound(
        self,
        steps: int,
        rounded_inputs: bool = False,
        orthonormalize_every: int = 0,
        shortest: float = 0.0,
    ) -> float | None:
        """Return a certified bound of the angle by which rounding turns the attitude over a run.

        A run begins at a proper attitude. The bound holds while the state stays near one: `AngleAccumulation` says how
        near, and for how many steps that is proved.

        Parameters
        ----------
        steps : int
        rounded_inputs : bool, optional
            Whether the bound covers increments that must be rounded to the input's format first.
        orthonormalize_every : int, optional
            Steps from one orthonormalization to the next; 0 for none.
        shortest : float, optional
            Length that no state of the run falls short of, or singular value of a matrix, where more is known of it
            than is proved of every run.

        Returns
        -------
        float or None
            Angle in rad from the same algorithm in exact arithmetic; None where nothing is certified.
        """
        return None

    def representable(self, increments: Any) -> Array:
        """Return increments rounded to the numbers that the step takes: in floating point, to `dtype`."""
        return np.asarray(increments, self.dtype)

    def prepared(self, increments: Any) -> Callable[[], Any]:
        """Return a call that propagates from zero rotation and records all states, for timing.

        Every conversion of the increments is done before.

        Parameters
        ----------
        increments : array_like, (N, K, 3)
            Angle increments in rad.
        """
        converted = np.ascontiguousarray(increments, self.dtype)
        return lambda: self.propagate(converted)

    def need_increments(self) -> None:
        """Check that steps take angle increments.

        Raises
        ------
        InputError
            If they take something else.
        """
        if self.takes != "increments":
            raise InputError(
                f"kernel {self.kernel} takes {self.takes}; a step that takes increments is needed"
            )

    def step(self, state: Any, increments: Any) -> Array:
        """Advance the state by one step.

        Parameters
        ----------
        state : array_like, (..., state shape)
            Body-to-reference attitude.
        increments : array_like, (..., samples, 3)
            Angle increments of the step in rad, body axes, oldest first, after those from before it.

        Returns
        -------
        array, (..., state shape)

        Raises
        ------
        InputError, InputTypeError
            If a shape, a dtype or a value does not fit.
        """
        return np.asarray(self._step(state, increments))

    def orthonormalize(self, state: Any) -> Array:
        """Restore the constraint of a state: its length, or its orthogonality.

        Parameters
        ----------
        state : array_like, (..., state shape)

        Returns
        -------
        array, (..., state shape)
        """
        return np.asarray(self.beside(self._need_orthonormalization())(state))

    def _need_orthonormalization(self) -> str:
        """Return the kernel that orthonormalizes, if there is one."""
        if self._orthonormalization is None:
            raise InputError(f"kernel {self.kernel} has nothing to orthonormalize its state with")
        return self._orthonormalization

    def propagate(
        self,
        increments: Any,
        record_every: int = 1,
        orthonormalize_every: int | None = None,
        initial: Any = None,
        jobs: int = 1,
    ) -> Array:
        """Run the algorithm over a sequence of increments.

        Parameters
        ----------
        increments : array_like, (..., N, samples, 3)
            Angle increments of N steps in rad, body axes; leading axes are independent runs. `gyro.windows` cuts a
            row of increments into those of each step.
        record_every, orthonormalize_every : int, optional
            Steps from record to record, and from orthonormalization to orthonormalization; never by default. A record
            of the same step is taken after it.
        initial : array_like, (..., state shape), optional
            State at the start, by default zero rotation.
        jobs : int, optional
            Number of threads that share independent runs of C in double or float, which needs no lock of the
            interpreter; other back ends use one. The bits are those of one thread.

        Returns
        -------
        array, (..., 1 + N // record_every, state shape)
            The initial state and the records.

        Raises
        ------
        InputError, InputTypeError
            If a shape, a dtype or a value does not fit.

        Examples
        --------
        >>> from strapgen import backend
        >>> turn = np.tile([0.0, 0.0, np.pi / 64], (16, 2, 1))
        >>> backend("euler", backend="numpy").propagate(turn)[-1].round(6)
        array([0.      , 0.      , 0.707107, 0.707107])
        """
        d = checks.real_array("increments", increments, (self.samples, 3), self.dtype)
        if d.ndim < 3:
            raise InputError(f"increments has shape {d.shape}; (..., steps, {self.samples}, 3) is needed")
        self._check_schedule(record_every, orthonormalize_every)
        checks.count("jobs", jobs)
        start = self.identity if initial is None else initial
        start = checks.real_array("initial", start, self.state_shape, self.dtype)
        batch, steps = d.shape[:-3], d.shape[-3]
        try:
            start = np.broadcast_to(start, batch + self.state_shape)
        except ValueError:
            raise InputError(
                f"initial has shape {start.shape}; it must broadcast to {batch + self.state_shape}"
            ) from None
        runs = int(np.prod(batch, dtype=int))
        if not runs:
            return np.empty((*batch, 1 + steps // record_every, *self.state_shape), self.dtype)
        history = self._in_threads(
            d.reshape(runs, steps, self.samples, 3),
            record_every,
            orthonormalize_every or 0,
            np.ascontiguousarray(start).reshape(runs, *self.state_shape),
            jobs,
        )
        return history.reshape(*batch, 1 + steps // record_every, *self.state_shape)

    def propagate_parts(
        self,
        part: Callable[[int, int], Any],
        steps: int,
        record_every: int = 1,
        orthonormalize_every: int | None = None,
        initial: Any = None,
    ) -> Array:
        """Run the algorithm over increments that come part by part.

        The result has the bits of `propagate`, whose arrays hold the whole run.

        Parameters
        ----------
        part : callable
            ``part(first, count)`` returns the increments of some steps, (count, samples, 3), one part after the other.
        steps : int
            Number of steps of the run.
        record_every, orthonormalize_every, initial : optional
            As for `propagate`; one run has one initial state.

        Returns
        -------
        array, (1 + steps // record_every, state shape)

        Raises
        ------
        InputError, InputTypeError
            As `propagate` does.
        """
        if steps <= PART:
            return self.propagate(part(0, steps), record_every, orthonormalize_every, initial)
        self._check_schedule(record_every, orthonormalize_every)
        history = np.empty((1 + steps // record_every, *self.state_shape), self.dtype)
        start = self.identity if initial is None else initial
        history[0] = start = checks.real_array("initial", start, self.state_shape, self.dtype)
        memory: Any = self._memory(start)
        for first, count, restore_every in run_parts(steps, orthonormalize_every or 0):
            increments = checks.real_array("increments", part(first, count), (self.samples, 3), self.dtype)
            states, memory = self._continue(increments, restore_every, memory, first)
            ahead = -first % record_every or record_every
            recorded = states[ahead - 1 :: record_every]
            place = (first + ahead) // record_every
            history[place : place + len(recorded)] = recorded
        return history

    def _continue(
        self, increments: Array, orthonormalize_every: int, memory: Any, first: int
    ) -> tuple[Array, Any]:
        """Return the states after each of some steps, (N, state shape), and the memory for the steps after them.

        The number of the first step serves messages.
        """
        states = self._propagate(
            increments[None], 1, orthonormalize_every, np.ascontiguousarray(memory)[None]
        )
        return states[0, 1:], states[0, -1]

    def _memory(self, initial: Array) -> Any:
        """Return the memory with which a run begins at a state."""
        return initial

    def _check_schedule(self, record_every: int, orthonormalize_every: int | None) -> None:
        checks.count("record_every", record_every, largest=checks.MOST)
        if orthonormalize_every is not None:
            checks.count("orthonormalize_every", orthonormalize_every, largest=checks.MOST)
            self._need_orthonormalization()

    def _in_threads(
        self, increments: Array, record_every: int, orthonormalize_every: int, initial: Array, jobs: int
    ) -> Array:
        """Propagate as `_propagate` does, in some threads where that is faster."""
        return self._propagate(increments, record_every, orthonormalize_every, initial)

    @abstractmethod
    def _propagate(
        self, increments: Array, record_every: int, orthonormalize_every: int, initial: Array
    ) -> Array:
        """Propagate checked arrays (runs, N, K, 3) from (runs, state shape)."""
