"""The Rust target in floating point: one module with a function and its contract, and a C interface beside it."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

from strapgen.ir.interfaces import RoundingBounds
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.targets import definitions
from strapgen.targets.c import emit as c
from strapgen.targets.c.rounding_text import rounding_text
from strapgen.targets.cpp.emit import interface_values
from strapgen.targets.cpp.text import CHECK, runs_of
from strapgen.targets.names import function_name
from strapgen.targets.rendering import render
from strapgen.targets.rust.text import RUST, TYPES, array, constants, module_name, structure_name

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
        "constants": constants(definitions.of_program(program, name, printer), printer.real.name),
        "rounding": rounding_text(rounding, program, flag=""),
        "structure": structure_name(name),
        "result": structure_name(name) if several else outputs[0][0],
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
