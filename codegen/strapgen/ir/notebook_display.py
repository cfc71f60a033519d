"""Objects in a notebook: a `repr` of a few lines, formulas and tables, data frames.

`strapgen.results.display` writes formulas, tables and plots, and the module ``display`` of an application does for its
objects. They stand above the objects that they show, and are loaded when a notebook or a user first asks.
"""

from __future__ import annotations

import importlib
import importlib.util
import textwrap
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from fractions import Fraction
from typing import Any

from strapgen.ir.read_only import ReadOnly, read_only

#: Most lines of a `repr`, and most characters of a line.
LINES, WIDTH = 5, 100
#: Most lines of a table of names.
NAMES = 24
#: Most characters of one field.
_FIELD = 60
#: Most characters of a number that is written exactly.
_NUMBER = 16
#: The package that shows objects.
_DISPLAY = "strapgen.results.display"


def short_repr(value: Any) -> str:
    """Return a value in at most five lines; a class takes this function as its ``__repr__``.

    A class that has a method ``_in_words`` says with it what stands after the name of the class, a line or several. Any
    other is a dataclass, and shows its fields that differ from their defaults.
    """
    name = type(value).__name__.lstrip("_")
    if hasattr(value, "_in_words"):
        words = str(value._in_words()).split("\n")
        return _in_lines(f"<{name} {words[0]}", *words[1:], end=">")
    shown = [f"{field}={_short(content)}" for field, content in _stated(value)]
    return _in_lines(f"{name}({', '.join(shown)}", end=")")


def full_text(value: Any) -> str:
    """Return the text of a value with all fields in full, whatever its ``__repr__`` leaves out."""
    if is_dataclass(value) and not isinstance(value, type):
        parts = (f"{f.name}={full_text(getattr(value, f.name))}" for f in fields(value) if f.repr)
        return f"{type(value).__name__}({', '.join(parts)})"
    if type(value) is tuple:
        return f"({', '.join(map(full_text, value))}{',' if len(value) == 1 else ''})"
    if type(value) is list:
        return f"[{', '.join(map(full_text, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{full_text(k)}: {full_text(v)}' for k, v in value.items())}}}"
    return repr(value)


def notebook_latex(value: Any) -> str | None:
    """Return an object as LaTeX for a notebook; a class takes this function as its ``_repr_latex_``."""
    text: str | None = _display(value, "objects").latex(value)
    return text


def notebook_html(value: Any) -> str | None:
    """Return an object as HTML for a notebook; a class takes this function as its ``_repr_html_``."""
    text: str | None = _display(value, "objects").html(value)
    return text


def names_table(titles: Mapping[str, str]) -> Any:
    """Return names with their titles as a table; of many the first ones, and how to see all."""
    table = importlib.import_module("strapgen.results.table")
    names = list(titles)
    shown = names if len(names) <= NAMES else names[: NAMES - 1]
    rows = [(name, textwrap.shorten(titles[name], WIDTH - 20, placeholder="...")) for name in shown]
    if len(names) > len(shown):
        rows.append(("...", f"{len(names) - len(shown)} more; list() of this mapping gives all names"))
    return table.TextTable((table.Column(align="<"), table.Column(align="<")), rows)


def to_pandas(value: Any) -> Any:
    """Return an object as a data frame of pandas, the units in the names of its columns."""
    return _display(value, "frames").pandas_frame(value)


class Records(ReadOnly):
    """Records along a time, which cannot be written: a plot, and the forms of other libraries."""

    __slots__ = ()

    def plot(self, path: Any = None, title: str = "") -> Any:
        """Return a plot of the records against time as a figure of matplotlib, or write it to a file."""
        return _display(self, "objects").plot(self, path, title)

    def to_pandas(self) -> Any:
        """Return the records as a data frame of pandas, one row each, the units in the names of the columns."""
        return to_pandas(self)

    def to_xarray(self) -> Any:
        """Return the records as a dataset of xarray along the time in s, the units in names and attributes."""
        return _display(self, "frames").xarray_dataset(self)


def _display(value: Any, module: str) -> Any:
    """Return a module that shows objects, after the application that defines a value has registered its forms."""
    loaded = importlib.import_module(f"{_DISPLAY}.{module}")
    for cls in type(value).__mro__:
        package, _, rest = cls.__module__.partition(".")
        place = (
            f"{package}.{rest.partition('.')[0]}.display" if package == "strapgen" else f"{package}.display"
        )
        if package not in ("builtins", "typing", "abc") and importlib.util.find_spec(place) is not None:
            importlib.import_module(place)
    return loaded


def counted_shape(shape: tuple[int, ...]) -> str:
    """Return a shape in words: "scalar", "3", "2 x 3"."""
    return " x ".join(map(str, shape)) or "scalar"


def _stated(value: Any) -> list[tuple[str, Any]]:
    """Return the fields of a dataclass that differ from their defaults."""
    stated = []
    for field in fields(value):
        content = getattr(value, field.name)
        default = field.default_factory() if field.default_factory is not MISSING else field.default
        default = read_only(default) if isinstance(value, ReadOnly) else default
        if field.repr and (
            default is MISSING or type(content) is not type(default) or _differs(content, default)
        ):
            stated.append((field.name, content))
    return stated


def _differs(content: Any, default: Any) -> bool:
    """Return whether a value is another than a default of its type; both may be arrays of numpy."""
    if hasattr(content, "tolist"):
        return bool(content.tolist() != default.tolist())
    return bool(content != default)


def _short(value: Any) -> str:
    """Return the value of a field in a few words."""
    if hasattr(value, "shape") and hasattr(value, "dtype"):
        return f"<{counted_shape(value.shape)} {value.dtype}>"
    if isinstance(value, Fraction | float):
        text = str(value)
        return f"{float(value):.6g}" if len(text) > _NUMBER else text
    if isinstance(value, Mapping):
        text = f"{{{', '.join(f'{key!r}: {_short(part)}' for key, part in value.items())}}}"
        return text if len(text) <= WIDTH else f"<{len(value)} entries>"
    if isinstance(value, tuple | list):
        text = ", ".join(map(_short, value)) if len(value) < _FIELD else ""
        comma = "," if len(value) == 1 else ""
        return f"({text}{comma})" if 0 < len(text) <= _FIELD else f"<{len(value)} entries>"
    text = repr(value)
    if isinstance(value, str):
        return text if len(text) <= WIDTH else f"{text[: WIDTH - 4]}...{text[-1]}"
    if len(text) <= _FIELD and "\n" not in text:
        return text
    return f"<{' '.join([type(value).__name__, str(getattr(value, 'name', ''))]).strip()}>"


def _in_lines(*paragraphs: str, end: str) -> str:
    """Return paragraphs wrapped to the width, each but the first after two spaces, with an end."""
    lines: list[str] = []
    for paragraph in paragraphs:
        first = "  " if lines else ""
        lines += textwrap.wrap(
            paragraph, WIDTH - 4, initial_indent=first, subsequent_indent="  ", break_long_words=True
        )
    if len(lines) > LINES:
        lines = [*lines[: LINES - 1], f"{lines[LINES - 1][: WIDTH - 4]} ..."]
    return "\n".join(lines) + end
