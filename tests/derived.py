"""Kernels, derived once for all tests of a process, and programs, derived once for all processes of a session."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import mpmath
import sympy as sp

from strapgen import catalogue
from strapgen.backends import BACKENDS, fitted
from strapgen.backends.kernel_sources import sources_of_program
from strapgen.catalogue import Choice
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.library import generated_sources
from strapgen.symbolic.kernel import Kernel


@cache
def kernel(choice: Choice) -> Kernel:
    return catalogue.derive(choice)


def program(choice: Choice) -> Program:
    return generated_sources.program(choice)


@cache
def programs() -> dict[str, Program]:
    """Return the standard catalogue by the names of its kernels."""
    return {choice.kernel: program(choice) for choice in catalogue.standard()}


def precisely(kernel: Kernel, values: Mapping[str, mpmath.mpf]) -> dict[str, mpmath.mpf]:
    """Return all elements of a kernel, its inputs included, in the precision of mpmath."""
    known = dict(values)
    for stage in (*kernel.stages, *kernel.outputs):
        used = {s for expression in stage.expressions for s in expression.free_symbols}
        names = [name for name in known if sp.Symbol(name, real=True) in used]
        arguments = [sp.Symbol(name, real=True) for name in names]
        found = sp.lambdify(arguments, list(stage.expressions), "mpmath")(*(known[name] for name in names))
        known |= dict(zip(stage.signal.elements, map(mpmath.mpf, found), strict=True))
    return known


def generated(program: Program, backend_name: str) -> Sources:
    """Return the sources that a back end by this name runs."""
    return sources_of_program(program, BACKENDS[backend_name].target, fitted(backend_name, None))
