"""Sources of an attitude step and of the kernels beside it: all that a back end is built from, and plain data."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from strapgen import pipeline
from strapgen.backends.registry import of_sources
from strapgen.catalogue import Choice
from strapgen.ir.sources import Sources
from strapgen.library import generated_sources
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.backends.protocol import Evaluator


@dataclass(frozen=True)
class StepSources:
    """Sources of an attitude step, and of its product, orthonormalization and attitude when they are needed.

    Parameters
    ----------
    step : Sources
    choice : Choice or None
        What was chosen; None where the step itself brings the kernels that are not in the catalogue.
    orthonormalization : str or None
        Kernel that orthonormalizes; by default the one that goes with the step.
    beside : dict of (str, str) to Sources or str
        Sources of other kernels by name and target; for what cannot be generated, why not.
    """

    step: Sources
    choice: Choice | None = None
    orthonormalization: str | None = None
    beside: dict[tuple[str, str], Sources | str] = field(default_factory=dict)

    def evaluator(self, kernel: str, target: str | None = None) -> Evaluator:
        """Return the step or a kernel beside it as a callable, by default on the step's own target.

        Raises
        ------
        InputError
            If the kernel cannot be generated for the target.
        """
        return of_sources(self.sources(kernel, target or self.step.target))

    def sources(self, kernel: str, target: str) -> Sources:
        """Return the sources of the step, or of a kernel beside it.

        Raises
        ------
        InputError
            If it cannot be generated for the target.
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
        for program in self.step.own:
            if program.kernel == kernel:
                return pipeline.generate(program, target, settings)
        choice = Choice(kernel) if self.choice is None else self.choice.companion(kernel)
        return generated_sources.sources(choice, target, settings)

    def complete(self) -> StepSources:
        """Return the same with all that the step may need, so that no kernel has to be derived where it is taken."""
        names = self.step.companions
        assert names is not None, "checked when a back end is built"
        target = self.step.target
        needed = [(self.orthonormalization or names.orthonormalize, target)]
        needed += [(names.attitude, "numpy")]
        if target == "numpy":
            needed += [(names.product, target)]
        beside: dict[tuple[str, str], Sources | str] = {}
        for kernel, language in needed:
            if kernel is not None:
                try:
                    beside[kernel, language] = self.sources(kernel, language)
                except InputError as error:  # found only where it is used, as without a copy
                    beside[kernel, language] = str(error)
        return replace(self, choice=None, beside=beside)
