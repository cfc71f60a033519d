"""Prints a program that calls a fixed-point function many times and reports a checksum of all that it returns.

The program draws its input itself, in integers, so that every processor and a model in Python draw the same.
"""

from __future__ import annotations

from dataclasses import dataclass

from strapgen.ir.signals import Signal
from strapgen.ir.sources import Sources
from strapgen.targets.c_numbers import numbers_of, types_of
from strapgen.targets.printer import fill_arguments
from strapgen.targets.rendering import render

#: Accepted calls in each part of a run, and the most that are tried.
NEEDED, MOST = 1000, 8000
#: The number from which the generator starts.
SEED = 2463534242
#: Sizes of the noise around the motion, each half of the one before; the largest is a quarter of a range.
NOISE = 24
#: What an output holds before a call.
UNTOUCHED = 21845


@dataclass(frozen=True)
class CallRun:
    """A run of a function on a processor."""

    #: The function in C, in words of at most 32 bits
    sources: Sources
    #: A motion: the elements of all inputs, call by call
    rows: tuple[tuple[int, ...], ...]

    @property
    def limits(self) -> list[tuple[int, int]]:
        """The range of every element of the inputs."""
        assert self.sources.fixed is not None
        return [(a.low, a.high) for a in self.sources.fixed.inputs for _ in range(a.signal.size)]

    @property
    def places(self) -> dict[str, int]:
        """The place of each input's first element among those of all."""
        places, place = {}, 0
        for signal in self.sources.function.inputs:
            places[signal.name] = place
            place += signal.size
        return places

    @property
    def pairs(self) -> list[tuple[Signal, Signal]]:
        """The inputs that an output of the call before becomes, with that output."""
        function = self.sources.function
        if self.sources.attitude_step is not None:
            return [(function.inputs[0], function.outputs[0])]
        if self.sources.recursion is None:
            return []
        signals = {signal.name: signal for signal in (*function.inputs, *function.outputs)}
        return [(signals[before], signals[after]) for before, after in self.sources.recursion.states]


def run_files(run: CallRun) -> dict[str, str]:
    """Print the program of a run."""
    sources, numbers = run.sources, numbers_of(run.sources)
    assert sources.fixed is not None
    name, function = sources.function.name, sources.function
    feedback = sources.fixed.residuals
    call = [f"in_{signal.name}" for signal in function.inputs]
    call += ["feedback"] if feedback else []
    call += [f"out_{signal.name}" for signal in function.outputs]
    values = {
        "name": name,
        "types": types_of(sources),
        "numbers": numbers,
        "inputs": function.inputs,
        "outputs": function.outputs,
        "pairs": run.pairs,
        "feedback": feedback,
        "places": run.places,
        "elements": len(run.limits),
        "call": ", ".join(call),
        "low": [numbers.literal(low) for low, _ in run.limits],
        "span": [f"{high - low}u" for low, high in run.limits],
        "rows": [
            fill_arguments(f"{{{', '.join(map(numbers.literal, row))}}},", "     ", 95) for row in run.rows
        ],
        "needed": NEEDED,
        "most": MOST,
        "seed": SEED,
        "noise": NOISE,
    }
    return {
        f"run_{name}.c": render("runner_c/run.c.j2", **values),
        "runner.h": render("runner_c/runner.h.j2"),
    }


@dataclass(frozen=True)
class LongRun:
    """Many steps of an attitude on a processor."""

    #: A step from increments, in words of at most 32 bits
    sources: Sources
    #: A motion: the increments of every step of a pass, in units of the last place
    rows: tuple[tuple[int, ...], ...]
    #: How many times the motion is taken, one pass after the other
    passes: int
    #: Largest change of an increment, drawn anew in every step
    noise: int

    @property
    def identity(self) -> list[int]:
        """Zero rotation as the integers of the state."""
        assert self.sources.fixed is not None
        assert self.sources.attitude_step is not None
        state = self.sources.fixed.inputs[0].format
        return [state.nearest(element) for element in self.sources.attitude_step.identity]


def long_run_files(run: LongRun) -> dict[str, str]:
    """Print a program that takes many steps of an attitude and reports the state again and again."""
    sources = run.sources
    assert sources.fixed is not None
    numbers, name = numbers_of(sources), sources.function.name
    state, samples = sources.fixed.inputs
    values = {
        "name": name,
        "types": types_of(sources),
        "numbers": numbers,
        "state": state.signal,
        "samples": samples.signal,
        "feedback": sources.fixed.residuals,
        "fresh": [f"{word.fresh}u" for word in sources.fixed.residuals],
        "identity": [numbers.literal(word) for word in run.identity],
        "rows": [
            fill_arguments(f"{{{', '.join(map(numbers.literal, row))}}},", "     ", 95) for row in run.rows
        ],
        "run": run,
        "seed": SEED,
    }
    return {
        f"long_run_{name}.c": render("runner_c/long_run.c.j2", **values),
        "runner.h": render("runner_c/runner.h.j2"),
    }
