"""A request to generate a kernel: the choice, the target, the settings and the name, as a command states them."""

from __future__ import annotations

from typing import NamedTuple

from strapgen.catalogue import Choice
from strapgen.ir.fixed_settings import Settings
from strapgen.targets.names import UNNAMED, Naming


class Request(NamedTuple):
    """What one call of ``strapgen generate`` generates: the arguments of `pipeline.compile`."""

    choice: Choice
    target: str
    settings: Settings | None = None
    naming: Naming = UNNAMED
