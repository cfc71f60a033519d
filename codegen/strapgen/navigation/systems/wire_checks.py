"""The rules of a wire: what must be equal at both ends, which rates meet, and what goes back."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from strapgen.ir.checks import counted
from strapgen.ir.exceptions import InputError
from strapgen.ir.signals import CYCLE, Signal
from strapgen.navigation.systems.ports import Ports


@dataclass(frozen=True)
class Source:
    """What a wire comes from: an input of the system, or a value of a stage."""

    #: As the file writes it
    name: str
    signal: Signal
    #: The stage; None for an input
    stage: Ports | None = None
    #: Whether it is a sum that is cleared when a slower stage has taken it
    sum: bool = False

    @property
    def every(self) -> int:
        """Cycles of the fastest rate from one value to the next."""
        return 1 if self.stage is None else self.stage.text.every


def check_order(stages: Sequence[Ports]) -> None:
    """Check that stages stand from the fastest to the slowest, and that each rate divides the next.

    The fastest runs in every cycle, unless it is an attitude step that collects the samples of several.
    """
    for before, stage in itertools.pairwise(stages):
        if stage.text.every < before.text.every:
            raise InputError(
                f"stage {stage.name} (every {stage.text.every}) stands after {before.name} "
                f"(every {before.text.every}); stages stand from the fastest to the slowest"
            )
        if stage.text.every % before.text.every:
            raise InputError(
                f"stage {stage.name}: every {stage.text.every} is no multiple of the {before.text.every} "
                f"of {before.name}; rates divide"
            )
    if stages[0].text.every != 1 and stages[0].program.attitude_step is None:
        raise InputError(
            f"stage {stages[0].name}: every is {stages[0].text.every}; the fastest stage has 1, unless it "
            "collects samples"
        )


def check_shape(where: str, needed: Signal, there: Signal) -> None:
    """Check that both ends of a wire have one shape."""
    if needed.shape != there.shape:
        raise InputError(f"{where}: shape {there.shape} meets shape {needed.shape}")


def check_direction(stage: Ports, name: str, source: Source) -> None:
    """Check that a wire to an earlier stage, or to the stage itself, is delayed, and no other is."""
    assert source.stage is not None
    back = source.stage.place >= stage.place
    if source.stage is stage and name not in stage.text.delay:
        raise InputError(
            f"stage {stage.name}: {name} = {source.name!r} comes from the stage itself; state its delay, "
            f"delay = {{ {name} = 1 }}"
        )
    if back and name not in stage.text.delay:
        raise InputError(
            f"stage {stage.name}: {name} = {source.name!r} goes back from a later stage to an earlier one; "
            f"state its delay, delay = {{ {name} = 1 }}"
        )
    if not back and name in stage.text.delay:
        raise InputError(
            f"stage {stage.name}: delay of {name}, which comes from the earlier stage {source.stage.name}; "
            "only wires that go back are delayed"
        )


def check_undelayed(stage: Ports, name: str, what: str) -> None:
    """Check that no delay is stated for an input that cannot have one."""
    if name in stage.text.delay:
        raise InputError(
            f"stage {stage.name}: delay of {name}, which is {what}; only wires that go back are delayed"
        )


def check_initial(stage: Ports, name: str, signal: Signal, initial: Sequence[Fraction]) -> None:
    """Check that the value of a cell before the first cycle lies inside its range."""
    largest = stage.text.ranges.get(name, signal.bound)
    if largest is None and signal.constraint:
        largest = Fraction(1)
    beyond = next((value for value in initial if largest is not None and abs(value) > largest), None)
    if largest is not None and beyond is not None:
        raise InputError(
            f"stage {stage.name}: initial {name} holds {float(beyond):g}, beyond its range of {float(largest):g}"
        )


def check_rates(where: str, stage: Ports, signal: Signal, source: Source, samples: int) -> None:
    """Check that what changes over a cycle passes between stages of one rate."""
    here, there = stage.text.every, source.every
    step = stage.program.attitude_step
    if samples and step is not None:
        due = there * (samples - step.beside)
        if here != due:
            raise InputError(
                f"{where}: a step takes {counted(samples - step.beside, 'sample')} of every {there}, so that its every "
                f"is {due}, not {here}"
            )
    elif source.sum:
        if here < there:
            raise InputError(
                f"{where}: a sum is taken by a stage that is not faster; every is {here}, below {there}"
            )
    elif signal.over == CYCLE and here != there:
        raise InputError(
            f"{where}: increments of every {there} meet a stage of every {here}; sum-3 sums them up, hold-3 "
            "shares them out"
        )


def check_range(stage: Ports, name: str, signal: Signal, source: Source) -> None:
    """Check that the range of an input is known before its stage is generated."""
    known = signal.bound is not None or signal.constraint or name in stage.text.ranges
    forward = source.stage is None or source.stage.place < stage.place
    if not known and not forward:
        raise InputError(f"stage {stage.name}: the range of {name} is missing; state it under ranges")
