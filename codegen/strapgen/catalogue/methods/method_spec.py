"""`MethodSpec` is what chooses an integration method: its name in the catalogue, or a value with its coefficients."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

#: Largest number of angle increments in a step, and of increments beside them, from before the step and from after it.
MOST_INCREMENTS = 8
MOST_BESIDE = 32


class Asked(NamedTuple):
    """The samples of a step that are asked for; None where the method, or a default, says how many they are."""

    increments: int | None = None
    rates: bool = False
    previous: int | None = None
    ahead: int | None = None

    @property
    def beside(self) -> tuple[int, int]:
        """The increments from before a step and from after it, checked."""
        before = checks.count("previous", self.previous or 0, smallest=0, largest=MOST_BESIDE)
        after = checks.count("ahead", self.ahead or 0, smallest=0, largest=MOST_BESIDE)
        if before + after > MOST_BESIDE:
            raise InputError(
                f"previous {before} and ahead {after} are {before + after} together; at most {MOST_BESIDE} are allowed"
            )
        return before, after


#: The samples that a step takes: increments, None for rates at nodes, and those from before it and from after it.
StepSamples: TypeAlias = tuple[int | None, int, int]


@runtime_checkable
class MethodSpec(Protocol):
    """A method by its name, tableau, window or coning coefficients; a value of a user's may be another class."""

    @property
    def name(self) -> str:
        """Name in that of the kernel."""

    @property
    def title(self) -> str:
        """One line for a reader."""

    @property
    def file(self) -> str:
        """Path of the file that holds it; "" without one."""

    @property
    def kind(self) -> str:
        """Word for it in messages."""

    @property
    def recipe(self) -> tuple[str, str, tuple[Any, ...]]:
        """Module, function and arguments that make a `Method` of it."""

    @property
    def own_samples(self) -> int | None:
        """Increments in a step of a method that says so itself."""

    def select(self, asked: Asked) -> tuple[MethodSpec, StepSamples]:
        """Return the method for the samples that are asked for, and the samples; refuse what does not go with it."""
        ...


def through_samples(
    name: str, asked: Asked, *, takes_rates: bool = True, takes_ahead: bool = True
) -> StepSamples:
    """Return the samples of a step whose rate is the polynomial through any number of them."""
    increments, rates = asked.increments, asked.rates
    previous, ahead = asked.beside
    if rates:
        if increments is not None or previous or ahead:
            more = f"{previous} previous ones" if previous else f"{ahead} ahead"
            what = f"{increments} increments" if increments is not None else more
            raise InputError(f"a step takes increments or rates, not both (got {what} and rates)")
        if not takes_rates:
            raise InputError(f"method {name} takes increments; rates at nodes do not go with it")
        return None, 0, 0
    increments = checks.count("increments", 2 if increments is None else increments, largest=MOST_INCREMENTS)
    if ahead and not takes_ahead:
        raise InputError(f"method {name} takes no increments ahead; --previous goes with it")
    return increments, previous, ahead
