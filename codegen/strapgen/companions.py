"""Companions: the kernels that an attitude step needs beside it."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction


@dataclass(frozen=True)
class Companions:
    """Kernels that go with an attitude step: what a back end needs beside it.

    Parameters
    ----------
    product : str or None
        Kernel that advances a state by a transition, and one transition by the next; None for a step that is not
        linear in the state.
    orthonormalize : str or None
        Kernel that restores the state's norm or orthogonality; None where nothing has to be restored.
    attitude : str or None
        Kernel that turns the state into a direction cosine matrix; None where the state is one.
    identity : tuple of Fraction
        The state of zero rotation, row-major.
    previous : int
        How many of the increments that a step takes are those before it, kept from earlier steps.
    isometry : bool
        Whether the exact transition is a rotation whatever the increments are.
    """

    product: str | None
    orthonormalize: str | None
    attitude: str | None
    identity: tuple[Fraction, ...]
    previous: int = 0
    isometry: bool = False
