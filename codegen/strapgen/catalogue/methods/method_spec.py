"""Specifications of integration methods: a name in the catalogue, or a value with coefficients.

`INTEGRATORS` are the methods without files of coefficients, as plain data: listing them imports no computer algebra.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar, NamedTuple, Protocol, TypeAlias, runtime_checkable

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

#: Largest number of angle increments in a step, and of increments beside them, from before the step and from after it.
MOST_INCREMENTS = 8
MOST_BESIDE = 32


class RequestedSamples(NamedTuple):
    """The requested numbers of samples of a step; None stands for the number of the method or the default."""

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

    def select(self, asked: RequestedSamples) -> tuple[MethodSpec, StepSamples]:
        """Return the method and its samples for the requested ones; refuse numbers that it does not have."""
        ...


def through_samples(
    name: str, asked: RequestedSamples, *, takes_rates: bool = True, takes_ahead: bool = True
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


#: From so many samples on a Taylor series has to keep every power of time of the polynomial through them.
LEAST_WHOLE = 4


@dataclass(frozen=True)
class Integrator:
    """A method without coefficient files; its function returns it from the arguments, or from the order."""

    title: str
    module: str
    order: int
    takes_rates: bool = True
    arguments: tuple[str, ...] = ()
    takes_ahead: bool = True
    name: str = ""  # that of its table
    function: str = "method"  # of the module

    file: ClassVar[str] = ""
    kind: ClassVar[str] = "method"
    own_samples: ClassVar[int | None] = None
    tolerance: ClassVar[Fraction] = Fraction(0)

    @property
    def recipe(self) -> tuple[str, str, tuple[Any, ...]]:
        """Module, function and arguments that make a `Method` of it."""
        return self.module, self.function, self.arguments or (self.order,)

    @property
    def _is_taylor(self) -> bool:
        return (self.module, self.function) == _TAYLOR

    def keeps(self, samples: int) -> bool:
        """Return whether the method keeps all powers of time of the polynomial through so many samples."""
        return not self._is_taylor or samples < LEAST_WHOLE or self.order >= samples

    def select(self, asked: RequestedSamples) -> tuple[Integrator, StepSamples]:
        """Return the method and its samples for the requested ones.

        A Taylor series that ends before the rate's polynomial through many samples does is refused: the powers of time
        that it leaves out are of first order in the increments, and the step does not turn by their sum.
        """
        increments, previous, ahead = through_samples(
            self.name, asked, takes_rates=self.takes_rates, takes_ahead=self.takes_ahead
        )
        samples = (increments or 0) + previous + ahead
        if not self.keeps(samples):
            allowed = [name for name, one in INTEGRATORS.items() if one._is_taylor and one.keeps(samples)]
            series = (
                f"{allowed[0]} to {allowed[-1]} and fit-exact keep" if len(allowed) > 1 else "fit-exact keeps"
            )
            raise InputError(
                f"method {self.name} leaves out part of the rate through {samples} samples, those beside the step "
                f"included; {series} all of it"
            )
        return self, (increments, previous, ahead)


#: The Taylor series among the methods of strapgen.
_TAYLOR = (f"{__package__}.polynomial_rotation", "taylor")


def _built_in(name: str, title: str, place: str, order: int, **rest: Any) -> Integrator:
    """Return a method that a function of a module of this folder derives, with `place` as "module:function"."""
    module, function = place.split(":")
    return Integrator(title, f"{__package__}.{module}", order, name=name, function=function, **rest)


#: Methods on increments alone, and those that take none from after the step.
_INCREMENTS = {"takes_rates": False}
_NONE_AHEAD = {**_INCREMENTS, "takes_ahead": False}

#: Integration methods without files of coefficients.
INTEGRATORS = {
    one.name: one
    for one in (
        *(
            _built_in(
                f"taylor{order}",
                f"Taylor series of order {order} of the transition",
                "polynomial_rotation:taylor",
                order,
                **_INCREMENTS,
            )
            for order in range(1, 21)
        ),
        *(
            _built_in(f"magnus{order}", f"Magnus series of order {order}", "rotation_series:magnus", order)
            for order in (2, 4, 6)
        ),
        _built_in(
            "fit-exact",
            "polynomial through the increments, integrated exactly",
            "polynomial_rotation:fit_exact",
            16,
            **_INCREMENTS,
        ),
        _built_in("munthe-kaas4", "Runge-Kutta-Munthe-Kaas method of order 4", "runge_kutta:munthe_kaas", 4),
        _built_in("crouch-grossman3", "Crouch-Grossman method of order 3", "runge_kutta:crouch_grossman", 3),
        _built_in(
            "coning-least-squares",
            "compressed coning coefficients, by least squares over a band",
            "coning:least_squares",
            2,
            **_NONE_AHEAD,
        ),
        *(
            _built_in(f"coning-{form}", title, "coning:by_form", order, **_NONE_AHEAD, arguments=(form,))
            for form, order, title in (
                ("compressed", 4, "compressed coning coefficients, made for coning"),
                ("uncompressed", 4, "uncompressed coning coefficients, made for polynomial rates"),
                ("combined", 6, "coning coefficients for both, with the terms of third and fourth order"),
            )
        ),
        _built_in(
            "coning-exact-rest",
            "coning coefficients for both, with all other terms of the polynomial through the increments",
            "coning:exact_rest",
            16,
            **_NONE_AHEAD,
        ),
        _built_in(
            "coning-polynomial",
            "uncompressed coning coefficients, with the terms of third and fourth order",
            "coning:by_form",
            6,
            **_NONE_AHEAD,
            arguments=("polynomial",),
        ),
    )
}
