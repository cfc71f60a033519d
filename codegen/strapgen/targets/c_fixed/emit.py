"""The fixed-point C target: a header with the contract of every function, and a C99 source on integers alone.

The code has no undefined or implementation-defined behaviour, and returns an error code for input out of range.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from strapgen.ir.integer_program import (
    FixedProgram,
    IntegerMaximum,
    IntegerQuotient,
    IntegerRoot,
    IntegerSelection,
    IntegerSum,
    Scaled,
    Term,
    Value,
    used_by,
)
from strapgen.ir.sources import Function, Sources
from strapgen.targets.lines import fill_expression
from strapgen.targets.names import C, external, printed
from strapgen.targets.rendering import render


@dataclass(frozen=True)
class Word:
    """The C types for words of one length.

    Parameters
    ----------
    bits : int
    type, residual : str
        Types of a word in memory, and of an error feedback, which has no sign.
    fast : str
        Type of a word in a calculation: the fastest of the processor that is long enough.
    wide, magnitude : str
        Types of a product, and of the magnitude of a product. C has none for words of 64 bits: a file defines them
        under names of its own.
    """

    bits: int
    type: str
    residual: str
    fast: str
    wide: str
    magnitude: str

    def within(self, name: str) -> Word:
        """Return the types as the file of a function calls them."""
        return replace(self, wide=self.wide.format(name), magnitude=self.magnitude.format(name))


WORDS = {
    16: Word(16, "int16_t", "uint16_t", "int", "int32_t", "uint32_t"),
    32: Word(32, "int32_t", "uint32_t", "int_fast32_t", "int64_t", "uint64_t"),
    64: Word(64, "int64_t", "uint64_t", "int64_t", "{}_wide_", "{}_magnitude_"),
}


def emit(fixed: FixedProgram, target: str) -> Sources:
    """Print a C header and source for a program.

    Parameters
    ----------
    fixed : FixedProgram
        With a word of `WORDS`.
    target : str
        Name of the target.

    Returns
    -------
    Sources
        Two files. The function ``<name>`` works on one sample, ``<name>_array`` on many; a step has
        ``<name>_propagate`` too, the loop over runs and steps.
    """
    interface, name = fixed.interface, external(fixed.program.name, f"_q{fixed.word - 1}")
    arguments = (*interface.inputs, *interface.outputs)
    scalars = [argument.signal.name for argument in arguments if not argument.signal.shape]
    _, files = printed(fixed, lambda named, _: _files(named, name, target), C, scalars)
    function = Function(
        name, *(tuple(a.signal for a in side) for side in (interface.inputs, interface.outputs))
    )
    return Sources(
        fixed.program.kernel,
        target,
        files,
        function,
        fixed.operations,
        fixed.temporaries,
        fixed.program.companions,
        interface,
        fixed.program.recursion,
    )


def _files(fixed: FixedProgram, name: str, target: str) -> dict[str, str]:
    """Return the header and the source of a program with its printed names."""
    interface, word = fixed.interface, WORDS[fixed.word].within(name)
    printer = _Printer(fixed, word, name)
    signals = [(a.signal, "const ") for a in interface.inputs] + [(a.signal, "") for a in interface.outputs]
    feedback_words = len(interface.residuals)
    pieces = [f"{constant}{word.type} {s.name}[{s.size}]" for s, constant in signals]
    inner = [f"{constant}{word.type} {printer.memory(s.name)}[{s.size}]" for s, constant in signals]
    arrays = [f"{constant}{word.type} *{s.name}" for s, constant in signals]
    calls = [f"{s.name} + {s.size} * k" for s, _ in signals]
    names = [s.name for s, _ in signals]
    if feedback_words:
        place = len(interface.inputs)
        pieces.insert(place, f"{word.residual} residuals[{feedback_words}]")
        inner.insert(place, f"{word.residual} *restrict residuals")
        arrays.insert(place, f"{word.residual} *residuals")
        calls.insert(place, f"residuals + {feedback_words} * k")
        names.insert(place, "residuals")
    definitions = [value.definition for value in fixed.body]
    values = {
        "fixed": fixed,
        "target": target,
        "program": fixed.program,
        "interface": interface,
        "name": name,
        "guard": f"{name}_h".upper(),
        "word": word,
        "state": interface.inputs[0].signal,
        "samples": interface.inputs[-1].signal,
        "residuals": feedback_words,
        "parameters": ", ".join(pieces),
        "inner_parameters": ", ".join(inner),
        "arrays": ", ".join(arrays),
        "calls": ", ".join(calls),
        "names": ", ".join(names),
        "code": printer.code(),
        "counts": ", ".join(f"{number} {kind}" for kind, number in fixed.operations.items() if number),
        "nearest": interface.settings.rounding == "nearest",
        "fresh": dict.fromkeys(f"UINT{fixed.word}_C({r.fresh})" for r in interface.residuals),
        "uses_shift": printer.uses_shift,
        "uses_root": any(isinstance(d, IntegerRoot) for d in definitions),
        "uses_quotient": any(isinstance(d, IntegerQuotient) for d in definitions),
        "guarded": tuple(value for value in fixed.body if value.guarded),
    }
    return {
        f"{name}.h": render("c_fixed/header.h.j2", **values),
        f"{name}.c": render("c_fixed/source.c.j2", **values),
    }


class _Printer:
    """Prints the values of a fixed-point program as C statements."""

    def __init__(self, fixed: FixedProgram, word: Word, name: str) -> None:
        self.fixed, self.word, self.name = fixed, word, name
        self.uses_shift = False
        self.wide_names = {value.name for value in fixed.body if value.wide}
        self.places = {feedback.name: k for k, feedback in enumerate(fixed.interface.residuals)}
        self.checks = any(value.guarded for value in fixed.body)
        self.nearest = fixed.interface.settings.rounding == "nearest"
        self.names = {value.name for value in fixed.body}
        self.names |= {name for argument in fixed.interface.inputs for name in argument.signal.elements}

    def memory(self, name: str) -> str:
        """Return the name of an argument's array; it differs from the names of all values."""
        return f"{name}_words" if name in self.names else name

    def code(self) -> dict[str, list[str]]:
        """Return the statements of one call: loads, checks of the inputs, the body, stores."""
        interface, kind = self.fixed.interface, self.word.fast
        used = {name for value in self.fixed.body for name in used_by(value)}
        loads, checks = [], []
        for argument in interface.inputs:
            assert argument.low == -argument.high, "inputs have symmetric ranges"
            limit = self.constant(argument.high)
            for number, element in enumerate(argument.signal.elements):
                source = f"{self.memory(argument.signal.name)}[{number}]"
                if element in used:
                    loads.append(f"const {kind} {element} = {source};")
                    source = element
                checks.append(f"{self.name}_out_({source}, {limit})")
        body = [line for value in self.fixed.body for line in self.statements(value)]
        stores = [
            f"{self.memory(argument.signal.name)}[{number}] = ({self.word.type}){name};"
            for argument in interface.outputs
            for number, name in enumerate(argument.values)
        ]
        if self.checks:
            stores += [f"residuals[{k}] = next_{r.name};" for k, r in enumerate(interface.residuals)]
        return {"loads": loads, "checks": checks, "body": body, "stores": stores}

    def statements(self, value: Value) -> list[str]:
        """Return the statements that compute a value."""
        lines = [f"/* {value.meaning} */"] if value.meaning else []
        kind = self.word.wide if value.wide else self.word.fast
        name = value.name
        match value.definition:
            case IntegerSum() as total:
                lines += self._sum(value, total, kind)
            case IntegerQuotient(numerator, denominator):
                text = f"{self.name}_div_({self.scaled(numerator)}, {denominator})"
                lines.append(_declared(kind, name, self.cast(text, value)))
            case IntegerRoot(argument):
                text = f"{self.name}_sqrt_(({self.word.magnitude})({self.scaled(argument)}))"
                lines.append(_declared(kind, name, text))
            case IntegerMaximum((first, *others)):
                lines.append(f"{kind} {name} = {self.cast(self.scaled(first), value)};")
                for other in others:
                    text = self.scaled(other)
                    lines.append(f"if ({text} > {name})\n        {name} = {self.cast(text, value)};")
            case IntegerSelection(cases, otherwise):
                text = self.scaled(otherwise)
                for left, right, result in reversed(cases):
                    condition = f"{self.scaled(left)} >= {self.scaled(right)}"
                    text = f"{condition} ? {self.scaled(result)}\n        : {text}"
                lines.append(f"const {kind} {name} = {self.cast(f'({text})', value)};")
        # The word of a sum is checked before it is narrowed.
        if value.guarded and (value.wide or not isinstance(value.definition, IntegerSum)):
            lines.append(self._guard(name, value))
        return lines

    def _guard(self, name: str, value: Value) -> str:
        limits = self.constant(value.low), self.constant(value.high)
        return f"if ({name} < {limits[0]}\n        || {name} > {limits[1]})\n        return 2;"

    def cast(self, text: str, value: Value) -> str:
        """Return an expression of a wide number as one of the value's type."""
        return text if value.wide else f"({self.word.fast})({text})"

    def _sum(self, value: Value, definition: IntegerSum, kind: str) -> list[str]:
        name, wide = value.name, self.word.wide
        fine = self._joined([self.term(term) for term in definition.fine])
        coarse = [self.term(term) for term in definition.coarse]
        if not definition.shift:
            total = self._joined(
                [*coarse, *([] if not definition.fine else [self.term(t) for t in definition.fine])]
            )
            return self._result(value, kind, total or "0")
        feedback, lines = definition.residual, []
        if feedback is None:
            half = f" + {self.constant(1 << (definition.shift - 1), wide=True)}" if self.nearest else ""
            rounded = self._shifted(fine + half, -definition.shift)
        else:
            place = f"residuals[{self.places[feedback.name]}]"
            fed_back = self._scaled_text(f"({wide}){place}", feedback.shift)
            before = self._shifted(fine, -definition.drop) if definition.drop else fine
            lines.append(_declared(wide, f"{name}_sum", f"{before} + {fed_back}"))
            left = (
                f"({self.word.magnitude}){name}_sum << {-feedback.shift}" if feedback.shift else f"{name}_sum"
            )
            word = self.word.residual
            if self.checks:  # a call that a later check refuses leaves it as it was
                lines.append(f"const {word} next_{feedback.name} = ({word})({left});")
            else:
                lines.append(f"{place} = ({word})({left});")
            rounded = self._shifted(f"{name}_sum", -definition.shift)
        terms = [*coarse[:1], f"+{rounded}", *coarse[1:]]
        return lines + self._result(value, kind, self._joined(terms))

    def _result(self, value: Value, kind: str, text: str) -> list[str]:
        """Return the statements that store a sum; a word with a range check is checked before it is narrowed."""
        if value.guarded and not value.wide:
            name = f"{value.name}_unchecked"
            return [
                _declared(self.word.wide, name, text),
                self._guard(name, value),
                _declared(kind, value.name, f"({kind}){name}"),
            ]
        if value.wide:
            return [_declared(kind, value.name, text)]
        return [_declared(kind, value.name, f"({kind})({text})")]

    @staticmethod
    def _joined(terms: list[str]) -> str:
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
            return sign + self.constant(abs(value), wide=True)
        first, *others = term.names
        start = first if first in self.wide_names else f"({wide}){first}"
        negative = term.shift < 0 and term.factor < 0  # what is shifted down is the signed product
        parts = [f"-{start}" if negative else start, *others]
        if abs(term.factor) != 1:
            parts.append(self.constant(abs(term.factor)))
        text = self._scaled_text(" * ".join(parts), term.shift)
        return f"+{text}" if negative else sign + text

    def _scaled_text(self, text: str, shift: int) -> str:
        """Return an expression times a power of two."""
        if not shift:
            return text
        return f"{text} * {self._power(shift)}" if shift > 0 else self._shifted(text, shift)

    def _power(self, shift: int) -> str:
        return self.constant(1 << shift, wide=True)

    def _shifted(self, text: str, shift: int) -> str:
        self.uses_shift = True
        return f"{self.name}_shr_({text}, {-shift})"

    def scaled(self, scaled: Scaled) -> str:
        """Return a scaled value as an expression of a wide number."""
        if isinstance(scaled.value, int):
            return self.constant(
                scaled.value << scaled.shift if scaled.shift > 0 else scaled.value, wide=True
            )
        name = scaled.value
        return self._scaled_text(
            name if name in self.wide_names else f"({self.word.wide}){name}", scaled.shift
        )

    def constant(self, value: int, wide: bool = False) -> str:
        """Return an integer as a constant expression, with the type of a wide number if `wide` is true."""
        if value < 0:
            return f"(-{self.constant(-value, wide)})"
        if value < 1 << 15:
            return f"({self.word.wide}){value}" if wide and self.word.bits == 64 else str(value)
        if value < 1 << 31:
            return f"INT32_C({value})"
        if value < 1 << 63:
            return f"INT64_C({value})"
        high, low = divmod(value, 1 << 62)
        text = f"({self.word.wide}){self.constant(high)} * INT64_C({1 << 62})"
        return f"({text} + INT64_C({low}))" if low else f"({text})"


def _declared(kind: str, name: str, text: str) -> str:
    """Return a declaration, its value on a line of its own where the first line would be too long."""
    indent = " " * 8
    statement = fill_expression(f"const {kind} {name} = {text};", indent, 100)
    if len(statement.partition("\n")[0]) <= 96:
        return statement
    return f"const {kind} {name} =\n" + fill_expression(f"{indent}{text};", indent, 100)
