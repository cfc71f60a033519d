"""The Rust target in floating point: one module with a function and its contract, and a C interface beside it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from fractions import Fraction

from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.interfaces import Argument, RoundingBounds
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.targets import c, c_fixed
from strapgen.targets.c_fixed import StatementPrinter
from strapgen.targets.c_numbers import WORDS, Word, memory_type
from strapgen.targets.contract import rounding_text
from strapgen.targets.cpp import CHECK, interface_values, runs_of
from strapgen.targets.names import C, Language, function_name
from strapgen.targets.printer import fill_arguments
from strapgen.targets.rendering import Macro, macros_of_fixed, macros_of_program, render

#: Functions of the C library by the operation that calls them.
_LIBRARY = {
    "sqrt": ("sqrt",),
    "sin": ("sin",),
    "cos": ("cos",),
    "sinc": ("sin",),
    "atan2": ("atan2",),
    "direction": ("atan2",),
    "maximum": ("fmax",),
}
_PARAMETERS = {"atan2": ("y", "x"), "fmax": ("x", "y")}
_FUNCTIONS = {
    "sqrt": "sqrt({})",
    "sin": "sin({})",
    "cos": "cos({})",
    "sinc": "sinc({})",
    "atan2": "atan2({}, {})",
    "direction": "atan2({}, {})",
    "wrap": "wrapped({})",
    "maximum": "fmax({}, {})",
    "at_least": "{} >= {}",
    "select": "(if {} {{ {} }} else {{ {} }})",
}


class _RustPrinter(c.CPrinter):
    """Prints nodes as Rust expressions: sums and products are those of C, choices and declarations are not."""

    def constant(self, value: Fraction) -> str:
        """Return the shortest literal that reads as the nearest number of the type, which Rust infers."""
        return super().constant(value).removesuffix(self.real.suffix)

    def function(self, kind: str, arguments: list[str]) -> str:
        """Return a call or a choice."""
        return _FUNCTIONS[kind].format(*arguments)

    def declared(self, kind: str, name: str, value: str) -> str:
        """Return the declaration of a value."""
        return f"let {name}: {TYPES[kind]} = {value};"


def emit(program: Program, target: str) -> Sources:
    """Print a module with ``<name>``, and the functions of the target ``c`` as an interface to it."""
    name = module_name(function_name(program, c.real_of(target).infix))
    return c.sources_of(program, target, name, _files, RUST, runs_of(name, "rust", "rs"))


def _files(program: Program, name: str, target: str, rounding: RoundingBounds) -> dict[str, str]:
    """Return the module and the C interface of a program with its printed names."""
    printer = _RustPrinter(c.real_of(target), name)
    kind = TYPES[printer.real.name]
    outputs = [(array(kind, r.signal.size), r.signal.name) for r in program.outputs]
    header, runs = runs_of(name, "rust", "rs")
    several = len(outputs) > 1
    returned = [f"[{', '.join(map(printer.text, result.nodes))}]" for result in program.outputs]
    values = c.values_of(program, name, target, printer, rounding) | interface_values(program, name, header)
    values |= {
        "file": f"{name}.rs",
        "kind": kind,
        "check": CHECK,
        "constants": constants(macros_of_program(program, name, printer), printer.real.name),
        "rounding": rounding_text(rounding, program, flag=""),
        "structure": _structure_name(name),
        "result": _structure_name(name) if several else outputs[0][0],
        "outputs": outputs,
        "rust_arguments": ", ".join(
            f"{s.name}: &{array(kind, s.size)}" if s.shape else f"{s.name}: {kind}" for s in program.inputs
        ),
        "returned": list(zip((o for _, o in outputs), returned, strict=True)),
        "code": c.code_of(program, printer) | {"stores": []},
        "library": _library(values["functions"]),
        "several": several,
    }
    templates = {f"{name}.rs": "rust/module.rs.j2", header: "cpp/interface.h.j2", runs: "rust/runs.rs.j2"}
    return {file: render(template, **values) for file, template in templates.items()}


def _library(kinds: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Return the functions of the C library that some operations call, with the names of their parameters."""
    names = sorted({name for kind in kinds for name in _LIBRARY.get(kind, ())})
    return {name: _PARAMETERS.get(name, ("x",)) for name in names}


#: The types of Rust for words of each length; it has products of every word.
_RUST_WORDS = {
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


def emit_fixed(fixed: FixedProgram, target: str) -> Sources:
    """Print a module with ``<name>``, and the functions of the target ``c-fixed`` as an interface to it."""
    name = module_name(function_name(fixed.program, f"_w{fixed.word}"))
    return c_fixed.sources_of(fixed, target, name, _fixed_files, RUST, runs_of(name, "rust", "rs"))


def _fixed_files(fixed: FixedProgram, name: str, target: str) -> dict[str, str]:
    """Return the module and the C interface of a program with its printed names."""
    printer, interface = _RustStatementPrinter(fixed, _RUST_WORDS[fixed.word], name), fixed.interface
    header, runs = runs_of(name, "rust", "rs")
    inputs = [(TYPES[memory_type(a)], a.signal.size, a.signal.name) for a in interface.inputs]
    outputs = [(TYPES[memory_type(a)], a.signal.size, a.signal.name) for a in interface.outputs]
    parameters = [f"{printer.memory(s)}: &{array(kind, size)}" for kind, size, s in inputs]
    if interface.residuals:
        parameters.append(f"residuals: &mut {array(printer.word.residual, len(interface.residuals))}")
    structure = _structure_name(name)
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
        "constants": constants(macros_of_fixed(fixed, name, _word_literal), "double"),
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


def _word_literal(value: int, bits: int, signed: bool = True) -> str:
    """Return an integer, whose type its declaration says."""
    return str(value)


#: Keywords of every edition, those that are set aside, and names that patterns take for a variant of the core library.
_TEXT = """
Self abstract as async await become box break const continue crate do dyn else enum extern f32 f64 false final fn for
gen i16 i32 i64 i128 if impl in let loop macro match mod move mut override priv pub ref return self static struct super
trait true try type typeof u16 u32 u64 u128 union unsafe unsized use usize virtual where while yield
Err None Ok Some
"""
_WORDS = frozenset(_TEXT.split())
#: Types of Rust by those of C.
TYPES = {"double": "f64", "float": "f32", "int": "i32"} | {
    f"{sign}int{bits}_t": f"{letter}{bits}"
    for sign, letter in (("", "i"), ("u", "u"))
    for bits in (16, 32, 64)
}


def _allows(name: str) -> bool:
    return name not in _WORDS and not re.fullmatch(r"_+", name)


#: The rules of Rust for names. Its functions and blocks are scopes as those of C are.
RUST = Language(_allows, C.scopes, most=C.most)


def module_name(name: str) -> str:
    """Return the name of a function and of its module: that of C, changed if Rust has it for itself.

    >>> module_name("euler_rk4_2"), module_name("loop")
    ('euler_rk4_2', 'loop_Kernel')
    """
    return name if _allows(name) else f"{name}_Kernel"


def _structure_name(name: str) -> str:
    """Return the name of the structure with the outputs of a function.

    >>> _structure_name("imu_compensate")
    'ImuCompensateOutputs'
    """
    return "".join(word[:1].upper() + word[1:] for word in name.split("_")) + "Outputs"


def array(kind: str, size: int) -> str:
    """Return the type of an array."""
    return f"[{kind}; {size}]"


def constants(definitions: Sequence[Macro], real: str) -> list[str]:
    """Return the definitions of a header as constants of Rust, whose real numbers have a type of C."""
    return [_constant(definition, real) for definition in definitions]


def _constant(definition: Macro, real: str) -> str:
    kind, value = TYPES[definition.type or real], definition.value
    if definition.size:
        kind, value = array(kind, definition.size), f"[{value[1:-1]}]"
    line, comment = f"pub const {definition.name}: {kind} = {value};", f"/* {definition.meaning} */"
    if len(line) + len(comment) < 99:
        return f"{line} {comment}"
    return f"{comment}\n{fill_arguments(line, '    ')}"
