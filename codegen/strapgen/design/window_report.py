"""The filters of windows, with their errors and gains, as a result."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, ClassVar

from strapgen.catalogue.methods.window import Window
from strapgen.design.family import number
from strapgen.design.filters import responses
from strapgen.ir.checks import counted
from strapgen.results.records import INTERNAL, entry, plain_record
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable

#: Level of F_1, largest gain of F_0 and noise gain of F_1 from which on a user is warned.
_HIGH_LEVEL, _HIGH_GAIN, _HIGH_NOISE_GAIN = 1e-4, 2.0, 10.0
_TWO_COLUMNS = (Column(align="<"), Column(align="<"))


@dataclass(frozen=True)
class FilterRow:
    """A filter of a window."""

    #: Number of the Legendre coefficient that it estimates
    coefficient: int
    #: Largest error over the band, by the rate times the sampling interval
    level: float
    #: Standard deviation of the coefficient by that of white noise of the increments
    noise_gain: float
    #: Exact, the oldest sample first
    taps: tuple[Fraction, ...]


@dataclass(frozen=True)
class WindowSide:
    """The properties of one set of filters of a family."""

    #: Samples before the step
    previous: int
    #: Samples ahead of it
    ahead: int
    objective: str
    #: Noise of an increment by the rate, for which they are designed
    noise: float
    symmetric: bool
    #: Largest response to a rate, up to half the sampling rate
    largest_gain: float
    filters: list[FilterRow]

    @staticmethod
    def of(window: Window) -> WindowSide:
        """Return the filters with their errors and gains."""
        filters = [
            FilterRow(m, responses.level(window, m), responses.noise_gain(window, m), row)
            for m, row in enumerate(window.filters)
        ]
        gain, noise = responses.largest_gain(window), float(window.noise)
        facts = (window.previous, window.ahead, window.objective, noise, bool(window.parity))
        return WindowSide(*facts, gain, filters)


@dataclass(frozen=True)
class NamedSide:
    """Filters of a family under their name."""

    name: str
    side: WindowSide = field(metadata=entry(spread=True))

    @staticmethod
    def of(window: Window) -> NamedSide:
        """Return one-sided filters."""
        return NamedSide(window.name, WindowSide.of(window))


@dataclass(frozen=True)
class WindowResult(Result):
    """The filters of a window with their errors and gains; taps are exact, as text, the oldest first."""

    drawn_by: ClassVar[str] = "strapgen.design.design_plots:window_image"

    window: Window = field(metadata=INTERNAL)
    name: str
    title: str
    source: str
    #: Samples of the step
    increments: int
    #: The filters are exact for polynomial rates of a degree below this number
    conditions: int
    #: Highest angular frequency for which they are designed
    band_rad_sample: float
    gyro: dict[str, Any] | None
    #: "fourth" for the rotation vector to fourth order, or "exact" for a power series of the quaternion
    rotation: str
    #: "legendre" for a filter of each coefficient, or "pair" for two whose product is that of coning
    form: str
    #: Terms of that power series
    terms: int | None
    side: WindowSide = field(metadata=entry(spread=True))
    one_sided: list[NamedSide]
    #: Filters of the first intervals of a recording
    start: list[NamedSide]

    @staticmethod
    def of(window: Window) -> WindowResult:
        """Return a family, or one-sided filters alone."""
        gyro = window.gyro
        same = ("name", "title", "source", "increments", "conditions", "rotation", "form")
        return WindowResult(
            window=window,
            **{name: getattr(window, name) for name in same},
            band_rad_sample=float(window.band),
            gyro=None if gyro is None else gyro.plain,
            terms=window.terms if window.rotation == "exact" else None,
            side=WindowSide.of(window),
            one_sided=list(map(NamedSide.of, window.one_sided)),
            start=list(map(NamedSide.of, window.start)),
        )

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each filter with its exact taps."""
        rows = []
        for one in (NamedSide(self.name, self.side), *self.one_sided, *self.start):
            facts = plain_record(one)
            filters, _ = facts.pop("filters"), facts.pop("symmetric")
            rows += [facts | row for row in filters]
        return rows

    def text(self) -> str:
        """Return conditions, errors and gains, and rounded taps."""
        window = self.window
        band = float(window.band)
        facts = {
            "samples": f"{window.previous} before the step, {window.increments} in it, {window.ahead} ahead of it",
            "exact, as rationals, for": "polynomial rates in time of degree up to "
            + str(window.conditions - 1),
            "band": f"{band:g} rad a sample, {band / (2 * math.pi):.4g} of the sampling rate",
            "objective": _objective(window),
            "gyro": _gyro(window),
            "rotation": "rotation vector to fourth order"
            if window.rotation == "fourth"
            else f"power series of the quaternion, {counted(window.terms, 'term')}",
            "symmetric in time": "yes" if window.parity else "no",
        }
        pair = self.form == "pair"
        first = 0 if window.gyro else 1
        return "\n".join(
            [
                f"{window.name}: {window.title}",
                f"source: {window.source}",
                "",
                *TextTable(_TWO_COLUMNS, list(facts.items())).lines(),
                "",
                *_side_table(self, first).lines(),
                "",
                "level: largest error of a Legendre coefficient over the band, by the rate times the sampling interval",
                "noise gain: standard deviation of the coefficient by that of white noise of the increments",
                "gain of F_0: largest response to a rate, up to half the sampling rate",
                *(["pair: its level of F_1 is that of the product with F_2/30 - F_0/6"] if pair else []),
                *(
                    [
                        "start: for the first intervals of a recording, in place of those with as many samples before"
                    ]
                    if window.start
                    else []
                ),
                "",
                *_tap_table(window).lines(),
            ]
        )


def _objective(window: Window) -> str:
    if window.objective == "minimax":
        return "least largest error over the band"
    noise = f", with increment noise of {number(window.noise)} of the rate" if window.noise else ""
    return f"least mean square error over the band{noise}"


def _gyro(window: Window) -> str:
    if window.gyro is None:
        return "ideal: increments are integrals of the rate"
    return f"{window.gyro.words}, {number(window.gyro.sample_hz or Fraction(0))} samples in a second"


def _side_table(result: WindowResult, first: int) -> TextTable:
    """Return a row for the filters of each number of samples ahead: levels and gains."""
    sides = [(result.side, ""), *((one.side, "") for one in result.one_sided)]
    sides += [(one.side, "start") for one in result.start]
    most = max(len(side.filters) for side, _ in sides)
    degrees = range(first, most)
    columns = [
        *([Column("of", "<")] if result.start else []),
        Column("before"),
        Column("ahead"),
        *(Column(f"F_{m}", spec=".3e", group="level") for m in degrees),
        *(Column(f"F_{m}", spec=".3g", group="noise gain") for m in degrees),
        Column("F_0", spec=".3g", group="gain"),
    ]
    rows = [
        [
            *([use] if result.start else []),
            side.previous,
            side.ahead,
            *(row.level for row in rows[first:]),
            *missing,
            *(row.noise_gain for row in rows[first:]),
            *missing,
            side.largest_gain,
        ]
        for side, use in sides
        for rows in [side.filters]
        for missing in [[None] * (most - len(rows))]
    ]
    return TextTable(columns, rows)


def _tap_table(window: Window) -> TextTable:
    """Return the taps of a window, rounded, a row for each sample."""
    columns = [Column("sample"), *(Column(f"F_{m}", spec=".15g") for m in range(window.degree + 1))]
    rows = [
        [place - window.previous, *map(float, taps)]
        for place, taps in enumerate(zip(*window.filters, strict=True))
    ]
    return TextTable(columns, rows)


def window_warnings(window: Window) -> list[str]:
    """Return warnings of large errors and gains, a sentence each."""
    warnings = []
    level = responses.level(window, 1)
    of = "the product of a pair" if window.form == "pair" else "F_1"
    if level > _HIGH_LEVEL:
        warnings.append(
            f"the error of {of} reaches {level:.2g} in the band, over {_HIGH_LEVEL:g}; "
            "a narrower band or more samples lower it"
        )
    every = [window, *window.one_sided]
    gain, where = max(((responses.largest_gain(one), one) for one in every), key=lambda pair: pair[0])
    if gain > _HIGH_GAIN:
        warnings.append(
            f"F_0 with {_sides(where)} amplifies rates beyond the band by up to {gain:.3g}, over {_HIGH_GAIN:g}; "
            "there must be no motion there"
        )
    gains = [(responses.noise_gain(one, 1), one) for one in window.one_sided]
    noise_gain, where = max(gains, key=lambda pair: pair[0], default=(0.0, window))
    if noise_gain > _HIGH_NOISE_GAIN:
        warnings.append(
            f"F_1 with {_sides(where)} has a noise gain of {noise_gain:.3g}, over {_HIGH_NOISE_GAIN:g}; "
            "a higher --now-noise lowers it"
        )
    return warnings


def _sides(window: Window) -> str:
    return f"{counted(window.previous, 'sample')} before the step and {window.ahead} ahead"
