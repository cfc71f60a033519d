"""Gives the wires of a gutter tracks, so that no two lie on each other and few cross."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field


@dataclass
class Straight:
    """A straight part of wires along a gutter."""

    #: Where it begins and ends, along the gutter
    low: float = float("inf")
    high: float = float("-inf")
    #: Where wires leave it towards lower tracks, and towards higher ones
    before: set[float] = field(default_factory=set)
    after: set[float] = field(default_factory=set)

    def reach(self, place: float, is_after: bool) -> None:
        """Extend it to a place where a wire leaves it."""
        self.low, self.high = min(self.low, place), max(self.high, place)
        (self.after if is_after else self.before).add(place)

    def crossings(self, other: Straight) -> int:
        """Return how often wires cross if another stretch has a higher track."""
        here = sum(other.low <= place <= other.high for place in self.after)
        return here + sum(self.low <= place <= self.high for place in other.before)


def tracks(runs: Mapping[Hashable, Straight], apart: float) -> dict[Hashable, int]:
    """Return a track for each stretch: 0 for the first, and so on; the order stays where no other is better."""
    order = _ordered(list(runs), runs)
    numbers: dict[Hashable, int] = {}
    for key in order:
        run = runs[key]
        beside = [
            number
            for other, number in numbers.items()
            if run.low < runs[other].high + apart and runs[other].low < run.high + apart
        ]
        numbers[key] = max(beside, default=-1) + 1
    return numbers


def _ordered(order: list[Hashable], runs: Mapping[Hashable, Straight]) -> list[Hashable]:
    """Return stretches in an order with few crossings: each moves to its best place until nothing gets better."""
    excess = {  # crossings of a before b less those of b before a
        (a, b): runs[a].crossings(runs[b]) - runs[b].crossings(runs[a]) for a in order for b in order
    }
    for _ in range(len(order)):
        earlier = list(order)
        for key in earlier:
            place = order.index(key)
            order.remove(key)
            costs = [sum(excess[key, other] for other in order)]
            for other in order:
                costs.append(costs[-1] + excess[other, key] - excess[key, other])
            order.insert(place if costs[place] == min(costs) else costs.index(min(costs)), key)
        if order == earlier:
            break
    return order
