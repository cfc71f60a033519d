"""The printer writes expressions as source text; the printers of all targets extend it."""

from __future__ import annotations

from fractions import Fraction

from strapgen.ir.program import DOUBLE_RESOLUTION, RESOLUTION, Constant, Node, Reference

_SUM, _PRODUCT, _UNARY, _ATOM = range(4)


class Printer:
    """Prints nodes with the fewest parentheses that keep the order of the operations.

    Sums look the same in every language here; a target's printer prints constants and functions.
    """

    #: The step from 1 to the next number of the target.
    resolution = DOUBLE_RESOLUTION
    #: The operators of a product and of a quotient.
    times, over = "*", "/"

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
            text = self.constant(abs(node.value))
            return (f"-{text}", _UNARY) if node.value < 0 else (text, _ATOM)
        method = getattr(self, f"_{node.kind}", None)
        if method is not None:
            printed: tuple[str, int] = method(*node.arguments)
            return printed
        return self.function(node.kind, [self.text(argument) for argument in node.arguments]), _ATOM

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
