"""Cases of a test on every combination of some values: few that cover every value at once, all others long."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from typing import Any

import pytest


def covering(*values: Iterable[Any]) -> list[Any]:
    """Return all combinations, one value of each list, as parameters of a test.

    As many of them as the longest list has values run at once: together they have every value of every list. Against
    each other, lists whose lengths have no common divisor are covered in many ways. The others are marked long.
    """
    lists = [list(several) for several in values]
    chosen = {tuple(number % len(several) for several in lists) for number in range(max(map(len, lists)))}
    return [
        pytest.param(
            *(several[place] for several, place in zip(lists, places, strict=True)),
            marks=() if places in chosen else pytest.mark.long,
        )
        for places in product(*(range(len(several)) for several in lists))
    ]
