"""Runs the loops of an algorithm in two speeds: from Python, one call for each cycle, or in one function of C."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from strapgen.catalogue import Choice
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.interfaces import Argument
from strapgen.ir.sources import Sources
from strapgen.navigation.systems.system import DescribedSystem
from strapgen.navigation.systems.system_runner import EXACT_BITS, carried
from strapgen.navigation.two_speed import two_speed_sources
from strapgen.navigation.two_speed.two_speed_c import LOOPS, wiring
from strapgen.run import compiler
from strapgen.run.compiled_code import array_type, real_type
from strapgen.run.evaluators import Array, Evaluator, in_si, stored
from strapgen.run.kernel_sources import sources_of_choice
from strapgen.targets import BUILT_IN


@dataclass(frozen=True)
class LoopSources:
    """Sources of an algorithm in two speeds, as plain data."""

    loops: tuple[Sources, ...]  # the fast, the slow and the navigation loop
    system: DescribedSystem  # how they are wired, and what is reset
    whole: Sources | None = None  # C of all loops in one function; None where they are called from Python


def loop_sources(algorithm: str, sculling: int, target: str, settings: Settings | None) -> LoopSources:
    """Return what runs on a target; parameters are those of `two_speed_sources.loops`."""
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
    """What a run of the loops takes, in the numbers that they compute with."""

    samples: Mapping[str, Array]  # of every cycle by the names of the loops' inputs, (count, elements)
    start: Mapping[str, Array]  # values at the start that are not zero, (1, elements)
    fast: int  # fast cycles in a slow cycle
    slow: int  # slow cycles in a navigation cycle


class Loops:
    """Calls one function for each cycle of each loop."""

    def __init__(self, sources: LoopSources, evaluator: Callable[[Sources], Evaluator]) -> None:
        self.sources = sources
        self.evaluator = evaluator
        self.wires = wiring(sources.system, sources.loops)
        self._arguments: dict[str, tuple[Argument, str]] = {}
        for loop in sources.loops:
            if loop.fixed is not None:
                for argument in (*loop.fixed.inputs, *loop.fixed.outputs):
                    self._arguments.setdefault(argument.signal.name, (argument, loop.kernel))
        self._load()

    def _load(self) -> None:
        """Load the code."""
        self.evaluators = tuple(map(self.evaluator, self.sources.loops))
        #: Type of the samples in floating point; an object is one of mpmath.
        self.number = self.evaluators[0].number

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
        """Return what a loop returned, by the name of the argument, as numbers in SI units."""
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
        """Return what the fast loop hands to each slow cycle.

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
        self.number = real_type(whole.target)
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
