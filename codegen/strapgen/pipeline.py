"""The compiler on one page. `compile` calls the stages in order, and no other module composes them.

choice --derive--> Kernel --lower--> Program --quantize--> FixedProgram --generate--> Sources

What `compile`, `fixed_program` and `program` return is cached. A second use loads neither SymPy nor Jinja, another
target or other settings of a kernel derive nothing again, and the integer model has the integers of the C.

The formulas of a kernel are exact. A program is straight-line code; fixed point alone quantizes it, to integers with
proved ranges and error bounds. `strapgen.build` makes a back end of the sources, `strapgen.simulate` tests it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from strapgen import catalogue, targets
from strapgen.catalogue import AnyAlgorithm, Choice, named
from strapgen.ir import checks
from strapgen.ir.checks import some
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Sources
from strapgen.ir.timing import timed
from strapgen.storage.cache import cached
from strapgen.targets.naming import UNNAMED, Naming

if TYPE_CHECKING:
    from pathlib import Path

    from strapgen.catalogue.choice import AnyMethod
    from strapgen.ir.integer_program import FixedProgram
    from strapgen.ir.kernel_info import Description
    from strapgen.ir.program import Program
    from strapgen.kernel.kernel import Kernel

_DEFAULTS = Settings()


def _target_code(target: str, settings: Settings | None, naming: Naming) -> str:
    """Refuse a target that does not go with the settings or the name; return a hash of an installed one's code."""
    _require_target(target, settings)
    if naming.option and not targets.TARGETS[target].nameable:
        raise InputError(f"{naming.option} goes with targets in C, C++, Rust and MATLAB, not with {target}")
    return targets.TARGETS.code(target)


@cached("sources", "sources of {0.kernel} for {1}", depends=_target_code)
def compile(
    choice: Choice, target: str, settings: Settings | None = None, naming: Naming = UNNAMED
) -> Sources:
    """Compile a choice for a target; a user may name the functions of its code."""
    if targets.TARGETS[target].fixed:
        chosen = (settings or _DEFAULTS).for_program(choice.increments, choice.kernel)
        return generate(naming.of(fixed_program(choice, chosen)), target)
    return generate(naming.of(declared(program(choice), target, settings)), target)


def declared(program: Program, target: str, settings: Settings | None) -> Program:
    """Return a program for a target in floating point, with the ranges and the sums that settings declare."""
    if settings is None:
        return program
    if settings.states_ranges:
        from strapgen.fixedpoint.bounded_series import with_declared_ranges

        program = with_declared_ranges(program, settings, targets.TARGETS[target].number or "double")
    if settings.sums == "tree":
        from strapgen.lowering.tree_sums import with_tree_sums

        program = with_tree_sums(program)
    return program


@cached("fixed-programs", "integers of {0.kernel}")
def fixed_program(choice: Choice, settings: Settings = _DEFAULTS) -> FixedProgram:
    """Return the program of a choice in integers, which all targets of fixed point share."""
    return quantize(program(choice), settings)


@cached("programs", "program of {0.kernel}")
def program(choice: Choice) -> Program:
    """Return the program of a choice, which all targets share."""
    return lower(catalogue.derive(choice))


def derive(
    algorithm: AnyAlgorithm,
    method: AnyMethod | None = None,
    increments: int | None = None,
    *,
    rates: bool = False,
    previous: int | None = None,
    ahead: int | None = None,
    constants: Mapping[str, Any] | None = None,
    layout: str | Path | Description | None = None,
) -> Kernel:
    """Derive an algorithm exactly.

    Parameters
    ----------
    algorithm : str, path, Choice or AttitudeAlgorithm
        An attitude algorithm ("dcm", "euler", "cayley-klein") or another kernel that ``strapgen list`` shows; a Python
        file; or what `strapgen.algorithm` or `strapgen.choose` returned, with which the other parameters do not go.
    method : str, Tableau, Window or ShapedConing, optional
        Integration method of an attitude algorithm, by name, as a tableau or as a window; by default "rk4".
    increments : int, optional
        Angle increments a step, 1 to 8 (default 2), of an attitude algorithm.
    rates : bool, optional
        Whether the step takes the body rate at every node of its method, times the step length, in place of increments.
    previous, ahead : int, optional
        Increments from before the step and from after it that it takes too, together at most 32 (default 0).
    constants : mapping of str to number, or to an array or nested sequence of numbers, optional
        Values of inputs of a kernel that is no attitude algorithm, in their units and row by row, by name. These are
        then no inputs; what is multiplied by zero vanishes.
    layout : path or Description, optional
        Of the kernels "separate" and "torques": the TOML file that describes the three gyros; of "magnetic-field": the
        file of its coefficients; of "filter": the TOML file of its sections.

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
    >>> derive("temperature-coefficient", constants={"slope_above": 0.5, "slope_below": "1/2"}).outputs[0].expressions
    (difference/2 + nominal,)
    """
    name = named("derive", algorithm)
    return catalogue.derive(
        catalogue.choose(name, method, increments, rates, previous, ahead, constants, layout)
    )


def lower(kernel: Kernel) -> Program:
    """Turn a kernel into straight-line code with the fewest operations that are known for it.

    Raises
    ------
    InputTypeError
        If it is no kernel; the message names the stage that is missing. So do all stages.
    InputError
        If it holds unknowns.
    NotImplementedError
        If an expression holds a function that programs do not know.

    Examples
    --------
    >>> lower(derive("euler")).operations["divide"]
    0
    """
    from strapgen import lowering  # loads SymPy, as only deriving and lowering do
    from strapgen.kernel.kernel import Kernel

    checks.require("lower", kernel, Kernel)
    kernel.require_known()
    with timed("lower", kernel.name):
        return lowering.lower(kernel)


def quantize(program: Program, settings: Settings | None = None) -> FixedProgram:
    """Lower a program to integers: formats from proved ranges, an error bound for every value.

    Parameters
    ----------
    program : Program
    settings : Settings, optional
        Word, largest increment, rounding and what else a user states; by default 32 bits and 1/8 rad.

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
    from strapgen import fixedpoint
    from strapgen.ir.program import Program

    checks.require("quantize", program, Program)
    _require_settings(settings)
    with timed("quantize", program.kernel):
        chosen = (settings or _DEFAULTS).for_program(program.increments_per_step, program.kernel)
        if chosen.sums != _DEFAULTS.sums:
            raise InputError(
                f"sums {chosen.sums} goes with targets in floating point; sums in fixed point are exact"
            )
        return fixedpoint.quantize(program, chosen)


def generate(program: Program | FixedProgram, target: str, settings: Settings | None = None) -> Sources:
    """Turn a program into source text; for a fixed-point target a `Program` is quantized first.

    In floating point, settings may state ranges and the order of sums alone: bounds are those of the ranges and of the
    order, and series take the place of the root, the cosine and the sine of a length whose range they bound.

    Parameters
    ----------
    program : Program or FixedProgram
    target : str
        A key of `strapgen.TARGETS`: one that ``strapgen list`` shows, of an installed package too.
    settings : Settings, optional
        Word, ranges and rounding for a `Program` and a fixed-point target; ranges and sums alone for one in floating
        point.

    Raises
    ------
    InputError
        If the target is unknown, or does not go with the program or the settings.

    Examples
    --------
    >>> sorted(generate(lower(derive("euler")), "c").step_files)
    ['euler_rk4_2.c', 'euler_rk4_2.h']
    """
    from strapgen.ir.integer_program import FixedProgram
    from strapgen.ir.program import Program

    checks.require("generate", program, Program, FixedProgram)
    _require_target(target, settings)
    if isinstance(program, Program) and targets.TARGETS[target].fixed:
        program = quantize(program, settings)
    elif isinstance(program, Program):
        program = declared(program, target, settings)
    elif settings is not None:
        kernel = program.program.kernel
        raise InputError(f"the program of {kernel} is quantized already; settings do not go with it")
    kernel = program.kernel if isinstance(program, Program) else program.program.kernel
    with timed("generate", f"{kernel} for {target}"):
        return targets.emit(program, target)


def _require_target(target: Any, settings: Any) -> None:
    if not isinstance(target, str):
        names = some(targets.TARGETS)
        raise InputTypeError(f"target is {checks.describe(target)}; a name is needed: {names}")
    _require_settings(settings)
    known = target in targets.TARGETS
    declares = known and settings is not None and settings.only_ranges and not targets.TARGETS[target].fixed
    targets.require(target, None if declares else settings)


def _require_settings(settings: Any) -> None:
    if settings is not None and not isinstance(settings, Settings):
        raise InputTypeError(f"settings is {checks.describe(settings)}; strapgen.Settings is needed")
