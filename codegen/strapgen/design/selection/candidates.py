"""The algorithms from which one is selected: those of the catalogue, and coefficients designed for the vibration."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from strapgen import catalogue, registration
from strapgen.catalogue import METHODS, Choice
from strapgen.catalogue.methods.shaped_coning import ShapedConing
from strapgen.catalogue.methods.window import GyroResponse
from strapgen.design.brief import DesignBrief, read_brief
from strapgen.design.coning import coning
from strapgen.design.coning.coning import ConingBrief
from strapgen.design.coning.lines import of_spectrum
from strapgen.design.environment import SpectralEnvironment
from strapgen.ir import checks

#: The states that an algorithm can integrate.
STATES = ("euler", "dcm")
#: Samples of a step, from before it and from after it, of methods that are of use with several; every other method of
#: the catalogue has the samples that it needs.
_SAMPLES: dict[str, tuple[tuple[int, ...], ...]] = {
    "rk2": ((1,), (2,)),
    "rk4": ((1, 1), (2,), (4,), (1, 3)),
    "magnus4": ((1, 1), (2,), (3,), (1, 3)),
    "magnus6": ((3,), (4,), (3, 3)),
    "crouch-grossman3": ((2,), (3,)),
    "coning-uncompressed": ((3,), (4,)),
    "coning-compressed": ((1,), (1, 1), (1, 2), (1, 3), (2,), (3,), (4,), (5,), (6,), (8,)),
    "coning-combined": ((2, 1), (3,), (4,), (3, 3), (5, 3)),
    "coning-exact-rest": ((3,),),
    "coning-least-squares": ((4,), (3, 3), (1, 8)),
}
#: Highest order of a Taylor series that is tried: the next ones cost more, and truncation is below rounding by then.
_HIGHEST_TAYLOR = 8
#: Methods that are a reference, not an algorithm to fly.
_REFERENCES = ("fit-exact",)
#: The attitude in two speeds, and its fast cycles in a slow one.
TWO_SPEED = "two-speed"
_CYCLES = (2, 4, 8, 16)
#: Objectives and samples of coefficients that are designed for a spectrum: see `coning.design`.
_OBJECTIVES = ("worst", "random")
_DESIGNED = ((4, 0), (1, 3), (3, 3), (1, 8))
#: What the name of a method begins with whose coefficients are designed for the brief.
TUNED = "tuned-"


@dataclass(frozen=True)
class Contender:
    """An algorithm that may be selected, for every state of `STATES`."""

    #: A method of the catalogue; or "tuned-worst" or "tuned-random", whose coefficients a design for the
    #: vibration gives; or "two-speed"
    method: str
    #: Samples of a step, and samples from before it and from after it; of two speeds the fast cycles in a slow
    #: one
    increments: int
    previous: int = 0
    ahead: int = 0

    @property
    def name(self) -> str:
        """The method and its samples, as "coning-combined:3+3"."""
        beside = f"+{self.previous}" if self.previous or self.ahead else ""
        return f"{self.method}:{self.increments}{beside}" + (f"+{self.ahead}" if self.ahead else "")

    def choice(self, state: str, path: str) -> Choice:
        """Return the choice of a step."""
        method = self.method
        if method.startswith(TUNED):
            shape = tuned(path, method.removeprefix(TUNED), self.increments, self.previous)
            return catalogue.choose_step(state, shape, self.increments, previous=self.previous)
        return catalogue.choose_step(state, method, self.increments, previous=self.previous, ahead=self.ahead)


def contenders(brief: DesignBrief, names: Iterable[str] | None = None) -> list[Contender]:
    """Return the algorithms for a brief.

    Coefficients are designed where the vibration has a spectrum that turns about two axes.

    >>> from fractions import Fraction
    >>> from strapgen.design.brief import BudgetBrief, GyroBrief, ProcessorBrief
    >>> brief = DesignBrief(Fraction(70), None, GyroBrief(Fraction(100)), BudgetBrief(0.01), ProcessorBrief())
    >>> [one.name for one in contenders(brief) if one.method in ("rk4", "window-7-7")]
    ['rk4:1+1', 'rk4:2', 'rk4:4', 'rk4:1+3', 'window-7-7:1+7+7']
    """
    several = [
        Contender(method, *samples)
        for method in METHODS
        if method not in _REFERENCES and not _is_long_taylor(method)
        for samples in _SAMPLES.get(method) or [_own_samples(method)]
    ]
    if any(registration.extensions("design.two-speed")):
        several += [Contender(TWO_SPEED, cycles) for cycles in _CYCLES]
    if isinstance(brief.environment, SpectralEnvironment) and _has_coning(brief.environment):
        several += [
            Contender(f"{TUNED}{objective}", *samples) for objective in _OBJECTIVES for samples in _DESIGNED
        ]
    if names is None:
        return several
    chosen: dict[Contender, None] = {}
    for name in names:
        matching = [one for one in several if name in (one.method, one.name)]
        if not matching:
            checks.choice("method", name, list(dict.fromkeys(one.method for one in several)))
        chosen |= dict.fromkeys(matching)
    return list(chosen)


def _is_long_taylor(method: str) -> bool:
    return method.startswith("taylor") and int(method.removeprefix("taylor")) > _HIGHEST_TAYLOR


def _own_samples(method: str) -> tuple[int, int, int]:
    """Return the samples that a method needs."""
    choice = catalogue.choose_step(STATES[0], method, catalogue.enough(method))
    assert choice.increments is not None, "a step of increments is chosen"
    return choice.increments, choice.previous, choice.ahead


def _has_coning(environment: SpectralEnvironment) -> bool:
    return {"angle_x", "angle_y"} <= set(environment.spectrum.transfers)


@lru_cache(maxsize=16)
def tuned(path: str, objective: str, samples: int, previous: int) -> ShapedConing:
    """Return the coefficients that are designed for the spectrum of a brief and for its gyro."""
    brief = read_brief(Path(path))
    assert isinstance(brief.environment, SpectralEnvironment), "only these are tuned for"
    gyro = None
    if brief.gyro.bandwidth_hz is not None and brief.gyro.damping is not None:
        gyro = GyroResponse(brief.gyro.bandwidth_hz, brief.gyro.damping, brief.gyro.sample_hz)
    lines = of_spectrum(brief.environment.spectrum, brief.gyro.sample_hz)
    return coning.design(ConingBrief(samples, previous, objective, lines=lines, gyro=gyro))
