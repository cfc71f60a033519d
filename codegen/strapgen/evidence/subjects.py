"""What evidence is collected for: a kernel in fixed point, with the C and the program that it was printed from."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from strapgen import catalogue, fixedpoint, pipeline
from strapgen.catalogue import Choice
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.library import generated_sources


@dataclass(frozen=True)
class Subject:
    """A kernel whose C in fixed point is to be examined.

    Parameters
    ----------
    choice : Choice
    settings : Settings, optional
        Word, ranges and rounding; by default 32 bits and 1/8 rad.
    """

    choice: Choice
    settings: Settings | None = None

    @cached_property
    def program(self) -> Program:
        """The kernel as straight-line code in exact numbers."""
        return generated_sources.program(self.choice)

    @cached_property
    def fixed(self) -> FixedProgram:
        """The program in integers, from which the C is printed."""
        return pipeline.quantize(self.program, self.settings)

    @cached_property
    def sources(self) -> Sources:
        """The C."""
        return generated_sources.sources(self.choice, "c-fixed", self.settings)

    @property
    def name(self) -> str:
        """The function's name in C, which is also that of the files."""
        return self.sources.function.name

    @property
    def digest(self) -> str:
        """A hash of the source and the header, 16 hexadecimal digits: what was examined."""
        total = hashlib.sha256()
        for name, text in sorted(self.sources.step_files.items()):
            total.update(f"{name}\n{text}".encode())
        return total.hexdigest()[:16]


def standard() -> Iterator[Subject]:
    """Yield the kernels of the standard catalogue as they stand in ``generated/c_fixed``."""
    for choice in catalogue.standard():
        if fixedpoint.can_lower(generated_sources.program(choice)):
            yield Subject(choice)
