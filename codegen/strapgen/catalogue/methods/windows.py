"""Windows, read from files, and their filters' conditions, verified exactly.

`WINDOWS` are those of the folder `window_filters`; a user's file is read by `read`. A file is a family: the filters
that commit an attitude, and one-sided filters for the same samples.

>>> from strapgen import windows
>>> windows.named_window("window-3-3").total_increments
7
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from strapgen.catalogue.coefficients import short_text
from strapgen.catalogue.methods import coefficient_files, window_conditions
from strapgen.catalogue.methods.coefficient_files import Band, CoefficientFiles, Gyro, Source, Title
from strapgen.catalogue.methods.window import Taps, Window, sibling_name, sibling_title
from strapgen.catalogue.toml_models import Key, UserFile
from strapgen.ir import checks
from strapgen.ir.checks import counted
from strapgen.ir.exceptions import InputError
from strapgen.registry import Merged, Registry, Titles
from strapgen.storage import streams

OBJECTIVES = ("minimax", "mean square")
ROTATIONS = ("fourth", "exact")
FORMS = ("legendre", "pair")

#: Most samples of a window, most conditions, the highest degree of the rate over a step, and most terms of the exact
#: rotation.
MOST_SAMPLES = 41
MOST_CONDITIONS = 12
MOST_DEGREE = 8
MOST_TERMS = 40

Filters = Annotated[
    tuple[tuple[Fraction, ...], ...],
    Key("Rows of c_0, c_1, ...: a tap for each sample, the oldest first", least=2, most=MOST_DEGREE + 1),
]
Previous = Annotated[int, Key("Samples before the step", "1", least=0, most=MOST_SAMPLES - 1)]
Ahead = Annotated[int, Key("Samples ahead of the step", "1", least=0, most=MOST_SAMPLES - 1)]
Objective = Annotated[str, Key("What the filters minimize over the band", choices=OBJECTIVES)]
Noise = Annotated[
    Fraction,
    Key(
        "Standard deviation of the noise of an increment, by that of the rate times the sampling interval",
        "1",
        least=0,
    ),
]


@dataclass(frozen=True)
class SideFile:
    """Filters of a family for other samples before and ahead of the step.

    Examples
    --------
    >>> row = (Fraction(0), Fraction(1))
    >>> SideFile(1, 0, "minimax", (row,)).noise
    Fraction(0, 1)
    """

    previous: Previous
    ahead: Ahead
    objective: Objective
    filters: Filters
    noise: Noise = Fraction(0)
    #: By default that of the family
    band: Band | None = None


@dataclass(frozen=True)
class WindowFile:
    """A family of filters that estimate the rate over a step; strapgen verifies their conditions.

    Examples
    --------
    >>> [*WindowFile.__annotations__][:4]
    ['name', 'source', 'previous', 'ahead']
    """

    name: Title
    source: Source
    previous: Previous
    ahead: Ahead
    conditions: Annotated[
        int,
        Key(
            "The filters are exact for polynomials in time of a lower degree",
            "1",
            least=1,
            most=MOST_CONDITIONS,
        ),
    ]
    band: Band
    objective: Objective
    filters: Filters
    one_sided: Annotated[
        tuple[SideFile, ...], Key("Filters for the same samples with fewer ahead, or fewer before")
    ]
    increments: Annotated[int, Key("Samples of the step", "1", least=1, most=MOST_SAMPLES)] = 1
    noise: Noise = Fraction(0)
    gyro: Gyro | None = None
    rotation: Annotated[
        str, Key("Rotation of a step: to fourth order, or by a power series", choices=ROTATIONS)
    ] = "fourth"
    terms: Annotated[int, Key("Terms of that power series", "1", least=1, most=MOST_TERMS)] = 16
    start: Annotated[
        tuple[SideFile, ...] | None,
        Key("Filters of the first intervals of a recording, designed for less noise"),
    ] = None
    form: Annotated[
        str,
        Key(
            "Legendre coefficients each, or a pair whose product is that of coning; one-sided ones are legendre",
            choices=FORMS,
        ),
    ] = "legendre"

    def __post_init__(self) -> None:
        coefficient_files.check_gyro(self.gyro)
        if self.form == "pair" and len(self.filters) != 3:
            raise InputError(f"filters has {counted(len(self.filters), 'row')}; a pair has 3, of c_0 to c_2")
        samples = self.previous + self.increments + self.ahead
        if samples > MOST_SAMPLES:
            raise InputError(f"the window has {samples} samples; at most {MOST_SAMPLES} are allowed")
        checks.count("conditions", self.conditions, largest=min(samples, MOST_CONDITIONS))
        _check_taps("filters", self.filters, len(self.filters), samples)

    def family(self, name: str) -> Window:
        """Return the family under a name, not verified."""
        window = Window(
            *(
                name,
                self.name,
                self.source,
                self.increments,
                self.previous,
                self.ahead,
                self.conditions,
                self.band,
            ),
            *(self.objective, self.filters, self.gyro, self.noise, self.rotation, self.terms),
            form=self.form,
        )
        one_sided = _all_one_sided(window, self.one_sided)
        start: tuple[Window, ...] = ()
        if self.start is not None:
            sizes = start_sizes(self.previous, self.ahead)
            start = _in_order("start", _stored_filters("start", window, self.start, sizes), sizes)
        return replace(window, one_sided=one_sided, start=start)


#: The longest family takes less.
WINDOW = UserFile("a family of filters", WindowFile, 4_000_000)


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
    """Return the name of the family, which is that of its file, of every window; one-sided filters follow theirs.

    The last number of a name is that of the samples on each side of the step.
    """
    sides = {name: int(name.rpartition("-")[2]) for name in files}
    return {
        sibling_name(name, side, side, *size): name
        for name, side in sorted(sides.items(), key=lambda pair: (pair[0].startswith("pair"), pair[0]))
        for size in [(side, side), *one_sided_sizes(side, side)]
    }


def _title(path: Path) -> str:
    """Return the title of a family, for which no filter is read."""
    head, _, _ = path.read_text("utf-8").partition("\nfilters")
    return str(tomllib.loads(head)["name"])


@cache
def _shipped_family(path: Path) -> dict[str, Window]:
    """Return the windows of a family of strapgen, whose file the tests verify, by name."""
    window = WINDOW.read(path).family(path.stem)
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
    """Return a window of the catalogue with the exact rotation of its polynomial.

    Examples
    --------
    >>> with_exact_rotation(WINDOWS["window-3-3"]).name
    'window-3-3-exact'
    """
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
        A TOML file with the keys of `WindowFile`.

    Returns
    -------
    Window
        Named after its key `name`, in lower case with hyphens.

    Raises
    ------
    InputError
        If the file cannot be read, a key or number is wrong, or a condition does not hold; the message names it.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> from strapgen import window_design
    >>> file = Path(mkdtemp()) / "mine.toml"
    >>> _ = file.write_text(window_design.written(WINDOWS["window-3-3"], "strapgen window"))
    >>> read(file).total_increments
    7
    """
    window = _read(path)
    file = checks.text("the name of the file", str(path))
    one_sided, start = (
        tuple(replace(one, file=file) for one in some) for some in (window.one_sided, window.start)
    )
    return replace(window, file=file, one_sided=one_sided, start=start)


def named_or_read(argument: str | Path) -> Window:
    """Return the window of a name, or of a file, its conditions verified.

    >>> named_or_read("window-3-3").name
    'window-3-3'
    """
    name = str(argument)
    window = None if streams.names_file(name) else named_window(name)
    if window is None and (streams.names_file(name) or Path(name).is_file()):
        return read(argument)
    if window is None:
        checks.choice("window", name, WINDOW_TITLES, "their one-sided filters, as window-14-0, or a file")
    assert window is not None
    verify(window)
    return window


def _read(path: str | Path, name: str = "") -> Window:
    """Return the family of a file under its own name or another one."""

    def family(file: WindowFile) -> Window:
        window = file.family(name or coefficient_files.slug(file.name))
        if window.name in _BUILT_IN:
            raise InputError(f"name {file.name!r} is that of the method {window.name}; another one is needed")
        verify(window)
        return window

    return WINDOW.convert(path, family)


def verify(window: Window) -> None:
    """Check the conditions of every filter of a family exactly.

    Raises
    ------
    InputError
        If one does not hold; the message names the first.

    Examples
    --------
    >>> verify(WINDOWS["window-3-3"])
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


def _all_one_sided(window: Window, tables: Sequence[SideFile]) -> tuple[Window, ...]:
    """Return the one-sided filters of a family, those with fewer samples before the step mirrored where possible."""
    sizes = one_sided_sizes(window.previous, window.ahead)
    stored = _stored_filters("one_sided", window, tables, sizes)
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


def _stored_filters(
    key: str, window: Window, tables: Sequence[SideFile], sizes: list[tuple[int, int]]
) -> dict[tuple[int, int], Window]:
    """Return the filters of the tables under a key, by the samples before and ahead of their step."""
    stored: dict[tuple[int, int], Window] = {}
    for number, table in enumerate(tables, 1):
        size = table.previous, table.ahead
        if size not in sizes or size in stored:
            twice = (
                "there twice" if size in stored else f"not among those for {window.total_increments} samples"
            )
            raise InputError(
                f"{key}[{number}]: {counted(size[0], 'sample')} before and {size[1]} ahead are {twice}"
            )
        rows = len(tables[0].filters) if window.form == "pair" else window.degree + 1
        _check_taps(f"{key}[{number}].filters", table.filters, rows, window.increments + sum(size))
        stored[size] = replace(
            window,
            **of_sibling(window),
            name=sibling_name(window.name, window.previous, window.ahead, *size),
            title=sibling_title(window.title, *size),
            previous=table.previous,
            ahead=table.ahead,
            band=table.band or window.band,
            objective=table.objective,
            noise=table.noise,
            filters=table.filters,
        )
    return stored


def of_sibling(window: Window) -> dict[str, Any]:
    """Return what one-sided filters have unlike their window; steps of several samples take the exact rotation.

    >>> of_sibling(WINDOWS["window-3-3"])
    {'sibling': True, 'form': 'legendre', 'rotation': 'fourth'}
    """
    rotation = "exact" if window.increments > 1 else window.rotation
    return {"sibling": True, "form": "legendre", "rotation": rotation}


def _check_taps(what: str, rows: Sequence[Taps], count: int, samples: int) -> None:
    if len(rows) != count:
        raise InputError(
            f"{what} has {counted(len(rows), 'row')}; {count} are needed, of c_0 to c_{count - 1}"
        )
    for number, row in enumerate(rows, 1):
        if len(row) != samples:
            raise InputError(
                f"{what}[{number}] has {counted(len(row), 'tap')}; as many as samples are needed: {samples}"
            )
