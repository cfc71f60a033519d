"""Reads the schedule of the loops of an attitude and heading reference from a TOML file."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

from strapgen.catalogue import toml_files
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.navigation.loops.loop_schedule import (
    CONDITIONS,
    REFERENCES,
    LoopMode,
    LoopSchedule,
    LoopSetting,
)

#: The schedule of the source, as far as it is printed.
BUILT_IN = Path(__file__).parent / "ltr81.toml"
#: A longer file is refused.
_MOST_BYTES, _MOST_MODES = 1 << 16, 50
#: Least and largest numbers of what decides over gains.
_LIMITS = {
    "cycle_s": (Fraction(1, 100_000), Fraction(1000)),
    "gravity": (Fraction(1, 1000), Fraction(1000)),
    "radius_m": (Fraction(1000), Fraction(10**10)),
    "tau_s": (Fraction(1, 1000), Fraction(10**6)),
}
_NUMBERS = ("cycle_s", "gravity", "radius_m", "heading_cutout_deg_s", "air_data_on_m_s", "air_data_off_m_s")
_KEYS = ("title", *_NUMBERS, "mode")
_MODE_KEYS = ("name", "duration_s", "when", "after_s", "level", "erection", "heading", "vertical")
_LOOP_KEYS = ("tau_s", "order", "reference")


def read(path: str | Path = BUILT_IN) -> LoopSchedule:
    """Read a schedule.

    >>> [mode.name for mode in read().sequence]
    ['fast', 'fine', 'normal']
    """
    tables = toml_files.content(path, "a schedule", _MOST_BYTES, str)
    try:
        return _parsed(tables)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _parsed(tables: dict[str, Any]) -> LoopSchedule:
    for key in tables:
        checks.choice("key", key, _KEYS)
    numbers = {key: _number(key, tables[key]) for key in _NUMBERS if key in tables}
    for key in ("cycle_s", "gravity", "radius_m"):
        if key not in numbers:
            raise InputError(f"the schedule has no {key}")
    cycle, gravity, radius = (numbers.pop(key) for key in ("cycle_s", "gravity", "radius_m"))
    modes = tables.get("mode")
    if not isinstance(modes, list) or not all(isinstance(mode, dict) for mode in modes):
        raise InputError("the schedule has no modes; [[mode]] tables are needed")
    if len(modes) > _MOST_MODES:
        raise InputError(f"the schedule has {len(modes)} modes; at most {_MOST_MODES} are allowed")
    read_modes = tuple(_mode(mode, number) for number, mode in enumerate(modes, 1))
    return LoopSchedule(
        _text("title", tables.get("title", "")), read_modes, cycle, gravity, radius, **numbers
    )


def _mode(table: dict[str, Any], number: int) -> LoopMode:
    name = _text("name", table.get("name", f"mode {number}"))
    try:
        for key in table:
            checks.choice("key", key, _MODE_KEYS)
        when = checks.choice("when", table.get("when", "sequence"), CONDITIONS)
        if ("level" in table) == ("erection" in table):
            raise InputError("either level or erection is needed")
        first = "level" if "level" in table else "erection"
        loops = tuple(_loop(key, table.get(key)) for key in (first, "heading", "vertical"))
        duration = _number("duration_s", table["duration_s"]) if "duration_s" in table else None
        after = _number("after_s", table["after_s"]) if "after_s" in table else Fraction(0)
        return LoopMode(name, loops, duration, when, after)
    except InputError as error:
        raise InputError(f"mode {name}: {error}") from None


def _loop(name: str, table: Any) -> LoopSetting:
    if not isinstance(table, dict):
        raise InputError(f"the {name} loop is missing; a table with {', '.join(_LOOP_KEYS)} is needed")
    for key in table:
        checks.choice(f"key of the {name} loop", key, _LOOP_KEYS)
    tau = _number(f"tau_s of the {name} loop", table["tau_s"]) if "tau_s" in table else None
    order = table.get("order")
    if order is not None and (isinstance(order, bool) or order not in (2, 3)):
        raise InputError(f"order of the {name} loop is {order!r}; 2 or 3 is needed")
    return LoopSetting(name, _text("reference", table.get("reference", REFERENCES[name][0])), tau, order)


def _number(what: str, value: Any) -> Fraction:
    if isinstance(value, bool) or not isinstance(value, (int, str)):
        raise InputError(f"{what} is no number")
    exact = checks.number(what, value, positive=True)
    least, largest = _LIMITS.get(what.split()[0], (exact, exact))
    if not least <= exact <= largest:
        raise InputError(f"{what} is {value}; {float(least):g} to {float(largest):g} is possible")
    return exact


def _text(what: str, value: Any) -> str:
    if not isinstance(value, str):
        raise InputError(f"{what} is no text")
    return checks.text(what, value)
