"""The protocol of back ends: all that simulator, truth models and tests see of generated code."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.backends.step_sources import StepSources
from strapgen.ir.sources import Sources
from strapgen.support import checks
from strapgen.support.exceptions import InputError

Array = NDArray[Any]


class Evaluator(ABC):
    """A generated function, called with arrays of samples. It can be pickled: the sources are, and built again.

    Parameters
    ----------
    sources : Sources
        What it is made of.
    dtype : dtype
        Type of the numbers that it computes with; a class of one target knows it.
    """

    def __init__(self, sources: Sources, dtype: Any) -> None:
        self.sources = sources
        self.function = sources.function
        self.dtype = np.dtype(dtype)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what makes it again in another process: its class and its sources."""
        return type(self), (self.sources,)

    def __call__(self, *values: Any) -> Any:
        """Call the function.

        Parameters
        ----------
        *values : array_like
            The inputs in order, each (..., shape of the signal); leading axes broadcast.

        Returns
        -------
        array or tuple of array
            The outputs.

        Raises
        ------
        InputError, InputTypeError
            If the number of inputs, a shape, a dtype or a value does not fit.
        """
        signals = self.function.inputs
        if len(values) != len(signals):
            names = ", ".join(signal.name for signal in signals)
            raise InputError(
                f"{self.function.name} got {len(values)} inputs; {len(signals)} are needed: {names}"
            )
        arrays = [
            checks.real_array(signal.name, value, signal.shape, self.dtype)
            for signal, value in zip(signals, values, strict=True)
        ]
        leading = [a.shape[: a.ndim - len(s.shape)] for a, s in zip(arrays, signals, strict=True)]
        try:
            batch = np.broadcast_shapes(*leading)
        except ValueError:
            shapes = ", ".join(f"{s.name} {a.shape}" for s, a in zip(signals, arrays, strict=True))
            raise InputError(f"the leading axes of {shapes} do not broadcast together") from None
        results = self.evaluate(arrays, batch)
        return results[0] if len(results) == 1 else results

    @abstractmethod
    def evaluate(self, arrays: list[Array], batch: tuple[int, ...]) -> tuple[Array, ...]:
        """Evaluate on checked arrays whose leading axes broadcast to `batch`."""


class Backend(ABC):
    """An attitude algorithm, compiled and ready to run.

    It can be pickled, so that a pool of processes can run it: its sources are, with those of the kernels beside the
    step, and built again, C from the cache.

    Parameters
    ----------
    parts : StepSources
        Sources of an attitude step, and of what goes with it.

    Attributes
    ----------
    name : str
        Name of the back end.
    kernel : str
        Name of the kernel that it runs.
    dtype : dtype
        Type of the numbers that it computes with.
    takes : str
        What a step takes: "increments", or "turns": rates at the nodes times the step length.
    increments, previous : int
        How many of them belong to a step, and how many from before it that it takes too.
    samples : int
        How many a step takes, both together.
    state_shape : tuple of int
        Shape of the state.
    elements : tuple of str
        Names of the state's elements, row-major.
    identity : array
        The state of zero rotation.
    attitude : str or None
        Kernel that turns a state into a direction cosine matrix; None where the state is one.
    unit : float
        Unit of the last place of a state's element near 1.
    sources : Sources
        What it was made of.
    """

    def __init__(self, parts: StepSources) -> None:
        sources = parts.step
        companions = sources.companions
        if companions is None:
            raise InputError(f"kernel {sources.kernel} is no attitude step; back ends are built from steps")
        state, samples = sources.function.inputs
        self.sources = sources
        self.name = sources.target
        self.kernel = sources.kernel
        self.takes = samples.name
        self.samples = samples.shape[0]
        self.previous = companions.previous
        self.increments = self.samples - self.previous
        self.state_shape = state.shape
        self.elements = state.elements
        self.attitude = companions.attitude
        self._parts = parts
        self._product = companions.product
        self._orthonormalization = parts.orthonormalization or companions.orthonormalize
        self._step: Evaluator = parts.evaluator(sources.kernel)
        self.dtype = self._step.dtype
        self.identity: Array = np.array([float(x) for x in companions.identity], self.dtype).reshape(
            state.shape
        )
        self.unit = float(np.finfo(self.dtype).eps)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what makes it again in another process: its class, and sources that need nothing else."""
        return type(self), (self._parts.complete(),)

    def beside(self, kernel: str) -> Evaluator:
        """Return a kernel that works on the same state, on the same target: an orthonormalization.

        Parameters
        ----------
        kernel : str
            One that the step brings, or of the catalogue.
        """
        return self._parts.evaluator(kernel)

    def matrices(self, states: Any) -> Array:
        """Return the attitude that states stand for.

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
        result: Array = self._parts.evaluator(self.attitude, "numpy")(states)
        return result

    def rounding_bound(self, steps: int, rounded_inputs: bool = False) -> float | None:
        """Return a certified bound of what rounding does to a run without orthonormalization.

        Parameters
        ----------
        steps : int
        rounded_inputs : bool, optional
            Whether increments that are no integers of the input's format are counted too.

        Returns
        -------
        float or None
            Bound of the distance from the same algorithm in exact arithmetic, as the length of the difference of two
            states, or of two rows of matrices; None where nothing is certified, as in floating point.
        """
        return None

    def representable(self, increments: Any) -> Array:
        """Return increments rounded to what the back end takes: in floating point, as they are."""
        return np.asarray(increments, self.dtype)

    def prepared(self, increments: Any) -> Callable[[], Any]:
        """Return a call that propagates from zero rotation, keeping all states, with every conversion done: for timing.

        Parameters
        ----------
        increments : array_like, (N, K, 3)
            Angle increments in rad.
        """
        ready = np.ascontiguousarray(increments, self.dtype)
        return lambda: self.propagate(ready)

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
        result: Array = self._step(state, increments)
        return result

    def orthonormalize(self, state: Any) -> Array:
        """Restore the constraint of a state: its length, or its orthogonality.

        Parameters
        ----------
        state : array_like, (..., state shape)

        Returns
        -------
        array, (..., state shape)
        """
        result: Array = self.beside(self._need_orthonormalization())(state)
        return result

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
    ) -> Array:
        """Run the algorithm over a sequence of increments.

        Parameters
        ----------
        increments : array_like, (..., N, samples, 3)
            Angle increments of N steps in rad, body axes; leading axes are independent runs. `gyro.windows` makes them
            of increments in a row.
        record_every : int, optional
            Steps from record to record.
        orthonormalize_every : int, optional
            Steps from orthonormalization to orthonormalization; never by default. A record of the same
            step is taken after it.
        initial : array_like, (..., state shape), optional
            State at the start, by default zero rotation.

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
        checks.count("record_every", record_every, largest=checks.MOST)
        if orthonormalize_every is not None:
            checks.count("orthonormalize_every", orthonormalize_every, largest=checks.MOST)
            self._need_orthonormalization()
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
        history = self._propagate(
            d.reshape(runs, steps, self.samples, 3),
            record_every,
            orthonormalize_every or 0,
            np.ascontiguousarray(start).reshape(runs, *self.state_shape),
        )
        return history.reshape(*batch, 1 + steps // record_every, *self.state_shape)

    @abstractmethod
    def _propagate(
        self, increments: Array, record_every: int, orthonormalize_every: int, initial: Array
    ) -> Array:
        """Propagate checked arrays (runs, N, K, 3) from (runs, state shape)."""
