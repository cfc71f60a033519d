"""The front door: the stages of the generator in order, each with its input and its output.

algorithm, method, increments
    | derive      exact formulas
Kernel
    | lower       straight-line code
Program
    | generate    source text
Sources
    | build       compiled, callable
Backend
    | simulate    against the truth
Run
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from strapgen import catalogue, targets

if TYPE_CHECKING:
    from strapgen.backends import Backend
    from strapgen.kernel import Kernel
    from strapgen.program import Program
    from strapgen.targets import Sources


def derive(
    algorithm: str, method: str | None = None, increments: int | None = None, *, rates: bool = False
) -> Kernel:
    """Derive an algorithm exactly.

    Parameters
    ----------
    algorithm : str
        An attitude algorithm ("dcm", "euler", "cayley-klein") or another kernel of the catalogue.
    method : str, optional
        Integration method, "rk1" to "rk4" (default), of an attitude algorithm.
    increments : int, optional
        Angle increments a step, 1 to 8 (default 2), of an attitude algorithm.
    rates : bool, optional
        Whether the step is given the body rate at every node of its method, times the step length, in place
        of increments.

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
    return catalogue.derive(catalogue.choose(algorithm, method, increments, rates))


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
    NotImplementedError
        If an expression holds a function that programs do not know.

    Examples
    --------
    >>> lower(derive("euler")).operations["divide"]
    0
    """
    from strapgen.lowering import lower as lower_kernel

    return lower_kernel(kernel)


def generate(program: Program, target: str) -> Sources:
    """Turn a program into source text.

    Parameters
    ----------
    program : Program
    target : str
        "numpy", "c" or "c-float".

    Returns
    -------
    Sources
        Text by file name, and the interface of the generated function.

    Raises
    ------
    InputError
        If the target is unknown.

    Examples
    --------
    >>> sorted(generate(lower(derive("euler")), "c").files)
    ['euler_rk4_2.c', 'euler_rk4_2.h']
    """
    return targets.emit(program, target)


def build(sources: Sources) -> Backend:
    """Turn the sources of an attitude step into a back end; C is compiled, once.

    Parameters
    ----------
    sources : Sources

    Returns
    -------
    Backend

    Raises
    ------
    InputError
        If the sources are of no attitude step.
    CompilerError
        If a C compiler is needed and there is none, or it fails.

    Examples
    --------
    >>> build(generate(lower(derive("euler")), "numpy")).name
    'numpy'
    """
    from strapgen.backends import build as build_backend

    return build_backend(sources)
