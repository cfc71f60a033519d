"""The numpy target: one module for each kernel, with functions that are vectorised over leading axes."""

from __future__ import annotations

from fractions import Fraction

from strapgen.ir.program import Operation, Program, Reference, walk
from strapgen.ir.sources import Sources
from strapgen.targets.contract import generating
from strapgen.targets.names import PYTHON, printed
from strapgen.targets.printer import Printer, fill_expression
from strapgen.targets.rendering import render

_FUNCTIONS = {
    "sqrt": "np.sqrt({})",
    "sin": "np.sin({})",
    "cos": "np.cos({})",
    "sinc": "_sinc({})",
    "atan2": "np.arctan2({}, {})",
    "direction": "np.arctan2({}, {})",
    "wrap": "_wrap({})",
    "maximum": "np.maximum({}, {})",
    "at_least": "{} >= {}",
    "select": "np.where({}, {}, {})",
}


class _NumpyPrinter(Printer):
    """Prints nodes as numpy expressions."""

    def constant(self, value: Fraction) -> str:
        """Return the shortest decimal that reads as the nearest double."""
        return repr(float(value))

    def function(self, kind: str, arguments: list[str]) -> str:
        """Return a numpy call."""
        return _FUNCTIONS[kind].format(*arguments)


def emit(program: Program, target: str) -> Sources:
    """Print a module with a function of arrays (..., shape), and of a step the function ``<name>_transition``."""
    scalars = [signal.name for signal in program.inputs if not signal.shape]
    named, files = printed(program, lambda part, _: _files(part, target), PYTHON, scalars)
    return Sources.of(program, target, named.name, files)


def _files(program: Program, target: str) -> dict[str, str]:
    """Return the module of a program with its printed names."""
    functions = [program] if program.transition is None else [program, program.transition_program()]
    kinds = {
        node.kind
        for assignment in program.body
        for node in walk(assignment.value)
        if isinstance(node, Operation)
    }
    text = render(
        "numpy_code/module.py.j2",
        program=program,
        command=f"{generating(program)} --target {target}",
        functions=[_function(part, part is not program) for part in functions],
        uses_sinc="sinc" in kinds,
        uses_wrap="wrap" in kinds,
    )
    return {f"{program.name}.py": text}


def _function(program: Program, is_transition: bool) -> dict[str, object]:
    printer = _NumpyPrinter()
    used = program.used()
    loads = []
    for signal in program.inputs:
        for place, name in zip(_places(signal.shape), signal.elements, strict=True):
            if name in used and signal.shape:
                loads.append(f"{name} = {signal.name}[..., {place}]")
    assigned = [
        {"text": _statement(a.name, printer.text(a.value)), "meaning": a.meaning} for a in program.body
    ]
    inputs = {name for signal in program.inputs for name in signal.elements}
    stores = []
    copies: set[str] = set()  # inputs that go straight out are copied first: the output may be the input
    for result in program.outputs:
        for place, node in zip(_places(result.signal.shape), result.nodes, strict=True):
            stores.append(f"{result.signal.name}[..., {place}] = {printer.text(node)}")
            if isinstance(node, Reference) and node.name in inputs:
                copies.add(node.name)
    return {
        "name": f"{program.name}_transition" if is_transition else program.name,
        "program": program,
        "loads": loads,
        "body": assigned,
        "stores": stores,
        "copies": sorted(copies),
    }


def _places(shape: tuple[int, ...]) -> list[str]:
    if len(shape) == 2:
        return [f"{i}, {j}" for i in range(shape[0]) for j in range(shape[1])]
    return [str(i) for i in range(shape[0])] if shape else [""]


def _statement(name: str, value: str, width: int = 100) -> str:
    line = f"{name} = {value}"
    if len(line) + 4 <= width:
        return line
    return f"{name} = (\n        {fill_expression(value, ' ' * 8, width)}\n    )"
