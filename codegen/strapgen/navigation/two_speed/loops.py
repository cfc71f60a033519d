"""Runs the loops of an algorithm in two speeds from Python, one call for each cycle."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from strapgen.catalogue import Choice
from strapgen.ir.fixed_interface import Argument
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Sources
from strapgen.navigation.systems.system import DescribedSystem
from strapgen.navigation.two_speed import two_speed_sources
from strapgen.navigation.two_speed.two_speed_c import LOOPS, wiring
from strapgen.run.evaluators import Array, Evaluator
from strapgen.run.fixed_numbers import integers, numbers
from strapgen.run.increments import pulses
from strapgen.run.kernel_sources import sources_of_choice
from strapgen.targets import BUILT_IN

#: From this word length on, a word resolves what a double does, and the gyro need not count pulses.
_EXACT_BITS = 53


@dataclass(frozen=True)
class LoopSources:
    """Sources of an algorithm in two speeds, as plain data.

    Parameters
    ----------
    loops : tuple of Sources
        The fast, the slow and the navigation loop.
    system : DescribedSystem
        How they are wired, and what is reset.
    whole : Sources or None
        C of all loops in one function; None where the loops are called from Python.
    """

    loops: tuple[Sources, ...]
    system: DescribedSystem
    whole: Sources | None = None


@dataclass(frozen=True)
class Cycles:
    """What a run of the loops takes, in the numbers that they compute with.

    Parameters
    ----------
    samples : mapping of str to array, (count, elements)
        Samples of every cycle by the names of the loops' inputs.
    start : mapping of str to array, (1, elements)
        Values at the start that are not zero.
    fast, slow : int
        Fast cycles in a slow cycle, and slow cycles in a navigation cycle.
    """

    samples: Mapping[str, Array]
    start: Mapping[str, Array]
    fast: int
    slow: int


class Loops(ABC):
    """Runs the loops of an algorithm in two speeds on one kind of code.

    Parameters
    ----------
    sources : LoopSources
    evaluator : callable
        Class that runs a single kernel of the same target.

    Attributes
    ----------
    dtype : dtype
        Type of the samples in floating point.
    """

    dtype: Any = np.dtype(np.float64)

    def __init__(self, sources: LoopSources, evaluator: Callable[[Sources], Evaluator]) -> None:
        self.sources = sources
        self.evaluator = evaluator
        self.wires = wiring(sources.system, sources.loops)
        self._arguments: dict[str, tuple[Argument, str]] = {}
        for loop in sources.loops:
            if loop.fixed is not None:
                for argument in (*loop.fixed.inputs, *loop.fixed.outputs):
                    self._arguments.setdefault(argument.signal.name, (argument, loop.kernel))

    @classmethod
    def generated(cls, algorithm: str, sculling: int, target: str, settings: Settings | None) -> LoopSources:
        """Return the sources that the class runs; parameters are those of `systems.two_speed_sources.loops`."""
        system = two_speed_sources.description(algorithm, sculling).system
        if target in BUILT_IN and BUILT_IN[target].fixed:
            return LoopSources(two_speed_sources.loops(algorithm, sculling, target, settings), system)
        names = two_speed_sources.kernels(algorithm, sculling)
        return LoopSources(tuple(sources_of_choice(Choice(name), target) for name in names), system)

    def converted(self, name: str, values: Array, *, summed: bool = False) -> Array:
        """Return samples as the loops take them.

        Parameters
        ----------
        name : str
            Name of the input.
        values : array, (count, elements)
            Samples in SI units.
        summed : bool, optional
            Whether the loops sum the samples. In fixed point each then takes over the rounding error of the one before,
            as from a gyro that counts pulses, and a sum is off by at most one unit.
        """
        if name not in self._arguments:
            with np.errstate(over="ignore"):  # a number that overflows is refused after the run
                return np.ascontiguousarray(values, self.dtype)
        argument, kernel = self._arguments[name]
        if summed and argument.format.word < _EXACT_BITS:
            values = pulses(values[:, None], argument.unit)[:, 0]
        return integers(argument, values, kernel)

    def in_si(self, name: str, values: Array) -> Array:
        """Return what a loop returned, by the name of the argument, as numbers in SI units."""
        return numbers(self._arguments[name][0], values) if name in self._arguments else values

    @abstractmethod
    def run(self, cycles: Cycles) -> tuple[Array, Array]:
        """Run whole navigation cycles.

        Parameters
        ----------
        cycles : Cycles

        Returns
        -------
        attitudes : array, (slow cycles, elements)
            Attitude after every slow cycle.
        changes : array, (navigation cycles, 3)
            Change of velocity over every navigation cycle.

        Raises
        ------
        InputError
            If a loop refuses its input; the message names the loop.
        """


class LoopsFromPython(Loops):
    """Calls one function for each cycle of each loop."""

    def __init__(self, sources: LoopSources, evaluator: Callable[[Sources], Evaluator]) -> None:
        super().__init__(sources, evaluator)
        self.evaluators = tuple(map(evaluator, sources.loops))
        self.dtype = self.evaluators[0].dtype

    def run(self, cycles: Cycles) -> tuple[Array, Array]:
        """Run whole navigation cycles, see `Loops.run`."""
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
