"""SymPy's expressions as LaTeX whose sums can be broken at the width of a page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction

import sympy as sp

from strapgen.results.display.latex import PAGE, equations, fits, sum_text, unbroken, width

#: Width of a left side, about, in widths of a digit.
_LEFT = 8.0


def expression_latex(expression: sp.Expr) -> str:
    r"""Return an expression as LaTeX: as it stands if lines hold its parts, otherwise expanded, a term at a time.

    >>> x = sp.Symbol("x")
    >>> expression_latex((x - 1) / 2)
    '\\frac{x}{2} - \\frac{1}{2}'
    """
    text = str(sp.latex(expression))
    if unbroken(text) <= PAGE - _LEFT:
        return text
    terms = sp.Add.make_args(sp.expand(expression))
    numbers = []
    for term in terms:
        number, factor = term.as_coeff_Mul()
        if not number.is_Rational:
            return " + ".join(str(sp.latex(one)) for one in terms).replace("+ -", "- ")
        numbers.append((Fraction(int(number.p), int(number.q)), "" if factor == 1 else str(sp.latex(factor))))
    return sum_text(numbers)


def named_equations(sides: Iterable[tuple[str, sp.Expr]], names: Mapping[sp.Symbol, str]) -> str:
    r"""Return equations as one align environment; what no line holds gets a letter with a number, and a line before.

    `names` has the LaTeX of the left sides' symbols.
    """
    pairs = list(sides)
    column = max((width(left) for left, _ in pairs), default=0.0)
    heads = {name.partition("_")[0] for name in names.values()}
    naming = _Naming(PAGE - column - 2.5, dict(names), next(one for one in "qsuzrtvwxy" if one not in heads))
    return equations(row for left, expression in pairs for row in naming.rows(left, expression))


class _Naming:
    """Letters for subexpressions that are too wide for a line, each once in all equations."""

    def __init__(self, room: float, names: dict[sp.Symbol, str], letter: str) -> None:
        self._room, self._names, self._letter = room, names, letter
        self._letters: dict[sp.Expr, sp.Symbol] = {}

    def rows(self, left: str, expression: sp.Expr) -> Iterator[tuple[str, str]]:
        """Yield an equation, before it those of the letters that are new in it."""
        expression = expression.xreplace(self._letters)
        while not fits(self._latex(expression), self._room) and (wide := self._widest(expression)):
            letter = sp.Dummy(real=True)
            *inner, (_, right) = self.rows("", wide)
            self._names[letter] = f"{self._letter}_{{{len(self._letters) + 1}}}"
            self._letters[wide] = letter
            yield from inner
            yield self._names[letter], right
            expression = expression.xreplace({wide: letter})
        yield left, self._latex(expression)

    def _widest(self, expression: sp.Expr) -> sp.Expr | None:
        """Return the widest function or root within an expression, of those that lines hold if there are such."""
        inside = [
            part
            for part in sp.preorder_traversal(expression)
            if part is not expression and (part.is_Function or (part.is_Pow and not part.exp.is_Integer))
        ]
        texts = {part: self._latex(part) for part in inside}
        whole = [part for part in inside if fits(texts[part], self._room)]
        return max(whole or inside, key=lambda part: width(texts[part]), default=None)

    def _latex(self, expression: sp.Expr) -> str:
        return str(sp.latex(expression, symbol_names=self._names))
