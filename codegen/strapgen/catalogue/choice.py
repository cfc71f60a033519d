"""A choice of kernel: what `choose` returns, and all that its users ask of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from strapgen.catalogue.methods.tableau import Tableau
from strapgen.catalogue.names import KERNELS

if TYPE_CHECKING:
    from strapgen.symbolic.kernel import Kernel


@dataclass(frozen=True)
class Choice:
    """A kernel that was chosen: a value, which says all that its derivation needs.

    Parameters
    ----------
    name : str
        Name of the algorithm or kernel; of a user's the name of its kernel.
    method : str or Tableau, optional
        Method of an attitude step of the catalogue, or of a vector of one.
    increments : int, optional
        Increments of a step. A step of the catalogue without increments is given the body rate at every node of its
        method.
    previous : int, optional
        Increments before the step that it takes too.
    user_kernel : Kernel, optional
        A user's kernel itself, with the kernels that it brings; None for one of the catalogue.
    """

    name: str
    method: str | Tableau | None = None
    increments: int | None = None
    previous: int = 0
    # Equal choices have equal kernels; a hash of the name and the numbers is enough to tell most others apart.
    user_kernel: Kernel | None = field(default=None, hash=False, repr=False)

    @classmethod
    def of_user(cls, kernel: Kernel) -> Choice:
        """Return the choice of a user's kernel: an attitude step, or a kernel that one brings."""
        if kernel.companions is None:
            return cls(kernel.name, user_kernel=kernel)
        previous = kernel.companions.previous
        return cls(kernel.name, None, kernel.inputs[1].shape[0] - previous, previous, kernel)

    @property
    def method_name(self) -> str | None:
        """Name of the method."""
        return self.method.name if isinstance(self.method, Tableau) else self.method

    @property
    def kernel(self) -> str:
        """Name of the kernel."""
        if self.method is None:
            return self.name
        before = f"-previous{self.previous}" if self.previous else ""
        return f"{self.name}-{self.method_name}-{self.increments or 'rates'}{before}"

    @property
    def identity(self) -> str:
        """What tells this choice from every other one: its kernel's name, and what a user made it of."""
        if self.user_kernel is not None:
            return f"{self.kernel} {self.user_kernel!r}"
        return f"{self.kernel} {self.method!r}" if isinstance(self.method, Tableau) else self.kernel

    @property
    def increments_per_step(self) -> int:
        """How many increments belong to a step: 1 for one that takes rates, each over a whole step."""
        return self.increments or 1

    @property
    def orthonormalizations(self) -> list[str]:
        """Kernels that orthonormalize the state: of a user's step the one that it names."""
        if self.user_kernel is None:
            return orthonormalizations(self.name)
        step = self.user_kernel.companions
        return [] if step is None or step.orthonormalize is None else [step.orthonormalize]

    def companion(self, name: str) -> Choice:
        """Return the choice of a kernel that goes with this one: one that a user's kernel brings, or of the catalogue.

        Parameters
        ----------
        name : str
            Product, orthonormalization or attitude of a step, as its `companions` name them.

        Examples
        --------
        >>> Choice("euler", "rk4", 2).companion("dcm-from-euler").kernel
        'dcm-from-euler'
        """
        brought = () if self.user_kernel is None else self.user_kernel.own
        return next((Choice.of_user(kernel) for kernel in brought if kernel.name == name), Choice(name))


def increments(choice: Choice) -> int:
    """Return how many increments belong to a step, see `Choice.increments_per_step`."""
    return choice.increments_per_step


def previous(choice: Choice) -> int:
    """Return how many increments before it a step takes too."""
    return choice.previous


def orthonormalizations(algorithm: str) -> list[str]:
    """Return the kernels that orthonormalize the state of an algorithm of the catalogue."""
    starts = (f"{algorithm}-orthonormalize", f"{algorithm}-normalize")
    return [name for name in KERNELS if name.startswith(starts)]
