"""Degrees of the polynomials that stages compute, without expanding them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from strapgen.kernel.kernel import Stage, evaluate_stages


@dataclass(frozen=True)
class _Degree:
    """The degree of a polynomial; sums and products of degrees follow those of the polynomials."""

    value: int

    def __add__(self, other: _Degree) -> _Degree:
        return max(self, other, key=lambda degree: degree.value)

    def __mul__(self, other: _Degree) -> _Degree:
        return _Degree(self.value + other.value)

    def __pow__(self, exponent: int) -> _Degree:
        return _Degree(self.value * exponent)


def degree(stages: Iterable[Stage], variables: Iterable[str], results: Sequence[str]) -> int | None:
    """Return an upper bound of the degree of the elements `results` in the variables; None if they are no polynomials.

    >>> from strapgen import derive
    >>> step = derive("euler", "rk4", increments=2)
    >>> degree(step.stages, [e for s in step.inputs for e in s.elements], ["p_x", "p_s"])
    4
    """
    try:
        known = evaluate_stages(stages, {name: _Degree(1) for name in variables}, lambda number: _Degree(0))
        return max(int(known[name].value) for name in results)
    except (AttributeError, TypeError, ValueError):  # SymPy's errors where no sum or product is left
        return None
