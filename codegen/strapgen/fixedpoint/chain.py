"""`Chain` collects the exact quantities from which a function is computed, each with a proved range."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

from strapgen.fixedpoint.intervals import Interval, maximum
from strapgen.fixedpoint.quantities import (
    Definition,
    ErrorPropagation,
    ExactOperation,
    InputElement,
    Monomial,
    Operand,
    Quantity,
    Sum,
)

_ONE = Fraction(1)


@dataclass
class Chain:
    """The quantities of a function in order, each made from those before it."""

    name: str  # that of the function's value, which is the last link
    known: Mapping[str, Quantity]
    same: dict[Definition, str]  # links of all functions so far, by definition
    #: Returns its argument, or that with a number behind it, as a name that is free.
    free: Callable[[str], str]
    word: int  # bits
    links: list[Quantity] = field(default_factory=list)
    ranges: dict[str, Interval] = field(default_factory=dict)  # those of the links

    @property
    def tolerance(self) -> Fraction:
        """The largest truncation error of a series: an eighth of the last place of a word that holds 1."""
        return Fraction(1, 1 << (self.word + 1))

    def range(self, operand: Operand) -> Interval:
        """Return the proved range of a quantity or a constant."""
        if isinstance(operand, Fraction):
            return Interval.of(operand)
        return self.ranges[operand] if operand in self.ranges else self.known[operand].range

    def add(
        self,
        label: str,
        definition: Definition,
        enclosure: Interval,
        approximation_error: Fraction = Fraction(0),
        inherited_error: ErrorPropagation | None = None,
    ) -> str:
        """Make a quantity unless there is an equal one; without a label it is the function's value."""
        if label and definition in self.same:
            return self.same[definition]
        name = self.name
        if label:
            name = self.free(f"{self.name}_{label}")
            count = 2
            while name in self.ranges:
                name, count = self.free(f"{self.name}_{label}_{count}"), count + 1
            self.same[definition] = name
        self.links.append(
            Quantity(
                name,
                definition,
                Fraction(0),
                enclosure,
                approximation_error=approximation_error,
                inherited_error=inherited_error,
            )
        )
        self.ranges[name] = enclosure
        return name

    def sum(
        self,
        label: str,
        *terms: tuple[Monomial, Fraction],
        within: Interval | None = None,
        approximation_error: Fraction = Fraction(0),
        inherited_error: ErrorPropagation | None = None,
    ) -> str:
        """Make a sum of products; `within` is a range that is known otherwise."""
        enclosure = Interval(0, 0)
        for monomial, coefficient in terms:
            ranges = [self.range(factor) for factor in monomial]
            if not ranges:
                enclosure += Interval.of(coefficient)
            elif len(ranges) == 1:
                enclosure += ranges[0].scale(coefficient)
            else:
                square = monomial[0] == monomial[1]
                product = ranges[0].square() if square else ranges[0] * ranges[1]
                enclosure += product.scale(coefficient)
        enclosure = enclosure.widened(approximation_error)
        return self.add(
            label,
            Sum(tuple((m, c) for m, c in terms if c)),
            enclosure if within is None else enclosure.meet(within),
            approximation_error,
            inherited_error,
        )

    def selection(self, label: str, *cases: tuple[Operand, Operand, Operand], otherwise: Operand) -> str:
        """Make a selection by comparisons of exact quantities."""
        enclosure = self.range(otherwise)
        for _, _, value in cases:
            enclosure = enclosure.join(self.range(value))
        operands = [operand for case in cases for operand in case]
        return self.add(label, ExactOperation("select", (*operands, otherwise)), enclosure)

    def maximum(self, label: str, *arguments: Operand) -> str:
        """Make the largest of several quantities and constants."""
        return self.add(label, ExactOperation("maximum", arguments), maximum(map(self.range, arguments)))

    def computed(self, argument: str) -> str:
        """Return an argument as the code computes it, so that it has no error of its own."""
        if argument in self.known and isinstance(self.known[argument].definition, InputElement):
            return argument
        return self.add("taken", ExactOperation("computed", (argument,)), self.range(argument))

    def magnitude(self, label: str, argument: str) -> str:
        """Return the magnitude of a quantity."""
        inside = self.range(argument)
        if inside.low >= 0:
            return argument
        negative = self.sum("negative", ((argument,), -_ONE))
        enclosure = Interval(0, Interval.of(inside.magnitude).high)
        return self.add(label, ExactOperation("maximum", (argument, negative)), enclosure)

    def square(self, argument: str) -> str:
        """Return the square of a quantity."""
        return self.sum("square", ((argument, argument), _ONE))

    def polynomial(self, label: str, coefficients: Sequence[Fraction], variable: str) -> str:
        """Make a polynomial of two or more coefficients by Horner's scheme."""
        *others, last_but_one, last = coefficients
        total = self.sum(label, ((variable,), last), ((), last_but_one))
        for coefficient in reversed(others):
            total = self.sum(label, ((variable, total), _ONE), ((), coefficient))
        return total

    def finish(self, value: str, *slopes: tuple[str, Fraction | None]) -> None:
        """Make the last quantity the function's value; `slopes` bound its derivatives by quantities taken as exact."""
        inside = self.range(value)
        inherited_error = ErrorPropagation(slopes, inside.highest - inside.lowest)
        last = self.links[-1] if self.links else None
        if last is not None and last.name == value and isinstance(last.definition, Sum):
            del self.same[last.definition]
            self.links[-1] = replace(last, name=self.name, inherited_error=inherited_error)
        else:  # one that is rounded to a word where a word is needed
            self.sum("", ((value,), _ONE), inherited_error=inherited_error)
