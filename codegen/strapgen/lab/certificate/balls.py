"""Programs in balls: numbers with a radius, in which the exact value is certain to lie.

Radii grow with every operation. Products of transitions are multiplied in pairs, then in pairs of pairs, so that radii
grow with the number of levels, not with that of the steps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cache, partial
from typing import Any

import numpy as np

from strapgen.ir.exceptions import MissingExtraError
from strapgen.ir.program import OPERATIONS, Program

#: Bits of balls along a run.
BITS = 128
#: Iterations from a matrix to the nearest rotation; each squares the distance.
_ITERATIONS = 8


def flint() -> Any:
    """Return the library of balls."""
    try:
        import flint as library
    except ImportError:
        raise MissingExtraError("a certificate needs python-flint: pip install 'strapgen[certify]'") from None
    return library


def ball(number: Fraction) -> Any:
    """Return a ball that holds a number."""
    from flint import arb, fmpq

    return arb(fmpq(number.numerator, number.denominator))


def column_of(numbers: Sequence[Any]) -> Any:
    """Return integers or floats as an array of balls: numpy's loops over objects call their operators."""
    from flint import arb

    column = np.empty(len(numbers), object)
    column[:] = [arb(value) for value in numbers]
    return column


def evaluate_single(program: Program, values: Sequence[Any]) -> list[Any]:
    """Return the elements of a program's only output."""
    (elements,) = evaluate(program, values)
    return elements


def evaluate(program: Program, values: Sequence[Any]) -> list[list[Any]]:
    """Return the elements of each output of a program, see `evaluate_single`."""
    names = [name for signal in program.inputs for name in signal.elements]
    results = program.run(dict(zip(names, values, strict=True)), ball, _operations())
    return [results[result.signal.name] for result in program.outputs]


def scalar_function(program: Program) -> Callable[..., list[list[Any]]]:
    """Return a program as a function of balls, one for each element of its inputs, at the precision of this call.

    It returns the elements of each output; a call on single balls takes a fraction of the time of `evaluate`.
    """
    lines: list[str] = []
    known: dict[str, Any] = dict(_functions())

    def emit(text: str, *arguments: str) -> str:
        lines.append(f"    t{len(lines)} = {text.format(*arguments)}")
        return f"t{len(lines) - 1}"

    def constant(value: Fraction) -> str:
        known[f"c{len(known)}"] = ball(value)
        return f"c{len(known) - 1}"

    calls = {kind: f"{kind}({', '.join(['{}'] * _operands(kind))})" for kind in _functions()}
    operations = {kind: partial(emit, text) for kind, text in (_SIGNS | calls).items()}
    names = [name for signal in program.inputs for name in signal.elements]
    inputs = [f"x{place}" for place in range(len(names))]
    results = program.run(dict(zip(names, inputs, strict=True)), constant, operations)
    returned = ", ".join(f"[{', '.join(results[one.signal.name])}]" for one in program.outputs)
    code = "\n".join([f"def function({', '.join(inputs)}):", *lines, f"    return [{returned}]"])
    exec(compile(code, f"<{program.kernel} on balls>", "exec"), known)
    function: Callable[..., list[list[Any]]] = known["function"]
    return function


def product_in_pairs(product: Program, turns: Sequence[Any]) -> list[Any]:
    """Return the products of transitions along the last axis of arrays, one for each element."""
    while (count := turns[0].shape[-1]) > 1:
        odd = count % 2
        pairs = [[column[..., k : count - odd : 2] for column in turns] for k in (0, 1)]
        last = [column[..., count - odd :] for column in turns]
        turns = [
            np.concatenate(parts, axis=-1)
            for parts in zip(evaluate_single(product, [*pairs[0], *pairs[1]]), last, strict=True)
        ]
    return [column[..., 0] for column in turns]


def rotation_vector(matrix: Any) -> list[Any]:
    """Return the rotation vector in rad of the rotation nearest to a matrix; no numbers from a quarter turn on."""
    from flint import arb

    turn = nearest_rotation(matrix)
    sines = [(turn[j, i] - turn[i, j]) / 2 for i, j in ((1, 2), (2, 0), (0, 1))]
    square = sum((x * x for x in sines), arb(0)).nonnegative_part()
    if not (square < 1 and turn.trace() > 1):
        return [arb("nan")] * 3
    low, high = (arb(end) for end in (square.lower(), square.upper()))
    return [x * _arcsine_ratio(low).union(_arcsine_ratio(high)) for x in sines]


def _arcsine_ratio(square: Any) -> Any:
    """Return arcsin(s)/s, which grows with s, from the square of s."""
    root = square.nonnegative_part().sqrt()
    return root.asin() / root if root > 0 else 1 + root


def nearest_rotation(matrix: Any) -> Any:
    """Return the rotation nearest to a matrix that is near a multiple of it, by Newton's iteration.

    Iterates have one nearest rotation. Where a matrix is moved by r, it moves by no more than 2 r, as long as no
    singular value is below 1/2 (R.-C. Li, SIAM J. Matrix Anal. Appl. 16 (1995) 327); so radii need not go on.
    """
    from flint import arb, arb_mat

    turn = matrix / _length(matrix) * arb(3).sqrt()
    one = arb_mat(3, 3, [int(i == j) for i in range(3) for j in range(3)])
    if not _length(turn.transpose() * turn - one) < 0.75:
        return arb_mat(3, 3, [arb("nan")] * 9)
    moved = arb(0)
    for _ in range(_ITERATIONS):
        moved += 2 * _length(arb_mat(3, 3, [x.rad() for x in turn.entries()]))
        middle = arb_mat(3, 3, [x.mid() for x in turn.entries()])
        turn = (middle + middle.inv().transpose()) / 2
    # The nearest rotation is no further from this matrix than its square is from 1.
    moved += _length(turn.transpose() * turn - one)
    return arb_mat(3, 3, [x + arb(0, moved.upper()) for x in turn.entries()])


def _length(matrix: Any) -> Any:
    """Return the root of the sum of the squares of all elements."""
    from flint import arb

    return sum((x * x for x in matrix.entries()), arb(0)).nonnegative_part().sqrt()


def is_zero(value: Any) -> bool:
    """Return whether a value is the integer 0, with which nothing has to be computed."""
    return isinstance(value, int) and not value


#: How operations are written whose operators balls have.
_SIGNS = {
    **{"add": "{} + {}", "subtract": "{} - {}", "multiply": "{} * {}", "divide": "{} / {}"},
    "negate": "-{}",
}


@cache
def _functions() -> dict[str, Callable[..., Any]]:
    """Return the operations of programs on balls that have no operator."""
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

    return {
        "sqrt": root,
        "sin": lambda x: x.sin(),
        "cos": lambda x: x.cos(),
        "sinc": lambda x: x.sinc(),
        "atan2": lambda y, x: arb.atan2(y, x),
        "direction": lambda y, x: arb.atan2(y, x),
        "wrap": wrap,
        "maximum": lambda x, y: x.max(y),
        "at_least": at_least,
        "select": select,
    }


def _operands(kind: str) -> int:
    return _functions()[kind].__code__.co_argcount


@cache
def _operations() -> dict[str, Callable[..., Any]]:
    """Return the operations of programs on balls, and on arrays of them."""
    exact = {
        "add": lambda x, y: y if is_zero(x) else x if is_zero(y) else x + y,
        "subtract": lambda x, y: -y if is_zero(x) else x if is_zero(y) else x - y,
        "multiply": lambda x, y: 0 if is_zero(x) or is_zero(y) else x * y,
    }
    on_arrays = {kind: np.frompyfunc(f, _operands(kind), 1) for kind, f in _functions().items()}
    return {**OPERATIONS, **exact, **on_arrays}
