"""A described filter as an object: its matrices, gains and code, and runs of the code on a back end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np

from strapgen import pipeline
from strapgen.ir import checks
from strapgen.ir.checks import unknown
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import Format
from strapgen.ir.notebook_display import Records, short_repr
from strapgen.ir.program import Program
from strapgen.ir.read_only import read_only
from strapgen.ir.sources import Sources
from strapgen.kernel.kernel import Kernel
from strapgen.navigation.kalman import FORMS, kalman_file, riccati
from strapgen.navigation.kalman.kalman_kernels import kernels, triangle
from strapgen.navigation.kalman.kalman_model import FilterModel
from strapgen.run.backend_names import BACKENDS, of_sources
from strapgen.run.evaluators import Array, Evaluator
from strapgen.run.kernel_sources import sources_of_program
from strapgen.storage.cache import stored
from strapgen.targets import TARGETS

Arrays = Mapping[str, Any]


def kalman(path: str | Path, form: str | None = None) -> KalmanFilter:
    """Read the file of a Kalman filter.

    Parameters
    ----------
    path : str or path
        TOML file with states, measurements, noise and schedule, see ``strapgen kalman``.
    form : str, optional
        "joseph" or "ud", in place of the form in the file.

    Raises
    ------
    InputError
        If something in the file is wrong, in one line with the path of the key.

    Examples
    --------
    >>> model = kalman("examples/kalman/gyrocompass.toml")
    >>> model.states, model.observability.rank
    (('tilt_north', 'tilt_east', 'azimuth'), 3)
    """
    text = kalman_file.read(path)
    try:
        return KalmanFilter(_in_form(text, form))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _in_form(text: kalman_file.FilterText, form: str | None) -> kalman_file.FilterText:
    """Return the text of a filter in another form, which its command then names."""
    if form is None:
        return text
    checks.choice("form", form, FORMS)
    if text.kind != "online":
        raise InputError(f"form is {form!r}; it goes with online gains, and not with {text.kind} ones")
    if form == text.form:
        return text
    return replace(text, form=form, command=f"{text.command} --form {form}")


class KalmanFilter(FilterModel):
    """A Kalman filter: matrices in exact numbers, gains, and generated code that runs.

    Parameters
    ----------
    text : FilterText
        What its file states, as `kalman` reads it.

    Attributes
    ----------
    states, measurements, inputs : tuple of str
        Names.
    F, G, H : Matrix
        Of the derivatives by the states and by the noise, and of the measurements by the states.
    transition, Q : Matrix
        Phi, and the covariance of the noise of a step.
    observability : Observability
        The rank of the observability matrix, and what no measurement shows.

    Examples
    --------
    >>> model = kalman("examples/kalman/gyrocompass.toml")
    >>> run = model.run({"force_east": np.full(5, 1e-3), "force_north": np.zeros(5)})
    >>> run.states.shape
    (6, 3)
    """

    __repr__ = short_repr

    def _in_words(self) -> str:
        gains = f"{self.text.kind} gains" if self.is_fixed_gain else f"online, {self.text.form}"
        return f"{self.text.name}: {len(self.states)} states, {len(self.measurements)} measurements, {gains}"

    def __post_init__(self) -> None:
        super().__post_init__()
        _ = self.solved

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return tuple(one.name for one in self.text.states)

    @property
    def measurements(self) -> tuple[str, ...]:
        """Names of the measurements."""
        return tuple(one.name for one in self.text.measurements)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return tuple(one.name for one in self.text.inputs)

    @property
    def is_fixed_gain(self) -> bool:
        """Whether the gains are computed before."""
        return self.text.kind != "online"

    @cached_property
    def solved(self) -> riccati.Gains | None:
        """The gains that are computed before, exactly as far as they are known; None where they are online."""
        if not self.is_fixed_gain:
            return None
        solve = riccati.steady if self.text.kind == "steady" else riccati.scheduled
        return stored("kalman-gains", [repr(self.text)], lambda: solve(self))

    @cached_property
    def gains(self) -> Mapping[str, Array] | None:
        """Gains in double by the measurement: (n,) if steady, (rows, n) if scheduled, None if online."""
        if self.solved is None:
            return None
        rows = {name: np.array(one, float) for name, one in self.solved.rows.items()}
        if self.text.kind == "steady":
            rows = {name: one[0] for name, one in rows.items()}
        return cast("Mapping[str, Array]", read_only(rows))

    def kernels(self, form: str | None = None) -> list[Kernel]:
        """Return the kernels, the time update first; `form` takes the place of that of the filter."""
        return kernels(self.with_form(form), self.solved.rows if self.solved else None)

    def with_form(self, form: str | None) -> KalmanFilter:
        """Return the filter with another form of its covariance."""
        text = _in_form(self.text, form)
        return self if text is self.text else KalmanFilter(text)

    @cached_property
    def programs(self) -> tuple[Program, ...]:
        """The programs of the kernels, from the cache."""
        return stored(
            "kalman-programs",
            [repr(self.text)],
            lambda: tuple(pipeline.lower(kernel) for kernel in self.kernels()),
        )

    def sources(self, target: str, settings: Settings | None = None) -> list[Sources]:
        """Return the sources of the kernels for a target; in fixed point the formats of a state are one.

        Raises
        ------
        InputError
            If the target is in fixed point, and the covariance is computed online or a range is missing.
        """
        if target not in TARGETS or not TARGETS[target].fixed:
            return [sources_of_program(program, target, settings) for program in self.programs]
        self._require_fixed(target)
        chosen = settings or Settings()
        formats: dict[str, Format] = {}
        for program in self.programs:
            fixed = sources_of_program(program, target, chosen).fixed
            assert fixed is not None
            for one in (*fixed.inputs, *fixed.outputs):
                name = one.signal.name.removeprefix("next_")
                if name in self.states and one.format.fraction <= formats.get(name, one.format).fraction:
                    formats[name] = one.format
        both = {place: str(one) for name, one in formats.items() for place in (name, f"next_{name}")}
        settings = replace(chosen, formats={**both, **chosen.formats})
        return [sources_of_program(program, target, settings) for program in self.programs]

    def _require_fixed(self, target: str) -> None:
        if not self.is_fixed_gain:
            raise InputError(
                f"{target} goes with steady or scheduled gains; a covariance that is computed online takes floating "
                "point"
            )
        text = self.text
        for kind, rows in (
            ("input", text.inputs),
            ("state", text.states),
            ("measurement", text.measurements),
        ):
            for one in rows:
                if one.range is None:
                    raise InputError(f"{kind}[{one.name}].range is missing; fixed point needs it")

    def on(self, backend: str = "numpy", form: str | None = None, word: int | None = None) -> FilterStepper:
        """Return the filter on a back end, to be called step by step.

        Parameters
        ----------
        backend : str, optional
            A back end that ``strapgen list backends`` shows.
        form : str, optional
            "joseph" or "ud", in place of that of the filter.
        word : int, optional
            Bits of a word in fixed point, where the back end does not state them.
        """
        checks.choice("backend", backend, BACKENDS)
        return FilterStepper(self.with_form(form), backend, word)

    def run(
        self,
        measurements: Arrays,
        inputs: Arrays | None = None,
        *,
        backend: str = "numpy",
        form: str | None = None,
        word: int | None = None,
        initial: Any = None,
    ) -> FilterRun:
        """Run the generated filter over measurements.

        Parameters
        ----------
        measurements : mapping of str to array_like, (..., N)
            Measured values of steps 1 to N, in the unit of the measurement; nan where there is none. Leading axes are
            independent runs. Those of steps that are no multiple of its ``every`` are ignored.
        inputs : mapping of str to array_like, (..., N), optional
            Values held over the interval that ends at the step.
        backend, form, word
            See `on`.
        initial : array_like, (..., n), optional
            Estimate before the first step; by default that of the file.

        Raises
        ------
        InputError
            If a name or a shape does not fit, or the code refuses a value.
        """
        stepper = self.on(backend, form, word)
        measured = _arrays("measurements", measurements, self.measurements)
        given = _arrays("inputs", inputs or {}, self.inputs)
        try:
            shape = np.broadcast_shapes(*(one.shape for one in (*measured.values(), *given.values())))
        except ValueError:
            raise InputError("the shapes of measurements and inputs do not broadcast together") from None
        if not shape:
            raise InputError("measurements have no steps; arrays of the steps are needed")
        runs, steps = shape[:-1], shape[-1]
        measured, given = (
            {k: np.broadcast_to(v, shape) for k, v in part.items()} for part in (measured, given)
        )
        state, covariance = stepper.start(runs, initial)
        n, online = len(self.states), not self.is_fixed_gain
        states = np.empty((*runs, steps + 1, n))
        covariances = np.empty((*runs, steps + 1, n, n)) if online else None
        innovations = {name: np.full(shape, np.nan) for name in self.measurements}
        variances = {name: np.full(shape, np.nan) for name in self.measurements} if online else None
        for k in range(steps + 1):
            if k:
                now = {name: value[..., k - 1] for name, value in given.items()}
                state, covariance = stepper.time_update(state, covariance, now)
                for one in self.text.measurements:
                    value = measured[one.name][..., k - 1] if one.name in measured else np.nan
                    if k % one.every or np.isnan(value).all():
                        continue
                    after = stepper.update(one.name, state, covariance, value, now, step=k)
                    state, covariance, innovations[one.name][..., k - 1] = after[:3]
                    if variances is not None:
                        variances[one.name][..., k - 1] = after[3]
            states[..., k, :] = state
            if covariances is not None:
                covariances[..., k, :, :] = stepper.matrix(covariance)
        return FilterRun(self.states, states, covariances, innovations, variances)


@dataclass(frozen=True)
class FilterRun(Records):
    """What a filter estimated: before the first step, and after each of N."""

    #: The n states
    names: tuple[str, ...]
    #: Estimates, (..., N + 1, n)
    states: Array
    #: Covariances, (..., N + 1, n, n); None where gains are computed before
    covariances: Array | None
    #: Measured less expected, (..., N) by the measurement; nan where there was none
    innovations: dict[str, Array]
    #: Variances of the innovations; None as for the covariances
    variances: dict[str, Array] | None

    __repr__ = short_repr

    def _in_words(self) -> str:
        return f"{self.states.shape[-2] - 1} steps of {', '.join(self.names)}"


class FilterStepper:
    """A filter on a back end, called step by step.

    >>> stepper = kalman("examples/kalman/gyrocompass.toml").on("numpy")
    >>> stepper.time_update(*stepper.start())[0]
    array([0., 0., 0.])
    """

    __repr__ = short_repr

    def _in_words(self) -> str:
        return f"{self.model.text.name} on {self._backend}"

    def __init__(self, model: KalmanFilter, backend: str, word: int | None = None) -> None:
        self.model, self._backend = model, backend
        entry = BACKENDS[backend]
        settings = Settings(word=entry.word or word or 32) if entry.fixed else None
        time, *updates = model.sources(entry.target, settings)
        self._time: Evaluator = of_sources(time)
        self._updates: dict[str, Evaluator] = {
            one: of_sources(sources) for one, sources in zip(model.measurements, updates, strict=True)
        }
        self._online = not model.is_fixed_gain

    @property
    def interfaces(self) -> list[Any]:
        """The interfaces of time update and updates in fixed point."""
        return [one.sources.fixed for one in (self._time, *self._updates.values())]

    def start(self, runs: Sequence[int] = (), initial: Any = None) -> tuple[Array, Array | None]:
        """Return the estimate and the covariance before the first step, for a shape of independent runs."""
        text = self.model.text
        first = [float(one.initial) for one in text.states] if initial is None else initial
        state = np.array(np.broadcast_to(np.asarray(first, np.float64), (*runs, len(text.states))))
        if not self._online:
            return state, None
        diagonal = np.diag([float(one.deviation**2) for one in text.states])
        packed = np.array([diagonal[place] for place in triangle(len(text.states))])
        return state, np.array(np.broadcast_to(packed, (*runs, packed.size)))

    def time_update(
        self, state: Array, covariance: Array | None, inputs: Arrays | None = None
    ) -> tuple[Array, Array | None]:
        """Return estimate and covariance after the interval, over which the inputs are held."""
        outputs = self._call(self._time, state, covariance, inputs or {}, {})
        return self._split(outputs)

    def update(
        self,
        measurement: str,
        state: Array,
        covariance: Array | None,
        measured: Any,
        inputs: Arrays | None = None,
        step: int | None = None,
    ) -> tuple[Array, Array | None, Array, Array | None]:
        """Return estimate, covariance, innovation and its variance after a measurement; nan changes nothing.

        `step`: number of the step, counted from 1, which a schedule needs.
        """
        if measurement not in self._updates:
            raise InputError(unknown("measurement", measurement, self._updates))
        value = np.asarray(measured, np.float64)
        there = ~np.isnan(value)
        values = {"measured": np.where(there, value, 0.0), **self._gains(measurement, step)}
        outputs = self._call(self._updates[measurement], state, covariance, inputs or {}, values)
        extra = 2 if self._online else 1
        innovation, *variance = (np.where(there, one, np.nan) for one in outputs[:extra])
        after, changed = self._split(outputs[extra:])
        after = np.where(there[..., None], after, state)
        if changed is not None and covariance is not None:
            changed = np.where(there[..., None], changed, covariance)
        return after, changed, innovation, variance[0] if variance else None

    def matrix(self, covariance: Array | None) -> Array:
        """Return the covariance, (..., n, n), from the form in which the code stores it."""
        if covariance is None:
            raise InputError("a filter with gains that are computed before has no covariance")
        n = len(self.model.states)
        upper = np.zeros((*covariance.shape[:-1], n, n))
        rows, columns = np.array(triangle(n)).T
        upper[..., rows, columns] = covariance
        diagonal = np.einsum("...ii->...i", upper).copy()
        if self.model.text.form == "joseph":
            return np.asarray(upper + np.swapaxes(upper, -1, -2) - diagonal[..., None] * np.eye(n))
        upper[..., range(n), range(n)] = 1.0
        return np.asarray((upper * diagonal[..., None, :]) @ np.swapaxes(upper, -1, -2))

    def _gains(self, measurement: str, step: int | None) -> dict[str, float]:
        """Return the gains of a step of the schedule."""
        if self.model.text.kind != "scheduled":
            return {}
        gains, every = (self.model.gains or {})[measurement], self._every[measurement]
        row = None if step is None or step % every else step // every - 1
        if row is None or not 0 <= row < len(gains):
            last = len(gains) * every
            raise InputError(
                f"step is {step}; the schedule has gains of {measurement} in multiples of {every} up to {last}"
            )
        return {f"gain_{name}": gain for name, gain in zip(self.model.states, gains[row], strict=True)}

    @cached_property
    def _every(self) -> dict[str, int]:
        return {one.name: one.every for one in self.model.text.measurements}

    def _call(
        self, evaluator: Evaluator, state: Array, covariance: Array | None, inputs: Arrays, values: Arrays
    ) -> list[Array]:
        for name in inputs:
            if name not in self.model.inputs:
                raise InputError(unknown("input", name, self.model.inputs))
        known: dict[str, Any] = {**inputs, **values}
        if self._online:
            known |= {"state": state, "covariance": covariance}
        else:
            known |= {name: state[..., k] for k, name in enumerate(self.model.states)}
        missing = [one.name for one in evaluator.function.inputs if one.name not in known]
        if missing:
            raise InputError(f"input {missing[0]} is missing; {evaluator.kernel} takes it")
        outputs = evaluator(*(known[one.name] for one in evaluator.function.inputs))
        return (
            [np.asarray(one, np.float64) for one in outputs]
            if isinstance(outputs, tuple)
            else [np.asarray(outputs)]
        )

    def _split(self, outputs: Sequence[Array]) -> tuple[Array, Array | None]:
        if self._online:
            return outputs[0], outputs[1]
        return np.stack(outputs, axis=-1), None


def _arrays(what: str, given: Arrays, names: Sequence[str]) -> dict[str, Array]:
    for name in given:
        if name not in names:
            raise InputError(unknown(f"name in {what}", name, names))
    return {name: np.asarray(value, np.float64) for name, value in given.items()}
