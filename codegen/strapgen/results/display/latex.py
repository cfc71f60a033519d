"""LaTeX for several reports: environments of the package amsmath, broken at the width of a page."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction

#: The width of a line of text in widths of a digit: 345 pt, that of the class article at 10 pt, less the number.
PAGE = 60.0
#: Width of the space before a continued line.
_INDENT = 2.0
#: Commands that take the width of nothing, and of several digits.
_WIDTHS = {"left": 0.0, "right": 0.0, "quad": 2.0, "qquad": 4.0, "!": -0.3, ",": 0.35, ";": 0.6, " ": 0.6}
_WIDTHS |= {"leq": 2.8, "geq": 2.8, "max": 3.6}


def align_environment(rows: Iterable[str]) -> str:
    """Return rows as one align environment of the package amsmath; each has its & before the relation."""
    body = " \\\\\n".join(rows)
    return f"\\begin{{align*}}\n{body}\n\\end{{align*}}"


def equations(sides: Iterable[tuple[str, str]], page: float = PAGE, head: str = "") -> str:
    r"""Return equations, left and right sides, as one align environment, each broken where the page ends.

    `page` is in widths of a digit; `head` stands before the left sides.
    """
    pairs = list(sides)
    column = max((width(left) for left, _ in pairs), default=0.0)
    return align_environment(f"{head}{left} &= {broken(right, page - column - 2.5)}" for left, right in pairs)


def broken(text: str, room: float) -> str:
    """Break a formula of an align environment before signs, where a line of so many widths of a digit is full."""
    lines: list[str] = []
    line = ""
    if any(width(part) > room for part in parts(text)):
        text = _with_slashes(text, room)
    for part in parts(text):
        if line and width(line) + width(part) > room - (_INDENT if lines else 0.0):
            lines.append(line.strip())
            line = ""
        line += part
    lines.append(line.strip())
    lines = [line.removeprefix(r"\quad ") for line in _fix_fences(lines)]
    # A line may begin with a sign: {} before it keeps the space of an operation between two numbers.
    return " \\\\\n    &\\quad {} ".join(lines)


def width(text: str) -> float:
    r"""Return about how wide a formula is, in widths of a digit.

    >>> width("a + b"), width(r"\tfrac{1}{48} A"), width(r"\boldsymbol\sigma")
    (4.8, 2.6, 1.2)
    """
    total, _ = _measure(text, 0)
    return round(total, 3)


def unbroken(text: str) -> float:
    """Return the width of the widest part of a formula that no line break divides."""
    return max(map(width, parts(text)))


def fits(text: str, room: float) -> bool:
    """Return whether lines of a width hold all parts of a formula, its wide quotients with a slash."""
    return unbroken(text) <= room or unbroken(_with_slashes(text, room)) + _INDENT <= room


def sum_text(terms: Sequence[tuple[Fraction, str]]) -> str:
    r"""Return a sum of numbers times factors; a factor "" stands for 1.

    >>> sum_text([(Fraction(1, 2), ""), (Fraction(-1, 48), "A")])
    '\\tfrac{1}{2} - \\tfrac{1}{48} A'
    """
    text = ""
    for number, factor in terms:
        size = abs(number)
        shown = (
            f"{size.numerator}"
            if size.denominator == 1
            else rf"\tfrac{{{size.numerator}}}{{{size.denominator}}}"
        )
        term = factor if size == 1 and factor else f"{shown} {factor}".strip()
        sign = ("-" if number < 0 else "") if not text else (" - " if number < 0 else " + ")
        text += f"{sign}{term}"
    return text or "0"


def parts(text: str) -> Iterator[str]:
    """Yield the parts of a formula between which a line may end: before signs and factors outside all braces."""
    depth, start, place = 0, 0, 0
    while place < len(text):
        character = text[place]
        if character == "\\" and place + 1 < len(text) and text[place + 1] in "{}":
            place += 2
            continue
        depth += text.startswith(r"\begin{", place) - text.startswith(r"\end{", place)
        depth += (character == "{") - (character == "}")
        sign = character == " " and text[place + 1 : place + 3] in ("+ ", "- ")
        factor = character == " " and text.startswith((r" \left(", r" \cos", r" \sin", r" \quad"), place)
        if not depth and (sign or factor) and place > start and not _after_fence(text[start:place]):
            yield text[start:place]
            start = place
        place += 1
    yield text[start:]


def _with_slashes(text: str, room: float) -> str:
    r"""Return a formula with a slash in place of each \frac outside all braces that is too wide for a line."""
    out, place, depth = "", 0, 0
    while place < len(text):
        if not depth and text.startswith(r"\frac{", place):
            _, middle = _measure(text, place + 6, "}")
            size, end = _measure(text, middle + 1, "}")
            above, below = text[place + 6 : middle - 1], text[middle + 1 : end - 1]
            if max(width(above), size) > room:
                over = above if width(above) < 2 else rf"\left({above}\right)"
                out += rf"{over} / \left({below}\right)"
                place = end
                continue
        depth += (text[place] == "{") - (text[place] == "}")
        out += text[place]
        place += 1
    return out


def _after_fence(text: str) -> bool:
    r"""Return whether text ends where a line must not: after \left( or a sign."""
    return text.rstrip().endswith((r"\left(", r"\left[", "(", "-", "+"))


def _fix_fences(lines: list[str]) -> list[str]:
    r"""Return lines with fences that close on the same line stretched, and those across lines of a fixed size."""
    if len(lines) < 2:
        return lines
    return [line.replace(r"\left", r"\bigl").replace(r"\right", r"\bigr") for line in lines]


def _measure(text: str, place: int, end: str = "") -> tuple[float, int]:
    """Return the width of a formula from a place up to a closing brace, and the place after it."""
    total = 0.0
    while place < len(text):
        character = text[place]
        if character == end:
            return total, place + 1
        if character == "\\":
            match = re.match(r"[A-Za-z]+|.", text[place + 1 :], flags=re.DOTALL)
            command = match[0] if match else ""
            place += 1 + len(command)
            if command in ("frac", "tfrac"):
                above, place = _argument(text, place)
                below, place = _argument(text, place)
                total += (
                    max(above, below) * (0.7 if command == "tfrac" else 1.0)
                    + 0.3
                    - 0.3 * (command == "tfrac")
                )
            elif command in ("mathbf", "mathrm", "boldsymbol", "text", "mathit", "dot", "operatorname"):
                argument, place = _argument(text, place)
                total += argument * (1.2 if command in ("mathbf", "boldsymbol") else 1.0)
            elif command == "begin" and text.startswith("{cases}", place):
                cases, place = _cases(text, place + len("{cases}"))
                total += cases
            elif command in ("sin", "cos", "tan", "log", "exp", "det"):
                total += 3.0
            else:
                total += _WIDTHS.get(command, 1.0)
        elif character in "^_":
            argument, place = _argument(text, place + 1)
            total += 0.75 * argument
        elif character == "{":
            inner, place = _measure(text, place + 1, "}")
            total += inner
        else:
            total += {" ": 0.2, "+": 2.4, "-": 2.4, "=": 2.8, "(": 0.8, ")": 0.8, "&": 0.0}.get(
                character, 1.0
            )
            place += 1
    return total, place


def _cases(text: str, place: int) -> tuple[float, int]:
    r"""Return the width of the rows of \begin{cases} from a place on, and the place after \end{cases}."""
    depth, rows, row = 0, [0.0], place
    for match in re.compile(r"\\(begin|end)\{cases\}|\\\\").finditer(text, place):
        if match[1] != "end" or depth:
            depth += {"begin": 1, "end": -1}.get(match[1], 0)
            if match[1] is None and not depth:
                rows.append(width(text[row : match.start()]))
                row = match.end()
            continue
        rows.append(width(text[row : match.start()]))
        return max(rows) + 3.0, match.end()
    return max(rows), len(text)


def _argument(text: str, place: int) -> tuple[float, int]:
    """Return the width of the argument of a command, and the place after it."""
    while place < len(text) and text[place] == " ":
        place += 1
    if place < len(text) and text[place] == "{":
        return _measure(text, place + 1, "}")
    match = re.compile(r"\\[A-Za-z]+|.", flags=re.DOTALL).match(text, place)
    return (1.0, match.end()) if match else (0.0, place)
