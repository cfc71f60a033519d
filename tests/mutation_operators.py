"""Faults that a script puts into the sources, and a draw of them at random: signs, terms, bounds, shifts, conditions.

A fault is a replacement of a stretch of text, so that line numbers stay and a reader sees the changed line as it is.
Left alone is what decides nothing in numbers: annotations, decorators, messages, `__repr__`, sizes of caches.
"""

from __future__ import annotations

import ast
import hashlib
import re
from collections.abc import Iterator, Sequence
from itertools import accumulate
from pathlib import Path
from typing import NamedTuple

#: The folders of the package whose code has a numerical meaning.
FOLDERS = (
    *("ir", "kernel", "fixedpoint", "catalogue", "lowering", "targets", "run"),
    *("lab", "analysis", "design", "navigation", "firmware", "stamped"),
)
#: Modules in them that compute nothing: names, texts, and how other people's code is run.
WITHOUT_NUMBERS = (
    *("catalogue/names.py", "catalogue/user/", "targets/names.py", "targets/renaming.py", "targets/lines.py"),
    *("targets/contract.py", "targets/rendering.py", "analysis/series/notation.py"),
)
_SWAPPED = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.LShift: ("<<", ">>"),
    ast.RShift: (">>", "<<"),
    ast.FloorDiv: ("//", "*"),
}
_BOUNDS = {ast.Lt: ("<", "<="), ast.LtE: ("<=", "<"), ast.Gt: (">", ">="), ast.GtE: (">=", ">")}
_EQUALITIES = {ast.Eq: ("==", "!="), ast.NotEq: ("!=", "==")}
#: Functions whose result does not depend on the order of their arguments.
_SYMMETRIC = {
    *("min", "max", "add", "multiply", "maximum", "minimum", "dot", "gcd", "lcm", "hypot", "isclose"),
    *("isinstance", "zip", "print", "array_equal", "allclose", "equal", "isdisjoint", "join", "meet"),
}
#: Arguments by keyword that change no number.
_KEYWORDS = {"maxsize", "timeout", "indent", "sep", "end", "stacklevel", "mode", "encoding", "meaning"}
#: Functions whose arguments are texts for a person.
_MESSAGES = {"progress", "warn", "stage", "describe", "combination_meaning"}


#: Numbers below are tolerances and widths of margins, in which half as much again changes nothing.
_LARGEST_TOLERANCE = 1e-3


class Site(NamedTuple):
    """One fault: a stretch of a file and what replaces it."""

    file: str
    start: int
    end: int
    text: str
    kind: str

    def applied(self, source: str) -> str:
        """Return the source with the fault."""
        return source[: self.start] + self.text + source[self.end :]

    def line(self, source: str) -> int:
        """Return the number of the line, from 1, in which the fault stands."""
        return source.count("\n", 0, self.start) + 1


class _Finder(ast.NodeVisitor):
    """Gathers the faults that a module of Python can have."""

    def __init__(self, file: str, source: str) -> None:
        self.file, self.source, self.sites = file, source, list[Site]()
        self._lines = source.split("\n")
        self._starts = [0, *accumulate(len(line) + 1 for line in self._lines)]

    # Places

    def _place(self, line: int, column: int) -> int:
        """Return a place in the text; `ast` counts columns in bytes."""
        text = self._lines[line - 1]
        return self._starts[line - 1] + (column if text.isascii() else len(text.encode()[:column].decode()))

    def _span(self, node: ast.expr) -> tuple[int, int]:
        return (
            self._place(node.lineno, node.col_offset),
            self._place(node.end_lineno or node.lineno, node.end_col_offset or 0),
        )

    def _text(self, node: ast.expr) -> str:
        return self.source[slice(*self._span(node))]

    def _put(self, start: int, end: int, text: str, kind: str) -> None:
        self.sites.append(Site(self.file, start, end, text, kind))

    def _instead(self, node: ast.expr, text: str, kind: str) -> None:
        self._put(*self._span(node), text, kind)

    def _between(self, left: ast.expr, right: ast.expr, old: str, new: str, kind: str) -> None:
        """Replace the operator between two operands."""
        start, end = self._span(left)[1], self._span(right)[0]
        if (place := self.source.find(old, start, end)) >= 0:
            self._put(place, place + len(old), new, kind)

    # What is left alone

    def visit(self, node: ast.AST) -> None:
        if not isinstance(node, ast.Raise | ast.Assert | ast.JoinedStr):
            super().visit(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        if node.name in ("__repr__", "__str__", "__hash__", "text", "describe"):
            return
        for default in (*node.args.defaults, *(d for d in node.args.kw_defaults if d is not None)):
            self.visit(default)
        for statement in node.body:
            self.visit(statement)

    def visit_If(self, node: ast.If) -> None:
        if isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            return
        self._negate(node.test)
        self.generic_visit(node)

    # Faults

    def visit_While(self, node: ast.While) -> None:
        self._negate(node.test)
        self.generic_visit(node)

    def visit_IfExp(self, node: ast.IfExp) -> None:
        if not any(map(_is_text, (node.body, node.orelse))):
            self._negate(node.test)
            self.generic_visit(node)

    def visit_comprehension(self, node: ast.comprehension) -> None:
        for test in node.ifs:
            self._negate(test)
        self.generic_visit(node)

    def _negate(self, test: ast.expr) -> None:
        if isinstance(test, ast.Constant):
            return
        if isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not):
            self._instead(test, f"({self._text(test.operand)})", "not")
        else:
            self._instead(test, f"(not ({self._text(test)}))", "condition")

    def visit_BinOp(self, node: ast.BinOp) -> None:
        if _is_text(node.left) or _is_text(node.right):
            return
        if type(node.op) in _SWAPPED and not _is_list(node.left) and not _is_list(node.right):
            kind = "shift" if isinstance(node.op, ast.LShift | ast.RShift) else "operator"
            self._between(node.left, node.right, *_SWAPPED[type(node.op)], kind)
            if isinstance(node.op, ast.Add | ast.Sub):
                self._instead(node, f"({self._text(node.left)})", "term")
        elif isinstance(node.op, ast.MatMult):
            self._instead(node, f"({self._text(node.right)} @ {self._text(node.left)})", "order")
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.USub):
            self._instead(node, f"({self._text(node.operand)})", "sign")
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        for left, right in zip(node.values, node.values[1:], strict=False):
            self._between(left, right, old, new, "and-or")
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        operands = [node.left, *node.comparators]
        for left, operation, right in zip(operands, node.ops, operands[1:], strict=False):
            if type(operation) in _BOUNDS:
                self._between(left, right, *_BOUNDS[type(operation)], "bound")
            elif type(operation) in _EQUALITIES:
                self._between(left, right, *_EQUALITIES[type(operation)], "condition")
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        if type(node.value) is int:
            self._instead(node, str(node.value + 1), "off by one")
            if node.value > 0:
                self._instead(node, str(node.value - 1), "off by one")
        elif type(node.value) is float and abs(node.value) > _LARGEST_TOLERANCE:
            self._instead(node, repr(node.value * 1.5), "weight")

    def visit_Call(self, node: ast.Call) -> None:
        name = getattr(node.func, "id", getattr(node.func, "attr", ""))
        if name in _MESSAGES or name.endswith(("Error", "Warning")):
            return
        if name in ("min", "max"):
            end = self._span(node.func)[1]
            self._put(end - len(name), end, "max" if name == "min" else "min", "min-max")
        elif len(node.args) > 1 and name not in _SYMMETRIC:
            first, second = node.args[:2]
            plain = not any(
                isinstance(a, ast.Starred | ast.GeneratorExp) or _is_text(a) for a in (first, second)
            )
            if plain and self._text(first) != self._text(second):
                (start, end), (begin, stop) = self._span(first), self._span(second)
                swapped = self._text(second) + self.source[end:begin] + self._text(first)
                self._put(start, stop, swapped, "order")
        self.visit(node.func)
        for argument in node.args:
            self.visit(argument)
        for keyword in node.keywords:
            if keyword.arg not in _KEYWORDS:
                self.visit(keyword.value)


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def _is_list(node: ast.expr) -> bool:
    return isinstance(node, ast.List | ast.Tuple | ast.ListComp)


def of_python(file: str, source: str) -> list[Site]:
    """Return the faults that a module can have."""
    finder = _Finder(file, source)
    finder.visit(ast.parse(source))
    return list(dict.fromkeys(finder.sites))


def compiles(source: str) -> bool:
    """Return whether a text is a module of Python."""
    try:
        ast.parse(source)
    except SyntaxError:
        return False
    return True


#: Patterns in templates, what replaces a match, and the kind of the fault.
_TEMPLATE_FAULTS = [
    (re.compile(pattern), text, kind)
    for kind, pairs in {
        "bound": [(r"(?<=\s)<(?=\s)", "<="), (r"(?<=\s)>(?=\s)", ">=")],
        "operator": [(r"(?<=\s)\+(?=\s)", "-"), (r"(?<=\s)-(?=\s)", "+"), (r"\+=", "-="), (r"-=", "+=")],
        "shift": [("<<", ">>"), (">>", "<<")],
        "and-or": [("&&", "||"), (r"\|\|", "&&")],
        "condition": [("==", "!="), ("!=", "==")],
        "off by one": [(r"\b0(?=;)", "1"), (r"\b2\b(?=[ ;])", "3"), (r"\b1\b(?=[ ;])", "2")],
    }.items()
    for pattern, text in pairs
]
_COMMENT = re.compile(r'^\s*(/?\*|//|#|""")|^\s*[A-Z][^=(]*\.$')


def of_template(file: str, source: str) -> list[Site]:
    """Return the faults that the code in a template can have; its comments and its own conditions stay."""
    sites = []
    place, inside = 0, False
    for line in source.splitlines(keepends=True):
        quotes = line.count('"""')
        comment = inside or quotes > 0 or _COMMENT.match(line) or "{%" in line
        if "{#" not in line and not comment:
            for pattern, text, kind in _TEMPLATE_FAULTS:
                for match in pattern.finditer(line):
                    if line.count('"', 0, match.start()) % 2 == 0:
                        sites.append(Site(file, place + match.start(), place + match.end(), text, kind))
        inside ^= quotes % 2 == 1
        place += len(line)
    return sites


def sites(root: Path, texts: bool = False) -> dict[str, list[Site]]:
    """Return all faults by folder: those of the package, and "templates"; of modules that compute nothing if told."""
    package = root / "codegen" / "strapgen"
    by_folder: dict[str, list[Site]] = {}
    for folder in FOLDERS:
        for path in sorted((package / folder).rglob("*.py")):
            if texts or not path.relative_to(package).as_posix().startswith(WITHOUT_NUMBERS):
                file = path.relative_to(root).as_posix()
                by_folder.setdefault(folder, []).extend(of_python(file, path.read_text()))
    for path in sorted((root / "templates").rglob("*.c.j2")) + sorted((root / "templates").rglob("*.py.j2")):
        file = path.relative_to(root).as_posix()
        by_folder.setdefault("templates", []).extend(of_template(file, path.read_text()))
    return by_folder


def drawn(by_folder: dict[str, list[Site]], root: Path, count: int, seed: int) -> list[Site]:
    """Return faults drawn at random: from every folder in proportion to its number, one at least, of all kinds alike.

    The lot of a fault is a hash of the seed and of its own text, so that a change of the sources leaves the draw
    elsewhere as it is. `by_folder` is what `sites` returns, `root` the folder of their files.
    """
    shares = _shares({folder: len(choices) for folder, choices in by_folder.items()}, count)
    return [site for folder, share in shares.items() for site in _mixed(by_folder[folder], share, seed, root)]


def _mixed(choices: Sequence[Site], count: int, seed: int, root: Path) -> Iterator[Site]:
    """Yield some faults, of one kind after the other, no two of them in one place."""
    texts = {file: (root / file).read_text() for file in {site.file for site in choices}}

    def lot(site: Site) -> bytes:
        text = texts[site.file]
        before = text[text.rfind("\n", 0, site.start) + 1 : site.start]
        return _hash(seed, site.file, site.kind, before, text[site.start : site.end], site.text)

    by_kind: dict[str, list[Site]] = {}
    for site in sorted(choices, key=lot, reverse=True):
        by_kind.setdefault(site.kind, []).append(site)
    kinds = sorted(by_kind, key=lambda kind: _hash(seed, choices[0].file, kind))
    places: set[tuple[str, int]] = set()
    while len(places) < count:
        kinds = [kind for kind in kinds if by_kind[kind]]
        for kind in kinds:
            site = by_kind[kind].pop()
            new = (site.file, site.start) not in places
            if new and (site.file.endswith(".j2") or compiles(site.applied(texts[site.file]))):
                places.add((site.file, site.start))
                yield site
            if len(places) == count:
                return


def _hash(*parts: object) -> bytes:
    return hashlib.sha256("\0".join(map(str, parts)).encode()).digest()


def _shares(sizes: dict[str, int], count: int) -> dict[str, int]:
    """Return how many of `count` fall to each folder, by the largest remainder after one for each."""
    total, left = sum(sizes.values()), count - len(sizes)
    exact = {name: left * size / total for name, size in sizes.items()}
    shares = {name: 1 + int(share) for name, share in exact.items()}
    by_rest = sorted(sizes, key=lambda name: (int(exact[name]) - exact[name], name))
    for name in by_rest[: count - sum(shares.values())]:
        shares[name] += 1
    return shares
