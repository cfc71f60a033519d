"""The fixed-model target prints a Python module on integers, which is the reference for the fixed-point C."""

from __future__ import annotations

from collections.abc import Mapping

from strapgen.ir.integer_program import (
    FixedProgram,
    IntegerOperation,
    IntegerSum,
    Scaled,
    Term,
    Value,
    cases_of,
)
from strapgen.ir.sources import Sources
from strapgen.targets.names import PYTHON, printed
from strapgen.targets.rendering import render


def emit(fixed: FixedProgram, target: str) -> Sources:
    """Print a module whose function takes and returns integers, or arrays of them."""
    named, files = printed(fixed, lambda part, other: _files(part, other, target), PYTHON)
    return Sources.of(fixed, target, named.name, files)


def _files(fixed: FixedProgram, other: Mapping[str, str], target: str) -> dict[str, str]:
    """Return the module of a program with its printed names; messages show the names of `other`."""
    interface = fixed.interface
    text = render(
        "integer_model/module.py.j2",
        fixed=fixed,
        target=target,
        program=fixed.program,
        interface=interface,
        other=other,
        statements=[statement for value in fixed.body for statement in _statements(value, fixed, other)],
        nearest=interface.settings.rounding == "nearest",
        fresh=[_fresh(feedback.name) for feedback in interface.residuals],
    )
    return {f"{fixed.name}.py": text}


def _fresh(name: str) -> str:
    return f"next_{name}"


def _statements(value: Value, fixed: FixedProgram, other: Mapping[str, str]) -> list[str]:
    """Return the lines that compute a value and check it on the way."""
    name, definition = value.name, value.definition
    label = other.get(name, name)
    lines = [f"# {value.meaning}"] if value.meaning else []
    if isinstance(definition, IntegerSum):
        lines += _sum(value, definition, fixed, label)
    elif definition is not None:
        lines.append(f"{name} = {_expression(definition)}")
    if value.saturated:
        lines.append(f"{name} = _saturated({name}, {value.low}, {value.high})")
    check = "_require" if value.range_checked else "_within"
    lines.append(f'{check}("{label}", {name}, {value.low}, {value.high})')
    return lines


def _expression(operation: IntegerOperation) -> str:
    """Return a quotient, a root, a maximum or a selection as an expression."""
    first, *others = arguments = [_scale(argument) for argument in operation.arguments]
    match operation.kind:
        case "divide":
            return f"_quotient({', '.join(arguments)})"
        case "sqrt":
            return f"_root({first})"
        case "maximum":
            text = first
            for argument in others:
                text = f"_larger({text}, {argument})"
            return text
        case "select":
            text = arguments[-1]
            for left, right, result in reversed(cases_of(arguments)):
                text = f"_chosen({left} >= {right}, {result}, {text})"
            return text
    raise ValueError(f"{operation.kind} is no operation on integers")


def _sum(value: Value, definition: IntegerSum, fixed: FixedProgram, label: str) -> list[str]:
    name = value.name
    fine = [_term(term) for term in definition.fine]
    coarse = [_term(term) for term in definition.coarse]
    if not definition.shift:
        return [f'{name} = _total("{label}", {value.peak}, {", ".join([*coarse, *fine]) or 0})']
    feedback, lines = definition.residual, []
    if feedback is not None and definition.drop:
        lines.append(f'{name}_kept = _total("{label}", {value.peak}, {", ".join(fine)}) >> {definition.drop}')
        fine = [f"{name}_kept"]
    if definition.halves:
        (term,) = definition.fine
        factors = [*term.names, *[str(term.factor)] * (len(term.names) == 1)]
        return [f"{name} = _half({', '.join(factors)})"]
    if feedback is not None:
        fine.append(_shift(feedback.name, feedback.shift))
    elif half := definition.half(fixed.interface.settings.rounding):
        fine.append(str(half))
    lines.append(f'{name}_sum = _total("{label}", {value.peak}, {", ".join(fine)})')
    if feedback is not None:
        mask = (1 << fixed.word) - 1
        lines.append(f"{_fresh(feedback.name)} = {_shift(f'{name}_sum', -feedback.shift)} & {mask}")
    rounded = _shift(f"{name}_sum", -definition.shift)
    lines.append(f'{name} = _total("{label}", {value.peak}, {", ".join([rounded, *coarse])})')
    return lines


def _shift(text: str, shift: int) -> str:
    if not shift:
        return text
    return f"({text} << {shift})" if shift > 0 else f"({text} >> {-shift})"


def _scale(scaled: Scaled) -> str:
    if isinstance(scaled.value, int):
        return str(scaled.value << scaled.shift if scaled.shift > 0 else scaled.value)
    return _shift(scaled.value, scaled.shift)


def _term(term: Term) -> str:
    if not term.names:
        return str(term.factor << term.shift if term.shift > 0 else term.factor)
    factor = [] if abs(term.factor) == 1 else [str(abs(term.factor))]
    text = " * ".join([*term.names, *factor])
    if term.factor < 0:
        text = f"-{text}"
    return _shift(f"({text})" if not text.isidentifier() else text, term.shift)
