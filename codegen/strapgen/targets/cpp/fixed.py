"""The fixed-point target of C++: one header with a function on integers, constexpr, and a C interface beside it."""

from __future__ import annotations

from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.sources import Sources
from strapgen.targets import definitions
from strapgen.targets.c_fixed import emit as c_fixed
from strapgen.targets.c_fixed.statements import StatementPrinter
from strapgen.targets.c_fixed.words import WORDS, Word, memory_type
from strapgen.targets.cpp.text import CHECK, CPP, constants, runs_of, standard
from strapgen.targets.names import function_name
from strapgen.targets.rendering import render


class _CppStatementPrinter(StatementPrinter):
    """Prints statements of C++: those of C with named conversions."""

    def cast(self, kind: str, text: str = "") -> str:
        """Return a name, a number or an expression in parentheses in another type; without it the cast alone."""
        inside = text[1:-1] if text.startswith("(") else text
        return f"static_cast<{kind}>" + (f"({inside})" if text else "")

    def unset(self, kind: str, name: str) -> str:
        """Return the declaration of a value that a branch sets: a constant expression needs a first value."""
        return f"{kind} {name} = 0;"


def emit(fixed: FixedProgram, target: str) -> Sources:
    """Print a header with ``strapgen::<name>``, and the functions of the target ``c-fixed`` as an interface to it."""
    name = function_name(fixed.program, f"_w{fixed.word}")
    return c_fixed.sources_of(fixed, target, name, _files, CPP, runs_of(name))


def _files(fixed: FixedProgram, name: str, target: str) -> dict[str, str]:
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
        "constants": constants(definitions.of_fixed(fixed, name)),
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
