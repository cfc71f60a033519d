"""Pages of the reference for Python: every public name, described by its docstring."""

from __future__ import annotations

import importlib
import inspect
import re
import types
from typing import Any

#: Titles of the pages by the folder of the package that defines the names, in the order of a reader's first day.
GROUPS = {
    "pipeline": "The stages: derive, lower, quantize, generate",
    "run": "Back ends, which run generated code",
    "catalogue": "Algorithms, methods and windows",
    "lab": "Motions, runs, recordings and comparisons",
    "stamped": "Samples with instants of their own",
    "attitude_algorithm": "Algorithms as objects",
    "design": "Windows that answer late and now",
    "navigation": "Two speeds, described systems and courses",
    "firmware": "Checks of code",
    "kernel": "Kernels of your own",
    "ir": "Programs, formats, sources and errors",
    "fixedpoint": "Bounds of rounding in floating point",
    "targets": "Targets, which print code",
}


def pages() -> dict[str, str]:
    """Return the pages of the reference for Python in reStructuredText, by their names."""
    import strapgen

    groups: dict[str, list[str]] = {group: [] for group in GROUPS}
    for name, module in strapgen._EXPORTS.items():
        groups[module.split(".")[0]].append(name)
    texts = {group: _group(GROUPS[group], names) for group, names in groups.items() if names}
    texts |= {name: _namespace(name) for name in strapgen._NAMESPACES}
    return {"index": _index(groups), **texts}


def summary(value: Any) -> str:
    """Return the first sentence of an object's docstring, as reStructuredText.

    Parameters
    ----------
    value : object
        A function, a class or a module.
    """
    return _first_sentence((inspect.getdoc(value) or "").split("\n\n")[0])


def _first_sentence(text: str) -> str:
    first = re.split(r"(?<=[.:;])\s", " ".join(text.split()))[0]
    return f"{first.rstrip('.:;')}."


def comment(module: str, name: str) -> str:
    """Return the comment that stands above a public value where it is defined.

    Parameters
    ----------
    module : str
        Full name of the module that offers the value.
    name : str
        Name of the value.
    """
    source = inspect.getsource(importlib.import_module(module))
    above = re.search(rf"((?:^#.*\n)+){name}\b", source, re.MULTILINE)
    return " ".join(line.lstrip("#: ") for line in above[1].splitlines()) if above else ""


def members(namespace: Any) -> list[str]:
    """Return the public functions and classes of a module that is a namespace of the package.

    Parameters
    ----------
    namespace : module
        One of the modules that the package offers under a name.
    """
    names = getattr(namespace, "__all__", None) or [
        name
        for name, value in vars(namespace).items()
        if (getattr(value, "__module__", "") or "").startswith(namespace.__name__)
        and not name.startswith("_")
    ]
    return [n for n in names if isinstance(getattr(namespace, n), type | types.FunctionType)]


def _heading(title: str, mark: str = "=") -> list[str]:
    return [title, mark * len(title), ""]


def _index(groups: dict[str, list[str]]) -> str:
    import strapgen

    lines = _heading("Python")
    lines += [
        "Every public name of the package, with what it is for. :doc:`/python-api` shows them at work.",
        "",
    ]
    for group, names in groups.items():
        lines += [*_heading(GROUPS[group], "-"), *_rows({n: _about(n) for n in names})]
    lines += _heading("Namespaces", "-")
    lines += _rows({f"{n}": summary(getattr(strapgen, n)) for n in strapgen._NAMESPACES}, role="py:mod")
    entries = [*(group for group, names in groups.items() if names), *strapgen._NAMESPACES]
    return "\n".join([*lines, ".. toctree::", "   :hidden:", "", *(f"   {entry}" for entry in entries), ""])


def _about(name: str) -> str:
    import strapgen

    value = getattr(strapgen, name)
    if isinstance(value, type | types.FunctionType):
        return summary(value)
    return _first_sentence(comment(f"strapgen.{strapgen._EXPORTS[name]}", name))


def _rows(rows: dict[str, str], role: str = "py:obj") -> list[str]:
    lines = [".. list-table::", "   :widths: 30 70", ""]
    for name, text in rows.items():
        lines += [f"   * - :{role}:`{name} <strapgen.{name}>`", f"     - {text}"]
    return [*lines, ""]


def _group(title: str, names: list[str]) -> str:
    lines = _heading(title)
    for name in names:
        lines += _entry(f"strapgen.{name}")
    return "\n".join(lines)


def _namespace(name: str) -> str:
    import strapgen

    module = getattr(strapgen, name)
    text = inspect.getdoc(module) or ""
    lines = [*_heading(f"strapgen.{name}"), f".. py:module:: strapgen.{name}", "", text, ""]
    for member in members(module):
        lines += _entry(f"strapgen.{name}.{member}", getattr(module, member))
    return "\n".join(lines)


def _entry(full: str, value: Any = None) -> list[str]:
    import strapgen

    name = full.removeprefix("strapgen.")
    value = getattr(strapgen, name) if value is None else value
    if isinstance(value, types.FunctionType):
        return [f".. autofunction:: {full}", ""]
    if isinstance(value, type):
        short = value.__name__
        if name != short and getattr(strapgen, short, None) is value:  # a name has one description
            outside = [".. py:currentmodule:: None", ""]  # which would stand before the name once more
            return [
                *outside,
                f".. py:class:: {full}",
                "",
                f"   The same as :py:class:`strapgen.{short}`.",
                "",
            ]
        kind = "autoexception" if issubclass(value, BaseException) else "autoclass"
        return [f".. {kind}:: {full}", "   :members:", ""]
    text = comment(f"strapgen.{strapgen._EXPORTS[name]}", name)
    return [f".. py:data:: {full}", "", f"   {text}", ""]
