"""The fixed-model target: a Python module on integers, the reference for the fixed-point C."""

from __future__ import annotations

from collections.abc import Mapping

from strapgen.ir.integer_program import (
    FixedProgram,
    IntegerMaximum,
    IntegerQuotient,
    IntegerRoot,
    IntegerSelection,
    IntegerSum,
    Scaled,
    Term,
    Value,
)
from strapgen.ir.sources import Function, Sources
from strapgen.targets.names import PYTHON, printed
from strapgen.targets.rendering import render


def emit(fixed: FixedProgram, target: str) -> Sources:
    """Print a Python module for a program.

    Parameters
    ----------
    fixed : FixedProgram
    target : str
        "fixed-model".

    Returns
    -------
    Sources
        One file. The function ``<name>`` takes and returns integers, or arrays of them.
    """
    interface = fixed.interface
    named, files = printed(fixed, _files, PYTHON)
    function = Function(
        named.name,
        tuple(argument.signal for argument in interface.inputs),
        tuple(argument.signal for argument in interface.outputs),
    )
    return Sources(
        fixed.program.kernel,
        target,
        files,
        function,
        fixed.operations,
        fixed.temporaries,
        fixed.program.companions,
        interface,
        fixed.program.recursion,
    )


def _files(fixed: FixedProgram, other: Mapping[str, str]) -> dict[str, str]:
    """Return the module of a program whose names are as they are printed; what it says has their other names."""
    interface = fixed.interface
    text = render(
        "integer_model/module.py.j2",
        fixed=fixed,
        program=fixed.program,
        interface=interface,
        other=other,
        statements=[statement for value in fixed.body for statement in _statements(value, fixed, other)],
        nearest=interface.settings.rounding == "nearest",
        fresh=[_fresh(residual.name) for residual in interface.residuals],
    )
    return {f"{fixed.name}.py": text}


def _fresh(name: str) -> str:
    return f"next_{name}"


def _statements(value: Value, fixed: FixedProgram, other: Mapping[str, str]) -> list[str]:
    """Return the lines that compute a value and check it on the way."""
    name, definition = value.name, value.definition
    said = other.get(name, name)
    lines = [f"# {value.meaning}"] if value.meaning else []
    if isinstance(definition, IntegerSum):
        lines += _sum(value, definition, fixed, said)
    else:
        if isinstance(definition, IntegerQuotient):
            text = f"_quotient({_scaled(definition.numerator)}, {definition.denominator})"
        elif isinstance(definition, IntegerRoot):
            text = f"_root({_scaled(definition.argument)})"
        elif isinstance(definition, IntegerMaximum):
            text = _scaled(definition.arguments[0])
            for argument in definition.arguments[1:]:
                text = f"_larger({text}, {_scaled(argument)})"
        else:
            assert isinstance(definition, IntegerSelection)
            text = _scaled(definition.otherwise)
            for left, right, chosen in reversed(definition.cases):
                text = f"_chosen({_scaled(left)} >= {_scaled(right)}, {_scaled(chosen)}, {text})"
        lines.append(f"{name} = {text}")
    check = "_require" if value.guarded else "_within"
    lines.append(f'{check}("{said}", {name}, {value.low}, {value.high})')
    return lines


def _sum(value: Value, definition: IntegerSum, fixed: FixedProgram, said: str) -> list[str]:
    name = value.name
    fine = [_term(term) for term in definition.fine]
    coarse = [_term(term) for term in definition.coarse]
    if not definition.shift:
        return [f'{name} = _total("{said}", {value.peak}, {", ".join([*coarse, *fine]) or 0})']
    residual, lines = definition.residual, []
    if residual is not None and definition.drop:
        lines.append(f'{name}_kept = _total("{said}", {value.peak}, {", ".join(fine)}) >> {definition.drop}')
        fine = [f"{name}_kept"]
    if residual is not None:
        fine.append(_shifted(residual.name, residual.shift))
    elif fixed.interface.settings.rounding == "nearest":
        fine.append(str(1 << (definition.shift - 1)))
    lines.append(f'{name}_sum = _total("{said}", {value.peak}, {", ".join(fine)})')
    if residual is not None:
        mask = (1 << fixed.word) - 1
        lines.append(f"{_fresh(residual.name)} = {_shifted(f'{name}_sum', -residual.shift)} & {mask}")
    rounded = _shifted(f"{name}_sum", -definition.shift)
    lines.append(f'{name} = _total("{said}", {value.peak}, {", ".join([rounded, *coarse])})')
    return lines


def _shifted(text: str, shift: int) -> str:
    if not shift:
        return text
    return f"({text} << {shift})" if shift > 0 else f"({text} >> {-shift})"


def _scaled(scaled: Scaled) -> str:
    if isinstance(scaled.value, int):
        return str(scaled.value << scaled.shift if scaled.shift > 0 else scaled.value)
    return _shifted(scaled.value, scaled.shift)


def _term(term: Term) -> str:
    if not term.names:
        return str(term.factor << term.shift if term.shift > 0 else term.factor)
    factor = [] if abs(term.factor) == 1 else [str(abs(term.factor))]
    text = " * ".join([*term.names, *factor])
    if term.factor < 0:
        text = f"-{text}"
    return _shifted(f"({text})" if not text.isidentifier() else text, term.shift)
