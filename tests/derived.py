"""Kernels and programs, derived once for all tests of a process."""

from __future__ import annotations

from functools import cache

from strapgen import catalogue, lower, standard_tree
from strapgen.catalogue import Choice
from strapgen.kernel import Kernel
from strapgen.program import Program


@cache
def kernel(choice: Choice) -> Kernel:
    return catalogue.derive(choice)


@cache
def program(choice: Choice) -> Program:
    return lower(kernel(choice))


@cache
def programs() -> dict[str, Program]:
    """Return the standard catalogue by the names of its kernels."""
    return {made.kernel: made for made in standard_tree.programs()}
