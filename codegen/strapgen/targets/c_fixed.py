"""The fixed-point C target: a header with the contract of every function, and a C99 source on integers alone.

The code has no undefined or implementation-defined behaviour, and returns an error code for input out of range.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace

from strapgen.ir.formats import signed_digits
from strapgen.ir.integer_program import (
    FixedProgram,
    IntegerOperation,
    IntegerSum,
    Scaled,
    Term,
    Value,
    cases_of,
    used_by,
)
from strapgen.ir.interfaces import Argument
from strapgen.ir.sources import Sources
from strapgen.targets import contract, contract_lines
from strapgen.targets.c_numbers import WORDS, Word, memory_type
from strapgen.targets.names import C, Language, function_name, printed
from strapgen.targets.printer import fill_expression
from strapgen.targets.rendering import PROPAGATE, macros_of_fixed, own_call, render_c, runs_of


def emit(fixed: FixedProgram, target: str) -> Sources:
    """Print a function on one sample (<name>.h and .c), and loops over samples and, of a step, over runs beside it."""
    name = function_name(fixed.program, f"_w{fixed.word}")
    return sources_of(fixed, target, name, _files, C, runs_of(name))


def sources_of(
    fixed: FixedProgram,
    target: str,
    name: str,
    files: Callable[[FixedProgram, str, str], dict[str, str]],
    language: Language,
    runs: tuple[str, str],
) -> Sources:
    """Print a program in a language whose function on arrays has the interface of C.

    `files` returns the text of the files of a program with its printed names.
    """
    interface = fixed.interface
    arguments = (*interface.inputs, *interface.outputs)
    scalars = [argument.signal.name for argument in arguments if not argument.signal.shape]
    _, texts = printed(fixed, lambda named, _: files(named, name, target), language, scalars)
    return Sources.of(fixed, target, name, texts, runs=runs)


def _files(fixed: FixedProgram, name: str, target: str) -> dict[str, str]:
    """Return the header and the source of a program with its printed names."""
    printer = StatementPrinter(fixed, WORDS[fixed.word].within(name), name)
    values = values_of(fixed, name, target, printer) | {
        "guard": f"{name}_h".upper(),
        "definitions": macros_of_fixed(fixed, name),
    }
    return render_c("c_fixed", name, **values)


def values_of(fixed: FixedProgram, name: str, target: str, printer: StatementPrinter) -> dict[str, object]:
    """Return the values for the templates of fixed point in every language, those of the C interface among them."""
    interface, word = fixed.interface, WORDS[fixed.word].within(name)
    signals = [(a.signal, f"const {memory_type(a)}") for a in interface.inputs]
    signals += [(a.signal, memory_type(a)) for a in interface.outputs]
    feedback_words = len(interface.residuals)
    pieces = [f"{kind} {printer.memory(s.name)}[{s.size}]" for s, kind in signals]
    arrays = [f"{kind} *{s.name}" for s, kind in signals]
    calls = [f"{s.name} + {s.size} * k" for s, _ in signals]
    if feedback_words:
        place = len(interface.inputs)
        pieces.insert(place, f"{word.residual} residuals[{feedback_words}]")
        arrays.insert(place, f"{word.residual} *residuals")
        calls.insert(place, f"residuals + {feedback_words} * k")
    command = contract.command(fixed, target)
    memory = {signal.name: printer.memory(signal.name) for signal, _ in signals}
    return {
        "fixed": fixed,
        "target": target,
        "program": fixed.program,
        "interface": interface,
        "word": word,
        "cast": printer.cast,
        "state": interface.inputs[0].signal,
        "samples": interface.inputs[-1].signal,
        "residuals": feedback_words,
        "parameters": ", ".join(pieces),
        "own": own_call(pieces, name),
        "propagate_parameters": ", ".join(
            [
                *PROPAGATE,
                f"{name}_orthonormalizer orthonormalize",
                f"const {word.type} *initial",
                f"const {memory_type(interface.inputs[-1])} *{interface.inputs[-1].signal.name}",
                *([f"{word.residual} *residuals"] if feedback_words else []),
                f"{word.type} *history",
                "size_t *stopped",
            ]
        ),
        "arrays": ", ".join(arrays),
        "calls": ", ".join(calls),
        "code": printer.code(),
        "counts": ", ".join(f"{number} {kind}" for kind, number in fixed.operations.items() if number),
        "nearest": interface.settings.rounding == "nearest",
        "fresh": dict.fromkeys(f"UINT{fixed.word}_C({r.fresh})" for r in interface.residuals),
        "uses": printer.uses,
        "memory": memory,
        "command": command,
        "contract": contract_lines.of_fixed(fixed, name, command, memory),
        "normalizing": contract.upkeep_text(fixed.program, interface, target),
        "range_checked": tuple(value for value in fixed.body if value.range_checked),
    }


class StatementPrinter:
    """Prints the values of a fixed-point program as C statements."""

    def __init__(self, fixed: FixedProgram, word: Word, name: str) -> None:
        self.fixed, self.word, self.name = fixed, word, name
        self.uses: set[str] = set()
        self.wide_names = {value.name for value in fixed.body if value.wide}
        self.places = {feedback.name: k for k, feedback in enumerate(fixed.interface.residuals)}
        self.checks = any(value.range_checked for value in fixed.body)
        self.rounding = fixed.interface.settings.rounding
        self.adds_shifted = fixed.interface.settings.multiply == "shift-add"
        # A file that multiplies nothing else has no function for squares, whose text needs that for products.
        self.has_products = any(
            len({*term.names}) == 2 or (term.names and abs(term.factor) != 1 and not self.adds_shifted)
            for value in fixed.body
            if isinstance(value.definition, IntegerSum)
            for term in (*value.definition.fine, *value.definition.coarse)
        )
        self.negated = _negated(fixed) if word.bits == 32 else frozenset[str]()
        self.names = {value.name for value in fixed.body}
        self.names |= {name for argument in fixed.interface.inputs for name in argument.signal.elements}

    def memory(self, name: str) -> str:
        """Return the name of an argument's array; it differs from the names of all values."""
        return f"{name}_words" if name in self.names else name

    def code(self) -> dict[str, list[str]]:
        """Return the statements of one call: loads, checks of the inputs, the body, stores."""
        interface, kind = self.fixed.interface, self.word.fast
        used = {name for value in self.fixed.body for name in used_by(value)}
        loads, checks = list[str](), list[str]()
        for argument in interface.inputs:
            of_argument = []
            largest = argument.format.largest
            whole = (argument.low, argument.high) == (-largest - 1, largest)  # whatever the memory holds
            assert whole or argument.low == -argument.high, "inputs have symmetric ranges"
            limit = self.constant(argument.high)
            for number, element in enumerate(argument.signal.elements):
                source = f"{self.memory(argument.signal.name)}[{number}]"
                if element in used:
                    loads.append(self.loaded(kind, element, source, argument))
                    source = element
                if not whole:
                    number_ = source if element in used else self.read(kind, source, argument)
                    of_argument.append(self._call("out", number_, limit))
            # The state comes last: it is needed last, and until then its registers are free.
            checks = of_argument + checks
        body = [line for value in self.fixed.body for line in self.statements(value)]
        stores = [
            f"{self.memory(argument.signal.name)}[{number}] = {self._stored(name)};"
            for argument in interface.outputs
            for number, name in enumerate(argument.values)
        ]
        if self.checks:
            stores += [f"residuals[{k}] = next_{r.name};" for k, r in enumerate(interface.residuals)]
        return {"loads": loads, "checks": checks, "body": body, "stores": stores}

    def _stored(self, name: str) -> str:
        return name if self.word.fast == self.word.type else self.cast(self.word.type, name)

    def _call(self, helper: str, *arguments: str) -> str:
        """Return a call of one of the file's own functions."""
        self.uses.add(helper)
        return f"{self.helper(helper)}({', '.join(arguments)})"

    # What differs between languages

    def helper(self, name: str) -> str:
        """Return the name of one of the file's own functions."""
        return f"{self.name}_{name}"

    def cast(self, kind: str, text: str = "") -> str:
        """Return a name, a number or an expression in parentheses in another type; without it the cast alone."""
        return f"({kind}){text}"

    def read(self, kind: str, source: str, argument: Argument) -> str:
        """Return an element of an argument as a number of a type; C converts it by itself."""
        return source

    def loaded(self, kind: str, name: str, source: str, argument: Argument) -> str:
        """Return the declaration of an element of an argument."""
        return f"const {kind} {name} = {self.read(kind, source, argument)};"

    def start(self, kind: str, name: str, constant: bool = True) -> str:
        """Return the beginning of a value's declaration."""
        return f"{'const ' * constant}{kind} {name} ="

    def unset(self, kind: str, name: str) -> str:
        """Return the declaration of a value that a branch sets."""
        return f"{kind} {name};"

    def refusal(self) -> str:
        """Return the statement that refuses a value on the way."""
        return "return 2;"

    def as_wide(self, name: str) -> str:
        """Return a value where a wide number is needed; C converts it by itself."""
        return name

    def _declared(self, kind: str, name: str, text: str, note: str = "", constant: bool = True) -> str:
        """Return a declaration, with its value on the next line if the first line would be too long."""
        indent, start = " " * 8, self.start(kind, name, constant)
        statement = fill_expression(f"{start} {text};", indent, 92)
        if len(statement.partition("\n")[0]) > 92:
            statement = f"{start}\n" + fill_expression(f"{indent}{text};", indent, 96)
        return _with_comment(statement, note) if note else statement

    def statements(self, value: Value) -> list[str]:
        """Return the statements that compute a value."""
        lines = [f"/* {value.meaning} */"] if value.meaning else []
        kind = self.word.wide if value.wide else self.word.fast
        name, note = value.name, contract.value_text(value, self.word.bits)
        match value.definition:
            case IntegerSum() as total:
                lines += self._sum(value, total, kind, note)
            case IntegerOperation("divide", (numerator, denominator)):
                text = self._call("div", self.scaled(numerator), self.as_wide(str(denominator.value)))
                lines.append(self._declared(kind, name, self.narrow(text, value), note))
            case IntegerOperation("sqrt", (argument,)):
                text = self._call("rt", self.scaled(argument))
                lines.append(self._declared(kind, name, text, note))
            case IntegerOperation("maximum", (first, *others)):
                lines.append(self._declared(kind, name, self.narrowed(first, value), note, constant=False))
                for other in others:
                    lines.append(_branch("if", self.scaled(other), ">", self.as_wide(name)))
                    lines.append(_assign(name, self.narrowed(other, value)))
                    lines.append("}")
            case IntegerOperation("select", arguments):
                lines += self._selection(value, kind, arguments, note)
        # The word of a sum is checked before it is narrowed.
        if value.range_checked and (value.wide or not self._checked_in_sum(value)):
            lines += self._guard(name, value)
        return lines

    @staticmethod
    def _checked_in_sum(value: Value) -> bool:
        return isinstance(value.definition, IntegerSum) and not value.definition.in_words

    def _selection(self, value: Value, kind: str, arguments: Sequence[Scaled], note: str) -> list[str]:
        """Return a chain of conditions, the first that holds before all others."""
        lines = [_with_comment(self.unset(kind, value.name), note)]
        for number, (left, right, result) in enumerate(cases_of(arguments)):
            word = "if" if not number else "} else if"
            lines.append(_branch(word, self.scaled(left), ">=", self.scaled(right)))
            lines.append(_assign(value.name, self.narrowed(result, value)))
        lines.append("} else {")
        lines.append(_assign(value.name, self.narrowed(arguments[-1], value)))
        return [*lines, "}"]

    def _guard(self, name: str, value: Value) -> list[str]:
        limits = self.constant(value.low), self.constant(value.high)
        condition = f"if (({name} < {limits[0]}) || ({name} > {limits[1]})) {{"
        if len(condition) > 90:
            first, second = condition.split(" || ")
            indent = " " * 12
            condition = (
                f"{fill_expression(first, indent, 95)}\n        {fill_expression(f'|| {second}', indent, 87)}"
            )
        return [condition, f"    {self.refusal()}", "}"]

    def narrow(self, text: str, value: Value, shift: int = 0) -> str:
        """Return an expression of a wide number, shifted down, as one of the value's type."""
        if value.wide:
            return self._shifted(text, shift) if shift else text
        return self._call("fit", text, str(shift))

    def narrowed(self, scaled: Scaled, value: Value) -> str:
        """Return a scaled value as one of another value's type."""
        name = scaled.value
        if isinstance(name, str) and not (value.wide or scaled.shift or name in self.wide_names):
            return name
        return self.narrow(self.scaled(scaled), value)

    def _sum(self, value: Value, definition: IntegerSum, kind: str, note: str) -> list[str]:
        name, wide = value.name, self.word.wide
        if definition.halves:
            return [self._declared(kind, name, self._half(definition), note)]
        fine = self._join([self.term(term) for term in definition.fine])
        if not definition.shift:
            terms = (*definition.coarse, *definition.fine)
            if definition.in_words and all(map(self._is_word, terms)):
                text = self._join([self.word_term(term) for term in terms])
                return [self._declared(kind, name, text or "0", note)]
            return self._result(value, kind, self._join([self.term(term) for term in terms]) or "0", note)
        feedback, lines, shift = definition.residual, [], definition.shift
        half = definition.half(self.rounding)
        in_words = definition.in_words and all(map(self._is_word, definition.coarse))
        if feedback is None:
            total = f"{fine} + {self.constant(half, wide=True)}" if half else fine
        else:
            place = f"residuals[{self.places[feedback.name]}]"
            fed_back = self._scaled_text(self.cast(wide, place), feedback.shift)
            before = self._shifted(fine, definition.drop) if definition.drop else fine
            lines.append(self._declared(wide, f"{name}_sum", f"{before} + {fed_back}"))
            left = f"{name}_sum"
            if feedback.shift:
                left = f"{self.cast(self.word.magnitude, left)} << {-feedback.shift}"
            word = self.word.residual
            text = self.cast(word, f"({left})")
            if self.checks:  # a call that a later check refuses leaves it as it was
                lines.append(self._declared(word, f"next_{feedback.name}", text))
            else:
                lines.append(f"{place} = {text};")
            total = f"{name}_sum"
        if in_words:
            words = [self.word_term(term) for term in definition.coarse]
            rounded = f"+{self._rounded(value, definition, fine, total)}"
            text = self._join([*words[:1], rounded, *words[1:]])
            return [*lines, self._declared(kind, name, text, note)]
        coarse = [self.term(term) for term in definition.coarse]
        if not coarse and not value.range_checked and not value.saturated:
            return [*lines, self._declared(kind, name, self.narrow(total, value, shift), note)]
        rounded = f"+{self._shifted(total, shift)}"
        return lines + self._result(value, kind, self._join([*coarse[:1], rounded, *coarse[1:]]), note)

    def _half(self, definition: IntegerSum) -> str:
        """Return a high word from half words."""
        (term,) = definition.fine
        self.uses.add("asr")
        factor = [self.constant(term.factor) + _exactly(term, term.factor)] * (len(term.names) == 1)
        return self._call("half", *term.names, *factor)

    def _result(self, value: Value, kind: str, text: str, note: str) -> list[str]:
        """Return the statements that store a sum; a word with a range check is checked before it is narrowed."""
        if value.range_checked and not value.wide:
            name = f"{value.name}_raw"
            return [
                self._declared(self.word.wide, name, text),
                *self._guard(name, value),
                self._declared(kind, value.name, self.narrow(name, value), note),
            ]
        if value.saturated:
            return [self._declared(kind, value.name, self._call("sat", text), note)]
        return [self._declared(kind, value.name, self.narrow(text, value), note)]

    def _rounded(self, value: Value, definition: IntegerSum, fine: str, total: str) -> str:
        """Return what is rounded in a sum as a word; `total` is `fine` and what is added to it before the shift."""
        half, shift, word = definition.half(self.rounding), definition.shift, self.word.bits
        if self._is_short(value, definition):
            inside = [self.word_term(term) for term in definition.fine]
            inside += [f"+{self.constant(half)}"] * bool(half)
            return self._call("asr", self._join(inside), str(shift))
        if word == 32 and shift >= word and definition.residual is None:
            # What has nothing in the low word is added to the high one.
            above = [t for t in definition.fine if t.shift >= word and (not t.names or self._is_word(t))]
            if not half and not above:
                return self._call("fit", fine, str(shift))
            below = self._join([self.term(term) for term in definition.fine if term not in above])
            high = (
                self._call("near", below) if half and shift == word else self._call("fit", below, str(word))
            )
            words = [self.word_term(replace(term, shift=term.shift - word)) for term in above]
            words += [f"+{self.constant(half >> word)}"] * bool(half >> word)
            high = self._join([high, *words])
            if shift > word:
                return self._call("asr", high, str(shift - word))
            return f"({high})" if words else high
        return self._call("fit", total, str(shift))

    def _is_short(self, value: Value, definition: IntegerSum) -> bool:
        """Return whether what is rounded in a sum is computed in words."""
        largest = (1 << (self.word.bits - 1)) - 1
        fits = value.peak <= largest and definition.shift < self.word.bits
        return fits and definition.residual is None and all(map(self._is_word, definition.fine))

    def _is_word(self, term: Term) -> bool:
        """Return whether a term is a word, or a small multiple of one, so that it is computed in words."""
        return not term.names or (
            len(term.names) == 1
            and term.names[0] not in self.wide_names
            and abs(term.factor) == 1
            and term.shift >= 0
        )

    def word_term(self, term: Term) -> str:
        """Return a term that is a word, its sign in front."""
        sign = "-" if term.factor < 0 else "+"
        if not term.names:
            return sign + self.constant(abs(term.factor) << term.shift) + _exactly(term)
        (name,) = term.names
        return sign + (f"{name} * {self.constant(1 << term.shift)}" if term.shift else name)

    @staticmethod
    def _join(terms: list[str]) -> str:
        """Return signed terms as a sum."""
        text = ""
        for term in terms:
            sign, rest = (term[0], term[1:]) if term[:1] in "+-" else ("+", term)
            text += f" {sign} {rest}" if text else (f"-{rest}" if sign == "-" else rest)
        return text

    def term(self, term: Term) -> str:
        """Return a term as an expression of a wide number, its sign in front."""
        wide = self.word.wide
        sign = "-" if term.factor < 0 else "+"
        if not term.names:
            value = term.factor << term.shift if term.shift > 0 else term.factor
            return sign + self.constant(abs(value), wide=True) + _exactly(term)
        factors = list(term.names)
        if sign == "-" and (negated := self._negated_product(term)):
            return negated
        if abs(term.factor) != 1 and self.adds_shifted:
            factors = [self._shifted_terms(term)]
        elif abs(term.factor) != 1:
            factors.append(self.constant(abs(term.factor)) + _exactly(term))
        if len(factors) == 2:
            first, second = factors
            square = first == second and self.has_products
            text = self._call("sqr", first) if square else self._call("mul", first, second)
        else:
            (text,) = factors
            is_wide = text in self.wide_names or text.startswith("(")
            text = text if is_wide else self.cast(wide, text)
        if term.shift < 0 and term.factor < 0:  # what is shifted down is the signed product
            return f"+{self._scaled_text(f'-{text}', term.shift)}"
        return sign + self._scaled_text(text, term.shift)

    def _negated_product(self, term: Term) -> str:
        """Return a product less than zero as one of a negated factor, so that it can be accumulated; "" without one."""
        if self.word.bits != 32 or self.adds_shifted:
            return ""
        if len(term.names) == 2:
            factor = next((name for name in term.names if name in self.negated), "")
            if not factor:
                return ""
            (other,) = [name for name in term.names if name != factor] or [factor]
            text = self._call("nml", other, factor)
            self.uses.add("mul")
        else:
            if abs(term.factor) == 1:
                return ""
            number = self.constant(term.factor) + _exactly(term, -1)
            text = self._call("mul", term.names[0], number)
        return f"+{self._scaled_text(text, term.shift)}"

    def _shifted_terms(self, term: Term) -> str:
        """Return a value times the magnitude of a constant as a sum of shifted terms, in brackets."""
        (name,) = term.names
        terms = [
            f"{'+' if digit > 0 else '-'}{self.cast(self.word.wide, name)}"
            + (f" * {self.constant(1 << power, wide=True)}" if power else "")
            for digit, power in signed_digits(abs(term.factor))
        ]
        return f"({self._join(terms)}){_exactly(term)}"

    def _scaled_text(self, text: str, shift: int) -> str:
        """Return an expression times a power of two."""
        if not shift:
            return text
        return (
            f"{text} * {self.constant(1 << shift, wide=True)}" if shift > 0 else self._shifted(text, -shift)
        )

    def _shifted(self, text: str, shift: int) -> str:
        return self._call("shr", text, str(shift)) if shift else text

    def scaled(self, scaled: Scaled) -> str:
        """Return a scaled value as an expression of a wide number."""
        if isinstance(scaled.value, int):
            return self.constant(
                scaled.value << scaled.shift if scaled.shift > 0 else scaled.value, wide=True
            )
        name = scaled.value
        text = name if name in self.wide_names else self.cast(self.word.wide, name)
        return self._scaled_text(text, scaled.shift)

    def constant(self, value: int, wide: bool = False) -> str:
        """Return an integer as a constant expression, with the type of a wide number if `wide` is true."""
        if value < 0:
            return f"(-{self.constant(-value, wide)})"
        if value >= 1 << 4 and not value & (value - 1):
            return self._power_of_two(value.bit_length() - 1)
        if value < 1 << 15:
            return self.cast(self.word.wide, str(value)) if wide and self.word.bits == 64 else str(value)
        if value < 1 << 31:
            return f"INT32_C({value})"
        if value < 1 << 63:
            return f"INT64_C({value})"
        high, low = divmod(value, 1 << 62)
        text = f"{self.cast(self.word.wide, self.constant(high))} * (INT64_C(1) << 62)"
        return f"({text} + INT64_C({low}))" if low else f"({text})"

    def _power_of_two(self, exponent: int) -> str:
        if exponent < 15:
            return f"(INT16_C(1) << {exponent})"
        if exponent < 31:
            return f"(INT32_C(1) << {exponent})"
        if exponent < 63:
            return f"(INT64_C(1) << {exponent})"
        return f"({self.cast(self.word.wide, '1')} << {exponent})"


def _negated(fixed: FixedProgram) -> frozenset[str]:
    """Return the factors to negate so that as many products less than zero as possible are accumulated: few of them."""
    ranges = {name: a.low for a in fixed.interface.inputs for name in a.signal.elements}
    ranges |= {value.name: value.low for value in fixed.body}
    products = [
        {*term.names}
        for value in fixed.body
        if isinstance(value.definition, IntegerSum)
        for term in (*value.definition.fine, *value.definition.coarse)
        if len(term.names) == 2 and term.factor < 0
    ]
    uses = Counter(name for value in fixed.body for name in used_by(value))
    chosen: set[str] = set()
    while products := [pair for pair in products if not pair & chosen]:
        # The negative of the lowest number of a word is none.
        names = [
            name for pair in products for name in sorted(pair) if ranges[name] > -(1 << (fixed.word - 1))
        ]
        if not names:
            break
        # Of those in equally many, the one that is soonest needed no more.
        chosen.add(max(dict.fromkeys(names), key=lambda name: (names.count(name), -uses[name])))
    return frozenset(chosen)


def _exactly(term: Term, sign: int = 1) -> str:
    """Return the exact number that a rounded constant stands for, as a comment; with the factor's sign if -1."""
    if (
        term.coefficient is None
        or term.coefficient.value.denominator & (term.coefficient.value.denominator - 1) == 0
    ):
        return ""
    text = contract.exact_text(abs(term.coefficient.value))
    return f" /* {'-' * (sign < 0)}{text} in Q{term.coefficient.fraction} */"


def _branch(word: str, left: str, sign: str, right: str) -> str:
    """Return the head of a branch that compares two numbers."""
    text = f"{word} ({left} {sign} {right}) {{"
    return text if len(text) <= 95 else f"{word} ({left}\n        {sign} {right}) {{"


def _assign(name: str, text: str) -> str:
    """Return an assignment inside a block."""
    return fill_expression(f"    {name} = {text};", " " * 12, 95)


def _with_comment(statement: str, note: str) -> str:
    """Return a statement with a comment behind it, or on the next line where there is no room."""
    beside = len(statement.rpartition("\n")[2]) + len(note) + 7 <= 95
    return f"{statement} /* {note} */" if beside else f"{statement}\n        /* {note} */"
