"""`quantize` turns a program into integer code with proved ranges and certified error bounds."""

from contextlib import suppress
from dataclasses import replace

from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import ROTATION_INPUTS, Settings
from strapgen.ir.formats import Format
from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.interfaces import Interface
from strapgen.ir.program import Operation, Program, walk

__all__ = ["OPERATIONS", "FixedProgram", "Format", "Interface", "Settings", "can_lower", "quantize"]


def quantize(program: Program, settings: Settings) -> FixedProgram:
    """Lower a program to integers."""
    from strapgen.fixedpoint.bounded_series import without_roots
    from strapgen.fixedpoint.quantization import finished, planned
    from strapgen.fixedpoint.sensor_scale import counted, in_counts

    if any(signal.constraint == "covariance" for signal in program.inputs):
        raise InputError(
            f"{program.kernel} holds a covariance, which is computed in floating point alone; velocity-position and an "
            "attitude step of the same method have the rest in fixed point"
        )
    if settings.input_bits is not None and not counted(program):
        what = "an lsb" if settings.sensor is not None else "a number of input bits"
        raise InputError(f"{program.kernel} takes no increments; {what} does not go with it")
    counts = program if settings.sensor is None else in_counts(program, settings.sensor)
    try:
        series = without_roots(counts, settings)
        one = planned(counts, settings)
        if series is not counts:
            with suppress(InputError):  # a word is too short for it
                other = planned(series, settings)
                bounds = other.fixed.error_bounds
                if all(bounds[name] <= error for name, error in one.fixed.error_bounds.items()):
                    return replace(finished(other), program=program)
        return replace(finished(one), program=program)
    except InputError:
        raise
    except (ValueError, ArithmeticError) as error:  # a proof fails, as where a divisor may be zero
        raise InputError(f"{program.kernel} has no fixed point: {error}") from error


#: Operations that fixed point has.
OPERATIONS = frozenset(
    (
        *("add", "subtract", "multiply", "divide", "negate", "sqrt", "maximum", "select", "at_least"),
        *("sin", "cos", "sinc", "atan2", "direction", "wrap"),
    )
)


def can_lower(program: Program) -> bool:
    """Return whether a program can be lowered as it is: its operations exist here, and its inputs have known ranges."""
    nodes = (node for assignment in program.body for node in walk(assignment.value))
    return all(
        signal.bound is not None or signal.name in ROTATION_INPUTS for signal in program.inputs
    ) and all(node.kind in OPERATIONS for node in nodes if isinstance(node, Operation))
