"""Kernels and programs, derived once for all tests of a process."""

from __future__ import annotations

from functools import cache

from strapgen import catalogue, generate, lower, standard_tree
from strapgen.backends import BACKENDS, fitted
from strapgen.catalogue import Choice
from strapgen.kernel import Kernel
from strapgen.program import Program
from strapgen.targets import Sources


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


def generated(program: Program, backend_name: str) -> Sources:
    """Return the sources that a back end by this name runs."""
    return generate(program, BACKENDS[backend_name].target, fitted(backend_name, None))
