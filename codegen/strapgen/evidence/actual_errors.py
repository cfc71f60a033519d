"""Certifies in ball arithmetic the errors of single calls and runs in fixed point.

The integer model computes what the C computes; the exact program is evaluated on the same integers in balls. Runs are
those of a certificate.
"""

from __future__ import annotations

import importlib.metadata
import random
from collections.abc import Sequence
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.evidence.collection import Result, Subject, Tool, Verdict, verdict
from strapgen.firmware.vectors import MODEL, vectors_of_choice
from strapgen.ir.exceptions import InputError
from strapgen.ir.interfaces import AngleAccumulation
from strapgen.lab.certificate.balls import ball, column_of, evaluate
from strapgen.lab.certificate.certificate import roundings
from strapgen.run.compiled_code import ModelEvaluator

#: Calls, and steps of a run; steps from one look at the state to the next.
COUNT, BETWEEN = 10_000, 100
#: Bits of balls, and the largest radius in units of the last place.
PRECISION, LARGEST_RADIUS = 384, Fraction(1, 100)
#: Part of their range that the increments fill where no number of steps is proved to keep the state proper.
_SMALL = Fraction(1, 128)
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
    words, count, proper = [int(one / state.unit) for one in identity], 0, True
    feedback = [entry.fresh for entry in subject.fixed.interface.residuals]
    matrix = len(state.signal.shape) == 2
    begins, ends = [words], []
    for step, row in enumerate(increments, 1):
        results = model(words, row, *([feedback] if feedback else []))
        words, feedback = [*results[0]], [*results[1]] if feedback else []
        proper = proper and _is_proper([float(word * state.unit) for word in words], angles)
        last = words
        if every and step % every == 0:
            words, count = [*normalization.model(words)[0]], count + 1
        if step % between == 0:
            ends.append(last if matrix else words)
            begins.append(words)
    turns = np.array(increments[: between * len(ends)], np.float64) * float(samples.unit)
    blocks = turns.reshape(len(ends), -1, 3)

    def numbers(words: Sequence[int]) -> Any:
        return np.array([float(word * state.unit) for word in words])

    worst = (0.0, 1.0)
    if matrix and every:  # whose orthonormalization turns it by what truncation has left: each part by itself
        parts = ([begin, end] for begin, end in zip(begins, ends, strict=False))
        found = [
            (next(roundings(subject.choice, between, [*map(numbers, part)], [block])), angles.bound(between))
            for part, block in zip(parts, blocks, strict=True)
        ]
    else:
        states = [numbers(words) for words in [begins[0], *ends]]
        done = [(k + 1) * between for k in range(len(ends))]
        bounds = [angles.bound(n, n // every if every else 0, normalization.error) for n in done]
        found = [*zip(roundings(subject.choice, between, states, blocks), bounds, strict=True)]
    for departed, bound in found:
        worst = max(worst, (departed.angle.above, bound), key=lambda pair: pair[0] / pair[1])
    return CertifiedRun(steps, count, *worst, proper)


class _Normalization(NamedTuple):
    """The kernel that normalizes a state: its integer model, and the error of an element."""

    model: Any
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
    return step, _Normalization(normalize, max(normalization.fixed.interface.outputs[0].errors))


def _is_proper(values: Sequence[float], angles: AngleAccumulation) -> bool:
    """Return whether a state is so near a proper one that the bound holds."""
    shortest = float(angles.shortest)
    if len(values) == 4:
        return float(np.linalg.norm(values)) >= shortest
    singular = np.linalg.svd(np.reshape(values, (3, 3)), compute_uv=False)
    return bool(singular[-1] >= shortest and singular[0] <= np.sqrt(2 - shortest**2))
