"""The run that all parts of a dossier share: a motion, a sampling rate and a duration."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from strapgen.catalogue import Choice
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motions import GENERAL, Motion
from strapgen.lab.motions.users_motions import any_motion

#: Most records of a history: a plot shows no more, and a page stays small.
MOST_RECORDS = 250


@dataclass(frozen=True)
class Conditions:
    """A motion, the sampling rate of the gyro, and the duration of the runs."""

    #: Name of a motion, or the file of a user's
    motion: str = "coning"
    #: Its parameters, as the command line states them
    settings: Mapping[str, str] = field(default_factory=lambda: dict(GENERAL))
    #: Samples a second in Hz, and the length of the runs in s; an algorithm runs as many whole steps as that
    #: holds
    sample_hz: str = "100"
    duration: str = "20"

    def profile(self) -> Motion:
        """Return the motion, checked with its numbers."""
        checks.number("sample_hz", self.sample_hz, positive=True)
        checks.number("duration", self.duration, positive=True)
        return any_motion(self.motion, self.duration, self.settings)

    def words(self) -> str:
        """Return the run in words."""
        parameters = "".join(f", {key}={value}" for key, value in self.settings.items())
        return f"{self.motion}{parameters}; {self.duration} s at {self.sample_hz} Hz"

    @property
    def options(self) -> str:
        """The options of the command line that state the motion."""
        parameters = [f"{key}={value}" for key, value in self.settings.items()]
        return shlex.join(["--motion", self.motion, *(["--set", *parameters] if parameters else [])])

    def schedule(self, choice: Choice) -> Schedule:
        """Return the step of an algorithm, and how many of them it runs.

        >>> from strapgen.catalogue import choose
        >>> Conditions(duration="10").schedule(choose("euler", "rk4", 2)).options
        '--step 1/50 --duration 10'
        """
        hertz = checks.number("sample_hz", self.sample_hz, positive=True)
        duration = checks.number("duration", self.duration, positive=True)
        step = choice.increments_per_step / hertz
        every = -(-int(duration / step) // MOST_RECORDS)
        if not every:
            raise InputError(
                f"duration {float(duration):g} s is shorter than a step of {choice.kernel} at {float(hertz):g} Hz"
            )
        return Schedule(step, int(duration / step) // every * every, every)


@dataclass(frozen=True)
class Schedule:
    """The steps of a run."""

    #: In s
    step: Fraction
    #: How many there are, a multiple of `every`
    steps: int
    #: Steps from one record to the next
    every: int

    @property
    def duration(self) -> Fraction:
        """The length of the run in s."""
        return self.steps * self.step

    @property
    def record(self) -> Fraction:
        """The time from one record to the next in s."""
        return self.every * self.step

    @property
    def options(self) -> str:
        """The options of the command line that state step and duration."""
        return f"--step {self.step} --duration {self.duration}"
