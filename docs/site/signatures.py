"""Signatures of the reference, with defaults as a user would write them."""

from __future__ import annotations

import dataclasses
import inspect
import sys
from fractions import Fraction
from typing import Any

import numpy as np
from sphinx.util.inspect import object_description


def with_plain_defaults(signature: str, obj: Any) -> str:
    """Return the signature of a function or a class as Sphinx writes it, with plain defaults.

    Parameters
    ----------
    signature : str
        As ``(lag=Fraction(1, 8), *, errors=<factory>)``.
    obj : callable
        What it belongs to.
    """
    try:
        parameters = inspect.signature(obj).parameters.values()
    except (TypeError, ValueError):
        return signature
    fields = {one.name: one for one in dataclasses.fields(obj)} if dataclasses.is_dataclass(obj) else {}
    for parameter in parameters:
        default, field = parameter.default, fields.get(parameter.name)
        if default is inspect.Parameter.empty:
            continue
        if field is not None and field.default_factory is not dataclasses.MISSING:
            plain = written(field.default_factory())
        else:
            plain = _constant(default, obj) or written(default)
        signature = signature.replace(
            f"{parameter.name}={object_description(default)}", f"{parameter.name}={plain}"
        )
    return signature


def written(value: Any) -> str:
    """Return a value as a call would state it: plain numbers, tuples for arrays, functions by their names."""
    if isinstance(value, Fraction):
        return str(value)
    if isinstance(value, np.ndarray):
        return written(_tuples(value.tolist()))
    if isinstance(value, float):
        return f"{value:g}" if float(f"{value:g}") == value else repr(value)
    if type(value) in (tuple, list):  # not a named tuple
        inside = ", ".join(map(written, value))
        return f"[{inside}]" if isinstance(value, list) else f"({inside}{',' * (len(value) == 1)})"
    if callable(value) and hasattr(value, "__name__"):
        return str(value.__name__)
    if dataclasses.is_dataclass(value):  # as it shows itself, not all fields
        return repr(value)
    return object_description(value)


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def _constant(value: Any, obj: Any) -> str:
    """Return the name of the table that is a default, in the module of the function; "" for other values."""
    module = vars(sys.modules.get(getattr(obj, "__module__", ""), sys))
    return next((name for name, one in module.items() if isinstance(value, dict) and one is value), "")
