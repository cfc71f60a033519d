"""Companions: the kernels that an attitude step needs beside it."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction


@dataclass(frozen=True)
class Companions:
    """Kernels that go with an attitude step: what a back end needs beside it.

    Parameters
    ----------
    product : str
        Kernel that advances a state by a transition, and one transition by the next.
    orthonormalize : str
        Kernel that restores the state's norm or orthogonality.
    attitude : str or None
        Kernel that turns the state into a direction cosine matrix; None where the state is one.
    identity : tuple of Fraction
        The state of zero rotation, row-major.
    """

    product: str
    orthonormalize: str
    attitude: str | None
    identity: tuple[Fraction, ...]
