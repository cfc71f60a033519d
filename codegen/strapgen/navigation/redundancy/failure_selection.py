"""Derives which sensor has failed and which triad to use, from parity equations and their trip levels."""

from __future__ import annotations

from fractions import Fraction

import sympy as sp

from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.redundancy.parity_equations import HEXAD_SET, SEBRING, SensorSet, equation_label

_HALF = sp.Rational(1, 2)


def _flag(condition: sp.Expr) -> sp.Expr:
    """Return 1 where an expression is at least zero, else 0."""
    return sp.Piecewise((1, condition >= 0), (0, True))


def _flags(name: str, prefix: str, labels: list[str], meaning: str) -> Signal:
    return Signal.labelled(name, prefix, labels, meaning=f"{meaning}: 1 or 0", bound=Fraction(1))


def select(sensors: SensorSet = HEXAD_SET) -> Kernel:
    """Return the detection and the selection.

    An equation fails where its parity reaches its trip level. The failed sensor is the one in all equations that fail,
    if only one is. The triad is the one whose sensors are in the fewest; among equals, the one of the least noise.

    Returns: inputs ``parity`` (M,) and ``trip`` (M,), the trip levels of the integer equations, in rad or m/s,
    and ``excluded`` (N,), 1 for a sensor that no longer counts, else 0; outputs ``detected``, 1 if an equation
    fails, ``failed`` (N,), 1 for the sensor that is isolated, and ``triad``, the number of the selected triad.
    """
    geometry = sensors.geometry
    labels = [str(number) for number in sensors.all_sensors]
    build = KernelBuilder()
    p = build.input(sensors.parity)
    trip = build.input(
        Signal.labelled(
            "trip",
            "t",
            map(equation_label, geometry.equations),
            unit=sensors.unit,
            meaning="trip levels of the parity equations",
            bound=sensors.parity.bound,
        )
    )
    excluded = build.input(_flags("excluded", "x", labels, "sensors that no longer count"))
    out = build.stage(
        _flags("out", "out", labels, "sensors that do not count"), [_flag(x - _HALF) for x in excluded]
    )
    names = list(map(equation_label, geometry.equations))
    fail = build.stage(
        _flags("fail", "f", names, "equations that fail"),
        [_fails(e, p[k], trip[k], out) for k, e in enumerate(geometry.equations)],
    )
    counts = [sum(fail[k] for k, e in enumerate(geometry.equations) if e[s]) for s in sensors.all_sensors]
    count = build.stage(
        Signal.labelled("count", "n", labels, meaning="failing equations of a sensor"), counts
    )
    total = build.value("total", sum(fail), "failing equations")
    candidates = [
        sp.Piecewise((0, _HALF - total >= 0), (1, n - total + _HALF >= 0), (0, True)) for n in count
    ]
    suspect = build.stage(_flags("suspect", "s", labels, "sensors in all failing equations"), candidates)
    several = build.value("several", sum(suspect), "number of suspects")
    isolated = build.stage(
        _flags("isolated", "isolated", labels, "the only suspect"),
        [sp.Piecewise((0, several - 1 - _HALF >= 0), (s, True)) for s in suspect],
    )
    penalty = len(geometry.equations) + 1
    cost = build.stage(
        Signal.labelled("cost", "cost", labels, meaning="what speaks against a sensor"),
        [n + penalty * (o + f) for n, o, f in zip(count, out, isolated, strict=True)],
    )
    best = _number_of_least(build, [sum(cost[k] for k in triad.sensors) for triad in geometry.triads])
    build.output(
        Signal.scalar("detected", meaning="whether an equation fails: 1 or 0"), [_flag(total - _HALF)]
    )
    build.output(
        Signal.labelled("failed", "failed", labels, meaning="the sensor that is isolated: 1 or 0"), isolated
    )
    build.output(Signal.scalar("triad", meaning="number of the selected triad"), [best])
    return build.kernel(
        f"select-{sensors.name}",
        "Failed sensor and selected triad",
        f"{SEBRING}, tables by failure directions described, rule derived",
        arguments=sensors.command,
        notes=(
            "Triads are numbered from 0 by their noise, then by the numbers of their sensors.",
            "Without a single suspect no sensor is isolated; detected is 1 all the same.",
        ),
    )


def _fails(equation: tuple[int, ...], parity: sp.Symbol, trip: sp.Symbol, out: sp.Matrix) -> sp.Expr:
    """Return 1 where an equation fails that needs no sensor that is out, else 0."""
    invalid = sum(out[sensor] for sensor, value in enumerate(equation) if value) - _HALF
    return sp.Piecewise((0, invalid >= 0), (1, sp.Abs(parity) - trip >= 0), (0, True))


def _number_of_least(build: KernelBuilder, costs: list[sp.Expr]) -> sp.Expr:
    """Return the number of the first triad of least cost."""
    least, best = build.value("least_0", costs[0], "least cost so far"), sp.S.Zero
    for number, expression in enumerate(costs[1:], 1):
        cost = build.value(f"triad_cost_{number}", expression)
        best = build.value(f"best_{number}", sp.Piecewise((best, cost - least >= 0), (number, True)))
        least = build.value(f"least_{number}", -sp.Max(-least, -cost))
    return best
