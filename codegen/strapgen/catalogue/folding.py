"""Constants folded into a kernel: inputs with known values become numbers in its formulas."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import sympy as sp

from strapgen.catalogue.choice import Constants, constant_options, number_text
from strapgen.ir.checks import counted, needed, unknown
from strapgen.ir.exceptions import InputError
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import exact
from strapgen.kernel.kernel import Kernel, Stage

#: Parts of an expression without a real value.
_UNDEFINED = (sp.nan, sp.zoo, sp.oo, -sp.oo, sp.I)


def fold(kernel: Kernel, constants: Constants) -> Kernel:
    """Return a kernel with constants in place of inputs, stated in its arguments and notes; products with 0 vanish.

    >>> from fractions import Fraction
    >>> from strapgen.catalogue import Choice, derive
    >>> kernel = fold(derive(Choice("temperature-coefficient")), (("difference", (Fraction(2),)),))
    >>> [signal.name for signal in kernel.inputs], kernel.expand()["coefficient"]
    (['nominal', 'slope_above', 'slope_below'], [nominal + 2*slope_above])
    """
    if not constants:
        return kernel
    signals = _check(kernel, constants)
    values = {
        sp.Symbol(name, real=True): exact(number)
        for name, numbers in constants
        for name, number in zip(signals[name].elements, numbers, strict=True)
    }
    stages = _fold_stages(kernel.name, kernel.stages, values)
    outputs = _fold_stages(kernel.name, kernel.outputs, values)
    transition = next((stage for stage in stages if stage.signal.name == kernel.transition), None)
    if transition is not None and not any(expression.free_symbols for expression in transition.expressions):
        transition = None
    stages = tuple(
        stage
        for stage in stages
        if stage is transition or not all(expression.is_Rational for expression in stage.expressions)
    )
    return replace(
        kernel,
        inputs=tuple(signal for signal in kernel.inputs if signal.name not in signals),
        stages=stages,
        outputs=outputs,
        transition=None if transition is None else kernel.transition,
        arguments=f"{kernel.arguments or kernel.name} {constant_options(constants)}",
        notes=(*kernel.notes, _note(signals, constants)),
    )


def _check(kernel: Kernel, constants: Constants) -> dict[str, Signal]:
    """Return by name the inputs that become constants."""
    states = [name for name, _ in kernel.recursion.states] if kernel.recursion else []
    signals = {signal.name: signal for signal in kernel.inputs}
    allowed = [name for name in signals if name not in states]
    for name, numbers in constants:
        if name in states:
            raise InputError(
                f"kernel {kernel.name}: {name} is a state, which each call changes, and no constant; "
                f"allowed: {', '.join(allowed)}"
            )
        if name not in signals:
            raise InputError(f"kernel {kernel.name}: {unknown('constant', name, allowed)}")
        signal = signals[name]
        if len(numbers) != signal.size:
            raise InputError(
                f"kernel {kernel.name}: constant {name} has {counted(len(numbers), 'number')}; {needed(signal.size)}: "
                f"{', '.join(signal.elements)}"
            )
    if len(constants) == len(signals):
        raise InputError(f"kernel {kernel.name}: all inputs are constants; at least one must not be")
    return {name: signals[name] for name, _ in constants}


def _fold_stages(name: str, stages: tuple[Stage, ...], values: dict[sp.Symbol, sp.Expr]) -> tuple[Stage, ...]:
    """Return stages with the values of symbols; elements that are numbers then join the values."""
    folded = []
    for stage in stages:
        expressions = tuple(expression.xreplace(values) for expression in stage.expressions)
        for element, expression in zip(stage.signal.elements, expressions, strict=True):
            if expression.has(*_UNDEFINED):
                raise InputError(f"kernel {name}: {element} has no value with these constants")
            if expression.is_Rational:
                values[sp.Symbol(element, real=True)] = expression
        folded.append(replace(stage, expressions=expressions))
    return tuple(folded)


def _note(signals: Mapping[str, Signal], constants: Constants) -> str:
    parts = []
    for name, numbers in constants:
        unit = "" if signals[name].unit == "1" else f" {signals[name].unit}"
        parts.append(f"{name} = {', '.join(map(number_text, numbers))}{unit}")
    return f"Constants in place of inputs: {'; '.join(parts)}."
