"""`StepSources` holds as plain data all that a back end is built from: a step's sources and those of its kernels."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from strapgen import catalogue
from strapgen.catalogue import Choice
from strapgen.ir.attitude_step import Companions
from strapgen.ir.exceptions import InputError
from strapgen.ir.sources import Sources
from strapgen.run.kernel_sources import sources_of_choice, sources_of_program


@dataclass(frozen=True)
class StepSources:
    """Sources of an attitude step, and of its product, orthonormalization and attitude as they are needed.

    Parameters
    ----------
    step : Sources
    choice : Choice or None
        The choice of the step; None where the step brings every kernel that is not in the catalogue.
    orthonormalization : str or None
        Kernel that orthonormalizes; by default the one that goes with the step.
    beside : dict of (str, str) to Sources or str
        Sources of other kernels by name and target; where a kernel cannot be generated, the reason.

    Raises
    ------
    InputError
        If the sources are not those of an attitude step.
    """

    step: Sources
    choice: Choice | None = None
    orthonormalization: str | None = None
    beside: dict[tuple[str, str], Sources | str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _ = self.step_kernels

    @property
    def step_kernels(self) -> Companions:
        """Names of the step's kernels, and what else its sources tell of an attitude step."""
        if self.step.companions is None:
            raise InputError(f"kernel {self.step.kernel} is no attitude step; back ends are built from steps")
        return self.step.companions

    @property
    def nodes(self) -> tuple[float, ...]:
        """Nodes at which the step takes the rate, as fractions of its length; empty if it takes increments.

        Raises
        ------
        InputError
            If the step takes rates, and the choice that knows where is not here.
        """
        if self.step.function.inputs[1].name == "increments":
            return ()
        if self.choice is None or not (nodes := catalogue.nodes(self.choice)):
            raise InputError(
                f"kernel {self.step.kernel} takes turns at nodes that its sources do not tell; "
                "strapgen.backend knows them from a choice"
            )
        return tuple(float(node) for node in nodes)

    def sources(self, kernel: str, target: str) -> Sources:
        """Return the sources of the step or of another kernel.

        Raises
        ------
        InputError
            If the kernel cannot be generated for the target.
        """
        if (kernel, target) == (self.step.kernel, self.step.target):
            return self.step
        known = self.beside.get((kernel, target))
        if isinstance(known, str):
            raise InputError(known)
        if known is None:
            known = self.beside[kernel, target] = self._generated(kernel, target)
        return known

    def _generated(self, kernel: str, target: str) -> Sources:
        fixed = self.step.fixed if target == self.step.target else None
        settings = fixed.companion_settings if fixed else None
        if self.choice is not None:
            return sources_of_choice(self.choice.companion(kernel), target, settings)
        for program in self.step.own:
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
