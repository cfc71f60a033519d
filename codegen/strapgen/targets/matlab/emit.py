"""The MATLAB target: a function file that MATLAB and Octave run on one sample or on many, and its loop over a run."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from fractions import Fraction

from strapgen.ir.float_interface import RoundingBounds
from strapgen.ir.program import Constant, Node, Operation, Program, Result, walk
from strapgen.ir.sources import Sources
from strapgen.targets import contract, contract_lines
from strapgen.targets.c.emit import HALF_TURNS, sources_of
from strapgen.targets.c.rounding_text import rounding_text
from strapgen.targets.lines import fill_arguments, fill_expression
from strapgen.targets.matlab.names import MATLAB, file_name
from strapgen.targets.printer import Printer
from strapgen.targets.rendering import render

_FUNCTIONS = {
    "sqrt": "square_root({})",
    "sin": "sin({})",
    "cos": "cos({})",
    "sinc": "sine_ratio({})",
    "atan2": "atan2({}, {})",
    "direction": "atan2({}, {})",
    "wrap": "within_half_turn({})",
    "maximum": "max({}, {})",
    "at_least": "{} >= {}",
    "select": "chosen({}, {}, {})",
}
#: The arguments of the loop over steps.
_PROPAGATE = ("initial", "samples", "record_every", "restore_every", "restore")


class _MatlabPrinter(Printer):
    """Prints nodes as MATLAB expressions on rows of samples."""

    times, over = ".*", "./"

    def constant(self, value: Fraction) -> str:
        """Return the shortest decimal that reads as the nearest double."""
        return repr(float(value))

    def function(self, kind: str, arguments: list[str]) -> str:
        """Return a call."""
        return _FUNCTIONS[kind].format(*arguments)


def emit(program: Program, target: str) -> Sources:
    """Print a function of arrays (shape, samples), one sample being a column or a matrix, and a loop over steps."""
    name = file_name(program)
    runs = (f"{name}_propagate.m",) if program.companions else ()
    return sources_of(program, target, name, _files, MATLAB, runs)


def _files(program: Program, name: str, target: str, rounding: RoundingBounds) -> dict[str, str]:
    """Return the function of a program with its printed names and, for a step, the loop."""
    printer = _MatlabPrinter()
    command = f"{contract.generating(program)} --target {target}"
    nodes = [node for a in program.body for node in walk(a.value) if isinstance(node, Operation)]
    outputs = [result.signal.name for result in program.outputs]
    values = {
        "program": program,
        "name": name,
        "command": command,
        "contract": contract_lines.of_program(program, name, command, rounding),
        "normalizing": contract.upkeep_text(program, target=target),
        "rounding": rounding_text(rounding, program, "", "MATLAB or Octave"),
        "signature": _signature(name, outputs, [signal.name for signal in program.inputs]),
        "code": _code(program, printer),
        "functions": {node.kind for node in nodes},
        "turn": tuple(map(printer.constant, HALF_TURNS)),
    }
    files = {f"{name}.m": render("matlab/function.m.j2", **values)}
    if program.companions is not None:
        values |= _loop(program, program.companions.identity, printer)
        values["loop_signature"] = _signature(f"{name}_propagate", ["history"], _PROPAGATE)
        files[f"{name}_propagate.m"] = render("matlab/propagate.m.j2", **values)
    return files


def _loop(program: Program, identity: Iterable[Fraction], printer: _MatlabPrinter) -> dict[str, object]:
    """Return the two parts of a step in the loop over steps, without the state and with it."""
    ahead, behind = program.split()
    state = program.inputs[0]
    first = _array(_by_columns(map(printer.constant, identity), state.shape), state.shape)
    return {
        "state": state,
        "samples": program.inputs[-1],
        "identity": _statement("initial", first, 12),
        "prepared": behind.inputs[1],
        "ahead": _code(ahead, printer),
        "behind": _code(behind, printer),
        "result": program.outputs[0].signal,
    }


def _code(program: Program, printer: _MatlabPrinter) -> dict[str, object]:
    """Return the statements of a function: loads, assignments, stores."""
    used = program.used(program.outputs)
    return {
        "loads": list(_loads(program, used)),
        "body": [
            {"text": _statement(a.name, printer.text(a.value)), "meaning": a.meaning}
            for a in program.body
            if a.name in used
        ],
        "stores": [_statement(r.signal.name, _output(r, program, printer)) for r in program.outputs],
    }


def _signature(name: str, outputs: Sequence[str], inputs: Sequence[str]) -> str:
    returned = outputs[0] if len(outputs) == 1 else f"[{', '.join(outputs)}]"
    return _continued(fill_arguments(f"{returned} = {name}({', '.join(inputs)})", " " * 4, 86))


def _loads(program: Program, used: Container[str]) -> Iterable[str]:
    """Yield the statements that take the elements of the inputs, each a row with an element of every sample."""
    for signal in program.inputs:
        yield f"{signal.name} = reshape({signal.name}, {signal.size}, []);"
        if signal.shape:
            for row, element in enumerate(_by_columns(signal.elements, signal.shape), 1):
                if element in used:
                    yield f"{element} = {signal.name}({row}, :);"


def _by_columns(elements: Iterable[str], shape: tuple[int, ...]) -> list[str]:
    """Return the elements of an array, which stand by rows, by columns as MATLAB stores them."""
    rows = list(elements)
    if len(shape) < 2:
        return rows
    return [rows[i * shape[1] + j] for j in range(shape[1]) for i in range(shape[0])]


def _output(result: Result, program: Program, printer: _MatlabPrinter) -> str:
    """Return the array (shape, samples) of an output."""
    first = program.inputs[0]

    def row(node: Node) -> str:
        text = printer.text(node)
        return f"repmat({text}, 1, size({first.name}, 2))" if isinstance(node, Constant) else text

    return _array(_by_columns(map(row, result.nodes), result.signal.shape), result.signal.shape)


def _array(elements: list[str], shape: tuple[int, ...]) -> str:
    """Return elements by columns as an array, over all samples if they are rows of these."""
    column = elements[0] if len(elements) == 1 else f"[{'; '.join(elements)}]"
    return f"reshape({column}, {', '.join(map(str, shape))}, [])" if len(shape) == 2 else column


def _statement(name: str, value: str, indent: int = 8) -> str:
    return _continued(fill_expression(f"{name} = {value};", " " * indent, 92))


def _continued(text: str) -> str:
    """Return a statement that goes on in the next line with the mark that says so."""
    return text.replace("\n", " ...\n")
