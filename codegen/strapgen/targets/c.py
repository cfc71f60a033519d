"""The C target: a header with the contract of every function and a C99 source, in double or in float."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from strapgen.program import Operation, Program, walk
from strapgen.signal import Signal
from strapgen.targets.printer import Printer, fill_expression
from strapgen.targets.rendering import render
from strapgen.targets.sources import Function, Sources


@dataclass(frozen=True)
class Real:
    """A floating-point type of C.

    Parameters
    ----------
    target : str
        Name of the target.
    name : str
        Name of the type.
    suffix : str
        Suffix of its literals and of the functions of math.h.
    infix : str
        What function and file names have after the kernel's, so that both types link into one program.
    """

    target: str
    name: str
    suffix: str
    infix: str


DOUBLE = Real("c", "double", "", "")
FLOAT = Real("c-float", "float", "f", "_float")
REALS = {real.target: real for real in (DOUBLE, FLOAT)}

_FUNCTIONS = {
    "sqrt": "sqrt{s}({})",
    "sin": "sin{s}({})",
    "cos": "cos{s}({})",
    "sinc": "sinc_({})",
    "atan2": "atan2{s}({}, {})",
    "maximum": "fmax{s}({}, {})",
    "at_least": "{} >= {}",
    "select": "({} ? {} : {})",
}


class CPrinter(Printer):
    """Prints nodes as C expressions of one floating-point type."""

    def __init__(self, real: Real) -> None:
        self.real = real

    def constant(self, value: Fraction) -> str:
        """Return the shortest literal that reads as the nearest number of the type."""
        text = repr(float(value)) if self.real is DOUBLE else str(_nearest_single(value))
        return text + self.real.suffix

    def function(self, kind: str, arguments: list[str]) -> str:
        """Return a call."""
        return _FUNCTIONS[kind].format(*arguments, s=self.real.suffix)


def _nearest_single(value: Fraction) -> np.float32:
    """Round once, not through double."""
    near = np.float32(float(value))
    candidates = (near, np.nextafter(near, np.float32(-np.inf)), np.nextafter(near, np.float32(np.inf)))
    return min(candidates, key=lambda c: (abs(Fraction(float(c)) - value), int(c.view(np.uint32)) & 1))


def emit(program: Program, target: str = "c") -> Sources:
    """Generate a C header and source for a program.

    Parameters
    ----------
    program : Program
    target : str, optional
        A key of `REALS`.

    Returns
    -------
    Sources
        Two files. The function ``<name>`` works on one sample, ``<name>_array`` on many; a step has
        ``<name>_propagate`` too, the loop over runs and steps.
    """
    real = REALS[target]
    printer = CPrinter(real)
    name = f"{program.name}{real.infix}"
    used = program.used()
    nodes = [node for a in program.body for node in walk(a.value) if isinstance(node, Operation)]
    values = {
        "program": program,
        "name": name,
        "guard": f"{name}_h".upper(),
        "command": f"strapgen generate {program.arguments} --target {real.target}",
        "real": real,
        "state": program.inputs[0],
        "parameters": _parameters(program, real),
        "names": ", ".join(s.name for s in (*program.inputs, *(r.signal for r in program.outputs))),
        "arrays": _arrays(program, real),
        "calls": _calls(program),
        "unused": [s.name for s in program.inputs if not used & set(s.elements)],
        "loads": [
            f"const {real.name} {element} = {signal.name}[{place}];"
            for signal in program.inputs
            if signal.shape
            for place, element in enumerate(signal.elements)
            if element in used
        ],
        "body": [
            {
                "text": fill_expression(
                    f"const {real.name} {a.name} = {printer.text(a.value)};", " " * 8, 96
                ),
                "meaning": a.meaning,
            }
            for a in program.body
        ],
        "stores": [
            f"{_target(result.signal, place)} = {printer.text(node)};"
            for result in program.outputs
            for place, node in enumerate(result.nodes)
        ],
        "uses_math": any(
            node.kind in _FUNCTIONS and node.kind not in ("at_least", "select") for node in nodes
        ),
        "uses_sinc": any(node.kind == "sinc" for node in nodes),
    }
    files = {
        f"{name}.h": render("c/header.h.j2", **values),
        f"{name}.c": render("c/source.c.j2", **values),
    }
    function = Function(name, program.inputs, tuple(result.signal for result in program.outputs))
    return Sources(
        program.kernel,
        real.target,
        files,
        function,
        program.operations,
        program.temporaries,
        program.companions,
    )


def _target(signal: Signal, place: int) -> str:
    return f"{signal.name}[{place}]" if signal.shape else f"*{signal.name}"


def _parameters(program: Program, real: Real) -> str:
    inputs = [
        f"const {real.name} {s.name}[{s.size}]" if s.shape else f"{real.name} {s.name}"
        for s in program.inputs
    ]
    outputs = [f"{real.name} {r.signal.name}[{r.signal.size}]" for r in program.outputs]
    return ", ".join(inputs + outputs)


def _arrays(program: Program, real: Real) -> str:
    inputs = [f"const {real.name} *{s.name}" for s in program.inputs]
    return ", ".join(inputs + [f"{real.name} *{r.signal.name}" for r in program.outputs])


def _calls(program: Program) -> str:
    inputs = [f"{s.name} + {s.size} * k" if s.shape else f"{s.name}[k]" for s in program.inputs]
    return ", ".join(inputs + [f"{r.signal.name} + {r.signal.size} * k" for r in program.outputs])
