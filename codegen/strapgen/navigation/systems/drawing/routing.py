"""Leads wires through the gutters between columns and the channels between rows of a drawing."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable

from strapgen.navigation.systems.drawing.drawing_parts import KINDS, TRACK, Box, Link, Way
from strapgen.navigation.systems.drawing.tracks import Straight, tracks

_Net = tuple[str, str, str]


class Routing:
    """Finds the ways of wires. Gutter k is left of column k, channel k above row k.

    All wires of one kind from one port go along one channel, so that they are one line as far as they can be.
    """

    def __init__(self, rows: list[list[Box]], links: list[Link]) -> None:
        self.rows = rows
        self.nets: dict[_Net, list[Link]] = {}
        for link in links:
            self.nets.setdefault(link.net, []).append(link)
        self.channel_tops: dict[int, float] = {}
        self.gutter_sides: dict[int, float] = {}
        self._channel: dict[_Net, int] = {}
        self._level: dict[int, dict[Hashable, int]] = {}
        self._upright: dict[int, dict[Hashable, int]] = {}

    def choose_channels(self) -> None:
        """Choose a channel for each net, where few others are, and a track in it."""
        self._choose_least_crowded()
        runs: dict[int, dict[Hashable, Straight]] = {}
        for net in sorted(self._channel, key=self._nesting):
            channel = self._channel[net]
            source = self.nets[net][0].source[0]
            run = runs.setdefault(channel, {}).setdefault(net, Straight())
            if source.kind:
                run.reach(source.column + 1, source.row >= channel)
            else:
                run.reach(source.column + 0.5, False)
            for link in self.nets[net]:
                destination = link.destination[0]
                if not source.kind or destination.column != source.column + 1:
                    run.reach(destination.column, destination.row >= channel)
        self._level = {channel: tracks(some, 0.2) for channel, some in runs.items()}

    def _nesting(self, net: _Net) -> tuple[int, int]:
        """Return what orders wires that leave a box side by side: to the left, the first is the lowest."""
        links = self.nets[net]
        source, port = links[0].source
        is_left = source.kind and min(link.destination[0].column for link in links) <= source.column
        sign = -1 if is_left else 1
        place = source.outputs.index(port) * len(KINDS) + port.kinds.index(net[2])
        return sign * source.row, sign * place

    def channel_tracks(self, channel: int) -> int:
        """Return how many tracks a channel has."""
        return max(self._level.get(channel, {}).values(), default=-1) + 1

    def choose_gutters(self) -> None:
        """Choose a track for each wire in each gutter; rows and channels have their places now."""
        runs: dict[int, dict[Hashable, Straight]] = {}
        for net, links in self.nets.items():
            source, port = links[0].source
            leave = source.column + 1
            for link in links:
                destination, end = link.destination
                run = runs.setdefault(destination.column, {}).setdefault(net, Straight())
                run.reach(end.y, True)
                if net in self._channel and (destination.column != leave or not source.kind):
                    place = source.column + 0.5 if not source.kind else leave
                    run.reach(self._height(net), place > destination.column)
            if source.kind:
                run = runs.setdefault(leave, {}).setdefault(net, Straight())
                run.reach(port.start(net[2]), False)
                for link in links:
                    if link.destination[0].column != leave:
                        run.reach(self._height(net), link.destination[0].column > leave)
        self._upright = {gutter: tracks(some, TRACK) for gutter, some in runs.items()}

    def gutter_tracks(self, gutter: int) -> int:
        """Return how many tracks a gutter has."""
        return max(self._upright.get(gutter, {}).values(), default=-1) + 1

    def ways(self) -> list[Way]:
        """Return the ways of all wires, once everything has its place."""
        return [Way(link, tuple(self._points(link))) for links in self.nets.values() for link in links]

    def _points(self, link: Link) -> list[tuple[float, float]]:
        """Return the corners of a wire."""
        (source, start), (destination, end) = link.source, link.destination
        x = self._side(destination.column, link.net)
        if not source.kind:
            y = self._height(link.net)
            return [(start.x, start.y), (start.x, y), (x, y), (x, end.y), (end.x, end.y)]
        first = (start.x, start.start(link.kind))
        if destination.column == source.column + 1:
            return [first, (x, first[1]), (x, end.y), (end.x, end.y)]
        turn, y = self._side(source.column + 1, link.net), self._height(link.net)
        return [first, (turn, first[1]), (turn, y), (x, y), (x, end.y), (end.x, end.y)]

    def _height(self, net: _Net) -> float:
        channel = self._channel[net]
        return self.channel_tops[channel] + TRACK * self._level[channel][net]

    def _side(self, gutter: int, net: _Net) -> float:
        return self.gutter_sides[gutter] + TRACK * self._upright[gutter][net]

    def _choose_least_crowded(self) -> None:
        """Choose the channel of each net in turn, twice, by how many wires are on the way already."""
        passing: Counter[tuple[int, int, int]] = Counter()
        for _ in range(2):
            for net, links in self.nets.items():
                source = links[0].source[0]
                if net in self._channel:
                    passing.subtract(self._cells(net, self._channel[net]))
                if not source.kind:
                    self._channel[net] = source.row + 1
                elif any(link.destination[0].column != source.column + 1 for link in links):
                    self._channel[net] = self._best_channel(net, passing)
                else:
                    continue
                passing.update(self._cells(net, self._channel[net]))

    def _best_channel(self, net: _Net, passing: Counter[tuple[int, int, int]]) -> int:
        """Return the channel whose way is the shortest, where each wire beside it counts as more way."""
        links = self.nets[net]
        rows = [links[0].source[0].row, *(link.destination[0].row for link in links)]
        first = min((box.row for row in self.rows for box in row if box.kind), default=0)
        costs = []
        for channel in range(max(first, min(rows)), max(rows) + 2):
            cells = self._cells(net, channel)
            back = 1 if (net[2] == "delayed") == (channel == min(rows)) and len(set(rows)) == 1 else 0
            costs.append((sum(12 + passing[cell] for cell in cells) + 6 * back, channel))
        return min(costs)[1]

    def _cells(self, net: _Net, channel: int) -> set[tuple[int, int, int]]:
        """Return the parts of gutters (0, column, row) and channels (1, channel, column) that a net passes."""
        links = self.nets[net]
        source = links[0].source[0]
        uprights = {(link.destination[0].column, link.destination[0].row) for link in links}
        if source.kind:
            uprights.add((source.column + 1, source.row))
        cells = {
            (0, column, between)
            for column, row in uprights
            for between in (range(channel, row + 1) if row >= channel else range(row, channel))
        }
        places = [column for column, _ in uprights] + ([] if source.kind else [source.column])
        return cells | {(1, channel, column) for column in range(min(places), max(places))}
