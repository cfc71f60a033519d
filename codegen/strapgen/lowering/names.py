"""Names that stand for no quantity of the algorithm: passes may drop, split or change what they hold."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count

from strapgen.program import Program

#: How names begin that common subexpressions get.
SHARED = "shared_"
#: How names begin that partial products of a power get.
FACTOR = "factor_"


def is_unnamed(name: str) -> bool:
    """Tell whether a name stands for no quantity of the algorithm."""
    return name.startswith((SHARED, FACTOR))


def shared_names(program: Program) -> Iterator[str]:
    """Yield names for common subexpressions that a program does not use yet."""
    taken = {assignment.name for assignment in program.body}
    taken |= {element for signal in program.inputs for element in signal.elements}
    return (name for k in count(1) if (name := f"{SHARED}{k}") not in taken)
