"""Finds the columns of a recording by the names and units in its header, or refuses an ambiguous header."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial

from strapgen.ir import checks, units
from strapgen.ir.exceptions import InputError

_TIME = re.compile(
    r"(?:.*_)?(?:t|time|times|timestamp|timestamps|stamp|seconds|elapsed)(?:_(?:elapsed|stamp|sample))?"
)
_AXIS = re.compile(r"(.*?)_?(?:axis_?)?([xyz012])(?:_?axis)?")
#: What the names of a gyro's columns are before the axis.
_GYRO = re.compile(
    r"(?:.*_)?(?:gyr\w*|angular_?(?:velocity|rate|vel|speed)|ang_?vel|omega|rotation_?rate|w_rs_s)(?:_.*)?|g|w|rate"
)
#: Those of an accelerometer, a magnetometer and an attitude, beside which a bare axis is open.
_OTHER = re.compile(
    r"(?:.*_)?(?:acc\w*|linear_?acc\w*|specific_?force|mag\w*|quat\w*|euler\w*)(?:_.*)?|a|m|b|e|q"
)
_SUFFIXES = ("ns", "us", "ms", "s", "sec", "rad_s", "rads", "deg_s", "dps", "mdps", "m_s2", "mss")


@dataclass(frozen=True)
class ColumnLayout:
    """The positions of the columns, and their units."""

    #: Of the time and of the values; without a time, of the values alone
    places: tuple[int, ...]
    #: Cells of a row
    width: int
    has_time: bool = True
    #: Units that header or user state, in the spelling of `units`; None where none does
    time_unit: str | None = None
    unit: str | None = None


@dataclass(frozen=True)
class _HeaderCell:
    """A cell of a header: its name in lower case with underscores, and its unit."""

    name: str
    unit: str | None
    text: str


def rates_layout(
    header: Sequence[str] | None,
    width: int,
    *,
    unit: str | None = None,
    columns: str | None = None,
    time_unit: str | None = None,
    has_time: bool = True,
) -> ColumnLayout:
    """Return the positions of time and rates in a file of rates.

    `unit, columns, time_unit`: what the user states in place of the header: units of rates and time in the spelling of
    `units`; names or numbers of the columns with commas between, the time and three rates, or the rates alone.
    """
    cells = None if header is None else [_cell(text) for text in header]
    find = partial(_stated_places, columns) if columns else _found_places
    places = find(cells, width, has_time)
    if cells is not None:
        of_rates = {*units.RATES}.intersection(cells[place].unit for place in places[has_time:])
        if len(of_rates) > 1:
            raise InputError(f"the rates are in {' and '.join(sorted(of_rates))}; one unit is needed")
        for place in places[has_time:]:
            unit = _agree("--rate-unit", unit, cells[place], units.RATES, "rates")
        if has_time:
            time_unit = _agree("--time-unit", time_unit, cells[places[0]], units.TIMES, "times")
    return ColumnLayout(places, width, has_time, time_unit, unit)


def named_layout(
    header: Sequence[str] | None, width: int, names: Sequence[str], wanted: Sequence[str]
) -> ColumnLayout:
    """Return the positions of columns with fixed names; without a header they are in order."""
    if header is None:
        if width != len(names):
            raise InputError(
                f"{width} columns without a header; a header with the names {', '.join(names)} is needed, or these "
                f"{len(names)} columns alone"
            )
        return ColumnLayout(tuple(range(width)), width)
    cells = [_cell(text) for text in header]
    plain = [cell.name for cell in cells]
    for name in names:
        if name not in plain:
            raise InputError(f"no column {name!r}; the columns {', '.join(names)} are needed")
    places = tuple(plain.index(name) for name in names)
    for place, unit in zip(places[1:], wanted[1:], strict=True):
        if cells[place].unit not in (None, unit):
            raise InputError(f"column {cells[place].text!r} is in {cells[place].unit}; {unit} is needed")
    return ColumnLayout(places, width, True, _agree("", None, cells[places[0]], units.TIMES, "times"))


def _cell(text: str) -> _HeaderCell:
    text = text.strip().lstrip("#%/ ").strip()
    match = re.fullmatch(r"(.*?)[\s_]*[\[(]([^\])]*)[\])]\s*", text)
    unit = None
    name = text
    if match is not None and not match[2].strip().isdigit():
        name, unit = match[1], units.spelled(match[2])
    elif match is not None:  # an index, as in gyro[0]
        name = f"{match[1]}_{match[2].strip()}"
    name = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    if unit is None:
        for suffix in _SUFFIXES:
            stem = name.removesuffix(f"_{suffix}")
            if stem != name and stem and not re.fullmatch(r"w_r", stem):
                if not (_TIME.fullmatch(stem) or _AXIS.fullmatch(stem)):
                    continue
                name, unit = stem, units.spelled(suffix.replace("_s", "/s"))
                break
    return _HeaderCell(name, unit, text)


def _found_places(cells: Sequence[_HeaderCell] | None, width: int, has_time: bool) -> tuple[int, ...]:
    """Return the places of time and rates by their names."""
    if cells is None:
        if width == (4 if has_time else 3):
            return tuple(range(width))
        raise InputError(
            f"{width} columns without a header; --columns says by their numbers which are the time and the rates, as "
            "1,2,3,4"
        )
    named = {k: cell.name for k, cell in enumerate(cells)}
    times = [k for k, name in named.items() if _TIME.fullmatch(name)]
    axes: dict[str, list[int | None]] = {}
    for k, name in named.items():
        match = _AXIS.fullmatch(name)
        if match is None or (has_time and k in times) or cells[k].unit in units.FORCES:
            continue
        stem = match[1].strip("_")
        if _GYRO.fullmatch(stem) or (not stem and cells[k].unit in (None, *units.RATES)):
            axes.setdefault(stem, [None] * 3)[
                "xyz".find(match[2]) if match[2] in "xyz" else int(match[2])
            ] = k
    groups = [tuple(group) for group in axes.values() if None not in group]
    seen = ", ".join(repr(cell.text) for cell in cells)
    if len(groups) != 1 or ("" in axes and any(map(_is_other, cells))):
        what = f"{len(groups)} sets of rates" if len(groups) > 1 else "no rates about three axes"
        raise InputError(f"{what} are named among the columns {seen}; --columns NAME,... says which they are")
    if has_time and len(times) != 1:
        what = "several columns of time" if times else "no column of time"
        raise InputError(
            f"{what} among {seen}; --columns NAME,... says which it is, or --sample-hz the sampling rate"
        )
    return (*(times if has_time else ()), *groups[0])


def _is_other(cell: _HeaderCell) -> bool:
    """Return whether a column is one of another sensor, or of an attitude."""
    match = _AXIS.fullmatch(cell.name)
    return match is not None and _OTHER.fullmatch(match[1].strip("_")) is not None


def _stated_places(
    columns: str, cells: Sequence[_HeaderCell] | None, width: int, has_time: bool
) -> tuple[int, ...]:
    """Return the places of the columns that a user names."""
    names = [name.strip() for name in columns.split(",")]
    count = 4 if has_time else 3
    if len(names) != count or len({*names}) != count:
        what = "the time and three rates" if count == 4 else "three rates, since --sample-hz states the time"
        raise InputError(f"--columns {columns} names {len(names)} columns; {count} are needed: {what}")
    places = []
    for name in names:
        exact = [k for k, cell in enumerate(cells or ()) if name.lower() in (cell.text.lower(), cell.name)]
        if len(exact) == 1:
            places.append(exact[0])
        elif name.isdigit() and 1 <= int(name) <= width:
            places.append(int(name) - 1)
        else:
            seen = ", ".join(repr(cell.text) for cell in cells or ()) or f"{width} without names"
            raise InputError(
                f"--columns: {name!r} is {'no' if not exact else 'more than one'} column of {seen}"
            )
    return tuple(places)


def known_unit(what: str, text: str, table: Mapping[str, Fraction]) -> str:
    """Return a unit of a table in its usual spelling."""
    name = units.spelled(checks.text(what, text))
    return name if name in table else checks.choice(what, text, [*table])


def _agree(
    option: str, stated: str | None, cell: _HeaderCell, table: Mapping[str, Fraction], what: str
) -> str | None:
    """Return the unit that a user or a column states."""
    if cell.unit is None:
        return stated
    if cell.unit not in table:
        raise InputError(
            f"column {cell.text!r} is in {cell.unit} where {what} are expected, in {', '.join(table)}"
        )
    if stated not in (None, cell.unit):
        raise InputError(f"{option} {stated} contradicts the header: column {cell.text!r} is in {cell.unit}")
    return cell.unit
