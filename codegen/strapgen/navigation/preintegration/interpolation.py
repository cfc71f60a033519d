"""Derives the integral of sampled rates by the polynomial through the `POINTS` samples around a time.

Lagrange's weight of the instant t_j, counted from the time, is the product of t_k/(t_k - t_j) over the others. Where
there are fewer samples the instants of the others are very far away: their weights vanish then, and leave those of the
polynomial through what is there.
"""

from __future__ import annotations

from itertools import combinations, product
from math import prod

import sympy as sp

from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.preintegration import POINTS

#: Place of the last instant that is not after the time, among those around it.
HERE = POINTS // 2 - 1
#: Parts of a sample: of the rate and of the specific force.
PARTS = 6
#: Nodes of Gauss from the middle of an interval, and their weights; exact on polynomials of the seventh degree.
GAUSS = [
    (
        sign * sp.sqrt(sp.Rational(3, 28) + way * sp.sqrt(sp.Rational(3, 490))),
        sp.Rational(1, 4) - way * sp.sqrt(30) / 72,
    )
    for way, sign in product((1, -1), (-1, 1))
]


def integral() -> Kernel:
    """Derive the integral from the instant before a time to the time, of samples that are integrals."""
    build = KernelBuilder()
    times, samples = _inputs(build, "integral from the instant before to this one")
    weights = _weights(build, times, [(sp.S.Zero, sp.S.One)])
    # The sum of the samples from the instant before to each instant, by its weight.
    shares = [sp.S.Zero] * POINTS
    for k in range(HERE + 1, POINTS):
        shares[k] = sp.Add(*weights[k:])
    for k in range(1, HERE + 1):
        shares[k] = -sp.Add(*weights[:k])
    return _kernel(
        build,
        "interpolated-integral",
        "Integral of a sampled rate from an instant to a time, by the polynomial through the sums of samples",
        _summed(build, shares, samples),
    )


def mean() -> Kernel:
    """Derive the mean over an interval around a time, of samples at instants."""
    build = KernelBuilder()
    times, samples = _inputs(build, "rate at the instant")
    return _kernel(
        build,
        "interpolated-mean",
        "Mean of a sampled rate over an interval around a time, by the polynomial through samples at instants",
        _summed(build, _weights(build, times, GAUSS), samples),
    )


def _inputs(build: KernelBuilder, meaning: str) -> tuple[list[sp.Symbol], sp.Matrix]:
    times = build.input(
        Signal.labelled(
            "times",
            "t",
            list(map(str, range(POINTS))),
            meaning=f"instants less the time, in intervals, rising; {HERE + 1} are up to the time; one without a "
            "sample is very far away",
        )
    )
    elements = tuple(f"s{k}_{part}" for k in range(POINTS) for part in range(PARTS))
    samples = build.input(
        Signal("samples", (POINTS, PARTS), elements, meaning=f"samples, six parts each: {meaning}")
    )
    return list(times), samples


def _weights(
    build: KernelBuilder, times: list[sp.Symbol], nodes: list[tuple[sp.Expr, sp.Expr]]
) -> list[sp.Expr]:
    """Return the weights of the polynomial through instants, at nodes that have weights themselves."""
    apart = {
        (j, k): build.value(f"apart_{j}_{k}", times[k] - times[j], "distance of two instants")
        for j, k in combinations(range(POINTS), 2)
    }
    below = [
        build.value(
            f"below_{j}",
            prod(apart[j, k] if j < k else -apart[k, j] for k in range(POINTS) if k != j),
            "product of the distances",
        )
        for j in range(POINTS)
    ]
    above = [sp.S.Zero] * POINTS
    for number, (node, weight) in enumerate(nodes):
        from_node = [time - node for time in times]
        if node:
            from_node = [
                build.value(f"from_{number}_{j}", value, "instant less the node")
                for j, value in enumerate(from_node)
            ]
        before, after = [weight], [sp.S.One]
        for j in range(POINTS - 1):
            before.append(
                build.value(f"before_{number}_{j}", before[-1] * from_node[j], "product of those up to here")
            )
            after.append(
                build.value(
                    f"after_{number}_{j}", after[-1] * from_node[-1 - j], "product of those from here on"
                )
            )
        above = [
            total + one * other for total, one, other in zip(above, before, reversed(after), strict=True)
        ]
    return [
        build.value(
            f"weight_{j}",
            build.value(f"above_{j}", one, "product of the distances from the time") / other,
            "weight of an instant",
        )
        for j, (one, other) in enumerate(zip(above, below, strict=True))
    ]


def _summed(build: KernelBuilder, weights: list[sp.Expr], samples: sp.Matrix) -> sp.Matrix:
    shares = [
        weight if weight.is_Symbol or not weight else build.value(f"share_{k}", weight, "part of a sample")
        for k, weight in enumerate(weights)
    ]
    return (sp.Matrix([shares]) * samples).T


def _kernel(build: KernelBuilder, name: str, title: str, value: sp.Matrix) -> Kernel:
    build.output(Signal.labelled("value", "value", list(map(str, range(PARTS))), meaning="six parts"), value)
    return build.kernel(
        name, title, "J. L. Lagrange's interpolation; C. F. Gauss's quadrature", arguments=name
    )
