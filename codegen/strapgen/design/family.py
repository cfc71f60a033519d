"""Designs a family of filters, those that commit an attitude and one-sided ones for the same samples, and writes it.

>>> from strapgen import window_design
>>> window_design.FamilyBrief(previous=7, ahead=7, band=Fraction(13, 10)).full_title
'Window 1+7+7 to 1.3 rad'
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from fractions import Fraction
from typing import Any

from strapgen.catalogue.methods.coefficient_files import slug
from strapgen.catalogue.methods.sensor_response import Response
from strapgen.catalogue.methods.window import Taps, Window, sibling_name, sibling_title
from strapgen.catalogue.methods.windows import of_sibling, one_sided_sizes, start_sizes, stored_sizes
from strapgen.design.filters import exchange, mean_square, responses
from strapgen.design.filters.filter_taps import Shape, Unknowns, rounded
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import full_text, short_repr
from strapgen.storage import cache

#: Default of the noise for which one-sided filters are designed.
ONE_SIDED_NOISE = Fraction(3, 10000)
#: Most samples of a step of a pair.
MOST_PAIR_INCREMENTS = 3


@dataclass(frozen=True)
class FamilyBrief:
    """The requirements on a family of filters.

    Parameters
    ----------
    previous, ahead : int
        Samples before the step, and ahead of it for the attitude that is committed.
    band : Fraction
        Highest angular frequency of the rate in rad a sample.
    conditions : int
        The filters are exact for polynomial rates of a degree below this.
    degree : int
        Highest Legendre coefficient of the rate that is estimated.
    gyro : Response, optional
        By default the increments are integrals of the rate.
    noise, one_sided_noise, start_noise : Fraction, optional
        Standard deviation of the noise of an increment, by that of the rate times the sampling interval, for the
        committed filters, for the one-sided ones and for those of the first intervals of a recording.
    spectrum : tuple of int, optional
        Density of the rate, see `responses.weights`; by default it is flat over the band.
    rotation : str, optional
    terms : int, optional
        As in `Window`.
    title : str, optional
        By default it says the samples and the band.
    increments : int, optional
        Samples of a step (N); several take the exact rotation.
    taps : (int, int), optional
        Of a pair, the numbers of free taps on each side of the middle of the step, of u and of v; `pair_side` has the
        samples that go with them. One-sided filters, up to `degree`, are those of a window.

    Raises
    ------
    InputError
        If the rotation of a step of several samples is not exact, or the numbers do not go with a pair.

    Examples
    --------
    >>> brief = FamilyBrief(previous=2, ahead=2, band=Fraction(1))
    >>> brief.objective, brief.full_title
    ('minimax', 'Window 1+2+2 to 1 rad')
    >>> FamilyBrief(8, 8, Fraction(13, 10), taps=(8, 6)).full_title
    'Pair 1+8+8 of 8/6 taps to 1.3 rad'
    """

    previous: int
    ahead: int
    band: Fraction
    conditions: int = 4
    degree: int = 4
    gyro: Response | None = None
    noise: Fraction = Fraction(0)
    one_sided_noise: Fraction = ONE_SIDED_NOISE
    spectrum: tuple[int, ...] | None = None
    rotation: str = "fourth"
    terms: int = 16
    title: str = ""
    start_noise: Fraction = Fraction(0)
    increments: int = 1
    taps: tuple[int, int] | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Refuse more conditions than samples, and a rotation that is not good enough for steps of several samples."""
        if self.taps is not None:
            self._check_pair(self.taps)
        checks.count("conditions", self.conditions, largest=self.previous + self.increments + self.ahead)
        if self.taps is None and self.increments > 1 and self.rotation != "exact":
            raise InputError(
                f"rotation is {self.rotation!r}; steps of {self.increments} samples take the exact one"
            )

    def _check_pair(self, taps: tuple[int, int]) -> None:
        checks.count("increments", self.increments, largest=MOST_PAIR_INCREMENTS)
        # The sample in the middle of an odd number has a tap of v itself.
        least = self.conditions // 2, (self.conditions + 1) // 2 - self.increments % 2
        for filter, number, needed in zip("uv", taps, least, strict=True):
            checks.count(f"{filter}-taps", number, smallest=needed)
        side = pair_side(taps, self.increments)
        if (self.previous, self.ahead) != (side, side):
            raise InputError(
                f"a pair of {taps[0]} and {taps[1]} taps has {side} samples on each side of its step"
            )

    @property
    def objective(self) -> str:
        """Whether the committed filters are the best ones at the worst frequency, or in the mean."""
        return "mean square" if self.noise or self.spectrum is not None else "minimax"

    @property
    def sizes(self) -> list[tuple[int, int]]:
        """The samples before and ahead of the step of all filters that are designed, the committed ones first."""
        return [(self.previous, self.ahead), *stored_sizes(self.previous, self.ahead, self.gyro is None)]

    @property
    def full_title(self) -> str:
        """The title, by default from the samples, the band, the gyro and the noise."""
        samples = f"{self.increments}+{self.previous}+{self.ahead}"
        kind = f"Window {samples}"
        if self.taps is not None:
            kind = f"Pair {samples} of {self.taps[0]}/{self.taps[1]} taps"
        parts = [f"{kind} to {float(self.band):g} rad"]
        if self.gyro is not None:
            parts.append(f"gyro {self.gyro.title}")
        if self.noise:
            parts.append(f"noise {float(self.noise):g}")
        if self.spectrum is not None:
            parts.append("for a spectrum")
        return self.title or ", ".join(parts)


def pair_side(taps: tuple[int, int], increments: int) -> int:
    """Return the samples on each side of the step of a pair, from its taps on each side of the middle of the step.

    >>> pair_side((8, 6), 1), pair_side((8, 7), 2)
    (8, 7)
    """
    return max(taps) - increments // 2


def design(
    brief: FamilyBrief, track: Callable[[Sequence[tuple[int, int]]], Iterator[tuple[int, int]]] = iter
) -> Window:
    """Return the family of filters for a brief.

    Parameters
    ----------
    brief : FamilyBrief
    track : callable, optional
        Passes on the sizes of the filters one by one, and may show how far the design has come.

    Returns
    -------
    Window

    Raises
    ------
    MissingExtraError
        If SciPy is not installed, which symmetric filters of the least largest error need.
    InputError
        If the filters are not determined, or their design does not converge.

    Examples
    --------
    >>> window = design(FamilyBrief(2, 2, Fraction(1), degree=2))
    >>> window.name, window.parity, [round(float(tap), 9) for tap in window.filters[1][3:]]
    ('window-1-2-2-to-1-rad', True, [0.341666667, -0.045833333])
    >>> [one.name for one in window.one_sided]
    ['window-1-2-2-to-1-rad-3-1', 'window-1-2-2-to-1-rad-4-0', 'window-1-2-2-to-1-rad-0-4', 'window-1-2-2-to-1-rad-1-3']
    """
    committed, designed = None, {}
    for size in track(brief.sizes):
        if committed is None:
            committed = commit_filters(brief)
        else:
            designed[size] = _filters(brief, size, brief.one_sided_noise)
    assert committed is not None, "its size is the first one"
    windows = {}
    for size in one_sided_sizes(brief.previous, brief.ahead):
        if size in designed:
            windows[size] = _sibling(committed, size, designed[size], brief.one_sided_noise)
        else:
            windows[size] = windows[size[::-1]].mirrored()
    start = tuple(
        _sibling(committed, size, _filters(brief, size, brief.start_noise), brief.start_noise)
        for size in start_sizes(brief.previous, brief.ahead)
    )
    return replace(committed, one_sided=tuple(windows.values()), start=start)


def commit_filters(brief: FamilyBrief) -> Window:
    """Return the filters that commit an attitude alone, as `design` does.

    >>> commit_filters(FamilyBrief(2, 2, Fraction(1), degree=2)).one_sided
    ()
    """
    return Window(
        slug(brief.full_title),
        brief.full_title,
        _source(brief),
        brief.increments,
        brief.previous,
        brief.ahead,
        brief.conditions,
        brief.band,
        brief.objective,
        _filters(brief, (brief.previous, brief.ahead), brief.one_sided_noise),
        brief.gyro,
        brief.noise,
        brief.rotation,
        brief.terms,
        form="legendre" if brief.taps is None else "pair",
    )


def _source(brief: FamilyBrief) -> str:
    methods = {
        "mean square": "least mean square error over the band",
        "minimax": "least largest error over the band, by exchange"
        if Shape(brief.previous, brief.ahead, brief.conditions, brief.gyro).symmetric
        else "least largest error over the band, by Lawson's iteration",
    }
    return f"strapgen window design; {methods[brief.objective]}; one-sided filters of least mean square error"


def _sibling(committed: Window, size: tuple[int, int], filters: tuple[Taps, ...], noise: Fraction) -> Window:
    previous, ahead = size
    return replace(
        committed,
        **of_sibling(committed),
        name=sibling_name(committed.name, committed.previous, committed.ahead, previous, ahead),
        title=sibling_title(committed.title, previous, ahead),
        previous=previous,
        ahead=ahead,
        objective="mean square",
        noise=noise,
        filters=filters,
    )


def _filters(brief: FamilyBrief, size: tuple[int, int], one_sided_noise: Fraction) -> tuple[Taps, ...]:
    """Return the filters with some samples before and ahead of the step, as rationals, from the cache if there."""
    key = full_text((replace(brief, title=""), size, one_sided_noise))
    return cache.stored("filters", [key], lambda: _designed(brief, size, one_sided_noise))


def _designed(brief: FamilyBrief, size: tuple[int, int], one_sided_noise: Fraction) -> tuple[Taps, ...]:
    """Design the filters with some samples before and ahead of the step."""
    shape = Shape(*size, brief.conditions, brief.gyro, brief.increments)
    one_sided = size != (brief.previous, brief.ahead)
    noise = None if brief.objective == "minimax" else brief.noise
    if one_sided:
        noise = one_sided_noise
    step = range(shape.previous, shape.previous + shape.increments)
    mean = tuple(Fraction(place in step) for place in range(shape.samples))
    if brief.gyro is not None:
        (mean,) = _best(brief, noise, shape, [0])
    if brief.taps is None or one_sided:
        return (mean, *_best(brief, noise, shape, range(1, brief.degree + 1)))
    # Of a pair c_2 - 5 c_0 = 30 v first, then u for the rationals of v.
    rows: list[Taps] = []
    for m, number in ((2, brief.taps[1]), (1, brief.taps[0])):
        side = pair_side((number, number), brief.increments)
        own = replace(shape, previous=side, ahead=side, pair=True)
        (row,) = _best(brief, noise, own, [m], tuple(tap / 30 for tap in rows[0]) if rows else None)
        zeros = (Fraction(0),) * (brief.previous - side)
        rows.append((*zeros, *row, *zeros))
    return mean, rows[1], tuple(a + 5 * b for a, b in zip(rows[0], mean, strict=True))


def _best(
    brief: FamilyBrief,
    noise: Fraction | None,
    shape: Shape,
    degrees: Sequence[int],
    lever: Taps | None = None,
) -> tuple[Taps, ...]:
    """Return the best filters as rationals, one for each degree: of least mean square error with a noise.

    Without one they are of the least largest error. `lever`: v of a pair whose u is designed.
    """
    unknowns = [Unknowns(shape, m) for m in degrees]
    taps: Sequence[Sequence[Any]]
    if noise is not None:
        taps = mean_square.mean_square_filters(shape, degrees, brief.band, noise, brief.spectrum, lever)
    elif shape.symmetric:
        taps = [exchange.minimax_filter(each, brief.band, lever=lever).taps for each in unknowns]
    else:
        taps = mean_square.lawson_filters(shape, degrees, brief.band, lever)
    return tuple(rounded(each, row) for each, row in zip(unknowns, taps, strict=True))


def written(family: Window, command: str) -> str:
    """Return a family as a TOML file that says which command designed it.

    Examples
    --------
    >>> from strapgen import WINDOWS
    >>> print(*written(WINDOWS["window-3-3"], "strapgen window design ...").splitlines()[:2], sep=chr(10))
    # Designed by: strapgen window design ...
    # Levels of F_1 to F_4: 2.160751e-03, 3.647130e-05, 3.112845e-04, 3.872884e-06
    """
    levels = ", ".join(
        f"{responses.level(family, m):.6e}" for m in range(0 if family.gyro else 1, family.degree + 1)
    )
    lines = [
        f"# Designed by: {command}",
        f"# Levels of F_{0 if family.gyro else 1} to F_{family.degree}: {levels}"
        + ("; that of F_1 is of its product with F_2/30 - F_0/6" if family.form == "pair" else ""),
        *(f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in _file_head(family).items()),
    ]
    lines += _filter_lines(family.filters)
    if family.gyro is not None:
        lines += ["", "[gyro]", *gyro_lines(family.gyro)]
    sizes = stored_sizes(family.previous, family.ahead, family.gyro is None)
    tables = [("one_sided", family.one_sided_with(ahead)) for _, ahead in sizes]
    for key, one in tables + [("start", one) for one in family.start]:
        lines += ["", f"[[{key}]]", f"previous = {one.previous}", f"ahead = {one.ahead}"]
        lines += [f'objective = "{one.objective}"', f'noise = "{number(one.noise)}"']
        lines += [f'band = "{number(one.band)}"'] if one.band != family.band else []
        lines += _filter_lines(one.filters)
    return "\n".join(lines) + "\n"


def gyro_lines(gyro: Response) -> Iterator[str]:
    """Yield the keys of a response and their values, as in a TOML file.

    >>> [*gyro_lines(Response(damping=Fraction(7, 10), frequency_hz=Fraction(40), sample_hz=Fraction(100)))]
    ['filter = "second-order"', 'frequency_hz = "40"', 'damping = "0.7"', 'sample_hz = "100"']
    """
    for key, value in gyro.facts.items():
        texts = repr(value) if isinstance(value, int) else json.dumps(value, default=number)
        yield f"{key} = {texts}"


def _file_head(family: Window) -> dict[str, str | int]:
    head: dict[str, str | int] = {
        "name": family.title,
        "source": family.source,
        "previous": family.previous,
        "ahead": family.ahead,
        "increments": family.increments,
        "conditions": family.conditions,
        "band": number(family.band),
        "objective": family.objective,
        "noise": number(family.noise),
        "rotation": family.rotation,
    }
    head |= {"form": family.form} if family.form != "legendre" else {}
    return head | ({"terms": family.terms} if family.rotation == "exact" else {})


def _filter_lines(rows: tuple[Taps, ...]) -> Iterator[str]:
    yield "filters = ["
    for row in rows:
        yield f"  [{', '.join(chr(34) + str(tap) + chr(34) for tap in row)}],"
    yield "]"


def number(value: Fraction) -> str:
    """Return a number as a decimal if it is one, otherwise as a fraction.

    >>> number(Fraction(13, 10)), number(Fraction(3, 10000)), number(Fraction(1, 3)), number(Fraction(-40))
    ('1.3', '0.0003', '1/3', '-40')
    """
    digits = next((n for n in range(13) if (value * 10**n).denominator == 1), None)
    if digits is None:
        return str(value)
    return format(Decimal((value * 10**digits).numerator).scaleb(-digits), "f")
