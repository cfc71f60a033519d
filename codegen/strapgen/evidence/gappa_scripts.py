"""Scripts for Gappa: what a program computes with roundings, beside the same program in exact numbers.

In a script ``c_x`` is the computed value of x and ``x_x`` the exact one. Gappa follows sums, products, quotients and
square roots; it checks that the rules by which a script rewrites one expression as another are identities.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from strapgen.ir.program import Constant, Node, Program, Reference

#: The operations of a program that Gappa knows by a sign.
SIGNS = {"add": "+", "subtract": "-", "multiply": "*", "divide": "/"}


class CannotFollowError(Exception):
    """A program has what Gappa has no theorem for; the message says what."""


@dataclass
class Script:
    """A script for Gappa."""

    #: Lines ``name = expression;``, facts of the inputs, and lines that tell Gappa how to rewrite an expression
    definitions: list[str] = field(default_factory=list)
    hypotheses: list[str] = field(default_factory=list)
    rules: list[str] = field(default_factory=list)
    #: Expressions, each with the bound of its magnitude that the project states
    goals: dict[str, Fraction] = field(default_factory=dict)

    def claim(self) -> str:
        """Return the script that claims the bounds."""
        return self._text([f"|{text}| <= {number(bound)}" for text, bound in self.goals.items()])

    def question(self) -> str:
        """Return the script that asks Gappa for its bounds."""
        return self._text([f"|{text}| in ?" for text in self.goals])

    def define(self, name: str, text: str) -> None:
        """Give an expression a name."""
        self.definitions.append(f"{name} = {text};")

    def suppose(self, name: str, low: Fraction, high: Fraction) -> None:
        """State the range of an input, or of a value that the code checks."""
        self.hypotheses.append(f"{name} in [{number(low)},{number(high)}]")

    def aim(self, text: str, bound: Fraction) -> None:
        """Add a goal; of two outputs that are the same, the smaller bound is claimed."""
        self.goals[text] = min(bound, self.goals.get(text, bound))

    def _text(self, goals: Sequence[str]) -> str:
        body = " /\\\n  ".join(self.hypotheses) + " ->\n  " + " /\\\n  ".join(goals)
        return "\n".join([*self.definitions, "", f"{{ {body} }}", "", *self.rules, ""])


def number(value: Fraction) -> str:
    """Return an exact number as Gappa reads it.

    >>> number(Fraction(-3, 8)), number(Fraction(1, 48)), number(Fraction(2))
    ('-3b-3', '(1/48)', '2')
    """
    top, bottom = value.numerator, value.denominator
    if bottom & (bottom - 1) == 0:
        return f"{top}b-{bottom.bit_length() - 1}" if bottom > 1 else str(top)
    return f"({top}/{bottom})"


def product(coefficient: Fraction, names: Sequence[str]) -> str:
    """Return a multiple of a product."""
    if not names:
        return number(coefficient)
    return " * ".join(names if coefficient == 1 else [number(coefficient), *names])


def total(terms: Sequence[str]) -> str:
    """Return a sum; what is less than nothing is subtracted, as programs have it.

    >>> total(["a * b", "-1 * c", "1b-3"])
    'a * b - c + 1b-3'
    """
    if not terms:
        return "0"
    first, *others = terms
    return first + "".join(
        f" - {term.removeprefix('-1 * ')}" if term.startswith("-1 * ") else f" + {term}" for term in others
    )


def exact_lines(
    program: Program, name_of_input: Callable[[str], str]
) -> tuple[list[str], dict[str, list[str]]]:
    """Return an exact program as definitions, and what holds its results."""
    inputs = {element for signal in program.inputs for element in signal.elements}

    def name(reference: str) -> str:
        return name_of_input(reference) if reference in inputs else f"x_{reference}"

    used = program.used(program.outputs)
    lines = [f"x_{a.name} = {_expression(a.value, name)};" for a in program.body if a.name in used]
    results = {r.signal.name: [_expression(node, name) for node in r.nodes] for r in program.outputs}
    return lines, results


def _expression(node: Node, name: Callable[[str], str]) -> str:
    if isinstance(node, Constant):
        return number(node.value)
    if isinstance(node, Reference):
        return name(node.name)
    arguments = [_expression(argument, name) for argument in node.arguments]
    if node.kind == "negate":
        return f"(-{arguments[0]})"
    if node.kind == "sqrt":
        return f"sqrt({arguments[0]})"
    if node.kind not in SIGNS:
        raise CannotFollowError(f"the program calls {node.kind}, for which Gappa has no theorem")
    return f"({arguments[0]} {SIGNS[node.kind]} {arguments[1]})"
