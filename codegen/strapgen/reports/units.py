"""Units in which reports show mean rates to a reader, with the factors to them."""

from __future__ import annotations

import math

#: For each unit of a mean rate the unit that a person reads, and the factor to it.
READABLE_UNITS = {"rad/s": ("deg/h", math.degrees(3600)), "m/s^2": ("micro-g", 1e6 / 9.80665)}
