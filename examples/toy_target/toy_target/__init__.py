"""A target of your own: Python on lists of numbers, without numpy, as small boards run it."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

from strapgen import Program, Signal, Sources, Target
from strapgen.targets.names import PYTHON, printed
from strapgen.targets.printer import Printer
from strapgen.targets.rendering import environment

#: How every operation is written for which the language has no operator. `sinc` and `wrap` are in the template.
FUNCTIONS = {
    "sqrt": "math.sqrt({})",
    "sin": "math.sin({})",
    "cos": "math.cos({})",
    "sinc": "_sinc({})",
    "atan2": "math.atan2({}, {})",
    "direction": "math.atan2({}, {})",
    "wrap": "_wrap({})",
    "maximum": "max({}, {})",
    "at_least": "{} >= {}",
    "select": "({1} if {0} else {2})",
}


class PlainPrinter(Printer):
    """Prints expressions; sums, products, signs and parentheses come from `Printer`."""

    functions = FUNCTIONS

    def constant(self, value: Fraction) -> str:
        """Return the shortest decimal that reads as the nearest double."""
        return repr(float(value))

    def function(self, kind: str, arguments: list[str]) -> str:
        """Return a call."""
        return self.functions[kind].format(*arguments)


def emit(program: Program, target: str) -> Sources:
    """Print a program as one module, in which no name of the kernel collides with a keyword or with the template."""
    scalars = [signal.name for signal in program.inputs if not signal.shape]  # they are their only element
    named, files = printed(program, lambda part, _: {f"{part.name}.py": text(part, target)}, PYTHON, scalars)
    return Sources.of(program, target, named.name, files)


def text(
    program: Program,
    target: str,
    printer: Printer | None = None,
    template: str = "module.py.j2",
    first: int = 0,
) -> str:
    """Return the module of a program whose names are free; arrays begin at the index `first`."""
    printer = printer or PlainPrinter()
    return (
        environment(Path(__file__).parent)
        .get_template(template)
        .render(
            program=program,
            target=target,
            loads=[load for signal in program.inputs for load in loads(signal, program.used(), first)],
            body=[(assignment, printer.text(assignment.value)) for assignment in program.body],
            outputs=[
                (result.signal.name, ", ".join(map(printer.text, result.nodes))) for result in program.outputs
            ],
        )
    )


def loads(signal: Signal, used: set[str], first: int = 0) -> Iterator[str]:
    """Yield a statement for every element of an input that is used; a scalar is there already."""
    for number, element in enumerate(signal.elements, first):
        if signal.shape and element in used:
            yield f"{element} = {signal.name}[{number}]"


TARGET = Target("Python on lists of numbers, without numpy", emit, language="Python", number="double")
