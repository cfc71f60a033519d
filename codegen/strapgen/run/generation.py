"""A request to generate a kernel: the choice, the target, the settings and the name, as a command states them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from strapgen import pipeline
from strapgen.catalogue import Choice
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Sources
from strapgen.targets.names import UNNAMED, Naming


class Request(NamedTuple):
    """What one call of ``strapgen generate`` generates: the arguments of `pipeline.compile`."""

    choice: Choice
    target: str
    settings: Settings | None = None
    naming: Naming = UNNAMED


def generated_data(choice: Choice, sources: Sources, target: str, files: Sequence[str]) -> dict[str, Any]:
    """Return sources for a target, as it was asked for, and the paths of their files as plain JSON data."""
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
