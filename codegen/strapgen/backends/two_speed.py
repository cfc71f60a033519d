"""Algorithms in two speeds, run from gyro and accelerometer increments on every back end.

A fast loop sums coning and sculling, a slow loop turns the attitude and transforms the velocity, a third one follows
the navigation frame. The C back ends run all loops in one generated function; the others run them from Python.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from strapgen import backends
from strapgen.backends import BACKENDS, Evaluator
from strapgen.backends.fixed import FixedEvaluator, integers, numbers
from strapgen.backends.increments import pulses
from strapgen.ir.fixed_interface import Argument
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Sources
from strapgen.library.two_speed_sources import loops, sources
from strapgen.support import checks
from strapgen.support.exceptions import InputError
from strapgen.targets.two_speed_c.emit import LOOPS, recursion, wiring
from strapgen.toolchain import compiler

Array = NDArray[Any]

#: Words from which on a double is as exact as its fixed-point number: nothing is left to carry on.
_EXACT_BITS = 53


class TwoSpeedRun(NamedTuple):
    """What a run gives.

    Parameters
    ----------
    attitudes : array, (slow cycles, state shape)
        Attitude after every slow cycle, and after the navigation cycle that ends with it.
    velocity_changes : array, (navigation cycles, 3)
        Integral of the specific force over every navigation cycle in m/s, navigation axes as they turn. What gravity
        and Coriolis forces add is for the navigation to say.
    """

    attitudes: Array
    velocity_changes: Array


class _Door:
    """Turns numbers into what loops compute with, and back."""

    def __init__(self, loops: Sequence[Sources]) -> None:
        self.arguments: dict[str, tuple[Argument, str]] = {}
        for loop in loops:
            if loop.fixed is not None:
                for argument in (*loop.fixed.inputs, *loop.fixed.outputs):
                    self.arguments.setdefault(argument.signal.name, (argument, loop.kernel))
        self.dtype = np.dtype(np.float32 if loops[0].target == "c-float" else np.float64)

    def taken(self, name: str, values: Array, *, summed: bool = False) -> Array:
        """Return samples, (count, elements), as the loop takes them; sums of them lose no more than one rounding."""
        if name not in self.arguments:
            with np.errstate(over="ignore"):  # what does not stay finite is refused after the run
                return np.ascontiguousarray(values, self.dtype)
        argument, kernel = self.arguments[name]
        if summed and argument.format.word < _EXACT_BITS:
            values = pulses(values[:, None], argument.format.unit)[:, 0]
        return integers(argument, values, kernel)

    def given(self, name: str, values: Array) -> Array:
        """Return outputs of a loop as numbers."""
        return numbers(self.arguments[name][0], values) if name in self.arguments else values


class TwoSpeed:
    """An algorithm in two speeds, ready to run.

    Parameters
    ----------
    algorithm : str
        "dcm" or "euler".
    sculling : int, optional
        Which sculling integral the fast loop makes: 1 holds the rotation compensation, 2 leaves it to the slow loop.
    backend : str, optional
        A key of `strapgen.backends.BACKENDS`.
    settings : Settings, optional
        What fixed point is made for.

    Attributes
    ----------
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
    Level flight on a turning table, 0.01 rad a slow cycle of two fast ones:

    >>> turning = TwoSpeed("euler")
    >>> run = turning.run(np.tile([0.0, 0.0, 0.005], (4, 1)), np.zeros((4, 3)), fast_cycles=2)
    >>> run.attitudes[-1].round(5)
    array([0.     , 0.     , 0.01   , 0.99995])
    """

    def __init__(
        self,
        algorithm: str,
        sculling: int = 2,
        backend: str = "numpy",
        settings: Settings | None = None,
    ) -> None:
        entry = BACKENDS[checks.choice("backend", backend, BACKENDS)]
        self.name = backend
        fitted = backends.fitted(backend, settings)
        self.loops = loops(algorithm, sculling, entry.target, fitted)
        self._whole = (
            compiler.load(sources(algorithm, sculling, entry.target, fitted))
            if entry.target.startswith("c")
            else None
        )
        self._wires = wiring(self.loops)
        self._door = _Door(self.loops)
        self._function = f"{algorithm}-two-speed-{sculling}".replace("-", "_") + _suffix(self.loops[0])
        self.state = self.loops[1].function.inputs[0]
        self.identity: Array = np.eye(3) if algorithm == "dcm" else np.array([0.0, 0, 0, 1])

    @cached_property
    def evaluators(self) -> tuple[Evaluator, ...]:
        """The generated function of each loop by itself."""
        return tuple(backends.of_sources(loop) for loop in self.loops)

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
            Fast cycles in a slow cycle.
        slow_cycles : int, optional
            Slow cycles in a navigation cycle.
        turns : array_like, (1 + N / fast_cycles, 3), optional
            Rate of the navigation frame at the ends of the slow cycles, times their length, in rad; zero by default.
        initial : array_like, (state shape), optional
            Attitude at the start; by default none.
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
        angles = checks.real_array("increments", increments, (3,), np.float64)
        velocities = checks.real_array("velocity_increments", velocity_increments, (3,), np.float64)
        if angles.ndim != 2 or len(angles) % (fast_cycles * slow_cycles):
            raise InputError(
                f"increments has shape {angles.shape}; (N, 3) with N a multiple of {fast_cycles * slow_cycles}, "
                "whole navigation cycles, is needed"
            )
        if velocities.shape != angles.shape:
            raise InputError(
                f"velocity_increments has shape {velocities.shape}; that of increments, {angles.shape}, is needed"
            )
        slow_total = len(angles) // fast_cycles
        frame = np.zeros((slow_total + 1, 3)) if turns is None else turns
        frame = checks.real_array("turns", frame, (3,), np.float64)
        if frame.shape != (slow_total + 1, 3):
            raise InputError(f"turns has shape {frame.shape}; {(slow_total + 1, 3)} is needed")
        start = self.identity if initial is None else initial
        start = checks.real_array("initial", start, self.state.shape, np.float64)
        before = np.zeros(3) if previous is None else previous
        before = checks.real_array("previous", before, (3,), np.float64)
        door = self._door
        samples = {
            "increment": door.taken("increment", angles, summed=True),
            "velocity_increment": door.taken("velocity_increment", velocities, summed=True),
            "turn": door.taken("turn", frame[1:]),
        }
        begun = {
            "state": door.taken("state", start.reshape(1, -1)),
            "previous_turn": door.taken("previous_turn", frame[:1]),
            "previous_increment": door.taken("previous_increment", before.reshape(1, -1)),
        }
        with np.errstate(all="ignore"):  # numbers that overflow are refused, in one line
            if self._whole is None:
                attitudes, changes = self.run_loops(samples, begun, fast_cycles, slow_cycles)
            else:
                attitudes, changes = self._run_in_c(self._whole, samples, begun, fast_cycles, slow_cycles)
        run = TwoSpeedRun(
            door.given("state", attitudes).reshape(-1, *self.state.shape),
            door.given("velocity_change", changes),
        )
        for what, values in zip(("attitude", "velocity"), run, strict=True):
            if not np.isfinite(values).all():
                raise InputError(f"the {what} does not stay finite: increments or turns are too large")
        return run

    def run_loops(
        self, samples: Mapping[str, Array], begun: Mapping[str, Array], fast_cycles: int, slow_cycles: int
    ) -> tuple[Array, Array]:
        """Run the loops one by one, from Python.

        Parameters
        ----------
        samples : dict of str to array, (count, elements)
            Samples as the loops take them, in fixed point integers.
        begun : dict of str to array, (1, elements)
            What is handed on and does not begin from zero.
        fast_cycles, slow_cycles : int
            As for `run`.

        Returns
        -------
        attitudes : array, (slow cycles, elements)
        changes : array, (navigation cycles, 3)
        """
        zero = {s.name: np.zeros((1, s.size), samples["increment"].dtype) for s in self._wires.memory}
        memory = zero | dict(begun)
        kept = [
            evaluator.fresh(1) if isinstance(evaluator, FixedEvaluator) else np.empty((1, 0))
            for evaluator in self.evaluators
        ]

        handed_on = [recursion(loop).inputs for loop in self.loops]

        def call(number: int, place: int) -> dict[str, Array]:
            evaluator, inputs = self.evaluators[number], handed_on[number]
            given = [
                memory[s.name] if s.name in memory else samples[s.name][place : place + 1]
                for s in evaluator.function.inputs
            ]
            outputs, kept[number] = _called(evaluator, given, kept[number])
            named = dict(zip((s.name for s in evaluator.function.outputs), outputs, strict=True))
            memory.update({inputs[name]: value for name, value in named.items() if name in inputs})
            return {name: value for name, value in named.items() if name not in inputs}

        fast, slow, navigation = range(len(LOOPS))
        slow_total = len(samples["turn"])
        attitudes, changes = [], []
        at_once = None if self.loops[fast].fixed else self._fast_loops(samples, begun, fast_cycles)
        for cycle in range(slow_total):
            if at_once is not None:
                memory.update({name: values[cycle : cycle + 1] for name, values in at_once.items()})
            else:
                memory.update({name: zero[name] for name in recursion(self.loops[fast]).begun_anew})
                for k in range(fast_cycles):
                    call(fast, cycle * fast_cycles + k)
            call(slow, cycle)
            if (cycle + 1) % slow_cycles == 0:
                changes.append(call(navigation, 0)["velocity_change"])
                memory.update({name: zero[name] for name in recursion(self.loops[slow]).begun_anew})
            attitudes.append(memory["state"])
        empty = np.empty((0, self.state.size)), np.empty((0, 3))
        if not attitudes:
            return empty
        return np.concatenate(attitudes), np.concatenate(changes) if changes else empty[1]

    def _fast_loops(
        self, samples: Mapping[str, Array], begun: Mapping[str, Array], fast_cycles: int
    ) -> dict[str, Array]:
        """Return what the fast loop hands to each slow cycle: the cycles side by side, since all of it begins anew."""
        evaluator, loop = self.evaluators[0], recursion(self.loops[0])
        last = samples["increment"][fast_cycles - 1 :: fast_cycles]
        memory = {
            signal.name: np.zeros((len(last), signal.size), self._door.dtype)
            for signal in evaluator.function.inputs
            if signal.name in loop.begun_anew
        }
        memory["previous_increment"] = np.concatenate([begun["previous_increment"], last[:-1]])
        for k in range(fast_cycles):
            given = [
                memory[s.name] if s.name in memory else samples[s.name][k::fast_cycles]
                for s in evaluator.function.inputs
            ]
            results = evaluator.evaluate(given, (len(last),))
            named = zip((s.name for s in evaluator.function.outputs), results, strict=True)
            memory = {loop.inputs[name]: np.asarray(value) for name, value in named}
        return memory

    def _run_in_c(
        self,
        module: Any,
        samples: Mapping[str, Array],
        begun: Mapping[str, Array],
        fast_cycles: int,
        slow_cycles: int,
    ) -> tuple[Array, Array]:
        ffi, lib = module.ffi, module.lib
        fixed = self.loops[0].fixed
        kind = self._door.dtype if fixed is None else np.dtype(f"int{fixed.settings.word}")
        type_ = {"float64": "double", "float32": "float"}.get(kind.name, f"{kind.name}_t")

        def pointer(array: Array) -> Any:
            return ffi.from_buffer(f"{type_}[]", array)

        memory = ffi.new(f"{self._function}_memory *")
        values = {name: np.ascontiguousarray(array, kind) for name, array in {**samples, **begun}.items()}
        getattr(lib, f"{self._function}_begin")(memory, pointer(values["state"]))
        for name in ("previous_turn", "previous_increment"):
            getattr(memory, name)[0:3] = values[name][0].tolist()
        slow_total = len(values["turn"])
        cycles = slow_total // slow_cycles
        attitudes, changes = np.empty((slow_total, self.state.size), kind), np.empty((cycles, 3), kind)
        if cycles:
            arrays = [values[s.name] for group in self._wires.samples for s in group]
            status = getattr(lib, f"{self._function}_run")(
                cycles,
                slow_cycles,
                fast_cycles,
                memory,
                *map(pointer, arrays),
                pointer(attitudes),
                pointer(changes),
            )
            if status:
                self.run_loops(samples, begun, fast_cycles, slow_cycles)  # says which loop refuses what
                raise AssertionError("the loops by themselves refuse what the whole refuses")
        return attitudes, changes


def _suffix(loop: Sources) -> str:
    if loop.fixed is not None:
        return f"_q{loop.fixed.settings.word - 1}"
    return "_float" if loop.target == "c-float" else ""


def _called(evaluator: Evaluator, given: Sequence[Array], kept: Array) -> tuple[Sequence[Array], Array]:
    """Call a loop on one sample of everything, each (1, elements)."""
    if isinstance(evaluator, FixedEvaluator):
        return evaluator.run(given, kept)
    shaped = [
        array.reshape(1, *signal.shape)
        for array, signal in zip(given, evaluator.function.inputs, strict=True)
    ]
    results = evaluator.evaluate(shaped, (1,))  # all samples have been checked
    return [np.asarray(result).reshape(1, -1) for result in results], kept
