"""Algorithms that other applications describe: `simulate` and `compare` hand them over to these."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from strapgen import registration


class DescribedAlgorithms(NamedTuple):
    """What runs algorithms of a kind: the functions take what the commands ``simulate`` and ``compare`` read."""

    #: Tells whether a name stands for one
    covers: Callable[[object], bool]
    #: Run one, and deliver the result
    simulate: Callable[..., None]
    compare: Callable[..., None]


def described(name: Any) -> DescribedAlgorithms | None:
    """Return what runs an algorithm that another application describes; None for any other."""
    return next((kind for kind in registration.extensions("lab.described") if kind.covers(name)), None)
