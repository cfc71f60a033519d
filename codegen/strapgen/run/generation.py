"""A request to generate a kernel: the choice, the target, the settings and the name, as a command states them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from strapgen import pipeline
from strapgen.catalogue import Choice
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Sources
from strapgen.targets.names import UNNAMED, Naming

if TYPE_CHECKING:
    from strapgen.ir.program import Program


@dataclass(frozen=True)
class Request:
    """What one call of ``strapgen generate`` generates.

    Parameters
    ----------
    choice : Choice
    target : str
        A key of `strapgen.targets.TARGETS`.
    settings : Settings or None
        Settings of fixed point, if any are stated.
    naming : Naming
        The name of the function in C, if the user chooses it.
    """

    choice: Choice
    target: str
    settings: Settings | None = None
    naming: Naming = UNNAMED

    def sources(self) -> Sources:
        """Return the generated sources."""
        return pipeline.compile(self.choice, self.target, self.settings, self.naming)

    def program(self) -> Program:
        """Return the program with its name."""
        return self.naming.of(pipeline.program(self.choice))


def generated_data(choice: Choice, sources: Sources, target: str, files: Sequence[str]) -> dict[str, Any]:
    """Return generated sources as plain JSON data.

    Parameters
    ----------
    choice : Choice
    sources : Sources
    target : str
        Name of the target, as it was asked for.
    files : sequence of str
        Where they were written.
    """
    operations = sources.operations
    data = {
        "kernel": sources.kernel,
        "target": target,
        "files": list(files),
        "operations": {kind: operations[kind] for kind in ("add", "multiply", "divide", "sqrt")},
        "temporaries": sources.temporaries,
    }
    if sources.rounding is not None:
        data["error_bounds"] = sources.rounding.as_data()
    if sources.fixed is None:
        return data
    return data | pipeline.fixed_program(choice, sources.fixed.settings).as_data()
