"""Jacobians of the vectors of a step: rotation vector, sculling term, velocity and position change."""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from strapgen.catalogue.kernels import attitude_step, sculling_term, velocity_position
from strapgen.catalogue.methods.method import Method
from strapgen.ir.signals import Signal
from strapgen.kernel.derivatives import add_tangents, tangent
from strapgen.kernel.kernel import Kernel, KernelBuilder


def rotation_vector(method: Method, increments: int, previous: int = 0, ahead: int = 0) -> Kernel:
    """Derive the Jacobian of the rotation vector of a step, see `jacobian`."""
    return jacobian(attitude_step.rotation_vector(method, increments, previous, ahead))


def sculling(method: Method, increments: int, previous: int = 0) -> Kernel:
    """Derive the Jacobians of the sculling term of a step, see `jacobian`."""
    return jacobian(sculling_term.sculling(method, increments, previous))


def velocity_and_position(method: Method, increments: int, previous: int = 0, ahead: int = 0) -> Kernel:
    """Derive the Jacobians of the velocity and position change of a step, see `jacobian`."""
    return jacobian(velocity_position.step(method, increments, previous, ahead))


def jacobian(kernel: Kernel) -> Kernel:
    """Derive ``<output>_by_<input>`` for every pair: rows are elements of the output, columns of the input.

    The expressions of the kernel must have derivatives everywhere.
    """
    build = KernelBuilder()
    for signal in kernel.inputs:
        build.input(signal)
    build.stages = list(kernel.stages)
    outputs = []
    for signal in kernel.inputs:
        rows: dict[str, list[list[sp.Expr]]] = {stage.signal.name: [] for stage in kernel.outputs}
        for element in signal.elements:
            along = {sp.Symbol(element, real=True): sp.Integer(1)}
            known = add_tangents(build, kernel.stages, along, f"by_{element}", "1")
            for stage in kernel.outputs:
                symbols = (sp.Symbol(name, real=True) for name in stage.signal.elements)
                pairs = zip(symbols, stage.expressions, strict=True)
                rows[stage.signal.name].append([tangent(*pair, known) for pair in pairs])
        for stage in kernel.outputs:
            outputs.append((_matrix(stage.signal, signal), rows[stage.signal.name]))
    for matrix, columns in outputs:
        build.output(matrix, [column[row] for row in range(matrix.shape[0]) for column in columns])
    first, _, rest = kernel.arguments.partition(" ")
    return replace(
        build.kernel(
            kernel.name.replace(first, f"{first}-jacobian", 1), f"Jacobians of: {kernel.title}", kernel.source
        ),
        order=kernel.order,
        arguments=f"{first}-jacobian {rest}",
    )


def _matrix(output: Signal, by: Signal) -> Signal:
    name = f"{output.name}_by_{by.name}"
    elements = tuple(f"{name}_{row}_{column}" for row in range(output.size) for column in range(by.size))
    unit = "1" if output.unit == by.unit else f"({output.unit})/{by.unit}" if by.unit != "1" else output.unit
    meaning = f"derivatives of {output.name} by {by.name}, row by row"
    return Signal(name, (output.size, by.size), elements, unit=unit, meaning=meaning)
