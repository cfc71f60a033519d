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
from strapgen.ir.version import VERSION
from strapgen.navigation.systems.fitting import fitted
from strapgen.navigation.systems.wiring import Description
from strapgen.targets.names import UNNAMED, Naming


@dataclass(frozen=True)
class Subject:
    """A kernel whose C in fixed point is to be examined."""

    choice: Choice
    #: Word, ranges and rounding; by default 32 bits and 1/8 rad
    settings: Settings | None = None
    #: Name of the function, where it is a stage of a system
    naming: Naming = UNNAMED

    @cached_property
    def program(self) -> Program:
        """The kernel as straight-line code in exact numbers."""
        return pipeline.program(self.choice)

    @cached_property
    def fixed(self) -> FixedProgram:
        """The program in integers, from which the C is printed."""
        return pipeline.fixed_program(self.choice, self.settings or Settings())

    @cached_property
    def sources(self) -> Sources:
        """The C."""
        return pipeline.compile(self.choice, "c-fixed", self.settings, self.naming)

    @property
    def name(self) -> str:
        """The function's name in C, which is also that of the files."""
        return self.sources.function.name

    @property
    def digest(self) -> str:
        """A hash of the source and the header, 16 hexadecimal digits: what was examined.

        strapgen's version in them is left out: where a new version generates the same code, evidence stays.
        """
        total = hashlib.sha256()
        for name, text in sorted(self.sources.step_files.items()):
            total.update(f"{name}\n{text.replace(VERSION, '')}".encode())
        return total.hexdigest()[:16]


def standard() -> Iterator[Subject]:
    """Yield the kernels of the standard catalogue as they stand in ``generated/c_fixed``."""
    for choice in catalogue.standard():
        if fixedpoint.can_lower(pipeline.program(choice)):
            yield Subject(choice)


def of_system(description: Description, settings: Settings | None = None) -> Iterator[Subject]:
    """Yield the stages of a described system, each with the word, ranges and formats that it has there."""
    fit = fitted(description, "c-fixed", settings)
    for stage in description.system.stages:
        sources = fit.sources[stage.name]
        assert sources.fixed is not None, "the target is fixed point"
        naming = Naming(name=sources.function.name)
        yield Subject(description.choices[stage.name], sources.fixed.settings, naming)
