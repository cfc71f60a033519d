"""Stores bounds that were proved before, for a browser, which lacks the numpy that proofs need.

A bound belongs to a program, whatever wrote it down: its key is the digest of all that the program holds.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

from strapgen.ir.interfaces import RoundingBounds
from strapgen.ir.notebook_display import full_text
from strapgen.ir.program import Program

#: What bounds say where they are not known for this reason.
WITHOUT_NUMPY = "numpy is missing, with which bounds are proved"

_bounds: dict[str, RoundingBounds] = {}


def key(program: Program, number: str) -> str:
    """Return the key of the bounds of a program in a type of numbers, under the settings that are the default."""
    return hashlib.sha256(f"{number} {full_text(program)}".encode()).hexdigest()


def load(data: Mapping[str, Mapping[str, Any]]) -> None:
    """Add bounds, as `RoundingBounds.as_dict` writes them, by their keys.

    >>> from strapgen import derive, lower, rounding_bounds
    >>> program = lower(derive("euler", method="rk1"))
    >>> load({key(program, "double"): rounding_bounds(program).as_dict()})
    >>> bounds(program, "double", 53) == rounding_bounds(program)
    True
    """
    _bounds.update({name: RoundingBounds.from_dict(each) for name, each in data.items()})


def bounds(program: Program, number: str, precision: int) -> RoundingBounds:
    """Return the stored bounds of a program, or the reason why there are none."""
    unknown = RoundingBounds(number, precision, reason=WITHOUT_NUMPY)
    return _bounds.get(key(program, number), unknown)
