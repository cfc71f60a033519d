"""The gate turns SymPy expressions into the nodes of a program; SymPy goes no further.

Common subexpressions of a kernel are named across all its stages and outputs. A sum ends with its constant, so that the
constant is rounded once. Terms with the same coefficient are summed before they are multiplied by it, and negative
terms are subtracted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import count

import sympy as sp
from sympy.core.relational import GreaterThan, LessThan, StrictGreaterThan, StrictLessThan

from strapgen.ir.program import Assignment, Constant, Node, Operation, Program, Reference, Result
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import Direction, Wrapped
from strapgen.kernel.kernel import Kernel
from strapgen.lowering.trees import FACTOR, SHARED, chain, gathered, plain, with_constant

_FUNCTIONS = {
    sp.sin: "sin",
    sp.cos: "cos",
    sp.sinc: "sinc",
    sp.atan2: "atan2",
    Wrapped: "wrap",
    Direction: "direction",
}


def gate(kernel: Kernel, common: bool = True) -> Program:
    """Return the program of a kernel from its formulas, whose `common` subexpressions are named if it is true."""
    definitions, values = share(kernel, common)
    reserved = {name for signal in kernel.signals for name in signal.elements}
    writer = _Writer(reserved | {definition.symbol.name for definition in definitions})
    for definition in definitions:
        value = writer.node(definition.expression)
        writer.body.append(Assignment(definition.symbol.name, value, definition.meaning))

    def result(signal: Signal) -> Result:
        symbols = (sp.Symbol(name, real=True) for name in signal.elements)
        return Result(signal, tuple(writer.node(values.get(s, s)) for s in symbols))

    stages = {stage.signal.name: stage.signal for stage in kernel.stages}
    return Program(
        info=replace(kernel.info, arguments=kernel.arguments or kernel.name),
        inputs=kernel.inputs,
        body=tuple(writer.body),
        outputs=tuple(result(stage.signal) for stage in kernel.outputs),
        transition=None if kernel.transition is None else result(stages[kernel.transition]),
    )


class _Writer:
    """Turns expressions into nodes; it adds a temporary where a power or an inverse function needs a value twice."""

    def __init__(self, reserved: set[str]) -> None:
        self.body: list[Assignment] = []
        self._powers = (name for k in count(1) if (name := f"{FACTOR}{k}") not in reserved)

    def node(self, expression: sp.Expr) -> Node:
        if expression.is_Symbol:
            return Reference(expression.name)
        if expression.is_Rational:
            return Constant(Fraction(int(expression.p), int(expression.q)))
        if expression.is_Add:
            return self._sum(expression)
        if expression.is_Mul:
            return self._product(expression)
        if expression.is_Pow:
            return self._power(expression.base, expression.exp)
        if isinstance(expression, sp.Max):
            first, *rest = (self.node(a) for a in sorted(expression.args, key=sp.default_sort_key))
            for argument in rest:
                first = Operation("maximum", (first, argument))
            return first
        if isinstance(expression, sp.Abs):
            value = self._named(self.node(expression.args[0]))
            return Operation("maximum", (value, Operation("negate", (value,))))
        if isinstance(expression, sp.Piecewise):
            return self._choice(list(expression.args))
        if expression.func in (sp.asin, sp.acos):
            return self._inverse(expression)
        if expression.func in _FUNCTIONS:
            return Operation(_FUNCTIONS[expression.func], tuple(self.node(a) for a in expression.args))
        raise NotImplementedError(f"no operation for {expression.func.__name__} in {expression}")

    def _sum(self, expression: sp.Add) -> Node:
        terms: list[tuple[Fraction, Node]] = []
        constant = Fraction(0)
        for term in sorted(expression.args, key=sp.default_sort_key):
            coefficient, rest = term.as_coeff_Mul(rational=True)
            value = Fraction(int(coefficient.p), int(coefficient.q))
            if rest == 1:
                constant += value
            else:
                terms.append((value, self.node(rest)))
        return plain(with_constant(gathered(terms), constant))

    def _product(self, expression: sp.Mul) -> Node:
        coefficient, rest = expression.as_coeff_Mul(rational=True)
        value = Fraction(int(coefficient.p), int(coefficient.q))
        above: list[Node] = []
        below: list[Node] = []
        for factor in sorted(sp.Mul.make_args(rest), key=sp.default_sort_key):
            if factor.is_Pow and factor.exp.is_negative:
                below.append(self._power(factor.base, -factor.exp))
            else:
                above.append(self.node(factor))
        if abs(value) != 1 or not above:
            above.insert(0, Constant(abs(value)))
        result = chain("multiply", above)
        if below:
            result = Operation("divide", (result, chain("multiply", below)))
        return Operation("negate", (result,)) if value < 0 else result

    def _power(self, base: sp.Expr, exponent: sp.Expr) -> Node:
        if exponent.is_negative:
            return Operation("divide", (Constant(Fraction(1)), self._power(base, -exponent)))
        if exponent == sp.Rational(1, 2):
            return Operation("sqrt", (self.node(base),))
        if not exponent.is_Integer:
            raise NotImplementedError(f"no operation for the power {exponent} of {base}")
        return self._power_by_squaring(self._named(self.node(base)), int(exponent))

    def _inverse(self, expression: sp.Expr) -> Node:
        """Write an arcsine or arccosine with atan2, which stays accurate near 1 and -1 and defined just beyond."""
        value, one = self._named(self.node(expression.args[0])), Constant(Fraction(1))
        # Two roots: multiplied out, 1 - x^2 would lose its digits where x is near 1.
        sides = (Operation(kind, (one, value)) for kind in ("subtract", "add"))
        zero = Constant(Fraction(0))
        roots = tuple(Operation("sqrt", (Operation("maximum", (zero, side)),)) for side in sides)
        other = Operation("multiply", roots)
        return Operation("atan2", (value, other) if expression.func is sp.asin else (other, value))

    def _power_by_squaring(self, base: Node, exponent: int) -> Node:
        """Return a whole power by repeated squaring."""
        if exponent == 1:
            return base
        if exponent % 2:
            return Operation("multiply", (self._power_by_squaring(base, exponent - 1), base))
        half = self._named(self._power_by_squaring(base, exponent // 2))
        return Operation("multiply", (half, half))

    def _named(self, node: Node) -> Node:
        if not isinstance(node, Operation):
            return node
        for assignment in self.body:
            if assignment.value == node:
                return Reference(assignment.name)
        name = next(self._powers)
        self.body.append(Assignment(name, node))
        return Reference(name)

    def _choice(self, pieces: list[tuple[sp.Expr, sp.Basic]]) -> Node:
        value, condition = pieces[0]
        if condition == sp.true:
            return self.node(value)
        yes, no = self.node(value), self._choice(pieces[1:])
        if isinstance(condition, (GreaterThan, LessThan)):
            test = Operation("at_least", (self.node(condition.gts), self.node(condition.lts)))
        elif isinstance(condition, (StrictGreaterThan, StrictLessThan)):
            test = Operation("at_least", (self.node(condition.lts), self.node(condition.gts)))
            yes, no = no, yes
        else:
            raise NotImplementedError(f"no operation for the condition {condition}")
        return Operation("select", (test, yes, no))


@dataclass(frozen=True)
class _Definition:
    """One line of a computation: ``symbol = expression``."""

    symbol: sp.Symbol
    expression: sp.Expr
    meaning: str = ""


def share(kernel: Kernel, common: bool = True) -> tuple[list[_Definition], dict[sp.Symbol, sp.Expr]]:
    """Name the common subexpressions of a kernel, unless its formulas shall stay as they are.

    Returns the definitions of stages, outputs and common subexpressions, each before its first use, and the elements
    that need none: they are numbers, or other symbols, inside the kernel possibly negated.

    Elements are visited in the order of their names, so that two kernels that differ only in the order in
    which they store a state get the same arithmetic.
    """
    values: dict[sp.Symbol, sp.Expr] = {}
    definitions: list[_Definition] = []
    for stage in (*kernel.stages, *kernel.outputs):
        meaning = stage.signal.meaning
        result = stage in kernel.outputs or stage.signal.name == kernel.transition
        for name, expression in sorted(zip(stage.signal.elements, stage.expressions, strict=True)):
            symbol, expression = sp.Symbol(name, real=True), expression.xreplace(values)
            if expression.is_Symbol or expression.is_Rational or (not result and (-expression).is_Symbol):
                values[symbol] = expression
            else:
                definitions.append(_Definition(symbol, expression, meaning))
                meaning = ""
    if not common:
        return definitions, values
    elements = (name for signal in kernel.signals for name in signal.elements)
    excluded = [sp.Symbol(name, real=True) for name in elements]
    names = sp.numbered_symbols(SHARED, start=1, exclude=excluded, real=True)
    common_parts, reduced = sp.cse([d.expression for d in definitions], symbols=names, order="canonical")
    # A program cannot assign a condition to a name, so each condition goes back to where it is used.
    conditions = {symbol: expression for symbol, expression in common_parts if expression.is_Relational}
    pending = {s: e.xreplace(conditions) for s, e in common_parts if s not in conditions}
    reduced = [expression.xreplace(conditions) for expression in reduced]
    ordered: list[_Definition] = []

    def needed(expression: sp.Expr) -> Iterator[_Definition]:
        for symbol in sorted(
            expression.free_symbols & pending.keys(), key=lambda s: int(s.name[len(SHARED) :])
        ):
            if symbol in pending:
                definition = pending.pop(symbol)
                yield from needed(definition)
                yield _Definition(symbol, definition)

    for definition, expression in zip(definitions, reduced, strict=True):
        ordered.extend(needed(expression))
        ordered.append(_Definition(definition.symbol, expression, definition.meaning))
    return ordered, values
