"""Reports the filters of windows, their errors and gains, as plain data and as text."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from strapgen.catalogue.methods.window import Window
from strapgen.design.filters import responses
from strapgen.design.windows.family_file import number
from strapgen.ir.suggestions import counted
from strapgen.results.report import Report, flat_table
from strapgen.results.table import Column, TextTable

#: Level of F_1, largest gain of F_0 and noise gain of F_1 from which on a user is warned.
_HIGH_LEVEL, _HIGH_GAIN, _HIGH_NOISE_GAIN = 1e-4, 2.0, 10.0
_TWO_COLUMNS = (Column(align="<"), Column(align="<"))


def window_data(window: Window) -> dict[str, Any]:
    """Return a family, or one-sided filters alone, as plain JSON data; taps are exact, as text, the oldest first."""
    gyro = window.gyro
    return {
        "name": window.name,
        "title": window.title,
        "source": window.source,
        "increments": window.increments,
        "conditions": window.conditions,
        "band_rad_sample": float(window.band),
        "gyro": None if gyro is None else {key: float(value) for key, value in vars(gyro).items()},
        "rotation": window.rotation,
        "terms": window.terms if window.rotation == "exact" else None,
        **_side(window),
        "one_sided": [{"name": one.name, **_side(one)} for one in window.one_sided],
        "start": [{"name": one.name, **_side(one)} for one in window.start],
    }


def _side(window: Window) -> dict[str, Any]:
    """Return what differs from filters to filters of a family."""
    return {
        "previous": window.previous,
        "ahead": window.ahead,
        "objective": window.objective,
        "noise": float(window.noise),
        "symmetric": window.parity,
        "largest_gain": responses.largest_gain(window),
        "filters": [
            {
                "coefficient": m,
                "level": responses.level(window, m),
                "noise_gain": responses.noise_gain(window, m),
                "taps": [str(tap) for tap in row],
            }
            for m, row in enumerate(window.filters)
        ],
    }


def window_text(window: Window, data: Mapping[str, Any]) -> str:
    """Return the filters of a window as text: conditions, errors and gains, and rounded taps."""
    band = float(window.band)
    facts = {
        "samples": f"{window.previous} before the step, {window.increments} in it, {window.ahead} ahead of it",
        "exact, as rationals, for": "polynomial rates in time of degree up to " + str(window.conditions - 1),
        "band": f"{band:g} rad a sample, {band / (2 * math.pi):.4g} of the sampling rate",
        "objective": _objective(window),
        "gyro": _gyro(window),
        "rotation": "rotation vector to fourth order"
        if window.rotation == "fourth"
        else f"power series of the quaternion, {counted(window.terms, 'term')}",
        "symmetric in time": "yes" if window.parity else "no",
    }
    first = 0 if window.gyro else 1
    return "\n".join(
        [
            f"{window.name}: {window.title}",
            f"source: {window.source}",
            "",
            *TextTable(_TWO_COLUMNS, list(facts.items())).lines(),
            "",
            *_side_table(data, first).lines(),
            "",
            "level: largest error of a Legendre coefficient over the band, by the rate times the sampling interval",
            "noise gain: standard deviation of the coefficient by that of white noise of the increments",
            "gain of F_0: largest response to a rate, up to half the sampling rate",
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
    bandwidth, damping, sample = map(number, vars(window.gyro).values())
    return f"second order, {bandwidth} Hz, damping {damping}, {sample} samples in a second"


def _side_table(data: Mapping[str, Any], first: int) -> TextTable:
    """Return a row for the filters of each number of samples ahead: levels and gains."""
    sides = [(data, ""), *((side, "") for side in data["one_sided"])]
    sides += [(side, "start") for side in data["start"]]
    degrees = [row["coefficient"] for row in data["filters"][first:]]
    columns = [
        *([Column("of", "<")] if data["start"] else []),
        Column("before"),
        Column("ahead"),
        *(Column(f"F_{m}", spec=".3e", group="level") for m in degrees),
        *(Column(f"F_{m}", spec=".3g", group="noise gain") for m in degrees),
        Column("F_0", spec=".3g", group="gain"),
    ]
    rows = [
        [
            *([use] if data["start"] else []),
            side["previous"],
            side["ahead"],
            *(row[key] for key in ("level", "noise_gain") for row in side["filters"][first:]),
            side["largest_gain"],
        ]
        for side, use in sides
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


def window_report(window: Window) -> Report:
    """Return a window as a report, whose table has a row for each filter with its exact taps."""
    data = window_data(window)
    return Report(lambda: window_text(window, data), lambda: data, lambda: flat_table(list(_rows(data))))


def _rows(data: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    for side in (data, *data["one_sided"], *data["start"]):
        facts = {
            key: side[key] for key in ("name", "previous", "ahead", "objective", "noise", "largest_gain")
        }
        for row in side["filters"]:
            yield facts | row


def window_warnings(window: Window) -> list[str]:
    """Return what a user of filters should know: errors and gains that are large, a sentence each."""
    warnings = []
    level = responses.level(window, 1)
    if level > _HIGH_LEVEL:
        warnings.append(
            f"the error of F_1 reaches {level:.2g} in the band, over {_HIGH_LEVEL:g}; "
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
