"""The samples that a step takes of a smooth motion, as power series in the step length."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy as sp

from strapgen.catalogue.coefficients import Number
from strapgen.kernel import algebra
from strapgen.kernel.power_series import Powers

#: The rate and its derivatives, each a vector of polynomials.
Rate = Sequence[Sequence[Any]]


def elements(ring: Any, rate: Rate, shares: Sequence[Sequence[sp.Expr]], top: int) -> list[Powers]:
    """Return the elements of samples, row by row: the sum of shares[k][j] w_j h^(j+1) for the sample k.

    `rate`: the rate in rad/s, or the specific force in m/s^2, and its derivatives at the beginning of the step.
    """
    rows = []
    for row in shares:
        numbers = [ring.domain.from_sympy(share) for share in row]
        rows += [
            Powers(ring, {j + 1: vector[axis] * numbers[j] for j, vector in enumerate(rate)}, top)
            for axis in range(3)
        ]
    return rows


def of_small_motion(ring: Any, vectors: Rate, shares: Sequence[Sequence[sp.Expr]], top: int) -> list[Powers]:
    """Return the elements of samples as series in the size of the motion, of which they are the first power.

    Parameters are those of `elements`; the length of the step is the first generator of the ring.
    """
    h = ring.gens[0]
    rows = []
    for row in shares:
        weights = [ring.domain.from_sympy(share) * h ** (j + 1) for j, share in enumerate(row)]
        for axis in range(3):
            total = sum((v[axis] * w for v, w in zip(vectors, weights, strict=True)), ring.zero)
            rows.append(Powers(ring, {1: total}, top))
    return rows


def with_step(ring: Any, element: Any) -> Any:
    """Return an element of the ring of a frame in one whose first generator is the length of the step."""
    return ring.from_dict({(0, *place): ring.domain.convert(c) for place, c in element.terms()})


def by_power(ring: Any, elements: Sequence[Powers], top: int) -> dict[int, list[Any]]:
    """Return elements that are series in the size of the motion by the power of the step, in the ring of the frame.

    `ring`: the ring of the frame, without the length of the step.
    """
    rows: dict[int, list[Any]] = {}
    for number, element in enumerate(elements):
        for part in element.parts.values():
            for (power, *place), coefficient in part.terms():
                if power <= top:
                    row = rows.setdefault(power, [ring.zero] * len(elements))
                    row[number] = row[number] + ring.from_dict({tuple(place): coefficient})
    return {power: row for power, row in sorted(rows.items()) if any(row)}


def increment_shares(k: int, count: int, terms: int) -> list[sp.Expr]:
    """Return the integrals of t^j/j!, j from 0 on, over the interval k of `count` in a step of length 1."""
    begin, end = sp.Rational(k, count), sp.Rational(k + 1, count)
    return [(end ** (j + 1) - begin ** (j + 1)) / sp.factorial(j + 1) for j in range(terms)]


def node_shares(node: Number, terms: int) -> list[sp.Expr]:
    """Return the values of t^j/j!, j from 0 on, at a node of a step of length 1."""
    return [algebra.exact(node) ** j / sp.factorial(j) for j in range(terms)]
