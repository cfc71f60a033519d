"""Renders the templates of targets, with the filters that they share."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.interfaces import Argument
from strapgen.ir.program import Program
from strapgen.ir.signals import Signal
from strapgen.storage import resources
from strapgen.targets import contract
from strapgen.targets.contract import elements_text, operations_text, range_text, run_paragraphs
from strapgen.targets.printer import Printer, fill, fill_arguments, fill_definition, fill_lines

if TYPE_CHECKING:
    import jinja2


#: First parameters of the loop over runs and steps, in every type of number.
PROPAGATE = ("size_t runs", "size_t steps", "size_t record_every", "size_t orthonormalize_every")


@cache
def environment(folder: Path | None = None) -> jinja2.Environment:
    """Return the environment of the templates in a folder, by default `templates/`."""
    import jinja2  # what only reads sources from the cache does without it

    shared = jinja2.Environment(
        loader=jinja2.FileSystemLoader(folder or resources.folder("templates")),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    shared.filters.update(
        fill=fill,
        arguments=fill_arguments,
        lines=fill_lines,
        range=range_text,
        elements=elements_text,
        operations=operations_text,
        argument_text=contract.argument_text,
        fixed_command=contract.command,
        defined=lambda definition: fill_definition(definition.name, definition.value, definition.meaning),
        run_paragraphs=run_paragraphs,
        residuals_text=contract.residuals_text,
        guards_text=contract.guards_text,
        json=partial(json.dumps, ensure_ascii=False),
    )
    return shared


def render(template: str, **values: Any) -> str:
    """Return a template of `templates/` filled with values."""
    return environment().get_template(template).render(**values)


def render_c(folder: str, name: str, **values: Any) -> dict[str, str]:
    """Return the files of a function in C: the function alone, then its loops over samples and runs."""
    files = {f"{name}.h": "header.h", f"{name}.c": "source.c"} | dict(
        zip(runs_of(name), ("runs.h", "runs.c"), strict=True)
    )
    return {file: render(f"{folder}/{template}.j2", name=name, **values) for file, template in files.items()}


def own_call(parameters: Iterable[str], function: str) -> dict[str, str]:
    """Return parameters under names that no kernel has, and a call with them, as C text.

    Loops call a function so, since one of their variables may have the function's name.
    """
    kinds = [parameter.rpartition(" ")[0] + " *" * parameter.endswith("]") for parameter in parameters]
    names = [f"a{number}_" for number in range(len(kinds))]
    declared = [
        f"{kind}{name}" if kind.endswith("*") else f"{kind} {name}"
        for kind, name in zip(kinds, names, strict=True)
    ]
    return {"parameters": ", ".join(declared), "call": f"{function}({', '.join(names)})"}


def runs_of(name: str) -> tuple[str, str]:
    """Return the names of the files with the loops of a function in C."""
    return f"{name}_runs.h", f"{name}_runs.c"


_IDENTITY = "the identity attitude"


@dataclass(frozen=True)
class Macro:
    """A name that a header defines."""

    name: str
    value: str  # C text
    meaning: str
    type: str = ""  # of C; "" for the floating-point type of the file
    size: int = 0  # that of an array; 0 for a number


def macros_of_fixed(
    fixed: FixedProgram, function: str, literal: Callable[..., str] | None = None
) -> list[Macro]:
    """Return the definitions of fixed-point code, whose integers `literal` prints, by default `word_literal`."""
    literal = literal or word_literal
    interface, bits, head = fixed.interface, fixed.word, function.upper()
    arguments = (*interface.inputs, *interface.outputs)
    names = _upper(argument.signal for argument in arguments)
    result = []
    for argument in arguments:
        name = f"{head}_{names[argument.signal.name]}"
        if argument.sensor is None:
            fraction = str(argument.format.fraction)
            result.append(Macro(f"{name}_FRACTION_BITS", fraction, f"{argument.format}", "int"))
        result.append(Macro(f"{name}_UNIT", _double(argument.unit), _unit(argument), "double"))
        result += _limits(name, argument, literal)
    step = fixed.program.attitude_step
    if step is not None:
        state = interface.inputs[0].format
        words = ", ".join(literal(state.nearest(x), bits) for x in step.identity)
        size, kind = len(step.identity), f"int{bits}_t"
        result.append(Macro(f"{head}_IDENTITY", f"{{{words}}}", _IDENTITY, kind, size))
    if interface.residuals:
        first = ", ".join(literal(feedback.fresh, bits, signed=False) for feedback in interface.residuals)
        meaning, size = "the residuals before the first call", len(interface.residuals)
        result.append(Macro(f"{head}_FIRST_RESIDUALS", f"{{{first}}}", meaning, f"uint{bits}_t", size))
    return result


def macros_of_program(program: Program, function: str, printer: Printer) -> list[Macro]:
    """Return the definitions of floating-point code."""
    step, head = program.attitude_step, function.upper()
    if step is None:
        return []
    numbers = ", ".join(printer.constant(x) for x in step.identity)
    return [Macro(f"{head}_IDENTITY", f"{{{numbers}}}", _IDENTITY, size=len(step.identity))]


def word_literal(value: int, bits: int, signed: bool = True) -> str:
    """Return an integer as a constant of C that has at least so many bits on every machine.

    >>> word_literal(-5, 16), word_literal(-(2**31), 32)
    ('-INT16_C(5)', '(-INT32_C(2147483647) - 1)')
    """
    if not signed:
        return f"UINT{bits}_C({value})"
    if not value:
        return "0"
    if value == -(1 << (bits - 1)):
        return f"(-INT{bits}_C({-value - 1}) - 1)"
    return f"{'-' if value < 0 else ''}INT{bits}_C({abs(value)})"


def _limits(name: str, argument: Argument, literal: Callable[..., str]) -> list[Macro]:
    """Return the range of the integers of an argument: one limit where it is symmetric."""
    limits = [("LOW", argument.low, "smallest integer"), ("HIGH", argument.high, "largest integer")]
    if argument.low == -argument.high:
        limits = [("LIMIT", argument.high, "largest magnitude")]
    bits = argument.format.word
    return [Macro(f"{name}_{end}", literal(n, bits), what, f"int{bits}_t") for end, n, what in limits]


def _upper(signals: Iterable[Signal]) -> dict[str, str]:
    """Return names in capital letters where these differ, for each signal by its name."""
    names = [signal.name for signal in signals]
    counts = Counter(name.upper() for name in names)
    return {name: name if counts[name.upper()] > 1 else name.upper() for name in names}


def _unit(argument: Argument) -> str:
    if argument.sensor is not None:
        return f"rad: a count of the gyro, {argument.sensor.unit}"
    unit = "" if argument.signal.unit == "1" else f" {argument.signal.unit}"
    return f"2^{-argument.format.fraction}{unit}"


def _double(value: Fraction) -> str:
    """Return the shortest literal that reads as the double nearest to a number."""
    text = repr(float(value))
    return text if "." in text or "e" in text else f"{text}.0"
