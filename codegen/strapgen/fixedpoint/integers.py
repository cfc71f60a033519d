"""From exact quantities to integers: formats from ranges, one rounding a sum, an error bound for every value."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from fractions import Fraction

from strapgen.exceptions import InputError
from strapgen.fixedpoint import code, derivation
from strapgen.fixedpoint import quantities as exact
from strapgen.fixedpoint.accumulation import accumulation
from strapgen.fixedpoint.alignment import aligning
from strapgen.fixedpoint.formats import ROUNDINGS, Format, finest
from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.limits import Limit, asked, limits, state_fraction
from strapgen.fixedpoint.quantities import exponent, is_dyadic, is_power_of_two
from strapgen.fixedpoint.settings import Settings
from strapgen.fixedpoint.terms import Placed, aligned, fits, largest_wide, nearest, up
from strapgen.program import Program
from strapgen.signal import Signal

#: Bits that inputs may be kept below their finest format, so that sums of them are exact.
_MOST_GUARD_BITS = 3
#: Part of the smaller end of a range that is checked that an error may take, so that proper input passes the check.
_MOST_GUARD_ERROR = Fraction(1, 2)


def lowered(program: Program, settings: Settings) -> code.FixedProgram:
    """Lower a program to integers.

    Parameters
    ----------
    program : Program
    settings : Settings

    Returns
    -------
    FixedProgram

    Raises
    ------
    InputError
        If an input has no known range, a format that is asked for does not hold its values, or the word is too short.
    """
    plan = limits(program, settings)

    def started(guard_bits: int) -> _Quantization:
        box = {name: limit.range(guard_bits) for limit in plan for name in limit.signal.elements}
        split = settings.carry == "state"
        made = derivation.quantities(program, box, split=split, word=settings.word)
        return _Quantization(program, settings, plan, made, guard_bits)

    tried = map(started, range(_MOST_GUARD_BITS + 1))
    first = next(tried)
    # What is handed on from call to call keeps its own finest format: it is no increment.
    finest = (
        first
        if program.recursion is not None or first.sums_of_inputs_are_exact()
        else next((work for work in tried if work.sums_of_inputs_are_exact()), first)
    )
    made, guard_bits = finest.exact, finest.guard_bits
    plain = finest.run()
    most = aligning(finest.body, finest.values, finest.forced)
    shorter = _Quantization(program, settings, plan, made, guard_bits, most)
    aligned = shorter.run()
    # Shorter where that costs no more than a hundredth in error.
    worse = any(
        new.errors[k] > old.errors[k] * Fraction(101, 100)
        for new, old in zip(aligned.interface.outputs, plain.interface.outputs, strict=True)
        for k in range(len(old.errors))
    )
    work, chosen = (finest, plain) if worse else (shorter, aligned)
    if program.companions is None or program.transition is None:
        return chosen
    adds_up = accumulation(
        program, settings, made, work.values, chosen.interface.inputs, chosen.interface.outputs
    )
    return replace(chosen, interface=replace(chosen.interface, accumulation=adds_up))


class _Quantization:
    """One walk over the exact quantities of a program."""

    def __init__(
        self,
        program: Program,
        settings: Settings,
        plan: list[Limit],
        made: exact.Quantities,
        guard_bits: int,
        most: Mapping[str, int] | None = None,
    ) -> None:
        self.program, self.settings, self.exact = program, settings, made
        self.guard_bits, self.most = guard_bits, most or {}
        self.word = settings.word
        self.half = ROUNDINGS[settings.rounding]
        self.values: dict[str, code.Value] = {}
        self.body: list[code.Value] = []
        self.residuals: list[code.ErrorFeedback] = []
        self.begun_anew: set[str] = set()
        self.operations = dict.fromkeys(("add", "multiply", "shift", "divide", "sqrt", "compare"), 0)
        self.inputs: list[code.Argument] = []
        for limit in plan:
            signal = limit.signal
            fraction, top = limit.places(guard_bits), limit.largest_integer(guard_bits)
            for name in signal.elements:
                self.values[name] = code.Value(
                    name, code.IntegerInput(), fraction, False, -top, top, Fraction(0), Fraction(0), top
                )
            zeros = (Fraction(0),) * signal.size
            format_ = Format(self.word, fraction)
            self.inputs.append(code.Argument(signal, format_, signal.elements, -top, top, zeros))
        self.factors = self.exact.factors() | {
            quantity.definition.denominator
            for quantity in self.exact.items.values()
            if isinstance(quantity.definition, exact.Quotient)
        }
        self.forced = self._forced()

    # Which values must be words of which format

    def _forced(self) -> dict[str, int]:
        """Return the fraction of every value whose format is given, or shared by the elements of a result."""
        forced: dict[str, int] = {}
        for name, text in self.settings.formats.items():
            known = ["state", *(signal.name for signal in self.program.inputs)]
            known += [result.signal.name for result in self.program.results]
            if name in known:
                continue
            if name not in self.exact.items:
                values = ", ".join(dict.fromkeys([*known, *self.exact.items]))
                raise InputError(f"{self.program.kernel} has no value {name!r}; its values are: {values}")
            if isinstance(self.exact.items[name].definition, exact.InputElement):
                raise InputError(
                    f"the format of {name} is that of its input; give the format of the whole input"
                )
            forced[name] = Format.parse(text, self.word).fraction
        for result in self.program.results:
            held = [name for name in self.exact.results[result.signal.name] if isinstance(name, str)]
            ranges = [self.exact.items[name].range.magnitude for name in held]
            is_output = result in self.program.outputs
            wish = self.settings.formats.get(result.signal.name)
            wish = asked(self.settings, result.signal) if is_output else wish
            carried = self._carried_input(result.signal) if is_output else None
            if wish is not None:
                fraction = Format.parse(wish, self.word).fraction
            elif carried is not None:
                fraction = carried.format.fraction
            elif is_output and (result.signal.constraint or self.program.companions is not None):
                fraction = self._state_like(result.signal)
            else:
                margin = Fraction(1) + Fraction(1, 1 << (self.word - 4))
                fraction = finest(max(ranges, default=Fraction(1)) * margin, self.word)
            forced |= {name: forced.get(name, fraction) for name in held}
        self.words = set(forced) | self.factors
        return forced

    def _carried_input(self, signal: Signal) -> code.Argument | None:
        """Return the input that an output is in the next call."""
        recursion = self.program.recursion
        name = recursion.inputs.get(signal.name) if recursion else None
        return next((argument for argument in self.inputs if argument.signal.name == name), None)

    def _state_like(self, signal: Signal) -> int:
        """Return the fraction of an output that is an attitude: that of an input like it, or of every state."""
        for argument in self.inputs:
            if argument.signal.constraint == signal.constraint and argument.signal.shape == signal.shape:
                return argument.format.fraction
        return state_fraction(self.word, Fraction(1) + self.settings.allowance)

    def sums_of_inputs_are_exact(self) -> bool:
        """Tell whether every sum of inputs that is needed as a word is one without rounding.

        A rounding error of a sum of inputs would be the same in every step of a steady motion.
        """
        for name, quantity in self.exact.items.items():
            definition = quantity.definition
            if name not in self.words or name in self.forced or not isinstance(definition, exact.Sum):
                continue
            if not all(len(m) == 1 and is_power_of_two(c) for m, c in definition.terms):
                continue
            if not all(
                isinstance(self.exact.items[m[0]].definition, exact.InputElement) for m, _ in definition.terms
            ):
                continue
            needed = max(self.values[m[0]].fraction - exponent(c) for m, c in definition.terms)
            if needed > finest(quantity.range.magnitude, self.word):
                return False
        return True

    # The walk

    def run(self) -> code.FixedProgram:
        """Lower everything and return the program."""
        carried = self._carried()
        for name, quantity in self.exact.items.items():
            definition = quantity.definition
            if isinstance(definition, exact.Sum):
                known = not quantity.offset and not quantity.inexact
                constant = known and all(not m for m, _ in definition.terms)
                if name in self.values or ((not definition.terms or constant) and name not in self.words):
                    continue
                self._sum(quantity, carried.get(name))
            elif isinstance(definition, exact.Quotient):
                self._quotient(quantity, definition)
            elif isinstance(definition, exact.SquareRoot):
                self._root(quantity, definition)
            elif isinstance(definition, exact.Maximum):
                self._largest(quantity, definition)
            elif isinstance(definition, exact.Selection):
                self._choice(quantity, definition)
            elif isinstance(definition, exact.Computed):
                self._taken(quantity, definition)
            elif isinstance(definition, exact.NearestInteger):
                self._nearest(quantity, definition)
        outputs = tuple(self._output(result.signal) for result in self.program.outputs)
        order = [name for name in carried if any(r.name == carried[name] for r in self.residuals)]
        residuals = {residual.name: residual for residual in self.residuals}
        return code.FixedProgram(
            self.program,
            code.Interface(
                self.settings,
                tuple(self.inputs),
                outputs,
                tuple(residuals[carried[name]] for name in order),
                None,
            ),
            tuple(self.body),
            self.operations,
        )

    def _carried(self) -> dict[str, str]:
        """Return the name of the residual of every value whose rounding is kept."""
        if self.settings.carry == "none":
            return {}
        first, result = self.program.inputs[0], self.program.outputs[0]
        if (first.shape, first.constraint) != (result.signal.shape, result.signal.constraint):
            return {}
        names = [name for name in self.exact.results[result.signal.name] if isinstance(name, str)]
        if self.settings.carry == "full" and self.program.transition is not None:
            held = self.exact.results[self.program.transition.signal.name]
            names += [name for name in held if isinstance(name, str)]
        return {name: f"residual_{name}" for name in names}

    def _sum(self, quantity: exact.Quantity, residual: str | None) -> None:
        """Lower a sum: exact products, aligned, added up and rounded once."""
        assert isinstance(quantity.definition, exact.Sum)
        terms = self._integer_terms(quantity)
        if quantity.name not in self.words:
            fraction = max((item.place for item in terms), default=self.word - 1)
            self._wide(quantity, terms, fraction)
            return
        natural = finest(quantity.range.magnitude, self.word)
        places = [item.place for item in terms]
        fraction = min(natural, max(places, default=natural), self.most.get(quantity.name, natural))
        fraction = self.forced.get(quantity.name, fraction)
        while True:
            value, kept = self._rounded(quantity, terms, fraction, residual)
            top = Format(self.word, fraction).largest
            if value.magnitude <= top:
                break
            if quantity.name in self.forced:
                limit = self._limit_output(quantity, fraction)
                if limit is not None:
                    value = replace(
                        value, low=max(value.low, -limit), high=min(value.high, limit), guarded=True
                    )
                    break
                raise InputError(
                    f"format {Format(self.word, fraction)} of {quantity.name} does not hold its range "
                    f"{(quantity.range + Interval.of(quantity.offset)).text()}"
                    f"{', less ' + str(quantity.offset) if quantity.offset else ''}"
                )
            fraction -= 1
        if kept is not None:
            self.residuals.append(kept)
        self._add(value)

    def _limit_output(self, quantity: exact.Quantity, fraction: int) -> int | None:
        """Return the largest integer of an output whose range is known but not proved: it is checked."""
        for result in self.program.outputs:
            if quantity.name in self.exact.results[result.signal.name]:
                if result.signal.constraint:
                    return math.floor((Fraction(1) + self.settings.allowance) * Fraction(2) ** fraction)
                carried = self._carried_input(result.signal)
                if carried is not None:
                    return carried.high
                if self.program.companions is not None:  # the state of the next step
                    return self.inputs[0].high
        return None

    def _integer_terms(self, quantity: exact.Quantity) -> list[Placed]:
        """Return the terms of a sum as integers, each with its fraction bits and its error."""
        assert isinstance(quantity.definition, exact.Sum)
        terms: list[Placed] = []
        constant = Fraction(0)
        for monomial, coefficient in quantity.definition.terms:
            if not monomial:
                constant = coefficient
                continue
            names = tuple(
                self._word(n) if len(monomial) == 2 or not is_power_of_two(coefficient) else n
                for n in monomial
            )
            values = [self.values[name] for name in names]
            error = self._product_error(values, monomial) * abs(coefficient)
            places = sum(value.fraction for value in values)
            if is_power_of_two(coefficient):
                sign = 1 if coefficient > 0 else -1
                terms.append(Placed(code.Term(names, sign), places - exponent(coefficient), up(error)))
                continue
            factor, bits = self._constant(coefficient)
            wrong = abs(Fraction(factor, 1) / Fraction(2) ** bits - coefficient)
            stored = values[0].magnitude / Fraction(2) ** values[0].fraction
            terms.append(Placed(code.Term(names, factor), places + bits, up(error + wrong * stored)))
        if constant:
            others = [item.place for item in terms]
            fine = max([*others, finest(abs(constant), 2 * self.word - 3) if not is_dyadic(constant) else 0])
            if is_dyadic(constant):
                fine = constant.denominator.bit_length() - 1
            fine = min(fine, 2 * self.word - 3 - math.ceil(abs(constant)).bit_length())
            integer = nearest(constant * Fraction(2) ** fine)
            wrong = abs(integer / Fraction(2) ** fine - constant)
            terms.append(Placed(code.Term((), integer), fine, up(wrong)))
        return terms

    def _product_error(self, values: list[code.Value], monomial: tuple[str, ...]) -> Fraction:
        """Return the error of an exact product of inexact values."""
        if len(values) == 1:
            return values[0].error
        a, b = values
        size_a = self.exact.items[monomial[0]].range.magnitude
        size_b = self.exact.items[monomial[1]].range.magnitude
        return size_a * b.error + size_b * a.error + a.error * b.error

    def _constant(self, value: Fraction) -> tuple[int, int]:
        """Return the nearest word to a number that is no power of two, and its fraction bits."""
        bits = finest(abs(value) * (1 + Fraction(1, 1 << self.word)), self.word)
        integer = nearest(value * Fraction(2) ** bits)
        while integer and integer % 2 == 0:
            integer, bits = integer // 2, bits - 1
        return integer, bits

    def _wide(self, quantity: exact.Quantity, terms: list[Placed], fraction: int) -> None:
        """Keep a sum that is only added, compared or drawn a root from at full precision."""
        while True:
            made, peak, error = aligned(terms, fraction, self.word, self.values)
            if fits(made, peak, self.word, self.values):
                break
            fraction -= 1
        self._add(self._value(quantity, code.IntegerSum(made), fraction, True, error, peak))

    def _rounded(
        self,
        quantity: exact.Quantity,
        terms: list[Placed],
        fraction: int,
        residual: str | None,
    ) -> tuple[code.Value, code.ErrorFeedback | None]:
        """Return a sum as a word."""
        coarse = [item for item in terms if item.place <= fraction]
        fine = [item for item in terms if item.place > fraction]
        added, coarse_peak, coarse_error = aligned(coarse, fraction, self.word, self.values)
        short = InputError(
            f"{self.program.kernel}: words of {self.word} bits are too short for {quantity.name}"
        )
        if not fits(added, coarse_peak, self.word, self.values):
            raise short
        if not fine:
            error = coarse_error
            return self._value(quantity, code.IntegerSum(added), fraction, False, error, coarse_peak), None
        places = max(item.place for item in fine)
        kept: code.ErrorFeedback | None = None
        drop = 0
        while True:
            shift = places - fraction
            if shift < 1:
                raise short
            made, peak, error = aligned(fine, places, self.word, self.values)
            extra = 1 << (shift - 1) if self.settings.rounding == "nearest" else 0
            if residual is not None:
                finer = fraction + self.word
                fresh = 1 << (self.word - 1) if self.settings.rounding == "nearest" else 0
                kept = code.ErrorFeedback(residual, finer, min(0, places - finer), fresh)
                extra = 1 << shift
                drop = max(0, places - finer)
                error += Fraction(2) ** -min(finer, places)
            if shift < 2 * self.word - 1 and fits(made, peak + extra, self.word, self.values):
                break
            places -= 1
        rounding = self.half / Fraction(2) ** fraction
        # With a residual, the result is off by what was left before and what is left now.
        error += coarse_error + (2 * rounding if residual is not None else rounding)
        definition = code.IntegerSum(made, shift - drop, added, kept, drop)
        low_level = max(peak + extra, coarse_peak + ((peak + extra) >> shift) + 1)
        if not fits(added, low_level, self.word, self.values):
            raise short
        value = self._value(quantity, definition, fraction, False, error, low_level)
        if kept is not None:  # whatever integer a caller hands over as a residual
            value = replace(value, low=value.low - 1, high=value.high + 1)
        return value, kept

    def _value(
        self,
        quantity: exact.Quantity,
        definition: code.IntegerDefinition,
        fraction: int,
        wide: bool,
        error: Fraction,
        peak: int,
    ) -> code.Value:
        """Return a value with the range of its integer: that of the quantity, and what rounding adds."""
        unit = Fraction(2) ** fraction
        own = up(error + quantity.inexact)
        error = own + self._following(quantity)
        low, high = quantity.range.lowest, quantity.range.highest
        if quantity.guarded and error > min(abs(low), abs(high)) * _MOST_GUARD_ERROR:
            self._begin_anew(quantity)
            error, limits = Fraction(0), (math.ceil(low * unit), math.floor(high * unit))
        elif quantity.guarded:
            # What passes the check is so far inside that the exact value is in the range too.
            limits = (math.ceil((low + error) * unit), math.floor((high - error) * unit))
        else:
            # What was taken as exact lies in its range too, so that its error does not lead out of this one.
            limits = (math.floor((low - own) * unit), math.ceil((high + own) * unit))
        return code.Value(
            quantity.name,
            definition,
            fraction,
            wide,
            *limits,
            quantity.offset,
            error,
            peak,
            quantity.guarded,
            quantity.meaning,
        )

    def _begin_anew(self, quantity: exact.Quantity) -> None:
        """Take the computed value as exact from here on: nothing is known of how far it is from the exact one.

        What comes after is bounded as a function of the computed value, so that it stays inside its formats; an output
        that depends on it is certified by the range of its signal alone.
        """
        only_checked = all(quantity.name not in exact.used_by(item) for item in self.exact.items.values())
        if only_checked or not self._is_limited() or not self._depends_on_operations(quantity.name):
            raise InputError(
                f"{self.program.kernel}: words of {self.word} bits are too short for {quantity.name}, its error may be "
                "as large as itself"
            )
        self.begun_anew.add(quantity.name)

    def _is_limited(self) -> bool:
        """Tell whether every output has a range by what it is: an attitude."""
        return all(r.signal.constraint and r.signal.bound is not None for r in self.program.outputs)

    def _depends_on_operations(self, name: str) -> bool:
        """Tell whether a value is no polynomial of the inputs, so that no range after it rests on its being one."""
        pending, seen = [name], set[str]()
        while pending:
            reached = pending.pop()
            definition = self.exact.items[reached].definition
            if isinstance(definition, exact.Sum):
                factors = {factor for monomial, _ in definition.terms for factor in monomial}
                pending += factors - seen
                seen |= factors
            elif not isinstance(definition, exact.InputElement):
                return True
        return False

    def _errors(self, signal: Signal, values: list[code.Value]) -> tuple[Fraction, ...]:
        """Return the error bounds of the elements of an output."""
        uncertain = set(self.begun_anew)
        for value in self.body:
            if uncertain.intersection(code.used_by(value)):
                uncertain.add(value.name)
        bound = signal.bound or Fraction(0)
        return tuple(
            bound + value.magnitude / Fraction(2) ** value.fraction
            if value.name in uncertain
            else value.error
            for value in values
        )

    def _following(self, quantity: exact.Quantity) -> Fraction:
        """Return what the errors of quantities add that were taken as exact on the way to this one."""
        follows, total = quantity.follows, Fraction(0)
        if follows is None:
            return total
        for name, slope in follows.slopes:
            error = self.values[self._word(name)].error
            if error:
                total += follows.most if slope is None else slope * error
        return up(min(total, follows.most))

    def _add(self, value: code.Value) -> None:
        self.values[value.name] = value
        self.body.append(value)
        self._count(value)

    # What is no sum

    def _word(self, name: str) -> str:
        """Return the value as a word, rounded from the wide one if it is needed."""
        value = self.values[name]
        if not value.wide:
            return name
        rounded = f"{name}_word"
        if rounded not in self.values:
            item = self.exact.items[name]
            quantity = replace(
                item, name=rounded, meaning="", guarded=False, inexact=Fraction(0), follows=None
            )
            fraction = min(finest(item.range.magnitude, self.word), value.fraction)
            terms = [Placed(code.Term((name,), 1), value.fraction, value.error)]
            while True:
                made, _ = self._rounded(quantity, terms, fraction, None)
                if made.magnitude <= Format(self.word, fraction).largest:
                    break
                fraction -= 1
            self._add(made)
        return rounded

    def _sides(
        self, operands: Iterable[exact.Operand], lossless: bool = True
    ) -> tuple[list[code.Scaled], int, Fraction]:
        """Return operands as integers of one fraction, their fraction bits, and the largest error.

        Unless it must be `lossless`, the fraction is one at which all of them have room.
        """
        operands = list(operands)
        places = [self.values[o].fraction for o in operands if isinstance(o, str)]
        for operand in operands:
            if isinstance(operand, Fraction):
                places.append(operand.denominator.bit_length() - 1 if is_dyadic(operand) else self.word)
        room = largest_wide(self.word)
        fraction = max(places)

        def size(operand: exact.Operand) -> int:
            if isinstance(operand, Fraction):
                return abs(nearest(operand * Fraction(2) ** fraction))
            value = self.values[operand]
            return math.ceil(value.magnitude * Fraction(2) ** (fraction - value.fraction))

        while not lossless and max(map(size, operands)) > room:
            fraction -= 1
        scaled: list[code.Scaled] = []
        error = Fraction(0)
        for operand in operands:
            if isinstance(operand, Fraction):
                integer = nearest(operand * Fraction(2) ** fraction)
                error = max(error, abs(integer / Fraction(2) ** fraction - operand))
                scaled.append(code.Scaled(integer))
            else:
                value = self.values[operand]
                lost = Fraction(2) ** -fraction if fraction < value.fraction else Fraction(0)
                error = max(error, value.error + lost)
                scaled.append(code.Scaled(operand, fraction - value.fraction))
            if size(operand) > room:
                raise InputError(
                    f"{self.program.kernel}: words of {self.word} bits are too short to compare {operand}"
                )
        return scaled, fraction, error

    def _taken(self, quantity: exact.Quantity, definition: exact.Computed) -> None:
        """Keep the computed value inside the range of the exact one, which brings it no farther from that."""
        name = self._word(definition.argument)
        value = self.values[name]
        unit = Fraction(2) ** value.fraction
        low, high = math.ceil(quantity.range.lowest * unit), math.floor(quantity.range.highest * unit)
        if low > high:
            raise InputError(
                f"{self.program.kernel}: words of {self.word} bits are too short for {definition.argument}"
            )
        cases: list[tuple[code.Scaled, code.Scaled, code.Scaled]] = []
        for left, right, beyond in ((name, high, value.high > high), (low, name, value.low < low)):
            if beyond:
                limit = left if isinstance(left, int) else right
                cases.append((code.Scaled(left), code.Scaled(right), code.Scaled(limit)))
        kept: code.IntegerDefinition = code.IntegerSelection(tuple(cases), code.Scaled(name))
        if not cases:
            kept = code.IntegerSum((code.Term((name,), 1),))
        limits = max(low, value.low), min(high, value.high)
        made = self._value(quantity, kept, value.fraction, False, Fraction(0), value.magnitude)
        self._add(replace(made, low=limits[0], high=limits[1]))

    def _nearest(self, quantity: exact.Quantity, definition: exact.NearestInteger) -> None:
        """Round a multiple to an integer, halves up whatever the rounding of words is."""
        name = self._word(definition.argument)
        value = self.values[name]
        factor = definition.factor.numerator
        shift = value.fraction + definition.factor.denominator.bit_length() - 1
        if shift < 1:
            raise InputError(f"{self.program.kernel}: words of {self.word} bits are too short for {name}")
        half = 1 << (shift - 1)
        terms = [code.Term((name,), factor)]
        if self.settings.rounding != "nearest":
            terms.append(code.Term((), half))
        made = self._value(
            quantity,
            code.IntegerSum(tuple(terms), shift),
            0,
            False,
            Fraction(0),
            value.magnitude * abs(factor) + half,
        )
        ends = sorted((end * factor + half) >> shift for end in (value.low, value.high))
        self._add(replace(made, low=ends[0], high=ends[1]))

    def _largest(self, quantity: exact.Quantity, definition: exact.Maximum) -> None:
        scaled, fraction, error = self._sides(definition.arguments)
        self._finish(quantity, code.IntegerMaximum(tuple(scaled)), fraction, error)

    def _choice(self, quantity: exact.Quantity, definition: exact.Selection) -> None:
        values, fraction, error = self._sides(
            [*(case[2] for case in definition.cases), definition.otherwise], lossless=False
        )
        cases: list[tuple[code.Scaled, code.Scaled, code.Scaled]] = []
        for (left, right, _), value in zip(definition.cases, values, strict=False):
            (one, other), _, _ = self._sides([left, right])
            cases.append((one, other, value))
            wrong = sum(self.values[side].error for side in (left, right) if isinstance(side, str))
            if wrong:  # the other branch may be taken
                error += quantity.range.highest - quantity.range.lowest
        self._finish(quantity, code.IntegerSelection(tuple(cases), values[-1]), fraction, error)

    def _finish(
        self, quantity: exact.Quantity, definition: code.IntegerDefinition, fraction: int, error: Fraction
    ) -> None:
        made = self._value(quantity, definition, fraction, True, error, 0)
        peak = made.magnitude
        wide = peak > Format(self.word, fraction).largest
        self._add(replace(made, wide=wide, peak=peak))

    def _root(self, quantity: exact.Quantity, definition: exact.SquareRoot) -> None:
        argument = self.values[definition.argument]
        inside = self.exact.items[definition.argument].range
        # As many places below the argument as a wide number has room for, an even number of them in all.
        room = 2 * self.word - 3
        shift = room - max(1, argument.high).bit_length()
        shift -= (argument.fraction + shift) % 2
        fraction = (argument.fraction + shift) // 2
        lost = argument.error + (Fraction(2) ** -(2 * fraction) if shift < 0 else 0)
        least = inside.lowest - lost
        near_zero = Interval.of(0, lost).sqrt().highest
        error = lost / (2 * Interval.of(least).sqrt().lowest) if least > 0 else near_zero
        error += self.half / Fraction(2) ** fraction
        scaled = code.Scaled(definition.argument, shift)
        peak = argument.high << shift if shift > 0 else argument.high
        made = self._value(quantity, code.IntegerRoot(scaled), fraction, False, error, peak)
        self._add(replace(made, low=max(made.low, 0), high=min(made.high, 1 << (self.word - 1))))
        self._check_word(quantity.name)

    def _check_word(self, name: str) -> None:
        value = self.values[name]
        if value.magnitude > Format(self.word, value.fraction).largest:
            raise InputError(f"{self.program.kernel}: words of {self.word} bits are too short for {name}")

    def _quotient(self, quantity: exact.Quantity, definition: exact.Quotient) -> None:
        below_name, numerator = definition.denominator, definition.numerator
        if self.values[below_name].error:  # what is exact, a wide number too, stays so
            below_name = self._word(below_name)
        below = self.values[below_name]
        if isinstance(numerator, str) and self.values[numerator].error:
            numerator = self._word(numerator)
        (top,), top_fraction, top_error = self._sides([numerator])
        size = abs(top.value) if isinstance(top.value, int) else self.values[top.value].magnitude
        fraction = self.forced.get(quantity.name, finest(quantity.range.magnitude, self.word))
        least = min(abs(below.low), abs(below.high))
        while True:
            shift = fraction + below.fraction - top_fraction
            room = largest_wide(self.word) - below.magnitude
            error = (top_error + quantity.range.magnitude * below.error) / (
                Fraction(least) / Fraction(2) ** below.fraction
            )
            error += self.half / Fraction(2) ** fraction
            made = self._value(
                quantity,
                code.IntegerQuotient(code.Scaled(top.value, top.shift + shift), below_name),
                fraction,
                False,
                error,
                size << max(0, shift),
            )
            fits = made.magnitude <= Format(self.word, fraction).largest
            if fits and shift >= 0 and size << shift <= room:
                break
            if quantity.name in self.forced or fraction < -self.word:
                raise InputError(
                    f"{self.program.kernel}: words of {self.word} bits are too short for {quantity.name}"
                )
            fraction -= 1
        self._add(made)

    # Around the code

    def _output(self, signal: Signal) -> code.Argument:
        names = tuple(name for name in self.exact.results[signal.name] if isinstance(name, str))
        values = [self.values[name] for name in names]
        fractions = {value.fraction for value in values}
        assert len(fractions) == 1, f"elements of {signal.name} have different formats"
        low, high = min(value.low for value in values), max(value.high for value in values)
        format_ = Format(self.word, fractions.pop())
        return code.Argument(signal, format_, names, low, high, self._errors(signal, values))

    def _count(self, value: code.Value) -> None:
        """Count the integer operations of a value."""
        count, definition = self.operations, value.definition
        if isinstance(definition, code.IntegerSum):
            terms = [*definition.fine, *definition.coarse]
            count["add"] += max(0, len(terms) - 1)
            count["multiply"] += sum(
                len(t.names) == 2 or (abs(t.factor) != 1 and bool(t.names)) for t in terms
            )
            count["shift"] += sum(bool(t.shift) for t in terms) + bool(definition.shift)
            plain = definition.shift and definition.residual is None
            count["add"] += bool(plain) and self.settings.rounding == "nearest"
            if definition.residual is not None:
                count["add"] += 1
                count["shift"] += bool(definition.residual.shift) * 2 + bool(definition.drop)
        elif isinstance(definition, code.IntegerQuotient):
            count["divide"] += 1
        elif isinstance(definition, code.IntegerRoot):
            count["sqrt"] += 1
        elif isinstance(definition, code.IntegerMaximum):
            count["compare"] += len(definition.arguments) - 1
        elif isinstance(definition, code.IntegerSelection):
            count["compare"] += len(definition.cases)
