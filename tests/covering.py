"""Tests on combinations of several parameters: few that have every value of each run at once, some more are long."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import pytest


def covering(cases: Sequence[Sequence[Any]]) -> Iterator[int]:
    """Yield the places of few cases that have every value of every parameter.

    Parameters
    ----------
    cases : sequence of sequence
        For each case a value of each parameter.

    Examples
    --------
    >>> list(covering([(method, state) for method in ("rk1", "rk2", "rk4") for state in ("dcm", "euler")]))
    [0, 3, 4]
    """
    values = [list(dict.fromkeys(column)) for column in zip(*cases, strict=True)]
    pending = [{(axis, value) for axis, value in enumerate(case)} for case in cases]
    missing = set().union(*pending)
    number = 0
    while missing:
        # Along the diagonal, so that each value meets others than its neighbour does.
        diagonal = {(axis, several[number % len(several)]) for axis, several in enumerate(values)}
        best = max(
            range(len(cases)), key=lambda k: (len(pending[k] & missing), len(pending[k] & diagonal), -k)
        )
        yield best
        missing -= pending[best]
        number += 1


def in_rounds(cases: Sequence[Sequence[Any]], count: int) -> set[int]:
    """Return the places of cases that have every value of every parameter so many times, where so many cases have it.

    Examples
    --------
    >>> sorted(in_rounds([(method, word) for method in ("rk1", "rk2", "rk4") for word in (16, 32, 64)], 2))
    [0, 1, 4, 5, 6, 8]
    """
    left = list(range(len(cases)))
    for _ in range(count):
        chosen = {left[number] for number in covering([cases[k] for k in left])} if left else set()
        left = [k for k in left if k not in chosen]
    return set(range(len(cases))) - set(left)


def mark_combinations(items: Iterable[pytest.Item]) -> None:
    """Mark as long the combinations whose every value is in another test that is not.

    Parameters of one list belong together: each of its rows counts as one value.
    """
    quick = [item for item in items if item.get_closest_marker("long") is None]
    for several, cases in _combinations(quick):
        chosen = {*covering(cases)}
        for number, item in enumerate(several):
            if number not in chosen:
                item.add_marker(pytest.mark.long)


def beyond_two_rounds(items: Iterable[pytest.Item]) -> Iterator[pytest.Item]:
    """Yield the long combinations that remain after every value of every parameter was in two of them.

    A value meets another partner in each round, and the quick tests are a third one. Where every combination has an
    expected value of its own, the mark `every_combination` leaves all of them.
    """
    long = [item for item in items if item.get_closest_marker("long") is not None]
    for several, cases in _combinations(long):
        if several[0].get_closest_marker("every_combination") is not None:
            continue
        chosen = in_rounds(cases, 2)
        yield from (item for number, item in enumerate(several) if number not in chosen)


def _combinations(items: Iterable[pytest.Item]) -> Iterator[tuple[list[pytest.Function], list[list[str]]]]:
    """Yield the cases of every test that has several parameters, with the value of each."""
    tests: dict[Any, list[pytest.Function]] = {}
    for item in items:
        if isinstance(item, pytest.Function) and len(_axes(item)) > 1:
            tests.setdefault(item.function, []).append(item)
    for several in tests.values():
        axes = _axes(several[0])
        yield (
            several,
            [
                [repr([item.callspec.params.get(name) for name in names]) for names in axes]
                for item in several
            ],
        )


def _axes(item: pytest.Function) -> list[tuple[str, ...]]:
    """Return the parameters of a test, those of one list together."""
    names = getattr(getattr(item, "callspec", None), "params", {})
    lists = [mark.args[0] for mark in item.iter_markers("parametrize")]
    together = [
        tuple(part.strip() for part in some.split(",")) if isinstance(some, str) else tuple(some)
        for some in lists
    ]
    listed = {name for some in together for name in some}
    return [*together, *((name,) for name in names if name not in listed)]
