"""Algorithms in two speeds, run from gyro and accelerometer increments on every back end.

A fast loop sums coning and sculling, a slow loop updates the attitude and transforms the velocity, and a third one
follows the navigation frame.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from strapgen.catalogue import AnyAlgorithm, Choice, state_name
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.interfaces import Argument
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.read_only import read_only
from strapgen.ir.renamed import renamed_parameters
from strapgen.ir.signals import Signal
from strapgen.ir.sources import Sources
from strapgen.navigation.systems.system import DescribedSystem
from strapgen.navigation.systems.system_runner import EXACT_BITS, SystemMemory, SystemRun, carried
from strapgen.navigation.two_speed import two_speed_sources
from strapgen.navigation.two_speed.two_speed_sources import LOOPS, Wiring, wiring
from strapgen.run import compiler
from strapgen.run.backend_names import BACKENDS, evaluator_class
from strapgen.run.backends import fit_settings
from strapgen.run.compiled_code import array_type, real_type
from strapgen.run.evaluators import Array, Evaluator, in_si, stored
from strapgen.run.kernel_sources import sources_of_choice
from strapgen.targets import BUILT_IN


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
    algorithm : str, Choice or AttitudeAlgorithm
        "dcm" or "euler"; of an object its state counts alone, since the loops have a method of their own.
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
        algorithm: AnyAlgorithm,
        sculling: int = 2,
        backend: str = "numpy",
        settings: Settings | None = None,
    ) -> None:
        target = BACKENDS[checks.choice("backend", backend, BACKENDS)].target
        chosen = fit_settings(backend, settings)
        state = state_name("TwoSpeed", algorithm, two_speed_sources.ALGORITHMS)
        self._load(backend, loop_sources(state, sculling, target, chosen))

    @classmethod
    def of_sources(cls, name: str, sources: LoopSources) -> TwoSpeed:
        """Return loops and the C of the whole, if there is any, as an algorithm under a name."""
        runner = cls.__new__(cls)
        runner._load(name, sources)
        return runner

    def _load(self, name: str, sources: LoopSources) -> None:
        """Load the code of the loops."""
        self.name = name
        self.loops: tuple[Sources, ...] = sources.loops
        loops = Loops if sources.whole is None else LoopsInC
        self._runner = loops(sources, evaluator_class(self.loops[0].target))
        self.state: Signal = self.loops[1].function.inputs[0]
        self.identity: Array = read_only(np.eye(3) if self.state.size == 9 else np.array([0.0, 0, 0, 1]))

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

    @renamed_parameters(increments="samples")
    def run(
        self,
        samples: Any,
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
        samples : array_like, (N, 3)
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
        fast_cycles = checks.count("fast_cycles", fast_cycles, largest=checks.MOST)
        slow_cycles = checks.count("slow_cycles", slow_cycles, largest=checks.MOST)
        angles, velocities = _checked(samples, velocity_increments, fast_cycles * slow_cycles)
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
            read_only(self._runner.in_si("state", attitudes).reshape(-1, *self.state.shape)),
            read_only(self._runner.in_si("velocity_change", changes)),
        )
        for what, values in zip(("attitude", "velocity"), run, strict=True):
            if not np.isfinite(values).all():
                raise InputError(f"the {what} does not stay finite: increments or turns are too large")
        return run


def _checked(samples: Any, velocity_increments: Any, cycle: int) -> tuple[Array, Array]:
    """Check the samples, which fill whole navigation cycles of `cycle` fast cycles, and return them."""
    angles = checks.real_array("samples", samples, (3,), np.float64)
    velocities = checks.real_array("velocity_increments", velocity_increments, (3,), np.float64)
    if angles.ndim != 2 or len(angles) % cycle:
        raise InputError(
            f"samples has shape {angles.shape}; (N, 3) with N a multiple of {cycle}, "
            "whole navigation cycles, is needed"
        )
    if velocities.shape != angles.shape:
        raise InputError(
            f"velocity_increments has shape {velocities.shape}; that of samples, {angles.shape}, is needed"
        )
    return angles, velocities


@dataclass(frozen=True)
class LoopSources:
    """Sources of an algorithm in two speeds, as plain data."""

    loops: tuple[Sources, ...]  # the fast, the slow and the navigation loop
    system: DescribedSystem  # how they are wired, and what is reset
    whole: Sources | None = None  # C of all loops in one function; None where they are called from Python


def loop_sources(algorithm: str, sculling: int, target: str, settings: Settings | None) -> LoopSources:
    """Return the loops for a target; parameters are those of `two_speed_sources.loops`."""
    system = two_speed_sources.description(algorithm, sculling).system
    if target in BUILT_IN and BUILT_IN[target].fixed:
        loops = tuple(two_speed_sources.loops(algorithm, sculling, target, settings))
    else:
        names = two_speed_sources.kernels(algorithm, sculling)
        loops = tuple(sources_of_choice(Choice(name), target) for name in names)
    if target not in BUILT_IN or not BUILT_IN[target].compiled:
        return LoopSources(loops, system)
    return LoopSources(loops, system, two_speed_sources.sources(algorithm, sculling, target, settings))


@dataclass(frozen=True)
class Cycles:
    """Samples and start of a run of the loops, in the numbers of their code."""

    samples: Mapping[str, Array]  # of every cycle by the names of the loops' inputs, (count, elements)
    start: Mapping[str, Array]  # values at the start that are not zero, (1, elements)
    fast: int  # fast cycles in a slow cycle
    slow: int  # slow cycles in a navigation cycle


class Loops:
    """Calls one function for each cycle of each loop."""

    def __init__(self, sources: LoopSources, evaluator: Callable[[Sources], Evaluator]) -> None:
        self.sources = sources
        self.evaluator = evaluator
        self.wires: Wiring = wiring(sources.system, sources.loops)
        self._arguments: dict[str, tuple[Argument, str]] = {}
        for loop in sources.loops:
            if loop.fixed is not None:
                for argument in (*loop.fixed.inputs, *loop.fixed.outputs):
                    self._arguments.setdefault(argument.signal.name, (argument, loop.kernel))
        self._load()

    def _load(self) -> None:
        """Load the code."""
        self.evaluators: tuple[Evaluator, ...] = tuple(map(self.evaluator, self.sources.loops))
        #: Type of the samples in floating point; an object is one of mpmath.
        self.number: np.dtype[Any] = self.evaluators[0].number

    def stored(self, name: str, values: Array, *, summed: bool = False) -> Array:
        """Return samples of an input in SI units, (count, elements), as the loops take them.

        In fixed point a sample that the loops sum takes over the rounding error of the one before, as from a gyro that
        counts pulses, and a sum is off by at most one unit.
        """
        argument, kernel = self._arguments.get(name, (None, ""))
        if summed and argument is not None and argument.format.word < EXACT_BITS:
            values = carried(values, argument.unit)
        return stored(values, self.number, argument, kernel)

    def in_si(self, name: str, values: Array) -> Array:
        """Return an output of a loop, by the name of the argument, as numbers in SI units."""
        return in_si(values, self._arguments.get(name, (None, ""))[0])

    def run(self, cycles: Cycles) -> tuple[Array, Array]:
        """Run whole navigation cycles.

        Returns (slow cycles, elements): attitude after every slow cycle. Returns (navigation cycles, 3): change of
        velocity over every navigation cycle.
        """
        if not len(cycles.samples["turn"]):
            return np.empty((0, cycles.start["state"].shape[1])), np.empty((0, 3))
        fast, slow, navigation = range(len(LOOPS))
        loops = self.sources.loops
        zero = self._zero(cycles)
        memory = zero | dict(cycles.start)
        feedback = [evaluator.fresh(1) for evaluator in self.evaluators]

        def call(loop: int, place: int) -> dict[str, Array]:
            """Call a loop on the samples of one cycle; update the memory, and return the other outputs."""
            evaluator = self.evaluators[loop]
            rows = [
                memory[s.name] if s.name in memory else cycles.samples[s.name][place : place + 1]
                for s in evaluator.function.inputs
            ]
            outputs, feedback[loop] = evaluator.run(rows, feedback[loop])
            named = dict(zip((s.name for s in evaluator.function.outputs), outputs, strict=True))
            inputs = self.wires.updates[loop]
            memory.update({inputs[name]: value for name, value in named.items() if name in inputs})
            return {name: value for name, value in named.items() if name not in inputs}

        attitudes, changes = [], []
        sums = None if loops[fast].fixed else self._fast_cycles(cycles)
        for cycle in range(len(cycles.samples["turn"])):
            if sums is not None:
                memory.update({name: values[cycle : cycle + 1] for name, values in sums.items()})
            else:
                memory.update({name: zero[name] for name in self.wires.cleared[slow]})
                for k in range(cycles.fast):
                    call(fast, cycle * cycles.fast + k)
            call(slow, cycle)
            if (cycle + 1) % cycles.slow == 0:
                changes.append(call(navigation, 0)["velocity_change"])
                memory.update({name: zero[name] for name in self.wires.cleared[navigation]})
            attitudes.append(memory["state"])
        return np.concatenate(attitudes), np.concatenate(changes)

    def _zero(self, cycles: Cycles) -> dict[str, Array]:
        """Return zeros for every input that a call receives from the one before."""
        kind = cycles.start["state"].dtype
        return {signal.name: np.zeros((1, signal.size), kind) for signal in self.wires.memory}

    def _fast_cycles(self, cycles: Cycles) -> dict[str, Array]:
        """Return the outputs of the fast loop for each slow cycle.

        In floating point the sums begin at zero in every slow cycle, so that all slow cycles run side by side.
        """
        evaluator, updates, cleared = self.evaluators[0], self.wires.updates[0], self.wires.cleared[1]
        last = cycles.samples["increment"][cycles.fast - 1 :: cycles.fast]
        memory = {
            name: np.repeat(zero, len(last), axis=0)
            for name, zero in self._zero(cycles).items()
            if name in cleared
        }
        memory["previous_increment"] = np.concatenate([cycles.start["previous_increment"], last[:-1]])
        for k in range(cycles.fast):
            rows = [
                memory[s.name] if s.name in memory else cycles.samples[s.name][k :: cycles.fast]
                for s in evaluator.function.inputs
            ]
            outputs, _ = evaluator.run(rows, evaluator.fresh(len(last)))
            named = zip((s.name for s in evaluator.function.outputs), outputs, strict=True)
            memory = {updates[name]: value for name, value in named}
        return memory


class LoopsInC(Loops):
    """Runs all loops in one call of the generated function of the whole."""

    def _load(self) -> None:
        whole = self.sources.whole
        assert whole is not None, "loops without a whole are called from Python"
        self.number: np.dtype[Any] = real_type(whole.target)
        self._function = whole.function.name
        self._module = compiler.load(whole)

    def run(self, cycles: Cycles) -> tuple[Array, Array]:
        """Run whole navigation cycles in C, see `Loops.run`."""
        ffi, lib = self._module.ffi, self._module.lib
        memory = ffi.new(f"{self._function}_memory *")
        values = {
            name: np.ascontiguousarray(array, self._kind(name))
            for name, array in {**cycles.samples, **cycles.start}.items()
        }
        getattr(lib, f"{self._function}_begin")(memory, self._pointer(values["state"]))
        for name in ("previous_turn", "previous_increment"):
            getattr(memory, name)[0:3] = values[name][0].tolist()
        slow_cycles = len(values["turn"])
        navigation_cycles = slow_cycles // cycles.slow
        attitudes = np.empty((slow_cycles, values["state"].shape[1]), self._kind("state"))
        changes = np.empty((navigation_cycles, 3), self._kind("velocity_change"))
        if navigation_cycles:
            inputs = [values[signal.name] for group in self.wires.samples for signal in group]
            status = getattr(lib, f"{self._function}_run")(
                navigation_cycles,
                cycles.slow,
                cycles.fast,
                memory,
                *map(self._pointer, (*inputs, attitudes, changes)),
            )
            if status:
                # One by one, the loops raise the error that names the loop and its input.
                Loops(self.sources, self.evaluator).run(cycles)
                raise AssertionError("the loops by themselves refuse what the whole refuses")
        return attitudes, changes

    def _kind(self, name: str) -> np.dtype[Any]:
        """Return the type of an argument's elements."""
        held = self._arguments.get(name)
        return self.number if held is None else np.dtype(f"int{held[0].format.word}")

    def _pointer(self, array: Array) -> Any:
        """Return the C pointer to a contiguous array's first element."""
        return self._module.ffi.from_buffer(array_type(array.dtype), array)


class LoopFiles:
    """Three loops at the rates of a described system."""

    def __init__(self, loops: TwoSpeed, system: DescribedSystem) -> None:
        self.loops = loops
        self.system = system

    def run(self, inputs: Mapping[str, Any]) -> SystemRun:
        """Run whole navigation cycles, and return the outputs of the system."""
        fast, slow, navigation = self.system.stages
        wired = {w.input: w.source for stage in self.system.stages for w in stage.wires if w.external}
        angles, velocities, turns = (
            np.asarray(inputs[wired[name]], float) for name in ("increment", "velocity_increment", "turn")
        )
        if len(angles) % navigation.every:
            raise InputError(
                f"the run has {len(angles)} cycles; two speeds take whole navigation cycles, of {navigation.every}"
            )
        run = self.loops.run(
            angles,
            velocities,
            fast_cycles=slow.every // fast.every,
            slow_cycles=navigation.every // slow.every,
            turns=np.concatenate([np.zeros((1, 3)), turns[slow.every - 1 :: slow.every]]),
        )
        state, change = slow.results[0][1], dict(navigation.results)["velocity_change"]
        values = {state: run.attitudes, change: run.velocity_changes}
        return SystemRun({name: values[name] for name in self.system.outputs}, SystemMemory({}, {}))
