"""The front door: the stages of the generator in order, each with its input and its output.

algorithm, method, increments
    | derive      exact formulas
Kernel
    | lower       straight-line code
Program
    | quantize    for fixed point alone: integers, with ranges and error bounds
FixedProgram
    | generate    source text
Sources
    | build       compiled, callable
Backend
    | simulate    against the truth
Run
"""

from __future__ import annotations

import os
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from strapgen import catalogue, fixedpoint, targets
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.support import stages
from strapgen.support.exceptions import InputTypeError

if TYPE_CHECKING:
    from strapgen.catalogue.methods.tableau import Tableau
    from strapgen.symbolic.kernel import Kernel


def derive(
    algorithm: str,
    method: str | Tableau | None = None,
    increments: int | None = None,
    *,
    rates: bool = False,
    previous: int = 0,
) -> Kernel:
    """Derive an algorithm exactly.

    Parameters
    ----------
    algorithm : str
        An attitude algorithm ("dcm", "euler", "cayley-klein") or another kernel of the catalogue.
    method : str or Tableau, optional
        Integration method of an attitude algorithm: a name that ``strapgen list`` shows, or a tableau; by default
        "rk4".
    increments : int, optional
        Angle increments a step, 1 to 8 (default 2), of an attitude algorithm.
    rates : bool, optional
        Whether the step is given the body rate at every node of its method, times the step length, in place
        of increments.
    previous : int, optional
        Increments before the step that it takes too, 0 to 3 (default 0): a fit of higher degree for a slow gyro.

    Returns
    -------
    Kernel

    Raises
    ------
    InputError
        If a name or number is not allowed.

    Examples
    --------
    >>> derive("euler", method="rk4", increments=2).name
    'euler-rk4-2'
    >>> derive("euler", method="rk4", rates=True).inputs[1].elements[:4]
    ('turn_0_x', 'turn_0_y', 'turn_0_z', 'turn_1_2_x')
    """
    stages.require("derive", algorithm, str, os.PathLike)
    return catalogue.derive(catalogue.choose(algorithm, method, increments, rates, previous))


def lower(kernel: Kernel) -> Program:
    """Turn a kernel into straight-line code with the fewest operations that are known for it.

    Parameters
    ----------
    kernel : Kernel

    Returns
    -------
    Program

    Raises
    ------
    InputTypeError
        If it is no kernel; the message names the stage that is missing. So do all stages.
    NotImplementedError
        If an expression holds a function that programs do not know.

    Examples
    --------
    >>> lower(derive("euler")).operations["divide"]
    0
    """
    from strapgen.lowering import lower as lower_kernel
    from strapgen.symbolic.kernel import Kernel

    stages.require("lower", kernel, Kernel)
    return replace(lower_kernel(kernel), own=tuple(map(lower_kernel, kernel.own)))


def quantize(program: Program, settings: Settings | None = None) -> FixedProgram:
    """Lower a program to integers: formats from proved ranges, an error bound for every value.

    Parameters
    ----------
    program : Program
    settings : Settings, optional
        Word, largest increment, rounding and what else a user states; by default 32 bits and 1/8 rad.

    Returns
    -------
    FixedProgram

    Raises
    ------
    InputError
        If an input has no known range, a format that is asked for does not hold its values, or the word is too short.

    Examples
    --------
    >>> fixed = quantize(lower(derive("euler")))
    >>> str(fixed.formats["state"]), float(fixed.error_bounds["next"] * 2**30) < 1
    ('Q1.30', True)
    """
    stages.require("quantize", program, Program)
    _require_settings(settings)
    return fixedpoint.quantize(program, settings or Settings())


def generate(program: Program | FixedProgram, target: str, settings: Settings | None = None) -> Sources:
    """Turn a program into source text.

    Parameters
    ----------
    program : Program or FixedProgram
        A fixed-point target takes either; a program is quantized first.
    target : str
        "numpy", "c", "c-float", "c-fixed" or "fixed-model".
    settings : Settings, optional
        What fixed point is made for, where the program is not quantized yet.

    Returns
    -------
    Sources
        Text by file name, and the interface of the generated function.

    Raises
    ------
    InputError
        If the target is unknown, or does not go with the program or the settings.

    Examples
    --------
    >>> sorted(generate(lower(derive("euler")), "c").files)
    ['euler_rk4_2.c', 'euler_rk4_2.h']
    """
    stages.require("generate", program, Program, FixedProgram)
    if not isinstance(target, str):
        raise InputTypeError(
            f"target is {stages.describe(target)}; a name is needed: {', '.join(targets.TARGETS)}"
        )
    _require_settings(settings)
    return targets.emit(program, target, settings)


def _require_settings(settings: Any) -> None:
    if settings is not None and not isinstance(settings, Settings):
        raise InputTypeError(f"settings is {stages.describe(settings)}; strapgen.Settings is needed")
