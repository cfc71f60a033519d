"""The formulas that every generator is given, from the kernels of strapgen."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from generators import Case
from strapgen.catalogue.kernels.attitude_step import step
from strapgen.catalogue.kinematics import KINEMATICS
from strapgen.catalogue.methods.runge_kutta import method, staged_step
from strapgen.catalogue.methods.tableaux import TABLEAUX
from strapgen.kernel.kernel import Kernel


def kernel(case: Case) -> Kernel:
    """Return the fourth-order step of a case, before any lowering."""
    kinematics, tableau = KINEMATICS[case.algorithm], TABLEAUX["rk4"]
    increments = 2 if case.samples == "increments" else None
    if case.form == "staged":
        return staged_step(kinematics, tableau, increments)
    return step(kinematics, method(tableau), increments)


def inputs(kernel: Kernel) -> tuple[list[str], list[str]]:
    """Return the names of the elements of the state and of the samples."""
    state, samples = kernel.inputs
    return list(state.elements), list(samples.elements)


def translated(kernel: Kernel, values: dict[str, Any], number: Callable[[int, int], Any]) -> list[Any]:
    """Evaluate a kernel's stages with the symbols of another system.

    Parameters
    ----------
    kernel : Kernel
    values : dict
        A symbol of the other system for every input element.
    number : callable
        ``number(p, q)``: p/q in the other system.
    """
    (elements,) = kernel.expand(values, lambda r: number(int(r.p), int(r.q))).values()
    return elements


def loads(kernel: Kernel) -> str:
    """Return C that gives the elements of both inputs their names."""
    lines = [
        f"    const double {name} = {array}[{k}];"
        for array, names in zip(("state", "samples"), inputs(kernel), strict=True)
        for k, name in enumerate(names)
    ]
    return "\n".join(lines)


def definition(body: str) -> str:
    """Return C of the step with a given body."""
    return (
        f"static inline void step(const double *state, const double *samples, double *next)\n{{\n{body}}}\n"
    )


def calling(call: str, elements: int) -> str:
    """Return C of the step by a call that leaves its results in `out`."""
    stores = "".join(f"    next[{k}] = out[{k}];\n" for k in range(elements))
    return definition(f"    double out[{elements}];\n{call}{stores}")
