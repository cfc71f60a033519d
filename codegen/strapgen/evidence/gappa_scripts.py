"""Scripts for Gappa: a program with its roundings, and the same program in exact numbers.

Gappa follows sums, products, quotients and square roots; it checks that the rules by which a script rewrites one
expression as another are identities. In fixed point ``c_x`` is the number that the integer in the C stands for, ``e_x``
the same sum in exact arithmetic, and ``x_x`` the value of the exact program. In floating point the operations are
numbered in the order of the C: ``c_3`` is the computed value of the third and ``e_3`` its exact one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import NamedTuple

from strapgen.fixedpoint.floating.errors import CONSTANT, INPUT, NUMBERS, Expression, Expressions
from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.quantities import is_power_of_two
from strapgen.ir.integer_program import FixedProgram, IntegerOperation, IntegerSum, Scaled, Term, Value
from strapgen.ir.interfaces import RoundingBounds
from strapgen.ir.program import RESOLUTION, Constant, Node, Program, Reference
from strapgen.kernel import polynomials

#: The operations of a program that Gappa knows by a sign.
SIGNS = {"add": "+", "subtract": "-", "multiply": "*", "divide": "/"}


class CannotFollowError(Exception):
    """A program has an operation for which Gappa has no theorem; the message names it."""


@dataclass
class Script:
    """A script for Gappa."""

    #: Lines ``name = expression;``, facts of the inputs, and lines that tell Gappa how to rewrite an expression
    definitions: list[str] = field(default_factory=list)
    hypotheses: list[str] = field(default_factory=list)
    rules: list[str] = field(default_factory=list)
    #: Expressions, each with the bound of its magnitude that the project states
    goals: dict[str, Fraction] = field(default_factory=dict)

    def claim(self) -> str:
        """Return the script that claims the bounds."""
        return self._text([f"|{text}| <= {number(bound)}" for text, bound in self.goals.items()])

    def question(self) -> str:
        """Return the script by which Gappa computes its bounds."""
        return self._text([f"|{text}| in ?" for text in self.goals])

    def define(self, name: str, text: str) -> None:
        """Give an expression a name."""
        self.definitions.append(f"{name} = {text};")

    def assume(self, name: str, low: Fraction, high: Fraction) -> None:
        """State the range of an input, or of a value that the code checks."""
        self.hypotheses.append(f"{name} in [{number(low)},{number(high)}]")

    def add_goal(self, text: str, bound: Fraction) -> None:
        """Add a goal; of two outputs that are the same, the smaller bound is claimed."""
        self.goals[text] = min(bound, self.goals.get(text, bound))

    def _text(self, goals: Sequence[str]) -> str:
        body = " /\\\n  ".join(self.hypotheses) + " ->\n  " + " /\\\n  ".join(goals)
        return "\n".join([*self.definitions, "", f"{{ {body} }}", "", *self.rules, ""])


def number(value: Fraction) -> str:
    """Return an exact number as Gappa reads it.

    >>> number(Fraction(-3, 8)), number(Fraction(1, 48)), number(Fraction(2))
    ('-3b-3', '(1/48)', '2')
    """
    top, bottom = value.numerator, value.denominator
    if bottom & (bottom - 1) == 0:
        return f"{top}b-{bottom.bit_length() - 1}" if bottom > 1 else str(top)
    return f"({top}/{bottom})"


def product(coefficient: Fraction, names: Sequence[str]) -> str:
    """Return a multiple of a product."""
    if not names:
        return number(coefficient)
    return " * ".join(names if coefficient == 1 else [number(coefficient), *names])


def total(terms: Sequence[str]) -> str:
    """Return a sum; negative terms are subtracted, as in programs.

    >>> total(["a * b", "-1 * c", "1b-3"])
    'a * b - c + 1b-3'
    """
    if not terms:
        return "0"
    first, *others = terms
    return first + "".join(
        f" - {term.removeprefix('-1 * ')}" if term.startswith("-1 * ") else f" + {term}" for term in others
    )


def exact_lines(
    program: Program, name_of_input: Callable[[str], str]
) -> tuple[list[str], dict[str, list[str]]]:
    """Return an exact program as definitions, and the names of its results."""
    inputs = {element for signal in program.inputs for element in signal.elements}

    def name(reference: str) -> str:
        return name_of_input(reference) if reference in inputs else f"x_{reference}"

    used = program.used(program.outputs)
    lines = [f"x_{a.name} = {_expression(a.value, name)};" for a in program.body if a.name in used]
    results = {r.signal.name: [_expression(node, name) for node in r.nodes] for r in program.outputs}
    return lines, results


def _expression(node: Node, name: Callable[[str], str]) -> str:
    if isinstance(node, Constant):
        return number(node.value)
    if isinstance(node, Reference):
        return name(node.name)
    arguments = [_expression(argument, name) for argument in node.arguments]
    if node.kind == "negate":
        return f"(-{arguments[0]})"
    if node.kind == "sqrt":
        return f"sqrt({arguments[0]})"
    if node.kind not in SIGNS:
        raise CannotFollowError(f"the program calls {node.kind}, for which Gappa has no theorem")
    return f"({arguments[0]} {SIGNS[node.kind]} {arguments[1]})"


#: Degree up to which a value is expanded in the inputs for its range, and terms that this may take.
_DEGREE, _MOST_TERMS = 2, 60
#: A range that is smaller by less does not count.
_SMALLER = 1 + Fraction(1, 1000)


# Writes a call in fixed point as a script for Gappa: the integers as the C rounds them, beside the exact program.
#
# Every value has three names: ``c_x`` is the number that the integer in the C stands for, ``e_x`` what the same sum
# is in exact arithmetic, and ``x_x`` is the value of the exact program. The script claims how far the outputs of the
# C are from the results of the exact program; that ``e_x`` is the same as ``x_x`` is an identity, which Gappa checks.


def fixed_script(fixed: FixedProgram) -> Script:
    """Return the script of one call of a program in fixed point."""
    return _FixedScriptWriter(fixed).script


class _FixedScriptWriter:
    """Writes the script of a program in fixed point."""

    def __init__(self, fixed: FixedProgram) -> None:
        self.script, self.rounding = Script(), fixed.interface.settings.rounding
        self.fractions: dict[str, int] = {}
        self.limits: dict[str, tuple[Fraction, Fraction]] = {}
        self.expansions: dict[str, polynomials.Polynomial] = {}
        self.divisors: list[str] = []
        self.exact: set[str] = set()  # what has no error, so that c_x is e_x
        for argument in fixed.interface.inputs:
            if argument.sensor is not None:
                raise CannotFollowError("the increments are counts of a gyro, whose scale is no power of two")
            for name in argument.signal.elements:
                self._input(name, argument.format.fraction, argument.low, argument.high)
                self.expansions[name] = polynomials.atom(name)
        for feedback in fixed.interface.residuals:
            self._input(feedback.name, feedback.fraction, 0, (1 << fixed.word) - 1)
        lines, results = exact_lines(fixed.program, lambda element: f"c_{element}")
        self.script.definitions += lines
        for value in fixed.body:
            self._value(value)
        offsets = {value.name: value.offset for value in fixed.body}
        for argument in fixed.interface.outputs:
            texts = results[argument.signal.name]
            for name, exact, bound in zip(argument.values, texts, argument.errors, strict=True):
                self._goal(name, exact, offsets.get(name, Fraction(0)), bound)

    def _input(self, name: str, fraction: int, low: int, high: int) -> None:
        """Add an integer that the caller brings."""
        unit = Fraction(2) ** -fraction
        self.fractions[name], self.limits[name] = fraction, (low * unit, high * unit)
        self.exact.add(name)
        self.script.assume(f"c_{name}", *self.limits[name])
        self.script.hypotheses.append(f"@FIX(c_{name},{-fraction})")

    def _goal(self, name: str, exact: str, offset: Fraction, bound: Fraction) -> None:
        """Add the claim of an element of an output."""
        computed, twin = f"c_{name}", self._exact(name)
        if offset:
            shifted = f"({computed} + {number(offset)})", f"({twin} + {number(offset)})"
            self._rewrite(f"{shifted[0]} - {shifted[1]}", f"{computed} - {twin}")
            computed, twin = shifted
        if exact != twin:
            self._rewrite(exact, twin)
        self.script.add_goal(f"{computed} - {exact}", bound)

    def _exact(self, name: str) -> str:
        return f"c_{name}" if name in self.exact else f"e_{name}"

    def _rewrite(self, text: str, other: str) -> None:
        """Add an identity, which holds where no divisor so far is zero."""
        conditions = ", ".join(f"{name} <> 0" for name in self.divisors)
        self.script.rules.append(f"{text} -> {other}{f' {{ {conditions} }}' if conditions else ''};")

    # Values

    def _value(self, value: Value) -> None:
        """Add the definitions of a value, rounded and exact."""
        name, unit = value.name, Fraction(2) ** -value.fraction
        if value.saturated:
            raise CannotFollowError("the state saturates, which is a branch")
        match value.definition:
            case IntegerSum() as definition:
                self._sum(value, definition)
            case IntegerOperation("divide", (numerator, denominator)):
                self._quotient(value, numerator, str(denominator.value))
            case IntegerOperation("sqrt", (argument,)):
                self._root(value, argument)
            case _:
                raise CannotFollowError(f"{name} is chosen by a comparison, which is a branch")
        self.fractions[name], self.limits[name] = value.fraction, (value.low * unit, value.high * unit)
        if value.range_checked:
            self.script.assume(f"c_{name}", *self.limits[name])
        if name not in self.exact:
            self.script.rules.append(f"c_{name} ~ e_{name};")

    def _sum(self, value: Value, definition: IntegerSum) -> None:
        name, fraction = value.name, value.fraction
        coarse = self._parts(definition.coarse, fraction)
        fine = self._parts(definition.fine, fraction + definition.shift + definition.drop)
        parts = [*coarse, *fine]
        if not definition.shift:
            self.script.define(f"c_{name}", total([part.computed for part in parts]))
            if all(part.computed == part.exact for part in parts):
                self.exact.add(name)
            else:
                self.script.define(f"e_{name}", total([part.exact for part in parts]))
            self._expand(value, parts)
            return
        self.script.define(f"s_{name}", total([part.computed for part in fine]))
        self.script.define(f"t_{name}", total([part.exact for part in fine]))
        if definition.halves:
            self._halves(value)
            return
        before, added = self._added(value, definition)
        self.script.define(f"r_{name}", f"fixed<{-fraction},dn>({' + '.join([before, *added])})")
        self.script.define(f"c_{name}", total([*(part.computed for part in coarse), f"r_{name}"]))
        self.script.define(f"e_{name}", total([*(part.exact for part in coarse), f"t_{name}"]))
        if added:
            moved = [f"(r_{name} - ({before} + {added[0]}))", *added, f"({before} - t_{name})"]
            self._rewrite(f"r_{name} - t_{name}", " + ".join(moved))
        self._expand(value, parts)

    def _halves(self, value: Value) -> None:
        """Add a high word from half words: up to two units, a whole number of them, below the product rounded down."""
        name, place = value.name, value.fraction
        self.script.define(f"r_{name}", f"fixed<{-place},dn>(s_{name})")
        self.script.assume(f"d_{name}", Fraction(0), 2 * Fraction(2) ** -place)
        self.script.hypotheses.append(f"@FIX(d_{name},{-place})")
        self.script.define(f"c_{name}", f"r_{name} - d_{name}")
        self.script.define(f"e_{name}", f"t_{name}")
        self._rewrite(f"c_{name} - e_{name}", f"(r_{name} - t_{name}) - d_{name}")

    def _added(self, value: Value, definition: IntegerSum) -> tuple[str, list[str]]:
        """Return the fine terms of a sum before rounding, and the terms added to them."""
        name, feedback = value.name, definition.residual
        if feedback is None:
            half = definition.half(self.rounding) * Fraction(2) ** (-value.fraction - definition.shift)
            return f"s_{name}", [number(half)] if half else []
        place, before, text = value.fraction + definition.shift, f"s_{name}", f"c_{feedback.name}"
        if definition.drop:
            before = f"d_{name}"
            self.script.define(before, f"fixed<{-place},dn>(s_{name})")
        if feedback.shift:
            text = f"f_{name}"
            self.script.define(text, f"fixed<{-place},dn>(c_{feedback.name})")
        return before, [text]

    def _parts(self, terms: Iterable[Term], place: int) -> list[_SumTerm]:
        """Return the terms of a sum at a place: as the C computes them, and exactly."""
        parts = []
        for term in terms:
            scale = term.factor * Fraction(2) ** (
                sum(self.fractions[name] for name in term.names) + term.shift - place
            )
            # A word stands for its integer times 2^-fraction, so that the powers of two of a sum cancel.
            computed = product(scale, [f"c_{name}" for name in term.names])
            coefficient = scale if term.coefficient is None else term.coefficient.value
            exact = product(coefficient, [self._exact(name) for name in term.names])
            if term.shift < 0 and term.names:  # rounds the signed product, so that both are added
                computed, exact = f"fixed<{-place},dn>({computed})", f"({exact})"
            parts.append(_SumTerm(term.names, coefficient, computed, exact))
        return parts

    # Ranges

    def _expand(self, value: Value, parts: Sequence[_SumTerm]) -> None:
        """Write a value as a polynomial of the inputs where the range of that is smaller."""
        if any(name not in self.expansions for part in parts for name in part.names):
            return
        expansion: polynomials.Polynomial = {}
        for part in parts:
            term = polynomials.scale(polynomials.ONE, part.coefficient)
            for name in part.names:
                term = polynomials.multiply(term, self.expansions[name])
            expansion = polynomials.add(expansion, term)
        if len(expansion) > _MOST_TERMS or any(len(monomial) > _DEGREE for monomial in expansion):
            return
        self.expansions[value.name] = expansion
        if self._width(expansion.items()) * _SMALLER < self._width((p.names, p.coefficient) for p in parts):
            texts = [
                f"{number(coefficient)} * ({product(Fraction(1), [f'c_{name}' for name in names])})"
                for names, coefficient in expansion.items()
            ]
            self._rewrite(self._exact(value.name), total(texts))

    def _width(self, terms: Iterable[tuple[tuple[str, ...], Fraction]]) -> Fraction:
        """Return the width of the range of a sum of products whose factors vary alone."""
        width = Fraction(0)
        for names, coefficient in terms:
            ends = [Fraction(1)]
            for name in names:
                ends = [end * limit for end in ends for limit in self.limits[name]]
            low = max(Fraction(0), min(ends)) if len({*names}) < len(names) else min(ends)
            width += abs(coefficient) * (max(ends) - low)
        return width

    # Quotients and roots

    def _scale(self, scaled: Scaled, fraction: int) -> tuple[str, str]:
        """Return a value or a constant as an integer of so many fraction bits stands for it, and exactly."""
        if isinstance(scaled.value, int):
            text = number(scaled.value * Fraction(2) ** (scaled.shift - fraction))
            return text, text
        name = scaled.value
        scale = Fraction(2) ** (self.fractions[name] + scaled.shift - fraction)
        computed = product(scale, [f"c_{name}"])
        if scaled.shift < 0:
            computed = f"fixed<{-fraction},dn>({computed})"
        return computed, product(scale, [self._exact(name)])

    def _quotient(self, value: Value, numerator: Scaled, denominator: str) -> None:
        name, fraction = value.name, value.fraction
        top, exact_top = self._scale(numerator, fraction + self.fractions[denominator])
        below, exact_below = f"c_{denominator}", self._exact(denominator)
        mode = "na" if self.rounding == "nearest" else "zr"  # of magnitudes, the sign comes last
        self.script.define(f"s_{name}", f"{top} / {below}")
        self.script.define(f"c_{name}", f"fixed<{-fraction},{mode}>(s_{name})")
        self.script.define(f"e_{name}", f"{exact_top} / {exact_below}")
        moved = [f"(-e_{name} * ({below} - {exact_below}))"]
        if top != exact_top:
            moved.append(f"({top} - {exact_top})")
        self.divisors += dict.fromkeys((below, exact_below))
        if below != exact_below:
            self._rewrite(f"s_{name} - e_{name}", f"({total(moved)}) / {below}")

    def _root(self, value: Value, argument: Scaled) -> None:
        name, fraction = value.name, value.fraction
        inside, exact_inside = self._scale(argument, 2 * fraction)
        mode = (
            "ne" if self.rounding == "nearest" else "dn"
        )  # no root of an integer lies halfway between two integers
        self.script.define(f"c_{name}", f"fixed<{-fraction},{mode}>(sqrt({inside}))")
        self.script.define(f"e_{name}", f"sqrt({exact_inside})")


class _SumTerm(NamedTuple):
    """A term of a sum: its factors, their exact coefficient, and the term as the C computes it and exactly."""

    names: tuple[str, ...]
    coefficient: Fraction
    computed: str
    exact: str


#: Gappa's names of the types.
_FORMATS = {"double": "float<ieee_64,ne>", "float": "float<ieee_32,ne>"}
#: Degrees up to which operations are expanded in the inputs for their ranges: of the second, proofs take long.
DEGREES = (2, 3)


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
                self.script.add_goal(f"c_{place} - {self.exact[place]}", bound)

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
            self.script.assume(f"c_{place} - ({computed})", -lost, lost)
        self.script.rules.append(f"c_{place} ~ e_{place};")
        self._range(place, expression)

    def _input(self, place: int, name: str) -> None:
        if name == RESOLUTION:
            raise CannotFollowError("the program looks at the resolution of its numbers")
        largest = self.largest[name]
        self.script.define(f"c_{place}", f"{self.format}({name})")
        self.script.assume(f"c_{place}", -largest, largest)
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
