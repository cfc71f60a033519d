"""The MATLAB target: a function file that MATLAB and Octave run on one sample or on many, and its loop over a run."""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Sequence
from fractions import Fraction

from strapgen.ir.exceptions import InputError
from strapgen.ir.interfaces import RoundingBounds
from strapgen.ir.program import Constant, Node, Operation, Program, Result, walk
from strapgen.ir.sources import Sources
from strapgen.targets import contract, contract_lines
from strapgen.targets.c import HALF_TURNS, sources_of
from strapgen.targets.contract import rounding_text
from strapgen.targets.names import Language, function_name
from strapgen.targets.printer import Printer, fill_arguments, fill_expression
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
    runs = (f"{name}_propagate.m",) if program.attitude_step else ()
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
    if program.attitude_step is not None:
        values |= _loop(program, program.attitude_step.identity, printer)
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
    return _continue_lines(fill_arguments(f"{returned} = {name}({', '.join(inputs)})", " " * 4, 86))


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
    return _continue_lines(fill_expression(f"{name} = {value};", " " * indent, 92))


def _continue_lines(text: str) -> str:
    """Return a statement over several lines with the continuation mark."""
    return text.replace("\n", " ...\n")


# Names

#: Keywords of MATLAB and of Octave, and what either takes for a number or a value.
_WORDS_TEXT = """
arguments break case catch classdef continue do else elseif end end_try_catch end_unwind_protect
endclassdef endenumeration endevents endfor endfunction endif endmethods endparfor endproperties endswitch
endwhile enumeration events for function global if methods otherwise parfor persistent properties return
spmd switch try until unwind_protect unwind_protect_cleanup while
"""
_WORDS = frozenset(_WORDS_TEXT.split())


def _allows(name: str) -> bool:
    """Return whether an identifier can name a quantity: it begins with a letter, and has at most 63 characters."""
    return name not in _WORDS and not name.startswith("_") and len(name) <= 63


def _scopes(texts: Iterable[str]) -> list[set[str]]:
    """Return the identifiers of each function, its signature included."""
    scopes = []
    for text in texts:
        plain = re.sub(r"%.*$|'[^'\n]*'", " ", text, flags=re.MULTILINE)
        scopes += [
            set(re.findall(r"(?<![\w.])[^\W\d]\w*", part)) - {"function"}
            for part in re.split(r"^(?=function\b)", plain, flags=re.MULTILINE)
        ]
    return [scope for scope in scopes if scope]


#: The rules for the names of quantities.
MATLAB = Language(_allows, _scopes)


def file_name(program: Program) -> str:
    """Return the name of a program's function, which is that of its file: the name in C wherever it is free.

    MATLAB and Octave have thousands of functions, and a file of the same name would hide one of them. Their names are
    mostly a single word, so a kernel whose name is one gets another word behind it.
    """
    name = function_name(program)
    if not program.chosen_name:
        return name if "_" in name else f"{name}_Kernel"
    if not _allows(name):
        raise InputError(
            f"{name} is a word of MATLAB and Octave itself; another name of the function is needed"
        )
    return name
