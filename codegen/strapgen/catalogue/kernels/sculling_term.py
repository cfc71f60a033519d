"""The sculling term of a step from the coning term, to which it is dual."""

from __future__ import annotations

import sympy as sp

from strapgen.catalogue.kernels.attitude_step import chosen
from strapgen.catalogue.methods.method import Method
from strapgen.catalogue.methods.samples import increments_signal, sample_names, velocities_signal
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import cross, exact
from strapgen.kernel.kernel import Kernel, KernelBuilder


def sculling(method: Method, increments: int, previous: int = 0) -> Kernel:
    """Derive the sculling term of a step in m/s, body axes, by duality with the coning coefficients of a method.

    The term is half the integral of (integral of w) x a + (integral of a) x w.
    """
    if method.coning is None:
        raise ValueError(f"{method.name} has no coning coefficients")
    pairs = method.coning(increments, previous)
    build = KernelBuilder()
    angles = increments_signal(increments, previous)
    names = [sample_names(increments, previous, letter=letter) for letter in "dv"]
    velocities = velocities_signal(increments, previous)
    d, v = build.input(angles), build.input(velocities)
    rows = [d[k, :].T for k in range(d.rows)], [v[k, :].T for k in range(v.rows)]
    total = sp.zeros(3, 1)
    for newer in range(1, d.rows):
        for levered, crossed, what in ((0, 1, "angle"), (1, 0, "velocity")):
            weights = {older: c for (older, other), c in pairs.items() if other == newer and c}
            if not weights:
                continue
            name = f"{what}_lever_{names[crossed][newer]}"
            signal = Signal.vector(
                name,
                name,
                unit=(angles, velocities)[levered].unit,
                meaning=f"sum of older {what} increments that is crossed with {names[crossed][newer]}",
            )
            terms = (exact(c) * rows[levered][older] for older, c in weights.items())
            lever = build.stage(signal, sum(terms, sp.zeros(3, 1)))
            total += cross(lever, rows[crossed][newer])
    build.output(
        Signal.vector(
            "sculling",
            "sculling",
            unit="m/s",
            meaning="sculling term of the velocity change, body axes",
            frame="b",
            over="cycle",
        ),
        total,
    )
    suffix, option, samples_text = chosen(method, increments, previous)
    samples_text = samples_text.replace("angle ", "angle and velocity ")
    return build.kernel(
        f"sculling-{suffix}",
        f"Sculling term of a step by {method.title.partition(',')[0]} from {samples_text}",
        f"{method.source.partition('; ')[0]}; by duality: K. M. Roscoe, J. Guid. Control Dyn. 24 (2001) 201-205",
        arguments=f"sculling {option}",
    )
