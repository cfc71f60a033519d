"""Windows, read from files, and their filters' conditions, verified exactly.

`WINDOWS` are those of the folder `window_filters`; a user's file is read by `read`. A file is a family: the filters
that commit an attitude, and one-sided filters for the same samples.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

from strapgen.catalogue import toml_files
from strapgen.catalogue.methods import coefficient_files, window_conditions
from strapgen.catalogue.methods.coefficient_files import (
    CoefficientFiles,
    band,
    entries,
    gyro,
    not_negative,
    rational,
)
from strapgen.catalogue.methods.coefficients import short_text
from strapgen.catalogue.methods.window import Taps, Window, sibling_name, sibling_title
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.suggestions import counted
from strapgen.registry import Merged, Registry, Titles

#: Keys of a file, and those of them that are optional.
KEYS = (
    *("name", "source", "previous", "ahead", "increments", "conditions", "band", "objective", "noise"),
    *("gyro", "rotation", "terms", "filters", "one_sided", "start"),
)
OPTIONAL = ("increments", "noise", "gyro", "rotation", "terms", "start")
#: Keys of one-sided filters and of those of the start, and those of them that are optional.
ONE_SIDED_KEYS = ("previous", "ahead", "objective", "noise", "band", "filters")
ONE_SIDED_OPTIONAL = ("noise", "band")

OBJECTIVES = ("minimax", "mean square")
ROTATIONS = ("fourth", "exact")

#: Most samples of a window, most conditions, the highest degree of the rate over a step, and most terms of the exact
#: rotation.
MOST_SAMPLES = 41
MOST_CONDITIONS = 12
MOST_DEGREE = 8
MOST_TERMS = 40

#: Most bytes of a file; the longest family takes less.
MOST_BYTES = 4_000_000


def one_sided_sizes(previous: int, ahead: int) -> list[tuple[int, int]]:
    """Return the samples before and ahead of the one-sided filters of a family, in the order of `Window.one_sided`.

    >>> one_sided_sizes(2, 2)
    [(3, 1), (4, 0), (0, 4), (1, 3)]
    """
    total = previous + ahead
    now = [(total - after, after) for after in range(ahead - 1, -1, -1)]
    return now + start_sizes(previous, ahead)


def start_sizes(previous: int, ahead: int) -> list[tuple[int, int]]:
    """Return the samples before and ahead of the filters of the start, in the order of `Window.start`.

    >>> start_sizes(2, 2)
    [(0, 4), (1, 3)]
    """
    return [(before, previous + ahead - before) for before in range(previous)]


def stored_sizes(previous: int, ahead: int, ideal: bool) -> list[tuple[int, int]]:
    """Return the sizes whose filters a file has to hold: with an ideal gyro and p = L the others are mirrored.

    >>> stored_sizes(2, 2, True), stored_sizes(2, 1, True)
    ([(3, 1), (4, 0)], [(3, 0), (0, 3), (1, 2)])
    """
    sizes = one_sided_sizes(previous, ahead)
    return sizes[:ahead] if ideal and previous == ahead else sizes


def _families(files: Iterable[str]) -> dict[str, str]:
    """Return the name of the family, which is that of its file, of every window; one-sided filters follow theirs."""
    sizes = [(int(p), int(a)) for p, a in (name.split("-")[1:] for name in files)]
    return {
        f"window-{before}-{after}": f"window-{previous}-{ahead}"
        for previous, ahead in sorted(sizes)
        for before, after in [(previous, ahead), *one_sided_sizes(previous, ahead)]
    }


def _title(path: Path) -> str:
    """Return the title of a family, for which no filter is read."""
    head, _, _ = path.read_text("utf-8").partition("\nfilters")
    return str(tomllib.loads(head)["name"])


@cache
def _shipped_family(path: Path) -> dict[str, Window]:
    """Return the windows of a family of strapgen, whose file the tests verify, by name."""
    window = _family(tomllib.loads(path.read_text("utf-8")), path.stem)
    return {one.name: one for one in (window, *window.one_sided)}


_FILES = Registry("windows", Path)
_FAMILIES = _families(_FILES.own)
_BUILT_IN = CoefficientFiles(
    {name: _FILES.own[family] for name, family in _FAMILIES.items()},
    lambda path, name: _shipped_family(path)[name],
)
#: The family of an installed package has the name of its file.
_INSTALLED = CoefficientFiles(_FILES, lambda path, name: _read(path, name), without=_FILES.own)

#: The windows of strapgen and of installed packages, by name.
WINDOWS: Merged[Window] = Merged(_BUILT_IN, _INSTALLED)

#: The titles of their families.
WINDOW_TITLES: Merged[str] = Merged(
    {name: _title(_FILES.own[name]) for name in dict.fromkeys(_FAMILIES.values())}, Titles(_INSTALLED)
)

#: Ending of the name of a window whose rotation is exact, and the terms of its power series.
EXACT, EXACT_TERMS = "-exact", 16


def named_window(name: str) -> Window | None:
    """Return the window of a name; None for the name of any other method.

    >>> named_window("window-7-7-exact").rotation, named_window("rk4")
    ('exact', None)
    """
    known = WINDOWS.get(name.removesuffix(EXACT))
    return known if known is None or not name.endswith(EXACT) else with_exact_rotation(known)


def with_exact_rotation(window: Window) -> Window:
    """Return a window of the catalogue with the exact rotation of its polynomial."""
    one_sided, start = (tuple(map(with_exact_rotation, some)) for some in (window.one_sided, window.start))
    name, title = f"{window.name}{EXACT}", f"{window.title}; exact rotation"
    terms = max(window.terms, EXACT_TERMS)  # a family may state more
    return replace(
        window, name=name, title=title, rotation="exact", terms=terms, one_sided=one_sided, start=start
    )


def read(path: str | Path) -> Window:
    """Read a family of filters from a file and check that every filter holds its conditions.

    Parameters
    ----------
    path : path
        A TOML file with the keys of `KEYS`; every tap is a whole number or a string, see `coefficients.number`.

    Returns
    -------
    Window
        Named after its key `name`, in lower case with hyphens.

    Raises
    ------
    InputError
        If the file cannot be read, a key or number is wrong, or a condition does not hold; the message names it.
    """
    window = _read(path)
    file = checks.text("the name of the file", str(path))
    one_sided, start = (
        tuple(replace(one, file=file) for one in some) for some in (window.one_sided, window.start)
    )
    return replace(window, file=file, one_sided=one_sided, start=start)


def _read(path: str | Path, name: str = "") -> Window:
    """Return the family of a file under its own name or another one."""
    data = toml_files.content(path, "a family of filters", MOST_BYTES)
    try:
        coefficient_files.check_keys(data, KEYS, OPTIONAL)
        name = name or coefficient_files.slug(data["name"])
        if name in _BUILT_IN:
            raise InputError(f"name {data['name']!r} is that of the method {name}; another one is needed")
        window = _family(data, name)
        verify(window)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return window


def verify(window: Window) -> None:
    """Check the conditions of every filter of a family exactly.

    Raises
    ------
    InputError
        If one does not hold; the message names the first.
    """
    for one in (window, *window.one_sided, *window.start):
        place = "" if one is window else f"{one.previous} before and {one.ahead} ahead: "
        place = f"start, {place}" if one in window.start else place
        if one.gyro is None and one.filters[0] != _sum_of_step(one):
            raise InputError(
                f"{place}filters row 1, of c_0, is the sum of the step's samples for an ideal gyro: "
                "ones there and zeros elsewhere are needed"
            )
        failure = window_conditions.first_failure(one)
        if failure:
            m, power, total, right = failure
            raise InputError(
                f"{place}the filter of c_{m} gives {short_text(total)} on the rate u^{power}, "
                f"{right} is needed (off by {short_text(total - right)})"
            )


def _sum_of_step(window: Window) -> Taps:
    """Return the filter of c_0 for an ideal gyro."""
    zero, one = (Fraction(0),), (Fraction(1),)
    return zero * window.previous + one * window.increments + zero * window.ahead


def _family(data: Mapping[str, Any], name: str) -> Window:
    """Return a family from the content of a file with all keys, after a check of its numbers and its shape."""
    previous, ahead = (_count(key, data[key], 0, MOST_SAMPLES - 1) for key in ("previous", "ahead"))
    increments = _count("increments", data.get("increments", 1), 1, MOST_SAMPLES)
    samples = previous + increments + ahead
    if samples > MOST_SAMPLES:
        raise InputError(f"the window has {samples} samples; at most {MOST_SAMPLES} are allowed")
    filters = entries("filters", data["filters"])
    if not 2 <= len(filters) <= MOST_DEGREE + 1:
        raise InputError(
            f"filters has {counted(len(filters), 'row')}; from 2 to {MOST_DEGREE + 1} are allowed, of c_0, c_1, ..."
        )
    window = Window(
        name,
        data["name"],
        data["source"],
        increments,
        previous,
        ahead,
        _count("conditions", data["conditions"], 1, min(samples, MOST_CONDITIONS)),
        band(data["band"]),
        checks.choice("objective", data["objective"], OBJECTIVES),
        _filters("filters", filters, len(filters), samples),
        gyro(data.get("gyro")),
        not_negative("noise", data.get("noise", 0)),
        checks.choice("rotation", data.get("rotation", "fourth"), ROTATIONS),
        _count("terms", data.get("terms", 16), 1, MOST_TERMS),
    )
    one_sided = _all_one_sided(window, entries("one_sided", data["one_sided"]))
    start: tuple[Window, ...] = ()
    if "start" in data:
        sizes = start_sizes(previous, ahead)
        start = _in_order("start", _stored("start", window, entries("start", data["start"]), sizes), sizes)
    return replace(window, one_sided=one_sided, start=start)


def _all_one_sided(window: Window, tables: list[Any]) -> tuple[Window, ...]:
    """Return the one-sided filters of a family, those with fewer samples before the step mirrored where possible."""
    sizes = one_sided_sizes(window.previous, window.ahead)
    stored = _stored("one_sided", window, tables, sizes)
    for previous, ahead in sizes:
        if (previous, ahead) not in stored and window.gyro is None and (ahead, previous) in stored:
            stored[previous, ahead] = stored[ahead, previous].mirrored()
    return _in_order("one_sided", stored, sizes)


def _in_order(
    key: str, stored: Mapping[tuple[int, int], Window], sizes: list[tuple[int, int]]
) -> tuple[Window, ...]:
    """Return filters in the order of their sizes, all of which are needed."""
    for previous, ahead in sizes:
        if (previous, ahead) not in stored:
            raise InputError(
                f"{key} lacks the filters with {counted(previous, 'sample')} before and {ahead} ahead"
            )
    return tuple(stored[size] for size in sizes)


def _stored(
    key: str, window: Window, tables: list[Any], sizes: list[tuple[int, int]]
) -> dict[tuple[int, int], Window]:
    """Return the filters of the tables under a key, by the samples before and ahead of their step."""
    stored: dict[tuple[int, int], Window] = {}
    for number, table in enumerate(tables, 1):
        what = f"{key}, table {number}"
        if not isinstance(table, dict):
            raise InputError(f"{what} is of type {type(table).__name__}; a table is needed")
        try:
            coefficient_files.check_keys(table, ONE_SIDED_KEYS, ONE_SIDED_OPTIONAL)
            one = _one_sided(window, table)
            size = one.previous, one.ahead
            if size not in sizes or size in stored:
                twice = "there twice" if size in stored else f"not among those for {window.samples} samples"
                raise InputError(f"{counted(size[0], 'sample')} before and {size[1]} ahead are {twice}")
        except InputError as error:
            raise InputError(f"{what}: {error}") from None
        stored[size] = one
    return stored


def _one_sided(window: Window, table: Mapping[str, Any]) -> Window:
    """Return one-sided filters, which take from their family what they do not state."""
    previous, ahead = (_count(key, table[key], 0, MOST_SAMPLES - 1) for key in ("previous", "ahead"))
    samples = previous + window.increments + ahead
    return replace(
        window,
        sibling=True,
        name=sibling_name(window.name, window.previous, window.ahead, previous, ahead),
        title=sibling_title(window.title, previous, ahead),
        previous=previous,
        ahead=ahead,
        band=band(table["band"]) if "band" in table else window.band,
        objective=checks.choice("objective", table["objective"], OBJECTIVES),
        noise=not_negative("noise", table.get("noise", 0)),
        filters=_filters("filters", entries("filters", table["filters"]), window.degree + 1, samples),
    )


def _filters(what: str, rows: list[Any], count: int, samples: int) -> tuple[Taps, ...]:
    if len(rows) != count:
        raise InputError(
            f"{what} has {counted(len(rows), 'row')}; {count} are needed, of c_0 to c_{count - 1}"
        )
    result = []
    for number, row in enumerate(rows, 1):
        taps = entries(f"{what} row {number}", row)
        if len(taps) != samples:
            raise InputError(
                f"{what} row {number} has {counted(len(taps), 'tap')}; as many as samples are needed: {samples}"
            )
        result.append(tuple(rational(f"{what} row {number}, tap {k}", tap) for k, tap in enumerate(taps, 1)))
    return tuple(result)


def _count(what: str, value: Any, smallest: int, largest: int) -> int:
    return checks.count(what, value, smallest=smallest, largest=largest)
