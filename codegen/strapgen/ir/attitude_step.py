"""The attitude step's kernels: product, orthonormalization and conversion to a direction cosine matrix."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction


@dataclass(frozen=True)
class Companions:
    """The kernels and properties of an attitude step that a back end needs in addition to the step itself.

    Parameters
    ----------
    product : str or None
        Kernel that multiplies a state by a transition, and one transition by the next; None for a step that is not
        linear in the state.
    orthonormalize : str or None
        Kernel that restores the norm or the orthogonality of the state; None if nothing has to be restored.
    attitude : str or None
        Kernel that converts the state to a direction cosine matrix; None if the state is one.
    identity : tuple of Fraction
        The state of zero rotation, row-major.
    previous : int
        Number of increments from before the step that it takes in addition to its own.
    isometry : bool
        Whether the exact transition is a rotation for any increments.
    """

    product: str | None
    orthonormalize: str | None
    attitude: str | None
    identity: tuple[Fraction, ...]
    previous: int = 0
    isometry: bool = False
