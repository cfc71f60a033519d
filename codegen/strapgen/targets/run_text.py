"""Writes a header's bound of the rounding of a run in words: a formula in its steps, and examples."""

from __future__ import annotations

import math
import re
from fractions import Fraction
from functools import partial

from strapgen.ir.formats import above, below
from strapgen.ir.interfaces import LARGEST_ERROR, AngleAccumulation, Interface
from strapgen.ir.program import Program
from strapgen.targets.contract import accumulation_text

#: Bounds are written with four digits.
_above, _below = partial(above, digits=4), partial(below, digits=4)
#: Steps from one normalization to the next in the examples, unless fewer are proved.
_APART = 1000
#: Units of the last place by which an element of an orthonormalization is off in the examples.
_UNITS = 4


def run_paragraphs(interface: Interface, program: Program) -> list[str]:
    """Return the bound of a run of N steps in words, and for some N; empty for a kernel that is no step."""
    angles = interface.angle_accumulation
    if angles is not None:
        is_matrix = len(program.inputs[0].shape) == 2
        words = _matrix_words(angles) if is_matrix else _parameter_words(angles)
        return [*words, *_table(interface, angles)]
    if interface.accumulation is not None:
        return [
            "Over a run of N steps without orthonormalization the distance from exact arithmetic on the same "
            f"increments is at most {accumulation_text(interface.accumulation, program, interface.settings.state)}."
        ]
    return []


def _parameter_words(angles: AngleAccumulation) -> list[str]:
    """Return the bound of a run of a vector of parameters in words."""
    return [
        f"Attitude error by rounding after N steps: at most {_formula(angles)} rad against exact arithmetic on the "
        f"same increments, while the length of the state is at least {_above(angles.shortest)}. From a length of at "
        f"least {_above(angles.start)} that is proved for {angles.proved_steps:,} steps. M normalizations in between, "
        "which multiply the words of the state by one factor and round each of them once, add at most "
        f"{_above(angles.per_normalization)} M rad.",
    ]


def _matrix_words(angles: AngleAccumulation) -> list[str]:
    """Return the bound of a run of a matrix in words."""
    inner, outer = angles.start**2, angles.shortest**2
    words = [
        "Error by rounding of the nearest rotation to the matrix C after N steps: at most "
        f"{_formula(angles)} rad against exact arithmetic on the same increments, for N up to "
        f"{angles.proved_steps:,} from a C whose C'C has eigenvalues from {_above(inner)} to {_below(2 - inner)}; over "
        f"more steps {_above(angles.beyond)} times as much, while they stay between {_above(outer)} and "
        f"{_below(2 - outer)}.",
    ]
    if angles.per_element is not None:
        fixed = f"{_above(angles.per_normalization)} + " if angles.per_normalization else ""
        words.append(
            "M orthonormalizations in between, at most as many steps apart, which multiply C by a symmetric expansion "
            f"of the inverse root of C'C, make {_above(angles.orthonormalized)} times as much of it and add at most "
            f"({fixed}{_above(angles.per_element)} h) M rad, with h the error of an element that their header states, "
            f"up to {_below(LARGEST_ERROR)}."
        )
    if angles.dual_rows_apart:
        words.append(
            f"With dual rows, as dcm_orthonormalize has them, at most {angles.dual_rows_apart} steps apart, h up to "
            f"{_below(angles.dual_rows_error)}, from a C'C with eigenvalues within {_below(angles.dual_rows_start)} "
            f"of 1, all that is exp({_above(angles.dual_rows_growth)} M) times as much."
        )
    return words


def _formula(angles: AngleAccumulation) -> str:
    once = f"{_above(angles.once)} + " if angles.once else ""
    return f"{once}{_above(angles.per_step)} N"


def _table(interface: Interface, angles: AngleAccumulation) -> list[str]:
    """Return the bounds of some runs, a line each."""
    apart = min(_APART, interface.normalized_within)
    is_restored = angles.per_element is not None and apart > 0
    error = _UNITS * interface.inputs[0].format.unit if angles.per_element else Fraction(0)
    to_first_order = f"orthonormalized to first order (h = {_UNITS} ulp)"
    kind = to_first_order if angles.per_element else "normalized"
    lines = []
    for steps, what in _runs(interface.settings.stated):
        line = f"- N = {steps}{what}: {_angle(angles.bound(steps))}"
        if is_restored:
            line += f"; {kind} every {apart} steps: {_angle(angles.bound(steps, steps // apart, error))}"
        lines.append(line)
    return lines


def _runs(stated: str) -> list[tuple[int, str]]:
    """Return numbers of steps for the examples; an hour where the step is stated."""
    runs = [(10**4, ""), (10**6, "")]
    step = re.search(r"--step (\S+)", stated)
    if step is not None:
        runs.append((int(3600 / Fraction(step[1])), ", an hour"))
    return sorted(runs)


def _angle(value: float) -> str:
    """Return a bound of an angle, unless it says nothing."""
    return f"{_above(Fraction(value))} rad" if value < math.pi else "no bound"
