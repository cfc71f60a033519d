"""The orders in which the steps of a run are multiplied."""

from __future__ import annotations

#: One step after the other, the default; or in blocks, whose products are multiplied then.
SEQUENTIAL = "sequential"
ORDERS = (SEQUENTIAL, "scan")
#: Back ends whose code has the order "scan".
SCANNING = ("c", "c-float")
