"""The fixed-point target of Rust: one module with a function on integers, and a C interface beside it."""

from __future__ import annotations

from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.interfaces import Argument
from strapgen.ir.sources import Sources
from strapgen.targets import definitions
from strapgen.targets.c_fixed import emit as c_fixed
from strapgen.targets.c_fixed.statements import StatementPrinter
from strapgen.targets.c_fixed.words import WORDS, Word, memory_type
from strapgen.targets.cpp.text import CHECK, runs_of
from strapgen.targets.names import function_name
from strapgen.targets.rendering import render
from strapgen.targets.rust.text import RUST, TYPES, array, constants, module_name, structure_name

#: The types of Rust for words of each length; it has products of every word.
_WORDS = {
    16: Word(16, "i16", "u16", "i32", "i32", "u32"),
    32: Word(32, "i32", "u32", "i32", "i64", "u64"),
    64: Word(64, "i64", "u64", "i64", "i128", "u128"),
}


class _RustStatementPrinter(StatementPrinter):
    """Prints statements of Rust, which converts no number by itself."""

    def helper(self, name: str) -> str:
        """Return the name of one of the module's own functions."""
        return name

    def cast(self, kind: str, text: str = "") -> str:
        """Return a name, an element or an expression in parentheses as a number of another type."""
        return f"{kind}::from({text})" if kind == self.word.wide else f"({text} as {kind})"

    def read(self, kind: str, source: str, argument: Argument) -> str:
        """Return an element of an argument as a number of a type."""
        return source if TYPES[memory_type(argument)] == kind else f"{kind}::from({source})"

    def loaded(self, kind: str, name: str, source: str, argument: Argument) -> str:
        """Return the declaration of an element of an argument."""
        return f"let {name}: {kind} = {self.read(kind, source, argument)};"

    def start(self, kind: str, name: str, constant: bool = True) -> str:
        """Return the beginning of a value's declaration."""
        return f"let {'' if constant else 'mut '}{name}: {kind} ="

    def unset(self, kind: str, name: str) -> str:
        """Return the declaration of a value that a branch sets."""
        return f"let {name}: {kind};"

    def refusal(self) -> str:
        """Return the statement that refuses a value on the way."""
        return "return Err(Refusal::TooFar);"

    def as_wide(self, name: str) -> str:
        """Return a value as a wide number."""
        return name if name in self.wide_names else self.cast(self.word.wide, name)

    def constant(self, value: int, wide: bool = False) -> str:
        """Return an integer; a power of two says its type, which its exponent does not show."""
        if value < 0:
            return f"(-{self.constant(-value, wide)})"
        if wide and value >= 1 << 4 and not value & (value - 1):
            return f"(1_{self.word.wide} << {value.bit_length() - 1})"
        return str(value)

    def returned(self) -> list[tuple[str, str]]:
        """Return the name and the value of every output."""
        return [
            (a.signal.name, f"[{', '.join(map(self._stored, a.values))}]")
            for a in self.fixed.interface.outputs
        ]


def emit(fixed: FixedProgram, target: str) -> Sources:
    """Print a module with ``<name>``, and the functions of the target ``c-fixed`` as an interface to it."""
    name = module_name(function_name(fixed.program, f"_w{fixed.word}"))
    return c_fixed.sources_of(fixed, target, name, _files, RUST, runs_of(name, "rust", "rs"))


def _files(fixed: FixedProgram, name: str, target: str) -> dict[str, str]:
    """Return the module and the C interface of a program with its printed names."""
    printer, interface = _RustStatementPrinter(fixed, _WORDS[fixed.word], name), fixed.interface
    header, runs = runs_of(name, "rust", "rs")
    inputs = [(TYPES[memory_type(a)], a.signal.size, a.signal.name) for a in interface.inputs]
    outputs = [(TYPES[memory_type(a)], a.signal.size, a.signal.name) for a in interface.outputs]
    parameters = [f"{printer.memory(s)}: &{array(kind, size)}" for kind, size, s in inputs]
    if interface.residuals:
        parameters.append(f"residuals: &mut {array(printer.word.residual, len(interface.residuals))}")
    structure = structure_name(name)
    result = structure if len(outputs) > 1 else array(*outputs[0][:2])
    values = c_fixed.values_of(fixed, name, target, printer)
    code = dict(values["code"])  # type: ignore[call-overload]
    code["stores"] = [store for store in code["stores"] if store.startswith("residuals[")]
    values |= {
        "name": name,
        "file": f"{name}.rs",
        "header": header,
        "guard_of_runs": header.replace(".", "_").upper(),
        "check": CHECK,
        "word": printer.word,
        "c_word": WORDS[fixed.word].within(name),
        "code": code,
        "fresh": dict.fromkeys(str(r.fresh) for r in interface.residuals),
        "constants": constants(definitions.of_fixed(fixed, name, _literal), "double"),
        "rust_arguments": ", ".join(parameters),
        "structure": structure,
        "result": result,
        "inputs": inputs,
        "outputs": outputs,
        "returned": printer.returned(),
    }
    templates = {
        f"{name}.rs": "rust/fixed_module.rs.j2",
        header: "cpp/fixed_interface.h.j2",
        runs: "rust/fixed_runs.rs.j2",
    }
    return {file: render(template, **values) for file, template in templates.items()}


def _literal(value: int, bits: int, signed: bool = True) -> str:
    """Return an integer, whose type its declaration says."""
    return str(value)
