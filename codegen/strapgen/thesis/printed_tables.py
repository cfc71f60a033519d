"""The five tables as the thesis prints them, with every figure that its scan makes illegible or that was misprinted."""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction

ALGORITHMS = ("dcm", "euler")
ORDERS = (1, 2, 4)


@dataclass(frozen=True)
class Repair:
    """A figure of the thesis that is not what its scan reads."""

    #: What is read in its place
    figure: str
    #: What the scan reads; a question mark stands for an illegible exponent
    scan: str
    #: Why the figure is what it is, as a sentence
    reason: str
    #: Its place in the table; "" and 0 for what the whole table rests on, its motion
    algorithm: str = ""
    order: int = 0

    @property
    def sentence(self) -> str:
        """The repair in words for a reader."""
        return f"{self.figure} is repaired, the scan reads {self.scan}: {self.reason}"


@dataclass(frozen=True)
class Table:
    """One of the thesis's tables."""

    number: int
    #: Motion of the table in words
    title: str
    #: The motion and its parameters
    motion: str
    settings: dict[str, int]
    #: Whether the drift is the mean over the axes, or that of the worst axis
    mean: bool
    #: The printed figures by algorithm and order, corrected where the transcription says so
    printed: dict[str, tuple[str, str, str]]
    #: Printed drift of the first-order direction cosine matrix in degrees; "" if there is none
    base: str = ""
    #: Whether a figure is the ratio to the direction cosine matrix of the same order, or of first order
    by_order: bool = False
    #: Figures of the table, and of its motion, that are not what the scan reads
    repairs: tuple[Repair, ...] = ()

    def repair(self, algorithm: str, order: int) -> Repair | None:
        """Return the repair of a figure; None if the scan has it as it is used here."""
        return next(
            (each for each in self.repairs if (each.algorithm, each.order) == (algorithm, order)), None
        )

    def repairs_behind(self, algorithm: str, order: int) -> list[Repair]:
        """Return the repairs that a figure rests on: its own, and those of the table's motion."""
        return [
            each for each in self.repairs if (each.algorithm, each.order) in ((algorithm, order), ("", 0))
        ]


def _coning(rate: int) -> dict[str, int]:
    return {"a_deg_s": rate, "b_deg_s": rate, "g_deg_s": rate}


_SIGN = Repair(
    "The rate a sin bt on axis x",
    "-a sin bt",
    "chapter 4 and appendix A have +a sin bt, with which Tables 4 and 5 come out; with -a the bases are "
    "others, 0.140 deg instead of 0.0625 deg.",
)

TABLES = (
    Table(
        1,
        "constant rate of 10 deg/s on one axis",
        "constant",
        {"y_deg_s": 10},
        False,
        {"dcm": ("1", ".5", ".12e-4"), "euler": (".25", ".125", ".75e-6")},
        "0.285",
        repairs=(
            Repair(
                ".75e-6",
                ".75e-?",
                "the exponent is illegible; the text has a sixteenth of .12e-4.",
                "euler",
                4,
            ),
        ),
    ),
    Table(
        2,
        "constant rate of 10 deg/s on three axes",
        "constant",
        {"x_deg_s": 10, "y_deg_s": 10, "z_deg_s": 10},
        False,
        {"dcm": ("1", ".5", ".36e-4"), "euler": (".25", ".125", ".225e-5")},
        repairs=(
            Repair(
                ".36e-4",
                ".26e-4",
                "the text has three times .12e-4, and .225e-5 is a sixteenth of .36e-4.",
                "dcm",
                4,
            ),
            Repair(
                ".225e-5",
                ".225e-?",
                "the exponent is illegible; the text has a sixteenth of .36e-4.",
                "euler",
                4,
            ),
        ),
    ),
    Table(
        3,
        "sinusoidal rate b cos(b t) on one axis, b = 10 deg/s",
        "sinusoidal",
        {"a_deg_s": 10, "b_deg_s": 10},
        False,
        {"dcm": ("1", "1", "1"), "euler": ("1", "1/4", "1/16")},
        by_order=True,
    ),
    Table(
        4,
        "coning on a constant pitch rate, a = b = g = 1 deg/s",
        "coning",
        _coning(1),
        True,
        {"dcm": ("1", ".71e-2", ".30e-8"), "euler": ("1", ".27e-2", ".16e-9")},
        "6.25e-2",
        repairs=(
            Repair(
                ".30e-8",
                ".30e-3",
                "Euler parameters have .16e-9 beside it, and the run has 3.07e-9.",
                "dcm",
                4,
            ),
            Repair(
                "b = 1 deg/s",
                "b = .1",
                "with b = 0.1 deg/s the base would be 0.00942 deg, where 6.25e-2 deg is printed.",
            ),
            _SIGN,
        ),
    ),
    Table(
        5,
        "coning on a constant pitch rate, a = b = g = 10 deg/s",
        "coning",
        _coning(10),
        True,
        {"dcm": ("1", ".44", ".19e-4"), "euler": (".66", ".16", ".23e-6")},
        "1.02",
        repairs=(
            Repair(".23e-6", ".23e-?", "the exponent is illegible; the run has 2.30e-7.", "euler", 4),
            _SIGN,
        ),
    ),
)


#: Printed figures that the thesis worked out from other printed figures, by 1/16.
SIXTEENTHS = {".75e-6": ".12e-4", ".225e-5": ".36e-4"}

#: The thesis gives table 3 as fractions, whose exactness it does not state; its other tables have two digits.
_FRACTION_TOLERANCE = 5e-3


def agrees(value: float, printed: str) -> bool:
    """Return whether a figure has the digits that the thesis prints.

    The thesis rounds some figures and truncates others: a figure up to half a unit below the printed one agrees, and so
    does one less than a unit above it. The entries .75e-6 and .225e-5 are sixteenths of the printed .12e-4 and .36e-4
    and only as exact as those.

    >>> agrees(1.87e-5, ".19e-4"), agrees(7.16e-3, ".71e-2"), agrees(7.3e-3, ".71e-2")
    (True, True, False)
    >>> agrees(7.439e-7, ".75e-6")
    True
    """
    if printed in SIXTEENTHS:
        return agrees(16 * value, SIXTEENTHS[printed])
    if "/" in printed:
        return math.isclose(value, float(Fraction(printed)), rel_tol=_FRACTION_TOLERANCE)
    figure = Decimal(printed)
    digits = 2 if figure == 1 else len(printed.partition("e")[0].partition(".")[2])
    unit = Decimal(1).scaleb(int(printed.partition("e")[2] or 0) - digits)
    return -unit / 2 <= Decimal(value) - figure < unit
