"""The formulas that every generator is given, from the kernels of strapgen."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import sympy as sp

from generators import Case
from strapgen.catalogue.kinematics import KINEMATICS
from strapgen.catalogue.runge_kutta import staged_step, step
from strapgen.catalogue.tableaux import TABLEAUX
from strapgen.kernel import Kernel


def kernel(case: Case) -> Kernel:
    """Return the fourth-order step of a case, before any lowering."""
    function = {"staged": staged_step, "transition": step}[case.form]
    return function(KINEMATICS[case.algorithm], TABLEAUX["rk4"], 2 if case.samples == "increments" else None)


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

    def value(expression: sp.Expr) -> Any:
        if expression.is_Symbol:
            return known[expression.name]
        if expression.is_Rational:
            return number(int(expression.p), int(expression.q))
        if expression.is_Pow:
            assert expression.exp == 2
            return value(expression.base) * value(expression.base)
        total = value(expression.args[0])
        for argument in expression.args[1:]:
            total = total + value(argument) if expression.is_Add else total * value(argument)
        return total

    known = dict(values)
    for stage in (*kernel.stages, *kernel.outputs):
        for name, expression in zip(stage.signal.elements, stage.expressions, strict=True):
            known[name] = value(expression)
    return [known[name] for name in kernel.outputs[0].signal.elements]


def loads(kernel: Kernel) -> str:
    """Return C that gives the elements of both inputs their names."""
    lines = [
        f"    const double {name} = {array}[{k}];"
        for array, names in zip(("state", "samples"), inputs(kernel), strict=True)
        for k, name in enumerate(names)
    ]
    return "\n".join(lines)
