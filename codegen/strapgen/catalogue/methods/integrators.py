"""The methods without files of coefficients by name, as plain data: listing them imports no computer algebra."""

from __future__ import annotations

from typing import NamedTuple


class Integrator(NamedTuple):
    """A method without coefficient files; ``method(*arguments)``, or ``method(order)``, of its module returns it."""

    title: str
    module: str
    order: int
    takes_rates: bool = True
    arguments: tuple[str, ...] = ()
    takes_ahead: bool = True


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
INTEGRATORS = {name: one._replace(module=f"{__package__}.{one.module}") for name, one in _INTEGRATORS.items()}
