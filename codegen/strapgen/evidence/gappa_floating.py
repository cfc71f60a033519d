"""Writes a call in floating point as a script for Gappa: every operation of the C rounded, beside the exact one.

The operations are numbered in the order of the C: ``c_3`` is the computed value of the third and ``e_3`` its exact one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from fractions import Fraction

from strapgen.evidence.gappa_scripts import SIGNS, CannotFollowError, Script, number, product, total
from strapgen.fixedpoint.floating.expressions import CONSTANT, INPUT, Expression, Expressions
from strapgen.fixedpoint.floating.number_formats import NUMBERS
from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.quantities import is_power_of_two
from strapgen.ir.interfaces import RoundingBounds
from strapgen.ir.program import RESOLUTION, Program
from strapgen.kernel import polynomials

#: Gappa's names of the types.
_FORMATS = {"double": "float<ieee_64,ne>", "float": "float<ieee_32,ne>"}
#: Degrees up to which operations are expanded in the inputs for their ranges: of the second, proofs take long.
DEGREES = (2, 3)
#: Terms that this may take.
_MOST_TERMS = 60
#: A range that is smaller by less does not count.
_SMALLER = 1 + Fraction(1, 1000)


def floating_script(program: Program, rounding: RoundingBounds, degree: int = DEGREES[0]) -> Script:
    """Return the script of one call of a program in floating point."""
    if not rounding.errors:
        raise CannotFollowError(f"the header states no bound: {rounding.reason}")
    if rounding.conditions:
        raise CannotFollowError("the bound of the header has conditions on values on the way")
    return _FloatingScriptWriter(program, rounding, degree).script


class _FloatingScriptWriter:
    """Writes the script of a program in floating point."""

    def __init__(self, program: Program, rounding: RoundingBounds, degree: int) -> None:
        self.degree = degree
        self.script, self.number, self.format = Script(), NUMBERS[rounding.number], _FORMATS[rounding.number]
        self.largest = {
            element: condition.high
            for signal in program.inputs
            for condition in rounding.inputs
            if condition.value == signal.name
            for element in signal.elements
        }
        self.expressions = Expressions.of(program)
        self.ranges: dict[int, Interval] = {}
        self.expansions: dict[int, polynomials.Polynomial] = {}
        self.exact: dict[int, str] = {}
        used = self._used([k for r in program.outputs for k in self.expressions.results[r.signal.name]])
        for place in sorted(used):
            self._add(place, self.expressions.items[place])
        for result in program.outputs:
            places = self.expressions.results[result.signal.name]
            for place, bound in zip(places, rounding.errors[result.signal.name], strict=True):
                self.script.aim(f"c_{place} - {self.exact[place]}", bound)

    def _used(self, places: Sequence[int]) -> set[int]:
        """Return the operations that some others need, and these."""
        used, pending = set(places), [*places]
        while pending:
            new = [k for k in self.expressions.items[pending.pop()].arguments if k not in used]
            used.update(new)
            pending += new
        return used

    def _add(self, place: int, expression: Expression) -> None:
        """Add an operation, rounded and exact."""
        if expression.kind == INPUT:
            self._input(place, expression.name)
            return
        if expression.kind == CONSTANT:
            literal = self.number.rounded(expression.value)
            self.script.define(f"c_{place}", number(literal))
            self.exact[place] = number(expression.value)
            self.ranges[place] = Interval.of(expression.value)
            self.expansions[place] = polynomials.scale(polynomials.ONE, expression.value)
            return
        computed = self._operation(expression, {k: f"c_{k}" for k in expression.arguments})
        exact = self._operation(expression, self.exact)
        self.script.define(
            f"c_{place}", computed if expression.kind == "negate" else f"{self.format}({computed})"
        )
        self.script.define(f"e_{place}", exact)
        self.exact[place] = f"e_{place}"
        factor = self._factor(expression)
        if factor:  # the exponent changes alone, but below the smallest normal number
            lost = self.number.underflow if factor < 1 else Fraction(0)
            self.script.suppose(f"c_{place} - ({computed})", -lost, lost)
        self.script.rules.append(f"c_{place} ~ e_{place};")
        self._range(place, expression)

    def _input(self, place: int, name: str) -> None:
        if name == RESOLUTION:
            raise CannotFollowError("the program looks at the resolution of its numbers")
        largest = self.largest[name]
        self.script.define(f"c_{place}", f"{self.format}({name})")
        self.script.suppose(f"c_{place}", -largest, largest)
        self.exact[place] = f"c_{place}"
        self.ranges[place] = Interval.symmetric(largest)
        self.expansions[place] = {(place,): Fraction(1)}

    @staticmethod
    def _operation(expression: Expression, names: Mapping[int, str]) -> str:
        operands = [names[k] for k in expression.arguments]
        if expression.kind == "negate":
            return f"-{operands[0]}"
        if expression.kind == "sqrt":
            return f"sqrt({operands[0]})"
        if expression.kind not in SIGNS:
            raise CannotFollowError(f"the program calls {expression.kind}, for which Gappa has no theorem")
        return f"{operands[0]} {SIGNS[expression.kind]} {operands[1]}"

    def _factor(self, expression: Expression) -> Fraction | None:
        """Return the size of the power of two by which an operation multiplies; None if it does something else."""
        if expression.kind == "add" and expression.arguments[0] == expression.arguments[1]:
            return Fraction(2)
        values = [
            item.value for k in expression.arguments if (item := self.expressions.items[k]).kind == CONSTANT
        ]
        powers = [abs(value) for value in values if value and is_power_of_two(value)]
        return powers[0] if expression.kind == "multiply" and powers else None

    # Ranges

    def _range(self, place: int, expression: Expression) -> None:
        """Write an operation as a polynomial of the inputs where the range of that is smaller."""
        arguments = expression.arguments
        if any(k not in self.ranges for k in arguments) or expression.kind in ("divide", "sqrt"):
            return
        first, *others = (self.ranges[k] for k in arguments)
        match expression.kind:
            case "add":
                inside = first + others[0]
            case "subtract":
                inside = first - others[0]
            case "multiply":
                inside = first.square() if arguments[0] == arguments[1] else first * others[0]
            case _:
                inside = -first
        expansion = self._expansion(expression)
        if expansion is not None:
            self.expansions[place] = expansion
            expanded = self._enclosure(expansion)
            if (expanded.high - expanded.low) * _SMALLER < inside.high - inside.low:
                inside = inside.meet(expanded)
                texts = [f"{number(c)} * ({_power_product(monomial)})" for monomial, c in expansion.items()]
                self.script.rules.append(f"e_{place} -> {total(texts)};")
        self.ranges[place] = inside

    def _expansion(self, expression: Expression) -> polynomials.Polynomial | None:
        """Return an operation as a polynomial of the inputs; None if that is long or of a high degree."""
        if any(k not in self.expansions for k in expression.arguments):
            return None
        first, *others = (self.expansions[k] for k in expression.arguments)
        match expression.kind:
            case "multiply":
                grown = polynomials.multiply(first, others[0])
            case "negate":
                grown = polynomials.scale(first, -1)
            case kind:
                grown = polynomials.add(first, others[0], 1 if kind == "add" else -1)
        long = len(grown) > _MOST_TERMS or any(len(monomial) > self.degree for monomial in grown)
        return None if long else grown

    def _enclosure(self, expansion: polynomials.Polynomial) -> Interval:
        """Return the range of a polynomial of the inputs whose terms vary alone."""
        whole = Interval.of(Fraction(0))
        for monomial, coefficient in expansion.items():
            part = Interval.of(Fraction(1))
            for k, power in Counter(monomial).items():
                for factor in [self.ranges[k].square()] * (power // 2) + [self.ranges[k]] * (power % 2):
                    part = part * factor
            whole = whole + part.scale(coefficient)
        return whole


def _power_product(monomial: Sequence[int]) -> str:
    """Return a product of inputs in which squares are seen as such."""
    return product(
        Fraction(1),
        [
            factor
            for k, power in Counter(monomial).items()
            for factor in [f"(c_{k} * c_{k})"] * (power // 2) + [f"c_{k}"] * (power % 2)
        ],
    )
