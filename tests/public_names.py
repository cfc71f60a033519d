"""The public names: those of the package, and those of its public modules."""

from __future__ import annotations

import inspect
from typing import Any

import strapgen


def public() -> dict[str, Any]:
    """Return what a user may name after ``strapgen.``, by its full name, without the modules themselves."""
    found = {}
    for name in strapgen.__all__:
        value = getattr(strapgen, name)
        if not inspect.ismodule(value):
            found[name] = value
            continue
        own = [key for key, part in vars(value).items() if getattr(part, "__module__", "") == value.__name__]
        for key in getattr(value, "__all__", [key for key in own if not key.startswith("_")]):
            found[f"{name}.{key}"] = getattr(value, key)
    return found
