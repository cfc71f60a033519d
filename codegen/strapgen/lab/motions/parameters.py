"""Reads the parameters of things chosen by name, with a key for each parameter and unit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError


def parameters(
    what: str,
    known: Mapping[str, Mapping[str, float]],
    settings: Mapping[str, Any],
    defaults: Mapping[str, float],
) -> dict[str, float]:
    """Return the parameters that settings state, in SI units; `known` has the factor of every key that sets one.

    >>> parameters("motion turn", {"z": {"z_deg_s": 0.5, "z_rad_s": 1.0}}, {"z_deg_s": "3"}, {})
    {'z': 1.5}
    """
    allowed = [key for choices in known.values() for key in choices]
    for key in settings:
        checks.choice(f"key of {what}:", key, allowed)
    if not settings:
        raise InputError(f"{what} needs parameters; allowed: {', '.join(allowed)}")
    values: dict[str, float] = {}
    for parameter, choices in known.items():
        used = [key for key in choices if key in settings]
        if len(used) > 1:
            raise InputError(f"{what}: {' and '.join(used)} are both given; one is needed")
        if not used and parameter not in defaults:
            raise InputError(f"{what} lacks {' or '.join(choices)}")
        values[parameter] = defaults.get(parameter, 0.0)
        for key in used:
            values[parameter] = float(checks.number(key, settings[key])) * choices[key]
    return values
