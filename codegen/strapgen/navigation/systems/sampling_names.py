"""The names of the kernels between stages of different rates, as plain data."""

from __future__ import annotations

from strapgen.ir.kernel_info import Recipe

_MODULE = "strapgen.navigation.systems.sampling"

#: Kernels between stages of different rates, and from counts; they take no method.
SAMPLING = {
    "sum-3": Recipe(
        "sum of increments for a slower cycle",
        _MODULE,
        "increment_sum",
        (),
        False,
    ),
    "hold-3": Recipe(
        "increments shared out to faster cycles",
        _MODULE,
        "held_increment",
        (),
        False,
    ),
    "angle-counts": Recipe(
        "angle increments from counts",
        _MODULE,
        "scaled_counts",
        ("angle",),
        False,
    ),
    "velocity-counts": Recipe(
        "velocity increments from counts",
        _MODULE,
        "scaled_counts",
        ("velocity",),
        False,
    ),
}
