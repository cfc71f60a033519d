"""Turns the LaTeX of formulas into MathML, which browsers typeset without a library or a font from elsewhere."""

from __future__ import annotations

import html
import re
from collections.abc import Iterator
from dataclasses import dataclass

from strapgen.results.display.latex import parts

#: Characters of commands, by the element that holds them: identifiers, and operators.
_IDENTIFIERS = {
    **{"alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ε", "varepsilon": "ε", "zeta": "ζ"},
    **{"eta": "η", "theta": "θ", "vartheta": "ϑ", "iota": "ι", "kappa": "κ", "lambda": "λ", "mu": "μ"},
    **{"nu": "ν", "xi": "ξ", "pi": "π", "rho": "ρ", "sigma": "σ", "tau": "τ", "phi": "ϕ", "varphi": "φ"},
    **{"chi": "χ", "psi": "ψ", "omega": "ω", "Gamma": "Γ", "Delta": "Δ", "Theta": "Θ", "Phi": "Φ"},
    **{"Psi": "Ψ", "Omega": "Ω", "Sigma": "Σ", "infty": "∞", "ell": "ℓ"},
}
_OPERATORS = {
    **{"times": "×", "cdot": "⋅", "circ": "∘", "leq": "≤", "le": "≤", "geq": "≥", "ge": "≥", "neq": "≠"},
    **{"ne": "≠", "approx": "≈", "wedge": "∧", "vee": "∨", "neg": "¬", "lfloor": "⌊", "rfloor": "⌋"},
    **{"{": "{", "}": "}", "to": "→", "pm": "±", "in": "∈", "lVert": "‖", "rVert": "‖"},
}
_SPACES = {"quad": 1.0, "qquad": 2.0, ",": 0.167, ":": 0.222, ";": 0.278, " ": 0.25, "!": -0.167}
_FUNCTIONS = ("sin", "cos", "tan", "exp", "log", "max", "min", "det")
#: Commands whose argument is text in a style of its own.
_STYLES = {"mathbf": "bold", "boldsymbol": "bold", "mathit": "words", "mathrm": "upright"}
_FENCES = {"left": True, "right": True, "bigl": False, "bigr": False}
_TOKEN = re.compile(r"\\(?:[A-Za-z]+|.)|\d+(?:\.\d+)?|[^\s]", re.DOTALL)
#: What stands between the lines of one equation that is broken at the width of a page.
_LISTED = re.compile(r", \\\\\n\s*&\\quad (?:\{\} )?")
_CONTINUED = re.compile(r" \\\\\n\s*&\\quad (?:\{\} )?")
#: A sign at the beginning of a piece stands between two terms.
_INFIX = ("<math><mo>", '<math><mo form="infix">')


@dataclass(frozen=True)
class FormulaRow:
    """A row of an align environment."""

    #: Its left side as MathML, with the relation
    left: str
    #: Its right side, in pieces of MathML between which a line may end
    parts: tuple[str, ...]


def equations(latex: str) -> list[FormulaRow]:
    r"""Return the rows of an align environment.

    >>> (row,) = equations("\\begin{align*}\ny &= a + b\n\\end{align*}")
    >>> row.parts
    ('<math><mi>a</mi></math>', '<math><mo form="infix">+</mo><mi>b</mi></math>')
    """
    body = latex.strip().removeprefix(r"\begin{align*}").removesuffix(r"\end{align*}").strip()
    whole = _CONTINUED.sub(" ", _LISTED.sub(r", \\quad ", body))
    rows = []
    for row in whole.split(" \\\\\n"):
        left, _, right = row.partition("&=")
        first, *others = [piece for piece in map(str.strip, parts(right.strip())) if piece] or [""]
        pieces = (mathml(first), *(mathml(piece).replace(*_INFIX, 1) for piece in others))
        rows.append(FormulaRow(mathml(f"{left} ="), pieces))
    return rows


def mathml(latex: str) -> str:
    r"""Return a formula as MathML in the line.

    >>> mathml(r"\tfrac{1}{2} x^{2}")
    '<math><mfrac><mn>1</mn><mn>2</mn></mfrac><msup><mi>x</mi><mn>2</mn></msup></math>'
    """
    return f"<math>{''.join(_Reader(latex).elements(()))}</math>"


class _Reader:
    """Reads a formula from left to right."""

    def __init__(self, latex: str) -> None:
        self._text = latex
        self._tokens = [(match[0], match.start()) for match in _TOKEN.finditer(latex)]
        self._place = 0

    def _peek(self) -> str:
        return self._tokens[self._place][0] if self._place < len(self._tokens) else ""

    def _next(self) -> str:
        token = self._peek()
        self._place += 1
        return token

    def elements(self, ends: tuple[str, ...]) -> list[str]:
        """Return elements up to one of some tokens, which stays unread, or to the end."""
        result: list[str] = []
        while self._peek() and self._peek() not in ends:
            if self._peek() in ("^", "_"):
                result.append(self._with_scripts(result.pop() if result else "<mrow></mrow>"))
            else:
                result += self._element()
        return result

    def _with_scripts(self, base: str) -> str:
        scripts: dict[str, str] = {}
        while self._peek() in ("^", "_"):
            sign = self._next()
            scripts[sign] = self._argument()
        if len(scripts) == 2:
            return f"<msubsup>{base}{scripts['_']}{scripts['^']}</msubsup>"
        sign, script = scripts.popitem()
        name = "msup" if sign == "^" else "msub"
        return f"<{name}>{base}{script}</{name}>"

    def _argument(self) -> str:
        """Return the next token, or the content of braces, as one element."""
        if self._peek() != "{":
            return _row(list(self._element()))
        self._next()
        if (word := self._word()) is not None:
            return word
        elements = self.elements(("}",))
        self._next()
        return _row(elements)

    def _word(self) -> str | None:
        """Return letters alone in braces as a word, as labels are; None for anything else."""
        match = re.match(r"([A-Za-z]{2,})\}", self._text[self._tokens[self._place][1] :])
        if match is None:
            return None
        while self._next() != "}":
            pass
        return f"<mi>{match[1]}</mi>"

    def _raw(self) -> str:
        """Return the text of the next braces."""
        self._next()
        start, depth = self._tokens[self._place][1], 1
        while depth:
            end = self._tokens[self._place][1] if self._place < len(self._tokens) else len(self._text)
            token = self._next()
            depth += (token == "{") - (token in ("}", ""))
        return self._text[start:end].replace(r"\_", "_")

    def _element(self) -> Iterator[str]:
        token = self._next()
        if token == "{":
            elements = self.elements(("}",))
            self._next()
            yield _row(elements)
        elif token.startswith("\\"):
            yield from self._command(token[1:])
        elif token[0].isdigit():
            yield f"<mn>{token}</mn>"
        elif token.isalpha():
            yield f"<mi>{token}</mi>"
        elif token == "|":
            yield '<mo stretchy="false">|</mo>'
        elif token == "-":
            yield "<mo>−</mo>"
        elif token in "()[]":
            yield f'<mo stretchy="false">{token}</mo>'
        elif token not in "&~":
            yield f"<mo>{html.escape(token)}</mo>"

    def _command(self, name: str) -> Iterator[str]:
        if name in ("frac", "tfrac"):
            fraction = f"<mfrac>{self._argument()}{self._argument()}</mfrac>"
            yield fraction if name == "tfrac" else f'<mstyle displaystyle="true">{fraction}</mstyle>'
        elif name == "sqrt":
            yield f"<msqrt>{self._argument()}</msqrt>"
        elif name in ("dot", "bar", "hat"):
            mark = {"dot": "˙", "bar": "¯", "hat": "^"}[name]
            yield f'<mover accent="true">{self._argument()}<mo>{mark}</mo></mover>'
        elif name in _STYLES:
            yield self._style(_STYLES[name])
        elif name == "text":
            yield f"<mtext>{html.escape(self._raw())}</mtext>"
        elif name == "operatorname":
            yield f"<mi>{html.escape(self._raw().lower())}</mi>"
        elif name in _FENCES:
            yield from self._fence(_FENCES[name])
        elif name == "begin":
            yield from self._environment(self._raw())
        elif name in _SPACES:
            yield f'<mspace width="{_SPACES[name]}em"></mspace>'
        elif name in _OPERATORS:
            yield f"<mo>{_OPERATORS[name]}</mo>"
        elif name in _FUNCTIONS:
            yield f'<mspace width="0.167em"></mspace><mi>{name}</mi>'
        elif name != "\\":
            yield f"<mi>{_IDENTIFIERS.get(name, html.escape(name))}</mi>"

    def _style(self, style: str) -> str:
        """Return letters in a style; underscores of words become spaces."""
        text = self._raw() if self._peek() == "{" else self._next()
        text = _IDENTIFIERS.get(text.removeprefix("\\"), text).replace("_", " ")
        return f'<mi class="{style}" mathvariant="normal">{html.escape(text)}</mi>'

    def _fence(self, stretchy: bool) -> Iterator[str]:
        sign = self._next()
        sign = _OPERATORS.get(sign.removeprefix("\\"), sign)
        if sign != ".":
            size = str(stretchy).lower()
            yield f'<mo stretchy="{size}" lspace="0" rspace="0">{html.escape(sign)}</mo>'

    def _environment(self, name: str) -> Iterator[str]:
        """Yield an environment of rows and columns as a table, cases with their brace."""
        rows: list[list[str]] = [[]]
        while self._peek() and self._peek() != "\\end":
            rows[-1].append("".join(self.elements(("&", "\\\\", "\\end"))))
            if self._peek() != "\\end" and self._next() == "\\\\":
                rows.append([])
        self._next()
        self._raw()
        cells = ("".join(f"<mtd>{cell}</mtd>" for cell in row) for row in rows if row)
        table = f"<mtable>{''.join(f'<mtr>{row}</mtr>' for row in cells)}</mtable>"
        yield f"<mrow><mo>{{</mo>{table}</mrow>" if name == "cases" else table


def _row(elements: list[str]) -> str:
    """Return elements as one."""
    return elements[0] if len(elements) == 1 else f"<mrow>{''.join(elements)}</mrow>"
