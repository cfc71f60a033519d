"""Makes and recognizes names of temporaries, which passes may drop, split or rescale."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count

from strapgen.ir.program import Program

#: Prefix of the temporaries that hold common subexpressions.
SHARED = "shared_"
#: Prefix of the temporaries that hold partial products of a power.
FACTOR = "factor_"


def is_temporary(name: str) -> bool:
    """Return whether a name is that of a temporary, which stands for no quantity of the algorithm."""
    return name.startswith((SHARED, FACTOR))


def shared_names(program: Program) -> Iterator[str]:
    """Yield names for further common subexpressions, none of which the program uses yet."""
    names = {assignment.name for assignment in program.body}
    names |= {element for signal in program.inputs for element in signal.elements}
    return (name for k in count(1) if (name := f"{SHARED}{k}") not in names)
