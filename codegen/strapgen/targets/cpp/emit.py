"""The C++ target: one header with a function and its contract, in double or in float, and a C interface beside it."""

from __future__ import annotations

from strapgen.ir.interfaces import RoundingBounds
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.targets import definitions
from strapgen.targets.c import emit as c
from strapgen.targets.cpp.text import CHECK, CPP, constants, result_of, runs_of
from strapgen.targets.names import function_name
from strapgen.targets.rendering import render

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
        "constants": constants(definitions.of_program(program, name, printer), printer.real.name),
        "digits": 53 if printer.real.bytes == 8 else 24,
        "result": result_of(name, outputs),
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
