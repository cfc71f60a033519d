"""Ball arithmetic: numbers with a radius, in which a program's exact value is certain to lie.

Radii grow with every operation. Products of transitions can be grouped at will: they are multiplied in pairs, then in
pairs of pairs, so that radii grow with the number of levels and not with that of the steps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from strapgen.ir.program import OPERATIONS, Program


def ball(number: Fraction) -> Any:
    """Return a ball that holds a number."""
    from flint import arb, fmpq

    return arb(fmpq(number.numerator, number.denominator))


def column_of(integers: Sequence[int]) -> Any:
    """Return integers as an array of balls: numpy's loops over objects call their operators."""
    from flint import arb

    column = np.empty(len(integers), object)
    column[:] = [arb(value) for value in integers]
    return column


def outcome(program: Program, values: Sequence[Any]) -> list[Any]:
    """Return the elements of a program's only output."""
    (elements,) = outcomes(program, values)
    return elements


def outcomes(program: Program, values: Sequence[Any]) -> list[list[Any]]:
    """Return the elements of each output of a program, see `outcome`."""
    names = [name for signal in program.inputs for name in signal.elements]
    results = program.run(dict(zip(names, values, strict=True)), ball, _operations())
    return [results[result.signal.name] for result in program.outputs]


def multiplied(product: Program, turns: Sequence[Any]) -> list[Any]:
    """Return the product of transitions."""
    while len(turns[0]) > 1:
        odd = len(turns[0]) % 2
        pairs = [[column[k : len(column) - odd : 2] for column in turns] for k in (0, 1)]
        last = [column[len(column) - odd :] for column in turns]
        turns = [
            np.concatenate(parts)
            for parts in zip(outcome(product, [*pairs[0], *pairs[1]]), last, strict=True)
        ]
    return [column[0] for column in turns]


def _operations() -> dict[str, Callable[..., Any]]:
    """Return the operations of programs on balls, and on arrays of them."""
    from flint import arb

    def root(x: Any) -> Any:  # a radicand that exists is not negative, whatever its ball holds beside
        return x.sqrt() if x < 0 else x.nonnegative_part().sqrt()

    def at_least(x: Any, y: Any) -> bool | None:
        difference = x - y
        return True if difference >= 0 else False if difference < 0 else None

    def select(condition: bool | None, yes: Any, no: Any) -> Any:
        return yes.union(no) if condition is None else yes if condition else no

    def wrap(x: Any) -> Any:
        return select(
            at_least(x, arb.pi()), x - 2 * arb.pi(), select(at_least(-x, arb.pi()), x + 2 * arb.pi(), x)
        )

    functions: dict[str, tuple[Callable[..., Any], int]] = {
        "sqrt": (root, 1),
        "sin": (lambda x: x.sin(), 1),
        "cos": (lambda x: x.cos(), 1),
        "sinc": (lambda x: x.sinc(), 1),
        "atan2": (lambda y, x: arb.atan2(y, x), 2),
        "direction": (lambda y, x: arb.atan2(y, x), 2),
        "wrap": (wrap, 1),
        "maximum": (lambda x, y: x.max(y), 2),
        "at_least": (at_least, 2),
        "select": (select, 3),
    }
    return {**OPERATIONS, **{kind: np.frompyfunc(f, count, 1) for kind, (f, count) in functions.items()}}
