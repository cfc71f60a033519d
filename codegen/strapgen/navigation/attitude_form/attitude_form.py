"""Counts what each form of the attitude costs in a navigator: three rows, two rows, or a quaternion."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from strapgen import pipeline
from strapgen.catalogue import Choice
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.lab.cost import cost
from strapgen.navigation.two_speed import transformation_error

#: What a navigator does with its attitude, in the words of a table.
PARTS = {
    "update": "update of fifth order",
    "matrix": "third row or matrix",
    "velocity": "velocity increment",
    "orthonormalization": "orthonormalization",
    "navigation": "navigation frame",
}
#: Titles of the forms, and the kernel of each part; "" where a form does without it.
FORMS: dict[str, tuple[str, dict[str, str]]] = {
    "dcm": (
        "direction cosines",
        {
            "update": "dcm-update-5",
            "matrix": "",
            "velocity": "dcm-velocity-2",
            "orthonormalization": "dcm-orthonormalize-first-order",
            "navigation": "dcm-navigation-update-2",
        },
    ),
    "two-rows": (
        "two rows, third by (43)",
        {
            "update": "dcm-two-rows-update-5",
            "matrix": "dcm-from-two-rows",
            "velocity": "dcm-velocity-2",
            "orthonormalization": "dcm-two-rows-orthonormalize",
            "navigation": "dcm-two-rows-navigation-2",
        },
    ),
    "euler": (
        "quaternion, matrix by (17)",
        {
            "update": "euler-update-5",
            "matrix": "dcm-from-euler",
            "velocity": "dcm-velocity-2",
            "orthonormalization": "euler-normalize-first-order",
            "navigation": "euler-navigation-update-2",
        },
    ),
    "euler-alone": (
        "quaternion, velocity by (58)",
        {
            "update": "euler-update-5",
            "matrix": "",
            "velocity": "euler-velocity-2",
            "orthonormalization": "euler-normalize-first-order",
            "navigation": "euler-navigation-update-2",
        },
    ),
}


@dataclass(frozen=True)
class PartRates:
    """How often a navigator runs each part, in Hz."""

    #: Slow cycles: update, matrix, velocity
    update: float
    #: 0 for a part that is never run
    navigation: float
    orthonormalization: float

    def of(self, part: str) -> float:
        """Return the rate of a part."""
        return {"navigation": self.navigation, "orthonormalization": self.orthonormalization}.get(
            part, self.update
        )


@dataclass(frozen=True)
class PartCost:
    """What a part of a form costs."""

    #: Keys of `FORMS` and `PARTS`; the kernel is "" where the form does without the part
    form: str
    part: str
    kernel: str
    #: How often it runs
    hz: float
    #: Operations of a call in floating point, by kind
    operations: Mapping[str, int]
    #: Instructions of a call in fixed point; None where none were counted
    executed: int | None = None

    @property
    def count(self) -> int:
        """Operations of a call, of all kinds."""
        return sum(self.operations.values())


@dataclass(frozen=True)
class VelocityLoss:
    """What the first-order attitude in a slow cycle costs in velocity."""

    #: In rad/s
    largest_rate: float
    #: Angle of a slow cycle at that rate, in rad
    angle: float
    #: Errors as parts of the velocity increment
    along: float
    across: float
    #: A stated error, and the slow rate that it takes
    error: float
    slowest_hz: float


@dataclass(frozen=True)
class FormStudy:
    """The costs of all forms."""

    rates: PartRates
    parts: tuple[PartCost, ...]
    truncation: VelocityLoss
    #: Processor on which instructions were counted; "" if none were
    cpu: str = ""

    def of(self, form: str) -> list[PartCost]:
        """Return the parts of a form."""
        return [part for part in self.parts if part.form == form]

    def per_second(self, form: str) -> float:
        """Return the operations of a form in a second."""
        return math.fsum(part.count * part.hz for part in self.of(form))

    def executed_per_second(self, form: str) -> float | None:
        """Return the instructions of a form in a second; None where none were counted."""
        if not self.cpu:
            return None
        return math.fsum((part.executed or 0) * part.hz for part in self.of(form))

    @property
    def spread(self) -> float:
        """By what part of the smallest total the largest exceeds it."""
        totals = [self.per_second(form) for form in FORMS]
        return max(totals) / min(totals) - 1


def pairs(without: Iterable[str] = ()) -> list[tuple[str, str]]:
    """Return the forms and parts that are counted."""
    left_out = {checks.choice("without", name, PARTS) for name in without}
    remaining = [part for part in PARTS if part not in left_out]
    if not remaining:
        raise InputError("without names every part; at least one has to be left")
    return [(form, part) for form in FORMS for part in remaining]


def part_costs(
    which: Iterable[tuple[str, str]], rates: PartRates, cpu: str = "", settings: Settings | None = None
) -> Iterator[PartCost]:
    """Count the operations of parts, and where a processor is named their instructions in fixed point."""
    for form, part in which:
        kernel = FORMS[form][1][part]
        if not kernel:
            yield PartCost(form, part, "", rates.of(part), {}, 0 if cpu else None)
            continue
        choice = Choice(kernel)
        counts = {kind: n for kind, n in pipeline.program(choice).operations.items() if n}
        executed = cost(pipeline.compile(choice, "c-fixed", settings), cpu).executed if cpu else None
        yield PartCost(form, part, kernel, rates.of(part), counts, executed)


def truncation(rates: PartRates, largest_rate: float, error: float) -> VelocityLoss:
    """Return what (47) costs at the slow rate, and the slow rate for a stated error.

    `largest_rate`: in rad/s.
    """
    slowest = transformation_error.slowest_rate(largest_rate, error)
    angle = largest_rate / rates.update
    return VelocityLoss(largest_rate, angle, *transformation_error.errors(angle), error, slowest)
