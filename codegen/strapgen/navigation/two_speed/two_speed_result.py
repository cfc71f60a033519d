"""Generated algorithms in two speeds as a result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from strapgen.cli.generated_result import GeneratedSources
from strapgen.results.records import INTERNAL
from strapgen.results.result import Result


@dataclass(frozen=True)
class TwoSpeedResult(Result):
    """What was generated of an algorithm in two speeds."""

    kernel: str
    target: str
    #: Kernels of the loops
    loops: Sequence[str]
    files: Sequence[str]
    #: Operations of a call by kind
    operations: Mapping[str, int]
    #: The loops, as generate has them
    functions: Sequence[GeneratedSources]
    said: str = field(metadata=INTERNAL)

    def text(self) -> str:
        """Return operations, files and contracts."""
        return self.said
