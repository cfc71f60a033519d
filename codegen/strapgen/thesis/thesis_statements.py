"""Tests the statements of the thesis on its results (chapter 5) by runs."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import product
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from strapgen.ir.exceptions import CompilerError
from strapgen.lab.motions.motions import motion
from strapgen.lab.runs import Run, simulate
from strapgen.results.records import entry, reader_table
from strapgen.results.result import Result
from strapgen.results.table import TextTable
from strapgen.run.backends import backend
from strapgen.thesis.thesis_tables import ALGORITHMS, DURATION, INTERVAL, ORDERS, STEP, TABLES, drift_deg

Numbers = dict[str, float]

#: Orders of the runs; the thesis has no third order.
_ALL = (1, 2, 3, 4)
#: Drift of the size of a gyro pulse, in deg.
_QUANTUM = 0.007

#: Parameters that a rate is set for: all of a motion, or the axes of a constant rate.
_KEYS = {"sinusoidal": "ab", "coning": "abg"}

#: Width of the text in characters.
_WIDTH = 100


@dataclass(frozen=True)
class Statement:
    """A statement of the thesis with the runs that test it."""

    number: int
    #: The statement in few words
    said: str = field(metadata=entry("statement of the text", align="<"))
    #: What the runs measure, with the numbers in it
    run: str = field(metadata=entry("run", align="<"))
    #: Whether it holds
    verdict: str = field(metadata=entry("verdict", align="<"))
    #: Whether the numbers bear out the verdict
    confirmed: bool
    #: The numbers by name
    numbers: Numbers


def statements() -> Iterator[Statement]:
    """Run every statement of the thesis's fifth chapter that its tables do not have."""
    for number, (said, template, verdict, measure) in enumerate(_STATEMENTS, 1):
        numbers, confirmed = measure()
        yield Statement(number, said, template.format(**numbers), verdict, bool(confirmed), numbers)


def _linear() -> tuple[Numbers, bool]:
    plain, restored = thesis_run("dcm", 1, every=None), thesis_run("dcm", 1)
    others = [thesis_run(a, o, every=None) for a, o in product(ALGORITHMS, (2, 3, 4))]
    numbers = {
        "scale": last_scale(plain),
        "bend": bend(plain.time, plain.drift[:, 1]),
        "restored": bend(restored.time, restored.drift[:, 1]),
        "others": max(bend(run.time, run.drift[:, 1]) for run in others),
    }
    return numbers, numbers["bend"] > 0.04 and max(numbers["restored"], numbers["others"]) < 1e-4


def _skew() -> tuple[Numbers, bool]:
    cases = list(product(ALGORITHMS, _ALL))
    skew = max(float(np.abs(thesis_run(a, o, every=None).skew).max()) for a, o in cases)
    alike = max(
        float(np.ptp(values[-1]))
        for a, o in cases
        for run in (thesis_run(a, o, "xyz", every=None),)
        for values in (run.scale, run.skew, run.drift)
    )
    return {"skew": skew, "alike": alike}, skew == 0 and alike < 1e-14


def _quarter() -> tuple[Numbers, bool]:
    ratios = [
        last_drift(thesis_run("euler", order)) / last_drift(thesis_run("dcm", order)) for order in ORDERS
    ]
    turn = math.radians(10) * float(STEP)
    numbers = dict(zip(("first", "second", "fourth"), ratios, strict=True))
    numbers |= {"series": 1 / 4 + 9 * turn**2 / 80}
    close = all(abs(x * size - 1) < 1e-3 for x, size in zip(ratios, (4, 4, 16), strict=True))
    return numbers, close and abs(ratios[0] - numbers["series"]) < 2e-6


def _faster() -> tuple[Numbers, bool]:
    def gain(rate: float, step: str) -> float:
        return last_drift(thesis_run("dcm", 4, rate=rate, step=step)) / last_drift(
            thesis_run("dcm", 1, rate=rate, step=step)
        )

    base = gain(10, "1/8")
    numbers = {
        "by_rate": math.log2(gain(20, "1/8") / base),
        "by_step": math.log2(gain(10, "1/4") / base),
    }
    return numbers, all(abs(power - 2) < 0.01 for power in numbers.values())


def _scale_cut() -> tuple[Numbers, bool]:
    numbers = {
        f"{algorithm}{order}": abs(
            last_scale(thesis_run(algorithm, order)) / last_scale(thesis_run(algorithm, order, every=None))
        )
        for algorithm, order in product(ALGORITHMS, (1, 2))
    }
    second = thesis_run("dcm", 2)
    numbers["left"] = last_scale(second) / (-(last_drift(second) ** 2) / 2)
    first = max(numbers["dcm1"], numbers["euler1"])
    return numbers, first < 1e-4 < 1e-2 < min(numbers["dcm2"], numbers["euler2"]) and abs(
        numbers["left"] - 1
    ) < 1e-4


def _fourth_order() -> tuple[Numbers, bool]:
    numbers = {
        "plain": last_scale(thesis_run("dcm", 4, every=None)),
        "restored": last_scale(thesis_run("dcm", 4)),
    }
    return numbers, abs(numbers["plain"]) < 1e-8 and abs(numbers["restored"] / numbers["plain"]) < 1e-5


def _at_the_end() -> tuple[Numbers, bool]:
    apart = max(
        float(np.abs(thesis_run(a, o, every=float(DURATION)).error[-1] - thesis_run(a, o).error[-1]).max())
        for a, o in product(ALGORITHMS, _ALL)
    )
    late, often = thesis_run("dcm", 1, "xyz", every=float(DURATION)), thesis_run("dcm", 1, "xyz")
    numbers = {
        "one_axis": apart,
        "scale": last_scale(late),
        "skew": math.degrees(late.skew[-1, 0]),
        "often_scale": last_scale(often),
        "often_skew": math.degrees(often.skew[-1, 0]),
    }
    second = [
        abs(last_scale(thesis_run("dcm", 2, "xyz", every=t))) for t in (float(DURATION), float(INTERVAL))
    ]
    return numbers, apart < 1e-13 and numbers["scale"] < 50 * numbers["often_scale"] and abs(
        second[0] / second[1] - 1
    ) < 1e-6


def _drift_kept() -> tuple[Numbers, bool]:
    changes = []
    for table, algorithm, order in product(TABLES, ALGORITHMS, _ALL):
        name = {"constant": "y" if table.number == 1 else "xyz"}.get(table.motion, table.motion)
        rate = table.settings.get("a_deg_s", 10)
        plain, restored = (
            drift_deg(table, thesis_run(algorithm, order, name, rate, every))
            for every in (None, float(INTERVAL))
        )
        changes.append((restored - plain, restored / plain - 1))
    larger = [(change, share) for change, share in changes if change > 0]
    numbers = {
        "runs": len(changes),
        "larger": len(larger),
        # At 1 deg/s and high order the drift is round-off.
        "share": max(share for change, share in larger if change > 1e-12),
        "before": math.degrees(thesis_run("dcm", 1, "xyz", every=None).drift_by_axis.max()),
        "after": math.degrees(thesis_run("dcm", 1, "xyz").drift_by_axis.max()),
    }
    return numbers, 0 < numbers["larger"] < 20 and numbers["share"] < 2e-4 and numbers["after"] < 1


def _small_scale() -> tuple[Numbers, bool]:
    # The drift of second order grows with the third power of the rate.
    rate = 10 * (_QUANTUM / math.degrees(last_drift(thesis_run("dcm", 2, every=None)) * -1)) ** (1 / 3)
    second = thesis_run("dcm", 2, rate=rate, every=None)
    numbers = {
        "rate": rate,
        "drift": abs(math.degrees(last_drift(second))),
        "scale": last_scale(second),
        "dcm4": abs(last_scale(thesis_run("dcm", 4, every=None))),
        "euler4": abs(last_scale(thesis_run("euler", 4, every=None))),
    }
    near = abs(numbers["drift"] / _QUANTUM - 1) < 0.01
    return numbers, near and numbers["scale"] > 1e-7 and numbers["euler4"] < 1e-10 < numbers["dcm4"]


def _halves() -> tuple[Numbers, bool]:
    numbers = {
        f"{algorithm}{high}": last_drift(thesis_run(algorithm, high))
        / last_drift(thesis_run(algorithm, high - 1))
        for algorithm, high in product(ALGORITHMS, (2, 4))
    }
    shares = (-1 / 2, -1 / 4) * 2
    return numbers, all(abs(x / w - 1) < 1e-3 for x, w in zip(numbers.values(), shares, strict=True))


def _powers() -> tuple[Numbers, bool]:
    def largest(order: int, rate: float) -> float:
        return float(thesis_run("dcm", order, "sinusoidal", rate).drift_by_axis.max())

    numbers = {f"order{o}": math.log2(largest(o, 10) / largest(o, 5)) for o in _ALL}
    powers = (1, 2, 4, 4)
    return numbers, all(abs(x - w) < 2e-3 for x, w in zip(numbers.values(), powers, strict=True))


def _sinusoid() -> tuple[Numbers, bool]:
    run = thesis_run("dcm", 2, "sinusoidal", every=None)
    angle = math.radians(10) * run.time
    harmonics = np.stack([np.sin(k * angle) for k in (1, 3)], axis=1)
    drift = run.drift[:, 1]
    parts = np.linalg.lstsq(harmonics, drift, rcond=None)[0]
    # The drift at b t = 90 deg, where both sines are 1 in size, is the unit.
    unit = abs(parts[0] - parts[1])
    rest = float(np.abs(drift - harmonics @ parts).max() / unit)
    numbers = {"once": float(parts[0] / unit), "thrice": float(parts[1] / unit), "rest": rest}
    return numbers, abs(numbers["once"] + 1.125) < 1e-3 and abs(numbers["thrice"] + 0.125) < 1e-3


def _coning() -> tuple[Numbers, bool]:
    numbers = {}
    for order, rate in ((2, 10), (4, 10), (2, 1)):
        run = thesis_run("dcm", order, "coning", rate)
        turning = math.radians(rate) * math.sqrt(5) * run.time  # sqrt(a^2 + (b + g)^2)
        parts = np.stack([run.time, np.ones_like(turning), np.sin(turning), np.cos(turning)], axis=1)
        fit = np.linalg.lstsq(parts, run.drift, rcond=None)[0]
        key = f"order{order}_{rate}"
        numbers[f"{key}_rest"] = float(np.abs(run.drift - parts @ fit).max() / np.abs(run.drift).max())
        numbers[f"{key}_slopes"] = float(fit[0, 1] / fit[0, 2])
        numbers[f"{key}_swing"] = float(
            np.hypot(fit[2], fit[3]).max() / np.abs(fit[0] * float(DURATION)).max()
        )
    fits = all(x < 1e-5 for name, x in numbers.items() if name.endswith("rest"))
    return numbers, fits and all(abs(x - 2) < 1e-2 for name, x in numbers.items() if name.endswith("slopes"))


def _at_least_as_good() -> tuple[Numbers, bool]:
    worst = [math.degrees(thesis_run(a, 1, "sinusoidal").drift_by_axis.max()) for a in ("euler", "dcm")]
    numbers = {"cases": 0.0, "double": _wins("numpy"), "euler": worst[0], "dcm": worst[1]}
    numbers["cases"] = len(TABLES) * len(ORDERS)
    try:
        numbers["single"] = _wins("c-float")
    except CompilerError:  # double alone decides then
        numbers["single"] = math.nan
    fewer = math.isnan(numbers["single"]) or numbers["single"] < numbers["double"]
    return numbers, numbers["double"] == numbers["cases"] - 1 and 0 < worst[0] / worst[1] - 1 < 2e-4 and fewer


@lru_cache(maxsize=4)
def _wins(name: str) -> float:
    """Return in how many of the tables' cases Euler parameters drift no more than direction cosines."""
    count = 0
    for table, order in product(TABLES, ORDERS):
        profile = motion(table.motion, **table.settings)
        euler, dcm = (
            drift_deg(
                table,
                simulate(backend(a, f"rk{order}", 2, name), profile, STEP, DURATION, INTERVAL, INTERVAL),
            )
            for a in ("euler", "dcm")
        )
        count += euler <= dcm
    return float(count)


#: What the thesis says, what runs measure, the verdict, and the function that measures.
_STATEMENTS: tuple[tuple[str, str, str, Callable[[], tuple[Numbers, bool]]], ...] = (
    (
        "At a constant rate scale and drift grow linearly.",
        "Direction cosines of first order without orthonormalization reach a scale of {scale:.2f}, and their drift "
        "bends by {bend:.0%}; with it by {restored:.0e}; without it at other orders by {others:.0e} or less.",
        "It holds while the scale is small, or with orthonormalization.",
        _linear,
    ),
    (
        "Skew is zero on one axis; on three axes all errors are alike.",
        "The largest skew is {skew:g}, the largest difference between axes {alike:.0e}.",
        "It holds exactly.",
        _skew,
    ),
    (
        "Euler parameters drift 1/4, 1/4, 1/16 as much as direction cosines at orders 1, 2, 4, at any rate and step.",
        "{first:.5f}, {second:.5f}, {fourth:.5f}; the series has 1/4 + 9 x^2/80 = {series:.5f} at first order.",
        "It holds to leading order in the angle x of a step.",
        _quarter,
    ),
    (
        "Fourth order gains on first as w/dt is decreased.",
        "Their ratio goes with the power {by_rate:.2f} of the rate and {by_step:.2f} of the step.",
        "It is a misprint: w times dt, and the gain goes with its square.",
        _faster,
    ),
    (
        "At first and second order orthonormalization cuts the scale error by a factor of the order of 1e-4.",
        "Direction cosines: {dcm1:.0e} and {dcm2:.0e}; Euler parameters: {euler1:.0e} and {euler2:.0e}. Of second "
        "order {left:.4f} times -drift^2/2 is left.",
        "It holds at first order; second order does not: -drift^2/2 is left.",
        _scale_cut,
    ),
    (
        "At fourth order orthonormalization is no significant improvement.",
        "The scale {plain:.1e} becomes {restored:.1e}.",
        "That it is not needed holds, that it is no improvement does not.",
        _fourth_order,
    ),
    (
        "Orthonormalization at the end alone is much less good.",
        "On one axis it is the same to {one_axis:.0e}. On three axes direction cosines of first order have scale "
        "{scale:.1e} and skew {skew:.1f} deg, against {often_scale:.1e} and {often_skew:.3f} deg every 5 s.",
        "It holds on three axes at first order only.",
        _at_the_end,
    ),
    (
        "Orthonormalization never improves the drift and sometimes increases it.",
        "It increases the drift in {larger:.0f} of {runs:.0f} runs, by a share of {share:.1e} or less; but "
        "{before:.3f} deg become {after:.3f} deg, the base of Table 2.",
        "It is half true, and contradicts the thesis's own Table 2.",
        _drift_kept,
    ),
    (
        "Where the drift is 0.007 deg, scale errors are in the 1e-10 range.",
        "At second order and {rate:.2f} deg/s the drift is {drift:.4f} deg and the scale {scale:.0e}; at fourth order "
        "and 10 deg/s it is {dcm4:.0e} and {euler4:.0e}.",
        "It does not come out: only fourth order has such scales.",
        _small_scale,
    ),
    (
        "Second order drifts half as much as first, fourth order a quarter of third.",
        "Direction cosines: {dcm2:.4f} and {dcm4:.4f}; Euler parameters: {euler2:.4f} and {euler4:.4f}.",
        "It holds for the size; the signs are opposite.",
        _halves,
    ),
    (
        "On a sinusoid the drift grows as b, b^2, b^4 at orders 1, 2, 4, and presumably as b^3 at order 3.",
        "The powers of orders 1 to 4 are {order1:.2f}, {order2:.2f}, {order3:.2f}, {order4:.2f}.",
        "It holds for orders 1, 2, 4; the guess for order 3 is refuted.",
        _powers,
    ),
    (
        "On a sinusoid the drift is a sinusoid of the period of sin bt.",
        "Direction cosines of second order: {once:.3f} sin bt {thrice:+.3f} sin 3bt in units of its size at 90 deg; "
        "{rest:.0e} is left.",
        "It is periodic, but no pure sinusoid.",
        _sinusoid,
    ),
    (
        "On coning the drift is irregular, not linear, and difficult to correlate with the motion.",
        "Straight lines on y and z, {order2_10_slopes:.3f} : 1 along the cone's axis (0, b+g, a), and a swing of "
        "{order2_10_swing:.1%} of them at 10 deg/s and {order2_1_swing:.1%} at 1 deg/s leave {order2_10_rest:.0e} and "
        "{order2_1_rest:.0e} (direction cosines, second order).",
        "It is surpassed: the series have the closed form.",
        _coning,
    ),
    (
        "Euler parameters are at least as good in every case.",
        "In double they are in {double:.0f} of {cases} cases, in single precision in {single:.0f}. The exception is "
        "Table 3 at first order: {euler:.5f} against {dcm:.5f} deg.",
        "It holds in the printed digits; it is false in single precision.",
        _at_least_as_good,
    ),
)


#: Number of statements.
COUNT = len(_STATEMENTS)


@lru_cache(maxsize=256)
def thesis_run(
    algorithm: str,
    order: int,
    name: str = "y",
    rate: float = 10,
    every: float | None = float(INTERVAL),
    step: str = str(STEP),
) -> Run:
    """Run one of the thesis's motions for 180 s.

    `name`: "sinusoidal" or "coning", or the axes of a constant rate, for instance "xyz". `rate`: every
    parameter of the motion in deg/s. `every`: time from one orthonormalization to the next in s; None for
    never. Records are as far apart, or 5 s. `step`: in s.
    """
    keys = _KEYS.get(name, name)
    profile = motion(name if name in _KEYS else "constant", **{f"{key}_deg_s": rate for key in keys})
    stepper = backend(algorithm, f"rk{order}", 2)
    return simulate(stepper, profile, step, DURATION, every, max(every or 0, float(INTERVAL)))


def last_drift(run: Run) -> float:
    """Return the drift about y at the end of a run, in rad."""
    return float(run.drift[-1, 1])


def last_scale(run: Run) -> float:
    """Return the largest scale error at the end of a run, with its sign."""
    scales = run.scale[-1]
    return float(scales[np.abs(scales).argmax()])


def bend(time: NDArray[np.float64], values: NDArray[np.float64]) -> float:
    """Return how far values depart from the best straight line, as a share of the last one."""
    line = np.stack([time, np.ones_like(time)], axis=1)
    rest = values - line @ np.linalg.lstsq(line, values, rcond=None)[0]
    return float(np.abs(rest).max() / abs(values[-1]))


@dataclass(frozen=True)
class StatementsResult(Result):
    """Statements of the thesis and the runs that test them: a row for each statement."""

    rows_in = "statements"
    row: ClassVar[type | None] = Statement

    statements: Sequence[Statement]

    def reader(self) -> TextTable:
        """Return the statements in words."""
        return reader_table(self.statements, Statement)

    def text(self) -> str:
        """Return each statement with measurements and verdict."""
        lines: list[str] = []
        for each in self.statements:
            verdict = each.verdict if each.confirmed else f"{each.verdict} (the runs do not bear this out)"
            lines += textwrap.wrap(
                f"{each.number}. {each.said}", _WIDTH, subsequent_indent=" " * len(f"{each.number}. ")
            )
            for what, text in (("run", each.run), ("verdict", verdict)):
                lines += textwrap.wrap(
                    f"{what}: {text}", _WIDTH, initial_indent="    ", subsequent_indent="      "
                )
            lines.append("")
        return "\n".join(lines).rstrip()
