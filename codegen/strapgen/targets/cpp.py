"""The C++ target: one header with a function and its contract, in double or in float, and a C interface beside it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.interfaces import RoundingBounds
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.targets import c, c_fixed
from strapgen.targets.c_fixed import StatementPrinter
from strapgen.targets.c_numbers import WORDS, Word, memory_type
from strapgen.targets.names import C, Language, function_name
from strapgen.targets.printer import fill_arguments
from strapgen.targets.rendering import Macro, macros_of_fixed, macros_of_program, render

_FUNCTIONS = {kind: f"std::{kind}({{}})" for kind in ("sqrt", "sin", "cos")} | {
    "sinc": "{n}_sc_({})",
    "atan2": "std::atan2({}, {})",
    "direction": "std::atan2({}, {})",
    "wrap": "{n}_wr_({})",
    "maximum": "std::fmax({}, {})",
}


class _CppPrinter(c.CPrinter):
    """Prints nodes as C++ expressions: those of C, with the functions of the namespace ``std``."""

    def function(self, kind: str, arguments: list[str]) -> str:
        """Return a call."""
        if kind not in _FUNCTIONS:
            return super().function(kind, arguments)
        return _FUNCTIONS[kind].format(*arguments, n=self.name)


def emit(program: Program, target: str) -> Sources:
    """Print a header with ``strapgen::<name>``, and the functions of the target ``c`` as an interface to it."""
    name = function_name(program, c.real_of(target).infix)
    return c.sources_of(program, target, name, _files, CPP, runs_of(name))


def _files(program: Program, name: str, target: str, rounding: RoundingBounds) -> dict[str, str]:
    """Return the header and the C interface of a program with its printed names."""
    printer = _CppPrinter(c.real_of(target), name)
    outputs = [(f"std::array<{printer.real.name}, {r.signal.size}>", r.signal.name) for r in program.outputs]
    header, runs = runs_of(name)
    values = c.values_of(program, name, target, printer, rounding) | interface_values(program, name, header)
    values |= {
        "file": f"{name}.hpp",
        "guard": f"{name}_hpp".upper(),
        "check": CHECK,
        "constants": constants(macros_of_program(program, name, printer), printer.real.name),
        "digits": 53 if printer.real.bytes == 8 else 24,
        "result": _result_of(name, outputs),
        "outputs": outputs,
        "arguments_text": ", ".join(
            f"const std::array<{printer.real.name}, {s.size}> &{s.name}"
            if s.shape
            else f"{printer.real.name} {s.name}"
            for s in program.inputs
        ),
        "returned": ", ".join(
            f"{{{{{', '.join(map(printer.text, result.nodes))}}}}}" for result in program.outputs
        ),
        "code": c.code_of(program, printer) | {"stores": []},
        "specifier": "inline" if values["uses_math"] else "constexpr",
    }
    templates = {f"{name}.hpp": "function.hpp", header: "interface.h", runs: "runs.cpp"}
    return {file: render(f"cpp/{template}.j2", **values) for file, template in templates.items()}


def interface_values(program: Program, name: str, header: str) -> dict[str, str]:
    """Return the values for the templates of a C interface to another language, beside those of the C itself."""
    return {
        "name": name,
        "header": header,
        "guard_of_runs": header.replace(".", "_").upper(),
        "unpacked": ", ".join(
            f"{name}_in_<{s.size}>(a{k}_)" if s.shape else f"a{k}_" for k, s in enumerate(program.inputs)
        ),
        "names": ", ".join([*(s.name for s in program.inputs), *(r.signal.name for r in program.outputs)]),
    }


class _CppStatementPrinter(StatementPrinter):
    """Prints statements of C++: those of C with named conversions."""

    def cast(self, kind: str, text: str = "") -> str:
        """Return a name, a number or an expression in parentheses in another type; without it the cast alone."""
        inside = text[1:-1] if text.startswith("(") else text
        return f"static_cast<{kind}>" + (f"({inside})" if text else "")

    def unset(self, kind: str, name: str) -> str:
        """Return the declaration of a value that a branch sets: a constant expression needs a first value."""
        return f"{kind} {name} = 0;"


def emit_fixed(fixed: FixedProgram, target: str) -> Sources:
    """Print a header with ``strapgen::<name>``, and the functions of the target ``c-fixed`` as an interface to it."""
    name = function_name(fixed.program, f"_w{fixed.word}")
    return c_fixed.sources_of(fixed, target, name, _fixed_files, CPP, runs_of(name))


def _fixed_files(fixed: FixedProgram, name: str, target: str) -> dict[str, str]:
    """Return the header and the C interface of a program with its printed names."""
    printer = _CppStatementPrinter(fixed, _word(fixed.word, name), name)
    header, runs = runs_of(name)
    interface = fixed.interface
    arrays = [
        (f"const {_array(memory_type(a), a.signal.size)}", printer.memory(a.signal.name))
        for a in interface.inputs
    ]
    if interface.residuals:
        arrays.append((_array(WORDS[fixed.word].residual, len(interface.residuals)), "residuals"))
    arrays += [
        (_array(memory_type(a), a.signal.size), printer.memory(a.signal.name)) for a in interface.outputs
    ]
    values = c_fixed.values_of(fixed, name, target, printer) | {
        "name": name,
        "file": f"{name}.hpp",
        "header": header,
        "guard": f"{name}_hpp".upper(),
        "guard_of_runs": header.replace(".", "_").upper(),
        "check": CHECK,
        "word": printer.word,
        "c_word": WORDS[fixed.word].within(name),
        "constants": constants(macros_of_fixed(fixed, name)),
        "arguments_text": ", ".join(f"{kind} &{argument}" for kind, argument in arrays),
        "arrays_of_calls": [kind.removeprefix("const ") for kind, _ in arrays],
    }
    templates = {f"{name}.hpp": "fixed.hpp", header: "fixed_interface.h", runs: "fixed_runs.cpp"}
    return {file: render(f"cpp/{template}.j2", **values) for file, template in templates.items()}


def _array(kind: str, size: int) -> str:
    return f"std::array<{standard(kind)}, {size}>"


def _word(bits: int, name: str) -> Word:
    """Return the types of a word as C++ calls them."""
    word = WORDS[bits].within(name)
    wide, magnitude = standard(word.wide), standard(word.magnitude)
    if bits == 64:  # several headers may define the same type
        wide, magnitude = "int128", "uint128"
    return Word(bits, standard(word.type), standard(word.residual), standard(word.fast), wide, magnitude)


#: What tells that a file is not what strapgen generates.
CHECK = "the same command with --check shows the differences"


def _scopes(texts: Iterable[str]) -> list[set[str]]:
    """Return the identifiers of each declaration and function; namespaces are no scopes."""
    return C.scopes(re.sub(r"^namespace \w* ?\{$|\"C\"", " ", text, flags=re.MULTILINE) for text in texts)


#: The rules of C++ for names, whose keywords those of C include.
CPP = Language(C.allows, _scopes, most=C.most)


def constants(definitions: Sequence[Macro], real: str = "double") -> list[str]:
    """Return the definitions of a header as constants of C++, under names in lower case."""
    return [_constant(definition, real) for definition in definitions]


def _constant(definition: Macro, real: str) -> str:
    kind = standard(definition.type or real)
    if definition.size:
        kind = f"std::array<{kind}, {definition.size}>"
        value = f"{{{definition.value}}}"
    else:
        value = f" = {definition.value}"
    line = f"constexpr {kind} {definition.name.lower()}{value};"
    comment = f"/* {definition.meaning} */"
    if len(line) > 99 and not definition.size:
        line = line.replace(" = ", " =\n    ")
    return (
        f"{line} {comment}" if len(line) + len(comment) < 99 else f"{comment}\n{fill_arguments(line, '    ')}"
    )


def standard(kind: str) -> str:
    """Return a type of C as C++ calls it."""
    return f"std::{kind}" if kind.endswith("_t") else kind


def _result_of(name: str, outputs: Sequence[tuple[str, str]]) -> str:
    """Return the return type of a function: that of its output, or a structure of several (type, name)."""
    return outputs[0][0] if len(outputs) == 1 else f"{name}_result"


def runs_of(name: str, language: str = "cpp", ending: str = "cpp") -> tuple[str, str]:
    """Return the names of the files with the C interface of a function in a language."""
    return f"{name}_{language}_runs.h", f"{name}_{language}_runs.{ending}"
