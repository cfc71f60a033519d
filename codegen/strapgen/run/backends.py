"""Back ends run generated algorithms: `backend` and `build` return one, `evaluator` a kernel as a callable."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from strapgen import catalogue
from strapgen.catalogue import AnyAlgorithm, Choice, named
from strapgen.catalogue.choice import AnyMethod
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.interfaces import Interface
from strapgen.ir.notebook_display import counted_shape, short_repr
from strapgen.ir.read_only import read_only
from strapgen.ir.renamed import renamed, renamed_parameters
from strapgen.ir.sources import Sources
from strapgen.registry import Merged
from strapgen.run.backend_names import BACKENDS, DEFAULT_BACKENDS, Entry, of_sources
from strapgen.run.evaluators import Array, Evaluator, Loop, in_si
from strapgen.run.increments import PART, run_parts
from strapgen.run.kernel_sources import StepSources, sources_of_choice
from strapgen.run.orders import ORDERS, SCANNING, SEQUENTIAL
from strapgen.targets.registry import NUMPY, TARGETS

__all__ = [
    "BACKENDS",
    "DEFAULT_BACKENDS",
    "Backend",
    "Entry",
    "Evaluator",
    "backend",
    "build",
    "evaluator",
    "fit_settings",
    "of_sources",
    "sources_to_build",
]


_KERNELS = Merged(catalogue.KERNELS, catalogue.LAYOUT_KERNELS)
#: Orthonormalizations that leave the attitude where it is, but for rounding: one factor for all parameters, and for
#: matrices a symmetric expansion of the inverse root of C'C.
KEEP_THE_ATTITUDE = frozenset(
    (
        *("euler-normalize", "euler-normalize-first-order"),
        *("cayley-klein-normalize", "cayley-klein-normalize-first-order"),
        *("dcm-orthonormalize-first-order", "dcm-orthonormalize-second-order"),
    )
)
#: The orthonormalization that turns the attitude by a little: the scheme of dual rows.
_DUAL_ROWS = "dcm-orthonormalize"


@renamed(samples="samples_per_step", beside="companion")
class Backend:
    """An attitude algorithm that runs.

    It can be pickled, so that a pool of processes can run it: the sources of the step and of its kernels travel, and
    compiled C comes from the cache.

    Parameters
    ----------
    parts : StepSources
        Sources of an attitude step and of its kernels.
    order : str, optional
        Order in which the steps of a run are multiplied, see `strapgen.backend`.

    Attributes
    ----------
    evaluator : Evaluator
        The step as a callable.
    name : str
        Name of the back end.
    kernel : str
        Name of the kernel that it runs.
    dtype : dtype
        Type of its states.
    takes : str
        Name of the step's second input: "increments", or "node_rotations" where a step takes rates at nodes times its
        length.
    increments : int
        Number of increments of a step.
    previous, ahead : int
        Numbers of increments from before the step and from after it that it takes in addition.
    samples_per_step : int
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
    interface : Interface
        Formats, ranges and error bounds of the step; an attribute in fixed point alone.

    Examples
    --------
    >>> from strapgen import backend
    >>> made = backend("euler", "rk4", 2)
    >>> made.step(made.identity, np.zeros((2, 3)))
    array([0., 0., 0., 1.])
    """

    interface: Interface

    __repr__ = short_repr

    def _in_words(self) -> str:
        state = f"state {counted_shape(self.state_shape)} {self.dtype}"
        return f"{self.name}: {self.kernel}, {self.samples_per_step} {self.takes} a step, {state}"

    def __init__(self, parts: StepSources, order: str = SEQUENTIAL) -> None:
        sources, kernels = parts.step, parts.step_kernels
        state, samples = sources.function.inputs
        self._parts = parts
        self.sources = sources
        self.evaluator: Evaluator = of_sources(sources)
        self.order: str = self._allowed(order, kernels.product)
        self.name: str = self.evaluator.name
        self.kernel: str = sources.kernel
        self.takes: str = samples.name
        self.samples_per_step: int = samples.shape[0]
        self.previous: int = kernels.previous
        self.ahead: int = kernels.ahead
        self.increments: int = self.samples_per_step - kernels.extra_increments
        self.state_shape: tuple[int, ...] = state.shape
        self.elements: tuple[str, ...] = state.elements
        self.attitude: str | None = kernels.attitude
        self._orthonormalization = parts.orthonormalization or kernels.orthonormalize
        self._product = kernels.product if self.evaluator.needs_product else None
        self._beside: dict[str, Evaluator] = {}
        self.dtype: np.dtype[Any] = self.evaluator.dtype
        identity = np.array([float(x) for x in kernels.identity], self.dtype)
        self.identity: Array = read_only(identity.reshape(state.shape))
        self.unit: float = float(np.finfo(self.dtype).eps)
        self.increment_unit: float | None = None
        self.count: float | None = None
        self.saturates: bool = False
        if sources.fixed is not None:
            self.interface = sources.fixed
            taken, result = sources.fixed.inputs[1], sources.fixed.outputs[0]
            self.unit = float(result.format.unit)
            self.increment_unit = float(taken.unit)
            self.saturates = result.saturates
            self.count = None if taken.sensor is None else self.increment_unit

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the class and its sources, from which another process builds the same back end."""
        target = self.sources.target
        needed = [(self._orthonormalization, target), (self._product, target), (self.attitude, NUMPY)]
        return type(self), (self._parts.complete(needed), self.order)

    def _allowed(self, order: str, product: str | None) -> str:
        """Return an order in which the code of the step can be run."""
        checks.choice("order", order, ORDERS)
        if order == SEQUENTIAL or self.evaluator.scans:
            return order
        kernel, name = self.sources.kernel, self.evaluator.name
        if product is None:
            reason = f"a step that is linear in its state is needed, and {kernel} is not"
        elif name not in SCANNING:
            reason = f"it goes with the back ends {' and '.join(SCANNING)}, not with {name}"
        else:
            reason = f"the transition of {kernel} holds constants, and its code no product of transitions"
        raise InputError(f"order is {order}; {reason}")

    @property
    def nodes(self) -> tuple[float, ...]:
        """Nodes at which a step takes the rate, as fractions of its length; empty if it takes increments."""
        return self._parts.nodes

    @property
    def choice(self) -> Choice | None:
        """The choice of the step; None where its sources do not tell it."""
        return self._parts.choice

    def companion(self, kernel: str) -> Evaluator:
        """Return another kernel on the same target as the step: one that restores a state, or converts it.

        Parameters
        ----------
        kernel : str
            A kernel that the step brings, or of the catalogue.
        """
        if kernel not in self._beside:
            self._beside[kernel] = of_sources(self._parts.sources(kernel, self.sources.target))
        return self._beside[kernel]

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
        return np.asarray(of_sources(self._parts.sources(self.attitude, NUMPY))(states))

    def rounding_bound(self, steps: int, rounded_inputs: bool = False) -> float | None:
        """Return a certified bound of the rounding error of a run without orthonormalization.

        Parameters
        ----------
        steps : int
        rounded_inputs : bool, optional
            Whether the bound covers increments that must be rounded to the input's format first.

        Returns
        -------
        float or None
            Bound of the distance from the same algorithm in exact arithmetic, as the length of the difference of two
            states, or of two rows of matrices; None where nothing is certified, as in floating point. Where a state
            saturates, it holds as long as no element of the exact state exceeds 1 in magnitude.
        """
        fixed = self.sources.fixed
        if fixed is None or fixed.accumulation is None:
            return None
        return fixed.accumulation.bound(steps, rounded_inputs)

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
        fixed, count, error, dual_rows = self.sources.fixed, 0, Fraction(0), False
        if fixed is None or fixed.angle_accumulation is None:
            return None
        angles = fixed.angle_accumulation
        if (orthonormalize_every or steps) > angles.proved_steps and shortest < angles.shortest:
            return None
        if orthonormalize_every:
            kernel = self._need_orthonormalization()
            dual_rows = kernel == _DUAL_ROWS
            if not (
                kernel in KEEP_THE_ATTITUDE or (dual_rows and orthonormalize_every <= angles.dual_rows_apart)
            ):
                return None
            count = steps // orthonormalize_every
            error = max(self.companion(kernel).interface.outputs[0].errors)
        bound = angles.bound(steps, count, error, rounded_inputs, dual_rows)
        return bound if math.isfinite(bound) else None

    @renamed_parameters(increments="samples")
    def representable(self, samples: Any) -> Array:
        """Return samples, such as increments in rad, rounded to the numbers that the step takes.

        These have the type `dtype`, or in fixed point a format.
        """
        fixed = self.sources.fixed
        values = np.asarray(samples, self.dtype)
        return values if fixed is None else in_si(self.evaluator.stored(1, values), fixed.inputs[1])

    @renamed_parameters(increments="samples")
    def prepared(self, samples: Any) -> Callable[[], Any]:
        """Return a call that propagates from zero rotation and records all states, for timing.

        Every conversion of the samples is done before.

        Parameters
        ----------
        samples : array_like, (N, K, 3)
            Angle increments in rad.
        """
        rows = self._rows(np.asarray(samples, self.dtype)[None])
        loop = self._begin(self.identity[None])
        return lambda: self.evaluator.loop(rows, loop)

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

    @renamed_parameters(increments="samples")
    def step(self, state: Any, samples: Any) -> Array:
        """Advance the state by one step.

        Parameters
        ----------
        state : array_like, (..., state shape)
            Body-to-reference attitude.
        samples : array_like, (..., samples a step, 3)
            Angle increments of the step in rad, body axes, oldest first, after those from before it.

        Returns
        -------
        array, (..., state shape)

        Raises
        ------
        InputError, InputTypeError
            If a shape, a dtype or a value does not fit.
        """
        return np.asarray(self.evaluator(state, samples))

    def orthonormalize(self, state: Any) -> Array:
        """Restore the constraint of a state: its length, or its orthogonality.

        Parameters
        ----------
        state : array_like, (..., state shape)

        Returns
        -------
        array, (..., state shape)
        """
        return np.asarray(self.companion(self._need_orthonormalization())(state))

    @property
    def orthonormalization(self) -> str | None:
        """The kernel that orthonormalizes a state; None where there is none."""
        return self._orthonormalization

    def _need_orthonormalization(self) -> str:
        """Return the kernel that orthonormalizes, if there is one."""
        if self._orthonormalization is None:
            raise InputError(f"kernel {self.kernel} has nothing to orthonormalize its state with")
        return self._orthonormalization

    @renamed_parameters(increments="samples")
    def propagate(
        self,
        samples: Any,
        record_every: int = 1,
        orthonormalize_every: int | None = None,
        initial: Any = None,
        jobs: int = 1,
        *,
        out: Any = None,
    ) -> Array:
        """Run the algorithm over a sequence of samples.

        Parameters
        ----------
        samples : array_like, (..., N, samples a step, 3)
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
        out : array, (..., 1 + N // record_every, state shape), optional
            Memory into which the result is written and which is returned: of the type `dtype`, in C order and apart
            from the inputs. After an error its numbers are undefined.

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
        d = checks.real_array("samples", samples, (self.samples_per_step, 3), self.dtype, finite=False)
        if d.ndim < 3:
            raise InputError(
                f"samples has shape {d.shape}; (..., steps, {self.samples_per_step}, 3) is needed"
            )
        schedule = self._schedule(record_every, orthonormalize_every)
        record_every = schedule["record_every"]
        jobs = checks.count("jobs", jobs)
        start = self._start(initial)
        batch, steps = d.shape[:-3], d.shape[-3]
        try:
            start = np.broadcast_to(start, batch + self.state_shape)
        except ValueError:
            raise InputError(
                f"initial has shape {start.shape}; it must broadcast to {batch + self.state_shape}"
            ) from None
        shape = (*batch, 1 + steps // record_every, *self.state_shape)
        runs = math.prod(batch)
        if out is not None:
            out = checks.output_array("out", out, shape, self.dtype, d, start)
        # Steps after which the last record tells whether all samples were finite.
        told = steps // record_every * record_every
        if "restore" in schedule or not self.evaluator.spreads_nonfinite:
            told = 0
        checks.require_finite("samples", samples, d[..., told:, :, :])
        if not runs:
            return np.empty(shape, self.dtype) if out is None else out
        rows = self._rows(d.reshape(runs, steps, self.samples_per_step, 3))
        begun = self._begin(start.reshape(runs, *self.state_shape))
        loop = replace(begun, **schedule, jobs=jobs, order=self.order, out=out)
        history, _ = self.evaluator.loop(rows, loop)
        if told and not np.isfinite(history[:, -1]).all():
            checks.require_finite("samples", samples, d)
        states = self._states(history).reshape(shape)
        if out is None:
            return states
        if not np.may_share_memory(states, out):
            out[...] = states
        result: Array = out
        return result

    def propagate_parts(
        self,
        part: Callable[[int, int], Any],
        steps: int,
        record_every: int = 1,
        orthonormalize_every: int | None = None,
        initial: Any = None,
        *,
        out: Any = None,
    ) -> Array:
        """Run the algorithm over increments that come part by part.

        The result has the bits of `propagate`, whose arrays hold the whole run.

        Parameters
        ----------
        part : callable
            ``part(first, count)`` returns the increments of some steps, (count, samples, 3), one part after the other.
        steps : int
            Number of steps of the run.
        record_every, orthonormalize_every, initial, out : optional
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
            return self.propagate(part(0, steps), record_every, orthonormalize_every, initial, out=out)
        schedule = self._schedule(record_every, orthonormalize_every)
        record_every, orthonormalize_every = schedule["record_every"], schedule.get("restore_every")
        schedule |= {"record_every": 1, "order": self.order}
        shape, start = (1 + steps // record_every, *self.state_shape), self._start(initial)
        history: Array = (
            np.empty(shape, self.dtype)
            if out is None
            else checks.output_array("out", out, shape, self.dtype, start)
        )
        history[0] = start
        loop = self._begin(np.broadcast_to(start, self.state_shape)[None])
        for first, count, restore_every in run_parts(steps, orthonormalize_every or 0):
            samples = checks.real_array("samples", part(first, count), (self.samples_per_step, 3), self.dtype)
            loop = replace(loop, **schedule | {"first": first, "restore_every": restore_every})
            states, feedback = self.evaluator.loop(self._rows(samples[None]), loop)
            loop = replace(loop, state=states[:, -1], feedback=feedback)
            ahead = -first % record_every or record_every
            recorded = self._states(states[0, ahead::record_every])
            place = (first + ahead) // record_every
            history[place : place + len(recorded)] = recorded
        return history

    def _rows(self, samples: Array) -> Array:
        """Return samples, (runs, N, samples, 3), in the numbers of the code, (runs, N, elements)."""
        self.evaluator.check_limit(1, samples)
        return self.evaluator.stored(1, samples.reshape(*samples.shape[:2], 3 * self.samples_per_step))

    def _states(self, rows: Array) -> Array:
        """Return states in the numbers of the code, (..., elements), as numbers of the same shape."""
        return self.evaluator.in_si(0, rows).reshape(*rows.shape[:-1], *self.state_shape)

    def _start(self, initial: Any) -> Array:
        """Return the checked state at the start, by default zero rotation."""
        start = self.identity if initial is None else initial
        return checks.real_array("initial", start, self.state_shape, self.dtype)

    def _begin(self, states: Array) -> Loop:
        """Return the initial numbers of runs from states, (runs, state shape)."""
        return Loop(
            self.evaluator.stored(0, states.reshape(len(states), self.identity.size)),
            self.evaluator.fresh(len(states)),
            product=None if self._product is None else self.companion(self._product),
        )

    def _schedule(self, record_every: int, orthonormalize_every: int | None) -> dict[str, Any]:
        """Return the fields of a `Loop` that say when states are recorded and orthonormalized, checked."""
        record_every = checks.count("record_every", record_every, largest=checks.MOST)
        if orthonormalize_every is None:
            return {"record_every": record_every}
        orthonormalize_every = checks.count("orthonormalize_every", orthonormalize_every, largest=checks.MOST)
        restore = self.companion(self._need_orthonormalization())
        return {"record_every": record_every, "restore_every": orthonormalize_every, "restore": restore}


def fit_settings(backend: str, settings: Settings | None) -> Settings | None:
    """Return the settings that a back end runs with, in its own word; None in floating point."""
    entry = BACKENDS[checks.choice("backend", backend, BACKENDS)]
    if not entry.fixed:
        if settings is not None:
            takers = ", ".join(name for name, other in BACKENDS.items() if other.fixed)
            raise InputError(f"backend {backend} takes no fixed-point settings; these do: {takers}")
        return None
    if settings is not None and not isinstance(settings, Settings):
        raise InputTypeError(f"settings is {settings!r}; strapgen.Settings is needed")
    settings = settings or Settings()
    if entry.word is None:
        return settings
    if settings.word not in (entry.word, Settings().word):
        raise InputError(f"word is {settings.word}; backend {backend} has words of {entry.word} bits")
    return replace(settings, word=entry.word)


def _settings_of_kernel(backend: str, settings: Settings | None) -> Settings | None:
    """Return the settings of a single kernel: `fit_settings`, or the ranges that are declared for generated text."""
    entry = BACKENDS[checks.choice("backend", backend, BACKENDS)]
    is_text = entry.target in TARGETS and not entry.fixed
    if is_text and isinstance(settings, Settings) and settings.only_ranges:
        return settings
    return fit_settings(backend, settings)


def evaluator(kernel: AnyAlgorithm, backend: str = "numpy", settings: Settings | None = None) -> Evaluator:
    """Return a kernel as a callable.

    Parameters
    ----------
    kernel : str, Choice or AttitudeAlgorithm
        Name of a kernel that takes no method, for instance "dcm-from-euler"; any choice that `strapgen.choose` or
        `Choice.companion` returns, of a user's algorithm too; or what `strapgen.algorithm` returns.
    backend : str, optional
        A key of `BACKENDS`.
    settings : Settings, optional
        Settings of fixed point; ranges alone for generated code in floating point.

    Returns
    -------
    Evaluator

    Raises
    ------
    InputError
        If a name is unknown.
    CompilerError
        If the back end needs a C compiler and there is none.

    Examples
    --------
    >>> evaluator("dcm-from-euler")([0.0, 0.0, 1.0, 0.0])
    array([[-1.,  0.,  0.],
           [ 0., -1.,  0.],
           [ 0.,  0.,  1.]])
    """
    name = getattr(kernel, "choice", kernel)
    checks.require("evaluator", name, str, Choice)
    checks.choice("backend", backend, BACKENDS)
    if isinstance(name, str):
        checks.choice("kernel", name, _KERNELS)
    choice = catalogue.choose(name)
    return of_sources(
        sources_of_choice(choice, BACKENDS[backend].target, _settings_of_kernel(backend, settings))
    )


def backend(
    algorithm: AnyAlgorithm,
    method: AnyMethod | None = None,
    increments: int | None = None,
    backend: str = "numpy",
    orthonormalization: str | None = None,
    settings: Settings | None = None,
    *,
    previous: int | None = None,
    ahead: int | None = None,
    order: str = SEQUENTIAL,
) -> Backend:
    """Return an attitude algorithm as a back end, generated and compiled if it is not in the cache.

    Parameters
    ----------
    algorithm : str, path, Choice or AttitudeAlgorithm
        "dcm", "euler" or "cayley-klein"; a Python file, or the entry point of a user's algorithm; or what
        `strapgen.algorithm` or `strapgen.choose` returns, with which the other parameters of a choice do not go.
    method : str, Tableau, Window or ShapedConing, optional
        A name that ``strapgen list`` shows, or a tableau; by default "rk4".
    increments : int, optional
        Angle increments per step, 1 to 8; by default 2.
    backend : str, optional
        A key of `BACKENDS`.
    orthonormalization : str, optional
        Kernel that orthonormalizes, for instance "dcm-orthonormalize-optimal"; by default the thesis's.
    settings : Settings, optional
        Settings of fixed point: largest increment, rounding, error feedback, and the word of "fixed-model". By default
        increments are at most 1/8 rad. Generated code in floating point takes a largest increment alone: see
        `strapgen.generate`.
    previous, ahead : int, optional
        Numbers of increments from before the step and from after it that it takes in addition, together at most 32;
        by default 0.
    order : str, optional
        "sequential" multiplies the steps of a run one after the other, with the bits of the step itself. "scan" is for
        long single runs of the back ends "c" and "c-float" and of a step that is linear in its state: blocks of
        transitions are multiplied side by side. It is a rounding order of its own, with bits of its own, which are the
        same on every machine.

    Returns
    -------
    Backend

    Raises
    ------
    InputError
        If a name or number is not allowed, or the step has no such order.
    CompilerError
        If the back end needs a C compiler and there is none.

    Examples
    --------
    >>> backend("dcm", method="rk2").increments
    2
    >>> backend(catalogue.choose("dcm", "rk2"), backend="c").name
    'c'
    """
    name = named("backend", algorithm)
    checks.choice("backend", backend, BACKENDS)
    choice = catalogue.choose_step(name, method, increments, previous=previous, ahead=ahead)
    if orthonormalization is not None:
        checks.choice("orthonormalization", orthonormalization, choice.orthonormalizations)
    step = sources_of_choice(choice, BACKENDS[backend].target, _settings_of_kernel(backend, settings))
    return Backend(StepSources(step, choice, orthonormalization), order)


def sources_to_build(choice: Choice, backend: str, settings: Settings | None = None) -> list[Sources]:
    """Return the sources that a back end of an attitude step builds: the step, and its orthonormalization.

    `strapgen.compile_together` compiles those of many steps in one call of the compiler.
    """
    entry = BACKENDS[checks.choice("backend", backend, BACKENDS)]
    step = StepSources(
        sources_of_choice(choice, entry.target, _settings_of_kernel(backend, settings)), choice
    )
    beside = step.step_kernels.orthonormalize
    return [step.step, *([] if beside is None else [step.sources(beside, entry.target)])]


def build(sources: Sources, orthonormalization: str | None = None) -> Backend:
    """Return the generated sources of an attitude step as a back end; C is compiled, once.

    Parameters
    ----------
    sources : Sources
    orthonormalization : str, optional
        Kernel that orthonormalizes; by default the one that goes with the algorithm.

    Returns
    -------
    Backend

    Raises
    ------
    InputError
        If the sources are not those of an attitude step.
    CompilerError
        If a C compiler is needed and there is none, or it fails.

    Examples
    --------
    >>> from strapgen import derive, generate, lower
    >>> build(generate(lower(derive("euler")), "numpy")).name
    'numpy'
    """
    checks.require("build", sources, Sources)
    return Backend(StepSources(sources, None, orthonormalization))
