"""The methods without files of coefficients by name, as plain data: listing them imports no computer algebra."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, ClassVar

from strapgen.catalogue.methods.method_spec import Asked, StepSamples, through_samples
from strapgen.ir.exceptions import InputError

#: From so many samples on a Taylor series has to keep every power of time of the polynomial through them.
LEAST_WHOLE = 4


@dataclass(frozen=True)
class Integrator:
    """A method without coefficient files; ``method(*arguments)``, or ``method(order)``, of its module returns it."""

    title: str
    module: str
    order: int
    takes_rates: bool = True
    arguments: tuple[str, ...] = ()
    takes_ahead: bool = True
    name: str = ""  # that of its table

    file: ClassVar = ""
    kind: ClassVar = "method"
    own_samples: ClassVar = None
    tolerance: ClassVar = Fraction(0)

    @property
    def recipe(self) -> tuple[str, str, tuple[Any, ...]]:
        """Module, function and arguments that make a `Method` of it."""
        return self.module, "method", self.arguments or (self.order,)

    def keeps(self, samples: int) -> bool:
        """Tell whether it is no Taylor series, or keeps every power of the rate's polynomial through the samples."""
        return self.module != TAYLOR or samples < LEAST_WHOLE or self.order >= samples

    def select(self, asked: Asked) -> tuple[Integrator, StepSamples]:
        """Return the method for the samples that are asked for, and the samples.

        A Taylor series that ends before the rate's polynomial through many samples does is refused: the powers of time
        that it leaves out are of first order in the increments, and the step does not turn by their sum.
        """
        increments, previous, ahead = through_samples(
            self.name, asked, takes_rates=self.takes_rates, takes_ahead=self.takes_ahead
        )
        samples = (increments or 0) + previous + ahead
        if not self.keeps(samples):
            allowed = [
                name for name, one in INTEGRATORS.items() if one.module == TAYLOR and one.keeps(samples)
            ]
            series = (
                f"{allowed[0]} to {allowed[-1]} and fit-exact keep" if len(allowed) > 1 else "fit-exact keeps"
            )
            raise InputError(
                f"method {self.name} leaves out part of the rate through {samples} samples, those beside the step "
                f"included; {series} all of it"
            )
        return self, (increments, previous, ahead)


#: The module of the Taylor series.
TAYLOR = f"{__package__}.taylor"

#: The methods, each with the module of this folder that derives it.
_INTEGRATORS = {
    **{
        f"taylor{order}": Integrator(
            f"Taylor series of order {order} of the transition", "taylor", order, False
        )
        for order in range(1, 21)
    },
    **{
        f"magnus{order}": Integrator(f"Magnus series of order {order}", "magnus", order)
        for order in (2, 4, 6)
    },
    "fit-exact": Integrator(
        "polynomial through the increments, integrated exactly", "fit_exact", 16, takes_rates=False
    ),
    "munthe-kaas4": Integrator("Runge-Kutta-Munthe-Kaas method of order 4", "munthe_kaas", 4),
    "crouch-grossman3": Integrator("Crouch-Grossman method of order 3", "crouch_grossman", 3),
    "coning-least-squares": Integrator(
        "compressed coning coefficients, by least squares over a band",
        "frequency_shaping",
        2,
        takes_rates=False,
        takes_ahead=False,
    ),
    "coning-compressed": Integrator(
        "compressed coning coefficients, made for coning", "coning", 4, False, ("compressed",), False
    ),
    "coning-uncompressed": Integrator(
        "uncompressed coning coefficients, made for polynomial rates",
        "coning",
        4,
        False,
        ("uncompressed",),
        False,
    ),
    "coning-combined": Integrator(
        "coning coefficients for both, with the terms of third and fourth order",
        "coning",
        6,
        False,
        ("combined",),
        False,
    ),
    "coning-exact-rest": Integrator(
        "coning coefficients for both, with all other terms of the polynomial through the increments",
        "exact_rest",
        16,
        False,
        takes_ahead=False,
    ),
    "coning-polynomial": Integrator(
        "uncompressed coning coefficients, with the terms of third and fourth order",
        "coning",
        6,
        False,
        ("polynomial",),
        False,
    ),
}

#: Integration methods without files of coefficients.
INTEGRATORS = {
    name: replace(one, name=name, module=f"{__package__}.{one.module}") for name, one in _INTEGRATORS.items()
}
