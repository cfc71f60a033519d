"""From a program to exact quantities: trees of operations become sums of products, functions become series.

Ranges are proved on the way; an operation that has no place in fixed point is refused.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.exceptions import InputError
from strapgen.fixedpoint.intervals import Interval, maximum
from strapgen.fixedpoint.quantities import (
    Definition,
    InputElement,
    Maximum,
    Operand,
    Quantities,
    Quantity,
    Quotient,
    Selection,
    SquareRoot,
    Sum,
    Terms,
    combined,
    is_dyadic,
    is_power_of_two,
    scaled,
    used_by,
)
from strapgen.fixedpoint.ranges import Ranges
from strapgen.fixedpoint.samples import samples
from strapgen.program import RESOLUTION, Constant, Node, Operation, Program, Reference


def quantities(
    program: Program, ranges: Mapping[str, Interval], split: bool = False, word: int = 32
) -> Quantities:
    """Turn a program into exact quantities.

    Parameters
    ----------
    program : Program
    ranges : mapping of str to Interval
        Range of every element of an input.
    split : bool, optional
        Whether what differs little from an exact sum of inputs is kept as its distance from that too. It takes more
        multiplications, and the rounding of a transition becomes as small as that of its terms of higher order.
    word : int, optional
        Bits of a word: series of functions are cut where it cannot tell any more.

    Returns
    -------
    Quantities

    Raises
    ------
    InputError
        If an operation cannot be done in fixed point on the given ranges.
    """
    with np.errstate(all="ignore"):  # samples are hints: what is not finite hints at nothing
        work = _Derivation(program, dict(ranges), split, word)
        for assignment in program.body:
            work.assign(assignment.name, assignment.value, assignment.meaning)
        work.finish()
    return work.made


#: An offset leaves what is stored at most this part of it: one bit or more is gained.
_SMALL = Fraction(1, 2)


class _Derivation:
    """The state of the walk over a program."""

    def __init__(self, program: Program, ranges: dict[str, Interval], split: bool, word: int) -> None:
        self.program, self.split, self.word = program, split, word
        self.made = Quantities()
        self.items = self.made.items
        self.ranges = Ranges(self.items, ranges)
        self.same: dict[Definition, str] = {}
        self.proper, self.any = samples(program.inputs, ranges)
        self.outputs = {
            node.name for result in program.outputs for node in result.nodes if isinstance(node, Reference)
        }
        for signal in program.inputs:
            for name in signal.elements:
                self.items[name] = Quantity(name, InputElement(signal.name), Fraction(0), ranges[name])

    # What stands in the program

    def assign(self, name: str, node: Node, meaning: str) -> None:
        """Make the quantity of an assignment."""
        if isinstance(node, Operation) and node.kind not in ("add", "subtract", "negate", "multiply"):
            self._operate(name, node, meaning)
        else:
            self._store(name, self._terms(node, name), meaning, whole=name in self.outputs)

    def finish(self) -> None:
        """Make what the results need: every element of an output a quantity of its own, stored whole."""
        for result in self.program.outputs:
            held: list[Operand] = []
            for element, node in zip(result.signal.elements, result.nodes, strict=True):
                name = node.name if isinstance(node, Reference) else ""
                # A choice between values may be longer than a word: it is rounded to one.
                mine = (
                    name
                    and name not in held
                    and not isinstance(self.items[name].definition, InputElement | Selection)
                )
                if not mine or self.items[name].offset or self.items[name].beside:
                    name = self._free(element)
                    self._store(name, self._terms(node, name), "", whole=True)
                held.append(name)
            self.made.results[result.signal.name] = tuple(held)
        if self.program.transition is not None:
            self.made.results[self.program.transition.signal.name] = tuple(
                node.name if isinstance(node, Reference) else node.value
                for node in self.program.transition.nodes
                if isinstance(node, Reference | Constant)
            )

        self._drop_unused()

    def _drop_unused(self) -> None:
        """Drop what no result needs: a function of a root may have been made from what stands under it."""
        results = (name for held in self.made.results.values() for name in held if isinstance(name, str))
        needed = set(results) | {q.name for q in self.items.values() if q.guarded}
        for quantity in reversed(list(self.items.values())):
            if quantity.name in needed:
                needed.update(used_by(quantity))
            elif not isinstance(quantity.definition, InputElement):
                del self.items[quantity.name]

    # Sums of products

    def _terms(self, node: Node, name: str) -> Terms:
        """Return a node as a sum over products of at most two stored quantities."""
        if isinstance(node, Constant):
            return {(): node.value} if node.value else {}
        if isinstance(node, Reference):
            if node.name == RESOLUTION:  # that of a word which holds an attitude
                return {(): Fraction(1, 1 << (self.word - 2))}
            return self._value_of(node.name)
        if node.kind in ("add", "subtract"):
            left, right = (self._terms(argument, name) for argument in node.arguments)
            return combined(left, right, Fraction(1 if node.kind == "add" else -1))
        if node.kind == "negate":
            return scaled(self._terms(node.arguments[0], name), Fraction(-1))
        if node.kind == "multiply":
            left, right = (self._terms(argument, name) for argument in node.arguments)
            return self._product(left, right, name)
        inner = self._free(f"{_stem(name)}_{_WORDS[node.kind]}")
        self._operate(inner, node, "")
        return self._value_of(inner)

    def _value_of(self, name: str) -> Terms:
        """Return a quantity, offset and all, in terms of what is stored."""
        quantity = self.items[name]
        terms = dict(quantity.definition.terms) if isinstance(quantity.definition, Sum) else None
        if terms is not None and not quantity.inexact and not any(terms):
            constant = quantity.offset + sum(terms.values(), Fraction(0))
            return {(): constant} if constant else {}
        offset: Terms = {(): quantity.offset} if quantity.offset else {}
        return offset | dict(quantity.beside) | {(name,): Fraction(1)}

    def _product(self, left: Terms, right: Terms, name: str) -> Terms:
        for constant, terms in ((left, right), (right, left)):
            if set(constant) <= {()}:
                return scaled(terms, constant.get((), Fraction(0)))
        left, right = self._factor(left, name), self._factor(right, name)
        total: Terms = {}
        for one, a in left.items():
            for other, b in right.items():
                total = combined(total, {tuple(sorted(one + other)): a * b}, Fraction(1))
        return total

    def _factor(self, terms: Terms, name: str) -> Terms:
        """Return a factor as a constant and one stored quantity, times a power of two, and what is kept beside it."""
        linear = [monomial for monomial in terms if monomial]
        if is_dyadic(terms.get((), Fraction(0))) and all(
            len(m) == 1 and is_power_of_two(terms[m]) for m in linear
        ):
            stored = [self.items[m[0]] for m in linear]
            beside = {m for quantity in stored for m, _ in quantity.beside}
            if len(linear) == 1 or (beside and all(m in beside or self.items[m[0]].beside for m in linear)):
                return terms
        inner = self._free(f"{name}_factor")
        self._store(inner, terms, "")
        return self._value_of(inner)

    def _store(self, name: str, terms: Terms, meaning: str, whole: bool = False) -> None:
        """Make the quantity of a sum; its constant becomes its offset where that makes the rest small."""
        for monomial, coefficient in list(terms.items()):
            if len(monomial) == 2 and not is_power_of_two(coefficient):
                # A product that is multiplied once more is rounded in between.
                inner = self._free(f"{name}_product")
                self._store(inner, {monomial: Fraction(1)}, "")
                del terms[monomial]
                terms = combined(terms, self._value_of(inner), coefficient)
        constant = terms.get((), Fraction(0))
        rest = {monomial: c for monomial, c in terms.items() if monomial}
        offset = Fraction(0)
        if constant and not whole and is_dyadic(constant):
            spread = self.ranges.enclosure(rest).magnitude
            if spread <= abs(constant) * _SMALL:
                offset = constant
        beside: Terms = {}
        if self.split and not whole and not (constant and not offset):
            exact: Terms = {
                m: c for m, c in rest.items() if len(m) == 1 and is_power_of_two(c) and self._is_exact(m[0])
            }
            others = {m: c for m, c in rest.items() if m not in exact}
            if exact and others:
                around = self.ranges.enclosure(exact).magnitude
                if self.ranges.enclosure(others).magnitude <= around * _SMALL:
                    beside, rest = exact, others
        if constant and not offset:
            rest[()] = constant
        definition = Sum(tuple(rest.items()))
        self._note(name, _evaluated(rest, self.proper), _evaluated(rest, self.any))
        seen = float(np.nan_to_num(np.abs(self.any[name]), posinf=0).max()) or 1e-300
        enclosure = self.ranges.of_sum(name, rest, seen)
        self.items[name] = Quantity(
            name, definition, offset, enclosure, meaning, beside=tuple(beside.items())
        )

    def _is_exact(self, name: str) -> bool:
        """Tell whether a quantity is a sum of inputs without rounding."""
        quantity = self.items[name]
        if isinstance(quantity.definition, InputElement):
            return True
        return (
            isinstance(quantity.definition, Sum)
            and not quantity.offset
            and not quantity.beside
            and all(
                len(m) == 1 and is_power_of_two(c) and isinstance(self.items[m[0]].definition, InputElement)
                for m, c in quantity.definition.terms
            )
        )

    # Operations that are no sums of products

    def _operate(self, name: str, node: Operation, meaning: str) -> None:
        if node.kind in _FUNCTIONS:
            self._function(name, node, meaning)
            return
        handle = getattr(self, f"_{node.kind}", None)
        if handle is None:
            raise InputError(f"{self.program.kernel} uses {node.kind}, which fixed point does not have")
        handle(name, node, meaning)

    def _divide(self, name: str, node: Operation, meaning: str) -> None:
        top = self._operand(node.arguments[0], f"{name}_numerator")
        below = self._operand(node.arguments[1], f"{name}_denominator")
        if isinstance(below, Fraction):
            assert below, "a program divides by zero"
            terms: Terms = self._value_of(top) if isinstance(top, str) else {(): top}
            self._store(name, scaled(terms, 1 / below), meaning, whole=name in self.outputs)
            return
        self._guard(below)
        enclosure = self._range(top) * self.items[below].range.reciprocal()
        self._note(name, *(self._sampled(top, s) / s[below] for s in (self.proper, self.any)))
        self._other(name, Quotient(top, below), enclosure, meaning)

    def _sqrt(self, name: str, node: Operation, meaning: str) -> None:
        argument = self._radicand(node.arguments[0], f"{_stem(name)}_radicand")
        if isinstance(argument, Fraction):
            root = Interval.of(argument).sqrt()
            held = Sum((((), root.lowest),))
            width = root.highest - root.lowest
            self.items[name] = Quantity(name, held, Fraction(0), root, meaning, inexact=width)
            self.ranges.expanded[name] = None
            self._note(name, *(np.full(len(s[""]), float(root.lowest)) for s in (self.proper, self.any)))
            return
        self._guard(argument)
        inside = self.items[argument].range
        if inside.low < 0:
            raise InputError(
                f"{self.program.kernel}: {argument} may be below 0, its range is {inside.text()}; it has no square root"
            )
        self._note(name, *(np.sqrt(np.maximum(s[argument], 0)) for s in (self.proper, self.any)))
        self._other(name, SquareRoot(argument), inside.sqrt(), meaning)

    def _radicand(self, node: Node, name: str) -> Operand:
        """Return what a root is drawn from; a sum of squares as squares of words, so that it is not below 0."""
        squared = _squares(node)
        if not squared or not any(self.items[n].beside or self.items[n].offset for n in squared):
            return self._operand(node, name)
        terms: Terms = {}
        for factor in squared:
            whole = self._operand(Reference(factor), f"{factor}_whole")
            square: Terms = {(whole, whole): Fraction(1)} if isinstance(whole, str) else {(): whole * whole}
            terms = combined(terms, square, Fraction(1))
        free = self._free(name)
        self._store(free, terms, "", whole=True)
        return free

    def _maximum(self, name: str, node: Operation, meaning: str) -> None:
        arguments = tuple(self._operand(a, f"{name}_argument") for a in _flat("maximum", node))
        ranges = [self._range(argument) for argument in arguments]
        enclosure = maximum(ranges)
        expansions: list[Terms | None] = [
            self.ranges.expanded.get(a) if isinstance(a, str) else {(): a} for a in arguments
        ]
        if all(e is not None for e in expansions):
            # The largest is at least the mean.
            mean: Terms = {}
            for expansion in expansions:
                mean = combined(mean, expansion or {}, Fraction(1, len(arguments)))
            least = self.ranges.enclosure({m: c for m, c in mean.items() if c}, self.ranges.box)
            enclosure = Interval(max(enclosure.low, least.low), enclosure.high)
        self._note(
            name,
            *(
                np.max([np.broadcast_to(self._sampled(a, s), len(s[""])) for a in arguments], axis=0)
                for s in (self.proper, self.any)
            ),
        )
        self._other(name, Maximum(arguments), enclosure, meaning)

    def _select(self, name: str, node: Operation, meaning: str) -> None:
        cases: list[tuple[Operand, Operand, Operand]] = []
        rest: Node = node
        while isinstance(rest, Operation) and rest.kind == "select":
            condition, yes, rest = rest.arguments
            if not isinstance(condition, Operation) or condition.kind != "at_least":
                raise InputError(f"{self.program.kernel}: the condition of {name} is no comparison")
            left, right = (self._operand(side, f"{name}_side") for side in condition.arguments)
            cases.append((left, right, self._operand(yes, f"{name}_case")))
        otherwise = self._operand(rest, f"{name}_case")
        enclosure = self._range(otherwise)
        for case in cases:
            enclosure = enclosure.join(self._range(case[2]))

        def chosen(values: dict[str, Any]) -> NDArray[Any]:
            result = np.broadcast_to(self._sampled(otherwise, values), len(values[""]))
            for left, right, value in reversed(cases):
                condition = self._sampled(left, values) >= self._sampled(right, values)
                result = np.where(condition, self._sampled(value, values), result)
            return result

        self._note(name, chosen(self.proper), chosen(self.any))
        self._other(name, Selection(tuple(cases), otherwise), enclosure, meaning)

    def _function(self, name: str, node: Operation, meaning: str) -> None:
        from strapgen.fixedpoint import functions  # it is written in the definitions of this module

        arguments: list[str] = []
        for argument in node.arguments:
            operand = self._operand(argument, f"{name}_argument")
            arguments.append(operand if isinstance(operand, str) else self._constant(operand, name))
        distance = self._distance(name, *arguments) if node.kind in ("atan2", "direction") else Fraction(0)
        try:
            made = functions.derived(
                node.kind, name, arguments, self.items, self.same, self._free, self.word, distance
            )
        except ValueError as error:
            raise InputError(f"{self.program.kernel}: {error}") from None
        made[-1] = replace(made[-1], meaning=meaning)
        self.items |= {quantity.name: quantity for quantity in made}
        self.ranges.expanded |= dict.fromkeys(quantity.name for quantity in made)
        self._note(
            name, *(_FUNCTIONS[node.kind](*(s[a] for a in arguments)) for s in (self.proper, self.any))
        )

    def _distance(self, name: str, ordinate: str, abscissa: str) -> Fraction:
        """Return the inverse of the largest slope of atan2 of inexact arguments: their least distance from the origin.

        That is proved, or checked when the code runs if they keep one in proper use; 0 where nothing is known.
        """
        definitions = [self.items[argument].definition for argument in (ordinate, abscissa)]
        if all(isinstance(definition, InputElement) for definition in definitions):
            return Fraction(0)
        terms: Terms = {}
        for argument, definition in zip((ordinate, abscissa), definitions, strict=True):
            square: Terms = {(argument, argument): Fraction(1)}
            if isinstance(definition, SquareRoot):
                square = self._value_of(definition.argument)
            terms = combined(terms, square, Fraction(1))
        free = self._free(f"{name}_distance")
        self._store(free, terms, "", whole=True)
        self._guard(free)
        least = self.items[free].range
        if least.low > 0:
            # Two vectors of length L or more, d apart, are up to 2 asin(d/2L) apart in angle. A value that is checked
            # has an error below half its smaller end, so that d < 3L/4, the angle below 9/8 d/L; else below pi/2 d/L.
            part = Fraction(8, 9) if self.items[free].guarded else Fraction(7, 11)
            return least.sqrt().lowest * part
        del self.items[free]
        return Fraction(0)

    def _other(self, name: str, definition: Definition, enclosure: Interval, meaning: str) -> None:
        self.items[name] = Quantity(name, definition, Fraction(0), enclosure, meaning)
        self.ranges.expanded[name] = None

    def _operand(self, node: Node, name: str) -> Operand:
        """Return a constant, or the name of a quantity that is stored whole."""
        terms = self._terms(node, name)
        if set(terms) <= {()}:
            return terms.get((), Fraction(0))
        if len(terms) == 1:
            ((monomial, coefficient),) = terms.items()
            if len(monomial) == 1 and coefficient == 1:
                return monomial[0]
        free = self._free(name)
        self._store(free, terms, "", whole=True)
        return free

    def _constant(self, value: Fraction, name: str) -> str:
        free = self._free(f"{name}_argument")
        self._store(free, {(): value}, "", whole=True)
        return free

    def _range(self, operand: Operand) -> Interval:
        return Interval.of(operand) if isinstance(operand, Fraction) else self.items[operand].range

    def _sampled(self, operand: Operand, values: dict[str, Any]) -> Any:
        return float(operand) if isinstance(operand, Fraction) else values[operand]

    def _guard(self, name: str) -> None:
        """Bound a divisor, or what a root is drawn from, away from zero by a check when the code runs.

        The limits are half the smallest and twice the largest value on proper inputs, to powers of two. Where it is
        proved that they hold, or where proper inputs come near zero, nothing is checked.
        """
        quantity, seen = self.items[name], self.proper[name]
        least, most = float(np.abs(seen).min()), float(np.abs(seen).max())
        if not math.isfinite(most):
            return
        one_sign = bool((seen > 0).all() or (seen < 0).all())
        low, high = quantity.range.low, quantity.range.high
        if not one_sign or least < most / 64:
            return
        near = Interval.of(
            Fraction(2) ** (round(math.log2(least)) - 1),
            Fraction(2) ** (math.ceil(math.log2(most) - 1e-6) + 1),
        )
        near = near if seen[0] > 0 else -near
        tighter = quantity.range.meet(near)
        needed = low <= 0 <= high or (tighter.low > low and abs(low) < abs(tighter.low) // 2)
        if needed:
            self.items[name] = replace(quantity, range=tighter, guarded=True)

    def _note(self, name: str, proper: Any, anywhere: Any) -> None:
        self.proper[name], self.any[name] = proper, anywhere

    def _free(self, name: str) -> str:
        """Return the name, or with a number behind it one that is free."""
        taken = self.items.keys() | {assignment.name for assignment in self.program.body}
        candidates = (name if k == 1 else f"{name}_{k}" for k in range(1, len(taken) + 2))
        return next(candidate for candidate in candidates if candidate not in taken)


def _squares(node: Node) -> list[str]:
    """Return the names whose squares a node is the sum of; none if it is no such sum."""
    if not isinstance(node, Operation):
        return []
    if node.kind == "add":
        parts = [_squares(argument) for argument in node.arguments]
        return [name for part in parts for name in part] if all(parts) else []
    left, right = node.arguments if node.kind == "multiply" else (None, None)
    return [left.name] if isinstance(left, Reference) and left == right else []


#: Functions on samples.
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sin": np.sin,
    "cos": np.cos,
    "sinc": lambda x: np.sinc(x / np.pi),
    "atan2": np.arctan2,
    "direction": np.arctan2,
    "wrap": lambda x: np.where(x > np.pi, x - 2 * np.pi, np.where(x < -np.pi, x + 2 * np.pi, x)),
}
_WORDS = {
    "divide": "quotient",
    "sqrt": "root",
    "maximum": "largest",
    "select": "choice",
    "sin": "sine",
    "cos": "cosine",
    "sinc": "sinc",
    "atan2": "angle",
    "direction": "angle",
    "wrap": "principal",
}


def _stem(name: str) -> str:
    """Return the name without what was put behind it for a part: of a part of a part the last word says enough."""
    for word in (*_WORDS.values(), "numerator", "denominator"):
        name = name.removesuffix(f"_{word}")
    return name


def _flat(kind: str, node: Node) -> list[Node]:
    if isinstance(node, Operation) and node.kind == kind:
        return [inner for argument in node.arguments for inner in _flat(kind, argument)]
    return [node]


def _evaluated(terms: Terms, values: dict[str, Any]) -> NDArray[Any]:
    total = np.zeros(len(values[""]))
    for monomial, coefficient in terms.items():
        product: Any = float(coefficient)
        for name in monomial:
            product = product * values[name]
        total = total + product
    return total
