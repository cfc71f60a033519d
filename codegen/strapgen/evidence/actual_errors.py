"""Certifies in ball arithmetic the errors of single calls and runs in fixed point.

The integer model computes what the C computes; the exact program is evaluated on the same integers in balls, numbers
with a radius in which the exact value is certain to lie. Radii grow with every operation. Products of transitions are
multiplied in pairs, then in pairs of pairs, so that radii grow with the number of levels, not with that of the steps.
"""

from __future__ import annotations

import importlib.metadata
import random
from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.evidence.collection import Result, Subject, Tool, Verdict, verdict
from strapgen.firmware.vectors import MODEL, vectors_of_choice
from strapgen.ir.exceptions import InputError
from strapgen.ir.interfaces import AngleAccumulation
from strapgen.ir.program import OPERATIONS, Program
from strapgen.run.compiled_code import ModelEvaluator

#: Calls, and steps of a run; steps from one look at the state to the next.
COUNT, BETWEEN = 10_000, 100
#: Bits of balls, and the largest radius in units of the last place.
PRECISION, LARGEST_RADIUS = 384, Fraction(1, 100)
#: Bits of the balls of a run with orthonormalizations: there are no products to be grouped, and radii grow.
_MORE_BITS = 8192
#: Part of their range that the increments fill where no number of steps is proved to keep the state proper.
_SMALL = Fraction(1, 128)
#: Iterations from a matrix to the nearest rotation; each squares the distance.
_ITERATIONS = 10
#: The orthonormalization of a run of matrices, which keeps the nearest rotation.
_MATRIX_NORMALIZATION = "dcm-orthonormalize-first-order"
TOOL = Tool(
    "FLINT", (), "python-flint from PyPI", lambda: importlib.metadata.version("python-flint"), ("flint",)
)


def check(subject: Subject, folder: Path) -> list[Verdict]:
    """Compare calls, and a run of a step, with balls."""
    claims = {"calls": partial(_judge_calls, subject)}
    if subject.fixed.interface.accumulation is not None:
        claims["steps"] = partial(_judge_run, subject)
    return [
        verdict(subject.name, f"error bound: {COUNT} {what}", TOOL, judge) for what, judge in claims.items()
    ]


# Calls


def _judge_calls(subject: Subject) -> tuple[Result, str]:
    accepted, share, radius = errors_of_calls(subject, COUNT)
    if radius >= LARGEST_RADIUS:
        return "fails", "balls become too wide"
    detail = f"{accepted} of {COUNT} calls accepted, errors up to {share:.3f} of the bound"
    return "agrees" if share <= 1 else "fails", detail


def errors_of_calls(subject: Subject, count: int) -> tuple[int, float, float]:
    """Call at corners of the ranges, near them and anywhere.

    Returns the number of calls that are accepted, the largest error as a part of its bound, and the largest radius of a
    ball in units of the last place.
    """
    from flint import ctx

    table = vectors_of_choice(subject.choice, "c-fixed", subject.settings, count)
    rows = [row for row in table.rows if row.status == 0]
    interface = subject.fixed.interface
    share = radius = 0.0
    with ctx.workprec(PRECISION):
        values = [
            column * ball(argument.unit)
            for place, argument in enumerate(interface.inputs)
            for column in map(column_of, zip(*(row.inputs[place] for row in rows), strict=True))
        ]
        for place, (argument, exact) in enumerate(
            zip(interface.outputs, evaluate(subject.program, values), strict=True)
        ):
            columns = map(column_of, zip(*(row.outputs[place] for row in rows), strict=True))
            for column, balls, bound in zip(columns, exact, argument.errors, strict=True):
                apart = np.broadcast_to(column - balls / ball(argument.unit), len(rows))
                radius = max(radius, *(float(x.rad()) if x.is_finite() else np.inf for x in apart))
                largest = max(abs(distance).upper() for distance in apart)
                if largest > 0:
                    share = max(
                        share,
                        float((largest * ball(argument.unit) / ball(bound)).upper()) if bound else np.inf,
                    )
    return len(rows), share, radius


# Runs


class CertifiedRun(NamedTuple):
    """The largest angle from the exact attitude in a run, with its bound at the same step."""

    steps: int
    normalizations: int
    #: In rad, where the angle is the largest part of the bound
    angle: float
    bound: float
    #: Whether the state stayed proper after every step
    proper: bool


def _judge_run(subject: Subject) -> tuple[Result, str]:
    angles = subject.fixed.interface.angle_accumulation
    if angles is None:
        return "not examined", "the header's bound of a run grows beyond all numbers"
    try:
        run = random_run_angle(subject, angles, COUNT)
    except InputError as error:
        return "fails", str(error)
    detail = f"{run.normalizations} normalizations, {run.angle:.3g} rad, the bound is {run.bound:.3g} rad"
    if not run.proper:
        return "fails", f"{detail}, but the state does not stay proper"
    return "agrees" if run.angle <= run.bound else "fails", detail


def random_run_angle(subject: Subject, angles: AngleAccumulation, steps: int, seed: int = 1) -> CertifiedRun:
    """Return the angle of a run of random increments from the exact one.

    Where the state is proved to stay proper for some steps, the increments fill their range and the state is normalized
    as often as that; elsewhere they are small.
    """
    model, normalization = _models(subject)
    state, samples = subject.fixed.interface.inputs
    stream, every = random.Random(seed), subject.fixed.interface.normalized_within
    between = every if every and len(state.signal.shape) == 2 else BETWEEN
    limit = samples.high if every else int(samples.high * _SMALL)
    increments = [[stream.randint(-limit, limit) for _ in range(samples.signal.size)] for _ in range(steps)]
    identity = subject.program.attitude_step.identity if subject.program.attitude_step else ()
    words, count, worst, proper = [int(one / state.unit) for one in identity], 0, (0.0, 1.0), True
    feedback = [entry.fresh for entry in subject.fixed.interface.residuals]
    exact = exact_states(subject, increments, between, normalization if between == every else None)
    for step, row in enumerate(increments, 1):
        results = model(words, row, *([feedback] if feedback else []))
        words, feedback = [*results[0]], [*results[1]] if feedback else []
        proper = proper and _is_proper([float(word * state.unit) for word in words], angles)
        if every and step % every == 0:
            words, count = [*normalization.model(words)[0]], count + 1
        if step % between == 0:
            angle = angle_between([ball(word * state.unit) for word in words], next(exact))
            bound = angles.bound(step, count, normalization.error)
            worst = max(worst, (angle, bound), key=lambda pair: pair[0] / pair[1])
    return CertifiedRun(steps, count, *worst, proper)


class _Normalization(NamedTuple):
    """The kernel that normalizes a state: its integer model, its program, and the error of an element."""

    model: Any
    program: Program
    error: Fraction


def _models(subject: Subject) -> tuple[Any, _Normalization]:
    """Return the function of a step on integers, and its normalization."""
    kernels = subject.program.attitude_step
    assert kernels is not None
    matrix = len(subject.program.inputs[0].shape) == 2
    name = _MATRIX_NORMALIZATION if matrix else str(kernels.orthonormalize)
    normalization = Subject(choose(name), subject.fixed.interface.companion_settings)
    step, normalize = (
        ModelEvaluator(pipeline.compile(part.choice, MODEL, part.settings)).step
        for part in (subject, normalization)
    )
    return step, _Normalization(
        normalize, normalization.program, max(normalization.fixed.interface.outputs[0].errors)
    )


def exact_states(
    subject: Subject,
    increments: Iterable[Sequence[int]],
    between: int,
    normalization: _Normalization | None = None,
) -> Iterator[list[Any]]:
    """Yield balls of the exact state after every block of steps; with a normalization, after that."""
    from flint import ctx

    samples = subject.fixed.interface.inputs[1]
    kernels, transition = subject.program.attitude_step, subject.program.transition_program()
    assert kernels is not None
    product = pipeline.program(choose(str(kernels.product)))
    exact = [ball(one) for one in kernels.identity]
    steps = iter(increments)
    while len(rows := list(islice(steps, between))) == between:
        with ctx.workprec(_MORE_BITS if normalization else PRECISION):
            columns = [column_of(column) * ball(samples.unit) for column in zip(*rows, strict=True)]
            exact = evaluate_single(
                product, [*exact, *product_in_pairs(product, evaluate_single(transition, columns))]
            )
            if normalization:
                exact = evaluate_single(normalization.program, exact)
        yield exact


def angle_between(state: Sequence[Any], exact: Sequence[Any]) -> float:
    """Return an upper end of the angle between two attitudes, in rad."""
    from flint import arb, arb_mat, ctx

    with ctx.workprec(PRECISION):
        if len(state) == 4:
            dot = sum(x * y for x, y in zip(state, exact, strict=True))
            lengths = sum(x * x for x in state) * sum(y * y for y in exact)
            sine = ((lengths - dot * dot) / lengths).nonnegative_part().sqrt()
            return float((2 * sine.asin()).upper())
        first, second = (_nearest_rotation(arb_mat(3, 3, [*elements])) for elements in (state, exact))
        apart = sum((x * x for x in (first - second).entries()), arb(0))
        return float((2 * (apart / 8).sqrt().asin()).upper())


def _nearest_rotation(matrix: Any) -> Any:
    """Return the rotation nearest to a matrix, by Newton's iteration."""
    for _ in range(_ITERATIONS):
        matrix = (matrix + matrix.inv().transpose()) / 2
    return matrix


def _is_proper(values: Sequence[float], angles: AngleAccumulation) -> bool:
    """Return whether a state is so near a proper one that the bound holds."""
    shortest = float(angles.shortest)
    if len(values) == 4:
        return float(np.linalg.norm(values)) >= shortest
    singular = np.linalg.svd(np.reshape(values, (3, 3)), compute_uv=False)
    return bool(singular[-1] >= shortest and singular[0] <= np.sqrt(2 - shortest**2))


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


def evaluate_single(program: Program, values: Sequence[Any]) -> list[Any]:
    """Return the elements of a program's only output."""
    (elements,) = evaluate(program, values)
    return elements


def evaluate(program: Program, values: Sequence[Any]) -> list[list[Any]]:
    """Return the elements of each output of a program, see `evaluate_single`."""
    names = [name for signal in program.inputs for name in signal.elements]
    results = program.run(dict(zip(names, values, strict=True)), ball, _operations())
    return [results[result.signal.name] for result in program.outputs]


def product_in_pairs(product: Program, turns: Sequence[Any]) -> list[Any]:
    """Return the product of transitions."""
    while len(turns[0]) > 1:
        odd = len(turns[0]) % 2
        pairs = [[column[k : len(column) - odd : 2] for column in turns] for k in (0, 1)]
        last = [column[len(column) - odd :] for column in turns]
        turns = [
            np.concatenate(parts)
            for parts in zip(evaluate_single(product, [*pairs[0], *pairs[1]]), last, strict=True)
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
