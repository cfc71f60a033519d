"""The printer writes expressions as source text; the printers of all targets extend it."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable
from fractions import Fraction

from strapgen.ir.exceptions import InputError
from strapgen.ir.program import DOUBLE_RESOLUTION, RESOLUTION, Constant, Node, Reference

_SUM, _PRODUCT, _UNARY, _ATOM = range(4)


class Printer:
    """Prints nodes with the fewest parentheses that keep the order of the operations.

    Sums look the same in every language here; a target's printer prints constants and functions.
    """

    #: The step from 1 to the next number of the target.
    resolution: Fraction = DOUBLE_RESOLUTION
    #: The operators of a product and of a quotient.
    times: str = "*"
    over: str = "/"

    def text(self, node: Node) -> str:
        """Return a node as source text."""
        return self._print(node)[0]

    def constant(self, value: Fraction) -> str:
        """Return a number as source text, correctly rounded."""
        raise NotImplementedError

    def reference(self, name: str) -> str:
        """Return a name as source text; the resolution is a number of the target."""
        return self.constant(self.resolution) if name == RESOLUTION else name

    def function(self, kind: str, arguments: list[str]) -> str:
        """Return a call, for every operation that is not written with an operator."""
        raise NotImplementedError

    def _print(self, node: Node) -> tuple[str, int]:
        if isinstance(node, Reference):
            return self.reference(node.name), _ATOM
        if isinstance(node, Constant):
            text = self._written("constant", "numbers", lambda: self.constant(abs(node.value)))
            return (f"-{text}", _UNARY) if node.value < 0 else (text, _ATOM)
        method = getattr(self, f"_{node.kind}", None)
        if method is not None:
            printed: tuple[str, int] = method(*node.arguments)
            return printed
        arguments = [self.text(argument) for argument in node.arguments]
        what = f"{node.kind} of {len(arguments)} arguments"
        return self._written("function", what, lambda: self.function(node.kind, arguments), node.kind), _ATOM

    def _written(self, method: str, what: str, write: Callable[[], str], kind: str = "") -> str:
        """Return the text that a method of a target's printer writes; say which method is missing."""
        try:
            text = write()
        except (KeyError, NotImplementedError) as error:
            if isinstance(error, KeyError) and error.args != (kind,):
                raise
            text = None  # as from a method without a return
        if not isinstance(text, str):
            printer = type(self).__name__
            raise InputError(f"{printer} does not print {what}; its method {method} must return the text")
        return text

    def _inside(self, node: Node, level: int) -> str:
        text, binding = self._print(node)
        return text if binding >= level else f"({text})"

    def _add(self, left: Node, right: Node) -> tuple[str, int]:
        return f"{self._inside(left, _SUM)} + {self._inside(right, _PRODUCT)}", _SUM

    def _subtract(self, left: Node, right: Node) -> tuple[str, int]:
        return f"{self._inside(left, _SUM)} - {self._inside(right, _PRODUCT)}", _SUM

    def _multiply(self, left: Node, right: Node) -> tuple[str, int]:
        return f"{self._inside(left, _PRODUCT)} {self.times} {self._inside(right, _UNARY)}", _PRODUCT

    def _divide(self, left: Node, right: Node) -> tuple[str, int]:
        return f"{self._inside(left, _PRODUCT)} {self.over} {self._inside(right, _UNARY)}", _PRODUCT

    def _negate(self, argument: Node) -> tuple[str, int]:
        # Two signs in a row are another operator in C.
        return f"-{self._inside(argument, _ATOM)}", _UNARY


class ExactPrinter(Printer):
    """Prints constants as fractions, and functions by their names."""

    def constant(self, value: Fraction) -> str:
        """Return a number as an integer or a fraction in parentheses."""
        return str(value) if value.denominator == 1 else f"({value})"

    def reference(self, name: str) -> str:
        """Return a name."""
        return name

    def function(self, kind: str, arguments: list[str]) -> str:
        """Return a call."""
        return f"{kind}({', '.join(arguments)})"


def fill(text: str, indent: str, width: int = 99) -> str:
    """Wrap text at spaces, every line after the first with `indent`."""
    if len(text) <= width and not re.search(r"[^\S ]", text):
        return text.rstrip()
    return "\n".join(
        textwrap.wrap(text, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    )


def fill_expression(text: str, indent: str, width: int = 99) -> str:
    """Wrap an expression before the signs of sums and choices, every line after the first with `indent`.

    What is still too long is wrapped at products and comparisons, then between arguments, then behind a parenthesis,
    and at last before shifts, values and comments, and inside of casts.
    """
    pieces = [text]
    for place in (
        *(r" (?=[+?:-] )", r" (?=(?:\.?[*/]|>=|[|]{1,2}) )", r"(?<=[,;]) ", r"(?<=[\w)]\()(?=\S)"),
        *(r" (?=(?:<<|>>|=|/[*]) )", r"(?<=>\()(?=\S)"),
    ):
        pieces = [
            part
            for piece in pieces
            for part in (
                re.split(place, piece) if len(indent) + len(piece) > width or piece is text else [piece]
            )
        ]
    return _filled(pieces, indent, width)


def fill_arguments(text: str, indent: str, width: int = 99) -> str:
    """Wrap a declaration or a call after its commas, every line after the first with `indent`.

    Where the first argument does not fit, a line ends with the parenthesis before it.
    """
    first, *others = re.split(r"(?<=,) ", text)
    pieces = [first] if len(first) <= width else re.split(r"(?<=\()", first, maxsplit=1)
    return _filled([*pieces, *others], indent, width)


def fill_lines(text: str, width: int = 99) -> str:
    """Wrap the lines of a text that are too long, each as an expression."""
    return "\n".join(
        line
        if len(line) <= width
        else fill_expression(line, " " * (len(line) - len(line.lstrip()) + 4), width)
        for line in text.split("\n")
    )


def fill_definition(name: str, value: str, meaning: str, width: int = 99) -> str:
    """Return the definition of a macro with a comment, over several lines if it is too long for one."""
    line = f"#define {name} {value} /* {meaning} */"
    if len(line) <= width:
        return line
    wrapped = fill_arguments(value, "    ", width - 6)
    return f"/* {meaning} */\n#define {name} \\\n    " + wrapped.replace("\n", " \\\n")


def _filled(pieces: list[str], indent: str, width: int) -> str:
    lines: list[str] = []
    for piece in pieces:
        between = "" if lines and lines[-1].endswith("(") else " "
        if lines and len(lines[-1]) + len(between) + len(piece) <= width:
            lines[-1] += f"{between}{piece}"
        else:
            lines.append(f"{indent if lines else ''}{piece}")
    return "\n".join(lines)
