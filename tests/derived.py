"""Kernels, derived once for all tests of a process, and programs, derived once for all processes of a session."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache

import mpmath
import numpy as np
import sympy as sp
from scipy.spatial.transform import Rotation

from strapgen import catalogue, pipeline
from strapgen.catalogue import Choice
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.kernel.kernel import Kernel, evaluate_stages
from strapgen.run.backends import BACKENDS, fit_settings
from strapgen.run.kernel_sources import sources_of_program

#: Kernels of the standard catalogue that fixed point can be made of without ranges from a user: all but the models of
#: motions, whose rates have none, as tests/library proves.
FIXED_POINT = [
    choice for choice in catalogue.standard() if not choice.kernel.endswith(("-truth", "-increments"))
]


def tells_more(choice: Choice) -> bool:
    """Tell whether the code of a kernel differs from that of all others in more than names and coefficients.

    Cayley-Klein parameters have the code of Euler parameters, and steps of lower order that of the fourth.
    """
    return not choice.name.startswith("cayley-klein") and choice.method in (None, "rk4")


@cache
def kernel(choice: Choice) -> Kernel:
    return catalogue.derive(choice)


def program(choice: Choice) -> Program:
    return pipeline.program(choice)


def quantized(choice: Choice, settings: Settings) -> FixedProgram:
    """Return a kernel of the catalogue in fixed point."""
    return pipeline.fixed_program(choice, settings)


@cache
def programs() -> dict[str, Program]:
    """Return the standard catalogue by the names of its kernels."""
    return {choice.kernel: program(choice) for choice in catalogue.standard()}


#: Functions of the catalogue that SymPy knows nothing of, in any precision.
FUNCTIONS = {
    "Direction": mpmath.atan2,
    "Wrapped": lambda x: x - 2 * mpmath.pi * ((x > mpmath.pi) - (x < -mpmath.pi)),
}


@cache
def _functions(kernel: Kernel) -> list[tuple[list[str], tuple[str, ...], Callable[..., list]]]:
    """Return for every stage the names of its arguments, those of its elements, and its function."""
    functions = []
    for stage in (*kernel.stages, *kernel.outputs):
        used = {symbol for expression in stage.expressions for symbol in expression.free_symbols}
        arguments = sorted(used, key=str)
        function = sp.lambdify(arguments, list(stage.expressions), [FUNCTIONS, "mpmath"])
        functions.append((list(map(str, arguments)), stage.signal.elements, function))
    return functions


def precisely(kernel: Kernel, values: Mapping[str, mpmath.mpf]) -> dict[str, mpmath.mpf]:
    """Return all elements of a kernel, its inputs included, in the precision of mpmath."""
    known = dict(values)
    for arguments, elements, function in _functions(kernel):
        known |= dict(zip(elements, map(mpmath.mpf, function(*map(known.get, arguments))), strict=True))
    return known


def on_arrays(kernel: Kernel, inputs: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return all elements of a kernel, its formulas computed on arrays in double: no code is made of them."""
    stages = (*kernel.stages, *kernel.outputs)
    return evaluate_stages(stages, inputs, float, lambda power, arguments: arguments[0] ** float(power.exp))


def turns(choice: Choice, samples: np.ndarray) -> Rotation:
    """Return the rotations over steps of Euler parameters on samples (N, K, 3) in rad."""
    step = kernel(choice)
    state, increments = step.inputs
    values = dict(zip(state.elements, (0.0, 0.0, 0.0, 1.0), strict=True))
    values |= dict(zip(increments.elements, samples.reshape(len(samples), -1).T, strict=True))
    known = on_arrays(step, values)
    return Rotation.from_quat(np.stack([known[name] for name in step.outputs[0].signal.elements], -1))


def generated(program: Program, backend_name: str) -> Sources:
    """Return the sources that a back end by this name runs."""
    return sources_of_program(program, BACKENDS[backend_name].target, fit_settings(backend_name, None))
