"""Writes a call in fixed point as a script for Gappa: the integers as the C rounds them, beside the exact program.

Every value has three names: ``c_x`` is the number that the integer in the C stands for, ``e_x`` what the same sum is in
exact arithmetic, and ``x_x`` is the value of the exact program. The script claims how far the outputs of the C are from
the results of the exact program; that ``e_x`` is the same as ``x_x`` is an identity, which Gappa checks.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from strapgen.evidence.gappa_scripts import CannotFollowError, Script, exact_lines, number, product, total
from strapgen.ir.integer_program import FixedProgram, IntegerOperation, IntegerSum, Scaled, Term, Value
from strapgen.kernel import polynomials

#: Degree up to which a value is expanded in the inputs for its range, and terms that this may take.
_DEGREE, _MOST_TERMS = 2, 60
#: A range that is smaller by less does not count.
_SMALLER = 1 + Fraction(1, 1000)


def fixed_script(fixed: FixedProgram) -> Script:
    """Return the script of one call of a program in fixed point."""
    return _FixedScriptWriter(fixed).script


class _FixedScriptWriter:
    """Writes the script of a program in fixed point."""

    def __init__(self, fixed: FixedProgram) -> None:
        self.script, self.nearest = Script(), fixed.interface.settings.rounding == "nearest"
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
        self.script.suppose(f"c_{name}", *self.limits[name])
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
        self.script.aim(f"{computed} - {exact}", bound)

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
            self.script.suppose(f"c_{name}", *self.limits[name])
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
        before, added = self._added(value, definition)
        self.script.define(f"r_{name}", f"fixed<{-fraction},dn>({' + '.join([before, *added])})")
        self.script.define(f"c_{name}", total([*(part.computed for part in coarse), f"r_{name}"]))
        self.script.define(f"e_{name}", total([*(part.exact for part in coarse), f"t_{name}"]))
        if added:
            moved = [f"(r_{name} - ({before} + {added[0]}))", *added, f"({before} - t_{name})"]
            self._rewrite(f"r_{name} - t_{name}", " + ".join(moved))
        self._expand(value, parts)

    def _added(self, value: Value, definition: IntegerSum) -> tuple[str, list[str]]:
        """Return the fine terms of a sum as they are rounded, and what is added to them before."""
        name, feedback = value.name, definition.residual
        if feedback is None:
            return f"s_{name}", [number(Fraction(2) ** (-value.fraction - 1))] if self.nearest else []
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

    def _scaled(self, scaled: Scaled, fraction: int) -> tuple[str, str]:
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
        top, exact_top = self._scaled(numerator, fraction + self.fractions[denominator])
        below, exact_below = f"c_{denominator}", self._exact(denominator)
        mode = "na" if self.nearest else "zr"  # of magnitudes, the sign comes last
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
        inside, exact_inside = self._scaled(argument, 2 * fraction)
        mode = "ne" if self.nearest else "dn"  # no root of an integer lies halfway between two integers
        self.script.define(f"c_{name}", f"fixed<{-fraction},{mode}>(sqrt({inside}))")
        self.script.define(f"e_{name}", f"sqrt({exact_inside})")


@dataclass(frozen=True)
class _SumTerm:
    """A term of a sum: its factors, their exact coefficient, and the term as the C computes it and exactly."""

    names: tuple[str, ...]
    coefficient: Fraction
    computed: str
    exact: str
