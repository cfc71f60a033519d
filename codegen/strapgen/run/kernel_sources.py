"""Input of back ends as plain data: the generated text of a kernel, or its program where it is interpreted."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

from strapgen import catalogue, pipeline
from strapgen.catalogue import Choice
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.kernel_info import AttitudeStep
from strapgen.ir.sources import Sources
from strapgen.targets import TARGETS
from strapgen.targets.naming import UNNAMED, Naming

if TYPE_CHECKING:
    from strapgen.ir.program import Program


@dataclass(frozen=True, kw_only=True)
class _ProgramSources(Sources):
    """Sources without text, for a back end that runs the program of a kernel."""

    program: Program


def sources_of_program(program: Program, target: str, settings: Settings | None = None) -> Sources:
    """Return generated text of a program if `target` is a target, else the program itself, for a back end."""
    if target in TARGETS:
        return pipeline.generate(program, target, settings)
    return _ProgramSources.of(
        program, target, program.name, {}, bundled_programs=program.bundled_programs, program=program
    )


def sources_of_choice(choice: Choice, target: str, settings: Settings | None = None) -> Sources:
    """Return the input of a back end for a chosen kernel, from the cache, see `sources_of_program`."""
    if target in TARGETS:
        return pipeline.compile(choice, target, settings)
    return sources_of_program(pipeline.program(choice), target)


def program_of(sources: Sources) -> Program:
    """Return the program that sources hold, if they are not generated text."""
    if not isinstance(sources, _ProgramSources):
        raise InputTypeError(
            f"sources of {sources.kernel} for {sources.target} hold text; a program is needed"
        )
    return sources.program


@dataclass(frozen=True)
class StepSources:
    """Sources of an attitude step, and of its product, orthonormalization and attitude as they are needed."""

    step: Sources
    choice: Choice | None = None  # None where the step brings every kernel that is not in the catalogue
    orthonormalization: str | None = None  # by default the kernel that goes with the step
    #: Sources of other kernels by name and target; where a kernel cannot be generated, the reason.
    beside: dict[tuple[str, str], Sources | str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _ = self.step_kernels

    @property
    def step_kernels(self) -> AttitudeStep:
        """Names of the step's kernels, and the other properties of an attitude step."""
        if self.step.attitude_step is None:
            raise InputError(f"kernel {self.step.kernel} is no attitude step; back ends are built from steps")
        return self.step.attitude_step

    @property
    def nodes(self) -> tuple[float, ...]:
        """Nodes at which the step takes the rate, as fractions of its length; empty if it takes increments."""
        if self.step.function.inputs[1].name == "increments":
            return ()
        if self.choice is None or not (nodes := catalogue.nodes(self.choice)):
            raise InputError(
                f"kernel {self.step.kernel} takes turns at nodes that its sources do not tell; "
                "strapgen.backend knows them from a choice"
            )
        return tuple(float(node) for node in nodes)

    def sources(self, kernel: str, target: str) -> Sources:
        """Return the sources of the step or of another kernel, if it can be generated for the target."""
        if (kernel, target) == (self.step.kernel, self.step.target):
            return self.step
        known = self.beside.get((kernel, target))
        if isinstance(known, str):
            raise InputError(known)
        if known is None:
            known = self.beside[kernel, target] = self._generate(kernel, target)
        return known

    def _generate(self, kernel: str, target: str) -> Sources:
        fixed = self.step.fixed if target == self.step.target else None
        settings = fixed.companion_settings if fixed else None
        if self.choice is not None:
            return sources_of_choice(self.choice.companion(kernel), target, settings)
        for program in self.step.bundled_programs:
            if program.kernel == kernel:
                return sources_of_program(program, target, settings)
        return sources_of_choice(Choice(kernel), target, settings)

    def complete(self, needed: Iterable[tuple[str | None, str]]) -> StepSources:
        """Return the same with the sources of the kernels and targets that are needed.

        A process that unpickles it then derives no kernel.
        """
        beside: dict[tuple[str, str], Sources | str] = {}
        for kernel, target in needed:
            if kernel is not None:
                try:
                    beside[kernel, target] = self.sources(kernel, target)
                except InputError as error:  # raised only where the kernel is used, as without a copy
                    beside[kernel, target] = str(error)
        return replace(self, choice=None, beside=beside)


class Request(NamedTuple):
    """The arguments of `pipeline.compile` for one call of ``strapgen generate``."""

    choice: Choice
    target: str
    settings: Settings | None = None
    naming: Naming = UNNAMED
